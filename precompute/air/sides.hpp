// Blocks of complex vectors.
#pragma once

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

namespace carillon::air {

inline constexpr std::size_t kSideLanes = 16;

/// Vectors of `unknowns` complex numbers, one per side. Invariant: for each unknown all real parts, then all imaginary parts, zero-padded
/// to a multiple of kSideLanes.
struct Sides {
  std::size_t unknowns = 0, count = 0, padded = 0;
  std::vector<float> values;  // (unknowns, 2, padded)

  Sides() = default;
  Sides(std::size_t unknown_count, std::size_t side_count)
      : unknowns(unknown_count),
        count(side_count),
        padded((side_count + kSideLanes - 1) / kSideLanes * kSideLanes),
        values(unknowns * 2 * padded) {}
  /// From (unknowns, count).
  Sides(std::span<const std::complex<float>> rows, std::size_t unknown_count, std::size_t side_count) : Sides(unknown_count, side_count) {
    for (std::size_t i = 0; i < unknowns; ++i)
      for (std::size_t m = 0; m < count; ++m) {
        get_real(i)[m] = rows[i * count + m].real();
        get_imaginary(i)[m] = rows[i * count + m].imag();
      }
  }

  float* get_real(std::size_t unknown) { return &values[unknown * 2 * padded]; }
  float* get_imaginary(std::size_t unknown) { return get_real(unknown) + padded; }
  const float* get_real(std::size_t unknown) const { return &values[unknown * 2 * padded]; }
  const float* get_imaginary(std::size_t unknown) const { return get_real(unknown) + padded; }
  /// (unknowns, count)
  std::vector<std::complex<float>> list() const {
    std::vector<std::complex<float>> rows;
    rows.reserve(unknowns * count);
    for (std::size_t i = 0; i < unknowns; ++i)
      for (std::size_t m = 0; m < count; ++m) rows.emplace_back(get_real(i)[m], get_imaginary(i)[m]);
    return rows;
  }
};

}  // namespace carillon::air
