// Surface of a packed bank: vertices on a lattice, in levels from coarse to fine, and triangles.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "runtime/bank/packed/border.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::packed {

using Place = std::array<std::int32_t, 3>;  // lattice coordinates

/// Limit of coordinates, for exact squared distances.
inline constexpr std::int32_t kMaxPlace = 1 << 24;
inline constexpr std::size_t kMaxLevels = 32;

/// V vertices, T triangles, L levels. Vertex position: origin + step * place.
struct Surface {
  Vec3 origin_m{};
  double step_m = 0.0;
  std::vector<Place> places;             // (V), by level, then along a space-filling curve
  std::vector<Triangle> triangles;       // (T)
  std::vector<std::size_t> level_begin;  // (L + 1), from 0 to V: level l is [level_begin[l], level_begin[l + 1])

  std::size_t level_count() const { return level_begin.size() - 1; }
  Vec3 find_vertex(std::size_t vertex) const {
    Vec3 x;
    for (std::size_t k = 0; k < 3; ++k) x[k] = origin_m[k] + step_m * places[vertex][k];
    return x;
  }
};

/// Original order of the triangles of a packed surface.
struct TriangleOrder {
  std::vector<std::int32_t> before;  // (T) original index of packed triangle i
  std::vector<std::uint8_t> first;   // (T) its current corner that was the first
};
std::vector<std::uint8_t> write_order(const TriangleOrder& order);
/// Restores the order. Untrusted bytes as in read_surface(): each index must occur once.
void restore_order(std::span<const std::byte> bytes, std::vector<Triangle>& triangles, const std::string& name);

/// Decodes the bytes of write_surface(). Untrusted: InputError unless they give such a surface (not necessarily closed); memory is bounded
/// by find_most_unpacked(). `name` is the file.
///
/// Method: breadth-first traversal over open edges; the third corner is a new vertex or a neighbour along the border (as in Touma and
/// Gotsman 1998 and Rossignac 1999), rarely another one. New vertices are predicted by the parallelogram rule (Touma and Gotsman).
Surface read_surface(std::span<const std::byte> bytes, const std::string& name);

/// Vertex order of a packed surface: by level, then along Morton's curve; stable.
std::vector<std::int32_t> find_order(std::span<const Place> places, std::span<const std::uint8_t> level);

/// Bytes of a surface given in any order, and its order when read by read_surface().
struct WrittenSurface {
  std::vector<std::uint8_t> bytes;
  std::vector<std::int32_t> vertices;   // (V) original indices in this order
  std::vector<std::int32_t> triangles;  // (T)
};

/// `places` (V) within +-kMaxPlace, `triangles` (T) closed and oriented: each edge belongs to two triangles, once in each direction; no
/// unused vertices. `level` (V): from 0, none empty, fewer than kMaxLevels.
WrittenSurface write_surface(const Vec3& origin_m, double step_m, const std::vector<Place>& places, const std::vector<Triangle>& triangles,
                             const std::vector<std::uint8_t>& level);

}  // namespace carillon::packed
