// Random drops of one body on the ground, a slab or a slope, with depth and energy looked at after every step.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "runtime/physics/rigid/space.hpp"
#include "tests/unit/runtime/physics/geometry/solids.hpp"
#include "tests/unit/runtime/physics/solids.hpp"

namespace carillon::rigid::tests {

inline constexpr std::array<const char*, 12> kDropBodies{"disc", "coin",  "ring",  "rod",  "pen", "cup",
                                                         "bowl", "sheet", "plate", "slab", "bar", "box"};

struct DropMatter {
  const char* name;
  double young_modulus_pa, poisson_ratio, density_kg_m3;
};
inline constexpr std::array<DropMatter, 4> kDropMatter{
    {{"steel", 200e9, 0.3, 7850}, {"glass", 70e9, 0.22, 2500}, {"rubber", 10e6, 0.48, 1100}, {"wood", 11e9, 0.35, 700}}};

/// An outline whose pieces are as short as the edges of a mesh.
inline std::vector<std::array<double, 2>> refine(const std::vector<std::array<double, 2>>& outline, double edge_m) {
  std::vector<std::array<double, 2>> fine{outline.front()};
  for (std::size_t k = 1; k < outline.size(); ++k) {
    const auto &a = outline[k - 1], &b = outline[k];
    const int pieces = std::max(1, static_cast<int>(std::ceil(std::hypot(b[0] - a[0], b[1] - a[1]) / edge_m)));
    for (int i = 1; i <= pieces; ++i) {
      const double t = static_cast<double>(i) / pieces;
      fine.push_back({a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])});
    }
  }
  return fine;
}

/// Surface of a body of kDropBodies, about its own origin.
inline geometry::tests::Solid make_drop_surface(int body, int fine = 1) {
  using namespace geometry::tests;
  switch (body) {
    case 0:
      return make_cylinder(0.0375, 0.006, 48);
    case 1:
      return make_cylinder(0.012, 0.002, 48 * fine);
    case 2:
      return make_ring(0.02, 0.003, 48 * fine, 16 * fine);
    case 3:
      return make_cylinder(0.005, 0.2, 24);
    case 4:
      return make_lathe(refine({{0, -0.07}, {0.0015, -0.068}, {0.0045, -0.055}, {0.0045, 0.065}, {0.003, 0.07}, {0, 0.07}}, 0.002), 20,
                        false);
    case 5:
      return make_lathe(
          refine({{0, 0}, {0.025, 0}, {0.0325, 0.02}, {0.04, 0.09}, {0.037, 0.09}, {0.0295, 0.021}, {0.023, 0.004}, {0, 0.004}},
                 0.006 / fine),
          40 * fine, false);
    case 6: {
      std::vector<std::array<double, 2>> outline;
      const double part = 0.1 / fine;
      for (int i = 0; i <= 12 * fine; ++i) outline.push_back({0.08 * std::sin(part * i), 0.08 * (1 - std::cos(part * i))});
      for (int i = 12 * fine; i >= 0; --i) outline.push_back({0.076 * std::sin(part * i), 0.08 - 0.076 * std::cos(part * i)});
      return make_lathe(outline, 48 * fine, false);
    }
    case 7:
      return make_box({0.2, 0.15, 0.0005}, 8);
    case 8:
      return make_box({0.2, 0.12, 0.002}, 8);
    case 9:
      return make_box({0.1, 0.08, 0.02}, 4);
    case 10:
      return make_box({0.3, 0.03, 0.01}, 8);
    default:
      return make_box({0.06, 0.06, 0.06}, 4);
  }
}

struct DropBody {
  Solid solid;
  std::vector<Vec3> vertices;  // from the centre of mass
};

inline DropBody make_drop_body(int body, int matter) {
  const DropMatter& m = kDropMatter.at(matter);
  geometry::tests::Solid surface = make_drop_surface(body);
  bank::Bank bank;
  bank.material.density_kg_m3 = m.density_kg_m3;
  bank.vertices_m.assign(surface.vertices.begin(), surface.vertices.end());
  bank.triangles.assign(surface.triangles.begin(), surface.triangles.end());
  physics::tests::set_rigid_of_solid(bank);
  for (Vec3& x : surface.vertices) x = x - bank.rigid.centre_m;
  DropBody out;
  out.vertices = surface.vertices;
  Solid& s = out.solid;
  s.shape = surface.make();
  s.mass_kg = bank.rigid.mass_kg;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) s.inertia_kg_m2[i][j] = i == j ? bank.rigid.inertia_kg_m2[4 * i] : 0.0;
  for (int i = 0; i < 3; ++i) s.inverse_inertia[i][i] = 1.0 / s.inertia_kg_m2[i][i];
  for (const Vec3& x : out.vertices) s.radius_m = std::max(s.radius_m, norm(x));
  s.young_modulus_pa = m.young_modulus_pa;
  s.poisson_ratio = m.poisson_ratio;
  return out;
}

