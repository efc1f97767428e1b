#pragma once

#include <libfreenect.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

/// A recording in libfreenect's format, as its program `record` writes them and fakenect plays them.
namespace knav::fakenect {

constexpr int kWidth = 640, kHeight = 480;
constexpr int kDistinctFrames = 40;

/// Every code from 0 to 2047 lies in every frame; the corner tells the frame's number.
inline uint16_t code_at(int u, int v, int frame) {
  if (u == 0 && v == 0) return static_cast<uint16_t>(600 + frame);
  return static_cast<uint16_t>((v * kWidth + u + 37 * frame) % 2048);
}

/// An index; for every frame a PGM of raw codes, named by the time and the Kinect's ticks; and between them
/// what the accelerometer said. The same kDistinctFrames again and again, `frames` in all, at 30 Hz. An old
/// dump is replaced.
inline void write_dump(const std::string& directory, int frames) {
  std::filesystem::remove_all(directory);
  std::filesystem::create_directories(directory);
  std::ofstream index(directory + "/INDEX.txt");
  std::vector<std::string> names;
  for (int frame = 0; frame < frames; ++frame) {
    char name[100];
    // The counter wraps soon after the beginning.
    const unsigned ticks = 4294967295U - 3000000U + 2000000U * static_cast<unsigned>(frame);
    std::snprintf(name, sizeof(name), "d-%.6f-%u.pgm", 1000.0 + frame / 30.0, ticks);
    names.emplace_back(name);
    index << name << "\n";
    const std::string path = directory + "/" + name;
    if (frame >= kDistinctFrames) {
      std::filesystem::create_hard_link(
          directory + "/" + names[static_cast<std::size_t>(frame % kDistinctFrames)], path);
    } else {
      std::vector<uint16_t> codes(static_cast<std::size_t>(kWidth * kHeight));
      for (int v = 0; v < kHeight; ++v) {
        for (int u = 0; u < kWidth; ++u)
          codes[static_cast<std::size_t>(v * kWidth + u)] = code_at(u, v, frame);
      }
      std::ofstream file(path, std::ios::binary);
      file << "P5 640 480 65535\n";
      file.write(reinterpret_cast<const char*>(codes.data()), static_cast<std::streamsize>(codes.size() * 2));
    }
    if (frame % 10 != 0) continue;
    std::snprintf(name, sizeof(name), "a-%.6f-%u.dump", 1000.001 + frame / 30.0, ticks);
    index << name << "\n";
    freenect_raw_tilt_state level{};
    level.accelerometer_y = 819;  // FREENECT_COUNTS_PER_G: standing level
    std::ofstream(directory + "/" + name, std::ios::binary)
        .write(reinterpret_cast<const char*>(&level), sizeof(level));
  }
}

}  // namespace knav::fakenect
