// Method: distance in a band around the surface by propagating the nearest triangle between samples; sign from the
//   winding number, by crossings of the surface with one line along x per sample row. A flood fill would fill closed cavities and needs a
//   watertight surface; the winding number does not and merges overlapping parts.
// Source: tie rule of the crossings: "simulation of simplicity" of Edelsbrunner and Muecke 1990 (infinitesimal shift of the line).
#include "precompute/mesher/distance_field.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "precompute/mesher/triangle_surface.hpp"
#include "runtime/base/error.hpp"

namespace carillon::mesher {
namespace {

// Method: grid points within a voxel of a triangle get their exact distance; then every point offers its triangle to its 26 neighbours,
//   which take it if nearer, from a queue until nothing changes (only a band is filled, so no sweeps). A point whose nearest triangle is
//   none of its neighbours' gets a larger distance; the largest error is 0.06 voxels on a ball with noise of a third of its edges, below a
//   thousandth on smooth bodies (distances_test.cpp).
// Source: closest point on a triangle by Voronoi regions: Ericson, Real-Time Collision Detection, 2005, section 5.1.5. Propagation:
//   Danielsson, "Euclidean distance mapping", CGIP 14, 1980, with triangles instead of vectors.

// Triangles are split until their boxes are at most this many voxels wide, so that a large one does not fill its whole box.
constexpr double kBox = 4;
// Least improvement, in squared voxels: prevents endless swaps by rounding.
constexpr float kNearer = 1e-6f;

struct Corners {
  std::array<float, 3> a, ab, ac;
  float ab_ab, ab_ac, ac_ac;
};

float dot3(const std::array<float, 3>& a, const std::array<float, 3>& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// Squared distance of p to the triangle.
float calc_square(const Corners& t, const std::array<float, 3>& p) {
  const std::array<float, 3> ap{p[0] - t.a[0], p[1] - t.a[1], p[2] - t.a[2]};
  const float d1 = dot3(t.ab, ap), d2 = dot3(t.ac, ap);
  // Nearest point: a + v ab + w ac.
  float v = 0, w = 0;
  const float d3 = d1 - t.ab_ab, d4 = d2 - t.ab_ac, d5 = d1 - t.ab_ac, d6 = d2 - t.ac_ac;
  const float vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  if (d1 <= 0 && d2 <= 0) {
  } else if (d3 >= 0 && d4 <= d3) {
    v = 1;
  } else if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    v = t.ab_ab > 0 ? d1 / t.ab_ab : 0;
  } else if (d6 >= 0 && d5 <= d6) {
    w = 1;
  } else if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    w = t.ac_ac > 0 ? d2 / t.ac_ac : 0;
  } else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const float sum = (d4 - d3) + (d5 - d6);
    w = sum > 0 ? (d4 - d3) / sum : 0;
    v = 1 - w;
  } else {
    const float sum = va + vb + vc;
    v = vb / sum;
    w = vc / sum;
  }
  float square = 0;
  for (int c = 0; c < 3; ++c) {
    const float off = ap[c] - v * t.ab[c] - w * t.ac[c];
    square += off * off;
  }
  return square;
}

class Filler {
 public:
  Filler(const TriangleSurface& surface, const std::array<std::int32_t, 3>& size) : size_(size) {
    for (const Triangle& t : surface.triangles) {
      const Vec3 &a = surface.points[t[0]], ab = surface.points[t[1]] - a, ac = surface.points[t[2]] - a;
      Corners corners{};
      for (int c = 0; c < 3; ++c) {
        corners.a[c] = static_cast<float>(a[c]);
        corners.ab[c] = static_cast<float>(ab[c]);
        corners.ac[c] = static_cast<float>(ac[c]);
      }
      corners.ab_ab = dot3(corners.ab, corners.ab);
      corners.ab_ac = dot3(corners.ab, corners.ac);
      corners.ac_ac = dot3(corners.ac, corners.ac);
      triangles_.push_back(corners);
    }
    const std::size_t count = static_cast<std::size_t>(size[0]) * size[1] * size[2];
    samples_.assign(count, {});
    for (std::int32_t f = 0; f < static_cast<std::int32_t>(triangles_.size()); ++f) {
      const Triangle& t = surface.triangles[f];
      seed(f, {surface.points[t[0]], surface.points[t[1]], surface.points[t[2]]});
    }
  }

