#include "global_map_builder/graph_optimizer.h"

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <array>
#include <chrono>
#include <cmath>
#include <memory>

namespace knav {
namespace {

/// Dynamic covariance scaling (Agarwal et al., ICRA 2013) as a loss: quadratic to phi, then levelling off at
/// 3 phi.
class DcsLoss final : public ceres::LossFunction {
 public:
  explicit DcsLoss(double phi) : phi_(phi) {}
  void Evaluate(double s, double rho[3]) const override {
    if (s <= phi_) {
      rho[0] = s, rho[1] = 1.0, rho[2] = 0.0;
      return;
    }
    const double sum = s + phi_;
    rho[0] = phi_ * (3.0 * s - phi_) / sum;
    rho[1] = 4.0 * phi_ * phi_ / (sum * sum);
    rho[2] = -2.0 * rho[1] / sum;
  }

 private:
  double phi_;
};

/// sqrt(information) * edge_error, with its derivatives.
class EdgeCost final : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  explicit EdgeCost(const PoseGraphEdge& edge)
      : edge_(edge), root_(Eigen::LLT<Eigen::Matrix3d>(edge.information).matrixU()) {}

  bool Evaluate(double const* const* p, double* residuals, double** jacobians) const override {
    const double* a = p[0];
    const double* b = p[1];
    const double heading = a[2] + edge_.T_from_to.yaw_rad;
    const double c = std::cos(heading), s = std::sin(heading);
    const double ca = std::cos(a[2]), sa = std::sin(a[2]);
    const double dx = b[0] - a[0], dy = b[1] - a[1];
    // Position error in map axes, then turned by minus (heading of from + measured turn).
    const double ex = dx - ca * edge_.T_from_to.x_m + sa * edge_.T_from_to.y_m;
    const double ey = dy - sa * edge_.T_from_to.x_m - ca * edge_.T_from_to.y_m;
    const Eigen::Vector3d e(c * ex + s * ey, -s * ex + c * ey, std::remainder(b[2] - heading, 2.0 * kPi));
    Eigen::Map<Eigen::Vector3d>{residuals} = root_ * e;
    if (jacobians == nullptr) return true;
    using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    if (jacobians[0] != nullptr) {
      // d e / d yaw_from: the measured part does not move in its own axes, so only the step (dx, dy) turns.
      Eigen::Matrix3d J;
      J << -c, -s, -s * dx + c * dy, s, -c, -c * dx - s * dy, 0.0, 0.0, -1.0;
      Eigen::Map<RowMajor3>{jacobians[0]} = root_ * J;
    }
    if (jacobians[1] != nullptr) {
      Eigen::Matrix3d J;
      J << c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0;
      Eigen::Map<RowMajor3>{jacobians[1]} = root_ * J;
    }
    return true;
  }

 private:
  PoseGraphEdge edge_;
  Eigen::Matrix3d root_;
};

struct Outcome {
  double cost = 0.0;
  int iterations = 0;
};

Outcome solve(const GraphOptimizerConfig& config, PoseGraph* graph) {
  std::map<int, std::array<double, 3>> values;
  for (const auto& [id, pose] : graph->nodes) values[id] = {pose.x_m, pose.y_m, pose.yaw_rad};

  std::unique_ptr<ceres::LossFunction> loss;
  if (config.robust_loss == "dcs")
    loss = std::make_unique<DcsLoss>(config.robust_scale * config.robust_scale);
  if (config.robust_loss == "cauchy") loss = std::make_unique<ceres::CauchyLoss>(config.robust_scale);

  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  for (auto& [id, value] : values) problem.AddParameterBlock(value.data(), 3);
  for (const PoseGraphEdge& edge : graph->edges) {
    problem.AddResidualBlock(new EdgeCost(edge), edge.robust ? loss.get() : nullptr,
                             values.at(edge.from).data(), values.at(edge.to).data());
  }
  for (const int anchor : anchor_nodes(*graph)) problem.SetParameterBlockConstant(values.at(anchor).data());
  for (const int node : graph->held) problem.SetParameterBlockConstant(values.at(node).data());

  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.max_num_iterations = config.max_iterations;
  options.function_tolerance = 1e-9;
  options.num_threads = 1;
  if (config.warm_start) {
    options.function_tolerance = 1e-6;
    options.initial_trust_region_radius = options.max_trust_region_radius;
  }
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  for (auto& [id, pose] : graph->nodes) {
    const auto& v = values.at(id);
    pose = {v[0], v[1], normalize_angle_rad(v[2])};
  }
  return {2.0 * summary.final_cost, static_cast<int>(summary.iterations.size()) - 1};
}

}  // namespace

GraphOptimizerSummary optimize(const GraphOptimizerConfig& config, PoseGraph* graph) {
  const auto start = std::chrono::steady_clock::now();
  GraphOptimizerSummary summary;
  anchor_nodes(*graph);  // throws on an edge to nowhere, before chi2() would
  summary.initial_chi2 = chi2(*graph);
  PoseGraph best;
  const auto attempt = [&](const char* name, PoseGraph trial) {
    const Outcome outcome = solve(config, &trial);
    summary.iterations += outcome.iterations;
    if (!best.nodes.empty() && !(outcome.cost < summary.robust_cost)) return;
    summary.robust_cost = outcome.cost;
    summary.initialization = name;
    best = std::move(trial);
  };
  // The chordal relaxation knows one anchor a part only.
  const bool chordal = config.initialization != "given" && graph->held.empty();
  if (chordal) {
    PoseGraph trial = *graph;
    initialize_chordal(&trial);
    attempt("chordal", std::move(trial));
  }
  if (config.initialization != "chordal" || !chordal) attempt("given", *graph);
  graph->nodes = std::move(best.nodes);
  summary.final_chi2 = chi2(*graph);
  summary.time_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

}  // namespace knav
