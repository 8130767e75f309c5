// Signed distance to a closed triangle surface, sampled on a grid.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Samples of the signed distance (positive outside) at origin + voxel * (i, j, k), x fastest. Exact to float precision from `inside_m`
/// below to `outside_m` above the surface, clamped beyond.
struct DistanceField {
  Vec3 origin{};
  double voxel_m = 0;
  std::array<std::int32_t, 3> size{};
  double outside_m = 0, inside_m = 0;
  std::vector<float> samples;

  float sample(std::int32_t i, std::int32_t j, std::int32_t k) const {
    return samples[static_cast<std::size_t>(i) +
                   static_cast<std::size_t>(size[0]) * (static_cast<std::size_t>(j) + static_cast<std::size_t>(size[1]) * k)];
  }
  /// Trilinear interpolation; points outside the grid are outside the body.
  double calc_distance(const Vec3& p) const;
};

/// `surface` is closed and oriented outward (it may self-intersect: inside is positive winding number). `offset_m` is added to every
/// distance. Throws InputError for more than 400 million samples.
struct FieldReach {
  double outside_m = 0, inside_m = 0;
};
DistanceField calc_distance_field(const TriangleSurface& surface, double voxel_m, const FieldReach& reach, double offset_m);

/// Body within the field: {d < 0}, or with wall_m > 0 the shell {-wall_m < d < 0}. Negative inside.
inline double calc_body(const DistanceField& field, double wall_m, const Vec3& p) {
  const double d = field.calc_distance(p);
  return wall_m > 0 ? (d > -d - wall_m ? d : -d - wall_m) : d;
}

/// Volume of the body, by the inside fraction of each voxel.
double calc_volume(const DistanceField& field, double wall_m);

}  // namespace carillon::mesher
