// Method:     all facets near each facet, found on a grid; inner integrals in closed form, outer ones by seven points on the facet or on
//   its four quarters; all very near neighbours share points, so jumps between neighbours cancel.
// Source:     docs/equations.md E10; seven points of degree five: Radon 1948.
#include "precompute/air/static_part.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <unordered_map>

#include "precompute/air/potentials.hpp"

namespace carillon::air {
namespace {

constexpr double kPerSphere = 1.0 / (4.0 * std::numbers::pi);
constexpr double kNear = 2.5;      // centroid distance over the larger longest edge: corrected
constexpr double kVeryNear = 1.5;  // the same: finer rule

struct OuterPoint {
  std::array<double, 3> hat{};
  double weight = 0.0;  // fraction of the area
};

std::vector<OuterPoint> make_rule(bool is_fine) {
  const double root = std::sqrt(15.0);
  std::vector<OuterPoint> rule{{{1.0 / 3, 1.0 / 3, 1.0 / 3}, 9.0 / 40.0}};
  for (const double sign : {-1.0, 1.0}) {
    const double a = (6.0 + sign * root) / 21.0, weight = (155.0 + sign * root) / 1200.0;
    for (int c = 0; c < 3; ++c) {
      OuterPoint point{{a, a, a}, weight};
      point.hat[c] = 1.0 - 2.0 * a;
      rule.push_back(point);
    }
  }
  if (!is_fine) return rule;
  std::vector<OuterPoint> fine;
  for (int quarter = 0; quarter < 4; ++quarter) {
    for (const OuterPoint& point : rule) {
      OuterPoint moved{{}, point.weight / 4.0};
      for (int c = 0; c < 3; ++c) {
        const std::size_t k = c;
        moved.hat[k] = quarter == 3 ? (1.0 - point.hat[k]) / 2.0 : (point.hat[k] + (c == quarter ? 1.0 : 0.0)) / 2.0;
      }
      fine.push_back(moved);
    }
  }
  return fine;
}

/// Facets by centroid: one grid per size class.
class Neighbours {
 public:
  explicit Neighbours(const RadiatingSurface& surface) : facets_(surface.get_facets()) {
    for (const Facet& facet : facets_)
      centroids_.push_back((1.0 / 3.0) * (surface.get_nodes()[facet.corners[0]] + surface.get_nodes()[facet.corners[1]] +
                                          surface.get_nodes()[facet.corners[2]]));
    for (std::size_t t = 0; t < facets_.size(); ++t) {
      const int level = find_level(facets_[t].size_m);
      lowest_ = std::min(lowest_, level);
      highest_ = std::max(highest_, level);
      cells_[find_cell(centroids_[t], level)].push_back(static_cast<std::int32_t>(t));
    }
  }

  const Vec3& get_centroid(std::size_t facet) const { return centroids_[facet]; }

  /// Facets whose centroid is nearer than kNear times the larger of both sizes, ascending.
  void find(std::size_t facet, std::vector<std::int32_t>& found) const {
    found.clear();
    const double size = facets_[facet].size_m;
    for (int level = lowest_; level <= highest_; ++level) {
      const double reach = kNear * std::max(size, std::ldexp(1.0, level)), side = std::ldexp(1.0, level);
      const auto low = find_index(centroids_[facet] - Vec3{reach, reach, reach}, side);
      const auto high = find_index(centroids_[facet] + Vec3{reach, reach, reach}, side);
      for (auto x = low[0]; x <= high[0]; ++x)
        for (auto y = low[1]; y <= high[1]; ++y)
          for (auto z = low[2]; z <= high[2]; ++z) {
            const auto cell = cells_.find(make_key({x, y, z}, level));
            if (cell == cells_.end()) continue;
            for (const std::int32_t other : cell->second)
              if (norm(centroids_[other] - centroids_[facet]) < kNear * std::max(size, facets_[other].size_m)) found.push_back(other);
          }
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());  // cells may share a hash
  }

 private:
  static int find_level(double size) { return static_cast<int>(std::ceil(std::log2(size))); }
  static std::array<std::int64_t, 3> find_index(const Vec3& place, double side) {
    return {static_cast<std::int64_t>(std::floor(place[0] / side)), static_cast<std::int64_t>(std::floor(place[1] / side)),
            static_cast<std::int64_t>(std::floor(place[2] / side))};
  }
  static std::uint64_t make_key(const std::array<std::int64_t, 3>& index, int level) {
    std::uint64_t key = static_cast<std::uint64_t>(level + 4096);
    for (const std::int64_t i : index) key = (key ^ static_cast<std::uint64_t>(i)) * 0x9e3779b97f4a7c15ULL + (key >> 29);
    return key;
  }
  std::uint64_t find_cell(const Vec3& place, int level) const { return make_key(find_index(place, std::ldexp(1.0, level)), level); }

