// At which wave numbers the air is solved, and what modes between them read there.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace carillon::air {

inline constexpr std::size_t kStencil = 4;

/// The wave numbers that a mode reads, with Lagrange's weights of all of them, and of the three nearest, whose difference is the error.
struct Stencil {
  std::vector<std::int32_t> nodes;  // ascending; one where the mode is at a wave number or none is to be read, else kStencil
  std::vector<double> weights;
  std::vector<double> weights_without_farthest;
};

/// Ascending wave numbers. Invariant: they differ.
class WaveNumbers {
 public:
  /// For modes at `modes` [1/m] of a surface in a sphere of `radius_m`. The mean step of k R is `step`, two thirds of it at the lower end;
  /// the modes' own wave numbers where those are fewer.
  WaveNumbers(std::span<const double> modes, double radius_m, double step);

  const std::vector<double>& get() const { return nodes_; }
  Stencil find_stencil(double k) const;

  /// One more inside each step in which a mode is that `is_wrong`, at the wave number of the one nearest to its middle; and beyond the
  /// ends. False when there is none.
  bool refine(std::span<const double> modes, const std::vector<bool>& is_wrong);

 private:
  std::vector<double> nodes_;
};

}  // namespace carillon::air
