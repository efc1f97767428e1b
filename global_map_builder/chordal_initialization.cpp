#include <Eigen/Geometry>
#include <Eigen/Sparse>
#include <algorithm>
#include <complex>
#include <unordered_map>

#include "core/error.h"
#include "global_map_builder/graph_optimizer.h"

namespace knav {
namespace {

using Complex = std::complex<double>;

/// Nodes as rows: anchors are known (row -1), the others unknowns 0 ... n-1.
struct Rows {
  std::unordered_map<int, int> of;
  int count = 0;
};

Rows number_unknowns(const PoseGraph& graph) {
  const std::vector<int> anchors = anchor_nodes(graph);
  Rows rows;
  for (const int anchor : anchors) rows.of[anchor] = -1;
  for (const auto& [id, pose] : graph.nodes) {
    if (rows.of.count(id) == 0) rows.of[id] = rows.count++;
  }
  return rows;
}

void solve_headings(const Rows& rows, PoseGraph* graph) {
  // min sum k |z_to - z_from e^(i a)|^2 over complex z, the anchors' z known.
  std::vector<Eigen::Triplet<Complex>> terms;
  Eigen::VectorXcd right = Eigen::VectorXcd::Zero(rows.count);
  for (const PoseGraphEdge& edge : graph->edges) {
    const double k = edge.information(2, 2);
    const Complex turn = std::polar(1.0, edge.T_from_to.yaw_rad);
    const int i = rows.of.at(edge.from), j = rows.of.at(edge.to);
    if (i >= 0) terms.emplace_back(i, i, k);
    if (j >= 0) terms.emplace_back(j, j, k);
    if (i >= 0 && j >= 0) {
      terms.emplace_back(j, i, -k * turn);
      terms.emplace_back(i, j, -k * std::conj(turn));
    } else if (j >= 0) {
      right(j) += k * turn * std::polar(1.0, graph->nodes.at(edge.from).yaw_rad);
    } else if (i >= 0) {
      right(i) += k * std::conj(turn) * std::polar(1.0, graph->nodes.at(edge.to).yaw_rad);
    }
  }
  Eigen::SparseMatrix<Complex> matrix(rows.count, rows.count);
  matrix.setFromTriplets(terms.begin(), terms.end());
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<Complex>> solver(matrix);
  if (solver.info() != Eigen::Success) return;
  const Eigen::VectorXcd z = solver.solve(right);
  for (auto& [id, pose] : graph->nodes) {
    const int row = rows.of.at(id);
    if (row >= 0 && std::abs(z(row)) > 1e-12) pose.yaw_rad = std::arg(z(row));
  }
}

void solve_positions(const Rows& rows, PoseGraph* graph) {
  std::vector<Eigen::Triplet<double>> terms;
  Eigen::VectorXd right = Eigen::VectorXd::Zero(2 * rows.count);
  const auto add_block = [&](int row, int column, const Eigen::Matrix2d& m) {
    for (int r = 0; r < 2; ++r) {
      for (int c = 0; c < 2; ++c) terms.emplace_back(2 * row + r, 2 * column + c, m(r, c));
    }
  };
  for (const PoseGraphEdge& edge : graph->edges) {
    const Pose2& from = graph->nodes.at(edge.from);
    const Pose2& to = graph->nodes.at(edge.to);
    // In map axes: t_to - t_from = R_from t_measured, weighted by the information turned into map axes.
    const Eigen::Matrix2d R_from = Eigen::Rotation2Dd(from.yaw_rad).toRotationMatrix();
    const Eigen::Matrix2d R = R_from * Eigen::Rotation2Dd(edge.T_from_to.yaw_rad).toRotationMatrix();
    const Eigen::Matrix2d weight = R * edge.information.topLeftCorner<2, 2>() * R.transpose();
    const Eigen::Vector2d step = R_from * Eigen::Vector2d(edge.T_from_to.x_m, edge.T_from_to.y_m);
    const int i = rows.of.at(edge.from), j = rows.of.at(edge.to);
    if (i >= 0) {
      add_block(i, i, weight);
      right.segment<2>(2 * i) -= weight * step;
    }
    if (j >= 0) {
      add_block(j, j, weight);
      right.segment<2>(2 * j) += weight * step;
    }
    if (i >= 0 && j >= 0) {
      add_block(i, j, -weight);
      add_block(j, i, -weight);
    } else if (i >= 0) {
      right.segment<2>(2 * i) += weight * Eigen::Vector2d(to.x_m, to.y_m);
    } else if (j >= 0) {
      right.segment<2>(2 * j) += weight * Eigen::Vector2d(from.x_m, from.y_m);
    }
  }
  Eigen::SparseMatrix<double> matrix(2 * rows.count, 2 * rows.count);
  matrix.setFromTriplets(terms.begin(), terms.end());
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
  if (solver.info() != Eigen::Success) return;
  const Eigen::VectorXd t = solver.solve(right);
  for (auto& [id, pose] : graph->nodes) {
    const int row = rows.of.at(id);
    if (row < 0) continue;
    pose.x_m = t(2 * row);
    pose.y_m = t(2 * row + 1);
  }
}

}  // namespace

std::vector<int> anchor_nodes(const PoseGraph& graph) {
  std::unordered_map<int, int> parent;
  for (const auto& [id, pose] : graph.nodes) parent[id] = id;
  const auto root = [&parent](int id) {
    while (parent.at(id) != id) id = parent[id] = parent[parent[id]];
    return id;
  };
  for (const PoseGraphEdge& edge : graph.edges) {
    if (parent.count(edge.from) == 0 || parent.count(edge.to) == 0) {
      throw UserError("pose graph: an edge joins " + std::to_string(edge.from) + " and " +
                      std::to_string(edge.to) + ", but not both are nodes.");
    }
    const int a = root(edge.from), b = root(edge.to);
    parent[std::max(a, b)] = std::min(a, b);
  }
  std::vector<int> anchors;
  for (const auto& [id, pose] : graph.nodes) {
    if (root(id) == id) anchors.push_back(id);
  }
  return anchors;
}

void initialize_chordal(PoseGraph* graph) {
  const Rows rows = number_unknowns(*graph);
  if (rows.count == 0) return;
  solve_headings(rows, graph);
  solve_positions(rows, graph);
}

}  // namespace knav
