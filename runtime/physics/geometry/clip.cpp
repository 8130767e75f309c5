// Method: separating axis test over the facets of both bodies and the edge pairs whose arcs cross on the Gauss map. If a facet separates
// best, the opposite facet is clipped against its side planes; if an edge pair does, its closest points are the contact. If the nearest
// features do not face each other (corner next to corner), the closest points of edges and corners are used. Facets are preferred to edges
// within one degree of them.
// Source: D. Gregorius, "The separating axis test between convex polyhedra" (GDC 2013); I. Sutherland, G. Hodgman (1974); C. Ericson,
// "Real-Time Collision Detection" (2005), 5.1.9.
#include <algorithm>
#include <cmath>
#include <span>

#include "runtime/physics/geometry/polyhedron.hpp"
#include "runtime/physics/geometry/reduce.hpp"
#include "runtime/physics/geometry/search.hpp"

namespace carillon::geometry {
namespace {

constexpr double kAxisPreferenceRatio = 1e-5;  // fraction of the size: required advantage of another axis
constexpr double kCoplanarCosine = 0.9998;     // cos(1 degree)
constexpr double kCoplanarStepM = 3e-6;        // m; facets this flush count as coplanar
constexpr double kFacetOverhangRatio = 1e-5;   // fraction of the size: permitted overhang of a corner beyond a facet

/// Polyhedron b in the frame of a. One block of memory, as this is made for every search.
struct Turned {
  std::vector<Vec3> room;
  std::span<Vec3> corners, normals, arcs;

  explicit Turned(const Polyhedron& b) : room(b.corners.size() + b.normals.size() + b.edges.size()) {
    const std::span<Vec3> all(room);
    corners = all.first(b.corners.size());
    normals = all.subspan(corners.size(), b.normals.size());
    arcs = all.last(b.edges.size());
  }
};

struct Axis {
  double gap = -Box::kFar;
  int kind = 0;  // 0 facet of a, 1 facet of b, 2 edges
  int i = -1, j = -1;
  Vec3 normal{};  // from b to a, frame of a
};

double find_min(std::span<const Vec3> points, const Vec3& n) {
  double min = Box::kFar;
  for (const Vec3& x : points) min = std::min(min, dot(n, x));
  return min;
}

struct Vertex {
  Vec3 x{};
  int corner = -1;           // corner of the clipped facet,
  int edge = -1, side = -1;  // or its edge and a side plane of the other facet,
  int other_corner = -1;     // or a corner of the other facet
  int along = 0;             // segment to the next point: edge e of its body, or -1 - side
};

class Pair {
 public:
  Pair(const Shape& a, const Frame& fa, const Shape& b, const Frame& fb)
      : sa_(a),
        sb_(b),
        a_(*a.polyhedron()),
        b_(*b.polyhedron()),
        fa_(fa),
        fb_(fb),
        t_(b_),
        size_(std::min(a.get_size_m(), b.get_size_m())) {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        rotation_[i][j] = 0.0;
        for (int k = 0; k < 3; ++k) rotation_[i][j] += fa.rotation[k][i] * fb.rotation[k][j];
      }
    offset_ = to_body(fa, fb.position_m);
    for (std::size_t i = 0; i < b_.corners.size(); ++i) t_.corners[i] = rotation_ * b_.corners[i] + offset_;
    for (std::size_t i = 0; i < b_.normals.size(); ++i) t_.normals[i] = rotation_ * b_.normals[i];
  }

  /// Gap along one axis; used to retest the axis of the previous search.
  double calc_gap(int kind, int i) const {
    return kind == 0 ? find_min(t_.corners, a_.normals[i]) - a_.offsets_m[i] : find_min(a_.corners, t_.normals[i]) - calc_offset(i);
  }

  Axis find_facet_axis(int kind, double enough) const {
    Axis best;
    const std::size_t count = kind == 0 ? a_.normals.size() : b_.normals.size();
    for (std::size_t i = 0; i < count; ++i) {
      const double gap = calc_gap(kind, static_cast<int>(i));
      if (gap <= best.gap) continue;
      best = {gap, kind, static_cast<int>(i), -1, kind == 0 ? -1.0 * a_.normals[i] : t_.normals[i]};
      if (gap > enough) break;
    }
    return best;
  }

