// Modes of banks in the form used by impacts.
#pragma once

#include <map>
#include <memory>

#include "runtime/bank/bank.hpp"
#include "runtime/physics/impact/modes.hpp"

namespace carillon::drive {

/// Bodies of one bank share their modes. Banks must not move in memory.
class ModeSets {
 public:
  /// nullptr for a bank without modes.
  std::shared_ptr<const impact::Modes> find(const bank::Bank& bank);

 private:
  std::map<const bank::Bank*, std::shared_ptr<const impact::Modes>> sets_;
};

}  // namespace carillon::drive
