#pragma once

#include <Eigen/Core>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "core/pose2.h"

namespace knav {

/// A measured relative pose. Error e = (position, heading) of T_measured^-1 * (T_map_from^-1 * T_map_to),
/// i.e. in the measured frame of `to` as g2o defines it; it counts e' information e.
struct PoseGraphEdge {
  int from = 0, to = 0;
  Pose2 T_from_to;
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity();  ///< (x [m], y [m], yaw [rad])
  bool robust = false;  ///< a closure, which may be wrong: gets the robust loss
};

struct PoseGraph {
  std::map<int, Pose2> nodes;  ///< T_map_node
  std::vector<PoseGraphEdge> edges;
  std::set<int> held;  ///< nodes that the optimiser leaves where they are
};

/// g2o's VERTEX_SE2 / EDGE_SE2, or TORO's VERTEX2 / EDGE2, told apart by the tags. Nodes that only edges name
/// start from the edge. UserError names file and line.
PoseGraph read_pose_graph(const std::string& path);
/// g2o; atomic.
void write_pose_graph(const std::string& path, const PoseGraph& graph);

/// The edge's error at the given poses.
Eigen::Vector3d edge_error(const PoseGraphEdge& edge, const Pose2& T_map_from, const Pose2& T_map_to);
double edge_chi2(const PoseGraphEdge& edge, const Pose2& T_map_from, const Pose2& T_map_to);
/// Sum of e' information e over all edges, without robust loss and without a factor 1/2.
double chi2(const PoseGraph& graph);

}  // namespace knav
