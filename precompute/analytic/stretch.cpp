#include "precompute/analytic/stretch.hpp"

#include <cmath>

namespace carillon::analytic {

void append_row(const la::Matrix& a, bank::QuarticEnergy& energy) {
  constexpr double kRounding = 1e-12;
  for (Eigen::Index j = 0; j < a.cols(); ++j)
    for (Eigen::Index i = 0; i <= j; ++i) {
      const bool is_rounding = std::abs(a(i, j)) <= kRounding * std::sqrt(std::abs(a(i, i) * a(j, j)));
      energy.rows.push_back(i != j && is_rounding ? 0.0F : static_cast<float>(a(i, j)));
    }
}

void append_diagonal_row(std::span<const double> a, bank::QuarticEnergy& energy) {
  for (std::size_t j = 0; j < a.size(); ++j) {
    energy.rows.insert(energy.rows.end(), j, 0.0F);
    energy.rows.push_back(static_cast<float>(a[j]));
  }
}

}  // namespace carillon::analytic
