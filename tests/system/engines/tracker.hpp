// carillon_touches in place of the library: what a reader of an engine hands over. Included once per program.
#pragma once

#include <carillon.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <vector>

namespace carillon::testing {

inline std::vector<carillon_pose> before, now;  // poses of the last two calls

/// By the program: a point of the step that has just been handed over.
void take(const carillon_point& point);

/// Points of a body on a terrain, and their vertical impulses.
struct OnTerrain {
  long points = 0;
  double impulse_n_s = 0.0, off_m = 0.0;  // off: largest distance of a point from the terrain

  void add(const carillon_point& p, double height_m) {
    ++points;
    impulse_n_s += p.impulse_n_s * p.normal[2] + p.friction_n_s[2];
    off_m = std::max(off_m, std::abs(p.point_m[2] - height_m));
  }
  /// True if the impulses are the change of momentum since `begin`, to a share of the weight, and all points are on the terrain.
  bool is_right(const char* name, double mass_kg, double seconds, const carillon_pose& begin, const carillon_pose& end,
                double share) const {
    const double weight_n_s = mass_kg * 9.81 * seconds, gained = mass_kg * (end.velocity_m_s[2] - begin.velocity_m_s[2]);
    const double error = (gained - impulse_n_s + weight_n_s) / weight_n_s;
    std::printf("%s: %ld points off by %.2g m, impulses by %.2g of the weight\n", name, points, off_m, error);
    return points > 100 && std::abs(error) < share && off_m < 1e-3;
  }
};

}  // namespace carillon::testing

extern "C" {
carillon_status carillon_touches_start(carillon_touches*, double, const carillon_pose* poses, int32_t bodies, char*, size_t) {
  carillon::testing::now.assign(poses, poses + bodies);
  return CARILLON_OK;
}
carillon_status carillon_touches_step(carillon_touches*, double, const carillon_pose* poses, int32_t bodies, const carillon_point* points,
                                      int32_t count, char*, size_t) {
  carillon::testing::before = carillon::testing::now;
  carillon::testing::now.assign(poses, poses + bodies);
  for (int32_t i = 0; i < count; ++i) carillon::testing::take(points[i]);
  return CARILLON_OK;
}
}
