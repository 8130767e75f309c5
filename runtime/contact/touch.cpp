// Method: the trees of boxes of two meshes are walked together down to the triangles near the cut; of
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

constexpr double kFlat =
    0.02;  // rad; how far below the plane a neighbour may point: a flat face that lands nearly flat lands with all of itself

constexpr double kRounding = 1e-12;   // of the size
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

/// The faces of both meshes whose leaves cut each other or are within the margin.
void find_near_faces(const Mesh& a, int node_a, const Mesh& b, int node_b, const Transform& X_ba, double margin_m, std::set<int>& faces_a,
                     std::set<int>& faces_b) {
  const Mesh::Node &na = a.node(node_a), &nb = b.node(node_b);
  if (!are_boxes_near(na.box, nb.box, X_ba, margin_m)) return;
  if (na.child < 0 && nb.child < 0) {
    for (int i = 0; i < na.count; ++i) faces_a.insert(a.order()[na.first + i]);
    for (int i = 0; i < nb.count; ++i) faces_b.insert(b.order()[nb.first + i]);
    return;
  }
  if (nb.child < 0 || (na.child >= 0 && na.count >= nb.count)) {
    for (int k = 0; k < 2; ++k) find_near_faces(a, na.child + k, b, node_b, X_ba, margin_m, faces_a, faces_b);
  } else {
    for (int k = 0; k < 2; ++k) find_near_faces(a, node_a, b, nb.child + k, X_ba, margin_m, faces_a, faces_b);
  }
}

std::set<int> find_vertices(const Surface& surface, const std::set<int>& faces) {
  std::set<int> vertices;
  for (const int f : faces) {
    for (const int v : surface.mesh().face(f)) vertices.insert(v);
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
  const Vec3 nearest = mesh.find_nearest(x, inside, face, uv);
  const double brim = kBrim * mine.size_m();
  if (!inside && (x - nearest).norm() > brim) return false;
  // A vertex that has sunk in counts whatever its neighbours do: something touched that none of the two tests knows.
  const bool sunk = (x - nearest).norm() > kSunk * mine.size_m();
  if (inside && (sunk || carries(mine, v, ~R_theirs_mine * mesh.normal(face)))) {
    touch.plane_point = nearest;
    touch.plane_normal = mesh.normal(face);
    return true;
  }
  double least = 0.05 * mine.size_m();
  bool found = false;
  for (const int f : their_faces) {
    const Vec3& n = mesh.normal(f);
    const double depth = dot(n, mesh.vertex(mesh.face(f)[0]) - x);
    if (depth <= 0.0 || depth >= least) continue;
    const Vec3 on_plane = x + depth * n;
    if ((mesh.find_nearest_on_face(on_plane, f, uv) - on_plane).norm() > brim || !carries(mine, v, ~R_theirs_mine * n)) continue;
    least = depth;
    touch.plane_point = on_plane;
    touch.plane_normal = n;
    found = true;
  }
  return found;
}

/// A cheap look at the faces near the cut alone: may x (frame of `theirs`) be inside? A search over the whole mesh takes long
/// for a point that many faces are about equally far from, so only the few points that pass come to it.
bool may_be_inside(const Surface& theirs, const std::set<int>& their_faces, const Vec3& x, double brim) {
  const auto& mesh = theirs.mesh();
  double least = SimTK::Infinity;
  bool inside = false;
  double least_root = SimTK::Infinity;
  for (const int f : their_faces) {
    const double reach = least_root + theirs.face_radius_m(f);
    if ((x - theirs.face_middle_m(f)).normSqr() > reach * reach * (1.0 + 1e-9)) continue;
    SimTK::Vec2 uv;
    const Vec3 d = x - mesh.find_nearest_on_face(x, f, uv);
    const double dist2 = d.normSqr();
    if (dist2 > least) continue;
    // Where two faces are equally near, inside either will do.
    inside = (dist2 == least && inside) || dot(d, mesh.normal(f)) < 0.0;
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
  const Vec3 up = ~X_a.R() * Vec3(0, 0, 1);
  std::set<int> below;
  surface.mesh().for_vertices_below(up, height_m - X_a.p()[2] + kRounding * surface.size_m(), [&](int v) { below.insert(v); });
  for (const int v : below) {
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
    find_near_faces(sa.mesh(), 0, sb.mesh(), 0, X_ba, margin, near.faces_a, near.faces_b);
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
  return are_boxes_near(sa.mesh().box(), sb.mesh().box(), ~X_b * X_a, margin_m);
}

double calc_overlap(const Surface& sa, const Transform& X_a, const Surface& sb, const Transform& X_b, Vec3& where) {
  if (far_apart(sa, X_a, sb, X_b)) return 0.0;
  double deepest = 0.0;
  const auto find_depth = [](const Mesh& mesh, const Vec3& x, bool& inside) {
    int face = 0;
    SimTK::Vec2 uv;
    return (mesh.find_nearest(x, inside, face, uv) - x).norm();
  };
  const auto test_vertices = [&](const Surface& mine, const Transform& X_mine, const Surface& theirs, const Transform& X_theirs) {
    const Transform X = ~X_theirs * X_mine;
    for (int v = 0; v < mine.mesh().vertex_count(); ++v) {
      const Vec3 x = X * mine.vertex(v);
      if (!theirs.mesh().box().contains(x)) continue;
      bool inside = false;
      const double depth = find_depth(theirs.mesh(), x, inside);
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
        const Vec3 p = X * mine.vertex(mine.mesh().face(f)[k]);
        const Vec3 d = X * mine.vertex(mine.mesh().face(f)[(k + 1) % 3]) - p;
        const double length = d.norm();
        const Vec3 along = d / length;
        double enter = SimTK::Infinity, leave = SimTK::Infinity;
        Vec3 normal(0);
        if (!theirs.mesh().find_crossing(p, along, enter, normal) || enter > length) continue;
        if (dot(normal, d) > 0.0) {  // it began inside
          leave = enter;
          enter = 0.0;
        } else {
          Vec3 other(0);
          const double past = enter + 1e-9 * length;
          if (theirs.mesh().find_crossing(p + past * along, along, leave, other)) leave += past;
        }
        const Vec3 middle = p + 0.5 * (enter + std::min(leave, length)) * along;
        bool inside = false;
        const double depth = find_depth(theirs.mesh(), middle, inside);
        if (inside && depth > deepest) {
          deepest = depth;
          where = X_theirs * middle;
        }
      }
    }
  };
  std::set<int> faces_a, faces_b;
  find_near_faces(sa.mesh(), 0, sb.mesh(), 0, ~X_b * X_a, 0.0, faces_a, faces_b);
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
      const Vec3 inwards = -mine.mesh().normal(f);
      const Vec3 start = mine.face_middle_m(f) + 1e-6 * mine.size_m() * inwards;
      double across = 0.0;
      Vec3 normal(0);
      if (!mine.mesh().find_crossing(start, inwards, across, normal)) continue;
      const Vec3 x = ~X_theirs * (X_mine * (start + 0.5 * across * inwards));
      if (!theirs.mesh().box().contains(x)) continue;
      bool inside = false;
      const double depth = std::min(find_depth(theirs.mesh(), x, inside), 0.5 * across);
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
