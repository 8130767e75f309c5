// Polygons: triangulation, high-order elements, particular solutions.
#include "precompute/analytic/polygon.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "precompute/analytic/particular_solutions.hpp"
#include "precompute/analytic/triangulate.hpp"
#include "tests/unit/precompute/analytic/bodies.hpp"

namespace carillon::analytic {
namespace {

using std::numbers::pi;

const std::vector<Point2> kSquare{{0, 0}, {1, 0}, {1, 1}, {0, 1}};
const std::vector<Point2> kL{{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}};

/// A comb whose teeth are a hundred times as long as wide.
std::vector<Point2> make_comb(int teeth) {
  std::vector<Point2> p{{0, 0}, {static_cast<double>(teeth), 0}};
  for (int i = teeth - 1; i >= 0; --i) {
    p.push_back({i + 0.9, 10});
    p.push_back({i + 0.8, 10});
    if (i > 0) p.push_back({i + 0.7, 1}), p.push_back({i + 0.1, 1});
  }
  p.push_back({0.0, 1});
  return p;
}

double calc_area(const std::vector<Point2>& p) {
  double twice = 0.0;
  for (std::size_t i = 0; i < p.size(); ++i) twice += p[i][0] * p[(i + 1) % p.size()][1] - p[i][1] * p[(i + 1) % p.size()][0];
  return 0.5 * twice;
}

void expect_net(const Net& net, double area) {
  double sum = 0.0;
  std::map<std::pair<int, int>, int> edges;
  for (const Triangle& t : net.triangles) {
    const Point2 &a = net.points_m[t[0]], &b = net.points_m[t[1]], &c = net.points_m[t[2]];
    const double part = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
    EXPECT_GT(part, 0.0);
    sum += part;
    for (int k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
  }
  EXPECT_NEAR(sum / area, 1.0, 1e-12);
  for (const auto& [edge, count] : edges) EXPECT_EQ(count, 1);
  // V - E + F = 1 of a disc: no hole, no second part.
  std::size_t rim = 0;
  for (const auto& [edge, count] : edges) rim += edges.count({edge.second, edge.first}) == 0 ? 1 : 0;
  EXPECT_EQ(net.points_m.size() + net.triangles.size(), (edges.size() + rim) / 2 + 1);
}

TEST(Triangulate, refuses_a_sliver_that_takes_too_many) {
  const std::vector<Point2> sliver{{0, 0}, {1, 0}, {1, 1e-5}};
  EXPECT_THROW(triangulate(sliver, 2e-6, {}, 1000), InputError);
}

TEST(Triangulate, fills_any_polygon) {
  for (const auto& polygon : {kSquare, kL, make_comb(5), make_comb(40)})
    for (const double edge : {10.0, 0.5, 0.21}) {
      Net net = triangulate(polygon, edge);
      expect_net(net, calc_area(polygon));
      for (const Triangle& t : net.triangles)
        for (int k = 0; k < 3; ++k) {
          const Point2 &a = net.points_m[t[k]], &b = net.points_m[t[(k + 1) % 3]];
          EXPECT_LE(std::hypot(b[0] - a[0], b[1] - a[1]), 1.5 * edge + (edge > 5.0 ? 10.0 : 0.0));
        }
      grade(net, 3, 12, 0.2);
      expect_net(net, calc_area(polygon));
    }
}

TEST(Triangulate, keeps_corners_apart) {
  for (const int n : {8, 40, 200}) {
    std::vector<Point2> round;
    for (int i = 0; i < n; ++i) round.push_back({std::cos(2 * pi * i / n), std::sin(2 * pi * i / n)});
    const Net net = triangulate(round, 0.4, std::vector<bool>(round.size(), true));
    expect_net(net, calc_area(round));
    for (const Triangle& t : net.triangles) EXPECT_LT(std::count_if(t.begin(), t.end(), [&](std::int32_t v) { return v < n; }), 2);
  }
}

TEST(Angles, are_those_inside) {
  const std::vector<double> angles = calc_angles(kL);
  for (std::size_t i = 0; i < angles.size(); ++i) EXPECT_NEAR(angles[i], i == 3 ? 1.5 * pi : 0.5 * pi, 1e-15);
}

TEST(TriangleBasis, is_one_at_its_points_and_sums_to_one) {
  for (const int order : {1, 2, 5, 8, 10}) {
    const TriangleBasis basis(order);
    ASSERT_EQ(basis.size(), (order + 1) * (order + 2) / 2);
    for (int i = 0; i < basis.size(); ++i) {
      const la::Vector values = basis.calc(basis.points()[i][0], basis.points()[i][1]);
      for (int j = 0; j < basis.size(); ++j) EXPECT_NEAR(values(j), i == j ? 1.0 : 0.0, 1e-12);
    }
    EXPECT_NEAR(basis.calc(0.21, 0.33).sum(), 1.0, 1e-12);
    EXPECT_NEAR(basis.mass.sum(), 0.5, 1e-12);
    EXPECT_NEAR(basis.stiffness_rr.sum(), 0.0, 1e-10);
  }
}

TEST(TriangleModes, of_a_square_are_those_of_the_closed_form) {
  std::vector<double> wanted;
  for (int m = 1; m < 9; ++m)
    for (int n = 1; n < 9; ++n) wanted.push_back(pi * pi * (m * m + n * n));
  std::sort(wanted.begin(), wanted.end());
  const TriangleModes modes = solve_triangles(triangulate(kSquare, 0.18), TriangleBasis(8), 500.0);
  ASSERT_EQ(modes.kappa.size(), static_cast<std::size_t>(std::count_if(wanted.begin(), wanted.end(), [](double k) { return k < 500.0; })));
  for (std::size_t m = 0; m < modes.kappa.size(); ++m) {
    EXPECT_NEAR(modes.kappa[m] / wanted[m], 1.0, 1e-9);
    EXPECT_GT(modes.kappa[m] / wanted[m], 1.0 - 1e-11);  // from above
    EXPECT_LT(modes.residuals[m], 1e-9);
  }
}

/// L of three unit squares: computed with 70 digits and 48 functions (with 36 these digits agree).
const std::vector<double> kLValues{9.6397238440219410527, 15.19725192645434327, 2 * pi* pi,       29.52148111414488329, 31.9126359571377622,
                                   41.474509890214922,    44.94848778135123,    5 * pi* pi,       5 * pi* pi,           56.7096098873851,
                                   65.376535709845885,    71.05775564851353,    71.57267968033656};

TEST(ParticularSolutions, give_the_l_shape_to_twelve_digits) {
  const auto solutions = ParticularSolutions::make(kL);
  ASSERT_TRUE(solutions);
  for (const double wanted : kLValues) {
    const int multiplicity = wanted == 5 * pi * pi ? 2 : 1;
    for (const double off : {-3e-7, 5e-6}) {
      const auto found = solutions->refine(wanted * (1 + off), 1e-5, multiplicity);
      ASSERT_TRUE(found) << wanted;
      EXPECT_NEAR(found->kappa / wanted, 1.0, 1e-13) << wanted;
      EXPECT_LE(std::abs(found->kappa / wanted - 1.0), found->error + 3e-15);
    }
  }
  EXPECT_FALSE(solutions->refine(12.0, 1e-5, 1));  // no eigenvalue there
}

TEST(ParticularSolutions, need_no_more_than_one_corner_with_a_singularity) {
  EXPECT_TRUE(ParticularSolutions::make(kSquare));
  EXPECT_FALSE(ParticularSolutions::make(make_comb(3)));
  const auto triangle = ParticularSolutions::make({{0, 0}, {1, 0}, {0.5, std::sqrt(0.75)}});
  ASSERT_TRUE(triangle);
  const double wanted = 16 * pi * pi / 3;  // Lame 1852: equilateral triangle of unit side
  EXPECT_NEAR(triangle->refine(wanted * 1.000001, 1e-5, 1).value().kappa / wanted, 1.0, 1e-13);
}

TEST(PolygonMembrane, L_is_known_to_twelve_digits_with_all_its_modes) {
  auto body = make(parse(R"({"membrane": {"shape": "L", "side_m": 1, "tension_n_m": 1, "density_kg_m2": 1}})"));
  const ModeList list = body->list_modes(std::sqrt(71.6) / (2 * pi), kAll);
  ASSERT_EQ(list.modes.size(), kLValues.size());
  for (std::size_t i = 0; i < kLValues.size(); ++i) EXPECT_NEAR(list.modes[i].lambda_rad2_s2 / kLValues[i], 1.0, 1e-12) << i;
}

TEST(PolygonMembrane, that_is_a_rectangle_is_the_rectangle) {
  auto polygon = make(parse(
      R"({"membrane": {"shape": "polygon", "corners_m": [[0, 0], [0, 0.3], [0.4, 0.3], [0.4, 0]], "tension_n_m": 2000, "density_kg_m2": 0.26}})"));
  auto rectangle =
      make(parse(R"({"membrane": {"shape": "rectangle", "length_m": 0.4, "width_m": 0.3, "tension_n_m": 2000, "density_kg_m2": 0.26}})"));
  const ModeList one = polygon->list_modes(1000.0, kAll), other = rectangle->list_modes(1000.0, kAll);
  ASSERT_EQ(one.modes.size(), other.modes.size());
  std::vector<Vec3> a(one.modes.size()), b(a.size());
  polygon->calc_shapes({0.11, 0.07, 0}, one.modes, a);
  rectangle->calc_shapes({0.11, 0.07, 0}, other.modes, b);
  for (std::size_t i = 0; i < a.size();) {
    std::size_t end = i;  // end of a degenerate group, whose basis is arbitrary: (3, 4) and (4, 3) and similar of a rectangle 4 : 3
    double found = 0.0, wanted = 0.0;
    for (; end < a.size() && other.modes[end].lambda_rad2_s2 < (1.0 + 1e-9) * other.modes[i].lambda_rad2_s2; ++end) {
      EXPECT_NEAR(one.modes[end].lambda_rad2_s2 / other.modes[end].lambda_rad2_s2, 1.0, 1e-12);
      found += a[end][2] * a[end][2];
      wanted += b[end][2] * b[end][2];
    }
    EXPECT_NEAR(std::sqrt(found), std::sqrt(wanted), 1e-4) << i;
    i = end;
  }
}

TEST(PolygonMembrane, error_bars_cover_what_singular_corners_cost) {
  // Two re-entrant corners: no particular solutions. Truth: the same with three times the band, hence elements a third as large.
  auto body = make(parse(
      R"({"membrane": {"shape": "polygon", "corners_m": [[0,0],[3,0],[3,1],[2,1],[2,2],[1,2],[1,1],[0,1]], "tension_n_m": 1, "density_kg_m2": 1}})"));
  const ModeList coarse = body->list_modes(0.9, kAll), fine = body->list_modes(2.7, kAll);
  ASSERT_GT(coarse.modes.size(), 5u);
  for (std::size_t i = 0; i < coarse.modes.size(); ++i) {
    const double cents = 1200 * std::abs(std::log2(to_hz(coarse.modes[i]) / to_hz(fine.modes[i])));
    EXPECT_LE(cents, coarse.modes[i].error_cents + fine.modes[i].error_cents) << i;
    EXPECT_LT(coarse.modes[i].error_cents, 0.1) << i;
  }
}

TEST(PolygonMembrane, takes_its_lowest_frequency_in_place_of_the_tension) {
  auto body = make(parse(R"({"membrane": {"shape": "L", "side_m": 0.3, "lowest_hz": 200, "density_kg_m2": 0.3}})"));
  const ModeList list = body->list_modes(500.0, kAll);
  EXPECT_NEAR(to_hz(list.modes[0]), 200.0, 1e-9);
  EXPECT_NEAR(to_hz(list.modes[2]), 200.0 * std::sqrt(kLValues[2] / kLValues[0]), 1e-8);
}

}  // namespace
}  // namespace carillon::analytic
