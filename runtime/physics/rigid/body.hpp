// A rigid body: its state, and how it flies.
#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "runtime/base/quaternion.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/physics/impact/modes.hpp"
#include "runtime/physics/geometry/touch.hpp"

namespace carillon::rigid {

using carillon::multiply;
using carillon::Quaternion;

Mat3 make_rotation(const Quaternion& q);
/// Of a rotation vector [rad], in full.
Quaternion make_turn(const Vec3& turn);
Quaternion normalise(const Quaternion& q);

/// What does not change.
struct Solid {
  std::shared_ptr<const geometry::Shape> shape;
  bool fixed = false;
  double mass_kg = 0.0;
  Vec3 centre_m{};       // of mass, frame of the mesh
  Mat3 inertia_kg_m2{};  // about the centre, axes of the mesh
  Mat3 inverse_inertia{};
  double radius_m = 0.0;  // of a ball about the centre that holds the body
  double restitution = 0.5, friction = 0.4;
  double young_modulus_pa = 0.0, poisson_ratio = 0.0;
  std::shared_ptr<const impact::Modes> modes;  // null: does not ring
  /// (n, 3) mode shapes at a place of the surface, axes of the mesh [1/sqrt(kg)]. Set where there are modes.
  std::function<std::vector<double>(const geometry::Place&)> find_shape;
};

/// Where a body is and how it moves. The angular momentum is kept, not the spin: in flight it is constant to the last bit.
struct State {
  Vec3 centre{}, velocity{};
  Quaternion rotation{1, 0, 0, 0};
  Vec3 momentum{};  // angular, about the centre, world axes [kg m^2/s]
};

/// The same with what follows from it.
struct Placed {
  Mat3 rotation{}, inverse_inertia{};  // world axes
  Vec3 spin{};
  geometry::Frame frame{};
};

Placed place(const Solid& solid, const State& state);

/// `time_s` later without contacts: a parabola, and a rotation of constant angular momentum, q' = 1/2 (I(q)^-1 L) q, by the classical
/// Runge-Kutta method in pieces that turn by at most 0.05 rad.
State fly(const Solid& solid, const State& state, const Vec3& gravity, double time_s);

/// Kinetic and in the field of gravity, which counts from the origin [J].
double calc_energy(const Solid& solid, const State& state, const Vec3& gravity);
double calc_kinetic(const Solid& solid, const State& state);
double calc_kinetic(const Solid& solid, const State& state, const Placed& placed);

}  // namespace carillon::rigid