  /// Propagates triangles to points nearer than reach[inside].
  void spread(const std::vector<char>& inside, const std::array<double, 2>& reach) {
    const std::array<float, 2> max{static_cast<float>(reach[0] * reach[0]), static_cast<float>(reach[1] * reach[1])};
    std::vector<std::array<std::int32_t, 3>> queue, next;
    std::vector<char> queued(samples_.size(), 0);
    for (std::int32_t k = 0; k < size_[2]; ++k)
      for (std::int32_t j = 0; j < size_[1]; ++j)
        for (std::int32_t i = 0; i < size_[0]; ++i)
          if (samples_[at(i, j, k)].nearest >= 0) queue.push_back({i, j, k});
    while (!queue.empty()) {
      for (const auto& [i, j, k] : queue) {
        const std::size_t from = at(i, j, k);
        queued[from] = 0;
        const Sample here = samples_[from];
        const std::int32_t f = here.nearest;
        const Corners& triangle = triangles_[f];
        const float own = std::sqrt(here.square);
        for (std::int32_t z = std::max(k - 1, 0); z <= std::min(k + 1, size_[2] - 1); ++z)
          for (std::int32_t y = std::max(j - 1, 0); y <= std::min(j + 1, size_[1] - 1); ++y)
            for (std::int32_t x = std::max(i - 1, 0); x <= std::min(i + 1, size_[0] - 1); ++x) {
              const std::size_t to = at(x, y, z);
              Sample& other = samples_[to];
              // A nearer one was processed before, or will be.
              if (other.nearest == f || other.square < here.square) continue;
              // Lower bound of the distance by the triangle inequality.
              const int steps = std::abs(x - i) + std::abs(y - j) + std::abs(z - k);
              const float min = own - kStep[steps];
              if (min > 0 && min * min >= other.square) continue;
              const float square = calc_square(triangle, {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)});
              if (!(square < other.square - kNearer) || square > max[inside[to]]) continue;
              other = {square, f};
              if (!queued[to]) next.push_back({x, y, z});
              queued[to] = 1;
            }
      }
      queue.swap(next);
      next.clear();
    }
  }

  void copy_to(const std::vector<char>& inside, const std::array<double, 2>& reach, std::vector<float>& distance) const {
    for (std::size_t n = 0; n < samples_.size(); ++n)
      if (samples_[n].nearest >= 0 && samples_[n].square <= reach[inside[n]] * reach[inside[n]])
        distance[n] = std::sqrt(samples_[n].square);
  }

 private:
  static constexpr std::array<float, 4> kStep{0, 1.000001f, 1.414215f, 1.732052f};

  std::size_t at(std::int32_t i, std::int32_t j, std::int32_t k) const {
    return static_cast<std::size_t>(i) +
           static_cast<std::size_t>(size_[0]) * (static_cast<std::size_t>(j) + static_cast<std::size_t>(size_[1]) * k);
  }

  /// Exact distances to triangle f in the voxels around `part` of it.
  void seed(std::int32_t f, const std::array<Vec3, 3>& part) {
    std::array<std::int32_t, 3> low, high;
    double widest = 0;
    for (int c = 0; c < 3; ++c) {
      const auto [min, max] = std::minmax({part[0][c], part[1][c], part[2][c]});
      widest = std::max(widest, max - min);
      low[c] = std::max(static_cast<std::int32_t>(std::floor(min)), 0);
      high[c] = std::min(static_cast<std::int32_t>(std::ceil(max)), size_[c] - 1);
    }
    if (widest > kBox) {
      const Vec3 ab = 0.5 * (part[0] + part[1]), bc = 0.5 * (part[1] + part[2]), ca = 0.5 * (part[2] + part[0]);
      seed(f, {part[0], ab, ca});
      seed(f, {ab, part[1], bc});
      seed(f, {ca, bc, part[2]});
      seed(f, {ab, bc, ca});
      return;
    }
    for (std::int32_t k = low[2]; k <= high[2]; ++k)
      for (std::int32_t j = low[1]; j <= high[1]; ++j)
        for (std::int32_t i = low[0]; i <= high[0]; ++i) {
          const float square = calc_square(triangles_[f], {static_cast<float>(i), static_cast<float>(j), static_cast<float>(k)});
          const std::size_t n = at(i, j, k);
          if (square < samples_[n].square) samples_[n] = {square, f};
        }
  }

  std::array<std::int32_t, 3> size_;
  std::vector<Corners> triangles_;
  struct Sample {
    float square = HUGE_VALF;   // of the distance to
    std::int32_t nearest = -1;  // this triangle, -1: none yet
  };
  std::vector<Sample> samples_;
};

