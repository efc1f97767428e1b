#include "ros_common/bag_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "ros_common/program.h"

namespace knav {
namespace {

std::string without_slash(const std::string& topic) { return topic.substr(topic.rfind('/', 0) == 0 ? 1 : 0); }

}  // namespace

BagReader::BagReader(const std::string& path) : path_(path) {
  std::error_code failed;
  if (!std::filesystem::is_regular_file(path, failed)) {
    throw UserError(path + ": no such file; give the path of a bag.");
  }
  if (std::filesystem::file_size(path, failed) == 0) throw UserError(path + ": the file is empty.");
  try {
    bag_.open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagUnindexedException&) {
    throw UserError(path + ": the bag was not closed properly; mend it with 'rosbag reindex'.");
  } catch (const std::exception& error) {
    throw UserError(fmt::format("{}: not a readable bag ({}); if it was cut off, try 'rosbag reindex'.", path,
                                error.what()));
  }
  if (rosbag::View(bag_).size() == 0) throw UserError(path + ": the bag holds no messages.");
}

bool BagReader::has_topic(const std::string& topic) const {
  rosbag::View view(bag_);
  const auto connections = view.getConnections();
  return std::any_of(connections.begin(), connections.end(), [&](const rosbag::ConnectionInfo* connection) {
    return without_slash(connection->topic) == without_slash(topic);
  });
}

std::vector<std::string> BagReader::topics_of_type(const std::string& datatype) const {
  rosbag::View view(bag_);
  std::vector<std::string> topics;
  for (const rosbag::ConnectionInfo* connection : view.getConnections()) {
    if (connection->datatype == datatype) topics.push_back("/" + without_slash(connection->topic));
  }
  std::sort(topics.begin(), topics.end());
  topics.erase(std::unique(topics.begin(), topics.end()), topics.end());
  return topics;
}

void BagReader::require_topic(const std::string& topic) const {
  if (has_topic(topic)) return;
  rosbag::View view(bag_);
  std::vector<std::string> topics;
  for (const rosbag::ConnectionInfo* connection : view.getConnections()) topics.push_back(connection->topic);
  throw UserError(
      fmt::format("{}: topic '{}' is missing; the bag has {}.", path_, topic, fmt::join(topics, ", ")));
}

void BagReader::for_each(const std::vector<std::string>& topics,
                         const std::function<void(const rosbag::MessageInstance&, double)>& visit) const {
  std::vector<std::string> both;
  for (const std::string& topic : topics) {
    both.push_back("/" + without_slash(topic));
    both.push_back(without_slash(topic));
  }
  rosbag::View view(bag_, rosbag::TopicQuery(both));
  const double count = std::max<double>(1.0, view.size());
  double done = 0.0;
  try {
    for (const rosbag::MessageInstance& message : view) {
      stop_if_interrupted();
      visit(message, done / count);
      done += 1.0;
    }
  } catch (const rosbag::BagException& error) {
    throw UserError(fmt::format("{}: damaged after message {:.0f} ({}).", path_, done, error.what()));
  }
}

}  // namespace knav
