#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/file_io.h"
#include "kinect_sim/simulator.h"
#include "kinect_sim/tour.h"
#include "kinect_sim/world_picture.h"
#include "ros_common/command_line.h"

namespace {

constexpr char kHelp[] =
    "A picture of a world: its plan (default), or what the simulated Kinect sees from a pose (--view x y "
    "yaw_deg).\n"
    "Plan: walls dark, furniture brown, table tops light, glass blue, stairs violet, low things red, people "
    "orange.";

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(kHelp, "render_world");
  std::string world_path, out, script, sensor = "default";
  std::vector<double> view;
  double scale = 40.0, far_m = 8.0;
  bool top_view = false, infrared = false;
  app.add_option("WORLD", world_path, "World file")->required();
  app.add_option("OUT", out, "PNG file to write")->required();
  app.add_flag("--top-view", top_view, "The plan (default)");
  app.add_option("--script", script, "Draw this tour's path into the plan");
  app.add_option("--scale", scale, "Pixels per metre of the plan")->check(CLI::Range(1.0, 500.0));
  CLI::Option* view_option =
      app.add_option("--view", view, "x y yaw_deg: depth image from there")->expected(3);
  app.add_flag("--infrared", infrared, "With --view: the IR image instead, 10 bits as 8")->needs(view_option);
  app.add_option("--sensor", sensor, "ideal | calibrated | default | harsh")
      ->check(CLI::IsMember(knav::KinectConfig::preset_names()));
  app.add_option("--far", far_m, "Depth [m] at the end of the colour scale");
  return knav::run_command(app, argc, argv, [&] {
    if (top_view && *view_option)
      throw knav::UserError("--top-view and --view exclude each other; give one.");
    const knav::WorldConfig world = knav::load_world(world_path);
    cv::Mat image;
    if (*view_option) {
      knav::SimulatorConfig config;
      config.sensor = sensor;
      knav::Simulator simulator(world, config);
      simulator.set_pose({view[0], view[1], view[2] * knav::kPi / 180.0});
      knav::FrameRequest request;
      simulator.request_now(&request);
      cv::Mat pixels;
      if (infrared) {
        simulator.render_infrared(request, &pixels);
        pixels.convertTo(image, CV_8U, 0.25);
      } else {
        simulator.render(request, &pixels);
        image = knav::depth_picture(pixels, far_m);
      }
    } else {
      knav::WorldPicture picture(world, scale);
      picture.draw_world();
      if (!script.empty()) {
        std::vector<knav::Point2> path = {{world.spawn.x_m, world.spawn.y_m}};
        for (const knav::TourStep& step : knav::load_tour(script).steps) {
          path.insert(path.end(), step.path.begin(), step.path.end());
        }
        picture.draw_path(path, cv::Scalar(60, 160, 60));
      }
      image = picture.image();
    }
    std::vector<unsigned char> bytes;
    cv::imencode(".png", image, bytes);
    knav::write_text_atomically(out, std::string(bytes.begin(), bytes.end()));
  });
}
