// Method: the two trees of oriented boxes that Simbody keeps for its meshes are walked together down to the triangles near the cut; of
// these,
//   a vertex inside the other body carries when none of its neighbours is deeper along the other's normal, and two ridges carry when their
//   arcs on the Gauss map cross (the only two ways in which polyhedra touch first).
// Source: S. Gottschalk, M. Lin, D. Manocha, "OBBTree" (1996); C. Ericson, "Real-Time Collision Detection" (2005), 5.1.9; the Gauss-map
// test for
//   edges: D. Gregorius, "The separating axis test between convex polyhedra" (GDC 2013).
// Deviations: the tests are local, so they hold for hollow shapes as well; buried faces are not looked for, since a step never goes so
// deep.
#include "runtime/contact/touch.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace carillon::contact {
namespace {

using SimTK::cross;
using SimTK::dot;
using SimTK::Transform;
using SimTK::UnitVec3;
using SimTK::Vec3;
using Node = SimTK::ContactGeometry::TriangleMesh::OBBTreeNode;

constexpr double kFlat =
    0.02;  // rad; how far below the plane a neighbour may point: a flat face that lands nearly flat lands with all of itself

constexpr double kSunk = 2e-3;        // of the size
constexpr double kMargin = 0.01;      // of the thinner body's thickness
constexpr double kEnd = 1e-6;         // of an edge: two that cross where the next one begins must not be missed
constexpr double kFlush = 1e-3;       // rad; the edges of two faces that lie on each other cross as well
constexpr std::size_t kProbes = 200;  // faces of each body that calc_overlap looks behind
constexpr double kBrim = 1e-4;        // of the size: a corner may stand out so far beyond the brim of a face that it still stands on

/// Does vertex v carry against a plane with this outward normal (frame of the surface)? Only corners do: what lies between them on a flat
/// face or a straight edge is never lower than the lowest of them, so that a finer mesh of the same shape touches in the same points.
bool carries(const Surface& surface, int v, const Vec3& normal) {
  if (!surface.is_corner(v)) return false;
  for (const int w : surface.neighbours(v)) {
    const Vec3 d = surface.vertex(w) - surface.vertex(v);
    if (dot(d, normal) < -kFlat * d.norm()) return false;
  }
  return true;
}

/// Do the boxes of two nodes come within the margin of each other?
bool are_boxes_near(const Node& a, const Node& b, const Transform& X_ba, double margin_m) {
  const Transform X_box = X_ba * a.getBounds().getTransform();  // of a corner of the box
  const SimTK::OrientedBoundingBox box(Transform(X_box.R(), X_box * Vec3(-margin_m)), a.getBounds().getSize() + Vec3(2 * margin_m));
  return box.intersectsBox(b.getBounds());
}

/// The faces of both meshes whose leaves cut each other or are within the margin.
void find_near_faces(const Node& a, const Node& b, const Transform& X_ba, double margin_m, std::set<int>& faces_a, std::set<int>& faces_b) {
  if (!are_boxes_near(a, b, X_ba, margin_m)) return;
  if (a.isLeafNode() && b.isLeafNode()) {
    for (const int f : a.getTriangles()) faces_a.insert(f);
    for (const int f : b.getTriangles()) faces_b.insert(f);
    return;
  }
  if (b.isLeafNode() || (!a.isLeafNode() && a.getNumTriangles() >= b.getNumTriangles())) {
    find_near_faces(a.getFirstChildNode(), b, X_ba, margin_m, faces_a, faces_b);
    find_near_faces(a.getSecondChildNode(), b, X_ba, margin_m, faces_a, faces_b);
  } else {
    find_near_faces(a, b.getFirstChildNode(), X_ba, margin_m, faces_a, faces_b);
    find_near_faces(a, b.getSecondChildNode(), X_ba, margin_m, faces_a, faces_b);
  }
}

std::set<int> find_vertices(const Surface& surface, const std::set<int>& faces) {
  std::set<int> vertices;
  for (const int f : faces) {
    for (int k = 0; k < 3; ++k) vertices.insert(surface.mesh().getFaceVertex(f, k));
  }
  return vertices;
}

/// A face of `theirs` that vertex v of `mine` (at x, frame of theirs) has gone through, if there is one on which it carries. The nearest
/// face is not always the one: on a box that stands flush on another, the corners are nearer to the side than to the top.
bool find_carrying_face(const Surface& mine, int v, const Surface& theirs, const Vec3& x, const SimTK::Rotation& R_theirs_mine,
                        const std::set<int>& their_faces, TouchPoint& touch) {
  bool inside = false;
  int face = 0;
  SimTK::Vec2 uv;
  const auto& mesh = theirs.mesh();
  const Vec3 nearest = mesh.findNearestPoint(x, inside, face, uv);
  const double brim = kBrim * mine.size_m();
  if (!inside && (x - nearest).norm() > brim) return false;
  // A vertex that has sunk in counts whatever its neighbours do: something touched that none of the two tests knows.
  const bool sunk = (x - nearest).norm() > kSunk * mine.size_m();
  if (inside && (sunk || carries(mine, v, ~R_theirs_mine * Vec3(mesh.getFaceNormal(face))))) {
    touch.plane_point = nearest;
    touch.plane_normal = Vec3(mesh.getFaceNormal(face));
    return true;
  }
  double least = 0.05 * mine.size_m();
  bool found = false;
  for (const int f : their_faces) {
    const Vec3 n(mesh.getFaceNormal(f));
    const double depth = dot(n, mesh.getVertexPosition(mesh.getFaceVertex(f, 0)) - x);
    if (depth <= 0.0 || depth >= least) continue;
    const Vec3 on_plane = x + depth * n;
    if ((mesh.findNearestPointToFace(on_plane, f, uv) - on_plane).norm() > brim || !carries(mine, v, ~R_theirs_mine * n)) continue;
    least = depth;
    touch.plane_point = on_plane;
    touch.plane_normal = n;
    found = true;
  }
  return found;
}

/// A cheap look at the faces near the cut alone: may x (frame of `theirs`) be inside? Simbody's search over the whole mesh takes
/// milliseconds for a point that many faces are about equally far from, so only the few points that pass come to it.
bool may_be_inside(const Surface& theirs, const std::set<int>& their_faces, const Vec3& x, double brim) {
  const auto& mesh = theirs.mesh();
  double least = SimTK::Infinity;
  bool inside = false;
  double least_root = SimTK::Infinity;
  for (const int f : their_faces) {
    const double reach = least_root + theirs.face_radius_m(f);
    if ((x - theirs.face_middle_m(f)).normSqr() > reach * reach * (1.0 + 1e-9)) continue;
    SimTK::Vec2 uv;
    const Vec3 d = x - mesh.findNearestPointToFace(x, f, uv);
    const double dist2 = d.normSqr();
    if (dist2 > least) continue;
    // Where two faces are equally near, inside either will do.
    inside = (dist2 == least && inside) || dot(d, Vec3(mesh.getFaceNormal(f))) < 0.0;
    least = dist2;
    least_root = std::sqrt(dist2);
  }
  const double reach = 0.1 * theirs.size_m();
  return (inside && least < reach * reach) || least < brim * brim;
}

/// Vertices of `mine` inside `theirs`.
void add_vertex_touches(TouchPoint base, int kind, const Surface& mine, const Surface& theirs, const Transform& X_theirs_mine,
                        const std::set<int>& faces, const std::set<int>& their_faces, std::vector<TouchPoint>& out) {
  for (const int v : find_vertices(mine, faces)) {
    if (!mine.is_corner(v)) continue;
    TouchPoint t = base;
    const Vec3 x = X_theirs_mine * mine.vertex(v);
    if (!may_be_inside(theirs, their_faces, x, kBrim * mine.size_m())) continue;
    if (!find_carrying_face(mine, v, theirs, x, X_theirs_mine.R(), their_faces, t)) continue;
    t.feature = {kind, v, 0};
    t.plane_on_b = kind == 0;
    t.station = mine.vertex(v);
    out.push_back(t);
  }
}

/// Closest points of two lines p + s d, q + t e as parameters; false when they are parallel.
bool find_closest(const Vec3& p, const Vec3& d, const Vec3& q, const Vec3& e, double& s, double& t) {
  const Vec3 r = p - q;
  const double a = dot(d, d), b = dot(d, e), c = dot(e, e), f = dot(d, r), g = dot(e, r);
  const double det = a * c - b * b;
  if (det < 1e-6 * a * c) return false;
  s = (b * g - c * f) / det;
  t = (a * g - b * f) / det;
  return true;
}

void add_ridge_touches(TouchPoint base, const Surface& sa, const Surface& sb, const Transform& X_ba, const std::set<int>& faces_a,
                       const std::set<int>& faces_b, std::vector<TouchPoint>& out) {
  // Deeper than a step may go (Engine::calc_largest_step), two ridges are on the far sides of their bodies.
  const double deepest = 0.3 * std::min(sa.thickness_m(), sb.thickness_m());
  std::set<int> ridges_a, ridges_b;
  for (const int f : faces_a) ridges_a.insert(sa.face_ridges(f).begin(), sa.face_ridges(f).end());
  for (const int f : faces_b) ridges_b.insert(sb.face_ridges(f).begin(), sb.face_ridges(f).end());
  for (const int i : ridges_a) {
    const RidgeEdge& ra = sa.ridge(i);
    const Vec3 p = X_ba * sa.vertex(ra.vertices[0]);
    const Vec3 d = X_ba * sa.vertex(ra.vertices[1]) - p;
    const Vec3 into_a[2] = {X_ba.R() * ra.into_face[0], X_ba.R() * ra.into_face[1]};
    for (const int j : ridges_b) {
      const RidgeEdge& rb = sb.ridge(j);
      const Vec3 q = sb.vertex(rb.vertices[0]);
      const Vec3 e = sb.vertex(rb.vertices[1]) - q;
      double s = 0.0, t = 0.0;
      if (!find_closest(p, d, q, e, s, t) || s < -kEnd || s > 1.0 + kEnd || t < -kEnd || t > 1.0 + kEnd) continue;
      Vec3 n = cross(d, e);
      n /= n.norm();
      if (dot(n, rb.into_face[0] + rb.into_face[1]) > 0.0) n = -n;  // outward of b
      if (dot(n, rb.into_face[0]) > kFlush || dot(n, rb.into_face[1]) > kFlush || dot(n, into_a[0]) < -kFlush ||
          dot(n, into_a[1]) < -kFlush)
        continue;
      const Vec3 xa = p + s * d, xb = q + t * e;
      const double depth = dot(n, xb - xa);
      if (depth <= 0.0 || depth > std::min(0.25 * std::min(d.norm(), e.norm()) + 1e-3, deepest)) continue;
      TouchPoint touch = base;
      touch.feature = {2, i, j};
      touch.plane_on_b = true;
      touch.station = ~X_ba * xa;
      touch.plane_point = xb;
      touch.plane_normal = n;
      out.push_back(touch);
    }
  }
}

bool far_apart(const Surface& sa, const Transform& X_a, const Surface& sb, const Transform& X_b) {
  const double reach = sa.radius_m() + sb.radius_m();
  return (X_a * sa.middle_m() - X_b * sb.middle_m()).normSqr() > reach * reach;
}

}  // namespace

