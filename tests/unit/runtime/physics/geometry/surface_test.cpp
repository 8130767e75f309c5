// Mesh of a shape: refusals, recognised features, touched triangles.
#include <gtest/gtest.h>

#include <numbers>
#include <string>

#include "runtime/base/error.hpp"
#include "runtime/physics/geometry/facing.hpp"
#include "runtime/physics/geometry/mesh.hpp"
#include "runtime/physics/geometry/polyhedron.hpp"
#include "runtime/physics/geometry/skin.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/runtime/physics/geometry/solids.hpp"

namespace carillon::geometry::tests {
namespace {

std::string refuse(const Solid& solid) {
  return carillon::tests::catch_message<InputError>([&] { solid.make(); });
}

TEST(shape, refusal_of_invalid_surfaces) {
  Solid open = make_box({1, 1, 1});
  open.triangles.pop_back();
  EXPECT_NE(refuse(open).find("the surface is open at edge"), std::string::npos);
  Solid thrice = make_box({1, 1, 1});
  thrice.triangles.push_back(thrice.triangles[0]);
  EXPECT_NE(refuse(thrice).find("not a manifold at edge"), std::string::npos);
  Solid inside_out = make_box({1, 1, 1});
  inside_out.turn_inside_out();
  EXPECT_NE(refuse(inside_out).find("inside out"), std::string::npos);
  Solid wild = make_box({1, 1, 1});
  wild.triangles[3][1] = 99;
  EXPECT_NE(refuse(wild).find("surface triangle 3 names vertex 99"), std::string::npos);
  Solid flat = make_box({1, 1, 1});
  flat.vertices[0] = flat.vertices[1];
  EXPECT_NE(refuse(flat).find("has no area"), std::string::npos);
  EXPECT_NE(refuse({}).find("no surface triangles"), std::string::npos);
}

TEST(shape, six_facets_of_box_for_any_mesh) {
  for (const int n : {1, 3, 20}) {
    const auto box = make_box({0.06, 0.05, 0.04}, n).make();
    ASSERT_TRUE(box->is_polyhedron()) << n;
    EXPECT_EQ(box->polyhedron()->corners.size(), 8U);
    EXPECT_EQ(box->polyhedron()->normals.size(), 6U);
    EXPECT_EQ(box->polyhedron()->edges.size(), 12U);
  }
}

TEST(shape, round_and_hollow_bodies_not_polyhedra) {
  EXPECT_FALSE(make_ball(1, 2).make()->is_polyhedron());
  EXPECT_FALSE(make_cylinder(1, 2, 24).make()->is_polyhedron());
  Solid hollow = make_box({1, 1, 1}, 2), inner = make_box({0.9, 0.9, 0.9}, 2);
  inner.turn_inside_out();
  hollow.add(inner, {});
  EXPECT_FALSE(hollow.make()->is_polyhedron());
}

TEST(shape, cylinder_rim_and_mantle) {
  const auto cylinder = make_cylinder(1.0, 2.0, 32).make();
  const Skin& skin = cylinder->skin();
  for (int v = 0; v < cylinder->mesh().count_vertices(); ++v) {
    const Vec3& x = cylinder->mesh().vertices[v];
    const bool is_on_rim = std::hypot(x[0], x[1]) > 0.5;
    EXPECT_EQ(skin.kind(v), is_on_rim ? VertexKind::ridge : VertexKind::none);
    EXPECT_NEAR(skin.calc_rim_radius_m(v), is_on_rim ? 1.0 : 0.0, 2e-3);
  }
  for (int f = 0; f < cylinder->mesh().count_faces(); ++f) {
    const bool cap = std::abs(cylinder->mesh().normals[f][2]) > 0.5;
    EXPECT_EQ(skin.is_flat(f), cap);
    if (cap) continue;
    const Vec3 x = skin.calc_point(f, {0.2, 0.3, 0.5});
    EXPECT_NEAR(std::hypot(x[0], x[1]), 1.0, 2e-4);  // facets: 0.0048
    EXPECT_NEAR(skin.calc_mean_curvature(f, {0.2, 0.3, 0.5}), 0.5, 0.02);
  }
}

TEST(shape, common_circle_of_rim_sides) {
  const double r = 0.07, half = std::numbers::pi / 48, chord = r * std::cos(half);
  const auto bowl = make_lathe({{0, 0}, {0.06, 0.01}, {0.075, 0.045}, {r, 0.05}, {0.05, 0.02}, {0, 0.01}}, 48, false).make();
  const Mesh& mesh = bowl->mesh();
  int rims = 0;
  for (int e = 0; e < 3 * mesh.count_faces(); ++e) {
    const Vec3 middle = 0.5 * (mesh.vertices[mesh.vertex_of(e)] + mesh.vertices[mesh.vertex_of(Mesh::next(e))]);
    if (!bowl->skin().is_sharp(e) || std::abs(std::hypot(middle[0], middle[1]) - chord) > 1e-9) continue;
    ++rims;
    Vec3 weights{};
    weights[e % 3] = weights[(e + 1) % 3] = 0.5;
    const Vec3 x = bowl->skin().calc_point(e / 3, weights);
    EXPECT_NEAR(std::hypot(x[0], x[1]), r, 1e-5 * r);  // the chord: 2.1e-3 r
    EXPECT_NEAR(x[2], 0.05, 1e-12);
    const Vec3 within = (1.0 + 5e-5 / chord) * middle - Vec3{0, 0, 1.1e-4};  // inside the mesh, in the opening of the skin
    const Nearest at = mesh.find_nearest(within, Box::kFar, -1);
    EXPECT_TRUE(mesh.is_inside(within, at));
    EXPECT_GT(calc_skin_gap(*bowl, within, at, true), 2e-5);
  }
  EXPECT_EQ(rims, 96);
}

TEST(shape, triangle_by_normal) {
  const Solid solid = make_box({2, 2, 2}, 4);
  const auto box = solid.make();
  for (int k = 0; k < 3; ++k) {
    Vec3 outward{};
    outward[k] = 1.0;
    const Place place = box->find_place({1, 1, 1}, outward);
    const auto& t = solid.triangles[place.triangle];
    Vec3 x{};
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(solid.vertices[t[i]][k], 1.0, 1e-12);
      x = x + place.barycentric[i] * solid.vertices[t[i]];
    }
    EXPECT_NEAR(norm(x - Vec3{1, 1, 1}), 0.0, 1e-12);
  }
  // Whatever triangle is looked at first.
  const auto round = make_ball(0.03, 4);
  for (const Solid* body : {&solid, &round}) {
    const auto made = body->make();
    for (int n = 0; n < 300; ++n) {
      const auto& t = body->triangles[(7 * n) % body->triangles.size()];
      const double u = 0.5 * (n % 3), v = 0.5 * (n / 3 % 2) * (1.0 - u);  // corners, edges and the inside
      const Vec3 at = u * body->vertices[t[0]] + v * body->vertices[t[1]] + (1.0 - u - v) * body->vertices[t[2]];
      const Vec3 outward = (1.0 / norm(at)) * at + Vec3{0.1 * (n % 5), 0.07 * (n % 3), -0.05 * (n % 7)};
      const Place whole = made->find_place(at, outward);
      for (int hint = 0; hint < static_cast<int>(body->triangles.size()); hint += 1 + n % 7) {
        const Place place = made->find_place(at, outward, hint);
        EXPECT_NEAR(dot(made->mesh().normals[place.triangle], outward), dot(made->mesh().normals[whole.triangle], outward), 1e-12);
        Vec3 x{};
        for (int i = 0; i < 3; ++i) x = x + place.barycentric[i] * body->vertices[body->triangles[place.triangle][i]];
        EXPECT_NEAR(norm(x - at), 0.0, 1e-9);
      }
    }
  }
  const auto ball = make_ball(0.03, 16).make();
  EXPECT_NEAR(ball->find_place({0, 0, 0.03}, {0, 0, 1}).curvature_per_m, 1.0 / 0.03, 0.5);
}

}  // namespace
}  // namespace carillon::geometry::tests
