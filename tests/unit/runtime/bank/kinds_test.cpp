// Known kinds of motion: textbook shapes on lattices of points.
#include "runtime/bank/kinds.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {
namespace {

using Field = std::function<Vec3(const Vec3&)>;
constexpr double kPi = std::numbers::pi;

/// Two triangles for each cell of a map of (i, j) to points, with duplicate points at the edges.
void add_patch(Bank& bank, int rows, int columns, const std::function<Vec3(double, double)>& map) {
  const auto first = static_cast<std::int32_t>(bank.vertices_m.size());
  for (int i = 0; i <= rows; ++i)
    for (int j = 0; j <= columns; ++j) bank.vertices_m.push_back(map(static_cast<double>(i) / rows, static_cast<double>(j) / columns));
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < columns; ++j) {
      const std::int32_t a = first + i * (columns + 1) + j, b = a + 1, c = a + columns + 1, d = c + 1;
      bank.triangles.push_back({a, c, b});
      bank.triangles.push_back({b, c, d});
    }
}

/// Box about `centre` with edges along the rows of `axes`.
Bank make_box(const Vec3& sides, const std::array<int, 3>& cells, const Mat3& axes = {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}) {
  Bank bank;
  for (int k = 0; k < 3; ++k)
    for (const double side : {-0.5, 0.5}) {
      const int a = (k + 1) % 3, b = (k + 2) % 3;
      add_patch(bank, cells[a], cells[b], [&](double s, double t) {
        Vec3 p{};
        p[k] = side * sides[k];
        p[a] = (side > 0 ? s - 0.5 : 0.5 - s) * sides[a];
        p[b] = (t - 0.5) * sides[b];
        return turn_back(axes, p) + Vec3{0.3, -0.2, 1.0};
      });
    }
  return bank;
}

/// Surface of revolution about z with meridian (radius, height) of 0 to 1.
Bank make_round(const std::function<std::array<double, 2>(double)>& meridian, int rows = 40, int around = 48) {
  Bank bank;
  add_patch(bank, rows, around, [&](double s, double t) {
    const auto [radius, height] = meridian(s);
    return Vec3{radius * std::cos(2 * kPi * t), radius * std::sin(2 * kPi * t), height};
  });
  return bank;
}

std::vector<std::string> find(Bank bank, const std::vector<Field>& fields) {
  for (std::size_t m = 0; m < fields.size(); ++m) {
    bank.eigenvalue_rad2_s2.push_back(static_cast<double>(m + 1));
    bank.shape_scale.push_back(1.0 / 32767);
  }
  for (const Vec3& p : bank.vertices_m)
    for (const Field& field : fields) {
      const Vec3 u = field(p - Vec3{0.3, -0.2, 1.0});
      for (const double x : u) bank.shape.push_back(static_cast<std::int16_t>(std::lround(32767 * std::clamp(0.2 * x, -1.0, 1.0))));
    }
  std::vector<std::string> kinds;
  for (const ModeKind& kind : find_kinds(bank)) kinds.push_back(describe(kind));
  return kinds;
}

/// Deflection and slope of a free Euler-Bernoulli bar of length 1, x from -1/2, with n + 1 nodes.
std::array<double, 2> bend(int n, double x) {
  const double k = (n + 0.5) * kPi - (n == 1 ? -0.0177 : n == 2 ? 0.0008 : 0.0), s = k * (x + 0.5);
  const double sigma = (std::cosh(k) - std::cos(k)) / (std::sinh(k) - std::sin(k));
  return {std::cosh(s) + std::cos(s) - sigma * (std::sinh(s) + std::sin(s)),
          k * (std::sinh(s) - std::sin(s) - sigma * (std::cosh(s) + std::cos(s)))};
}

