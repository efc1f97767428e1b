#include "openni2_driver/openni_device.h"

#include <fmt/format.h>

#include <chrono>

#include "core/error.h"
#include "openni2_driver/parked_thread.h"

namespace knav {
namespace {

double steady_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}
// How long the thread sleeps at most: unplugging and the end of a recording are only counted by the runtime.
constexpr double kPollPeriodS = 0.1;

}  // namespace

const char* to_string(DeviceState state) {
  switch (state) {
    case DeviceState::kSearching:
      return "searching";
    case DeviceState::kIdle:
      return "idle";
    case DeviceState::kStreaming:
      return "streaming";
    case DeviceState::kStalled:
      return "stalled";
    case DeviceState::kEnded:
      return "ended";
  }
  return "unknown";
}

OpenNIDevice::OpenNIDevice(const OpenNIDeviceConfig& config, FrameHandler on_frame, EventHandler on_event)
    : config_(config),
      on_frame_(std::move(on_frame)),
      on_event_(std::move(on_event)),
      started_s_(steady_s()),
      finished_(run_on_parked_thread([this] { run(); })) {}

OpenNIDevice::~OpenNIDevice() {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  finished_.wait();
}

void OpenNIDevice::request(SensorStream stream, bool on) {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    wanted_[static_cast<int>(stream)] = on;
    woken_ = true;
  }
  wake_.notify_all();
}

void OpenNIDevice::configure(const OpenNIDeviceConfig& config) {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    new_config_ = std::make_unique<OpenNIDeviceConfig>(config);
    woken_ = true;
  }
  wake_.notify_all();
}

DeviceStatus OpenNIDevice::status() const {
  std::lock_guard<std::mutex> lock(mutex_);
  DeviceStatus status = status_;
  const double now_s = steady_s();
  if (status.openings == 0) status.waited_s = now_s - started_s_;
  if (outage_since_s_ >= 0.0) status.last_outage_s = now_s - outage_since_s_;
  if (!status.last_event.empty()) status.last_event_age_s = now_s - last_event_s_;
  return status;
}

bool OpenNIDevice::stopping() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return stop_;
}

void OpenNIDevice::wait(double seconds) {
  std::unique_lock<std::mutex> lock(mutex_);
  wake_.wait_for(lock, std::chrono::duration<double>(seconds), [this] { return stop_ || woken_; });
  woken_ = false;
}

void OpenNIDevice::report_problem(const std::string& problem) {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    status_.problem = problem;
  }
  if (problem == reported_) return;
  reported_ = problem;
  if (!problem.empty()) tell(true, problem);
}

void OpenNIDevice::tell(bool fault, const std::string& sentence) {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    status_.last_event = sentence;
    last_event_s_ = steady_s();
  }
  on_event_(fault, sentence);
}

void OpenNIDevice::begin_outage() {
  std::lock_guard<std::mutex> lock(mutex_);
  if (outage_since_s_ < 0.0) outage_since_s_ = steady_s();
}

void OpenNIDevice::end_outage() {
  std::lock_guard<std::mutex> lock(mutex_);
  if (outage_since_s_ < 0.0) return;
  status_.last_outage_s = steady_s() - outage_since_s_;
  ++status_.recoveries;
  outage_since_s_ = -1.0;
}

void OpenNIDevice::take_new_config() {
  std::unique_ptr<OpenNIDeviceConfig> config;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    config = std::move(new_config_);
  }
  if (!config) return;
  config->device_id = config_.device_id;
  config_ = *config;
  if (session_) {
    session_->configure(config_);
    next_start_s_ = 0.0;
    last_index_[0] = last_index_[1] = -1;
  } else if (ended_ && (lost_ ? config_.enable_reconnect : config_.playback_repeat)) {
    ended_ = false;
    std::lock_guard<std::mutex> lock(mutex_);
    status_.state = DeviceState::kSearching;
  }
}

bool OpenNIDevice::open() {
  try {
    if (!runtime_) runtime_ = OpenNIRuntime::acquire();
    const ResolvedDevice device = resolve_device(*runtime_, config_.device_id);
    if (device.uri.empty()) {
      if (!lost_) report_problem(device.problem + " Waiting for it.");
      return false;
    }
    session_ = std::make_unique<OpenNISession>(runtime_, device, config_, [this] {
      {
        std::lock_guard<std::mutex> lock(mutex_);
        woken_ = true;
      }
      wake_.notify_all();
    });
  } catch (const UserError& error) {
    report_problem(error.what());
    return false;
  }
  last_index_[0] = last_index_[1] = -1;
  last_frame_s_ = steady_s();
  next_start_s_ = 0.0;
  const bool was_lost = lost_;
  lost_ = false;
  bool was_stalled = false;
  double away_s = 0.0;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    was_stalled = status_.state == DeviceState::kStalled;
    if (status_.openings == 0) status_.waited_s = steady_s() - started_s_;
    away_s = was_lost ? steady_s() - outage_since_s_ : status_.openings == 0 ? status_.waited_s : 0.0;
    ++status_.openings;
    status_.uri = session_->uri();
    status_.vendor = session_->vendor();
    status_.name = session_->name();
    status_.serial = session_->serial();
    // A stalled device counts as stalled until a frame comes.
    if (!was_stalled) {
      status_.state = DeviceState::kIdle;
      status_.problem.clear();
    }
  }
  if (!was_stalled) {
    reported_.clear();
    const char* when = was_lost ? " {:.1f} s after it was lost" : " after {:.1f} s of waiting";
    tell(false, fmt::format("Opened {} {}, serial number {} ({}){}.", session_->vendor(), session_->name(),
                            session_->serial().empty() ? "unknown" : session_->serial(), session_->uri(),
                            was_lost || away_s > 1.0 ? fmt::format(fmt::runtime(when), away_s) : ""));
  }
  return true;
}

