#pragma once

#include <vector>

#include "core/pose2.h"
#include "planner_tracker/map_layer.h"

namespace knav {

/// Somebody who was seen walking, in the map.
struct Walker {
  Point2 at;
  Point2 v_mps;
};

/// True if a camera of 57 degrees that looks ahead has this point of the robot's frame in view, and it lies between these distances.
bool in_view(const Point2& in_robot, double from_m, double to_m);
/// The same for a point of the map, not too near and not too far for somebody to be made out.
bool in_view(const Pose2& T_map_robot, const Point2& at);

/// Follows who walks, and says where he is to be expected once the robot looks elsewhere: a Kinect sees a sixth of what is
/// round the robot, and the local map has him where he was seen last.
class Walkers {
 public:
  /// @param may_stand_s  see may_stand_at()
  explicit Walkers(double may_stand_s) : may_stand_s_(may_stand_s) {}

  void clear() {
    tracks_.clear();
    lost_.clear();
  }
  /// Call after every new local map. @param moving  see MovingCells @param layer  the combined map
  void update(const std::vector<Point2>& moving, const MapLayer& layer, const Pose2& T_map_robot, double now_s);
  /// Where they are expected now: whoever was seen walking within `memory_s`, straight on at his speed.
  void expected(double now_s, double memory_s, std::vector<Walker>* walkers) const;
  /// Middles of places, each as wide as somebody, where one who walked out of view may have stopped: from where he was seen last on for
  /// the next half second of his way. Until they are seen again, for `may_stand_s` at most; the local map has none of them.
  const std::vector<Point2>& may_stand_at() const { return may_stand_at_; }

 private:
  struct Track {
    Point2 at, v_mps;
    Point2 began_at;
    double seen_s;
    bool walks = false;  ///< has left where he began, so it is no furniture that comes into view bit by bit
  };
  void cluster(const std::vector<Point2>& moving);
  static Point2 at(const Track& track, double now_s);
  void lose(const Pose2& T_map_robot, double now_s);

  double may_stand_s_;
  std::vector<Track> tracks_;
  std::vector<Track> lost_;  ///< walked out of view
  std::vector<Point2> may_stand_at_;
  std::vector<Point2> clusters_;  ///< their middles
  std::vector<std::size_t> open_, left_;  ///< scratch of cluster()
};

}  // namespace knav
