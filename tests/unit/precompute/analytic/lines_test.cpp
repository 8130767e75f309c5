// Strings and beams against closed forms computed independently with 30 digits, and against quadrature.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "precompute/analytic/line_bodies.hpp"
#include "precompute/analytic/polynomials.hpp"
#include "tests/unit/precompute/analytic/bodies.hpp"
#include "tests/unit/precompute/analytic/rows.hpp"

namespace carillon::analytic {
namespace {

using job::Edge;
using std::numbers::pi;

/// Simpson's rule on [0, 1]: independent of the closed forms.
template <class F>
double integrate(F&& f, int pieces = 20000) {
  double sum = f(0.0) + f(1.0);
  for (int i = 1; i < pieces; ++i) sum += (i % 2 == 1 ? 4.0 : 2.0) * f(static_cast<double>(i) / pieces);
  return sum / (3.0 * pieces);
}

const std::array<Edge, 4> kEdges{Edge::free, Edge::hinged, Edge::clamped, Edge::sliding};

TEST(BeamRoots, are_those_of_the_tables) {
  const auto check = [](std::array<Edge, 2> ends, std::vector<double> wanted) {
    for (const bool is_turned : {false, true}) {
      if (is_turned) std::swap(ends[0], ends[1]);
      const std::vector<double> found = find_beam_roots(ends, wanted.back() + 0.5);
      ASSERT_EQ(found.size(), wanted.size());
      for (std::size_t i = 0; i < wanted.size(); ++i) EXPECT_NEAR(found[i] / wanted[i], 1.0, 1e-14);
    }
  };
  const std::vector<double> free_free{4.7300407448627040, 7.8532046240958376, 10.995607838001671, 14.137165491257464};
  check({Edge::free, Edge::free}, free_free);
  check({Edge::clamped, Edge::clamped}, free_free);
  check({Edge::clamped, Edge::free}, {1.8751040687119612, 4.6940911329741746, 7.8547574382376126, 10.995540734875467});
  check({Edge::clamped, Edge::hinged}, {3.9266023120479188, 7.0685827456287321, 10.210176122813031});
  check({Edge::free, Edge::hinged}, {3.9266023120479188, 7.0685827456287321, 10.210176122813031});
  check({Edge::clamped, Edge::sliding}, {2.3650203724313520, 5.4978039190008359, 8.6393798286997407});
  check({Edge::free, Edge::sliding}, {2.3650203724313520, 5.4978039190008359, 8.6393798286997407});
  check({Edge::hinged, Edge::hinged}, {pi, 2 * pi, 3 * pi});
  check({Edge::sliding, Edge::sliding}, {pi, 2 * pi, 3 * pi});
  check({Edge::hinged, Edge::sliding}, {pi / 2, 3 * pi / 2, 5 * pi / 2});
}

TEST(BeamRoots, are_those_of_the_table) {
  const std::map<std::string, std::array<Edge, 2>> ends{{"free-free", {Edge::free, Edge::free}},
                                                        {"clamped-free", {Edge::clamped, Edge::free}},
                                                        {"clamped-pinned", {Edge::clamped, Edge::hinged}}};
  const auto rows = read_rows("beam_roots.csv");
  ASSERT_EQ(rows.size(), 24u);
  for (const auto& row : rows) {
    const auto n = std::stoul(row[1]);
    const std::vector<double> found = find_beam_roots(ends.at(row[0]), 40.0);
    ASSERT_GE(found.size(), n);
    EXPECT_NEAR(found[n - 1] / std::stod(row[2]), 1.0, 5e-15) << row[0] << n;
  }
}

TEST(BeamFunctions, meet_their_ends_and_are_orthonormal) {
  for (const Edge first : kEdges)
    for (const Edge last : kEdges) {
      const std::array<Edge, 2> ends{first, last};
      const std::vector<double> roots = find_beam_roots(ends, 20.0);
      for (const double a : roots) {
        const BeamFunction one = make_beam_function(ends, a);
        for (int end = 0; end < 2; ++end) {
          const bool is_fixed = ends[end] == Edge::hinged || ends[end] == Edge::clamped,
                     is_level = ends[end] == Edge::clamped || ends[end] == Edge::sliding;
          EXPECT_NEAR(one.calc(end, is_fixed ? 0 : 3), 0.0, 1e-12);
          EXPECT_NEAR(one.calc(end, is_level ? 1 : 2), 0.0, 1e-12);
        }
        for (const double b : roots) {
          const BeamFunction other = make_beam_function(ends, b);
          EXPECT_NEAR(integrate([&](double x) { return one.calc(x) * other.calc(x); }), a == b ? 1.0 : 0.0, 1e-10);
        }
      }
    }
}

TEST(BeamFunctions, lose_no_digits_in_high_modes) {
  // cosh and sinh would lose all digits: at mode 300 they differ in the 400th.
  const std::vector<double> roots = find_beam_roots({Edge::clamped, Edge::free}, 300.5 * pi);
  ASSERT_EQ(roots.size(), 301u);
  for (const double beta : roots) EXPECT_NEAR(std::abs(make_beam_function({Edge::clamped, Edge::free}, beta).calc(1.0)), 2.0, 1e-9) << beta;
}

TEST(Gauss, is_exact_for_polynomials) {
  for (const int n : {1, 2, 5, 40}) {
    const GaussRule rule = make_gauss_rule(n);
    double sum = 0.0;
    for (std::size_t i = 0; i < rule.x.size(); ++i) sum += rule.weight[i] * std::pow(rule.x[i], 2 * n - 1);
    EXPECT_NEAR(sum * 2 * n, 1.0, 1e-13) << n;
  }
}

TEST(ConditionedBasis, meets_its_conditions) {
  const la::Matrix basis = make_conditioned_basis(12, {EndConditions{true, true}, EndConditions{false, true}});
  EXPECT_EQ(basis.cols(), 9);
  EXPECT_NEAR((basis.transpose() * basis - la::Matrix::Identity(9, 9)).norm(), 0.0, 1e-13);
  EXPECT_NEAR((basis.transpose() * calc_legendre(12, 0.0)).norm(), 0.0, 1e-12);
  EXPECT_NEAR((basis.transpose() * calc_legendre(12, 1.0, 1)).norm(), 0.0, 1e-10);
}

TEST(KnownString, has_the_frequencies_and_shapes_of_the_books) {
  auto body = make(parse(R"({"string": {"length_m": 0.65, "tension_n": 70, "mass_kg_m": 4e-4}})"));
  const ModeList list = body->list_modes(1700.0, kAll);
  ASSERT_EQ(list.modes.size(), 10u);
  const std::array<double, 5> hz{321.7923178977214, 643.5846357954427, 965.3769536931641, 1287.169271590885, 1608.961589488607};
  const std::array<double, 5> phi{51.55217691535189, 83.41317444308707, 83.41317444308707, 51.55217691535189, 0.0};
  std::vector<Vec3> found(10);
  body->calc_shapes({0.13, 0, 0}, list.modes, found);
  for (std::size_t i = 0; i < 10; ++i) {
    EXPECT_NEAR(to_hz(list.modes[i]) / hz[i / 2], 1.0, 1e-14);
    EXPECT_NEAR(found[i][1 + i % 2], phi[i / 2], 1e-10);
    EXPECT_EQ(found[i][2 - i % 2], 0.0);
  }
}

TEST(KnownString, is_stiff_with_a_diameter) {
  auto body = make(parse(R"({"string": {"length_m": 0.65, "tension_n": 70, "mass_kg_m": 4e-4, "diameter_m": 0.25e-3}})",
                         make_material(2e11, 0.3, 7850)));
  const ModeList list = body->list_modes(1700.0, kAll);
  const std::array<double, 5> hz{321.7943770061107, 643.6011085044496, 965.4325481967523, 1287.301048203981, 1609.21895827647};
  for (std::size_t i = 0; i < 10; ++i) EXPECT_NEAR(to_hz(list.modes[i]) / hz[i / 2], 1.0, 1e-13);
}

TEST(KnownString, takes_its_lowest_frequency_in_place_of_the_tension) {
  auto body = make(parse(R"({"string": {"length_m": 0.65, "lowest_hz": 110, "diameter_m": 1e-3}})"));
  // Slightly higher by stiffness: by B / 2.
  const double stiffness =
      std::pow(pi, 3) * 2e11 * std::pow(1e-3, 4) / (64 * 4 * 0.65 * 0.65 * 110 * 110 * 7850 * pi / 4 * 1e-6 * 0.65 * 0.65);
  EXPECT_NEAR(to_hz(body->list_modes(150.0, kAll).modes[0]) / 110.0, std::sqrt(1 + stiffness), 1e-12);
}

const std::string kBar = R"({"beam": {"length_m": 0.3, "width_m": 0.02, "thickness_m": 0.006)";
const std::string kAluminium = make_material(7e10, 0.33, 2700);

TEST(KnownBeam, has_the_frequencies_and_shapes_of_the_books) {
  auto body = make(parse(kBar + R"(, "motions": "bending"}})", kAluminium));
  EXPECT_EQ(body->rigid_modes, 6);
  const ModeList list = body->list_modes(3200.0, kAll);
  std::vector<double> along_z;
  std::vector<Vec3> phi(list.modes.size());
  body->calc_shapes({0.3, 0, 0}, list.modes, phi);
  for (std::size_t i = 0; i < phi.size(); ++i)
    if (phi[i][2] != 0.0) {
      along_z.push_back(to_hz(list.modes[i]));
      EXPECT_NEAR(std::abs(phi[i][2]), 6.415002990995842, 1e-12);
    }
  const std::vector<double> wanted{348.9274616419854, 961.8319842007775, 1885.57526238988, 3116.951691430506};
  ASSERT_EQ(along_z.size(), wanted.size());
  for (std::size_t i = 0; i < wanted.size(); ++i) EXPECT_NEAR(along_z[i] / wanted[i], 1.0, 1e-13);
}

TEST(KnownBeam, torsion_and_axial_waves_have_their_speeds) {
  auto body = make(parse(R"({"beam": {"length_m": 0.5, "diameter_m": 0.01, "ends": ["clamped", "free"], "motions": ["torsion", "axial"]}})",
                         kAluminium));
  EXPECT_EQ(body->rigid_modes, 0);
  const double axial = std::sqrt(7e10 / 2700) / 2.0, torsion = std::sqrt(7e10 / 2.66 / 2700) / 2.0;  // lowest, Hz: c / 4 L
  const ModeList list = body->list_modes(axial * 1.01, kAll);
  ASSERT_EQ(list.modes.size(), 2u);
  EXPECT_NEAR(to_hz(list.modes[0]) / torsion, 1.0, 1e-13);
  EXPECT_NEAR(to_hz(list.modes[1]) / axial, 1.0, 1e-13);
  // Unit modal mass: rho A L <phi^2> along the axis, rho I_p L <phi'^2> in torsion.
  std::vector<Vec3> phi(2);
  body->calc_shapes({0.5, 0.005, 0.0}, list.modes, phi);
  const double area = pi * 25e-6, mass = 2700 * area * 0.5, polar = pi * std::pow(0.005, 4) / 2.0;
  EXPECT_NEAR(std::abs(phi[1][0]), std::sqrt(2.0 / mass), 1e-12 * std::sqrt(2.0 / mass));
  const double twist = std::sqrt(2.0 / (2700 * polar * 0.5));
  EXPECT_NEAR(std::abs(phi[0][2]), 0.005 * twist, 1e-12 * twist);
}

TEST(TorsionConstant, is_that_of_the_tables) {
  // Timoshenko and Goodier 1970, section 109: J / (a b^3) of a / b = 1, 2, 10.
  EXPECT_NEAR(calc_torsion_constant(1.0, 1.0), 0.14057701495515551, 1e-10);
  EXPECT_NEAR(calc_torsion_constant(2.0, 1.0) / 2.0, 0.2287, 1e-4);
  EXPECT_NEAR(calc_torsion_constant(1.0, 10.0) / 10.0, 0.3123, 1e-4);
}

/// Roots of Timoshenko's frequency equation of a beam hinged at both ends (closed form): omega^4 rho I / (k G A) ... for half-waves n.
TEST(Timoshenko, hinged_beam_has_the_closed_form) {
  const double length = 0.3, b = 0.02, h = 0.02, young = 7e10, nu = 0.33, rho = 2700, g = young / (2 * (1 + nu));
  const double kappa = 10 * (1 + nu) / (12 + 11 * nu), area = b * h, moment = b * h * h * h / 12;
  auto body = make(parse(
      R"({"beam": {"length_m": 0.3, "width_m": 0.02, "thickness_m": 0.02, "ends": "hinged", "theory": "timoshenko", "motions": "bending"}})",
      make_material(young, nu, rho)));
  const ModeList list = body->list_modes(20000.0, kAll);
  std::vector<double> wanted;
  for (int n = 1; n < 40; ++n) {
    const double k = n * pi / length, a = rho * moment / (kappa * g * area) * rho * area;
    // a w^4 - w^2 (rho A + k^2 (rho I + E I rho / (kappa G))) + E I k^4 = 0, with rho A in front of w^2.
    const double mid = rho * area + k * k * (rho * moment + young * moment * rho / (kappa * g)), end = young * moment * std::pow(k, 4);
    for (const double sign : {-1.0, 1.0}) {
      const double hz = std::sqrt((mid + sign * std::sqrt(mid * mid - 4 * a * end)) / (2 * a)) / (2 * pi);
      if (hz < 20000.0) wanted.push_back(hz), wanted.push_back(hz);  // a square section: both planes
    }
  }
  // Pure shear, n = 0: uniform rotation of the sections.
  std::sort(wanted.begin(), wanted.end());
  ASSERT_EQ(list.modes.size(), wanted.size());
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    EXPECT_NEAR(to_hz(list.modes[i]) / wanted[i], 1.0, 1e-8) << i;
    EXPECT_LE(1200 * std::abs(std::log2(to_hz(list.modes[i]) / wanted[i])), list.modes[i].error_cents + 1e-6);
  }
}

TEST(Timoshenko, slender_beam_is_that_of_euler_and_bernoulli) {
  const std::string rod =
      R"({"beam": {"length_m": 1, "width_m": 0.002, "thickness_m": 0.002, "motions": "bending", "ends": ["clamped", "free"])";
  const ModeList thick = make(parse(rod + R"(, "theory": "timoshenko"}})"))->list_modes(200.0, kAll),
                 thin = make(parse(rod + "}}"))->list_modes(200.0, kAll);
  ASSERT_EQ(thick.modes.size(), thin.modes.size());
  for (std::size_t i = 0; i < thin.modes.size(); ++i) EXPECT_NEAR(to_hz(thick.modes[i]) / to_hz(thin.modes[i]), 1.0, 5e-4);
}

}  // namespace
}  // namespace carillon::analytic
