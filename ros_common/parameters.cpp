#include "ros_common/parameters.h"

namespace knav {
namespace {

YAML::Node to_yaml(XmlRpc::XmlRpcValue& value) {
  using Value = XmlRpc::XmlRpcValue;
  switch (value.getType()) {
    case Value::TypeBoolean:
      return YAML::Node(static_cast<bool>(value));
    case Value::TypeInt:
      return YAML::Node(static_cast<int>(value));
    case Value::TypeDouble:
      return YAML::Node(static_cast<double>(value));
    case Value::TypeString:
      return YAML::Node(static_cast<std::string>(value));
    case Value::TypeArray: {
      YAML::Node list(YAML::NodeType::Sequence);
      for (int i = 0; i < value.size(); ++i) list.push_back(to_yaml(value[i]));
      return list;
    }
    case Value::TypeStruct: {
      YAML::Node map(YAML::NodeType::Map);
      for (auto& entry : value) map[entry.first] = to_yaml(entry.second);
      return map;
    }
    default:
      return YAML::Node();
  }
}

}  // namespace

YAML::Node parameters_as_yaml(const ros::NodeHandle& private_handle) {
  XmlRpc::XmlRpcValue value;
  if (!private_handle.getParam(private_handle.getNamespace(), value)) return YAML::Node(YAML::NodeType::Map);
  return to_yaml(value);
}

}  // namespace knav
