// A rigid body: state and free flight.
#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include "runtime/base/quaternion.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/physics/geometry/touch.hpp"
#include "runtime/physics/impact/modes.hpp"

namespace carillon::rigid {

using carillon::make_rotation;
using carillon::make_turn;
using carillon::multiply;
using carillon::normalise;
using carillon::Quaternion;

/// Constant properties of a body.
struct Solid {
  std::shared_ptr<const geometry::Shape> shape;
  bool fixed = false;
  double mass_kg = 0.0;
  Vec3 centre_m{};       // of mass, frame of the mesh
  Mat3 inertia_kg_m2{};  // about the centre, axes of the mesh
  Mat3 inverse_inertia{};
  double radius_m = 0.0;  // of a ball about the centre that encloses the body
  double restitution = 0.5, friction = 0.4, rolling_resistance = 1e-3;
  double young_modulus_pa = 0.0, poisson_ratio = 0.0;
  std::shared_ptr<const impact::Modes> modes;                   // null: no modes
  double max_bend_m = std::numeric_limits<double>::infinity();  // of soft bodies: blows that bend them farther are rigid
  /// (n, 3) mode shapes at a point of the surface, mesh axes [1/sqrt(kg)]. Set if there are modes.
  std::function<std::vector<double>(const geometry::Place&)> find_shape;
};

/// Pose and motion of a body. Stores the angular momentum instead of the spin: constant in flight, bit for bit.
struct State {
  Vec3 centre{}, velocity{};
  Quaternion rotation{1, 0, 0, 0};
  Vec3 momentum{};  // angular, about the centre, world axes [kg m^2/s]
};

/// A state with derived quantities.
struct Placed {
  Mat3 rotation{}, inverse_inertia{};  // world axes
  Vec3 spin{};
  geometry::Frame frame{};
};

Placed place(const Solid& solid, const State& state);

/// Motion by `time_s` without contacts: a parabola, and a rotation at constant angular momentum, q' = 1/2 (I(q)^-1 L) q, by the classical
/// Runge-Kutta method in substeps of at most 0.05 rad.
State fly(const Solid& solid, const State& state, const Vec3& gravity, double time_s);

/// Kinetic and gravitational energy, relative to the origin [J].
double calc_energy(const Solid& solid, const State& state, const Vec3& gravity);
double calc_kinetic(const Solid& solid, const State& state);
double calc_kinetic(const Solid& solid, const State& state, const Placed& placed);

}  // namespace carillon::rigid
