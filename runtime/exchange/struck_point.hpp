// A point of the surface that is struck.
#pragma once

#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::exchange {

struct StruckPoint {
  Vec3 point_m{}, inward{};
  std::vector<double> velocity{};  // (m) modal velocity after a blow of 1 N s along `inward` [m kg^1/2 / s]
};

/// Nearest point of the surface. Throws InputError for a place that is far from it.
StruckPoint find_struck_point(const bank::Bank& bank, const Vec3& point_m);

}  // namespace carillon::exchange
