// Smooth surface through facet corners, against closed-form bodies in various triangulations; planar bodies stay unchanged.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "precompute/mesher/round_surface.hpp"
#include "precompute/mesher/surface.hpp"
#include "tests/unit/precompute/mesher/surfaces.hpp"

namespace carillon::mesher {
namespace {

using namespace testing;
using std::numbers::pi;
using Profile = std::vector<std::array<double, 2>>;
using Outline = std::vector<std::array<double, 2>>;

constexpr double kSharpDeg = 40;

/// By the divergence theorem on a fine cut: shares nothing with RoundSurface::calc_volume.
double calc_cut_volume(RoundSurface& round) {
  const double coarse = calc_volume(round.cut(6)), fine = calc_volume(round.cut(12));
  return fine + (fine - coarse) / 3;
}

struct Kind {
  const char* name;
  std::function<Profile(int)> make;  // of so many rings
  double volume;
  double max;  // largest volume error of the smooth surface, over the facets' deficit
  bool is_closed = false;
  int min_rings = 1;
};

const std::vector<Kind>& list_kinds() {
  static const std::vector<Kind> kinds{
      {"cylinder", [](int m) { return make_profile(m, [](double t) {
                                 return std::array{1.0, 5 * t};
                               }); }, 5 * pi, 1e-3},
      {"cone", [](int m) { return make_profile(m, [](double t) {
                             return std::array{1 - t, 3 * t};
                           }); }, pi, 0.08},
      {"flat cone", [](int m) { return make_profile(m, [](double t) {
                                  return std::array{1 - t, 0.3 * t};
                                }); }, 0.1 * pi, 0.08},
      {"frustum", [](int m) { return make_profile(m, [](double t) {
                                return std::array{1 - 0.6 * t, 3 * t};
                              }); }, pi * (1 + 0.4 + 0.16),
       0.04},
      {"tube",
       [](int m) {
         Profile p = make_profile(m, [](double t) { return std::array{1.0, 3 * t}; });
         const Profile in = make_profile(m, [](double t) { return std::array{0.9, 3 - 3 * t}; });
         p.insert(p.end(), in.begin(), in.end());
         return p;
       },
       3 * pi * 0.19, 1e-3, true},
      {"sphere",
       [](int m) {
         return make_profile(m, [](double t) { return std::array{t == 0 || t == 1 ? 0.0 : std::sin(pi * t), -std::cos(pi * t)}; });
       },
       4 * pi / 3, 0.007, false, 8},
      {"torus",
       [](int m) {
         Profile p = make_profile(m, [](double t) { return std::array{3 + std::cos(2 * pi * t), std::sin(2 * pi * t)}; });
         p.pop_back();
         return p;
       },
       6 * pi * pi, 0.03, true, 16}};
  return kinds;
}

TEST(Round, smooth_volume) {
  for (const Kind& kind : list_kinds())
    for (const int sides : {16, 24, 32, 64, 128})
      for (const int rings : {1, 4, 8, 16, 32})
        for (const Cut cut : {Cut::kQuads, Cut::kDiagonal, Cut::kOtherDiagonal, Cut::kAlternating, Cut::kTurned}) {
          if (rings < kind.min_rings || (sides > 32 && (rings > 8 || cut == Cut::kAlternating))) continue;
          if (cut == Cut::kTurned && (kind.is_closed || sides > 32)) continue;
          const TriangleSurface facets = to_triangles(make_lathe(kind.make(rings), sides, cut, kind.is_closed));
          const RoundSurface round(facets, kSharpDeg);
          const double bound = kind.max * std::abs(calc_volume(facets) / kind.volume - 1);
          EXPECT_NEAR(round.calc_volume() / kind.volume, 1, bound)
              << kind.name << ", " << sides << " sides, " << rings << " rings, cut " << static_cast<int>(cut) << ", facets "
              << calc_volume(facets) / kind.volume - 1;
          if (cut == Cut::kTurned) continue;  // slender triangles that turn by more than 25 degrees may be doubted
          EXPECT_FALSE(round.is_doubtful()) << kind.name << ", " << sides << " sides, " << rings << " rings, cut " << static_cast<int>(cut);
        }
}

TEST(Round, cut_surface) {
  RoundSurface round(to_triangles(make_lathe(list_kinds()[0].make(3), 24, Cut::kQuads)), kSharpDeg);
  EXPECT_NEAR(calc_cut_volume(round) / round.calc_volume(), 1, 1e-6);
  const TriangleSurface cut = round.cut(3);
  for (std::int32_t t = 0; t < static_cast<std::int32_t>(cut.triangles.size()); ++t) {
    const auto& [a, b, c] = cut.triangles[t];
    const Vec3 p = 0.2 * cut.points[a] + (0.5 * cut.points[b] + 0.3 * cut.points[c]), q = round.find(t, p);
    if (std::abs(p[2]) < 1e-12 || std::abs(p[2] - 5) < 1e-12)
      EXPECT_NEAR(q[2], p[2], 1e-12);
    else
      EXPECT_NEAR(std::hypot(q[0], q[1]), 1, 2e-5);
    EXPECT_LT(norm(q - p), 2e-3);
  }
}

/// A bottle: body, shoulder of an arc, neck; tangents continue except where the neck begins.
Profile make_bottle(int arc, int rings) {
  Profile p;
  for (int i = 0; i < rings; ++i) p.push_back({0.03, 0.1 * i / rings});
  for (int i = 0; i <= arc; ++i) p.push_back({0.01 + 0.02 * std::cos(pi / 3 * i / arc), 0.1 + 0.02 * std::sin(pi / 3 * i / arc)});
  p.push_back({0.02, 0.15});
  return p;
}

double calc_turned_volume(const Profile& p) {
  double sum = 0;
  for (std::size_t i = 1; i < p.size(); ++i)
    sum += pi / 3 * (p[i][1] - p[i - 1][1]) * (p[i][0] * p[i][0] + p[i][0] * p[i - 1][0] + p[i - 1][0] * p[i - 1][0]);
  return sum;
}

TEST(Round, long_panels_at_an_arc) {
  const double exact = calc_turned_volume(make_bottle(4000, 1));
  for (const int rings : {1, 5})
    for (const int sides : {16, 24, 64}) {
      const RoundSurface round(to_triangles(make_lathe(make_bottle(6, rings), sides, Cut::kQuads)), kSharpDeg);
      EXPECT_NEAR(round.calc_volume() / exact, 1, 3e-4) << sides << " " << rings;
    }
}

TEST(Round, ring_at_a_rim) {
  for (const int rings : {4, 8}) {
    const Profile p = make_profile(rings, [](double t) { return std::array{t == 0 ? 0.0 : std::sin(pi / 2 * t), -std::cos(pi / 2 * t)}; });
    const RoundSurface round(to_triangles(make_lathe(p, 32, Cut::kDiagonal)), kSharpDeg);
    EXPECT_NEAR(round.calc_volume() / (2 * pi / 3), 1, 6e-4);
  }
}

Outline make_polygon(int n) {
  Outline out;
  for (int i = 0; i < n; ++i) out.push_back({std::cos(2 * pi * i / n), std::sin(2 * pi * i / n)});
  return out;
}

/// A rectangle whose corners are cut by so many facets.
Outline make_cut_corners(double a, double b, double cut, int facets) {
  Outline out;
  for (int corner = 0; corner < 4; ++corner)
    for (int k = 0; k <= facets; ++k) {
      const double angle = pi / 2 * (corner + 1.0 * k / facets);
      out.push_back({(corner == 0 || corner == 3 ? 1 : -1) * (a - cut) + cut * std::cos(angle),
                     (corner < 2 ? 1 : -1) * (b - cut) + cut * std::sin(angle)});
    }
  return out;
}

Outline make_star(int n, double inner) {
  Outline out;
  for (int i = 0; i < 2 * n; ++i) out.push_back({(i % 2 ? inner : 1) * std::cos(pi * i / n), (i % 2 ? inner : 1) * std::sin(pi * i / n)});
  return out;
}

/// A block whose upper edges are bevelled.
Polygons make_bevelled(double width, double height) {
  Polygons s;
  for (const auto& [half, z] : {std::pair{0.5, 0.0}, {0.5, 0.1}, {0.5 - width, 0.1 + height}})
    for (const auto& [x, y] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) s.points.push_back({x * half, y * half, z});
  for (int k = 0; k < 2; ++k)
    for (int j = 0; j < 4; ++j) s.faces.push_back({4 * k + j, 4 * k + (j + 1) % 4, 4 * k + 4 + (j + 1) % 4, 4 * k + 4 + j});
  s.faces.push_back({3, 2, 1, 0});
  s.faces.push_back({8, 9, 10, 11});
  return s;
}

void expect_flat(const Polygons& body, const std::string& name, bool may_be_doubtful = false) {
  const TriangleSurface facets = to_triangles(body);
  const RoundSurface round(facets, kSharpDeg);
  EXPECT_LT(round.get_largest_bulge(), 1e-12) << name;
  EXPECT_NEAR(round.calc_volume() / calc_volume(facets), 1, 1e-12) << name;
  if (!may_be_doubtful) {
    EXPECT_FALSE(round.is_doubtful()) << name;
  }
}

TEST(Round, planar_bodies) {
  expect_flat(make_box(3, 2, 1), "box");
  expect_flat(make_letter_n(), "letter");
  for (const int n : {3, 4, 5, 6, 7}) expect_flat(make_prism(make_polygon(n), 3), "prism of " + std::to_string(n));
  expect_flat(make_prism(make_cut_corners(3, 2, 0.4, 1), 10), "bar with bevels");
  for (const int n : {4, 5, 8, 12, 16, 24})
    for (const double inner : {0.5, 0.7, 0.9}) expect_flat(make_prism(make_star(n, inner), 1), "star of " + std::to_string(n));
  for (const int n : {4, 6})
    for (const double height : {0.2, 0.5, 2.0})
      expect_flat(make_lathe({{1, 0}, {0, height}}, n, Cut::kQuads), "pyramid of " + std::to_string(n));
  for (const double height : {0.02, 0.05, 0.1}) expect_flat(make_bevelled(0.05, height), "bevelled block " + std::to_string(height));
  for (const double height : {0.02, 0.05, 0.2}) expect_flat(make_bevelled(0.45, height), "pointed block " + std::to_string(height));
  for (const double height : {0.1, 0.2, 0.3})
    expect_flat(make_prism({{-1, -1}, {1, -1}, {1, 0}, {0, height}, {-1, 0}}, 3), "roof " + std::to_string(height));
}

TEST(Round, ambiguous_facets) {
  // Eight sides stay planes, twelve become round; the offset leads from one reading to the other.
  for (const int sides : {8, 9, 10, 12, 14}) {
    RoundSurface round(to_triangles(make_prism(make_polygon(sides), 3)), kSharpDeg);
    ASSERT_TRUE(round.is_doubtful()) << sides;
    const TriangleSurface cut = round.cut(1);
    double largest = 0;
    for (std::int32_t t = 0; t < static_cast<std::int32_t>(cut.triangles.size()); ++t) {
      const auto& [a, b, c] = cut.triangles[t];
      const Vec3 p = 0.5 * (cut.points[a] + cut.points[b]);
      if (std::abs(p[2]) < 1.5 - 1e-9) largest = std::max(largest, norm(round.find_doubt(t, p)));
    }
    EXPECT_NEAR(largest, 1 - std::cos(pi / sides), 0.1 * (1 - std::cos(pi / sides))) << sides;
  }
  // Fillets in two and three facets stay planes, in four they are round.
  for (const int facets : {2, 3}) {
    const Polygons bar = make_prism(make_cut_corners(3, 2, 0.4, facets), 10);
    expect_flat(bar, "fillet of " + std::to_string(facets), true);
    EXPECT_TRUE(RoundSurface(to_triangles(bar), kSharpDeg).is_doubtful()) << facets;
  }
  const RoundSurface fillet(to_triangles(make_prism(make_cut_corners(3, 2, 0.4, 4), 10)), kSharpDeg);
  EXPECT_FALSE(fillet.is_doubtful());
  EXPECT_NEAR(fillet.calc_volume() / (10 * (24 - (4 - pi) * 0.16)), 1, 1e-5);
}

TEST(Round, self_intersecting_smooth_surface) {
  // A rod of 16 sides whose facet looks at a block, nearer than the arc over the facet is high: the round rod would be inside the block.
  const int sides = 16;
  const double radius = 0.02, length = 0.06, low = radius * std::cos(pi / sides), gap = 0.4 * (radius - low);
  Outline outline;
  for (const auto& [x, y] : make_polygon(sides)) {
    const double angle = std::atan2(y, x) + pi / sides;
    outline.push_back({radius * std::cos(angle), radius * std::sin(angle)});
  }
  Polygons body = make_prism(outline, length);
  const double rod = calc_volume(to_triangles(body));
  const int first = static_cast<int>(body.points.size());
  const Polygons block = make_box(0.02, 0.05, length);
  for (const auto& [x, y, z] : block.points) body.points.push_back({x + low + gap, y - 0.025, z - length / 2});
  for (auto face : block.faces) {
    for (int& v : face) v += first;
    body.faces.push_back(face);
  }
  SurfaceReport report;
  const mesh::TetMesh m =
      mesh_surface({.surface = write_text("web.obj", to_obj(body)), .nodes = 2000, .order = 1, .method = Method::kStuffing}, report);
  EXPECT_NEAR(report.expected_volume_m3 / (rod + 0.02 * 0.05 * length), 1, 2e-3);  // of the facets: the round rod has 1.4 % more
  EXPECT_NEAR(report.doubt_m / (radius - low), 1, 0.1);
  ASSERT_EQ(m.doubt_m.size(), m.nodes_m.size());
  int on_side = 0;
  for (std::size_t i = 0; i < m.nodes_m.size(); ++i) {
    const auto& [x, y, z] = m.nodes_m[i];
    const double reach = std::hypot(x, y);
    if (x > low + gap + 1e-3) {
      EXPECT_LT(norm(m.doubt_m[i]), 1e-12) << i;  // the block has none
    }
    // From the rod's facets it leads to the circle.
    const double facet = 2 * pi / sides * std::round(std::atan2(y, x) * sides / (2 * pi));
    if (x > low - 1e-4 || std::abs(z) > 0.4 * length || std::abs(x * std::cos(facet) + y * std::sin(facet) - low) > 2e-6) continue;
    EXPECT_NEAR(reach + dot(m.doubt_m[i], Vec3{x / reach, y / reach, 0}), radius, 0.02 * (radius - low)) << i;
    ++on_side;
  }
  EXPECT_GT(on_side, 50);
}

TEST(Round, nodes_on_smooth_skins) {
  const double radius = 0.01, length = 0.03, wall = 0.003;
  const auto file = write_text("lathe.obj", to_obj(make_lathe({{radius, 0}, {radius, 0.01}, {radius, length}}, 24, Cut::kQuads)));
  for (const SurfaceOptions& options :
       {SurfaceOptions{.surface = file, .nodes = 1500, .order = 1}, SurfaceOptions{.surface = file, .nodes = 5000, .order = 2},
        SurfaceOptions{.surface = file, .wall_m = wall, .nodes = 6000, .order = 2}}) {
    SurfaceReport report;
    const mesh::TetMesh m = mesh_surface(options, report);
    const double inner = options.wall_m ? radius - wall : 0;
    const double exact = pi * (radius * radius * length - inner * inner * (options.wall_m ? length - 2 * wall : 0));
    double worst = 0;
    for (const auto& p : m.nodes_m) worst = std::max(worst, std::hypot(p[0], p[1]) - radius);
    EXPECT_LT(worst, 2e-5 * radius);
    if (options.order == 2) {
      EXPECT_NEAR(report.volume_m3 / exact, 1, options.wall_m ? 3e-3 : 1e-4);
    }
    if (!options.wall_m) {
      EXPECT_NEAR(report.expected_volume_m3 / exact, 1, 1e-5);
      int on_side = 0;
      for (const auto& p : m.nodes_m) on_side += std::abs(std::hypot(p[0], p[1]) - radius) < 2e-5 * radius;
      EXPECT_GT(on_side, 100);
      for (const auto& p : m.nodes_m)  // nothing is left on the facets, up to 0.9 % of the radius inside
        EXPECT_FALSE(std::hypot(p[0], p[1]) > 0.991 * radius && std::hypot(p[0], p[1]) < 0.9995 * radius && p[2] > 0 && p[2] < length &&
                     options.order == 1);
    }
    EXPECT_TRUE(m.doubt_m.empty());
  }
}

}  // namespace
}  // namespace carillon::mesher
