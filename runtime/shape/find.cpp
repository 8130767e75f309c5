// One search for all pairs of shapes: its steps (candidates, corners, ridges, nearest places) share the same margins and slack; longer than
// most files.
// Method: convex polyhedra by clipping. Of any other pair, the samples of each that the other's grid does not show to be further than the
//   margin; of those, corners and ridge points that no neighbour is lower than, and samples of curved parts that are the nearest among
//   their neighbours; each against the nearest place of the other's fine mesh, and settled there. Ridges against curved parts: the lowest
//   place of each straight piece, and ends that both pieces rise from. Ridges against ridges by two trees and the arcs on the Gauss map.
//   The candidates are kept with a slack, so that a pair that has moved less than it is answered from memory, and so are the samples that
//   are near: a distance changes by no more than the way.
// Source: C. Ericson, "Real-Time Collision Detection" (2005), 5.1.9; Gauss map of edges: D. Gregorius (GDC 2013).
// Deviations: estimates from the grid's face by way of neighbours, not the nearest face of all, decide which sample is the nearest among
//   its neighbours, but for bodies with walls thinner than four cells.
#include <optional>

#include "runtime/shape/grid.hpp"
#include "runtime/shape/mesh.hpp"
#include "runtime/shape/polyhedron.hpp"
#include "runtime/shape/reduce.hpp"
#include "runtime/shape/search.hpp"
#include "runtime/shape/skin.hpp"

namespace carillon::shape {
namespace {

constexpr double kBrim = 1e-4;    // of the size: a corner may stand out so far beyond the brim of a face that it still stands on
constexpr double kEnd = 1e-6;     // of an edge: two that cross where the next one begins must not be missed
constexpr double kEdge = 1e-3;    // rad; the edges of two faces that lie on each other cross as well
constexpr double kBend = 4.0;     // over the thickness: the curvature, halved, that is allowed for between samples
constexpr double kNear = 0.01;    // of the size of the smaller body: ways for which the samples that are near are kept
constexpr double kThinCells = 4;  // a wall thinner than so many cells is thin: a node of the grid may look to its far side

/// Distances of samples of one body to another, found once in a search.
struct Distances {
  std::vector<double> values;
  std::vector<std::uint32_t> stamps;
  std::uint32_t stamp = 0;
  void begin(std::size_t count) {
    if (stamps.size() < count) {
      stamps.assign(count, 0);
      values.resize(count);
      stamp = 0;
    }
    if (++stamp == 0) {
      std::fill(stamps.begin(), stamps.end(), 0);
      stamp = 1;
    }
  }
};

/// What the surface of a body looks like from a place near it, in its own frame.
class Ground {
 public:
  explicit Ground(const Shape& shape) : shape_(shape), body_(shape.polyhedron()) {
    if (body_ != nullptr) return;
    grid_ = &shape.grid();
    const Mesh& mesh = shape.mesh();
    wall_m_ = 2.0 * mesh.volume_m3 / mesh.area_m2;
    thin_ = wall_m_ < kThinCells * grid_->get_cell_m();
  }

  /// No face is nearer than this.
  double find_bound(const Vec3& x) const { return body_ != nullptr ? find_outside(x) : grid_->find_near(x).min_m; }
  /// Signed, good enough to compare neighbours; beyond `limit` a bound will do.
  double estimate(const Vec3& x, double limit) const {
    if (body_ != nullptr) {
      int outside = 0;  // of how many facets: next to an edge or a corner, the facets do not say how far
      for (std::size_t i = 0; i < body_->normals.size() && outside < 2; ++i)
        outside += dot(body_->normals[i], x) > body_->offsets_m[i] ? 1 : 0;
      return outside < 2 ? find_outside(x) : std::sqrt(shape_.mesh().find_nearest(x, Box::kFar, -1).distance2);
    }
    const Grid::Near near = grid_->find_near(x);
    if (near.face < 0 || near.min_m > limit) return near.min_m;
    const Mesh& mesh = shape_.mesh();
    Nearest on = mesh.walk_nearest(x, near.face);
    bool inside = mesh.is_inside(x, on);
    if (inside && thin_ && on.distance2 > 0.01 * wall_m_ * wall_m_) {  // or behind the far side of a wall
      on = mesh.find_nearest(x, Box::kFar, on.face);
      inside = mesh.is_inside(x, on);
    }
    return (inside ? -1.0 : 1.0) * std::sqrt(on.distance2);
  }
  /// The same, but behind a thin wall a bound.
  double find_distance(const Vec3& x, double limit) const { return thin_ ? find_bound(x) : estimate(x, limit); }
  bool is_thin() const { return thin_; }
  /// Of a place over the skin; where it is more than `limit_m`, any such number.
  double calc_gap(const Vec3& x, double limit_m) const {
    if (body_ != nullptr) return find_outside(x);
    const Skin& skin = shape_.skin();
    const Mesh& mesh = shape_.mesh();
    const Grid::Near near = grid_->find_near(x);
    const double far = std::max(limit_m, 0.0) + skin.get_sag_m();
    if (near.face < 0 || near.min_m > limit_m + skin.get_sag_m()) return near.min_m;
    Nearest on = mesh.walk_nearest(x, near.face);
    bool inside = mesh.is_inside(x, on);
    if (!inside && on.distance2 > far * far) return std::sqrt(on.distance2);
    if (inside && thin_ && on.distance2 > 0.01 * wall_m_ * wall_m_) {
      on = mesh.find_nearest(x, Box::kFar, on.face);
      inside = mesh.is_inside(x, on);
    }
    if (skin.is_flat(on.face)) return (inside ? -1.0 : 1.0) * std::sqrt(on.distance2);
    return dot(skin.calc_normal(on.face, on.weights), x - skin.calc_point(on.face, on.weights));
  }
  Nearest find_nearest(const Vec3& x) const {
    return shape_.mesh().find_nearest(x, Box::kFar, body_ != nullptr ? -1 : grid_->find_near(x).face);
  }

