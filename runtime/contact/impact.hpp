// One instant of impact: velocities before in, impulses out. And how long a real impact of such bodies lasts.
#pragma once

#include <SimTKcommon.h>

#include <vector>

namespace carillon::contact {

/// A rigid body at the instant of an impact, world axes. A body that cannot move has zero inverse mass and inertia.
struct Mobile {
  double inverse_mass = 0.0;        // 1/kg
  SimTK::Mat33 inverse_inertia{0};  // 1/(kg m^2), about the centre
  SimTK::Vec3 centre{0};            // m
  SimTK::Vec3 velocity{0};          // m/s, of the centre
  SimTK::Vec3 spin{0};              // rad/s
};

/// A point where two bodies touch at that instant.
struct ImpactPoint {
  int a = 0, b = -1;         // index of the Mobile; -1: does not move
  SimTK::Vec3 where{0};      // m
  SimTK::Vec3 normal{0};     // unit, from b to a
  double restitution = 0.0;  // used only where the approach is faster than the threshold of solve_impact
  double friction = 0.0;
  double approach_m_s = 0.0;  // out: normal speed before, > 0 approaching
  SimTK::Vec3 impulse{0};     // out: on a [N s]
};

/// Velocity of the point of a minus that of b.
SimTK::Vec3 calc_relative_velocity(const std::vector<Mobile>& bodies, const ImpactPoint& point);

/// 1 / m_eff of the contact along `direction`: sum over both bodies of 1/m + d . ((I^-1 (r x d)) x r).  [1/kg]
double calc_inverse_effective_mass(const std::vector<Mobile>& bodies, int a, int b, const SimTK::Vec3& where, const SimTK::Vec3& direction);

/// Finds the impulses of all points together and applies them to `bodies`. At every point the normal speed afterwards is at least
/// e times the approach (e = 0 for an approach below `threshold_m_s`), the normal impulse pushes, and the tangential impulse stops the
/// sliding as far as the friction cone lets it. Kinetic energy never grows.
void solve_impact(std::vector<Mobile>& bodies, std::vector<ImpactPoint>& points, double threshold_m_s);

/// What of a body matters for the length of an impact.
struct Elastic {
  double young_modulus_pa = 0.0;
  double poisson_ratio = 0.0;
  double curvature_per_m = 0.0;  // of the surface at the contact, convex positive
};

/// Hertz contact time [s]: 2.87 (m^2 / (R E*^2 v))^(1/5), kept within 5 us .. 20 ms. 1/R is the sum of both curvatures, kept within
/// 1/(0.5 mm) and 1/`largest_radius_m` (a flat contact has no Hertz radius; the size of the body takes its place).
double calc_hertz_duration(const Elastic& a, const Elastic& b, double mass_kg, double speed_m_s, double largest_radius_m);

}  // namespace carillon::contact
