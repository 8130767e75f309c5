// Bodies with known modes where their formulas, functions and elements are hardest: high numbers, slender sides, sharp corners, limits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "precompute/analytic/beam_functions.hpp"
#include "precompute/analytic/polygon.hpp"
#include "tests/hard/figure.hpp"
#include "tests/unit/precompute/analytic/bodies.hpp"

namespace carillon::hard {
namespace {

using namespace analytic;
using job::Edge;
using std::numbers::pi;

TEST(spectra, beam_functions_at_mode_1000) {
  // Slopes and moments at the ends, and the mean square by quadrature; cosh and sinh would overflow at mode 226.
  const std::string id = "beam_functions_at_mode_1000";
  const std::array<std::array<Edge, 2>, 4> all{
      {{Edge::free, Edge::free}, {Edge::clamped, Edge::free}, {Edge::clamped, Edge::hinged}, {Edge::free, Edge::sliding}}};
  double worst = 0.0;
  for (const std::array<Edge, 2>& ends : all) {
    const std::vector<double> roots = find_beam_roots(ends, 1001.0 * pi);
    ASSERT_GE(roots.size(), 1000u);
    for (const std::size_t n : {std::size_t{0}, std::size_t{11}, std::size_t{99}, std::size_t{999}}) {
      const BeamFunction w = make_beam_function(ends, roots[n]);
      for (int end = 0; end < 2; ++end) {
        const bool is_fixed = ends[end] == Edge::clamped || ends[end] == Edge::hinged,
                   is_level = ends[end] == Edge::clamped || ends[end] == Edge::sliding;
        worst = std::max({worst, std::abs(w.calc(end, is_fixed ? 0 : 3)), std::abs(w.calc(end, is_level ? 1 : 2))});
      }
      double sum = 0.0;
      const int pieces = 200000;
      for (int i = 0; i < pieces; ++i) sum += std::pow(w.calc((i + 0.5) / pieces), 2) / pieces;
      worst = std::max(worst, std::abs(sum - 1.0));
    }
  }
  hold(id, worst, 1e-4, "ends and mean square of modes 1 to 1000");
}

TEST(spectra, slender_membrane) {
  // Sides 1 : 1000: hundreds of modes within a per mille of the lowest frequency; each is there once.
  const std::string id = "slender_membrane";
  auto body = make(parse(R"({"membrane": {"shape": "rectangle", "length_m": 1000, "width_m": 1, "tension_n_m": 1, "density_kg_m2": 1}})"));
  const double high = 0.5 * std::sqrt(1.0 + 1e-6 * 200.5 * 200.5);
  const ModeList list = body->list_modes(high, kAll);
  hold(id, std::abs(static_cast<double>(list.modes.size()) - 200.0), 0.0, "modes missing of 200");
  double worst = 0.0;
  for (std::size_t m = 0; m < list.modes.size(); ++m) {
    const double n = static_cast<double>(m) + 1.0, lambda = pi * pi * (1.0 + 1e-6 * n * n);
    worst = std::max(worst, std::abs(list.modes[m].lambda_rad2_s2 / lambda - 1.0));
  }
  hold(id, worst, 1e-13, "relative error of lambda");
  // The same as a polygon, 1 : 30, by elements.
  auto strip = make(parse(
      R"({"membrane": {"shape": "polygon", "corners_m": [[0, 0], [30, 0], [30, 1], [0, 1]], "tension_n_m": 1, "density_kg_m2": 1}})"));
  const ModeList found = strip->list_modes(0.5 * std::sqrt(1.0 + 20.5 * 20.5 / 900.0), kAll);
  hold(id, std::abs(static_cast<double>(found.modes.size()) - 20.0), 0.0, "modes missing of 20, elements");
  worst = 0.0;
  for (std::size_t m = 0; m < found.modes.size(); ++m)
    worst = std::max(worst, std::abs(found.modes[m].lambda_rad2_s2 / (pi * pi * (1.0 + (m + 1.0) * (m + 1.0) / 900.0)) - 1.0));
  hold(id, worst, 1e-8, "relative error of lambda, elements");
}

Polygon::Solved solve(const std::vector<Point2>& corners, double max_kappa, const PolygonSetting& setting) {
  job::MembraneBody body;
  body.shape = "polygon";
  body.corners_m = corners;
  body.tension_n_m = body.density_kg_m2 = 1.0;
  body.thickness_m = 0.01;
  Polygon polygon(body, {}, setting);
  return polygon.solve(max_kappa);
}

TEST(spectra, slit_of_350_degrees) {
  // r^(18/35): the strongest singularity but for a crack. Truth: order ten and rings to 1e-12; and no bar is shorter than the error.
  const std::string id = "slit_of_350_degrees";
  const double s = std::tan(pi / 36);
  const std::vector<Point2> slit{{0, -1}, {1, -1}, {1, 1}, {-1, 1}, {-1, s}, {0, 0}, {-1, -s}, {-1, -1}};
  const Polygon::Solved truth = solve(slit, 90.0, {.order = 10, .edge_radians = 4.0, .corner_error = 1e-12, .ratio = 0.3}),
                        found = solve(slit, 90.0, {});
  ASSERT_EQ(found.kappa.size(), truth.kappa.size());
  double worst = 0.0, over = 0.0;
  for (std::size_t m = 0; m < found.kappa.size(); ++m) {
    const double error = std::abs(found.kappa[m] / truth.kappa[m] - 1.0);
    worst = std::max(worst, error);
    over = std::max(over, error / (found.error[m] + truth.error[m]));
  }
  hold(id, worst, 1e-6, "relative error of an eigenvalue");
  hold(id, over, 1.0, "error over its bar");
}

TEST(spectra, almost_an_annulus) {
  // Sixty-four corners about a hole, closed but for a slit of a tenth of a degree: nearly a ring cut open, whose separable modes are known:
  // J_nu(k r) Y_nu(k R) - Y_nu(k r) J_nu(k R) with nu = m pi / angle. Polygon and circle differ by their areas' part.
  const std::string id = "almost_an_annulus";
  const double gap = pi / 1800, inner = 0.5;
  const int sides = 32;
  std::vector<Point2> ring;
  for (int i = 0; i <= sides; ++i)
    ring.push_back({std::cos(gap / 2 + (2 * pi - gap) * i / sides), std::sin(gap / 2 + (2 * pi - gap) * i / sides)});
  for (int i = sides; i >= 0; --i)
    ring.push_back({inner * std::cos(gap / 2 + (2 * pi - gap) * i / sides), inner * std::sin(gap / 2 + (2 * pi - gap) * i / sides)});
  const Polygon::Solved found = solve(ring, 60.0, {.uses_particular_solutions = false});
  std::vector<double> wanted;
  for (int m = 1; m < 30; ++m) {
    const double nu = m * pi / (2 * pi - gap);
    const auto cross = [&](double k) {
      return std::cyl_bessel_j(nu, k) * std::cyl_neumann(nu, inner * k) - std::cyl_neumann(nu, k) * std::cyl_bessel_j(nu, inner * k);
    };
    double low = 6.0, high = 9.0;  // the first root: near pi / (1 - inner), rising with nu
    if ((cross(low) > 0) == (cross(high) > 0)) break;
    for (int step = 0; step < 60; ++step) ((cross(0.5 * (low + high)) > 0) == (cross(low) > 0) ? low : high) = 0.5 * (low + high);
    wanted.push_back(low * low);
  }
  double worst = 0.0;
  for (std::size_t m = 0; m < found.kappa.size() && m < wanted.size(); ++m)
    worst = std::max(worst, std::abs(found.kappa[m] / wanted[m] - 1.0));
  ASSERT_GE(found.kappa.size(), 6u);
  ASSERT_GE(wanted.size(), found.kappa.size());
  hold(id, worst, 0.03, "of a round ring, whose area is 0.6 per cent larger");
  hold(id, *std::max_element(found.error.begin(), found.error.end()), 1e-5, "longest bar");
}

TEST(spectra, clamped_plate_high_modes) {
  // The circle at 100 half-waves: I_m(k r) grows by 10^130. Roots must be those of their own equation with no digit lost, by the limit of
  // large k: k R -> (s + m / 2) pi for m = 0.
  const std::string id = "clamped_plate_high_modes";
  auto body = make(
      parse(R"({"plate": {"shape": "circle", "radius_m": 1, "thickness_m": 0.001, "edges": "clamped"}})", make_material(2e11, 0.3, 7850)));
  const double rate = std::sqrt(2e11 * 1e-6 / (12 * 0.91 * 7850));
  const ModeList list = body->list_modes(rate * 320.0 * 320.0 / (2 * pi), kAll);
  double worst = 0.0;
  int roots = 0;
  for (const Mode& mode : list.modes) {
    if (mode.index[0] != 0 || mode.index[1] < 90) continue;
    ++roots;
    const double k = std::sqrt(std::sqrt(mode.lambda_rad2_s2) / rate);
    worst = std::max(worst, std::abs(k - mode.index[1] * pi));
  }
  hold(id, roots >= 10 ? 0.0 : 1.0, 0.0, "roots from the ninetieth on that are missing");
  hold(id, worst, 2e-3, "distance of k R from s pi, which falls as 1 / (8 s)");
  hold(id, std::abs(static_cast<double>(list.modes.size()) / (320.0 * 320.0 / 4.0 - 320.0 / 2.0 - 320.0 * 0.26) - 1.0), 0.03,
       "modes against Weyl's law");
  // The square by Ritz's method, eighth hundred of modes, with its own bars.
  auto square = make(parse(R"({"plate": {"shape": "rectangle", "length_m": 1, "width_m": 1, "thickness_m": 0.001, "edges": "clamped"}})",
                           make_material(2e11, 0.3, 7850)));
  const ModeList ritz = square->list_modes(rate * 80.0 * 80.0 / (2 * pi), kAll);
  double cents = 0.0;
  for (const Mode& mode : ritz.modes) cents = std::max(cents, mode.error_cents);
  hold(id, cents, 0.01, "longest bar of a clamped square [cent]");
}

TEST(spectra, timoshenko_limit) {
  // As the beam gets thinner, Timoshenko's beam becomes Euler and Bernoulli's, from below and as the square of the thickness: no locking.
  const std::string id = "timoshenko_limit";
  double before = 0.0, worst = 0.0;
  for (const double thickness : {1e-2, 1e-3, 1e-4}) {
    const std::string beam =
        R"({"beam": {"length_m": 1, "motions": "bending", "ends": ["clamped", "free"], "diameter_m": )" + std::to_string(thickness);
    const double high = 2000.0 * thickness / 1e-2;
    const ModeList thick = make(parse(beam + R"(, "theory": "timoshenko"}})"))->list_modes(high, kAll),
                   thin = make(parse(beam + "}}"))->list_modes(high, kAll);
    const std::size_t count = std::min(thick.modes.size(), thin.modes.size());
    ASSERT_GE(count, 8u);
    const double off = 1.0 - to_hz(thick.modes[7]) / to_hz(thin.modes[7]);
    EXPECT_GT(off, 0.0) << thickness;
    if (before > 0.0) worst = std::max(worst, std::abs(before / off / 100.0 - 1.0));
    before = off;
  }
  hold(id, worst, 0.05, "how far the difference is from the square of the thickness");
}

}  // namespace
}  // namespace carillon::hard