 private:
  double find_outside(const Vec3& x) const {
    double max = -Box::kFar;
    for (std::size_t i = 0; i < body_->normals.size(); ++i) max = std::max(max, dot(body_->normals[i], x) - body_->offsets_m[i]);
    return max;
  }
  const Shape& shape_;
  const Polyhedron* body_ = nullptr;
  const Grid* grid_ = nullptr;
  bool thin_ = false;
  double wall_m_ = 0.0;
};

/// What is at a place of a skin: a plane or curved part of it, an edge, a corner.
struct Facing {
  Side side = Side::plane;
  Vec3 axis{};  // normal of a plane, direction of a line
  int vertex = -1;
};

Facing describe(const Mesh& mesh, const Skin& skin, const Nearest& at) {
  int zeros = 0, zero = 0, whole = 0;
  for (int k = 0; k < 3; ++k) {
    if (at.weights[k] <= 0.0) {
      ++zeros;
      zero = k;
    } else {
      whole = k;
    }
  }
  if (zeros == 2) {
    const int v = mesh.vertex_of(3 * at.face + whole);
    if (skin.kind(v) == VertexKind::corner) return {Side::point, {}, v};
    // Amid an edge: along the sharp edge that leaves it.
    for (int e = 3 * at.face + whole;;) {
      if (skin.is_sharp(e)) return {Side::line, normalise(mesh.vertices[mesh.vertex_of(Mesh::next(e))] - mesh.vertices[v]), v};
      e = Mesh::next(mesh.opposite[e]);
      if (e == 3 * at.face + whole) break;
    }
  }
  if (zeros == 1) {
    const int e = 3 * at.face + (zero + 1) % 3;
    if (skin.is_sharp(e))
      return {Side::line, normalise(mesh.vertices[mesh.vertex_of(Mesh::next(e))] - mesh.vertices[mesh.vertex_of(e)]), -1};
  }
  if (skin.is_flat(at.face)) return {Side::plane, mesh.normals[at.face], -1};
  return {Side::skin, {}, -1};
}

/// The outward normal of a face at the place of it that is nearest to x; of a curved one that of the skin.
Vec3 find_normal(const Shape& shape, int face, const Vec3& x) {
  return shape.skin().calc_normal(face, shape.mesh().find_nearest_on_face(x, face).weights);
}

/// Ridge::into at a place of the ridge, in the tangent plane of a curved side.
Vec3 find_into(const Shape& shape, const Ridge& ridge, int side, const Vec3& x) {
  const int face = ridge.faces[side];
  if (shape.skin().is_flat(face)) return ridge.into[side];
  const Vec3 n = find_normal(shape, face, x);
  return normalise(side == 0 ? cross(n, ridge.along) : cross(ridge.along, n));
}

/// One direction of a search: samples of `mine` before the surface of `theirs`. Touches are made with mine as a.
class Pass {
 public:
  Pass(const Shape& mine, const Frame& fm, const Shape& theirs, const Frame& ft, double reach, std::vector<Touch>& out)
      : mine_(mine), theirs_(theirs), fm_(fm), ft_(ft), ground_(theirs), reach_(reach), sag_(theirs.skin().get_sag_m()), out_(out) {
    const Frame relative = calc_relative(fm, ft);
    rotation_ = relative.rotation;
    offset_ = relative.position_m;
    bend_ = kBend * (1.0 / mine.get_thickness_m() + 1.0 / theirs.get_thickness_m());
  }