/// Fills `distance` (a grid of size[0] x size[1] x size[2], x fastest) with the distance in voxels of each grid point (i, j, k) to the
/// surface, given in voxels from the grid origin. Points farther than reach[inside[n]] voxels keep their value. `inside`: 0 or 1 per point.
void fill_distances(const TriangleSurface& surface, const std::array<std::int32_t, 3>& size, const std::vector<char>& inside,
                    const std::array<double, 2>& reach, std::vector<float>& distance) {
  Filler filler(surface, size);
  filler.spread(inside, reach);
  filler.copy_to(inside, reach, distance);
}

/// Twice the signed area of (a, b, p) in the yz plane, with the sign for p shifted by (eps, eps^2): never 0 for a != b. Computed from the
/// lower to the higher index, so both triangles of an edge get exactly opposite signs.
double calc_side(const Vec3& a, const Vec3& b, double y, double z) {
  const double side = (b[1] - a[1]) * (z - a[2]) - (b[2] - a[2]) * (y - a[1]);
  if (side != 0) return side;
  if (b[2] != a[2]) return a[2] - b[2];
  return b[1] - a[1];
}

struct Crossing {
  float x;
  std::int8_t turn;
};

/// All crossings of the surface with sample rows: x, and +1 where the row enters the body.
void collect_crossings(const TriangleSurface& surface, const DistanceField& field, std::vector<std::vector<Crossing>>& rows) {
  for (const Triangle& t : surface.triangles) {
    std::array<const Vec3*, 3> p;
    for (int c = 0; c < 3; ++c) p[c] = &surface.points[t[c]];
    const auto range = [&](int axis) {
      const auto [low, high] = std::minmax({(*p[0])[axis], (*p[1])[axis], (*p[2])[axis]});
      const auto first = static_cast<std::int32_t>(std::floor((low - field.origin[axis]) / field.voxel_m));
      const auto last = static_cast<std::int32_t>(std::ceil((high - field.origin[axis]) / field.voxel_m));
      return std::array{std::max(first, 0), std::min(last, field.size[axis] - 1)};
    };
    const auto rows_y = range(1), rows_z = range(2);
    for (std::int32_t k = rows_z[0]; k <= rows_z[1]; ++k)
      for (std::int32_t j = rows_y[0]; j <= rows_y[1]; ++j) {
        const double y = field.origin[1] + j * field.voxel_m, z = field.origin[2] + k * field.voxel_m;
        std::array<double, 3> side;
        for (int c = 0; c < 3; ++c) {
          const int a = c, b = (c + 1) % 3;
          side[c] = t[a] < t[b] ? calc_side(*p[a], *p[b], y, z) : -calc_side(*p[b], *p[a], y, z);
        }
        const bool positive = side[0] > 0 && side[1] > 0 && side[2] > 0, negative = side[0] < 0 && side[1] < 0 && side[2] < 0;
        if (!positive && !negative) continue;
        const double sum = side[0] + side[1] + side[2];
        const double x = (side[1] * (*p[0])[0] + side[2] * (*p[1])[0] + side[0] * (*p[2])[0]) / sum;
        // A normal with positive x component (counter-clockwise in yz) faces +x: the row leaves the body here.
        rows[static_cast<std::size_t>(j) + static_cast<std::size_t>(field.size[1]) * k].push_back(
            {static_cast<float>((x - field.origin[0]) / field.voxel_m), static_cast<std::int8_t>(positive ? -1 : 1)});
      }
  }
}

