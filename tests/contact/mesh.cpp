// Mesh against Simbody's mesh, which shares no code with it. C++17, as all that includes Simbody.
#include "runtime/contact/mesh.hpp"

#include <Simbody.h>
#include <gtest/gtest.h>

#include <random>
#include <set>

namespace carillon::contact {
namespace {

using SimTK::Transform;
using SimTK::Vec3;

/// A closed lump with bays: a sphere whose radius swings.
struct Lump {
  std::vector<Vec3> vertices;
  std::vector<Face> faces;
  explicit Lump(double swing) {
    const SimTK::PolygonalMesh sphere = SimTK::PolygonalMesh::createSphereMesh(1.0, 3);
    for (int v = 0; v < sphere.getNumVertices(); ++v) {
      const Vec3& x = sphere.getVertexPosition(v);
      vertices.push_back(x * (1.0 + swing * std::sin(7.0 * x[0] + 1.0) * std::cos(5.0 * x[1])));
    }
    for (int f = 0; f < sphere.getNumFaces(); ++f) {
      for (int k = 2; k < sphere.getNumVerticesForFace(f); ++k)
        faces.push_back({sphere.getFaceVertex(f, 0), sphere.getFaceVertex(f, k - 1), sphere.getFaceVertex(f, k)});
    }
  }
  SimTK::ContactGeometry::TriangleMesh make_theirs() const {
    SimTK::Array_<int> indices;
    for (const Face& f : faces)
      for (const int v : f) indices.push_back(v);
    SimTK::Array_<Vec3> places;
    for (const Vec3& x : vertices) places.push_back(x);
    return {places, indices, false};
  }
};

class Random {
 public:
  Vec3 make_point(double size) { return {size * spread_(engine_), size * spread_(engine_), size * spread_(engine_)}; }
  Transform make_transform() {
    const Vec3 axis = make_point(1.0);
    return {SimTK::Rotation(3.0 * spread_(engine_), SimTK::UnitVec3(axis)), make_point(2.0)};
  }

 private:
  std::mt19937 engine_{17};
  std::uniform_real_distribution<double> spread_{-1.0, 1.0};
};

TEST(Mesh, NearestPlacesAndCrossingsAreSimbodys) {
  const Lump lump(0.3);
  const Mesh ours(lump.vertices, lump.faces);
  const auto theirs = lump.make_theirs();
  ASSERT_EQ(static_cast<int>(ours.edges().size()), theirs.getNumEdges());
  Random random;
  int inside_count = 0, crossings = 0;
  for (int i = 0; i < 3000; ++i) {
    const Vec3 x = random.make_point(1.6);
    bool inside = false, is_inside = false;
    int face = 0;
    SimTK::Vec2 uv;
    const Vec3 place = ours.find_nearest(x, inside, face, uv);
    SimTK::UnitVec3 normal;
    const Vec3 expected = theirs.findNearestPoint(x, is_inside, normal);
    EXPECT_NEAR((place - x).norm(), (expected - x).norm(), 1e-12);
    EXPECT_EQ(inside, is_inside) << x;
    inside_count += inside ? 1 : 0;
    const Face& f = ours.face(face);
    EXPECT_LT((uv[0] * ours.vertex(f[0]) + uv[1] * ours.vertex(f[1]) + (1.0 - uv[0] - uv[1]) * ours.vertex(f[2]) - place).norm(), 1e-12);
    const SimTK::UnitVec3 way(random.make_point(1.0));
    double distance = 0.0, wanted = 0.0;
    Vec3 outward(0);
    const bool crosses = ours.find_crossing(x, Vec3(way), distance, outward);
    ASSERT_EQ(crosses, theirs.intersectsRay(x, way, wanted, normal)) << x << way;
    if (!crosses) continue;
    ++crossings;
    EXPECT_NEAR(distance, wanted, 1e-9);
    EXPECT_EQ(SimTK::dot(outward, Vec3(way)) > 0.0, inside);
  }
  EXPECT_GT(inside_count, 300);
  EXPECT_GT(crossings, 500);
}

TEST(Mesh, VerticesBelowAPlaneAreAllFound) {
  const Lump lump(0.3);
  const Mesh mesh(lump.vertices, lump.faces);
  Random random;
  for (int i = 0; i < 200; ++i) {
    const Vec3 up = Vec3(SimTK::UnitVec3(random.make_point(1.0)));
    const double height = random.make_point(1.4)[0];
    std::set<int> found, expected;
    mesh.for_vertices_below(up, height, [&](int v) { found.insert(v); });
    for (int v = 0; v < mesh.vertex_count(); ++v)
      if (SimTK::dot(up, mesh.vertex(v)) < height) expected.insert(v);
    EXPECT_EQ(found, expected);
  }
}

TEST(Mesh, BoxesThatAreNearAreNeverMissedAndOthersMostly) {
  Random random;
  int apart = 0, missed = 0;
  for (int i = 0; i < 2000; ++i) {
    Box a, b;
    for (int k = 0; k < 2; ++k) {
      a.add(random.make_point(1.0));
      b.add(random.make_point(1.0));
    }
    const Transform X = random.make_transform();
    const double margin = 0.1;
    double least = SimTK::Infinity;
    for (int k = 0; k < 729; ++k) {
      const Vec3 share(k % 9 / 8.0, k / 9 % 9 / 8.0, k / 81 / 8.0);
      const Vec3 x = X * (a.low + share.elementwiseMultiply(a.high - a.low));
      least = std::min(least, std::sqrt(b.calc_distance2(x)));
    }
    const bool near = are_boxes_near(a, b, X, margin);
    EXPECT_TRUE(near || least > margin) << least;
    if (least > 0.5) {
      ++apart;
      missed += near ? 1 : 0;
    }
  }
  EXPECT_GT(apart, 200);
  EXPECT_LT(missed, apart / 20);
}

TEST(Mesh, EdgesThatAreOpenOrDisagreeAreMarked) {
  const std::vector<Face> tetrahedron{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  const auto whole = find_opposite_edges(tetrahedron, 4);
  for (int e = 0; e < 12; ++e) EXPECT_EQ(whole[whole[e]], e);
  const auto open = find_opposite_edges({tetrahedron.begin(), tetrahedron.end() - 1}, 4);
  EXPECT_EQ(std::count(open.begin(), open.end(), -1), 3);
  std::vector<Face> turned = tetrahedron, doubled = tetrahedron, folded = tetrahedron;
  std::swap(turned[2][0], turned[2][1]);
  doubled.push_back(tetrahedron[1]);
  folded[0][1] = folded[0][0];
  for (const auto& faces : {turned, doubled, folded}) {
    const auto marks = find_opposite_edges(faces, 4);
    EXPECT_GT(std::count(marks.begin(), marks.end(), -2), 0);
  }
}

}  // namespace
}  // namespace carillon::contact
