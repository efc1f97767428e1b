#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "global_map_builder/closure.h"
#include "global_map_builder/drive_recorder.h"
#include "global_map_builder/map_builder_config.h"
#include "global_map_builder/map_changes.h"
#include "global_map_builder/map_contour.h"
#include "global_map_builder/map_directory.h"
#include "global_map_builder/map_record.h"

namespace knav {

struct BuiltMap {
  MapDirectory map;  ///< with the corrected trajectory; the first drive's start pose is the origin
  Contour contour;
  PoseGraph graph;
  MapRecord record;                ///< drives, their keyframes in the map, closures
  Trajectory drive, odometry;      ///< of the newest drive, uncorrected, from the origin
  OccupancyGrid before;            ///< coarse: without closures and refinement
  std::vector<MapChange> changes;  ///< against the map that was extended
  int old_drives = 0;              ///< of the map that was extended
  int settled_keyframes = 0;       ///< of a scanner, that stood turned wrongly
  int mended_steps = 0;            ///< where the mapper jumped
  std::size_t fitted_pairs = 0;    ///< of keyframes, in the joint refinement; 0 if it was not kept
  std::map<std::string, double> stage_s;
};

/// A line of the user's allow / deny list; the pair is named by the keyframes' stamps.
struct ListedClosure {
  int from_drive = 0, to_drive = 0;
  double from_stamp_s = 0.0, to_stamp_s = 0.0;
  bool allow = false;
  bool has_transform = false;
  Pose2 T_from_to;
  std::string where;  ///< file and entry, for messages
};

/// From recordings to a global map (paper section III.G): the local mapper's trajectory, closures, robust
/// graph optimisation, one signed distance grid from the corrected trajectory, its contour and the true
/// distance to it. Not thread safe. The same calls give the same bytes.
class MapBuilder {
 public:
  MapBuilder(const MapBuilderConfig& config, const LocalMapperConfig& mapper);

  /// A map to add to: its frame and its drives stay as they are. Before the first observation.
  void extend(MapRecord record, MapDirectory map);
  /// The drives of a record instead of observations: closures and map are made anew.
  void build_again(MapRecord record) { drives_ = std::move(record.drives); }
  /// What follows is another drive, that began anywhere, at any time. Needed before the second only.
  void begin_drive(const std::string& name);

  // In the order of stamps, odometry a little ahead of the observations.
  void add_odometry(double stamp_s, const Pose2& T_odom_base) {
    recorder_->add_odometry(stamp_s, T_odom_base);
  }
  void add(const DepthProfile& profile, const Pose2& T_base_camera) {
    recorder_->add(profile, T_base_camera);
  }
  void add(const RangeScan& scan, const Pose2& T_base_sensor) { recorder_->add(scan, T_base_sensor); }
  /// The button: the robot stands at a marked place. Marks of one place close a loop.
  void mark(double stamp_s) { recorder_->mark(stamp_s); }

  /// Of the drive that is being recorded.
  const Drive& drive() const { return recorder_->drive(); }
  /// UserError from build() if a pair is unknown.
  void set_list(std::vector<ListedClosure> list) { list_ = std::move(list); }

  /// @param progress stage and the fraction of it done; may throw to stop
  /// UserError if nothing that can be mapped was added, or if a drive shares no place with the others. Call
  /// once.
  BuiltMap build(const std::function<void(const char* stage, double fraction)>& progress = {});

 private:
  void end_drive();

  MapBuilderConfig config_;
  LocalMapperConfig mapper_;
  std::unique_ptr<DriveRecorder> recorder_;
  std::vector<Drive> drives_;
  MapRecord old_;
  MapDirectory old_map_;
  std::vector<ListedClosure> list_;
};

}  // namespace knav