  /// The samples that are nearer than `reach_m`.
  void list(double reach_m, std::vector<std::pair<int, double>>& near) const {
    const Samples& s = mine_.samples();
    near.clear();
    std::vector<int> open;
    if (!s.samples.empty()) open.push_back(0);
    while (!open.empty()) {
      const Ball& ball = s.sample_tree[open.back()];
      open.pop_back();
      if (ground_.find_bound(to_theirs(ball.middle)) - ball.radius_m > reach_m) continue;
      if (ball.child >= 0) {
        open.push_back(ball.child + 1);
        open.push_back(ball.child);
        continue;
      }
      for (int i = ball.first; i < ball.first + ball.count; ++i)
        if (const double d = ground_.find_distance(to_theirs(s.samples[i].point), reach_m); d <= reach_m) near.emplace_back(i, d);
    }
  }
  /// How far beyond the reach of a search a sample may be that stands for a place within it.
  double find_room() const { return calc_room(mine_.samples().reach_m) + reach_ + sag_; }

  /// `near`: samples that were near before the bodies moved by at most `way_m`.
  void run(Distances& distances, const std::vector<std::pair<int, double>>& near, double way_m) {
    const Samples& s = mine_.samples();
    if (s.samples.empty()) return;
    distances.begin(s.samples.size());
    const double limit = reach_ + sag_ + 2.0 * s.spacing_m;
    const auto measure = [&](int i) {
      if (distances.stamps[i] != distances.stamp) {
        distances.stamps[i] = distances.stamp;
        distances.values[i] = ground_.estimate(to_theirs(s.samples[i].point), limit);
      }
      return distances.values[i];
    };
    std::vector<std::pair<double, int>> pits;
    for (const auto& [i, before] : near) {
      const Sample& sample = s.samples[i];
      const double within = reach_ + sag_ + (sample.kind == VertexKind::smooth ? calc_room(sample.reach_m) : 0.0);
      if (before - way_m > within) continue;
      if (way_m == 0.0 && !ground_.is_thin()) {  // as it was just estimated
        distances.stamps[i] = distances.stamp;
        distances.values[i] = before;
      }
      const double d = measure(i);
      if (d > within) continue;
      if (sample.kind != VertexKind::smooth) {
        add_point(sample);
        continue;
      }
      bool nearest = true;
      for (int k = 0; k < sample.neighbours && nearest; ++k) {
        const int other = s.neighbours[sample.first_neighbour + k];
        const double step2 = norm2(s.samples[other].point - sample.point), fall = measure(other) - d;
        nearest = fall >= 0.0 || fall * fall <= kFlat * kFlat * step2;
      }
      if (nearest) pits.emplace_back(d, i);
    }
    // Those next to one that has been settled lower would come to the same place.
    std::sort(pits.begin(), pits.end());
    std::vector<std::pair<Vec3, double>> found;
    for (const auto& [d, i] : pits) {
      const Sample& sample = s.samples[i];
      const bool known = std::any_of(found.begin(), found.end(), [&, d = d](const auto& other) {
        return other.second <= d && norm2(other.first - sample.point) < sample.reach_m * sample.reach_m;
      });
      if (known) continue;
      const std::size_t before = out_.size();
      add_smooth(sample);
      if (out_.size() > before) found.emplace_back(out_.back().station_a, out_.back().gap_m);
    }
  }

  /// The sample that is deepest in theirs; -1 where none is deeper than `gap_m`, which becomes its gap.
  int find_deepest(double& gap_m, const std::vector<std::pair<int, double>>& near, double way_m) const {
    int deepest = -1;
    for (const auto& [i, before] : near)
      if (before - way_m - sag_ < gap_m)
        if (const double d = ground_.calc_gap(to_theirs(mine_.samples().samples[i].point), gap_m); d < gap_m) gap_m = d, deepest = i;
    return deepest;
  }

  /// Ridges of mine before curved parts of theirs: the lowest places of their straight pieces, and corners between two pieces that both
  /// rise.
  void run_ridges() {
    const Samples& s = mine_.samples();
    if (s.ridges.empty() || theirs_.is_polyhedron()) return;
    std::vector<int> open{0}, ends;
    while (!open.empty()) {
      const Ball& ball = s.ridge_tree[open.back()];
      open.pop_back();
      if (ground_.find_bound(to_theirs(ball.middle)) - ball.radius_m > reach_ + sag_) continue;
      if (ball.child >= 0) {
        open.push_back(ball.child + 1);
        open.push_back(ball.child);
        continue;
      }
      for (int i = ball.first; i < ball.first + ball.count; ++i)
        if (const int end = add_ridge(i); end >= 0) ends.push_back(end);
    }
    std::sort(ends.begin(), ends.end());
    for (std::size_t i = 1; i < ends.size(); ++i)
      if (ends[i] == ends[i - 1] && (i < 2 || ends[i] != ends[i - 2])) add_end(ends[i]);
  }