enum class DropFloor { ground, slab, slope };

/// One drop. Angles in degrees.
struct Drop {
  int body = 0, matter = 0;
  double height_m = 0.0, tilt_deg = 0.0, azimuth_deg = 0.0;  // of the tilt's axis about the body's
  int side = 0;                                              // of the body that is down, of six
  double spin_rad_s = 0.0, spin_deg = 0.0;                   // its axis from the vertical
  double speed_m_s = 0.0;
  DropFloor floor = DropFloor::ground;
  double slope_deg = 0.0, restitution = 0.3, friction = 0.5;
};

/// Any 16 bytes are a drop; half of all tilts are below 10 degrees.
inline Drop decode_drop(const std::array<std::uint8_t, 16>& bytes) {
  const auto get = [&](int i) { return bytes[i] / 255.0; };
  const auto get_log = [&](int i, double low, double high) { return low * std::pow(high / low, get(i)); };
  Drop d;
  d.body = bytes[0] % 12;
  d.matter = bytes[1] % 4;
  d.height_m = bytes[2] < 16 ? 0.0 : get_log(2, 1e-3, 0.5);
  d.tilt_deg = bytes[3] % 2 == 0 ? get_log(4, 1e-3, 10.0) : 90.0 * get(4);
  d.azimuth_deg = 360.0 * get(5);
  d.side = bytes[6] % 6;
  d.spin_rad_s = bytes[7] < 64 ? 0.0 : get_log(7, 0.1, 100.0);
  d.spin_deg = 180.0 * get(8);
  d.speed_m_s = bytes[9] < 128 ? 0.0 : get(9);
  d.floor = static_cast<DropFloor>(bytes[10] % 3);
  d.slope_deg = d.floor == DropFloor::slope ? 15.0 * get(11) : 0.0;
  d.restitution = 0.9 * get(12);
  d.friction = 0.1 + 0.9 * get(13);
  return d;
}

struct DropOutcome {
  double deepest_m = 0.0, rests_m = 0.0;  // of the lowest vertex: ever, and in the last 0.2 s
  double ends_m = 0.0;                    // at the end
  double missed_m = 0.0;                  // a vertex below the floor and below all touches of a step, at its end, at most
  double gained = 0.0;                    // energy above that at the start and the lifted energy, of the largest kinetic energy
  double speed_m_s = 0.0;                 // at the end
  double lifted = 0.0;                    // of the largest kinetic energy
  int late_hits = 0, late_strikes = 0;    // in the last 0.5 s: points, and instants
  int hits = 0;
  double thickness_m = 0.0;
  bool sleeps = false, is_on_floor = true;  // no part of it is beyond the slab's sides
};

/// Of the touches of body 0 and `other`, as they are now; 0 where there is none below the floor [m].
inline double find_least_gap(const Space& space, int other) {
  const auto at = space.pairs().find({0, other});
  if (at == space.pairs().end()) return 0.0;
  geometry::PairMemory memory = at->second.memory;
  const geometry::Frame mine = place(space.solid(0), space.state(0)).frame;
  const geometry::Frame theirs = other < 0 ? geometry::Frame{} : place(space.solid(other), space.state(other)).frame;
  double least = 0.0;
  for (const Contact& c : at->second.contacts) {
    geometry::Touch touch = c.touch;
    geometry::refresh(touch, *space.solid(0).shape, mine, other < 0 ? nullptr : space.solid(other).shape.get(), theirs);
    least = std::min(least, touch.gap_m);
  }
  return least;
}

/// Largest depth allowed to a rigid body at any time: 50 um or 1 % of its thickness [m].
inline double calc_allowed_depth(const DropOutcome& outcome) { return std::max(5e-5, 0.01 * outcome.thickness_m); }