TEST(Kinds, of_a_bar_are_those_of_beam_theory_in_any_position) {
  // Bending: u = -z w', w.
  const double s = std::sqrt(0.5);
  const Mat3 straight{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}, turned{Vec3{s, s, 0}, Vec3{-0.5, 0.5, s}, Vec3{0.5, -0.5, s}};
  for (const Mat3& axes : {straight, turned}) {
    const auto along = [&](const std::function<Vec3(const Vec3&)>& f) {
      return [=](const Vec3& p) { return turn_back(axes, f(axes * p)); };
    };
    std::vector<Field> fields;
    std::vector<std::string> wanted;
    for (int n = 1; n <= 5; ++n) {
      const std::string nodes = std::to_string(n) + (n == 1 ? " node" : " nodes"), more = std::to_string(n + 1) + " nodes";
      fields.push_back(along([n](const Vec3& p) { return Vec3{-p[2] * bend(n, p[0])[1], 0, bend(n, p[0])[0]}; }));
      wanted.push_back("bending, " + more);
      fields.push_back(along([n](const Vec3& p) { return Vec3{-p[1] * bend(n, p[0])[1], bend(n, p[0])[0], 0}; }));
      wanted.push_back("lateral bending, " + more);
      fields.push_back(along([n](const Vec3& p) {
        const double turn = 20 * std::cos(n * kPi * (p[0] + 0.5));
        return Vec3{0, -turn * p[2], turn * p[1]};
      }));
      wanted.push_back("torsion, " + nodes);
      fields.push_back(along([n](const Vec3& p) {  // Poisson's ratio 0.3
        const double x = n * kPi * (p[0] + 0.5), strain = -0.3 * n * kPi * -std::sin(x);
        return Vec3{std::cos(x), strain * p[1], strain * p[2]};
      }));
      wanted.push_back("longitudinal, " + nodes);
    }
    // Unknown: a mixture of two kinds, and a deforming section.
    fields.push_back(along([](const Vec3& p) { return Vec3{0, bend(1, p[0])[0], bend(2, p[0])[0]}; }));
    wanted.push_back("-");
    fields.push_back(along([](const Vec3& p) { return Vec3{0, 0, std::cos(30 * kPi * p[1])}; }));
    wanted.push_back("-");
    EXPECT_EQ(find(make_box({1.0, 0.1, 0.04}, {60, 8, 4}, axes), fields), wanted);
  }
  // A square section bends in any direction.
  const Field slanted = [](const Vec3& p) { return Vec3{0, 0.6 * bend(2, p[0])[0], 0.8 * bend(2, p[0])[0]}; };
  EXPECT_EQ(find(make_box({1.0, 0.05, 0.05}, {60, 4, 4}), {slanted}), std::vector<std::string>{"bending, 3 nodes"});
}

TEST(Kinds, of_round_bodies_are_their_nodal_diameters) {
  const auto ring = [](int n) {  // inextensional: u_r = cos n phi, u_phi = - sin n phi / n
    return [n](const Vec3& q) {
      const Vec3 p = q + Vec3{0.3, -0.2, 1.0};
      const double phi = std::atan2(p[1], p[0]) + 0.3, out = std::cos(n * phi), around = n == 0 ? 0.0 : -std::sin(n * phi) / n;
      const double c = p[0] / std::hypot(p[0], p[1]), s = p[1] / std::hypot(p[0], p[1]), grows = 1 + p[2];
      return grows * Vec3{c * out - s * around, s * out + c * around, 0};
    };
  };
  const Field turn = [](const Vec3& q) {
    const Vec3 p = q + Vec3{0.3, -0.2, 1.0};
    return Vec3{-p[1], p[0], 0};
  };
  const auto bell = [](double s) {  // down outside, up inside
    const double t = s < 0.5 ? 2 * s : 2 - 2 * s, wall = s < 0.5 ? 0.0 : 0.05;
    return std::array{std::max(0.02, std::sin(0.5 * kPi * t) - wall), std::cos(0.5 * kPi * t)};
  };
  const auto tube = [](double s) { return s < 0.5 ? std::array{0.5, 2 * s} : std::array{0.45, 2 - 2 * s}; };
  const std::vector<Field> fields{ring(2), ring(3), ring(4), ring(7), turn, ring(1)};
  const std::vector<std::string> wanted{"2 diameters", "3 diameters", "4 diameters", "7 diameters", "torsion", "1 diameter"};
  EXPECT_EQ(find(make_round(bell), fields), wanted);
  EXPECT_EQ(find(make_round(tube), fields), wanted);
  EXPECT_EQ(find(make_round(tube), {ring(0)}), std::vector<std::string>{"breathing"});
  // A disc: w = r^n cos(n phi).
  const auto disc = [](double s) { return s < 0.5 ? std::array{2 * s, 0.01} : std::array{2 - 2 * s, -0.01}; };
  const auto drum = [](int n) {
    return [n](const Vec3& q) {
      const Vec3 p = q + Vec3{0.3, -0.2, 1.0};
      return Vec3{0, 0, std::pow(std::hypot(p[0], p[1]), n) * std::cos(n * std::atan2(p[1], p[0]) + 1)};
    };
  };
  EXPECT_EQ(find(make_round(disc), {drum(2), drum(3), drum(5)}), (std::vector<std::string>{"2 diameters", "3 diameters", "5 diameters"}));
}

