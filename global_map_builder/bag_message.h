#pragma once

#include <fmt/format.h>
#include <ros/message_traits.h>
#include <rosbag/message_instance.h>

#include <boost/shared_ptr.hpp>
#include <exception>

#include "core/error.h"
#include "ros_common/bag_reader.h"

namespace knav {

/// UserError if the message is malformed or of another type; names the topic.
template <class Message>
boost::shared_ptr<const Message> instantiate(const BagReader& bag, const rosbag::MessageInstance& message) {
  boost::shared_ptr<const Message> out;
  try {
    out = message.instantiate<Message>();
  } catch (const std::exception& error) {
    throw UserError(fmt::format("{}: a message on '{}' is malformed ({}).", bag.path(), message.getTopic(),
                                error.what()));
  }
  if (!out) {
    throw UserError(fmt::format("{}: topic '{}' has type {}, expected {}.", bag.path(), message.getTopic(),
                                message.getDataType(), ros::message_traits::datatype<Message>()));
  }
  return out;
}

}  // namespace knav
