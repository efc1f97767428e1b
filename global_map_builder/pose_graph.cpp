#include "global_map_builder/pose_graph.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <fstream>
#include <sstream>

#include "core/error.h"
#include "core/file_io.h"

namespace knav {
namespace {

enum class Order { kG2o, kToro };

struct LineReader {
  const std::string& path;
  int line_number = 0;
  [[noreturn]] void fail(const std::string& what) const {
    throw UserError(fmt::format("{}: line {}: {}.", path, line_number, what));
  }
  void numbers(std::istringstream& words, double* value, int count) const {
    for (int i = 0; i < count; ++i) {
      if (!(words >> value[i]) || !std::isfinite(value[i]))
        fail(fmt::format("needs {} finite numbers here", count));
    }
  }
};

Eigen::Matrix3d information_from(const double* v, Order order) {
  Eigen::Matrix3d m;
  if (order == Order::kG2o) {  // xx xy xt yy yt tt
    m << v[0], v[1], v[2], v[1], v[3], v[4], v[2], v[4], v[5];
  } else {  // xx xy yy tt xt yt
    m << v[0], v[1], v[4], v[1], v[2], v[5], v[4], v[5], v[3];
  }
  return m;
}

PoseGraphEdge read_edge(const LineReader& reader, std::istringstream& words, Order order) {
  PoseGraphEdge edge;
  if (!(words >> edge.from >> edge.to)) reader.fail("an edge needs two node numbers");
  if (edge.from == edge.to) reader.fail("an edge joins a node with itself");
  double v[9];
  reader.numbers(words, v, 9);
  edge.T_from_to = {v[0], v[1], normalize_angle_rad(v[2])};
  edge.information = information_from(v + 3, order);
  if (Eigen::LLT<Eigen::Matrix3d>(edge.information).info() != Eigen::Success) {
    reader.fail("the information matrix is not positive definite");
  }
  return edge;
}

}  // namespace

PoseGraph read_pose_graph(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw UserError(path + ": cannot be read.");
  PoseGraph graph;
  LineReader reader{path};
  std::string line;
  while (std::getline(file, line)) {
    ++reader.line_number;
    std::istringstream words(line);
    std::string tag;
    if (!(words >> tag) || tag[0] == '#') continue;
    if (tag == "VERTEX_SE2" || tag == "VERTEX2") {
      int id = 0;
      double v[3];
      if (!(words >> id)) reader.fail("a vertex needs a number");
      reader.numbers(words, v, 3);
      if (!graph.nodes.emplace(id, Pose2{v[0], v[1], normalize_angle_rad(v[2])}).second) {
        reader.fail(fmt::format("vertex {} was given before", id));
      }
    } else if (tag == "EDGE_SE2" || tag == "EDGE2") {
      graph.edges.push_back(read_edge(reader, words, tag == "EDGE2" ? Order::kToro : Order::kG2o));
    } else if (tag != "FIX" && tag != "EQUIV") {
      reader.fail(fmt::format(
          "'{}' is not known; only VERTEX_SE2, EDGE_SE2 (g2o), VERTEX2 and EDGE2 (TORO) are", tag));
    }
  }
  if (graph.edges.empty()) throw UserError(path + ": no edges; expected a 2D pose graph of g2o or TORO.");
  for (const PoseGraphEdge& edge : graph.edges) {
    const auto from = graph.nodes.emplace(edge.from, Pose2{}).first;
    graph.nodes.emplace(edge.to, from->second * edge.T_from_to);
  }
  return graph;
}

void write_pose_graph(const std::string& path, const PoseGraph& graph) {
  std::string text;
  for (const auto& [id, pose] : graph.nodes) {
    text += fmt::format("VERTEX_SE2 {} {:.9g} {:.9g} {:.9g}\n", id, pose.x_m, pose.y_m, pose.yaw_rad);
  }
  for (const PoseGraphEdge& edge : graph.edges) {
    const auto& m = edge.information;
    text += fmt::format("EDGE_SE2 {} {} {:.9g} {:.9g} {:.9g} {:.9g} {:.9g} {:.9g} {:.9g} {:.9g} {:.9g}\n",
                        edge.from, edge.to, edge.T_from_to.x_m, edge.T_from_to.y_m, edge.T_from_to.yaw_rad,
                        m(0, 0), m(0, 1), m(0, 2), m(1, 1), m(1, 2), m(2, 2));
  }
  write_text_atomically(path, text);
}

Eigen::Vector3d edge_error(const PoseGraphEdge& edge, const Pose2& T_map_from, const Pose2& T_map_to) {
  const Pose2 error = edge.T_from_to.inverse() * (T_map_from.inverse() * T_map_to);
  return {error.x_m, error.y_m, error.yaw_rad};
}

double edge_chi2(const PoseGraphEdge& edge, const Pose2& T_map_from, const Pose2& T_map_to) {
  const Eigen::Vector3d e = edge_error(edge, T_map_from, T_map_to);
  return e.dot(edge.information * e);
}

double chi2(const PoseGraph& graph) {
  double sum = 0.0;
  for (const PoseGraphEdge& edge : graph.edges) {
    sum += edge_chi2(edge, graph.nodes.at(edge.from), graph.nodes.at(edge.to));
  }
  return sum;
}

}  // namespace knav
