// How a vertex follows from its neighbours by their places alone, and what can be said beyond that.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "runtime/codec/neighbours.hpp"

namespace carillon::codec {

/// The best linear prediction of a smooth field at a vertex from its neighbours, and of its gradient there times their mean distance h.
///
/// Method:  kriging with the covariance 1 / (1 + (0.3 r)^2) + 100 (1 + x . x'), r and x in units of h about the vertex; the second term
/// lets
///          any linear field pass. 1e-4 on the diagonal stands for the rounding of the neighbours.
/// Source:  kriging: Matheron 1963; the covariance, an inverse multiquadric: Hardy 1971, positive definite by Micchelli 1986.
struct Stencil {
  std::array<double, kNeighbours> value{};                    // weights of the neighbours
  std::array<std::array<double, kNeighbours>, 3> gradient{};  // along each axis
  std::array<std::array<double, 3>, kNeighbours> offset{};    // of the neighbours, in units of h
};

/// The stencils of vertices at `centres` (n) with `neighbours` (n), which are among `places`. Any thread.
void calc_stencils(std::span<const Place> centres, std::span<const Neighbours> neighbours, std::span<const Place> places,
                   std::span<Stencil> stencils);

/// What is added to the kriging of a vertex: linear functions of what its neighbours do, as the local form of the body makes them (near an
/// edge or a change of thickness all slow fields bend alike). Coefficients are 3x3 matrices, row-major.
enum class Fit : std::uint8_t {
  kNone = 0,        // kriging alone
  kGradient = 1,    // plus sum over axes j of C_j (gradient along j)
  kDifferences = 2  // plus sum over neighbours k of D_k (neighbour k less value, gradient . offset)
};
inline constexpr std::size_t kGradientNumbers = 27, kDifferenceNumbers = 9 * kNeighbours;

/// The matrix that makes the prediction of a vertex of the rows of its neighbours: three weights, of its x, y and z, for each component of
/// each neighbour in turn.
using Matrix = std::array<float, 3 * 3 * kNeighbours>;

/// gradient (27) and differences (108, or none): the coefficients.
Matrix calc_matrix(const Stencil& stencil, std::span<const float> gradient, std::span<const float> differences);

}  // namespace carillon::codec