inline DropOutcome run_drop(const Drop& d, double seconds) {
  using geometry::tests::make_turn;
  using geometry::tests::multiply;
  DropBody body = make_drop_body(d.body, d.matter);
  body.solid.restitution = d.restitution;
  body.solid.friction = d.friction;
  constexpr double kDegree = std::numbers::pi / 180.0;
  const Quaternion sides[6] = {{1, 0, 0, 0},
                               {0, 1, 0, 0},
                               {std::sqrt(0.5), std::sqrt(0.5), 0, 0},
                               {std::sqrt(0.5), -std::sqrt(0.5), 0, 0},
                               {std::sqrt(0.5), 0, std::sqrt(0.5), 0},
                               {std::sqrt(0.5), 0, -std::sqrt(0.5), 0}};
  State start;
  const double a = kDegree * d.azimuth_deg, half = 0.5 * kDegree * d.tilt_deg;
  start.rotation =
      carillon::multiply(Quaternion{std::cos(half), std::sin(half) * std::cos(a), std::sin(half) * std::sin(a), 0}, sides[d.side]);
  const Mat3 rotation = make_rotation(start.rotation);
  double low = 1.0;
  for (const Vec3& x : body.vertices) low = std::min(low, (rotation * x)[2]);
  start.centre = {0, 0, d.height_m - low + 1e-4};  // curved skins reach below their vertices
  start.velocity = {d.speed_m_s, 0, 0};
  const Vec3 spin = d.spin_rad_s * Vec3{std::sin(kDegree * d.spin_deg), 0, std::cos(kDegree * d.spin_deg)};
  start.momentum = rotation * (body.solid.inertia_kg_m2 * (transpose(rotation) * spin));
  const double slope = kDegree * d.slope_deg;
  const Vec3 gravity{9.81 * std::sin(slope), 0, -9.81 * std::cos(slope)};
  std::vector<Solid> solids{body.solid};
  std::vector<State> states{start};
  std::optional<Ground> ground = Ground{0.0, d.restitution, d.friction, 30e9, 0.2};
  constexpr double kSide = 1.0;
  if (d.floor == DropFloor::slab) {
    ground.reset();
    Solid slab = body.solid;
    slab.fixed = true;
    slab.shape = geometry::tests::make_box({kSide, kSide, 0.05}, 4).make();
    slab.radius_m = slab.shape->get_radius_m();
    slab.young_modulus_pa = 30e9;
    slab.poisson_ratio = 0.2;
    solids.push_back(slab);
    states.push_back({.centre = {0, 0, -0.025}});
  }
  Space space(std::move(solids), std::move(states), ground, gravity, {});
  DropOutcome out;
  out.thickness_m = space.solid(0).shape->get_thickness_m();
  const double before = space.calc_books().motion_j;
  double kinetic = 1e-3 * 9.81 * body.solid.mass_kg;  // 1 mm of height
  while (space.get_time() < seconds - 1e-9) {
    space.step(seconds);
    const double now = space.get_time();
    const State& s = space.state(0);
    const Mat3 r = make_rotation(s.rotation);
    double lowest = 1e9;
    for (const Vec3& x : body.vertices) {
      const Vec3 at = s.centre + r * x;
      lowest = std::min(lowest, at[2]);
      if (d.floor == DropFloor::slab && std::max(std::abs(at[0]), std::abs(at[1])) > 0.5 * kSide) out.is_on_floor = false;
    }
    if (!out.is_on_floor) return out;
    const double depth = std::max(0.0, -lowest);
    out.deepest_m = std::max(out.deepest_m, depth);
    out.ends_m = depth;
    if (now > seconds - 0.2) out.rests_m = std::max(out.rests_m, depth);
    if (!space.is_still(0)) out.missed_m = std::max(out.missed_m, depth + find_least_gap(space, d.floor == DropFloor::slab ? 1 : -1));
    const Books books = space.calc_books();
    kinetic = std::max(kinetic, calc_kinetic(body.solid, s));
    out.gained = std::max(out.gained, (books.motion_j - books.lifted_j - before) / kinetic);
    for (const Strike& strike : space.take_strikes()) {
      if (now > seconds - 0.5) ++out.late_strikes;
      for (const Hit& hit : strike.hits)
        if (hit.approach_m_s > 0.0 && norm(hit.impulse) > 0.0) {
          ++out.hits;
          if (now > seconds - 0.5) ++out.late_hits;
        }
    }
  }
  out.lifted = space.calc_books().lifted_j / kinetic;
  out.speed_m_s = norm(space.state(0).velocity);
  out.sleeps = space.is_still(0);
  return out;
}

/// Bounds of every drop of a rigid body.
struct DropBounds {
  double rests_m = 25e-6, ever = 1.0;  // asleep, or in the last 0.2 s; over calc_allowed_depth()
  double missed_m = 2e-6, gained = 1e-5, lifted = 1e-3;
};
inline constexpr DropBounds kWanted;
/// Bounds of any drop of the fuzzer. Of 3,562 random drops none came to rest deeper than 25 um or was ever deeper than allowed; eight low
/// falls were lifted by 0.0011 to 0.0042.
inline constexpr DropBounds kHeldToday{.ever = 2.0, .missed_m = 2e-5, .gained = 1e-4, .lifted = 0.05};

/// The bound that an outcome has violated; empty: none.
inline std::string describe_fault(const DropOutcome& o, const DropBounds& bounds) {
  if (o.sleeps && o.ends_m > bounds.rests_m) return "sleeps " + std::to_string(1e6 * o.ends_m) + " um deep";
  if (o.deepest_m > bounds.ever * calc_allowed_depth(o)) return "was " + std::to_string(1e6 * o.deepest_m) + " um deep";
  if (o.missed_m > bounds.missed_m) return "was " + std::to_string(1e6 * o.missed_m) + " um deeper than its touches";
  if (o.gained > bounds.gained) return "gained a share of " + std::to_string(o.gained) + " of its energy";
  if (o.lifted > bounds.lifted) return "was lifted by a share of " + std::to_string(o.lifted) + " of its energy";
  return {};
}

}  // namespace carillon::rigid::tests
