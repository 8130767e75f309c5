#include "runtime/exchange/struck_point.hpp"

#include <fmt/format.h>

#include "runtime/bank/nearest.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::exchange {
StruckPoint find_struck_point(const bank::Bank& bank, const Vec3& point_m) {
  const bank::NearestPlace found = bank::find_nearest(bank, point_m);
  const auto [low, high] = bank::find_extent(bank.vertices_m);
  if (found.triangle < 0 || !(found.distance_m <= bank::kFarthestShare * norm(high - low)))
    throw InputError(fmt::format("[{:g}, {:g}, {:g}] is not near the surface; give metres", point_m[0], point_m[1], point_m[2]));
  const Vec3 across = bank::calc_normal(bank.vertices_m, bank.triangles[found.triangle]);
  StruckPoint struck{.point_m = found.point_m};
  if (norm(across) > 0.0) struck.inward = -1.0 * normalise(across);
  const std::vector<double> shapes = bank::calc_shapes(bank, found.triangle, found.barycentric);
  for (std::size_t m = 0; m < bank.mode_count(); ++m) struck.shape.push_back({shapes[3 * m], shapes[3 * m + 1], shapes[3 * m + 2]});
  return struck;
}

std::vector<double> StruckPoint::calc_velocities() const {
  std::vector<double> velocities;
  for (const Vec3& phi : shape) velocities.push_back(dot(phi, inward));
  return velocities;
}

}  // namespace carillon::exchange
