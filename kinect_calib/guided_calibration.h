#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/pose2.h"
#include "kinect_calib/guided_calibration_config.h"
#include "kinect_calib/square_bias.h"
#include "kinect_calib/standing_range.h"
#include "kinect_calib/wall_viewer.h"

namespace knav {

/// What holds for the whole calibration.
struct GuidedStart {
  bool behind_is_free = false;  ///< somebody has looked: the robot backs off blind
  bool range_finder = true;     ///< false: each distance is asked for
  double range_offset_m = 0.0;  ///< added to each range to get the camera's distance
  std::vector<double> done_m;   ///< distances that an earlier, broken calibration finished
  std::string depth_topic = "depth", odometry_topic = "odom", range_topic = "range";  ///< for sentences
};

/// What came since the last step.
struct GuidedInput {
  double now_s = 0.0;
  bool new_frame = false;
  double depth_stamp_s = -std::numeric_limits<double>::infinity();
  SeenWall wall;  ///< of the newest frame
  double odometry_stamp_s = -std::numeric_limits<double>::infinity();
  Pose2 T_odom_base;
  std::vector<double> ranges_m;
  std::optional<double> typed_m;  ///< the answer while the state is kAsk
};

/// One distance, finished.
struct GuidedDistance {
  double distance_m = 0.0, sd_m = 0.0;
  int readings = 0;  ///< of the range finder; 0: typed
  double depth_m = 0.0, off_square_deg = 0.0;
};

enum class GuidedState { kWait, kSquareUp, kSettle, kMove, kCollect, kAsk, kSwing, kPaused, kDone, kFailed };

/// What to do now.
struct GuidedStep {
  double forward_mps = 0.0, turn_radps = 0.0;
  GuidedState state = GuidedState::kWait;
  std::string text;          ///< what it does, or why it stands
  std::string notice;        ///< once: why a distance is measured again, what a swing gave
  bool keep_frame = false;   ///< the newest frame belongs to this distance
  bool drop_frames = false;  ///< those kept so far do not
  /// The frames kept are at this distance: call accept() or refuse() before the next step.
  std::optional<GuidedDistance> finished;
};

/// Takes a robot through the distances of a depth calibration (paper section III.B): square to the wall,
/// stand, collect, 5-15 % further back, and so on. It drives by odometry and checks that by depth, and stands
/// whenever it does not know what goes on.
class GuidedCalibration {
 public:
  GuidedCalibration(const GuidedCalibrationConfig& config, GuidedStart start);

  GuidedStep step(const GuidedInput& input);
  void accept();
  /// @param why a sentence; the distance is measured again, and after three times it ends
  void refuse(const std::string& why);

  int finished_count() const { return finished_; }
  int total_count() const;
  double target_m() const { return target_m_; }
  const SquareBias& square_bias() const { return square_bias_; }

 private:
  void enter(GuidedState state);
  std::string trouble(const GuidedInput& input) const;
  bool stopped_by_trouble(const GuidedInput& input);
  void fail(const std::string& why);
  void square_up(const GuidedInput& input, GuidedStep* step);
  void settle(const GuidedInput& input);
  void start_moving();
  void move(const GuidedInput& input, GuidedStep* step);
  void collect(const GuidedInput& input, GuidedStep* step);
  void ask(const GuidedInput& input, GuidedStep* step);
  enum class SwingPhase { kLeft, kRight, kBack };
  void start_swing();
  void swing_to(SwingPhase phase);
  void swing(const GuidedInput& input, GuidedStep* step);
  void finish(double distance_m, int readings, GuidedStep* step);
  double turn_towards_square(double yaw_rad) const;
  double off_square_rad(const GuidedInput& input) const;
  double here_m(const GuidedInput& input) const;
  bool has_moved(const GuidedInput& input, double patience) const;

  GuidedCalibrationConfig config_;
  GuidedStart start_;
  GuidedState state_ = GuidedState::kWait;
  std::string text_, notice_;
  double now_s_ = 0.0, entered_s_ = 0.0;
  bool started_ = false;

  int finished_ = 0, refused_ = 0;
  double last_finished_m_ = 0.0, finishing_m_ = 0.0, target_m_ = 0.0;

  // Where the newest distance was known: what odometry drives on from.
  bool anchored_ = false;
  double anchor_m_ = 0.0, anchor_depth_m_ = 0.0;
  Pose2 T_odom_anchor_;

  double square_since_s_ = 0.0, square_from_rad_ = 0.0;
  double turn_radps_ = 0.0;

  // Standing: means since the robot has come to rest.
  double sum_yaw_rad_ = 0.0, sum_depth_m_ = 0.0;
  int stood_frames_ = 0;
  Pose2 T_odom_stood_;
  double off_square_deg_ = 0.0, stood_depth_m_ = 0.0;

  double checked_s_ = 0.0;
  Pose2 T_odom_checked_;
  int moves_ = 0, direction_ = 0;  // direction_: 1 forward, -1 back, 0 not yet under way

  StandingRange ranges_;
  double newest_range_s_ = -std::numeric_limits<double>::infinity();
  int frames_ = 0;

  SquareBias square_bias_;
  Swing swing_;
  SwingPhase swing_phase_ = SwingPhase::kLeft;
  bool swing_standing_ = false;
  double swing_since_s_ = 0.0;

  double trouble_since_s_ = -1.0, calm_since_s_ = -1.0;
  bool drop_ = false;
};

const char* name_of(GuidedState state);

}  // namespace knav