  /// A touch of a sample with the nearest place of theirs.
  Touch make_touch(int place) const {
    const Sample& sample = mine_.samples().samples[place];
    const Nearest at = ground_.find_nearest(to_theirs(sample.point));
    const Mesh& mesh = theirs_.mesh();
    const bool is_curved = !theirs_.skin().is_flat(at.face);
    Touch t = begin(sample.point, at.place, is_curved ? theirs_.skin().calc_normal(at.face, at.weights) : mesh.normals[at.face]);
    t.axis_b = mesh.normals[at.face];
    if (is_curved) t.side_b = Side::skin, t.face_b = at.face, t.smooth = true;
    t.curvature_a_per_m = get_sharp_curvature(mine_, sample.kind);
    if (sample.kind == VertexKind::smooth) {
      const Spot spot = mine_.skin().locate(sample.point, sample.face);
      t.curvature_a_per_m = mine_.skin().calc_mean_curvature(spot.face, spot.weights);
    }
    settle(t, mine_, fm_, &theirs_, ft_, mine_.samples().spacing_m, kFirst);
    t.id = make_id(Feature::corner_a, place, kDeepest);
    return t;
  }

 private:
  Vec3 to_theirs(const Vec3& x) const { return rotation_ * x + offset_; }
  double calc_room(double reach_m) const { return std::min(reach_m, bend_ * reach_m * reach_m); }
  bool may_carry(const Sample& sample, const Vec3& normal) const {
    return carries(mine_.mesh(), sample.vertex, turn_back(rotation_, normal));
  }

  Touch begin(const Vec3& station, const Vec3& theirs, const Vec3& normal) const {
    Touch t;
    t.station_a = station;
    t.station_b = theirs;
    t.normal = ft_.rotation * normal;
    return t;
  }

  /// A corner or a point of a ridge.
  void add_point(const Sample& sample) {
    const Vec3 x = to_theirs(sample.point);
    const Mesh& mesh = theirs_.mesh();
    const Nearest at = ground_.find_nearest(x);
    const double d = std::sqrt(at.distance2);
    if (d > reach_ + sag_ && !mesh.is_inside(x, at)) return;
    const Facing facing = describe(mesh, theirs_.skin(), at);
    Touch t;
    bool found = false;
    if (facing.side == Side::skin) {
      const Vec3 n = theirs_.skin().calc_normal(at.face, at.weights);
      if (may_carry(sample, n)) {
        t = begin(sample.point, at.place, n);
        t.side_b = Side::skin;
        t.face_b = at.face;
        t.smooth = true;
        found = settle(t, mine_, fm_, &theirs_, ft_, 0.05 * mine_.get_size_m(), kFirst);
        found = found && may_carry(sample, turn_back(ft_.rotation, t.normal));
      }
    } else if (facing.side == Side::plane) {
      found = may_carry(sample, facing.axis);
      if (found) {
        t = begin(sample.point, at.place, facing.axis);
        t.axis_b = facing.axis;
      }
    }
    if (!found) found = find_brim(sample, x, d, t);
    if (!found && facing.side != Side::skin && !mesh.is_inside(x, at) && d > 1e-9 * mine_.get_size_m()) {
      const Vec3 n = (1.0 / d) * (x - at.place);
      if (may_carry(sample, n)) {
        t = begin(sample.point, at.place, n);
        t.side_b = Side::point;
        t.curvature_b_per_m = get_sharp_curvature(theirs_, facing.side == Side::point ? VertexKind::corner : VertexKind::ridge);
        found = true;
      }
    }
    if (!found) return;
    if (t.side_b == Side::plane && sample.kind != VertexKind::corner && !mine_.skin().is_flat(sample.face) && add_rim(sample, t)) return;
    if (t.side_b != Side::skin) settle(t, mine_, fm_, &theirs_, ft_, reach_);
    t.curvature_a_per_m = get_sharp_curvature(mine_, sample.kind);
    t.id = make_id(Feature::corner_a, sample.vertex, 0);
    if (t.gap_m <= reach_) out_.push_back(t);
  }

  /// A touch of a place of a ridge of mine with a curved part of theirs; none over a flat one.
  std::optional<Touch> begin_ridge(const Vec3& point) const {
    const Nearest at = ground_.find_nearest(to_theirs(point));
    if (theirs_.skin().is_flat(at.face)) return std::nullopt;
    Touch t = begin(point, at.place, theirs_.skin().calc_normal(at.face, at.weights));
    t.side_b = Side::skin;
    t.face_b = at.face;
    t.smooth = true;
    t.curvature_a_per_m = get_sharp_curvature(mine_, VertexKind::ridge);
    return t;
  }

