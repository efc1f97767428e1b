#pragma once

#include <ros/node_handle.h>

#include "core/config.h"

namespace knav {

/// All parameters of a namespace as a YAML map.
YAML::Node parameters_as_yaml(const ros::NodeHandle& private_handle);

/// A node's private parameters as its config struct; UserError lists every fault, unknown keys included.
template <class Config>
Config read_parameters(const ros::NodeHandle& private_handle) {
  return read_config<Config>(parameters_as_yaml(private_handle), private_handle.getNamespace());
}

}  // namespace knav