  /// Facets coplanar with a back-to-back facet of the other body. Such bodies slide along these planes or rest on them; they have no
  /// contact across them.
  std::vector<Axis> find_seams() const {
    std::vector<Axis> seams;
    for (const int kind : {0, 1}) {
      const std::span<const Vec3> mine = get_normals(kind == 0), theirs = get_normals(kind != 0);
      for (std::size_t i = 0; i < mine.size(); ++i) {
        const double gap = calc_gap(kind, static_cast<int>(i));
        if (std::abs(gap) > kCoplanarStepM) continue;
        const Vec3 normal = kind == 0 ? -1.0 * mine[i] : mine[i];
        if (std::any_of(seams.begin(), seams.end(), [&](const Axis& other) { return dot(other.normal, normal) > kCoplanarCosine; }))
          continue;
        if (std::any_of(theirs.begin(), theirs.end(), [&](const Vec3& n) { return dot(n, mine[i]) < -kCoplanarCosine; }))
          seams.push_back({gap, kind, static_cast<int>(i), -1, normal});
      }
    }
    return seams;
  }

  Axis find_edge_axis() {
    for (std::size_t j = 0; j < b_.edges.size(); ++j) t_.arcs[j] = rotation_ * b_.edges[j].arc;
    const std::size_t count_b = b_.edges.size();
    // Normals of a times arcs of b, all of them; normals of b times one arc of a.
    std::vector<double> dots_a(a_.normals.size() * count_b), dots_b(b_.normals.size());
    for (std::size_t f = 0; f < a_.normals.size(); ++f)
      for (std::size_t j = 0; j < count_b; ++j) dots_a[f * count_b + j] = dot(a_.normals[f], t_.arcs[j]);
    Axis best;
    for (std::size_t i = 0; i < a_.edges.size(); ++i) {
      const Polyhedron::Edge& ea = a_.edges[i];
      const Vec3 &na0 = a_.normals[ea.facets[0]], &na1 = a_.normals[ea.facets[1]];
      for (std::size_t f = 0; f < dots_b.size(); ++f) dots_b[f] = dot(t_.normals[f], ea.arc);
      for (std::size_t j = 0; j < count_b; ++j) {
        const Polyhedron::Edge& eb = b_.edges[j];
        // Arcs (na0, na1) and (-nb0, -nb1) intersect.
        const double c = dots_b[eb.facets[0]], d = dots_b[eb.facets[1]];
        const double p = dots_a[ea.facets[0] * count_b + j], q = dots_a[ea.facets[1] * count_b + j];
        if (c * d >= 0.0 || p * q >= 0.0 || c * q >= 0.0) continue;
        Vec3 n = cross(ea.arc, t_.arcs[j]);
        const double length2 = norm2(n);
        if (length2 < 1e-6 * norm2(ea.arc) * norm2(t_.arcs[j])) continue;
        n = (1.0 / std::sqrt(length2)) * n;
        if (dot(n, na0 + na1) > 0.0) n = -1.0 * n;  // from b to a
        const double gap = dot(n, a_.corners[ea.corners[0]] - t_.corners[eb.corners[0]]);
        if (gap > best.gap) best = {gap, 2, static_cast<int>(i), static_cast<int>(j), n};
      }
    }
    return best;
  }