void OpenNIDevice::close(DeviceState state, const std::string& problem) {
  session_.reset();
  {
    std::lock_guard<std::mutex> lock(mutex_);
    status_.state = state;
  }
  report_problem(problem);
}

void OpenNIDevice::apply_requests() {
  bool wanted[kSensorStreamCount];
  {
    std::lock_guard<std::mutex> lock(mutex_);
    std::copy(wanted_, wanted_ + kSensorStreamCount, wanted);
  }
  std::string problem;
  bool started = false;
  for (int i = 0; i < kSensorStreamCount; ++i) {
    const auto stream = static_cast<SensorStream>(i);
    const bool before = session_->streaming(stream);
    if (before == wanted[i] || (wanted[i] && steady_s() < next_start_s_)) continue;
    try {
      session_->set_streaming(stream, wanted[i]);
    } catch (const UserError& error) {
      problem = error.what();
      next_start_s_ = steady_s() + config_.reconnect_period_s;
    }
    started = started || (!before && session_->streaming(stream));
  }
  const bool any = session_->streaming(SensorStream::kDepth) || session_->streaming(SensorStream::kInfrared);
  if (started || !any) last_frame_s_ = steady_s();
  if (!problem.empty()) report_problem(problem);
  bool idle = false;
  std::unique_lock<std::mutex> lock(mutex_);
  if (status_.state != DeviceState::kStalled)
    status_.state = any ? DeviceState::kStreaming : DeviceState::kIdle;
  if (!wanted[0] && !wanted[1]) {
    status_.state = DeviceState::kIdle;
    status_.problem.clear();
    idle = true;
  } else if (started && problem.empty() && status_.state == DeviceState::kStreaming) {
    status_.problem.clear();
  }
  lock.unlock();
  if (idle) end_outage();
}

void OpenNIDevice::deliver(const SensorFrame& frame) {
  const auto stream = static_cast<int>(frame.stream);
  last_frame_s_ = steady_s();
  bool recovered = false;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    ++status_.frames[stream];
    // A smaller index is a recording that began again.
    if (last_index_[stream] >= 0 && frame.index > last_index_[stream] + 1) {
      status_.missed_frames[stream] += static_cast<uint64_t>(frame.index - last_index_[stream] - 1);
    }
    recovered = status_.state == DeviceState::kStalled;
    if (recovered) {
      status_.state = DeviceState::kStreaming;
      status_.problem.clear();
    }
  }
  last_index_[stream] = frame.index;
  end_outage();
  if (recovered) {
    reported_.clear();
    tell(false, session_->uri() + ": sends frames again.");
  }
  on_frame_(frame);
}

void OpenNIDevice::read_frames() {
  try {
    // A few at most, so that requests and the end are seen in between.
    for (int i = 0; i < 4; ++i) {
      if (!session_->read([this](const SensorFrame& frame) { deliver(frame); })) break;
    }
  } catch (const UserError& error) {
    report_problem(error.what());
  }
}

void OpenNIDevice::run() {
  while (!stopping()) {
    take_new_config();
    if (ended_) {
      wait(1.0);
      continue;
    }
    if (!session_ && !open()) {
      const double until_s = steady_s() + config_.reconnect_period_s;
      while (!stopping() && steady_s() < until_s) wait(until_s - steady_s());
      continue;
    }
    apply_requests();
    const bool streaming =
        session_->streaming(SensorStream::kDepth) || session_->streaming(SensorStream::kInfrared);
    if (streaming) read_frames();

    const std::string uri = session_->uri();
    if (session_->unplugged()) {
      {
        std::lock_guard<std::mutex> lock(mutex_);
        ++status_.disconnections;
      }
      begin_outage();
      ended_ = !config_.enable_reconnect;
      lost_ = true;
      close(ended_ ? DeviceState::kEnded : DeviceState::kSearching,
            uri + (ended_ ? ": was unplugged, and enable_reconnect is false."
                          : ": was unplugged. Waiting for it."));
    } else if (session_->at_end_of_file() && !config_.playback_repeat) {
      ended_ = true;
      close(DeviceState::kEnded, uri + ": the recording is at its end.");
    } else if (streaming && steady_s() - last_frame_s_ > config_.stall_timeout_s) {
      {
        std::lock_guard<std::mutex> lock(mutex_);
        ++status_.stalls;
        status_.state = DeviceState::kStalled;
      }
      begin_outage();
      const std::string problem =
          fmt::format("{}: sent no frame for {:.1f} s.", uri, config_.stall_timeout_s);
      if (config_.enable_reconnect) {
        close(DeviceState::kStalled, problem + " Opening it again until it does.");
      } else {
        last_frame_s_ = steady_s();
        report_problem(problem + " It is left open, since enable_reconnect is false.");
      }
    } else {
      wait(kPollPeriodS);
    }
  }
  session_.reset();
  runtime_.reset();
}

}  // namespace knav