  /// The lowest place of a straight piece of a ridge. Returns the vertex at the end to which it falls; -1 where there is none.
  int add_ridge(int ridge) {
    const Ridge& r = mine_.samples().ridges[ridge];
    const double length = norm(r.end - r.begin);
    double least = reach_ + sag_ + 0.25 * length;
    Vec3 lowest{};
    bool found = false;
    for (const double part : {0.0, 0.5, 1.0}) {
      const Vec3 x = r.begin + part * (r.end - r.begin);
      const double d = ground_.estimate(to_theirs(x), least);
      if (d < least) least = d, lowest = x, found = true;
    }
    if (!found) return -1;
    std::optional<Touch> t = begin_ridge(lowest);
    if (!t) return -1;
    t->side_a = Side::line;
    t->axis_a = r.along;
    const bool settled = settle(*t, mine_, fm_, &theirs_, ft_, length, kFirst);
    const double at = dot(t->station_a - r.begin, r.along);
    if (at < 0.0) return r.vertices[0];
    if (at > length) return r.vertices[1];
    const Vec3 n = turn_back(fm_.rotation, t->normal);
    for (const int k : {0, 1})
      if (dot(n, find_into(mine_, r, k, t->station_a)) < -kFlush) return -1;
    t->id = make_id(Feature::corner_a, ridge, 3);
    if (settled && t->gap_m <= reach_) out_.push_back(*t);
    return -1;
  }

  /// A corner of a ridge that is lower than both pieces next to it.
  void add_end(int vertex) {
    std::optional<Touch> t = begin_ridge(mine_.mesh().vertices[vertex]);
    if (!t || !settle(*t, mine_, fm_, &theirs_, ft_, 0.05 * mine_.get_size_m(), kFirst) || t->gap_m > reach_) return;
    t->id = make_id(Feature::corner_a, vertex, 0);
    out_.push_back(*t);
  }

  /// A flat face about x on which the sample carries, though it is not the nearest one: a corner in the plane of a side.
  bool find_brim(const Sample& sample, const Vec3& x, double d, Touch& t) const {
    const Mesh& mesh = theirs_.mesh();
    const double brim = kBrim * std::min(mine_.get_size_m(), theirs_.get_size_m());
    double best = -Box::kFar;
    mesh.for_ball(x, d + brim, [&](int f) {
      const Vec3& n = mesh.normals[f];
      const double gap = dot(n, x - mesh.corner(f, 0));
      if (gap <= best || gap > reach_ || std::abs(gap) > d + brim || !theirs_.skin().is_flat(f)) return;
      const Vec3 foot = x - gap * n;
      if (mesh.find_nearest_on_face(foot, f).distance2 > brim * brim || !may_carry(sample, n)) return;
      best = gap;
      t = begin(sample.point, foot, n);
      t.axis_b = n;
    });
    return best > -Box::kFar;
  }

  /// A rim over a facet is round: the lowest place of the skin about the sample. False where that is not over the facet.
  bool add_rim(const Sample& sample, Touch t) {
    const double reach = kWalk * std::max(1.5 * sample.reach_m, 2.0 * mine_.samples().spacing_m);
    const double brim = kBrim * std::min(mine_.get_size_m(), theirs_.get_size_m());
    t.side_a = Side::skin;
    t.face_a = sample.face;
    t.smooth = true;
    t.id = make_id(Feature::corner_a, sample.vertex, 0);
    const auto add = [&](const Touch& touch) {
      if (theirs_.mesh().find_nearest(touch.station_b, Box::kFar, -1).distance2 > brim * brim) return false;
      if (touch.gap_m <= reach_) out_.push_back(touch);
      return true;
    };
    Touch stays = t;
    stays.stays = true;
    const bool remains = settle(stays, mine_, fm_, &theirs_, ft_, reach);
    if (!settle(t, mine_, fm_, &theirs_, ft_, reach) || is_level(t, mine_, fm_, &theirs_, ft_)) return remains && add(stays);
    if (remains && norm(t.station_a - sample.point) > kGuard * mine_.get_size_m()) add(stays);
    settle(t, mine_, fm_, &theirs_, ft_, reach);  // the spring's centre is now there
    return add(t);
  }

