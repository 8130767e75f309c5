#pragma once

#include <stdexcept>

namespace carillon::mesher {

/// The skin cannot be extruded to this wall; what() is a predicate about the wall, with the position.
struct WallError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace carillon::mesher