  void clip(const Axis& axis, double margin, std::vector<Touch>& out) const {
    const bool on_a = axis.kind == 0;  // reference facet
    const Polyhedron &mine = on_a ? a_ : b_, &theirs = on_a ? b_ : a_;
    const std::span<const Vec3> my_corners = get_corners(on_a), their_corners = get_corners(!on_a), their_normals = get_normals(!on_a);
    const Vec3& n = get_normals(on_a)[axis.i];
    const double offset = on_a ? a_.offsets_m[axis.i] : calc_offset(axis.i);
    int facing = 0;
    for (std::size_t i = 1; i < their_normals.size(); ++i)
      if (dot(their_normals[i], n) < dot(their_normals[facing], n)) facing = static_cast<int>(i);
    std::vector<Vertex> polygon, next;
    const auto& loop = theirs.loops[facing];
    polygon.reserve(loop.size() + mine.loops[axis.i].size());
    next.reserve(loop.size() + mine.loops[axis.i].size());
    for (std::size_t i = 0; i < loop.size(); ++i) {
      Vertex v;
      v.x = their_corners[loop[i]];
      v.corner = loop[i];
      v.along = theirs.loop_edges[facing][i];
      polygon.push_back(v);
    }
    const auto& sides = mine.loops[axis.i];
    const int count = static_cast<int>(sides.size());
    for (int k = 0; k < count && !polygon.empty(); ++k) {
      const Vec3 &p = my_corners[sides[k]], &q = my_corners[sides[(k + 1) % count]];
      const Vec3 out_of = normalise(cross(q - p, n));
      next.clear();
      for (std::size_t i = 0; i < polygon.size(); ++i) {
        const Vertex &here = polygon[i], &there = polygon[(i + 1) % polygon.size()];
        const double s = dot(out_of, here.x - p), t = dot(out_of, there.x - p), brim = kFacetOverhangRatio * size_;
        if (s <= brim) next.push_back(here);
        if ((s <= brim) == (t <= brim)) continue;
        Vertex v;
        v.x = here.x + std::clamp(s / (s - t), 0.0, 1.0) * (there.x - here.x);
        v.along = s <= brim ? -1 - k : here.along;
        if (here.along >= 0) {
          v.edge = here.along;
          v.side = mine.loop_edges[axis.i][k];
        } else {
          v.other_corner = sides[(k - (-1 - here.along) + count) % count == 1 ? k : (k + 1) % count];
        }
        next.push_back(v);
      }
      polygon.swap(next);
    }
    for (const Vertex& v : polygon) {
      const double gap = dot(n, v.x) - offset;
      if (gap > margin) continue;
      Touch t;
      t.gap_m = gap;
      t.normal = on_a ? -1.0 * axis_world(n) : axis_world(n);
      const Vec3 foot = v.x - gap * n;
      t.station_a = on_a ? foot : v.x;
      t.station_b = turn_back(rotation_, (on_a ? v.x : foot) - offset_);
      t.where_m = to_world(fa_, v.x - (0.5 * gap) * n);
      t.side_a = on_a ? Side::plane : Side::point;
      t.side_b = on_a ? Side::point : Side::plane;
      (on_a ? t.axis_a : t.axis_b) = mine.normals[axis.i];
      const double corner_a = sa_.get_corner_curvature_per_m(), corner_b = sb_.get_corner_curvature_per_m();
      if (v.corner >= 0) {
        t.id = on_a ? make_id(Feature::corner_b, b_.corner_vertices[v.corner], 0)
                    : make_id(Feature::corner_a, a_.corner_vertices[v.corner], 0);
        (on_a ? t.curvature_b_per_m : t.curvature_a_per_m) = on_a ? corner_b : corner_a;
      } else if (v.edge >= 0) {
        t.id = on_a ? make_id(Feature::edges, v.side, v.edge) : make_id(Feature::edges, v.edge, v.side);
        t.curvature_a_per_m = 0.5 * corner_a;
        t.curvature_b_per_m = 0.5 * corner_b;
      } else {
        const int c = v.other_corner;
        t.id = on_a ? make_id(Feature::corner_a, a_.corner_vertices[c], 0) : make_id(Feature::corner_b, b_.corner_vertices[c], 0);
        (on_a ? t.curvature_a_per_m : t.curvature_b_per_m) = on_a ? corner_a : corner_b;
      }
      out.push_back(t);
    }
  }

  void cross_edges(const Axis& axis, std::vector<Touch>& out) const {
    const Polyhedron::Edge &ea = a_.edges[axis.i], &eb = b_.edges[axis.j];
    const Vec3 p = a_.corners[ea.corners[0]], q = t_.corners[eb.corners[0]];
    const Vec3 d = ea.along, e = rotation_ * eb.along, r = p - q;
    const double mixed = dot(d, e), det = 1.0 - mixed * mixed;
    const double s = (mixed * dot(e, r) - dot(d, r)) / det, u = (dot(e, r) - mixed * dot(d, r)) / det;
    if (axis.gap > 0.0 && (s < 0.0 || s > ea.length || u < 0.0 || u > eb.length)) return;
    Touch t;
    t.gap_m = axis.gap;
    t.normal = axis_world(axis.normal);
    t.station_a = p + s * d;
    t.station_b = b_.corners[eb.corners[0]] + u * eb.along;
    t.where_m = 0.5 * (to_world(fa_, t.station_a) + to_world(fb_, t.station_b));
    t.side_a = t.side_b = Side::line;
    t.axis_a = ea.along;
    t.axis_b = eb.along;
    t.curvature_a_per_m = 0.5 * sa_.get_corner_curvature_per_m();
    t.curvature_b_per_m = 0.5 * sb_.get_corner_curvature_per_m();
    t.id = make_id(Feature::edges, axis.i, axis.j);
    out.push_back(t);
  }

