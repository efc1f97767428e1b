#include "openni2_driver/simulated_device/shared_camera.h"

#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <linux/futex.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstring>
#include <ctime>

#include "core/error.h"

namespace knav {
namespace {

constexpr uint32_t kMagic = 0x4b4e4331;  // changes with the layout
constexpr uint32_t kSlots = 4;
constexpr char kDirectory[] = "/dev/shm", kPrefix[] = "kinect_nav_camera.";
constexpr int64_t kWantedUs = 1000000;

int64_t monotonic_us() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<int64_t>(now.tv_sec) * 1000000 + now.tv_nsec / 1000;
}

}  // namespace

struct SharedCameraLayout {
  struct Slot {
    std::atomic<uint32_t> number;  ///< of the frame in it; 0 while it is being written
    int32_t index;
    uint64_t time_us;
  };
  struct Stream {
    std::atomic<int64_t> wanted_until_us;
    std::atomic<uint32_t> newest;  ///< what readers wait on
    Slot slots[kSlots];
  };
  std::atomic<uint32_t> magic;  ///< written last
  int32_t writer_pid;
  int32_t width_px, height_px;
  double focal_px, rate_hz;
  char serial[64];
  std::atomic<int64_t> alive_us;
  std::atomic<uint32_t> plugged;
  Stream streams[kSharedStreamCount];

  std::size_t pixels() const {
    return static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  }
  uint16_t* frame(int stream, uint32_t slot) {
    auto* first = reinterpret_cast<uint16_t*>(reinterpret_cast<char*>(this) + sizeof(SharedCameraLayout));
    return first + pixels() * (static_cast<std::size_t>(stream) * kSlots + slot);
  }
  bool alive() const {
    return monotonic_us() - alive_us.load() < static_cast<int64_t>(kSharedCameraTimeoutS * 1e6);
  }
};
static_assert(std::atomic<uint32_t>::is_always_lock_free && std::atomic<int64_t>::is_always_lock_free,
              "processes share these");

namespace {

std::string path_of(const std::string& name) { return std::string(kDirectory) + "/" + kPrefix + name; }

std::size_t bytes_of(int width_px, int height_px) {
  return sizeof(SharedCameraLayout) + sizeof(uint16_t) * kSlots * kSharedStreamCount *
                                          static_cast<std::size_t>(width_px) *
                                          static_cast<std::size_t>(height_px);
}

/// Null if it is not there or not ours. The file may be one that another process is just making.
SharedCameraLayout* map_existing(const std::string& path, std::size_t* bytes) {
  const int file = ::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW);
  if (file < 0) return nullptr;
  struct stat state {};
  void* memory = MAP_FAILED;
  if (fstat(file, &state) == 0 && state.st_size >= static_cast<off_t>(sizeof(SharedCameraLayout))) {
    *bytes = static_cast<std::size_t>(state.st_size);
    memory = mmap(nullptr, *bytes, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  }
  ::close(file);
  if (memory == MAP_FAILED) return nullptr;
  auto* layout = static_cast<SharedCameraLayout*>(memory);
  if (layout->magic.load() != kMagic || layout->width_px <= 0 || layout->height_px <= 0 ||
      *bytes < bytes_of(layout->width_px, layout->height_px)) {
    munmap(memory, *bytes);
    return nullptr;
  }
  return layout;
}

}  // namespace

