// Method: isosurface stuffing: a body-centred cubic lattice over the body; lattice points close to the surface are snapped onto it;
//   stencils cut the crossing tetrahedra. A quadrilateral face is cut from the corner of the first cubic grid (in one grid, the smaller
//   number), the free one by its shorter diagonal, not by the paper's parity rule; its angle bound (10.7 degrees) is therefore not proven
//   here, and the report measures the angles.
// Source: Labelle and Shewchuk, "Isosurface stuffing: fast tetrahedral meshes with good dihedral angles", ACM TOG 26(3), 2007, sections 3
//   and 4; snapping distances (alpha_long, alpha_short) from table 1, "safe" row.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "precompute/mesher/volume_mesh.hpp"
#include "runtime/base/error.hpp"

namespace carillon::mesher {
namespace {

constexpr double kAlphaLong = 0.24999, kAlphaShort = 0.41189;
// Long edges (three in seven) equal the spacing, short ones 0.866 of it: 0.92 on average.
constexpr double kSpacingPerEdge = 1.08;

using Cell = std::array<std::int32_t, 3>;

/// Lattice: points of the first grid have even, of the second odd coordinates, in half spacings.
class Lattice {
 public:
  Lattice(const DistanceField& field, double wall_m, double spacing_m) : field_(field), wall_m_(wall_m), half_(0.5 * spacing_m) {
    for (int c = 0; c < 3; ++c) {
      const double extent = field.voxel_m * (field.size[c] - 1);
      const auto cells = static_cast<std::int32_t>(std::ceil(extent / spacing_m)) + 1;
      size_[c] = 2 * cells + 2;
      origin_[c] = field.origin[c] + 0.5 * (extent - cells * spacing_m) - 0.31 * half_;
    }
    const double count = 0.25 * static_cast<double>(size_[0]) * size_[1] * size_[2];
    if (count > 5e8)
      throw InputError(
          fmt::format("edges of {:.3g} m would need {:.3g} lattice points; ask for longer ones", spacing_m / kSpacingPerEdge, count));
    const std::size_t slots = static_cast<std::size_t>(size_[0] / 2) * (size_[1] / 2) * (size_[2] / 2) * 2;
    values_.assign(slots, 1.0f);
    for_each_point([&](const Cell& p) { values_[get_slot(p)] = static_cast<float>(calc_body(field_, wall_m_, get_place(p))); });
  }

  std::size_t get_slot(const Cell& p) const {
    const std::size_t cell =
        static_cast<std::size_t>(p[0] / 2) +
        static_cast<std::size_t>(size_[0] / 2) * (static_cast<std::size_t>(p[1] / 2) + static_cast<std::size_t>(size_[1] / 2) * (p[2] / 2));
    return 2 * cell + (p[0] & 1);
  }
  Vec3 get_place(const Cell& p) const { return {origin_[0] + half_ * p[0], origin_[1] + half_ * p[1], origin_[2] + half_ * p[2]}; }
  bool holds(const Cell& p) const { return p[0] >= 0 && p[1] >= 0 && p[2] >= 0 && p[0] < size_[0] && p[1] < size_[1] && p[2] < size_[2]; }
  float& value(const Cell& p) { return values_[get_slot(p)]; }

  template <class Visit>
  void for_each_point(Visit&& visit) const {
    for (std::int32_t k = 0; k < size_[2]; ++k)
      for (std::int32_t j = k & 1; j < size_[1]; j += 2)
        for (std::int32_t i = k & 1; i < size_[0]; i += 2) visit(Cell{i, j, k});
  }

  /// Root of the body function between two points, by bisection.
  Vec3 find_root(Vec3 inside, Vec3 outside) const {
    for (int n = 0; n < 30; ++n) {
      const Vec3 middle = 0.5 * (inside + outside);
      (calc_body(field_, wall_m_, middle) < 0 ? inside : outside) = middle;
    }
    return 0.5 * (inside + outside);
  }

