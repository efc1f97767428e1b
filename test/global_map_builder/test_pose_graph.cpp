#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "core/error.h"
#include "core/file_io.h"
#include "core/random.h"
#include "global_map_builder/graph_optimizer.h"

namespace knav {
namespace {

PoseGraphEdge edge(int from, int to, const Pose2& T, bool robust = false) {
  PoseGraphEdge e;
  e.from = from;
  e.to = to;
  e.T_from_to = T;
  e.information = Eigen::Vector3d(400.0, 400.0, 2500.0).asDiagonal();  // 5 cm, 1.1 deg
  e.robust = robust;
  return e;
}

/// Poses round a square of 10 m, a metre apart, exact edges, closed by one more edge.
PoseGraph square_loop() {
  PoseGraph graph;
  Pose2 pose;
  for (int i = 0; i < 40; ++i) {
    graph.nodes[i] = pose;
    const Pose2 step{1.0, 0.0, i % 10 == 9 ? kPi / 2.0 : 0.0};
    graph.edges.push_back(edge(i, (i + 1) % 40, step, i == 39));
    pose = pose * step;
  }
  return graph;
}

double largest_distance_m(const PoseGraph& a, const PoseGraph& b) {
  double largest = 0.0;
  for (const auto& [id, pose] : a.nodes) largest = std::max(largest, distance_m(pose, b.nodes.at(id)));
  return largest;
}

TEST(PoseGraph, ErrorOfAnEdgeIsWorkedOutByHand) {
  // `to` is 1 m ahead and turned left; measured was 0.9 m ahead, turned left by 0.1 rad less.
  const PoseGraphEdge e = edge(0, 1, {0.9, 0.0, kPi / 2.0 - 0.1});
  const Eigen::Vector3d error = edge_error(e, {2.0, 3.0, kPi}, {1.0, 3.0, -kPi / 2.0});
  EXPECT_NEAR(error.x(), 0.1 * std::sin(0.1), 1e-12);  // 0.1 m ahead, in axes turned by pi/2 - 0.1
  EXPECT_NEAR(error.y(), -0.1 * std::cos(0.1), 1e-12);
  EXPECT_NEAR(error.z(), 0.1, 1e-12);
}

TEST(PoseGraph, ChordalInitializationSolvesAnExactGraphFromAnyStart) {
  const PoseGraph truth = square_loop();
  PoseGraph graph = truth;
  RandomStream random(3, random_stream::kTest, 0, 0);
  for (auto& [id, pose] : graph.nodes) {
    if (id != 0) pose = {random.uniform(-50, 50), random.uniform(-50, 50), random.uniform(-kPi, kPi)};
  }
  initialize_chordal(&graph);
  EXPECT_LT(largest_distance_m(truth, graph), 1e-6);
}

TEST(PoseGraph, OptimisationKeepsTheLowestNodeOfEveryPart) {
  PoseGraph graph = square_loop();
  graph.nodes[100] = {7.0, 8.0, 1.0};
  graph.nodes[101] = {0.0, 0.0, 0.0};
  graph.edges.push_back(edge(100, 101, {1.0, 0.0, 0.0}));
  EXPECT_EQ(anchor_nodes(graph), (std::vector<int>{0, 100}));
  optimize({}, &graph);
  EXPECT_DOUBLE_EQ(graph.nodes.at(100).x_m, 7.0);
  EXPECT_NEAR(graph.nodes.at(101).x_m, 7.0 + std::cos(1.0), 1e-6);
}

/// A straight chain, at its optimum without error, and one more edge that says it is longer: in standard deviations of chain and edge
/// together the growth of chi2, worked out by hand, is (1 m)^2 / (401 (0.05 m)^2).
TEST(PoseGraph, FromAnOptimumANewEdgesInnovationIsFoundInFewFullSteps) {
  constexpr int kSteps = 400;
  PoseGraph graph;
  for (int i = 0; i <= kSteps; ++i) {
    graph.nodes[i] = {1.0 * i, 0.0, 0.0};
    if (i > 0) graph.edges.push_back(edge(i - 1, i, {1.0, 0.0, 0.0}));
  }
  graph.edges.push_back(edge(0, kSteps, {kSteps + 1.0, 0.0, 0.0}));
  GraphOptimizerConfig config;
  config.initialization = "given";
  config.robust_loss = "none";
  config.warm_start = true;
  const GraphOptimizerSummary summary = optimize(config, &graph);
  EXPECT_NEAR(summary.final_chi2, 1.0 / (401.0 * 0.05 * 0.05), 1e-5);
  EXPECT_LE(summary.iterations, 3);
  EXPECT_NEAR(graph.nodes.at(kSteps).x_m, kSteps * (1.0 + 1.0 / 401.0), 1e-4);
}

TEST(PoseGraph, FalseClosuresFadeOut) {
  const PoseGraph truth = square_loop();
  for (const char* loss : {"dcs", "cauchy"}) {
    PoseGraph graph = truth;
    RandomStream random(5, random_stream::kTest, 0, 0);
    for (PoseGraphEdge& e : graph.edges) {  // a sane odometry: 1 cm, 0.3 deg a metre
      if (!e.robust)
        e.T_from_to =
            e.T_from_to * Pose2{random.normal(0, 0.01), random.normal(0, 0.01), random.normal(0, 0.005)};
    }
    graph.edges.push_back(edge(15, 35, {0.0, 0.0, 0.0}, true));  // 10 m apart in truth
    graph.edges.push_back(edge(3, 22, {0.5, 0.0, kPi}, true));
    GraphOptimizerConfig config;
    config.robust_loss = loss;
    optimize(config, &graph);
    EXPECT_LT(largest_distance_m(truth, graph), 0.5) << loss;
    config.robust_loss = "none";
    optimize(config, &graph);
    EXPECT_GT(largest_distance_m(truth, graph), 1.0)
        << "the false closures bend the map when nothing guards it";
  }
}

TEST(PoseGraph, FilesReadBackAndTellTheLineOfAFault) {
  const std::string path = ::testing::TempDir() + "/knav_graph.g2o";
  const PoseGraph graph = square_loop();
  write_pose_graph(path, graph);
  const PoseGraph again = read_pose_graph(path);
  EXPECT_LT(largest_distance_m(graph, again), 1e-6);
  EXPECT_EQ(again.edges.size(), graph.edges.size());
  EXPECT_NEAR(again.edges[0].information(2, 2), 2500.0, 1e-6);

  const auto fault_of = [&](const std::string& text) {
    write_text_atomically(path, text);
    try {
      read_pose_graph(path);
    } catch (const UserError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(fault_of("VERTEX_SE2 0 0 0 0\nEDGE_SE2 0 1 1 0 nan 1 0 0 1 0 1\n").find("line 2"),
            std::string::npos);
  EXPECT_NE(fault_of("EDGE_SE2 0 1 1 0 0 1 0 0 -1 0 1\n").find("positive definite"), std::string::npos);
  EXPECT_NE(fault_of("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n").find("not known"), std::string::npos);
  EXPECT_NE(fault_of("").find("no edges"), std::string::npos);
  EXPECT_NE(fault_of("EDGE_SE2 0 1 1 0").find("line 1"), std::string::npos);
}

TEST(PoseGraph, ToroOrderOfTheInformationIsItsOwn) {
  const std::string path = ::testing::TempDir() + "/knav_graph.graph";
  write_text_atomically(path, "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0\nEDGE2 0 1 1 0 0 10 1 20 30 2 3\n");
  const Eigen::Matrix3d m = read_pose_graph(path).edges[0].information;
  EXPECT_EQ(m(0, 0), 10);
  EXPECT_EQ(m(0, 1), 1);
  EXPECT_EQ(m(1, 1), 20);
  EXPECT_EQ(m(2, 2), 30);
  EXPECT_EQ(m(0, 2), 2);
  EXPECT_EQ(m(1, 2), 3);
}

std::string real_data() {
  const char* given = std::getenv("KINECT_NAV_REALDATA");
  return given != nullptr ? given : std::string(KINECT_NAV_SOURCE_DIR) + "/../shared/realdata";
}

TEST(PoseGraph, KnownOptimaAreReachedFromTheFilesAsTheyAre) {
  const std::string folder = real_data() + "/pose_graphs/";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no pose graphs at " << folder;
  const std::pair<const char*, double> known[] = {{"INTEL.g2o", 215.830},
                                                  {"M3500.g2o", 137.913},
                                                  {"M3500a.g2o", 912.115},
                                                  {"M3500b.g2o", 2054.716},
                                                  {"FR079_P_toro.graph", 37.599}};
  for (const auto& [name, chi2] : known) {
    PoseGraph graph = read_pose_graph(folder + name);
    GraphOptimizerConfig config;
    config.initialization = "chordal";
    EXPECT_NEAR(optimize(config, &graph).final_chi2, chi2, 1e-3 * chi2) << name;
  }
}

}  // namespace
}  // namespace knav