  /// A place of a curved part.
  void add_smooth(const Sample& sample) {
    constexpr int kMax = 4;  // looks at what it faces
    const Mesh& mesh = theirs_.mesh();
    const double reach = std::max(1.5 * sample.reach_m, 2.0 * mine_.samples().spacing_m), brim = kBrim * mine_.get_size_m();
    Spot spot = mine_.skin().locate(sample.point, sample.face);
    const Vec3 x = to_theirs(spot.point);
    Nearest at = ground_.find_nearest(x);
    const bool inside = mesh.is_inside(x, at);
    const double d = std::sqrt(at.distance2);
    if (!inside && d > reach_ + sag_ + sample.reach_m) return;
    Touch t;
    Facing facing = describe(mesh, theirs_.skin(), at);
    if (inside && facing.side != Side::skin) facing = {Side::plane, mesh.normals[at.face], -1};
    for (int i = 0; i < kMax; ++i) {
      Vec3 n = mesh.normals[at.face];
      if (facing.side == Side::skin) {
        n = theirs_.skin().calc_normal(at.face, at.weights);
      } else if (facing.side != Side::plane) {
        n = -1.0 * (rotation_ * mine_.skin().calc_normal(spot.face, spot.weights));
      }
      t = begin(spot.point, at.place, n);
      t.side_a = Side::skin;
      t.face_a = spot.face;
      t.smooth = true;
      t.side_b = facing.side;
      t.axis_b = facing.axis;
      t.face_b = facing.side == Side::skin ? at.face : -1;
      if (facing.side == Side::line) t.curvature_b_per_m = get_sharp_curvature(theirs_, VertexKind::ridge);
      if (facing.side == Side::point) t.curvature_b_per_m = get_sharp_curvature(theirs_, VertexKind::corner);
      const Touch before = t;
      bool settled = settle(t, mine_, fm_, &theirs_, ft_, facing.side == Side::plane ? kWalk * reach : reach, kFirst);
      if (settled && facing.side == Side::plane && is_level(t, mine_, fm_, &theirs_, ft_)) {
        t = before;
        t.stays = true;
        settled = settle(t, mine_, fm_, &theirs_, ft_, kWalk * reach);
      }
      if (settled && facing.side == Side::plane) settle(t, mine_, fm_, &theirs_, ft_, reach);
      if (facing.side == Side::plane || facing.side == Side::line) {
        const Nearest foot = mesh.find_nearest(t.station_b, Box::kFar, at.face);
        if (foot.distance2 > brim * brim || (facing.side == Side::line && !is_between(t, foot))) {
          // Past the facet or the edge: what is there?
          at = foot;
          if (facing.side == Side::line && foot.distance2 <= brim * brim) {
            at = ground_.find_nearest(to_theirs(t.station_a));
            const Facing other = describe(mesh, theirs_.skin(), at);
            if (other.side == Side::line && std::abs(dot(other.axis, facing.axis)) > 0.99) return;
          }
          facing = describe(mesh, theirs_.skin(), at);
          if (i + 1 == kMax) return;
          continue;
        }
      }
      if (facing.side == Side::point) {
        const Nearest other = ground_.find_nearest(to_theirs(t.station_a));
        const Facing beyond = describe(mesh, theirs_.skin(), other);
        if (beyond.side != Side::point && i + 1 < kMax) {
          at = other;
          facing = beyond;
          spot = mine_.skin().locate(t.station_a, t.face_a);
          continue;
        }
      }
      if (settled) break;
      // Falling on beyond its reach: of another sample, unless it is nearly parallel.
      const Vec3 outward = rotation_ * mine_.skin().calc_normal(spot.face, spot.weights);
      if (facing.side != Side::plane || norm(outward + n) > kFlush) return;
      t.stays = true;
      t.station_a = spot.point;
      t.face_a = spot.face;
      t.gap_m = dot(n, x - at.place);
      t.station_b = x - t.gap_m * n;
      t.where_m = to_world(ft_, x - 0.5 * t.gap_m * n);
      break;
    }
    if (t.gap_m > reach_) return;
    t.id = make_id(Feature::corner_a, mine_.skin().group(t.face_a), 1);
    out_.push_back(t);
  }

  /// Does the normal of a touch on an edge of theirs lie between the normals of its two faces?
  bool is_between(const Touch& t, const Nearest& foot) const {
    const Mesh& mesh = theirs_.mesh();
    const Vec3 n = turn_back(ft_.rotation, t.normal);
    const auto fits = [&](int e) {
      if (!theirs_.skin().is_sharp(e)) return false;
      const Vec3 along = normalise(mesh.vertices[mesh.vertex_of(Mesh::next(e))] - mesh.vertices[mesh.vertex_of(e)]);
      if (std::abs(dot(along, t.axis_b)) < 0.99) return false;
      const Vec3 in = cross(find_normal(theirs_, e / 3, foot.place), along);
      const Vec3 out = cross(along, find_normal(theirs_, mesh.opposite[e] / 3, foot.place));
      return dot(n, in) <= kFlush && dot(n, out) <= kFlush;
    };
    for (int k = 0; k < 3; ++k) {
      if (foot.weights[(k + 2) % 3] > 1e-9) continue;
      if (fits(3 * foot.face + k)) return true;
    }
    for (int k = 0; k < 3; ++k) {
      if (foot.weights[k] < 1.0 - 1e-6) continue;
      const int start = 3 * foot.face + k;
      int e = start;
      do {
        if (fits(e)) return true;
        e = Mesh::next(mesh.opposite[e]);
      } while (e != start);
    }
    return false;
  }

