// Strike positions of a body and the loudness of its modes there.
#pragma once

#include <cstddef>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// Outward unit normals of the vertices: area-weighted mean of the adjacent triangles; 0 if these cancel.
std::vector<Vec3> calc_vertex_normals(const Bank& bank);

/// A-weighted amplitude of each mode after a unit blow at a vertex along a direction, (m) [Pa / (N s) at 1 m], by the bank's gains.
std::vector<double> calc_blow_amplitudes(const Bank& bank, std::size_t vertex, const Vec3& direction);

/// Strike positions: the first is the vertex with the loudest blow along its normal, each further one is as far as possible from those
/// before among vertices loud enough. At most `count`.
std::vector<std::size_t> find_strikes(const Bank& bank, std::size_t count);

/// Duration of a blow's sound: T60 of its loudest modes [s].
double calc_ring_s(const Bank& bank, std::size_t vertex);

}  // namespace carillon::bank
