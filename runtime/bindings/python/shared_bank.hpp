// A bank held by Python objects.
#pragma once

#include <memory>
#include <string>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/nearest.hpp"

namespace carillon::python {

/// An immutable bank; numpy arrays view it and keep it alive.
struct SharedBank {
  std::shared_ptr<const bank::Bank> stored;         // as in the file
  std::shared_ptr<const bank::Bank> played;         // with the requested frequencies; may be the same
  std::string name;                                 // file name for display
  bool is_corrected = false;                        // prefers corrected frequencies
  std::shared_ptr<const bank::SurfaceTree> tree{};  // of `played`; created on first use

  const bank::SurfaceTree& get_tree() {
    if (!tree) tree = std::make_shared<bank::SurfaceTree>(*played);
    return *tree;
  }
};

}  // namespace carillon::python
