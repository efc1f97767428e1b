// optimize_graph: a 2D pose graph (g2o or TORO) to its least-squares optimum.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "global_map_builder/graph_optimizer.h"
#include "ros_common/command_line.h"

int main(int argc, char** argv) {
  CLI::App app{
      "Optimises a 2D pose graph: g2o (EDGE_SE2) or TORO (EDGE2) in, g2o out. chi2 is the sum of "
      "e' Omega e over all edges."};
  std::string in, out, json;
  knav::GraphOptimizerConfig config;
  config.robust_loss = "none";
  config.initialization = "chordal";
  app.add_option("IN", in, "graph to read")->required();
  app.add_option("OUT", out, "g2o file to write")->required();
  app.add_option("--init", config.initialization, "start: chordal (rotations first), given, or best of both")
      ->check(CLI::IsMember({"chordal", "given", "best"}))
      ->capture_default_str();
  app.add_option("--loss", config.robust_loss, "loss on edges between nodes that do not follow each other")
      ->check(CLI::IsMember({"none", "cauchy", "dcs"}))
      ->capture_default_str();
  app.add_option("--max-iterations", config.max_iterations)
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  app.add_option(
      "--json", json,
      "write {initial_chi2, final_chi2, iterations, time_s, nodes, edges} here; '-' = standard output");
  return knav::run_command(app, argc, argv, [&] {
    knav::PoseGraph graph = knav::read_pose_graph(in);
    for (knav::PoseGraphEdge& edge : graph.edges) edge.robust = std::abs(edge.to - edge.from) > 1;
    const knav::GraphOptimizerSummary summary = knav::optimize(config, &graph);
    knav::write_pose_graph(out, graph);
    if (json != "-") {
      fmt::print("initial chi2 {:.3f}\nfinal chi2 {:.3f}\niterations {}\ntime {:.3f} s\n",
                 summary.initial_chi2, summary.final_chi2, summary.iterations, summary.time_s);
    }
    knav::write_json(json, nlohmann::json{{"initial_chi2", summary.initial_chi2},
                                          {"final_chi2", summary.final_chi2},
                                          {"iterations", summary.iterations},
                                          {"time_s", summary.time_s},
                                          {"nodes", graph.nodes.size()},
                                          {"edges", graph.edges.size()}}
                               .dump(2));
  });
}
