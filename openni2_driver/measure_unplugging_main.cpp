// measure_unplugging: pulls the cable of a simulated Kinect again and again under the driver and counts what
// it costs.

#include <dirent.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <ctime>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/error.h"
#include "core/progress.h"
#include "openni2_driver/openni_device.h"
#include "openni2_driver/simulated_device/shared_camera.h"
#include "openni2_driver/virtual_device/analytic_room.h"
#include "ros_common/command_line.h"

namespace {

constexpr char kHelp[] =
    "Shows a simulated Kinect, reads its depth and IR through OpenNI2 and the driver, pulls its cable for a "
    "while, plugs "
    "it in again, and so on. Tells how soon frames are back, and what file descriptors, threads and memory "
    "the process "
    "has after each time. Fails if frames are not back in time, come wrong, or descriptors or threads pile "
    "up.";

double steady_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void sleep_s(double seconds) {
  const double end_s = steady_s() + seconds;
  while (steady_s() < end_s) {
    knav::stop_if_interrupted();
    std::this_thread::sleep_for(
        std::chrono::duration<double>(std::min(0.02, std::max(0.0, end_s - steady_s()))));
  }
}

int entries(const char* directory) {
  DIR* handle = opendir(directory);
  int count = 0;
  while (handle != nullptr && readdir(handle) != nullptr) ++count;
  if (handle != nullptr) closedir(handle);
  return count - 3;  // ".", ".." and, of descriptors, the one to count with
}

struct Footprint {
  int file_descriptors = entries("/proc/self/fd");
  int threads = entries("/proc/self/task") + 1;
  long resident_bytes = 0;
  Footprint() {
    long total = 0, resident = 0;
    std::ifstream("/proc/self/statm") >> total >> resident;
    resident_bytes = resident * sysconf(_SC_PAGESIZE);
  }
};

/// The simulated Kinect: the room whose every pixel has a formula, at 30 Hz.
class Camera {
 public:
  explicit Camera(const std::string& name) : writer_(name, info()), thread_([this] { run(); }) {}
  ~Camera() {
    stop_ = true;
    thread_.join();
  }
  void set_plugged(bool plugged) { writer_.set_plugged(plugged); }

 private:
  static knav::SharedCameraInfo info() {
    knav::SharedCameraInfo info;
    info.serial = "MEASURE";
    return info;
  }
  void run() {
    knav::AnalyticRoom room;
    const knav::VirtualCamera camera;
    auto due = std::chrono::steady_clock::now();
    for (int frame = 0; !stop_; ++frame) {
      writer_.keep_alive();
      const auto time_us = static_cast<uint64_t>(frame) * 1000000 / 30;
      for (const auto stream : {knav::SharedStream::kDepth, knav::SharedStream::kInfrared}) {
        if (!writer_.wanted(stream)) continue;
        uint16_t* pixels = writer_.begin_frame(stream);
        if (stream == knav::SharedStream::kDepth) {
          room.render_depth(static_cast<uint64_t>(frame), camera, pixels);
        } else {
          room.render_ir(static_cast<uint64_t>(frame), camera, pixels);
        }
        writer_.end_frame(stream, time_us, frame);
      }
      due += std::chrono::microseconds(33333);
      std::this_thread::sleep_until(due);
    }
  }
  knav::SharedCameraWriter writer_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// Counts frames, and pixels of depth that are not the room's.
class Frames {
 public:
  void take(const knav::SensorFrame& frame) {
    if (frame.stream == knav::SensorStream::kDepth) {
      const std::size_t pixels =
          static_cast<std::size_t>(frame.width_px) * static_cast<std::size_t>(frame.height_px);
      got_.resize(pixels);
      expected_.resize(pixels);
      copy_pixels(frame, got_.data());
      room_.render_depth(static_cast<uint64_t>(frame.index), {frame.width_px, frame.height_px},
                         expected_.data());
      for (std::size_t i = 0; i < pixels; ++i) wrong_pixels_ += got_[i] != expected_[i] ? 1 : 0;
    }
    ++count_[static_cast<int>(frame.stream)];
  }
  /// Frames of the stream that has fewer.
  long both() const { return std::min(count_[0].load(), count_[1].load()); }
  long wrong_pixels() const { return wrong_pixels_; }

