// Method: distance in a band around the surface by propagating the nearest triangle between samples (nearest_triangle.hpp); sign from the
//   winding number, by crossings of the surface with one line along x per sample row. A flood fill would fill closed cavities and needs a
//   watertight surface; the winding number does not and merges overlapping parts.
// Source: tie rule of the crossings: "simulation of simplicity" of Edelsbrunner and Muecke 1990 (infinitesimal shift of the line).
#include "precompute/mesher/distance_field.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "precompute/mesher/nearest_triangle.hpp"
#include "runtime/base/error.hpp"

namespace carillon::mesher {
namespace {

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