  const std::vector<Facet>& facets_;
  std::vector<Vec3> centroids_;
  std::unordered_map<std::uint64_t, std::vector<std::int32_t>> cells_;
  int lowest_ = 4096, highest_ = -4096;
};

/// True if the midpoint rule omits the static kernels of this pair of points; in single precision, like the midpoint rule.
bool are_near(const EdgePoint& a, const EdgePoint& b) {
  float squared = 0.0F;
  for (std::size_t k = 0; k < 3; ++k) {
    const float d = static_cast<float>(a.place_m[k]) - static_cast<float>(b.place_m[k]);
    squared += d * d;
  }
  const float reach = kNearPoints * std::max(static_cast<float>(a.size_m), static_cast<float>(b.size_m));
  return squared < reach * reach;
}

/// Integrals over one pair of facets, without 1 / 4 pi.
struct Pair {
  double plain = 0.0;              // of 1 / R
  double single[3][3] = {};        // of lambda_i lambda_j / R
  double double_layer[3][3] = {};  // of lambda_i lambda_j d(1 / R) / dn_y
  double adjoint[3][3] = {};       // of lambda_i lambda_j d(1 / R) / dn_x
};

void add_exact(const RadiatingSurface& surface, const Facet& outer, const Facet& inner, const std::vector<OuterPoint>& rule, Pair& pair) {
  const std::vector<Vec3>& nodes = surface.get_nodes();
  const std::array<Vec3, 3> corners{nodes[inner.corners[0]], nodes[inner.corners[1]], nodes[inner.corners[2]]};
  for (const OuterPoint& point : rule) {
    Vec3 x{};
    for (std::size_t c = 0; c < 3; ++c) x = x + point.hat[c] * nodes[outer.corners[c]];
    Potentials found = calc_potentials(corners, inner.normal, inner.curl, x);
    if (&outer == &inner) found.double_layer = {};
    const double weight = point.weight * outer.area_m2;
    pair.plain += weight * found.constant;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) {
        const double share = weight * point.hat[i];
        pair.single[i][j] += share * found.single[j];
        pair.double_layer[i][j] += share * found.double_layer[j];
        if (&outer != &inner) pair.adjoint[i][j] += share * dot(outer.normal, found.gradient[j]);
      }
  }
}

void subtract_midpoints(const RadiatingSurface& surface, const Facet& outer, const Facet& inner, Pair& pair) {
  const std::vector<EdgePoint>& points = surface.get_points();
  const double area = outer.area_m2 * inner.area_m2 / 9.0;
  for (std::size_t s = 0; s < 3; ++s)
    for (std::size_t t = 0; t < 3; ++t) {
      const EdgePoint &x = points[outer.points[s]], &y = points[inner.points[t]];
      if (are_near(x, y)) continue;
      const Vec3 d = x.place_m - y.place_m;
      const double r = norm(d), single = area / r, gradient = area / (r * r * r);
      const double to_inner = gradient * dot(d, inner.normal), to_outer = -gradient * dot(d, outer.normal);
      pair.plain -= single;
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j) {
          if (i == s || j == t) continue;  // the hat function is 0 at the midpoint opposite its corner, and 1/2 at the others
          pair.single[i][j] -= single / 4.0;
          pair.double_layer[i][j] -= to_inner / 4.0;
          pair.adjoint[i][j] -= to_outer / 4.0;
        }
    }
}

}  // namespace

std::size_t StaticPart::calc_bytes() const {
  return first.size() * sizeof(std::size_t) + column.size() * (sizeof(std::int32_t) + 3 * sizeof(double)) +
         (single.size() + adjoint.size()) * sizeof(double);
}

