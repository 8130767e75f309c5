// Contact springs: Hertz and felt, work per step, losses and pulse lengths.
#pragma once

namespace carillon::impact {

/// F = K y^p for y > 0, otherwise 0. Hertz: p = 1.5, K = 4/3 E* sqrt(R). Felt of mallets and hammers: p = 2.2 to 3.5. With hysteresis chi:
/// F = K y^p (1 + chi y'), never negative (Hunt and Crossley 1975).
struct Spring {
  bool operator==(const Spring&) const = default;

  double stiffness = 0.0;       // K [N/m^p]
  double exponent = 1.5;        // p >= 1
  double hysteresis_s_m = 0.0;  // chi >= 0
};

/// 1/E* [1/Pa] of two bodies: (1 - nu_a^2)/E_a + (1 - nu_b^2)/E_b.
double calc_contact_compliance(double young_a_pa, double poisson_a, double young_b_pa, double poisson_b);

/// Radius of the Hertz contact under a force [N]: cbrt(3/4 F R/E*) [m] (K. L. Johnson, "Contact mechanics" (1985), eq. 4.22).
double calc_patch_radius(double force_n, double radius_m, double compliance_per_pa);

/// Hertz stiffness 4/3 E* sqrt(R) [N/m^1.5] of two bodies: Young's moduli [Pa], Poisson's ratios, R [m] of the summed curvatures.
double calc_hertz_stiffness(double young_a_pa, double poisson_a, double young_b_pa, double poisson_b, double radius_m);
double calc_hertz_stiffness(double compliance_per_pa, double radius_m);

/// Stiffness 2 E* sqrt(A/pi) [N/m] of a flat face with area A [m^2]: flat round punch (K. L. Johnson, "Contact mechanics" (1985), eq.
/// 3.36).
double calc_face_stiffness(double compliance_per_pa, double area_m2);

/// V(y) = K y^(p+1)/(p+1) [J]; 0 for y < 0.
double calc_spring_energy(const Spring& spring, double y);
/// Compression y > 0 [m] at which a spring stores that energy.
double calc_compression(const Spring& spring, double energy_j);

/// Force of a step from y0 to y1 in h: (V(y1) - V(y0))/(y1 - y0) (1 + chi (y1 - y0)/h), the first factor without cancellation, the second
/// not below 0; and its derivative by y1. The work of this force over the step is V(y1) - V(y0) plus a loss >= 0 for any h. Increases with
/// y1.
struct StepForce {
  double force = 0.0, slope = 0.0;  // N, N/m
};
StepForce calc_step_force(const Spring& spring, double y0, double y1, double h_s);

/// Hysteresis chi [s/m] for which a rebound has the restitution e at the approach speed v. From the energies of compression and rebound, x
/// - ln(1 + x) = -ln(1 - e x) - e x with x = chi v, for every exponent. e >= 1: 0; e is clamped to at least 0.002. v > 0.
double calc_hysteresis(double restitution, double speed_m_s);

/// Elastic pulse of a mass m [kg] with speed v [m/s] on this spring: maximum compression ((p+1)/2 m v^2/K)^(1/(p+1)) and length 2 y_max/v
/// sqrt(pi) G(1 + 1/(p+1))/G(1/2 + 1/(p+1)) (Hertz 1882: 3.218 (m/(K sqrt v))^(2/5)).
struct ElasticPulse {
  double compression_m = 0.0, length_s = 0.0;
};
ElasticPulse calc_elastic_pulse(const Spring& spring, double mass_kg, double speed_m_s);

/// Hertz contact time [s]: 2.87 (m^2 / (R E*^2 v))^(1/5) (K. L. Johnson, "Contact mechanics" (1985), eq. 11.24), of at least 1 mm/s,
/// clamped to 5 us .. 20 ms.
double calc_hertz_duration(double compliance_per_pa, double radius_m, double mass_kg, double speed_m_s);

}  // namespace carillon::impact