void place_touch(TouchPoint& t, const Transform& X_a, const Transform& X_b) {
  const Transform& X_point = t.plane_on_b ? X_a : X_b;
  const Transform& X_plane = t.plane_on_b ? X_b : X_a;
  t.where = X_point * t.station;
  const Vec3 outward = X_plane.R() * t.plane_normal;
  t.depth_m = dot(outward, X_plane * t.plane_point - t.where);
  t.normal = t.plane_on_b ? outward : Vec3(-outward);
}

std::vector<TouchPoint> find_ground_touches(int a, const Surface& surface, const Transform& X_a, double height_m) {
  std::vector<TouchPoint> out;
  if ((X_a * surface.middle_m())[2] - surface.radius_m() > height_m) return out;
  // Simbody's half space fills x > 0 of its own frame, so its x axis points down.
  static const SimTK::ContactTracker::HalfSpaceTriangleMesh tracker;
  static const SimTK::ContactGeometry::HalfSpace half_space;
  const SimTK::UntrackedContact prior(SimTK::ContactSurfaceIndex(0), SimTK::ContactSurfaceIndex(1));
  const Transform X_half(SimTK::Rotation(SimTK::Pi / 2, SimTK::YAxis), Vec3(0, 0, height_m));
  SimTK::Contact found;
  tracker.trackContact(prior, X_half, half_space, X_a, surface.mesh(), 0.0, found);
  if (found.isEmpty() || !SimTK::TriangleMeshContact::isInstance(found)) return out;
  const Vec3 up = ~X_a.R() * Vec3(0, 0, 1);
  for (const int v : find_vertices(surface, SimTK::TriangleMeshContact::getAs(found).getSurface2Faces())) {
    const Vec3 x = X_a * surface.vertex(v);
    if (x[2] >= height_m || !carries(surface, v, up)) continue;
    TouchPoint t;
    t.a = a;
    t.feature = {0, v, 0};
    t.station = surface.vertex(v);
    t.plane_point = Vec3(x[0], x[1], height_m);
    t.plane_normal = Vec3(0, 0, 1);
    place_touch(t, X_a, Transform());
    out.push_back(t);
  }
  return out;
}

