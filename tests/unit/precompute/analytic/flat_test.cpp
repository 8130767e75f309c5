// Membranes and plates against closed forms, published tables and quadrature.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "precompute/analytic/flat_bodies.hpp"
#include "runtime/base/error.hpp"
#include "tests/unit/precompute/analytic/bodies.hpp"
#include "tests/unit/precompute/analytic/rows.hpp"

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

/// vdDP96, figure 2: the square membrane of unit length and 500 Hz, struck at (0.1, 0.1).
const std::string kFigure2 = R"({"membrane": {"shape": "rectangle", "length_m": 1, "width_m": 1, "lowest_hz": 500, "density_kg_m2": 1}})";

TEST(SquareMembrane, has_the_400_modes_of_figure_2) {
  auto body = make(parse(kFigure2));
  const ModeList list = body->list_modes(8201.0, kAll);
  const auto rows = read_rows("square_membrane_fig2.csv");
  ASSERT_EQ(rows.size(), 400u);
  ASSERT_EQ(list.modes.size(), rows.size());
  std::vector<Vec3> phi(list.modes.size());
  body->calc_shapes({0.1, 0.1, 0}, list.modes, phi);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    // To the nine printed digits; full precision of the listed half-waves.
    const double m = std::stod(rows[i][1]), n = std::stod(rows[i][2]), hz = 500 * std::sqrt((m * m + n * n) / 2);
    const double psi = 2 * std::sin(0.1 * pi * m) * std::sin(0.1 * pi * n), amplitude = psi * 500 / hz;
    EXPECT_NEAR(hz / std::stod(rows[i][3]), 1.0, 5e-9);
    EXPECT_NEAR(amplitude, std::stod(rows[i][5]), 5e-10);
    EXPECT_NEAR(to_hz(list.modes[i]) / hz, 1.0, 1e-12) << i;
  }
  // Degenerate pairs are in either order: compared after sorting.
  const auto sort_amplitudes = [&](auto get) {
    std::vector<std::pair<double, double>> all;
    for (std::size_t i = 0; i < rows.size(); ++i) all.emplace_back(std::round(to_hz(list.modes[i]) * 1e6), get(i));
    std::sort(all.begin(), all.end());
    return all;
  };
  const auto found = sort_amplitudes([&](std::size_t i) { return phi[i][2] * 500 / to_hz(list.modes[i]); });
  const auto wanted = sort_amplitudes([&](std::size_t i) {
    const double m = std::stod(rows[i][1]), n = std::stod(rows[i][2]);
    return 2 * std::sin(0.1 * pi * m) * std::sin(0.1 * pi * n) / std::sqrt((m * m + n * n) / 2);
  });
  for (std::size_t i = 0; i < rows.size(); ++i) EXPECT_NEAR(found[i].second, wanted[i].second, 1e-12) << i;
}

TEST(SquareMembrane, is_brighter_towards_its_edge_by_the_known_centroids) {
  auto body = make(parse(kFigure2));
  const ModeList list = body->list_modes(8201.0, kAll);
  double before = 0.0;
  for (const auto& row : read_rows("square_membrane_brightness.csv")) {
    std::vector<Vec3> phi(list.modes.size());
    body->calc_shapes({std::stod(row[0]), std::stod(row[1]), 0}, list.modes, phi);
    double sum = 0.0, weighted = 0.0;
    for (std::size_t i = 0; i < phi.size(); ++i) {
      const double hz = to_hz(list.modes[i]), energy = std::pow(phi[i][2] / hz, 2);
      sum += energy;
      weighted += energy * hz;
    }
    EXPECT_NEAR(weighted / sum, std::stod(row[2]), 6e-5) << row[0];
    EXPECT_GT(weighted / sum, before);
    before = weighted / sum;
  }
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

struct Root {
  double lambda, error;  // omega a^2 sqrt(rho h / D); relative, from the body's own bar
};

/// All modes up to the largest given one; for a circle only up to that many nodal diameters.
std::vector<Root> list_roots(const std::string& plate, double poisson_ratio, double largest, int most_diameters = 1 << 30) {
  auto body = make(parse(plate, make_material(2e11, poisson_ratio, 7850)));
  const double rate = std::sqrt(2e11 * 1e-6 / (12 * (1 - poisson_ratio * poisson_ratio) * 7850));
  std::vector<Root> found;
  for (const Mode& mode : body->list_modes(1.0001 * largest * rate / (2 * pi), kAll).modes)
    if (mode.index[0] <= most_diameters)
      found.push_back({std::sqrt(mode.lambda_rad2_s2) / rate, std::exp2(mode.error_cents / 1200.0) - 1.0});
  return found;
}

/// The plates of plates_kirchhoff.csv (Bessel roots and Ritz's method in other arithmetic): every mode with its multiplicity, and no other.
void expect_plates(const std::string& shape, const std::string& size, double least_tolerance, int most_diameters = 1 << 30) {
  struct Plate {
    std::vector<double> lambda;
    double tolerance = 0.0;
  };
  std::map<std::pair<std::string, std::string>, Plate> plates;  // by edges and Poisson's ratio
  for (const auto& row : read_rows("plates_kirchhoff.csv")) {
    if (row[0] != shape) continue;
    Plate& plate = plates[{row[1], row[2]}];
    const int times = row[6].empty() ? 1 : std::stoi(row[6]);
    plate.lambda.insert(plate.lambda.end(), static_cast<std::size_t>(times), std::stod(row[7]));
    if (row[8] != "exact") plate.tolerance = std::max(plate.tolerance, 4.0 * std::stod(row[8]) / std::stod(row[7]));
  }
  ASSERT_FALSE(plates.empty());
  const std::map<std::string, std::string> edges{{"free", R"("free")"},
                                                 {"clamped", R"("clamped")"},
                                                 {"ss", R"("hinged")"},
                                                 {"cantilever(CFFF)", R"(["clamped", "free", "free", "free"])"}};
  for (const auto& [key, plate] : plates) {
    const double nu = key.second == "any" ? 0.3 : std::stod(key.second);
    const std::vector<Root> found =
        list_roots(R"({"plate": {"shape": ")" + size + R"(, "thickness_m": 0.001, "edges": )" + edges.at(key.first) + "}}", nu,
                   plate.lambda.back(), most_diameters);
    // The table may end within a pair.
    ASSERT_GE(found.size(), plate.lambda.size()) << key.first << " " << key.second;
    for (std::size_t i = plate.lambda.size(); i < found.size(); ++i) EXPECT_NEAR(found[i].lambda / plate.lambda.back(), 1.0, 1e-7) << i;
    for (std::size_t i = 0; i < plate.lambda.size(); ++i) {
      const double off = std::abs(found[i].lambda / plate.lambda[i] - 1.0);
      EXPECT_LE(off, std::max(plate.tolerance, least_tolerance) + found[i].error) << key.first << " " << key.second << " " << i;
      EXPECT_LT(found[i].error, key.first == "cantilever(CFFF)" ? 1e-4 : 1e-6) << key.first << " " << key.second << " " << i;
    }
  }
}