/// 1 for every sample inside the surface.
std::vector<char> find_inside(const TriangleSurface& surface, const DistanceField& field) {
  std::vector<std::vector<Crossing>> rows(static_cast<std::size_t>(field.size[1]) * field.size[2]);
  collect_crossings(surface, field, rows);
  std::vector<char> inside(field.samples.size(), 0);
  for (std::size_t row = 0; row < rows.size(); ++row) {
    auto& crossings = rows[row];
    if (crossings.empty()) continue;
    std::sort(crossings.begin(), crossings.end(),
              [](const Crossing& a, const Crossing& b) { return a.x != b.x ? a.x < b.x : a.turn > b.turn; });
    std::size_t next = 0;
    int winding = 0;
    for (std::int32_t i = 0; i < field.size[0]; ++i) {
      for (; next < crossings.size() && crossings[next].x <= static_cast<float>(i); ++next) winding += crossings[next].turn;
      inside[row * static_cast<std::size_t>(field.size[0]) + i] = winding > 0;
    }
  }
  return inside;
}

}  // namespace

double DistanceField::calc_distance(const Vec3& p) const {
  std::array<std::int32_t, 3> cell;
  std::array<double, 3> f;
  for (int c = 0; c < 3; ++c) {
    const double x = (p[c] - origin[c]) / voxel_m;
    if (!(x >= 0) || x > size[c] - 1) return outside_m;
    cell[c] = std::min(static_cast<std::int32_t>(x), size[c] - 2);
    f[c] = x - cell[c];
  }
  const std::size_t nx = size[0], nxy = nx * size[1];
  const float* s = samples.data() + cell[0] + nx * cell[1] + nxy * cell[2];
  const auto along_x = [&](const float* q) { return q[0] + f[0] * (q[1] - q[0]); };
  const double y0 = along_x(s) + f[1] * (along_x(s + nx) - along_x(s));
  const double y1 = along_x(s + nxy) + f[1] * (along_x(s + nxy + nx) - along_x(s + nxy));
  return y0 + f[2] * (y1 - y0);
}

DistanceField calc_distance_field(const TriangleSurface& surface, double voxel_m, const FieldReach& reach, double offset_m) {
  constexpr float kFar = 1e9f;  // in voxels
  constexpr double kMaxSamples = 4e8;
  const Box box = calc_box(surface.points);
  DistanceField field;
  field.voxel_m = voxel_m;
  field.outside_m = reach.outside_m;
  field.inside_m = reach.inside_m;
  double count = 1;
  constexpr int kMargin = 3;
  for (int c = 0; c < 3; ++c) {
    const double cells = std::ceil(box.extent()[c] / voxel_m) + 2 * kMargin;
    count *= cells + 1;
    if (!(count <= kMaxSamples))
      throw InputError(
          fmt::format("a distance field of {:.3g} m voxels over a body of {:.3g} m diagonal has more than {:.0f} million samples; "
                      "ask for longer edges (--edge), fewer nodes or a thicker wall",
                      voxel_m, box.diagonal(), kMaxSamples / 1e6));
    field.size[c] = static_cast<std::int32_t>(cells) + 1;
    // Offset by an odd fraction of a voxel, so that flat faces of the box avoid the samples.
    field.origin[c] = 0.5 * (box.low[c] + box.high[c]) - voxel_m * (0.5 * cells + 0.0137 * (c + 1));
  }
  field.samples.assign(static_cast<std::size_t>(field.size[0]) * field.size[1] * field.size[2], kFar);

  TriangleSurface scaled = surface;
  for (Vec3& p : scaled.points) p = (1 / voxel_m) * (p - field.origin);
  const std::vector<char> inside = find_inside(surface, field);
  fill_distances(scaled, field.size, inside, {reach.outside_m / voxel_m, (reach.inside_m + offset_m) / voxel_m}, field.samples);
  for (std::size_t n = 0; n < field.samples.size(); ++n) {
    const double d = (inside[n] ? -1.0 : 1.0) * voxel_m * field.samples[n] + offset_m;
    field.samples[n] = static_cast<float>(std::clamp(d, -field.inside_m, field.outside_m));
  }
  return field;
}

double calc_volume(const DistanceField& field, double wall_m) {
  // Each sample represents its voxel; fraction inside for a plane at the sample's distance.
  double voxels = 0;
  for (const float sample : field.samples) {
    const double outer = std::clamp(0.5 - sample / field.voxel_m, 0.0, 1.0);
    const double inner = wall_m > 0 ? std::clamp(0.5 - (sample + wall_m) / field.voxel_m, 0.0, 1.0) : 0;
    voxels += outer - inner;
  }
  return voxels * field.voxel_m * field.voxel_m * field.voxel_m;
}

}  // namespace carillon::mesher
