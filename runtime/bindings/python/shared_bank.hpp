// A bank as Python holds it.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/nearest.hpp"

namespace carillon::python {

/// A bank that does not change: arrays of Python look into it, and keep it.
struct SharedBank {
  std::shared_ptr<const bank::Bank> stored;         // as it is in the file
  std::shared_ptr<const bank::Bank> played;         // with the frequencies that were asked for; may be the same
  std::string name;                                 // for people: the file
  bool is_corrected = false;                        // corrected frequencies are played where the bank has them
  std::shared_ptr<const bank::SurfaceTree> tree{};  // of `played`; made when it is asked for first

  const bank::SurfaceTree& get_tree() {
    if (!tree) tree = std::make_shared<bank::SurfaceTree>(*played);
    return *tree;
  }
};

}  // namespace carillon::python
