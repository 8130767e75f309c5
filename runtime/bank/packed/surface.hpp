// The surface of a packed bank: vertices on a lattice, in levels from coarse to fine, and triangles.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/bank/packed/border.hpp"

namespace carillon::packed {

using Place = std::array<std::int32_t, 3>;  // in steps of the lattice

/// Coordinates are at most this, so that squares of distances are exact.
inline constexpr std::int32_t kMaxPlace = 1 << 24;
inline constexpr std::size_t kMaxLevels = 32;

/// V vertices, T triangles, L levels. A vertex is at origin + step * place.
struct Surface {
  Vec3 origin_m{};
  double step_m = 0.0;
  std::vector<Place> places;             // (V), level by level, and within one along a curve that fills space
  std::vector<Triangle> triangles;       // (T)
  std::vector<std::size_t> level_begin;  // (L + 1), from 0 to V: level l is [level_begin[l], level_begin[l + 1])

  std::size_t level_count() const { return level_begin.size() - 1; }
  Vec3 find_vertex(std::size_t vertex) const {
    Vec3 x;
    for (std::size_t k = 0; k < 3; ++k) x[k] = origin_m[k] + step_m * places[vertex][k];
    return x;
  }
};

/// What the triangles of a packed surface were before.
struct TriangleOrder {
  std::vector<std::int32_t> before;  // (T) the number that packed triangle i had
  std::vector<std::uint8_t> first;   // (T) which of its corners now was the first
};
std::vector<std::uint8_t> write_order(const TriangleOrder& order);
/// Puts triangles back. Untrusted as read_surface(): every number occurs once.
void restore_order(std::span<const std::byte> bytes, std::vector<Triangle>& triangles, const std::string& name);

/// Reads what write_surface() has written. Untrusted: InputError unless the bytes give such a surface, which need not be closed; it takes
/// no more memory than find_most_unpacked() of the bytes. `name` is the file.
///
/// Method: triangles follow one another over open edges, breadth first; the third corner is the next vertex, or one of the neighbours along
/// the border (Touma and Gotsman 1998 and Rossignac 1999 in kind), and seldom another one. A new vertex is predicted by the parallelogram
/// with the triangle behind the edge (Touma and Gotsman).
Surface read_surface(std::span<const std::byte> bytes, const std::string& name);

/// The order of a packed surface: vertices by their levels, within a level by Morton's curve, and of one place as they come.
std::vector<std::int32_t> find_order(std::span<const Place> places, std::span<const std::uint8_t> level);

/// The bytes of a surface whose vertices and triangles may lie in any order, and the order in which read_surface() gives them.
struct WrittenSurface {
  std::vector<std::uint8_t> bytes;
  std::vector<std::int32_t> vertices;   // (V) that it has in this order
  std::vector<std::int32_t> triangles;  // (T)
};

/// `places` (V) within +-kMaxPlace, `triangles` (T) closed and oriented: each edge belongs to two triangles and is passed once in each
/// direction; every vertex has a triangle. `level` (V): from 0, none empty, fewer than kMaxLevels.
WrittenSurface write_surface(const Vec3& origin_m, double step_m, const std::vector<Place>& places, const std::vector<Triangle>& triangles,
                             const std::vector<std::uint8_t>& level);

}  // namespace carillon::packed
