// Membranes on polygons.
#pragma once

#include "precompute/analytic/flat_bodies.hpp"
#include "precompute/analytic/triangle_modes.hpp"

namespace carillon::analytic {

/// Resolution of the elements of a polygon. Defaults from tests/bench/analytic.
struct PolygonSetting {
  int order = 8;
  double edge_radians = 6.0;   // longest edge times the largest wave number
  double corner_error = 1e-8;  // relative eigenvalue error allowed per singular corner: determines its rings of elements
  double ratio = 0.2;          // size ratio of successive rings
  bool uses_particular_solutions = true;
};

/// High-order finite elements, graded towards corners whose angle is not pi / n; error bars from the next lower order. With only one such
/// corner (an L), eigenvalues are refined by particular solutions. Mode::index: index into modes_.
class Polygon : public FlatBody {
 public:
  Polygon(const job::MembraneBody& body, const material::Material& material, const PolygonSetting& setting = {});
  ModeList list_modes(double high_hz, std::int64_t max_modes) override;
  int choose_grid(std::span<const Mode> modes) const override;

  /// Eigenvalues of -Laplace up to max_kappa [1/m^2], and their relative errors (estimates).
  struct Solved {
    std::vector<double> kappa, error;
  };
  Solved solve(double max_kappa);

 private:
  Net make_elements(double k, double edge_m) const;
  la::Matrix calc_slope_products(std::span<const Mode> modes) const override;
  Net make_net(int grid) const override;
  void calc_deflections(const Point2& point_m, std::span<const Mode> modes, std::span<double> w) const override;
  std::size_t find_element(const Point2& point_m, double& r, double& s) const;
  void refine(Solved& solved);

  std::vector<Point2> corners_m_;
  double side_m_ = 0.0;  // of an L
  double area_m2_ = 0.0, rim_m_ = 0.0, longest_m_ = 0.0;
  std::optional<double> tension_n_m_, lowest_hz_;
  double density_kg_m2_ = 0.0, rate_ = 0.0;
  int refined_ = 0;
  PolygonSetting setting_;
  TriangleBasis basis_;
  Net elements_;
  TriangleModes modes_;
  mutable std::size_t last_element_ = 0;
};

}  // namespace carillon::analytic
