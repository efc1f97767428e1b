#pragma once

#include <cstdint>
#include <istream>
#include <ostream>
#include <type_traits>
#include <vector>

namespace knav {

/// Values as they lie in memory, for files that never leave this machine; vectors with their count before them. What cannot be
/// read sets the stream's failbit.
template <class T>
void write(std::ostream& out, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  out.write(reinterpret_cast<const char*>(&value), sizeof value);
}
template <class T>
void write(std::ostream& out, const std::vector<T>& values) {
  static_assert(std::is_trivially_copyable_v<T>);
  write(out, static_cast<std::uint64_t>(values.size()));
  out.write(reinterpret_cast<const char*>(values.data()),
            static_cast<std::streamsize>(values.size() * sizeof(T)));
}
template <class T>
void read(std::istream& in, T* value) {
  in.read(reinterpret_cast<char*>(value), sizeof *value);
}
template <class T>
void read(std::istream& in, std::vector<T>* values) {
  std::uint64_t count = 0;
  read(in, &count);
  if (!in || count > (std::uint64_t{1} << 33) / sizeof(T)) {
    in.setstate(std::ios::failbit);
    return;
  }
  values->resize(count);
  in.read(reinterpret_cast<char*>(values->data()), static_cast<std::streamsize>(count * sizeof(T)));
}

}  // namespace knav