 private:
  knav::AnalyticRoom room_;
  std::vector<uint16_t> got_, expected_;
  std::atomic<long> count_[knav::kSensorStreamCount] = {};
  std::atomic<long> wrong_pixels_{0};
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(kHelp, "measure_unplugging");
  int cycles = 10;
  double away_s = 5.0, stay_s = 1.0, limit_s = 3.0;
  std::string out = "-";
  app.add_option("--cycles", cycles, "How often the cable is pulled")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  app.add_option("--away-s", away_s, "Unplugged for so long [s]")
      ->check(CLI::Range(0.05, 3600.0))
      ->capture_default_str();
  app.add_option("--stay-s", stay_s, "Plugged in for so long once frames are back [s]")
      ->check(CLI::Range(0.05, 3600.0))
      ->capture_default_str();
  app.add_option("--limit-s", limit_s, "Frames must be back so soon after plugging in [s]")
      ->capture_default_str();
  app.add_option("--out", out, "JSON file to write; - is standard output")->capture_default_str();
  return knav::run_command(app, argc, argv, [&] {
    const std::string name = fmt::format("measure_{}", getpid());
    Camera camera(name);
    knav::OpenNIDeviceConfig config;
    config.device_id = "kinect_nav_simulated/" + name;
    Frames frames;
    knav::OpenNIDevice device(
        config, [&](const knav::SensorFrame& frame) { frames.take(frame); }, [](bool, const std::string&) {});
    device.request(knav::SensorStream::kDepth, true);
    device.request(knav::SensorStream::kInfrared, true);
    const auto wait_for_frame = [&](double seconds) {
      const long before = frames.both();
      const double start_s = steady_s();
      while (frames.both() == before) {
        if (steady_s() - start_s > seconds) {
          throw knav::UserError(
              fmt::format("No frames after {:.1f} s: {}", seconds, device.status().problem));
        }
        sleep_s(0.002);
      }
      return steady_s() - start_s;
    };
    wait_for_frame(10.0);
    sleep_s(stay_s);
    const Footprint before;
    nlohmann::json rounds = nlohmann::json::array();
    double slowest_s = 0.0;
    knav::Progress progress("unplugging");
    for (int cycle = 0; cycle < cycles; ++cycle) {
      camera.set_plugged(false);
      sleep_s(away_s);
      camera.set_plugged(true);
      const double back_s = wait_for_frame(std::max(10.0, 2 * limit_s));
      slowest_s = std::max(slowest_s, back_s);
      sleep_s(stay_s);
      const Footprint now;
      rounds.push_back({{"frames_back_after_s", back_s},
                        {"file_descriptors", now.file_descriptors},
                        {"threads", now.threads},
                        {"resident_bytes", now.resident_bytes}});
      progress.update(static_cast<double>(cycle + 1) / cycles);
    }
    const Footprint after;
    const auto status = device.status();
    const nlohmann::json report = {{"cycles", cycles},
                                   {"away_s", away_s},
                                   {"limit_s", limit_s},
                                   {"slowest_back_after_s", slowest_s},
                                   {"disconnections", status.disconnections},
                                   {"recoveries", status.recoveries},
                                   {"wrong_depth_pixels", frames.wrong_pixels()},
                                   {"file_descriptors_before", before.file_descriptors},
                                   {"file_descriptors_after", after.file_descriptors},
                                   {"threads_before", before.threads},
                                   {"threads_after", after.threads},
                                   {"resident_bytes_before", before.resident_bytes},
                                   {"resident_bytes_after", after.resident_bytes},
                                   {"rounds", rounds}};
    knav::write_json(out, report.dump(2));
    if (slowest_s > limit_s) {
      throw knav::UserError(fmt::format("Frames were back only {:.2f} s after plugging in (--limit-s {}).",
                                        slowest_s, limit_s));
    }
    if (status.disconnections != cycles || frames.wrong_pixels() > 0) {
      throw knav::UserError(fmt::format("{} of {} unpluggings noticed, {} wrong pixels.",
                                        status.disconnections, cycles, frames.wrong_pixels()));
    }
    if (after.file_descriptors > before.file_descriptors || after.threads > before.threads) {
      throw knav::UserError(fmt::format("{} file descriptors became {}, {} threads {}.",
                                        before.file_descriptors, after.file_descriptors, before.threads,
                                        after.threads));
    }
  });
}