std::vector<TouchPoint> find_touches(int a, const Surface& sa, const Transform& X_a, int b, const Surface& sb, const Transform& X_b,
                                     NearFaces& near) {
  std::vector<TouchPoint> out;
  if (far_apart(sa, X_a, sb, X_b)) return out;
  const Transform X_ba = ~X_b * X_a;
  const double margin = kMargin * std::min(sa.thickness_m(), sb.thickness_m());
  const double turned = (X_ba.R().asMat33() - near.X_ba.R().asMat33()).norm();
  const double moved = (X_ba * sa.middle_m() - near.X_ba * sa.middle_m()).norm() + turned * sa.radius_m();
  if (!near.known || moved > margin) {
    near = {true, X_ba, {}, {}};
    find_near_faces(sa.mesh().getOBBTreeNode(), sb.mesh().getOBBTreeNode(), X_ba, margin, near.faces_a, near.faces_b);
  }
  const std::set<int>&faces_a = near.faces_a, &faces_b = near.faces_b;
  if (faces_a.empty()) return out;
  TouchPoint base;
  base.a = a;
  base.b = b;
  add_vertex_touches(base, 0, sa, sb, X_ba, faces_a, faces_b, out);
  add_vertex_touches(base, 1, sb, sa, ~X_ba, faces_b, faces_a, out);
  add_ridge_touches(base, sa, sb, X_ba, faces_a, faces_b, out);
  for (TouchPoint& t : out) place_touch(t, X_a, X_b);
  return out;
}

