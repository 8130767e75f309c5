// Strings and beams.
#pragma once

#include "precompute/analytic/beam_functions.hpp"
#include "precompute/analytic/known_body.hpp"
#include "precompute/analytic/slabs.hpp"
#include "precompute/la/lapack.hpp"

namespace carillon::analytic {

/// f = n / (2 L) sqrt(T / mu) sqrt(1 + B n^2), B = pi^3 E d^4 / (64 T L^2), phi = sqrt(2 / (mu L)) sin(n pi x / L), along y and along z
/// (Fletcher and Rossing 1998, The Physics of Musical Instruments, section 2.18). Mode::index: n, axis (1 or 2).
class String : public KnownBody {
 public:
  String(const job::StringBody& body, const material::Material& material);
  ModeList list_modes(double high_hz, std::int64_t max_modes) override;
  void calc_shapes(const Vec3& point_m, std::span<const Mode> modes, std::span<Vec3> phi) const override;
  ClosedSurface make_surface(int grid) const override;
  int choose_grid(std::span<const Mode> modes) const override;
  /// Mean stretch, with both planes (Kirchhoff 1876, Carrier 1945).
  bank::QuarticEnergy calc_coupling(std::span<const Mode> modes, const material::Material& material, bool is_stretch) const override;

 private:
  double length_m_, mass_kg_m_, diameter_m_, tension_n_, stiffness_;  // stiffness: B
};

/// Bending along y and z by Euler-Bernoulli or by Timoshenko (Ritz's method on Legendre polynomials); torsion with Saint-Venant's constant;
/// axial waves. An end that is not free fixes torsion and axial motion. Mode::index: motion, number, index into shapes_.
class Beam : public KnownBody {
 public:
  Beam(const job::BeamBody& body, const material::Material& material);
  ModeList list_modes(double high_hz, std::int64_t max_modes) override;
  void calc_shapes(const Vec3& point_m, std::span<const Mode> modes, std::span<Vec3> phi) const override;
  ClosedSurface make_surface(int grid) const override;
  int choose_grid(std::span<const Mode> modes) const override;
  bool is_coupled(const Mode& mode) const override { return mode.index[0] == kBendingY || mode.index[0] == kBendingZ; }
  /// As String. Both ends are held and fixed along the beam (Woinowsky-Krieger 1950).
  bank::QuarticEnergy calc_coupling(std::span<const Mode> modes, const material::Material& material, bool is_stretch) const override;

 private:
  enum Motion { kBendingY = 1, kBendingZ = 2, kTorsion = 3, kAxial = 4 };
  struct Shape {
    BeamFunction function{};       // Euler-Bernoulli
    la::Vector deflection, shear;  // Timoshenko: coefficients of Legendre polynomials, of w and L times the shear angle
    double wave = 0.0;             // torsion, axial: half-waves times pi
  };
  void add_bending(Motion motion, double second_moment_m4, double high_hz, std::vector<Mode>& modes);
  void add_timoshenko(Motion motion, double second_moment_m4, double high_hz, std::vector<Mode>& modes);
  void add_waves(Motion motion, double speed_m_s, double high_hz, std::vector<Mode>& modes);
  bool is_fixed(int end) const { return body_.ends[end] != job::Edge::free; }

  job::BeamBody body_;
  double young_pa_, shear_pa_, density_kg_m3_, poisson_ratio_;
  double area_m2_, moment_y_m4_, moment_z_m4_, torsion_m4_;  // moment_y: for bending along y
  std::vector<Shape> shapes_;
};

/// Saint-Venant's torsion constant of a rectangle [m^4] (Timoshenko and Goodier 1970, Theory of Elasticity, section 109).
double calc_torsion_constant(double width_m, double thickness_m);

}  // namespace carillon::analytic