SharedCameraWriter::SharedCameraWriter(const std::string& name, const SharedCameraInfo& info)
    : path_(path_of(name)), info_(info) {
  if (name.empty() || name.find('/') != std::string::npos || name.size() > 100) {
    throw UserError(
        fmt::format("'{}' is no name for a simulated camera; letters, digits and '_' make one.", name));
  }
  if (SharedCameraLayout* other = map_existing(path_, &bytes_)) {
    // One that was killed is silent only after a while, but gone at once.
    const bool alive = other->alive() && (kill(other->writer_pid, 0) == 0 || errno != ESRCH);
    munmap(other, bytes_);
    if (alive) {
      throw UserError(fmt::format(
          "another simulator shows its camera as '{}' ({}); give this one another name or end that one.",
          name, path_));
    }
  }
  bytes_ = bytes_of(info.width_px, info.height_px);
  // A file of its own, never one that readers of a dead simulator still have open.
  ::unlink(path_.c_str());
  const int file = ::open(path_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
  void* memory = MAP_FAILED;
  if (file >= 0 && posix_fallocate(file, 0, static_cast<off_t>(bytes_)) == 0) {
    memory = mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  }
  const int reason = errno;
  if (file >= 0) ::close(file);
  if (memory == MAP_FAILED) {
    ::unlink(path_.c_str());
    throw UserError(fmt::format("{}: {} bytes of shared memory cannot be had: {}.", path_, bytes_,
                                std::strerror(reason)));
  }
  layout_ = static_cast<SharedCameraLayout*>(memory);  // all zeros, which every member may be
  layout_->writer_pid = static_cast<int32_t>(getpid());
  layout_->width_px = info.width_px;
  layout_->height_px = info.height_px;
  layout_->focal_px = info.focal_px;
  layout_->rate_hz = info.rate_hz;
  info.serial.copy(layout_->serial, sizeof(layout_->serial) - 1);
  layout_->plugged = 1;
  keep_alive();
  layout_->magic.store(kMagic);
}

SharedCameraWriter::~SharedCameraWriter() {
  layout_->plugged = 0;
  ::unlink(path_.c_str());
  munmap(layout_, bytes_);
}

void SharedCameraWriter::keep_alive() { layout_->alive_us = monotonic_us(); }

bool SharedCameraWriter::wanted(SharedStream stream) const {
  return layout_->plugged && layout_->streams[static_cast<int>(stream)].wanted_until_us > monotonic_us();
}

uint16_t* SharedCameraWriter::begin_frame(SharedStream which) {
  SharedCameraLayout::Stream& stream = layout_->streams[static_cast<int>(which)];
  const uint32_t slot = (stream.newest.load() + 1) % kSlots;
  stream.slots[slot].number.store(0);
  std::atomic_thread_fence(std::memory_order_seq_cst);
  return layout_->frame(static_cast<int>(which), slot);
}

void SharedCameraWriter::end_frame(SharedStream which, uint64_t time_us, int index) {
  if (!streaming_ || !layout_->plugged) return;
  SharedCameraLayout::Stream& stream = layout_->streams[static_cast<int>(which)];
  const uint32_t number = stream.newest.load() + 1;
  SharedCameraLayout::Slot& slot = stream.slots[number % kSlots];
  slot.index = index;
  slot.time_us = time_us;
  slot.number.store(number, std::memory_order_release);
  stream.newest.store(number, std::memory_order_release);
  syscall(SYS_futex, reinterpret_cast<uint32_t*>(&stream.newest), FUTEX_WAKE, INT_MAX, nullptr, nullptr, 0);
}

void SharedCameraWriter::set_plugged(bool plugged) { layout_->plugged = plugged ? 1 : 0; }
void SharedCameraWriter::set_streaming(bool streaming) { streaming_ = streaming; }

std::shared_ptr<SharedCameraReader> SharedCameraReader::open(const std::string& name) {
  std::shared_ptr<SharedCameraReader> reader(new SharedCameraReader);
  reader->layout_ = map_existing(path_of(name), &reader->bytes_);
  if (reader->layout_ == nullptr || !reader->plugged()) return nullptr;
  const SharedCameraLayout& layout = *reader->layout_;
  reader->info_.serial.assign(layout.serial, strnlen(layout.serial, sizeof(layout.serial)));
  reader->info_.width_px = layout.width_px;
  reader->info_.height_px = layout.height_px;
  reader->info_.focal_px = layout.focal_px;
  reader->info_.rate_hz = layout.rate_hz;
  return reader;
}

SharedCameraReader::~SharedCameraReader() {
  if (layout_ != nullptr) munmap(layout_, bytes_);
}

bool SharedCameraReader::plugged() const { return layout_->plugged && layout_->alive(); }

void SharedCameraReader::want(SharedStream stream) {
  layout_->streams[static_cast<int>(stream)].wanted_until_us = monotonic_us() + kWantedUs;
}

uint32_t SharedCameraReader::newest(SharedStream stream) const {
  return layout_->streams[static_cast<int>(stream)].newest.load(std::memory_order_acquire);
}

void SharedCameraReader::wait_newer(SharedStream stream, uint32_t seen) const {
  timespec timeout{0, 20000000};
  syscall(SYS_futex, reinterpret_cast<uint32_t*>(&layout_->streams[static_cast<int>(stream)].newest),
          FUTEX_WAIT, seen, &timeout, nullptr, 0);
}

bool SharedCameraReader::copy(SharedStream which, uint32_t number, uint16_t* out, Stamp* stamp) const {
  const SharedCameraLayout::Slot& slot = layout_->streams[static_cast<int>(which)].slots[number % kSlots];
  if (slot.number.load(std::memory_order_acquire) != number) return false;
  stamp->time_us = slot.time_us;
  stamp->index = slot.index;
  std::memcpy(out, layout_->frame(static_cast<int>(which), number % kSlots),
              layout_->pixels() * sizeof(uint16_t));
  std::atomic_thread_fence(std::memory_order_seq_cst);
  return slot.number.load(std::memory_order_relaxed) == number;
}

std::vector<std::string> shared_camera_names() {
  std::vector<std::string> names;
  DIR* directory = opendir(kDirectory);
  if (directory == nullptr) return names;
  while (const dirent* entry = readdir(directory)) {
    const std::string file = entry->d_name;
    const std::string prefix = kPrefix;
    if (file.compare(0, prefix.size(), prefix) == 0) names.push_back(file.substr(prefix.size()));
  }
  closedir(directory);
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace knav