bool may_be_near(const Surface& sa, const Transform& X_a, const Surface& sb, const Transform& X_b, double margin_m) {
  const double reach = sa.radius_m() + sb.radius_m() + margin_m;
  if ((X_a * sa.middle_m() - X_b * sb.middle_m()).normSqr() > reach * reach) return false;
  return are_boxes_near(sa.mesh().getOBBTreeNode(), sb.mesh().getOBBTreeNode(), ~X_b * X_a, margin_m);
}

double calc_overlap(const Surface& sa, const Transform& X_a, const Surface& sb, const Transform& X_b, Vec3& where) {
  if (far_apart(sa, X_a, sb, X_b)) return 0.0;
  double deepest = 0.0;
  const auto test_vertices = [&](const Surface& mine, const Transform& X_mine, const Surface& theirs, const Transform& X_theirs) {
    const Transform X = ~X_theirs * X_mine;
    const SimTK::OrientedBoundingBox& box = theirs.mesh().getOBBTreeNode().getBounds();
    for (int v = 0; v < mine.mesh().getNumVertices(); ++v) {
      const Vec3 x = X * mine.vertex(v);
      if (!box.containsPoint(x)) continue;
      bool inside = false;
      UnitVec3 normal;
      const double depth = (theirs.mesh().findNearestPoint(x, inside, normal) - x).norm();
      if (inside && depth > deepest) {
        deepest = depth;
        where = X_theirs * x;
      }
    }
  };
  test_vertices(sa, X_a, sb, X_b);
  test_vertices(sb, X_b, sa, X_a);
  // Two plates that cross have no vertex in each other, but edges that pierce.
  const auto test_edges = [&](const Surface& mine, const Transform& X_mine, const Surface& theirs, const Transform& X_theirs,
                              const std::set<int>& faces) {
    const Transform X = ~X_theirs * X_mine;
    for (const int f : faces) {
      for (int k = 0; k < 3; ++k) {
        const Vec3 p = X * mine.vertex(mine.mesh().getFaceVertex(f, k));
        const Vec3 d = X * mine.vertex(mine.mesh().getFaceVertex(f, (k + 1) % 3)) - p;
        const double length = d.norm();
        const UnitVec3 along(d);
        double enter = SimTK::Infinity, leave = SimTK::Infinity;
        UnitVec3 normal;
        if (!theirs.mesh().intersectsRay(p, along, enter, normal) || enter > length) continue;
        if (dot(Vec3(normal), d) > 0.0) {  // it began inside
          leave = enter;
          enter = 0.0;
        } else {
          UnitVec3 other;
          const double past = enter + 1e-9 * length;
          if (theirs.mesh().intersectsRay(p + past * Vec3(along), along, leave, other)) leave += past;
        }
        const Vec3 middle = p + 0.5 * (enter + std::min(leave, length)) * Vec3(along);
        bool inside = false;
        const double depth = (theirs.mesh().findNearestPoint(middle, inside, normal) - middle).norm();
        if (inside && depth > deepest) {
          deepest = depth;
          where = X_theirs * middle;
        }
      }
    }
  };
  std::set<int> faces_a, faces_b;
  find_near_faces(sa.mesh().getOBBTreeNode(), sb.mesh().getOBBTreeNode(), ~X_b * X_a, 0.0, faces_a, faces_b);
  test_edges(sa, X_a, sb, X_b, faces_a);
  test_edges(sb, X_b, sa, X_a, faces_b);
  // Two bodies whose faces coincide (the same body twice at the same place) have vertices and edges on, not in, each other. Their insides
  // tell: points halfway from a face to the wall opposite.
  const auto test_insides = [&](const Surface& mine, const Transform& X_mine, const Surface& theirs, const Transform& X_theirs,
                                const std::set<int>& faces) {
    const std::size_t stride = 1 + faces.size() / kProbes;
    std::size_t count = 0;
    for (const int f : faces) {
      if (count++ % stride != 0) continue;
      const UnitVec3 inwards = -mine.mesh().getFaceNormal(f);
      const Vec3 start = mine.mesh().findCentroid(f) + 1e-6 * mine.size_m() * Vec3(inwards);
      double across = 0.0;
      UnitVec3 normal;
      if (!mine.mesh().intersectsRay(start, inwards, across, normal)) continue;
      const Vec3 x = ~X_theirs * (X_mine * (start + 0.5 * across * Vec3(inwards)));
      if (!theirs.mesh().getOBBTreeNode().getBounds().containsPoint(x)) continue;
      bool inside = false;
      const double depth = std::min((theirs.mesh().findNearestPoint(x, inside, normal) - x).norm(), 0.5 * across);
      if (inside && depth > deepest) {
        deepest = depth;
        where = X_theirs * x;
      }
    }
  };
  test_insides(sa, X_a, sb, X_b, faces_a);
  test_insides(sb, X_b, sa, X_a, faces_b);
  return deepest;
}

}  // namespace carillon::contact
