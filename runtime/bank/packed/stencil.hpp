// Prediction of a vertex from its neighbours.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "runtime/bank/packed/neighbours.hpp"

namespace carillon::packed {

/// Best linear prediction of a smooth field at a vertex from its neighbours, and of its gradient there times their mean distance h.
///
/// Method: kriging with the covariance 1 / (1 + (0.3 r)^2) + 100 (1 + x . x'), r and x in units of h about the vertex; the second term
///   reproduces linear fields. 1e-4 on the diagonal represents the rounding of the neighbours.
/// Source: kriging: Matheron 1963; covariance, an inverse multiquadric: Hardy 1971, positive definite by Schoenberg 1938.
struct Stencil {
  std::array<float, kNeighbours> value{};                    // weights of the neighbours
  std::array<std::array<float, kNeighbours>, 3> gradient{};  // along each axis
  std::array<std::array<float, kNeighbours>, 3> offset{};    // of the neighbours along each axis, in units of h
};

/// Stencils of vertices at `centres` (n) with `neighbours` (n) among `places`. Thread-safe.
void calc_stencils(std::span<const Place> centres, std::span<const Neighbours> neighbours, std::span<const Place> places,
                   std::span<Stencil> stencils);

/// Correction of the kriging prediction: linear functions of the neighbours' motion, which adapt to the local geometry (near an edge or a
/// change of thickness all slow fields bend alike). Coefficients are 3x3 matrices, row-major.
enum class Fit : std::uint8_t {
  kNone = 0,        // kriging alone
  kGradient = 1,    // plus sum over axes j of C_j (gradient along j)
  kDifferences = 2  // plus sum over neighbours k of D_k (neighbour k less value, gradient . offset)
};
inline constexpr std::size_t kGradientNumbers = 27, kDifferenceNumbers = 9 * kNeighbours;

/// Prediction matrix: weights of the neighbours (K) for the contribution of each of their components to x, y and z; by component, then by
/// x, y and z.
using Matrix = std::array<float, 3 * 3 * kNeighbours>;

}  // namespace carillon::packed
