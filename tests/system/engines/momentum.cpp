// momentum_NAME: output of an adapter against mechanics. Impulses are the change of momentum (along the vertical if the tracker finds the
// friction); points lie between the surfaces of both bodies at their pose. This program takes the place of the tracker.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>

#include "tests/system/engines/engine.hpp"
#include "tests/system/engines/tracker.hpp"

namespace {

using carillon::testing::Solid;

constexpr double kRadius = 0.03;
constexpr int kBalls = 2;  // the first bodies

struct Seen {
  std::vector<double> sums_n_s;  // x y z of each body
  double off_m = 0.0;            // of points from the surfaces of balls
  double normal = 0.0;           // largest deviation of a normal from a unit vector
  bool points_after = false, has_friction = true;
  long points = 0;
};
Seen seen;

}  // namespace

void carillon::testing::take(const carillon_point& p) {
  ++seen.points;
  if (std::isnan(p.friction_n_s[0])) seen.has_friction = false;
  const std::vector<carillon_pose>& poses = seen.points_after ? now : before;
  double length2 = 0.0;
  for (int k = 0; k < 3; ++k) {
    const double push = p.impulse_n_s * p.normal[k] + (seen.has_friction ? p.friction_n_s[k] : 0.0);
    length2 += p.normal[k] * p.normal[k];
    seen.sums_n_s[static_cast<std::size_t>(3 * p.a + k)] += push;
    if (p.b >= 0) seen.sums_n_s[static_cast<std::size_t>(3 * p.b + k)] -= push;
  }
  seen.normal = std::max(seen.normal, std::abs(std::sqrt(length2) - 1.0));
  for (const int body : {p.a, p.b}) {
    if (body < 0 || body >= kBalls) continue;
    double distance2 = 0.0;
    for (int k = 0; k < 3; ++k) {
      const double at = p.point_m[k] + (body == p.a ? p.gap_m * p.normal[k] : 0.0) - poses[static_cast<std::size_t>(body)].position_m[k];
      distance2 += at * at;
    }
    seen.off_m = std::max(seen.off_m, std::abs(std::sqrt(distance2) - kRadius));
  }
}

namespace {

Solid make_solid(const char* name, const char* kind, const std::array<double, 3>& half_m, double mass_kg,
                 const std::array<double, 3>& at_m) {
  Solid solid;
  solid.name = name;
  solid.kind = kind;
  solid.mass_kg = mass_kg;
  solid.rotation[0] = 1.0;
  for (std::size_t k = 0; k < 3; ++k) {
    solid.half_m[k] = half_m[k];
    solid.position_m[k] = at_m[k];
    const double one = half_m[(k + 1) % 3], other = half_m[(k + 2) % 3];
    solid.inertia_kg_m2[k] = solid.kind == "ball" ? 0.4 * mass_kg * kRadius * kRadius : mass_kg / 3.0 * (one * one + other * other);
  }
  return solid;
}

/// Balls that meet in flight, fall, slide and roll; a box and a tube that land on a corner and on an end.
std::vector<Solid> make_solids() {
  std::vector<Solid> solids = {make_solid("a", "ball", {kRadius, kRadius, kRadius}, 0.5, {-0.1, 0.0, 0.2}),
                               make_solid("b", "ball", {kRadius, kRadius, kRadius}, 0.5, {0.0, 0.0, 0.2}),
                               make_solid("box", "box", {0.06, 0.04, 0.025}, 0.3, {2.0, 0.0, 0.2}),
                               make_solid("tube", "tube", {0.075, 0.02, 0.02}, 0.1, {-2.0, 0.0, 0.15})};
  solids[0].velocity_m_s[0] = 1.0;
  solids[2].spin_rad_s[0] = 3.0;
  solids[2].spin_rad_s[1] = 4.0;
  solids[3].velocity_m_s[1] = 0.4;
  solids[3].spin_rad_s[1] = 2.0;
  return solids;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return std::fputs("usage: momentum_NAME LARGEST_SHARE LARGEST_OFFSET_M\n", stderr), 2;
  try {
    constexpr double kStep = 1.0 / 240.0;
    const std::vector<Solid> solids = make_solids();
    carillon_touches_options options;
    carillon_touches_options_init(&options);
    carillon::testing::set_options(options);
    seen.points_after = options.points_after != 0;
    const auto engine = carillon::testing::make_engine(solids, kStep, nullptr);
    seen.sums_n_s.assign(3 * solids.size(), 0.0);
    engine->start(nullptr, 0);
    const std::vector<carillon_pose> begin = carillon::testing::now, &now = carillon::testing::now;
    constexpr int kSteps = 240;
    for (int n = 1; n <= kSteps; ++n) engine->step(n * kStep, nullptr, 0);
    double worst = 0.0;
    for (std::size_t i = 0; i < solids.size(); ++i) {
      const double weight_n_s = solids[i].mass_kg * 9.81 * kSteps * kStep;
      for (int k = 0; k < 3; ++k) {
        const double gained = solids[i].mass_kg * (now[i].velocity_m_s[k] - begin[i].velocity_m_s[k]);
        const double given = seen.sums_n_s[3 * i + static_cast<std::size_t>(k)] - (k == 2 ? weight_n_s : 0.0);
        std::printf("body %zu, axis %d: momentum %.6f N s, impulses %.6f N s\n", i, k, gained, given);
        // Sums of springs: a stiff tube is in contact for a few internal steps only, and off by 3 %.
        if (!seen.has_friction && (k != 2 || solids[i].kind == "tube")) continue;
        worst = std::max(worst, std::abs(gained - given) / weight_n_s);
      }
    }
    std::printf("%ld points, impulses off by %.3g of the weight, points by %.3g m, normals by %.3g\n", seen.points, worst, seen.off_m,
                seen.normal);
    return seen.points > 10 && worst <= std::atof(argv[1]) && seen.off_m <= std::atof(argv[2]) && seen.normal < 1e-6 ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", argv[0], error.what());
    return 1;
  }
}
