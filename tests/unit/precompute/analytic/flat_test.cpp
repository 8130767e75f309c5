// Membranes and plates against closed forms, published tables and quadrature.
#include <gtest/gtest.h>

#include <algorithm>

#include "precompute/analytic/flat_bodies.hpp"
#include "runtime/base/error.hpp"
#include "tests/unit/precompute/analytic/bodies.hpp"

namespace carillon::analytic {
namespace {

using std::numbers::pi;

struct Known {
  double hz, phi;
};

void expect_modes(KnownBody& body, double high_hz, const Vec3& point, const std::vector<Known>& wanted) {
  const ModeList list = body.list_modes(high_hz, kAll);
  std::vector<Vec3> phi(list.modes.size());
  body.calc_shapes(point, list.modes, phi);
  ASSERT_EQ(list.modes.size(), wanted.size());
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    EXPECT_NEAR(to_hz(list.modes[i]) / wanted[i].hz, 1.0, 1e-13) << i;
    EXPECT_NEAR(phi[i][2], wanted[i].phi, 1e-12) << i;
  }
}

TEST(RectangularMembrane, has_the_modes_of_the_books) {
  auto body =
      make(parse(R"({"membrane": {"shape": "rectangle", "length_m": 0.4, "width_m": 0.3, "tension_n_m": 2000, "density_kg_m2": 0.26}})"));
  expect_modes(*body, 465.0, {0.1, 0.1, 0},
               {{182.7204206889644, 6.933752452815364},
                {263.5231383473649, 9.805806756909202},
                {312.2327917425014, 6.933752452815364},
                {359.9174881699947, 6.933752452815364},
                {365.4408413779288, 9.805806756909202},
                {440.0490454405763, 6.933752452815364},
                {452.0253566747369, 0.0},
                {462.2501635210243, 0.0}});
}

TEST(CircularMembrane, has_the_modes_of_the_books) {
  auto body = make(parse(R"({"membrane": {"shape": "circle", "radius_m": 0.2, "tension_n_m": 2000, "density_kg_m2": 0.26}})"));
  expect_modes(*body, 590.0, {0.1, 0, 0},
               {{167.8425382426248, 7.139156236713884},
                {267.430314760655, 11.28100836873997},
                {267.430314760655, 0.0},
                {358.4359288921936, 10.48187256273604},
                {358.4359288921936, 0.0},
                {385.2686604910141, -2.738027146021934},
                {445.2973994657747, 8.956609778081446},
                {445.2973994657747, 0.0},
                {489.6462739905481, 3.496169999820917},
                {489.6462739905481, 0.0},
                {529.6212239534351, 7.283799086583081},
                {529.6212239534351, 0.0},
                {587.4736389970202, 8.881244115004571},
                {587.4736389970202, 0.0}});
}

TEST(HingedPlate, has_the_modes_of_the_books) {
  auto body = make(parse(R"({"plate": {"shape": "rectangle", "length_m": 0.4, "width_m": 0.3, "thickness_m": 0.001, "edges": "hinged"}})",
                         make_material(2e11, 0.3, 7850)));
  expect_modes(*body, 245.0, {0.1, 0.1, 0},
               {{41.65491416418564, 1.261886162812672},
                {86.64222146150614, 1.784576525620624},
                {121.6323493594221, 1.261886162812672},
                {161.6210669570403, 1.261886162812672},
                {166.6196566567426, 1.784576525620624},
                {241.5985021522767, 1.261886162812672}});
}

/// lambda^2 = omega a^2 sqrt(rho h / D) of all modes up to the largest of those given.
std::vector<double> list_lambdas(const std::string& plate, double poisson_ratio, double largest) {
  auto body = make(parse(plate, make_material(2e11, poisson_ratio, 7850)));
  const double rate = std::sqrt(2e11 * 1e-6 / (12 * (1 - poisson_ratio * poisson_ratio) * 7850));
  std::vector<double> found;
  for (const Mode& mode : body->list_modes(1.0001 * largest * rate / (2 * pi), kAll).modes)
    found.push_back(std::sqrt(mode.lambda_rad2_s2) / rate);
  return found;
}

void expect_all_in(const std::vector<double>& found, const std::vector<double>& wanted, double tolerance) {
  for (const double value : wanted) {
    const auto nearest =
        std::min_element(found.begin(), found.end(), [&](double a, double b) { return std::abs(a - value) < std::abs(b - value); });
    ASSERT_NE(nearest, found.end());
    EXPECT_NEAR(*nearest / value, 1.0, tolerance) << value;
  }
}

TEST(CircularPlate, has_the_roots_of_the_tables) {
  const std::string circle = R"({"plate": {"shape": "circle", "radius_m": 1, "thickness_m": 0.001, "edges": )";
  // Free, nu = 0.3: Leissa 1969, table 2.5, recomputed to 14 digits. Pairs but for m = 0.
  const std::vector<double> free{5.3583297878999, 9.0031373502955, 12.438988165408, 20.474550113938,
                                 21.835162704169, 33.494931587508, 35.260108315373, 38.443198244752};
  const std::vector<double> found = list_lambdas(circle + R"("free"}})", 0.3, free.back());
  EXPECT_EQ(found.size(), 2 * free.size() - 2);
  expect_all_in(found, free, 1e-12);
  const std::vector<double> clamped = list_lambdas(circle + R"("clamped"}})", 0.3, 40.0);
  expect_all_in(clamped, {10.2158261963, 21.2604036, 34.8770356, 39.7711482}, 1e-7);
  expect_all_in(list_lambdas(circle + R"("hinged"}})", 0.3, 30.0), {4.9351, 13.8982, 25.6133, 29.7200}, 1e-4);
}

TEST(RitzPlate, has_the_frequencies_of_the_tables) {
  const std::string square = R"({"plate": {"shape": "rectangle", "length_m": 1, "width_m": 1, "thickness_m": 0.001, "edges": )";
  // Leissa 1973 and later solutions with bounds.
  expect_all_in(list_lambdas(square + R"("clamped"}})", 0.3, 133.0), {35.985190, 73.393848, 108.216271, 131.580905, 132.204793}, 3e-7);
  expect_all_in(list_lambdas(square + R"("free"}})", 0.3, 36.0), {13.4682, 19.5961, 24.2702, 34.8009}, 3e-5);
  expect_all_in(list_lambdas(square + R"(["clamped", "free", "free", "free"]}})", 0.3, 32.0), {3.4711, 8.5073, 21.285, 27.199, 30.955},
                1e-3);
  // Other edges than all hinged come from Ritz's method: opposite ones hinged, the others sliding, have a closed form, pi^2 (m^2 + n^2).
  std::vector<double> wanted;
  for (int m = 1; m < 9; ++m)
    for (int n = 0; n < 9; ++n) wanted.push_back(pi * pi * (m * m + n * n));
  std::sort(wanted.begin(), wanted.end());
  wanted.resize(40);
  const std::vector<double> found = list_lambdas(square + R"(["hinged", "hinged", "sliding", "sliding"]}})", 0.3, wanted.back());
  ASSERT_GE(found.size(), wanted.size());
  for (std::size_t i = 0; i < wanted.size(); ++i) EXPECT_NEAR(found[i] / wanted[i], 1.0, 1e-9) << i;
}

TEST(RitzPlate, says_how_wrong_it_can_be) {
  // A corner where a clamped edge meets a free one makes the convergence algebraic: bars must cover it. Truth: twice as many polynomials.
  auto body = make(parse(
      R"({"plate": {"shape": "rectangle", "length_m": 1, "width_m": 0.7, "thickness_m": 0.001, "edges": ["clamped", "free", "free", "clamped"]}})"));
  const ModeList coarse = body->list_modes(40.0, kAll);
  const ModeList fine = body->list_modes(400.0, kAll);
  ASSERT_GT(coarse.modes.size(), 5u);
  for (std::size_t i = 0; i < coarse.modes.size(); ++i) {
    const double cents = 1200 * std::abs(std::log2(to_hz(coarse.modes[i]) / to_hz(fine.modes[i])));
    EXPECT_LE(cents, coarse.modes[i].error_cents) << i;
    EXPECT_LT(coarse.modes[i].error_cents, 1.0) << i;
  }
}

TEST(FlatBodies, have_orthonormal_modes) {
  // What goes in comes out: the modal mass by quadrature over a fine net, for each kind of flat body.
  const std::vector<std::string> bodies{
      R"({"membrane": {"shape": "rectangle", "length_m": 1, "width_m": 0.6, "tension_n_m": 100, "density_kg_m2": 0.3}})",
      R"({"membrane": {"shape": "circle", "radius_m": 0.5, "tension_n_m": 100, "density_kg_m2": 0.3}})",
      R"({"membrane": {"shape": "L", "side_m": 0.5, "tension_n_m": 100, "density_kg_m2": 0.3}})",
      R"({"plate": {"shape": "circle", "radius_m": 0.5, "thickness_m": 0.002, "edges": "free"}})",
      R"({"plate": {"shape": "circle", "radius_m": 0.5, "thickness_m": 0.002, "edges": "clamped"}})",
      R"({"plate": {"shape": "circle", "radius_m": 0.5, "thickness_m": 0.002, "edges": "hinged"}})",
      R"({"plate": {"shape": "circle", "radius_m": 0.5, "thickness_m": 0.002, "edges": "sliding"}})",
      R"({"plate": {"shape": "rectangle", "length_m": 1, "width_m": 0.6, "thickness_m": 0.002}})",
      R"({"plate": {"shape": "rectangle", "length_m": 1, "width_m": 0.6, "thickness_m": 0.002, "edges": ["clamped", "hinged", "free", "sliding"]}})"};
  for (const std::string& text : bodies) {
    auto body = make(parse(text, make_material(2e11, 0.3, 7850)));
    const ModeList list = body->list_modes(100.0, 12);
    const std::size_t count = std::min<std::size_t>(12, list.modes.size());
    ASSERT_GE(count, 6u) << text;
    const std::span<const Mode> modes(list.modes.data(), count);
    const Surface surface = body->make_surface(160);
    const double density = body->rigid.mass_kg / body->rigid.volume_m3, thickness = surface.vertices_m[0][2] - surface.vertices_m.back()[2];
    std::vector<double> sums(count * count, 0.0);
    std::vector<Vec3> phi(count);
    for (const bank::Triangle& t : surface.triangles) {
      const Vec3 &a = surface.vertices_m[t[0]], &b = surface.vertices_m[t[1]], &c = surface.vertices_m[t[2]];
      const double area = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
      if (!(a[2] > 0 && b[2] > 0 && c[2] > 0)) continue;  // the upper side
      for (const auto& [p, q] :
           {std::pair(&a, &b), std::pair(&b, &c), std::pair(&c, &a)}) {  // mid-points of edges: exact for squares of lines
        body->calc_shapes(0.5 * (*p + *q), modes, phi);
        for (std::size_t i = 0; i < count; ++i)
          for (std::size_t j = 0; j < count; ++j) sums[i * count + j] += density * thickness * area / 3.0 * phi[i][2] * phi[j][2];
      }
    }
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t j = 0; j < count; ++j) EXPECT_NEAR(sums[i * count + j], i == j ? 1.0 : 0.0, 3e-3) << text << i << " " << j;
  }
}

TEST(Materials, that_are_not_the_same_in_all_directions_are_refused) {
  const job::JobSpec job = parse(R"({"plate": {"shape": "circle", "radius_m": 0.5, "thickness_m": 0.002}})", R"("spruce")");
  EXPECT_THROW(make(job), InputError);
}

}  // namespace
}  // namespace carillon::analytic
