#pragma once

#include <nodelet/nodelet.h>

#include <exception>

namespace knav {

/// onInit() for every nodelet here: a fault in the parameters becomes one fatal message instead of a crash of the
/// whole manager, and a Debug build says so.
class NodeletBase : public nodelet::Nodelet {
 public:
  void onInit() final {
#ifndef NDEBUG
    NODELET_WARN("This is a Debug build, many times slower; use -DCMAKE_BUILD_TYPE=Release.");
#endif
    try {
      start();
    } catch (const std::exception& error) {
      NODELET_FATAL("%s: does not start: %s", getName().c_str(), error.what());
      throw;
    }
  }

 protected:
  /// Reads parameters, advertises and subscribes. May throw UserError.
  virtual void start() = 0;
};

}  // namespace knav