TEST(Kinds, of_a_sphere_are_breathing_or_unknown) {
  const auto sphere = [](double s) { return std::array{std::sin(kPi * s), -std::cos(kPi * s)}; };
  const auto centred = [](const std::function<Vec3(const Vec3&)>& f) { return [f](const Vec3& q) { return f(q + Vec3{0.3, -0.2, 1.0}); }; };
  const Field swell = centred([](const Vec3& p) { return p; });
  const Field oval = centred([](const Vec3& p) { return Vec3{-p[0], -p[1], 2 * p[2]}; });
  const Field shear = centred([](const Vec3& p) { return Vec3{p[1] * p[2], p[0] * p[2], 0}; });
  Bank bank = make_round(sphere);
  for (auto& t : bank.triangles) std::swap(t[1], t[2]);
  EXPECT_EQ(find(bank, {swell, oval, shear}), (std::vector<std::string>{"breathing", "-", "-"}));
}

TEST(Kinds, of_a_plate_are_its_nodal_lines) {
  const auto wave = [](int m, int n) {
    return [m, n](const Vec3& p) { return Vec3{0, 0, std::cos(m * kPi * (p[0] / 0.3 + 0.5)) * std::cos(n * kPi * (p[1] / 0.2 + 0.5))}; };
  };
  const Field stretch = [](const Vec3& p) { return Vec3{std::cos(kPi * (p[0] / 0.3 + 0.5)), 0, 0}; };
  const Field both = [&](const Vec3& p) { return wave(2, 0)(p) + wave(0, 2)(p); };
  EXPECT_EQ(find(make_box({0.3, 0.2, 0.01}, {48, 32, 1}), {wave(1, 1), wave(2, 0), wave(0, 2), wave(3, 1), stretch, both}),
            (std::vector<std::string>{"plate bending, 1 x 1 lines", "plate bending, 2 x 0 lines", "plate bending, 0 x 2 lines",
                                      "plate bending, 3 x 1 lines", "in plane", "plate bending"}));
}

TEST(Kinds, of_an_irregular_body_are_unknown) {
  Bank bank = make_box({1, 0.9, 0.7}, {10, 9, 7});
  for (Vec3& p : bank.vertices_m) p = p + 0.2 * Vec3{std::sin(3 * p[1]), std::sin(4 * p[2] + 1), std::sin(5 * p[0])};
  const Field wild = [](const Vec3& p) { return Vec3{std::sin(3 * p[1] + p[2]), std::cos(2 * p[0]), std::sin(4 * p[0] * p[1])}; };
  EXPECT_EQ(find(bank, {wild}), std::vector<std::string>{"-"});
  EXPECT_TRUE(find_kinds(Bank()).empty());
}

}  // namespace
}  // namespace carillon::bank