 private:
  const DistanceField& field_;
  double wall_m_, half_;
  Cell size_{};
  Vec3 origin_{};
  std::vector<float> values_;
};

Cell add(const Cell& a, const Cell& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }

/// Fourteen lattice neighbours: six along the axes (long edges), eight along the diagonals (short).
std::vector<Cell> list_neighbours() {
  std::vector<Cell> out;
  for (int axis = 0; axis < 3; ++axis)
    for (const int sign : {-2, 2}) {
      Cell step{};
      step[axis] = sign;
      out.push_back(step);
    }
  for (int n = 0; n < 8; ++n) out.push_back({n & 1 ? 1 : -1, n & 2 ? 1 : -1, n & 4 ? 1 : -1});
  return out;
}

class Stuffer {
 public:
  Stuffer(const DistanceField& field, double wall_m, double spacing_m) : lattice_(field, wall_m, spacing_m) {}

  mesh::TetMesh run() {
    warp();
    lattice_.for_each_point([&](const Cell& p) { add_tets_at(p); });
    out_.regions.assign(out_.tet_count(), 0);
    return std::move(out_);
  }

 private:
  /// Snaps each lattice point to its nearest crossing if that is too close.
  void warp() {
    const auto neighbours = list_neighbours();
    std::vector<std::pair<std::size_t, Vec3>> moves;
    lattice_.for_each_point([&](const Cell& p) {
      const bool inside = lattice_.value(p) < 0;
      const Vec3 place = lattice_.get_place(p);
      double best = 1e300;
      Vec3 target{};
      for (std::size_t n = 0; n < neighbours.size(); ++n) {
        const Cell q = add(p, neighbours[n]);
        if (!lattice_.holds(q) || (lattice_.value(q) < 0) == inside) continue;
        const Vec3 other = lattice_.get_place(q);
        const Vec3 root = inside ? lattice_.find_root(place, other) : lattice_.find_root(other, place);
        const double distance = norm(root - place), part = distance / norm(other - place);
        if (part < (n < 6 ? kAlphaLong : kAlphaShort) && distance < best) best = distance, target = root;
      }
      if (best < 1e300) moves.emplace_back(lattice_.get_slot(p), target);
    });
    for (const auto& [slot, target] : moves) moved_[slot] = target;
  }

  int get_sign(const Cell& p) { return moved_.contains(lattice_.get_slot(p)) ? 0 : lattice_.value(p) < 0 ? 1 : -1; }
  Vec3 get_place(const Cell& p) const {
    const auto found = moved_.find(lattice_.get_slot(p));
    return found == moved_.end() ? lattice_.get_place(p) : found->second;
  }

  std::int32_t number_point(const Cell& p) {
    const auto [found, fresh] = corners_.try_emplace(lattice_.get_slot(p), static_cast<std::int32_t>(out_.nodes_m.size()));
    if (fresh) out_.nodes_m.push_back(get_place(p));
    return found->second;
  }
  std::int32_t number_cut(const Cell& inside, const Cell& outside) {
    const std::array<std::size_t, 2> key{lattice_.get_slot(inside), lattice_.get_slot(outside)};
    const auto [found, fresh] = cuts_.try_emplace(key, static_cast<std::int32_t>(out_.nodes_m.size()));
    if (fresh) out_.nodes_m.push_back(lattice_.find_root(lattice_.get_place(inside), lattice_.get_place(outside)));
    return found->second;
  }

  void add_tet(std::int32_t a, std::int32_t b, std::int32_t c, std::int32_t d) {
    const auto& x = out_.nodes_m;
    if (dot(x[b] - x[a], cross(x[c] - x[a], x[d] - x[a])) < 0) std::swap(c, d);
    out_.tets.insert(out_.tets.end(), {a, b, c, d});
  }

