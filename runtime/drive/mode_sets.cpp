#include "runtime/drive/mode_sets.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace carillon::drive {

std::shared_ptr<const impact::Modes> ModeSets::find(const bank::Bank& bank) {
  if (bank.mode_count() == 0) return nullptr;
  auto& modes = sets_[&bank];
  if (!modes) {
    std::vector<double> omega;
    for (const double lambda : bank.eigenvalue_rad2_s2) omega.push_back(std::sqrt(std::max(lambda, 0.0)));
    modes = std::make_shared<const impact::Modes>(omega, bank.decay_per_s);
  }
  return modes;
}

}  // namespace carillon::drive