StaticPart make_static_part(const RadiatingSurface& surface, std::span<const float> velocity, std::size_t count, std::size_t first_row,
                            std::size_t last_row) {
  const std::vector<Facet>& facets = surface.get_facets();
  const std::size_t rows = last_row - first_row;
  const auto is_mine = [&](std::int32_t node) {
    return static_cast<std::size_t>(node) >= first_row && static_cast<std::size_t>(node) < last_row;
  };
  const Neighbours neighbours(surface);
  std::vector<std::vector<std::int32_t>> near(facets.size()), columns(rows);
  for (std::size_t s = 0; s < facets.size(); ++s) {
    if (std::none_of(facets[s].corners.begin(), facets[s].corners.end(), is_mine)) continue;
    neighbours.find(s, near[s]);
    for (const std::int32_t node : facets[s].corners) {
      if (!is_mine(node)) continue;
      std::vector<std::int32_t>& row = columns[static_cast<std::size_t>(node) - first_row];
      for (const std::int32_t t : near[s]) row.insert(row.end(), facets[t].corners.begin(), facets[t].corners.end());
      std::sort(row.begin(), row.end());
      row.erase(std::unique(row.begin(), row.end()), row.end());
    }
  }
  StaticPart part;
  part.first.assign(1, 0);
  for (const auto& row : columns) {
    part.column.insert(part.column.end(), row.begin(), row.end());
    part.first.push_back(part.column.size());
  }
  part.double_layer.resize(part.column.size());
  part.normals.resize(part.column.size());
  part.curls.resize(part.column.size());
  part.single.resize(rows * count);
  part.adjoint.resize(rows * count);
  const std::vector<OuterPoint> fine = make_rule(true), coarse = make_rule(false);
  for (std::size_t s = 0; s < facets.size(); ++s) {
    const Facet& outer = facets[s];
    for (const std::int32_t t : near[s]) {
      const Facet& inner = facets[t];
      const double reach = kVeryNear * std::max(outer.size_m, inner.size_m);
      const bool is_very_near = norm(neighbours.get_centroid(s) - neighbours.get_centroid(static_cast<std::size_t>(t))) < reach;
      Pair pair;
      add_exact(surface, outer, inner, is_very_near ? fine : coarse, pair);
      subtract_midpoints(surface, outer, inner, pair);
      const double normals = dot(outer.normal, inner.normal);
      for (std::size_t i = 0; i < 3; ++i) {
        if (!is_mine(outer.corners[i])) continue;
        const std::size_t row = static_cast<std::size_t>(outer.corners[i]) - first_row;
        const auto begin = part.column.begin() + static_cast<std::ptrdiff_t>(part.first[row]);
        const auto end = part.column.begin() + static_cast<std::ptrdiff_t>(part.first[row + 1]);
        for (std::size_t j = 0; j < 3; ++j) {
          const std::size_t at = std::lower_bound(begin, end, inner.corners[j]) - part.column.begin();
          part.double_layer[at] += kPerSphere * pair.double_layer[i][j];
          part.normals[at] += kPerSphere * normals * pair.single[i][j];
          part.curls[at] += kPerSphere * dot(outer.curl[i], inner.curl[j]) * pair.plain;
          const float* v = &velocity[(t * 3 + j) * count];
          double *single = &part.single[row * count], *adjoint = &part.adjoint[row * count];
          const double by_single = kPerSphere * pair.single[i][j], by_adjoint = kPerSphere * pair.adjoint[i][j];
          for (std::size_t n = 0; n < count; ++n) {
            single[n] += by_single * v[n];
            adjoint[n] += by_adjoint * v[n];
          }
        }
      }
    }
  }
  return part;
}

StaticPart share_static_part(const comm::Communicator& comm, const RadiatingSurface& surface, std::span<const float> velocity,
                             std::size_t count) {
  const std::size_t nodes = surface.count_nodes(), ranks = comm.size(), rank = comm.rank();
  StaticPart own = comm.agree([&] { return make_static_part(surface, velocity, count, nodes * rank / ranks, nodes * (rank + 1) / ranks); });
  if (ranks == 1) return own;
  const std::vector<std::size_t> sizes = comm.all_gather([&] {
    std::vector<std::size_t> list;
    for (std::size_t row = 1; row < own.first.size(); ++row) list.push_back(own.first[row] - own.first[row - 1]);
    return list;
  });
  comm.agree([&] {
    own.first.assign(1, 0);
    for (const std::size_t size : sizes) own.first.push_back(own.first.back() + size);
  });
  own.column = comm.all_gather(own.column);
  for (auto* values : {&own.double_layer, &own.normals, &own.curls, &own.single, &own.adjoint}) *values = comm.all_gather(*values);
  return own;
}

}  // namespace carillon::air