  /// Tetrahedra around the three long edges that start at p: each has such an edge and one of the four across it.
  void add_tets_at(const Cell& p) {
    for (int axis = 0; axis < 3; ++axis) {
      Cell along{};
      along[axis] = 2;
      const Cell q = add(p, along);
      if (!lattice_.holds(q)) continue;
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      constexpr std::array<std::array<int, 2>, 4> kAround{{{1, 1}, {-1, 1}, {-1, -1}, {1, -1}}};
      for (int n = 0; n < 4; ++n) {
        Cell r = p, s = p;
        r[axis] += 1, s[axis] += 1;
        r[u] += kAround[n][0], r[v] += kAround[n][1];
        s[u] += kAround[(n + 1) % 4][0], s[v] += kAround[(n + 1) % 4][1];
        // Each tetrahedron has a long edge of either grid; it is created from the first grid's.
        if ((p[0] & 1) == 0 && lattice_.holds(r) && lattice_.holds(s)) add_cut({p, q, r, s});
      }
    }
  }

  void add_cut(const std::array<Cell, 4>& corners) {
    std::vector<Cell> plus, zero, minus;
    for (const Cell& c : corners) {
      const int sign = get_sign(c);
      (sign > 0 ? plus : sign < 0 ? minus : zero).push_back(c);
    }
    if (plus.empty()) return;
    std::sort(plus.begin(), plus.end(), [&](const Cell& a, const Cell& b) {
      return (a[0] & 1) != (b[0] & 1) ? (a[0] & 1) < (b[0] & 1) : lattice_.get_slot(a) < lattice_.get_slot(b);
    });
    std::vector<std::int32_t> p, z;
    for (const Cell& c : plus) p.push_back(number_point(c));
    for (const Cell& c : zero) z.push_back(number_point(c));
    const auto cut = [&](std::size_t in, std::size_t out) { return number_cut(plus[in], minus[out]); };
    if (minus.empty()) {
      p.insert(p.end(), z.begin(), z.end());
      add_tet(p[0], p[1], p[2], p[3]);
    } else if (plus.size() == 1) {
      for (std::size_t m = 0; m < minus.size(); ++m) z.push_back(cut(0, m));
      add_tet(p[0], z[0], z[1], z[2]);
    } else if (plus.size() == 2 && minus.size() == 1) {  // pyramid with its tip at the zero corner
      const std::int32_t a = cut(0, 0), b = cut(1, 0);
      add_tet(z[0], p[0], p[1], b);
      add_tet(z[0], p[0], b, a);
    } else if (plus.size() == 2) {  // wedge
      const std::int32_t a0 = cut(0, 0), a1 = cut(0, 1), b0 = cut(1, 0), b1 = cut(1, 1);
      add_tet(p[0], p[1], b0, b1);
      const auto& x = out_.nodes_m;
      if (norm(x[a0] - x[b1]) < norm(x[a1] - x[b0])) {
        add_tet(p[0], a0, b1, a1);
        add_tet(p[0], a0, b1, b0);
      } else {
        add_tet(p[0], a1, b0, a0);
        add_tet(p[0], a1, b0, b1);
      }
    } else {  // three inside: prism
      const std::int32_t c0 = cut(0, 0), c1 = cut(1, 0), c2 = cut(2, 0);
      add_tet(p[0], p[1], p[2], c2);
      add_tet(p[0], p[1], c1, c2);
      add_tet(p[0], c0, c1, c2);
    }
  }

  struct CutHash {
    std::size_t operator()(const std::array<std::size_t, 2>& key) const {
      return (key[0] * 0x9E3779B97F4A7C15ull) ^ (key[1] * 0xC2B2AE3D27D4EB4Full >> 7);
    }
  };
  Lattice lattice_;
  std::unordered_map<std::size_t, Vec3> moved_;
  std::unordered_map<std::size_t, std::int32_t> corners_;
  std::unordered_map<std::array<std::size_t, 2>, std::int32_t, CutHash> cuts_;
  mesh::TetMesh out_;
};

}  // namespace

mesh::TetMesh stuff(const DistanceField& field, double wall_m, double edge_m) {
  return Stuffer(field, wall_m, kSpacingPerEdge * edge_m).run();
}

}  // namespace carillon::mesher