  /// Closest points of bodies whose nearest features are edges or corners that do not face each other.
  void find_closest(double margin, std::vector<Touch>& out) const {
    double min = margin * margin;
    Vec3 at_a{}, at_b{};
    int which_a = -1, which_b = -1;
    for (std::size_t i = 0; i < a_.edges.size(); ++i) {
      const Vec3 &p = a_.corners[a_.edges[i].corners[0]], d = a_.corners[a_.edges[i].corners[1]] - p;
      for (std::size_t j = 0; j < b_.edges.size(); ++j) {
        const Vec3 &q = t_.corners[b_.edges[j].corners[0]], e = t_.corners[b_.edges[j].corners[1]] - q, r = p - q;
        const double dd = norm2(d), ee = norm2(e), de = dot(d, e), dr = dot(d, r), er = dot(e, r), det = dd * ee - de * de;
        double s = det > 1e-12 * dd * ee ? std::clamp((de * er - dr * ee) / det, 0.0, 1.0) : 0.0;
        double u = (de * s + er) / ee;
        if (u < 0.0 || u > 1.0) {
          u = std::clamp(u, 0.0, 1.0);
          s = std::clamp((de * u - dr) / dd, 0.0, 1.0);
        }
        const Vec3 x = p + s * d, y = q + u * e;
        if (norm2(x - y) >= min) continue;
        min = norm2(x - y);
        at_a = x, at_b = y;
        which_a = static_cast<int>(i), which_b = static_cast<int>(j);
      }
    }
    if (which_a < 0 || !(min > 1e-24 * size_ * size_)) return;
    Touch t;
    t.gap_m = std::sqrt(min);
    const Vec3 n = (1.0 / t.gap_m) * (at_a - at_b);
    t.normal = axis_world(n);
    t.station_a = at_a;
    t.station_b = turn_back(rotation_, at_b - offset_);
    t.where_m = to_world(fa_, 0.5 * (at_a + at_b));
    t.side_b = Side::point;
    t.curvature_a_per_m = sa_.get_corner_curvature_per_m();
    t.curvature_b_per_m = sb_.get_corner_curvature_per_m();
    t.id = make_id(Feature::edges, which_a, which_b);
    out.push_back(t);
  }

  double size() const { return size_; }

 private:
  std::span<const Vec3> get_corners(bool of_a) const { return of_a ? std::span<const Vec3>(a_.corners) : t_.corners; }
  std::span<const Vec3> get_normals(bool of_a) const { return of_a ? std::span<const Vec3>(a_.normals) : t_.normals; }
  Vec3 axis_world(const Vec3& n) const { return fa_.rotation * n; }
  /// Of a facet of b, in the frame of a.
  double calc_offset(int facet) const { return b_.offsets_m[facet] + dot(t_.normals[facet], offset_); }

  const Shape &sa_, &sb_;
  const Polyhedron &a_, &b_;
  const Frame &fa_, &fb_;
  Mat3 rotation_{};
  Vec3 offset_{};
  Turned t_;
  double size_;
};

}  // namespace

void find_polyhedra_touches(const Shape& a, const Frame& fa, const Shape& b, const Frame& fb, double margin, PairMemory& memory,
                            std::vector<Touch>& out) {
  out.clear();
  Pair pair(a, fa, b, fb);
  if (memory.axis[0] >= 0 && pair.calc_gap(memory.axis[0], memory.axis[1]) > margin) return;
  const Axis on_a = pair.find_facet_axis(0, margin);
  if (on_a.gap > margin) {
    memory.axis = {0, on_a.i};
    return;
  }
  const Axis on_b = pair.find_facet_axis(1, margin);
  if (on_b.gap > margin) {
    memory.axis = {1, on_b.i};
    return;
  }
  const double prefer = kAxisPreferenceRatio * pair.size();
  const bool was_b = memory.axis[0] == 1;
  Axis facet = on_b.gap > on_a.gap + (was_b ? -prefer : prefer) ? on_b : on_a;
  memory.axis = {facet.kind, facet.i};
  if (facet.gap > 0.0) {
    const std::vector<Axis> seams = pair.find_seams();
    if (seams.size() > 1) return;  // edge to edge: sliding past
    if (seams.size() == 1 && dot(seams.front().normal, facet.normal) < kCoplanarCosine) {
      pair.clip(seams.front(), margin, out);
      reduce(out, Box::kFar);
      return;
    }
  }
  const Axis edges = pair.find_edge_axis();
  if (edges.gap > margin) return;
  const bool crossed = edges.i >= 0 && edges.gap > facet.gap + prefer && dot(edges.normal, facet.normal) < kCoplanarCosine;
  if (!crossed) pair.clip(facet, margin, out);
  if (out.empty() && edges.i >= 0 && (crossed || edges.gap > facet.gap - prefer)) pair.cross_edges(edges, out);
  double min = margin;
  for (const Touch& t : out) min = std::min(min, t.gap_m);
  // Separated, and the nearest facets do not face each other.
  if (out.empty() || (facet.gap > 0.0 && !crossed && min > facet.gap + prefer)) pair.find_closest(out.empty() ? margin : min - prefer, out);
  reduce(out, Box::kFar);
}

}  // namespace carillon::geometry
