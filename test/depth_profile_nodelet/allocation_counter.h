#pragma once

#include <cstddef>

namespace knav::test {

/// Calls of operator new in this program so far.
std::size_t allocation_count();

}  // namespace knav::test
