#pragma once

#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <functional>
#include <string>
#include <vector>

namespace knav {

/// Reads recordings without a master, with faults in words.
class BagReader {
 public:
  /// UserError if the file is missing, empty, truncated or not a bag (with what to do: rosbag reindex).
  explicit BagReader(const std::string& path);

  const std::string& path() const { return path_; }
  bool has_topic(const std::string& topic) const;
  /// The topics of a message type such as "sensor_msgs/Image"; each with a leading slash.
  std::vector<std::string> topics_of_type(const std::string& datatype) const;
  /// UserError that names the missing topic and lists those the bag has.
  void require_topic(const std::string& topic) const;

  /// Every message of the topics, in the order of recording, with progress in [0, 1]; stops on Ctrl-C. A damaged
  /// chunk is a UserError.
  void for_each(const std::vector<std::string>& topics,
                const std::function<void(const rosbag::MessageInstance&, double progress)>& visit) const;

 private:
  std::string path_;
  mutable rosbag::Bag bag_;
};

}  // namespace knav