  const Shape &mine_, &theirs_;
  const Frame &fm_, &ft_;
  Ground ground_;
  double reach_, sag_, bend_ = 0.0;
  std::vector<Touch>& out_;
  Mat3 rotation_{};
  Vec3 offset_{};
};

/// The same touch seen from the other body.
void turn_round(Touch& t) {
  t.normal = -1.0 * t.normal;
  std::swap(t.station_a, t.station_b);
  std::swap(t.curvature_a_per_m, t.curvature_b_per_m);
  std::swap(t.side_a, t.side_b);
  std::swap(t.axis_a, t.axis_b);
  std::swap(t.face_a, t.face_b);
  t.id ^= static_cast<std::uint64_t>(Feature::corner_a) << 56 ^ static_cast<std::uint64_t>(Feature::corner_b) << 56;
}

void cross_ridges(const Shape& a, const Frame& fa, const Shape& b, const Frame& fb, double reach, std::vector<Touch>& out) {
  const Samples &sa = a.samples(), &sb = b.samples();
  if (sa.ridges.empty() || sb.ridges.empty()) return;
  const double deepest = 0.3 * std::min(a.get_thickness_m(), b.get_thickness_m());
  const auto to_b = [&](const Vec3& x) { return to_body(fb, to_world(fa, x)); };
  const auto meet = [&](int i, int j) {
    const Ridge &ra = sa.ridges[i], &rb = sb.ridges[j];
    const Vec3 p = to_b(ra.begin), d = to_b(ra.end) - p, q = rb.begin, e = rb.end - rb.begin, r = p - q;
    const double dd = norm2(d), ee = norm2(e), de = dot(d, e), det = dd * ee - de * de;
    if (det < 1e-6 * dd * ee) return;
    const double s = (de * dot(e, r) - ee * dot(d, r)) / det, t = (dd * dot(e, r) - de * dot(d, r)) / det;
    if (s < -kEnd || s > 1.0 + kEnd || t < -kEnd || t > 1.0 + kEnd) return;
    Vec3 n = normalise(cross(d, e));
    if (dot(n, rb.into[0] + rb.into[1]) > 0.0) n = -1.0 * n;  // outward of b
    const Vec3 on_a = ra.begin + s * (ra.end - ra.begin), on_b = q + t * e, m = turn_back(fa.rotation, fb.rotation * n);
    for (const int k : {0, 1})
      if (dot(n, find_into(b, rb, k, on_b)) > kEdge || dot(m, find_into(a, ra, k, on_a)) < -kEdge) return;
    const double gap = dot(n, r + s * d - t * e);
    if (gap > reach || -gap > std::min(deepest, 0.5 * std::sqrt(std::min(dd, ee)))) return;
    Touch touch;
    touch.side_a = touch.side_b = Side::line;
    touch.normal = fb.rotation * n;
    touch.station_a = on_a;
    touch.station_b = on_b;
    touch.axis_a = ra.along;
    touch.axis_b = rb.along;
    touch.id = make_id(Feature::edges, i, j);
    touch.curvature_a_per_m = 0.5 * a.get_corner_curvature_per_m();
    touch.curvature_b_per_m = 0.5 * b.get_corner_curvature_per_m();
    const auto bends = [](const Shape& shape, const Ridge& ridge) {
      return shape.skin().kind(ridge.vertices[0]) == VertexKind::ridge || shape.skin().kind(ridge.vertices[1]) == VertexKind::ridge;
    };
    touch.smooth = bends(a, ra) || bends(b, rb);
    settle(touch, a, fa, &b, fb, reach);
    out.push_back(touch);
  };
  std::vector<std::array<int, 2>> open{{0, 0}};
  while (!open.empty()) {
    const auto [i, j] = open.back();
    open.pop_back();
    const Ball &ba = sa.ridge_tree[i], &bb = sb.ridge_tree[j];
    const double far = ba.radius_m + bb.radius_m + reach;
    if (norm2(to_b(ba.middle) - bb.middle) > far * far) continue;
    if (ba.child < 0 && bb.child < 0) {
      for (int k = ba.first; k < ba.first + ba.count; ++k)
        for (int l = bb.first; l < bb.first + bb.count; ++l) meet(k, l);
    } else if (bb.child < 0 || (ba.child >= 0 && ba.radius_m >= bb.radius_m)) {
      open.push_back({ba.child + 1, j});
      open.push_back({ba.child, j});
    } else {
      open.push_back({i, bb.child + 1});
      open.push_back({i, bb.child});
    }
  }
}

/// Renews the samples that are near where `wanted` and the way since then are beyond their reach. Returns that way.
double update_near(const Shape& a, const Frame& fa, const Shape& b, const Frame& fb, double wanted, NearSamples& near) {
  const Frame relative = calc_relative(fa, fb);
  if (near.known) {
    const double way = calc_way(near.pose, relative, a);
    if (wanted + way <= near.reach_m) return way;
  }
  near.known = true;
  near.pose = relative;
  near.reach_m = std::max(wanted, near.wanted_m) + kNear * std::min(a.get_size_m(), b.get_size_m());
  std::vector<Touch> none;
  Pass(a, fa, b, fb, 0.0, none).list(near.reach_m, near.samples[0]);
  Pass(b, fb, a, fa, 0.0, none).list(near.reach_m, near.samples[1]);
  return 0.0;
}

void find_candidates(const Shape& a, const Frame& fa, const Shape& b, const Frame& fb, double reach, NearSamples& near,
                     std::vector<Touch>& out) {
  static thread_local Distances distances_a, distances_b;
  // A body that is curved all over and not much larger than the other finds everything itself: its samples are dense enough.
  const bool a_alone = a.skin().is_all_curved() && a.get_size_m() < 2.0 * b.get_size_m();
  const bool b_alone = b.skin().is_all_curved() && b.get_size_m() < 2.0 * a.get_size_m();
  const bool a_first = a.samples().samples.size() <= b.samples().samples.size();
  const bool by_a = !b_alone || (a_alone && a_first), by_b = !a_alone || (b_alone && !a_first);
  Pass pass_a(a, fa, b, fb, reach, out), pass_b(b, fb, a, fa, reach, out);
  near.wanted_m = std::max(pass_a.find_room(), pass_b.find_room());
  const double way = update_near(a, fa, b, fb, near.wanted_m, near);
  if (by_a) pass_a.run(distances_a, near.samples[0], way);
  if (by_b) {
    const std::size_t first = out.size();
    pass_b.run(distances_b, near.samples[1], way);
    for (std::size_t i = first; i < out.size(); ++i) turn_round(out[i]);
  }
  pass_a.run_ridges();
  const std::size_t first = out.size();
  pass_b.run_ridges();
  for (std::size_t i = first; i < out.size(); ++i) turn_round(out[i]);
  cross_ridges(a, fa, b, fb, reach, out);
}

}  // namespace

Deepest find_deepest(const Shape& a, const Frame& fa, const Shape& b, const Frame& fb, double gap, PairMemory& memory) {
  Deepest found{.gap_m = gap};
  const double far = a.get_radius_m() + b.get_radius_m();
  if (norm2(to_world(fa, a.get_middle_m()) - to_world(fb, b.get_middle_m())) > far * far || (a.is_polyhedron() && b.is_polyhedron()))
    return found;
  std::vector<Touch> none;
  const double way = update_near(a, fa, b, fb, std::max(a.get_sag_m(), b.get_sag_m()), memory.near);
  const auto& [of_a, of_b] = memory.near.samples;
  found.place = Pass(a, fa, b, fb, 0.0, none).find_deepest(found.gap_m, of_a, way);
  if (const int place = Pass(b, fb, a, fa, 0.0, none).find_deepest(found.gap_m, of_b, way); place >= 0)
    found.place = place, found.is_of_a = false;
  return found;
}

Touch make_touch(const Shape& a, const Frame& fa, const Shape& b, const Frame& fb, const Deepest& at) {
  std::vector<Touch> none;
  if (at.is_of_a) return Pass(a, fa, b, fb, 0.0, none).make_touch(at.place);
  Touch t = Pass(b, fb, a, fa, 0.0, none).make_touch(at.place);
  turn_round(t);
  return t;
}

void find_touches(const Shape& a, const Frame& fa, const Shape& b, const Frame& fb, double margin, PairMemory& memory,
                  std::vector<Touch>& out) {
  out.clear();
  const double far = a.get_radius_m() + b.get_radius_m() + margin;
  if (norm2(to_world(fa, a.get_middle_m()) - to_world(fb, b.get_middle_m())) > far * far) return;
  if (a.is_polyhedron() && b.is_polyhedron()) {
    find_polyhedra_touches(a, fa, b, fb, margin, memory, out);
    return;
  }
  const Frame pose = calc_relative(fa, fb);
  if (recall(memory, pose, a, margin) && answer(a, fa, &b, fb, margin, true, memory, out)) return;
  const double size = std::min(a.get_size_m(), b.get_size_m());
  memory.known = true;
  memory.searched = pose;
  memory.reach_m = margin + choose_slack(margin, size);
  memory.candidates.clear();
  find_candidates(a, fa, b, fb, memory.reach_m, memory.near, memory.candidates);
  thin(memory.candidates, 0.02 * size, kPatch * size);
  answer(a, fa, &b, fb, margin, false, memory, out);
}

}  // namespace carillon::shape
