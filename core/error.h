#pragma once

#include <stdexcept>
#include <string>

namespace knav {

/// A fault in what the user gave us. what() is one sentence that names the file, key or topic and what to do.
class UserError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace knav
