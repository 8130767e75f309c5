// Where a body is struck so that it sounds, and how loud its modes are there.
#pragma once

#include <cstddef>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// Unit normals of the vertices, out of the body: the mean of their triangles', by area; 0 where these cancel.
std::vector<Vec3> calc_vertex_normals(const Bank& bank);

/// A-weighted amplitude of each mode after a unit blow at a vertex along a direction, (m) [Pa / (N s) at 1 m]. By the bank's own gains.
std::vector<double> calc_blow_amplitudes(const Bank& bank, std::size_t vertex, const Vec3& direction);

/// Vertices of the bank: the first where a blow along the normal is heard most, the others as far from those before as they can be while
/// they are heard, too. At most `count`.
std::vector<std::size_t> find_strikes(const Bank& bank, std::size_t count);

/// The time after which nearly all of what a blow makes is over: T60 of its loudest modes [s].
double calc_ring_s(const Bank& bank, std::size_t vertex);

}  // namespace carillon::bank
