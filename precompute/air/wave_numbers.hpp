// Wave numbers of the solves, and interpolation weights of the modes between them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace carillon::air {

inline constexpr std::size_t kStencil = 4;

/// Wave numbers that a mode reads, with Lagrange weights of all of them and of the three nearest, whose difference is the error.
struct Stencil {
  std::vector<std::int32_t> nodes;  // ascending; one if the mode is at a wave number or there is only one, else kStencil
  std::vector<double> weights;
  std::vector<double> weights_without_farthest;
};

/// Ascending, distinct wave numbers.
class WaveNumbers {
 public:
  /// For modes at `modes` [1/m] of a surface in a sphere of `radius_m`. The mean step of k R is `step`, two thirds of it at the lower end;
  /// the modes' own wave numbers if those are fewer.
  WaveNumbers(std::span<const double> modes, double radius_m, double step);

  const std::vector<double>& get() const { return nodes_; }
  Stencil find_stencil(double k) const;

  /// Inserts a wave number into each step with a mode that `is_wrong`, at the mode nearest to its middle, and beyond the ends. False if
  /// none was inserted.
  bool refine(std::span<const double> modes, const std::vector<bool>& is_wrong);

 private:
  std::vector<double> nodes_;
};

}  // namespace carillon::air
