// Membranes and plates on rectangles and circles.
#pragma once

#include "precompute/analytic/known_body.hpp"
#include "precompute/analytic/slabs.hpp"
#include "precompute/la/lapack.hpp"

namespace carillon::analytic {

/// Base of flat bodies: motion along z, slab surface.
class FlatBody : public KnownBody {
 public:
  /// grid intervals along the longest side.
  ClosedSurface make_surface(int grid) const override { return make_slab(make_net(grid), thickness_m_); }
  void calc_shapes(const Vec3& point_m, std::span<const Mode> modes, std::span<Vec3> phi) const override;
  /// One row from the mean of both strains: sqrt(E h / (4 A (1 - nu^2))) times the integrals of grad w_i . grad w_j over the area A (Berger
  /// 1955). Held rim. The stretching frequency is a lower bound: a disc has the lowest one among all bodies of equal area held along the
  /// rim (Faber 1923, Krahn 1925), and no wave is slower than shear.
  bank::QuarticEnergy calc_coupling(std::span<const Mode> modes, const material::Material& material, bool is_stretch) const override;

 protected:
  /// Surface integrals of grad w_i . grad w_j [1/kg], (modes, modes).
  virtual la::Matrix calc_slope_products(std::span<const Mode> modes) const = 0;
  virtual Net make_net(int grid) const = 0;
  /// w of each mode [kg^-1/2], (modes).
  virtual void calc_deflections(const Point2& point_m, std::span<const Mode> modes, std::span<double> w) const = 0;
  /// Mass and inertia for this mass per area.
  void set_rigid(double density_kg_m2);

  double thickness_m_ = 0.0;
};

/// Rectangle with product-of-sines modes: f = c / 2 sqrt((m / a)^2 + (n / b)^2) of a membrane, pi / 2 sqrt(D / (rho h)) ((m / a)^2 + (n /
/// b)^2) of a plate hinged on all sides; phi = 2 / sqrt(sigma a b) sin sin (Rayleigh, The Theory of Sound, sections 194 to 200 and 225).
/// Mode::index: m, n.
class SineRectangle : public FlatBody {
 public:
  SineRectangle(const job::MembraneBody& body, const material::Material& material);
  SineRectangle(const job::PlateBody& body, const material::Material& material);
  ModeList list_modes(double high_hz, std::int64_t max_modes) override;
  int choose_grid(std::span<const Mode> modes) const override;
  /// For a plate with straight, fixed sides: one row for each product of cosines of Airy's stress function, and two for the mean strains
  /// (Chu and Herrmann 1956; Ducceschi and others 2014). Mean stretch only: two rows that give each mode alone its full hardening.
  bank::QuarticEnergy calc_coupling(std::span<const Mode> modes, const material::Material& material, bool is_stretch) const override;

 private:
  la::Matrix calc_slope_products(std::span<const Mode> modes) const override;
  Net make_net(int grid) const override;
  void calc_deflections(const Point2& point_m, std::span<const Mode> modes, std::span<double> w) const override;
  void add_stress_functions(std::span<const Mode> modes, double rigidity_n_m, bank::QuarticEnergy& energy) const;

  double length_m_, width_m_, density_kg_m2_;
  bool is_plate_;
  double rate_;  // membrane: c^2 [m^2/s^2]; plate: D / (rho h) [m^4/s^2]
};

/// Radial functions of a circle that meet the rim's conditions: J_m, and for a plate I_m. Mode::index: m, s, 0 for cos and 1 for sin, and
/// index into radials_.
class Circle : public FlatBody {
 public:
  /// f = j_ms / (2 pi R) c, phi = J_m(j r / R) cos or sin / (|J_(m+1)(j)| sqrt(sigma pi R^2 (m ? 1/2 : 1))) (Rayleigh, section 204).
  Circle(const job::MembraneBody& body, const material::Material& material);
  /// w = J_m(k r) + C I_m(k r) (Leissa 1969, Vibration of Plates, chapter 2).
  Circle(const job::PlateBody& body, const material::Material& material);
  ModeList list_modes(double high_hz, std::int64_t max_modes) override;
  int choose_grid(std::span<const Mode> modes) const override;

 private:
  struct Radial {
    int m = 0;
    double root = 0.0;
    double bessel = 0.0, modified = 0.0;  // factors of J_m(root r / R) and I_m(root r / R) / I_m(root)
  };
  la::Matrix calc_slope_products(std::span<const Mode> modes) const override;
  Net make_net(int grid) const override;
  void calc_deflections(const Point2& point_m, std::span<const Mode> modes, std::span<double> w) const override;
  std::array<double, 4> calc_conditions(int m, double root) const;
  double calc_determinant(int m, double root) const;
  Radial make_radial(int m, double root) const;

  double radius_m_, density_kg_m2_, poisson_ratio_ = 0.0;
  bool is_plate_;
  job::Edge edge_ = job::Edge::clamped;
  double rate_;  // as SineRectangle
  std::vector<Radial> radials_;
  mutable double cached_radius_ = -1.0;  // points come ring by ring
  mutable std::vector<double> cached_;
};

/// Rectangular plate with arbitrary edge conditions: Ritz's method on products of polynomials that meet the conditions on deflection and
/// slope (Bhat 1985; here Legendre polynomials, transformed to beam modes in each direction). Mode::index: index into shapes_.
class RitzPlate : public FlatBody {
 public:
  RitzPlate(const job::PlateBody& body, const material::Material& material);
  ModeList list_modes(double high_hz, std::int64_t max_modes) override;
  int choose_grid(std::span<const Mode> modes) const override;

 private:
  /// Functions of one direction and parity: Legendre coefficients and their integrals.
  struct Line {
    la::Matrix functions;             // (polynomials, k)
    la::Matrix slopes, bends, mixed;  // integrals of f' f', f'' f'', f f''
  };
  struct Shape {
    int x_line = 0, y_line = 0;
    la::Matrix coefficients;  // (k of x, k of y)
  };
  struct Solved {
    std::vector<double> lambda;
    std::vector<Shape> shapes;
  };
  std::vector<Line> make_lines(int polynomials, job::Edge first, job::Edge last) const;
  Solved solve(int x_polynomials, int y_polynomials, double high_lambda);
  la::Matrix calc_slope_products(std::span<const Mode> modes) const override;
  Net make_net(int grid) const override;
  void calc_deflections(const Point2& point_m, std::span<const Mode> modes, std::span<double> w) const override;

  job::PlateBody body_;
  double density_kg_m2_, poisson_ratio_, rate_;
  int x_polynomials_ = 0, y_polynomials_ = 0;
  std::vector<Line> x_lines_, y_lines_;
  std::vector<Shape> shapes_;
};

/// Mass per area and thickness of a membrane, from one or both in the job.
std::array<double, 2> find_sheet(const job::MembraneBody& body, const material::Material& material);

/// Wave number [1/m] with at least that many modes below it, for a membrane or plate of this area and rim: Weyl's law with its second term,
/// N = A k^2 / 4 pi - rim k / 4 pi, for a fixed rim (the smallest count).
double find_wave_number(double area_m2, double rim_m, double modes);

/// Flexural rigidity D = E h^3 / (12 (1 - nu^2)) over the mass per area [m^4/s^2].
double calc_plate_rate(const material::Material& material, double thickness_m);

}  // namespace carillon::analytic