TEST(CircularPlate, has_the_roots_of_the_table) { expect_plates("circle", R"(circle", "radius_m": 1)", 2e-13, 6); }

TEST(RectangularPlate, has_the_frequencies_of_the_table) { expect_plates("square", R"(rectangle", "length_m": 1, "width_m": 1)", 1e-12); }

TEST(Membranes, have_the_eigenvalues_of_the_table) {
  const std::map<std::string, std::string> shapes{{"unit disk", R"("circle", "radius_m": 1)"},
                                                  {"unit square", R"("rectangle", "length_m": 1, "width_m": 1)"},
                                                  {"L-shape (3 unit squares)", R"("L", "side_m": 1)"}};
  std::map<std::string, std::vector<double>> wanted;
  for (const auto& row : read_rows("membranes.csv")) wanted[row[0]].push_back(std::stod(row[3]));
  ASSERT_EQ(wanted.size(), shapes.size());
  for (const auto& [name, kappa] : wanted) {
    auto body = make(parse(R"({"membrane": {"shape": )" + shapes.at(name) + R"(, "tension_n_m": 1, "density_kg_m2": 1}})"));
    const ModeList list = body->list_modes(1.0001 * std::sqrt(kappa.back()) / (2 * pi), kAll);
    ASSERT_EQ(list.modes.size(), kappa.size()) << name;
    for (std::size_t i = 0; i < kappa.size(); ++i) EXPECT_NEAR(list.modes[i].lambda_rad2_s2 / kappa[i], 1.0, 1e-12) << name << i;
  }
}

TEST(RitzPlate, has_the_closed_form_where_there_is_one) {
  const std::string square = R"({"plate": {"shape": "rectangle", "length_m": 1, "width_m": 1, "thickness_m": 0.001, "edges": )";
  // All edges other than hinged use Ritz's method: two opposite hinged and two sliding edges have the closed form pi^2 (m^2 + n^2).
  std::vector<double> wanted;
  for (int m = 1; m < 9; ++m)
    for (int n = 0; n < 9; ++n) wanted.push_back(pi * pi * (m * m + n * n));
  std::sort(wanted.begin(), wanted.end());
  wanted.resize(40);
  const std::vector<Root> found = list_roots(square + R"(["hinged", "hinged", "sliding", "sliding"]}})", 0.3, wanted.back());
  ASSERT_GE(found.size(), wanted.size());
  for (std::size_t i = 0; i < wanted.size(); ++i) EXPECT_NEAR(found[i].lambda / wanted[i], 1.0, 1e-9) << i;
}

TEST(RitzPlate, says_how_wrong_it_can_be) {
  // A corner between a clamped and a free edge gives algebraic convergence: bars must cover it. Truth: twice as many polynomials.
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
  // Modal mass by quadrature over a fine mesh, for each kind of flat body.
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
    const ClosedSurface surface = body->make_surface(160);
    const double density = body->rigid.mass_kg / body->rigid.volume_m3, thickness = surface.vertices_m[0][2] - surface.vertices_m.back()[2];
    std::vector<double> sums(count * count, 0.0);
    std::vector<Vec3> phi(count);
    for (const Triangle& t : surface.triangles) {
      const Vec3 &a = surface.vertices_m[t[0]], &b = surface.vertices_m[t[1]], &c = surface.vertices_m[t[2]];
      const double area = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
      if (!(a[2] > 0 && b[2] > 0 && c[2] > 0)) continue;  // upper face only
      for (const auto& [p, q] :
           {std::pair(&a, &b), std::pair(&b, &c), std::pair(&c, &a)}) {  // midpoints of edges: exact for squares of linear functions
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
