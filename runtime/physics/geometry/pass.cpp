// Method: samples near the other body: corners and ridge points that are local minima, and samples of curved parts that are nearest among
// their neighbours; each is paired with the nearest point of the other body's mesh and settled there. Ridges against curved parts: the
// lowest point of each straight piece, and ends from which both pieces rise. The nearest point is found by walking from the grid's face,
// except for bodies with walls thinner than four cells.
// Source: C. Ericson, "Real-Time Collision Detection" (2005), 5.1.9.
#include "runtime/physics/geometry/pass.hpp"

namespace carillon::geometry {
namespace {

constexpr double kCornerOverhangRatio = 1e-4;  // fraction of the size: overhang of a corner that still rests on a face
constexpr double kHalfCurvatureBound = 4.0;    // relative to 1 / thickness: bound of half the curvature between samples

}  // namespace

Pass::Pass(const Shape& mine, const Frame& fm, const Shape& theirs, const Frame& ft, double reach, std::vector<Touch>& out)
    : mine_(mine), theirs_(theirs), fm_(fm), ft_(ft), surface_(theirs), reach_(reach), sag_(theirs.skin().get_sag_m()), out_(out) {
  const Frame relative = calc_relative(fm, ft);
  rotation_ = relative.rotation;
  offset_ = relative.position_m;
  bend_ = kHalfCurvatureBound * (1.0 / mine.get_thickness_m() + 1.0 / theirs.get_thickness_m());
}

void Pass::list(double reach_m, std::vector<std::pair<int, double>>& near) const {
  const Samples& s = mine_.samples();
  near.clear();
  for_near(
      s.sample_tree, [&](const Ball& ball) { return surface_.find_bound(to_theirs(ball.middle)) - ball.radius_m > reach_m; },
      [&](int i) {
        if (const double d = surface_.find_distance(to_theirs(s.samples[i].point), reach_m); d <= reach_m) near.emplace_back(i, d);
      });
}

void Pass::run(Distances& distances, const std::vector<std::pair<int, double>>& near, double way_m) {
  const Samples& s = mine_.samples();
  if (s.samples.empty()) return;
  distances.begin(s.samples.size());
  const double limit = reach_ + sag_ + 2.0 * s.spacing_m;
  const auto measure = [&](int i) {
    if (distances.stamps[i] != distances.stamp) {
      distances.stamps[i] = distances.stamp;
      distances.values[i] = surface_.estimate(to_theirs(s.samples[i].point), limit);
    }
    return distances.values[i];
  };
  std::vector<std::pair<double, int>> pits;
  for (const auto& [i, before] : near) {
    const Sample& sample = s.samples[i];
    const double within = reach_ + sag_ + (sample.kind == VertexKind::smooth ? calc_room(sample.reach_m) : 0.0);
    if (before - way_m > within) continue;
    if (way_m == 0.0 && !surface_.is_thin()) {  // just estimated
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
      nearest = fall >= 0.0 || fall * fall <= kFlatPatchSlope * kFlatPatchSlope * step2;
    }
    if (nearest) pits.emplace_back(d, i);
  }
  // Neighbours of a sample that settled lower would converge to the same point.
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

int Pass::find_deepest(double& gap_m, const std::vector<std::pair<int, double>>& near, double gone_m, std::vector<double>& least_m) const {
  int deepest = -1;
  for (std::size_t n = 0; n < near.size(); ++n) {
    if (least_m[n] - gone_m >= gap_m) continue;
    const double d = surface_.calc_gap(to_theirs(mine_.samples().samples[near[n].first].point), gap_m);
    least_m[n] = d + gone_m;
    if (d < gap_m) gap_m = d, deepest = near[n].first;
  }
  return deepest;
}

void Pass::run_ridges() {
  const Samples& s = mine_.samples();
  if (theirs_.is_polyhedron()) return;
  std::vector<int> ends;
  for_near(
      s.ridge_tree, [&](const Ball& ball) { return surface_.find_bound(to_theirs(ball.middle)) - ball.radius_m > reach_ + sag_; },
      [&](int i) {
        if (const int end = add_ridge(i); end >= 0) ends.push_back(end);
      });
  std::sort(ends.begin(), ends.end());
  for (std::size_t i = 1; i < ends.size(); ++i)
    if (ends[i] == ends[i - 1] && (i < 2 || ends[i] != ends[i - 2])) add_end(ends[i]);
}

Touch Pass::make_touch(int place, bool is_vertex) const {
  const Skin& skin = mine_.skin();
  const Sample sample =
      is_vertex ? Sample{.point = mine_.mesh().vertices[place], .kind = skin.kind(place), .vertex = place, .face = skin.find_face(place)}
                : mine_.samples().samples[place];
  const Nearest at = surface_.find_nearest(to_theirs(sample.point));
  const Mesh& mesh = theirs_.mesh();
  const bool is_curved = !theirs_.skin().is_flat(at.face);
  Touch t = begin(sample.point, at.place, is_curved ? theirs_.skin().calc_normal(at.face, at.weights) : mesh.normals[at.face]);
  t.axis_b = mesh.normals[at.face];
  if (is_curved) t.side_b = Side::skin, t.face_b = at.face, t.smooth = true;
  t.curvature_a_per_m = get_sharp_curvature(mine_, sample.kind);
  t.rim_m = mine_.skin().calc_rim_radius_m(sample.vertex);
  if (sample.kind == VertexKind::smooth) {
    const Spot spot = skin.locate(sample.point, sample.face);
    t.curvature_a_per_m = skin.calc_mean_curvature(spot.face, spot.weights);
  }
  settle(t, mine_, fm_, &theirs_, ft_, mine_.samples().spacing_m, kSearchIterations);
  t.id = make_id(Feature::corner_a, place, is_vertex ? kMissedVertexId : kMissedTouchId);
  return t;
}

Touch Pass::begin(const Vec3& station, const Vec3& theirs, const Vec3& normal) const {
  Touch t;
  t.station_a = station;
  t.station_b = theirs;
  t.normal = ft_.rotation * normal;
  return t;
}

void Pass::add_point(const Sample& sample) {
  const Vec3 x = to_theirs(sample.point);
  const Mesh& mesh = theirs_.mesh();
  const Nearest at = surface_.find_nearest(x);
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
      found = settle(t, mine_, fm_, &theirs_, ft_, 0.05 * mine_.get_size_m(), kSearchIterations);
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
  t.rim_m = mine_.skin().calc_rim_radius_m(sample.vertex);
  t.id = make_id(Feature::corner_a, sample.vertex, 0);
  if (t.gap_m <= reach_) out_.push_back(t);
}

std::optional<Touch> Pass::begin_ridge(const Vec3& point) const {
  const Nearest at = surface_.find_nearest(to_theirs(point));
  if (theirs_.skin().is_flat(at.face)) return std::nullopt;
  Touch t = begin(point, at.place, theirs_.skin().calc_normal(at.face, at.weights));
  t.side_b = Side::skin;
  t.face_b = at.face;
  t.smooth = true;
  t.curvature_a_per_m = get_sharp_curvature(mine_, VertexKind::ridge);
  return t;
}

int Pass::add_ridge(int ridge) {
  const Ridge& r = mine_.samples().ridges[ridge];
  const double length = norm(r.end - r.begin);
  double least = reach_ + sag_ + 0.25 * length;
  Vec3 lowest{};
  bool found = false;
  for (const double part : {0.0, 0.5, 1.0}) {
    const Vec3 x = r.begin + part * (r.end - r.begin);
    const double d = surface_.estimate(to_theirs(x), least);
    if (d < least) least = d, lowest = x, found = true;
  }
  if (!found) return -1;
  std::optional<Touch> t = begin_ridge(lowest);
  if (!t) return -1;
  t->side_a = Side::line;
  t->axis_a = r.along;
  const bool settled = settle(*t, mine_, fm_, &theirs_, ft_, length, kSearchIterations);
  const double at = dot(t->station_a - r.begin, r.along);
  if (at < 0.0) return r.vertices[0];
  if (at > length) return r.vertices[1];
  const Vec3 n = turn_back(fm_.rotation, t->normal);
  for (const int k : {0, 1})
    if (dot(n, find_into(mine_, r, k, t->station_a)) < -kParallelSlope) return -1;
  t->id = make_id(Feature::corner_a, ridge, 3);
  if (settled && t->gap_m <= reach_) out_.push_back(*t);
  return -1;
}

void Pass::add_end(int vertex) {
  std::optional<Touch> t = begin_ridge(mine_.mesh().vertices[vertex]);
  if (!t || !settle(*t, mine_, fm_, &theirs_, ft_, 0.05 * mine_.get_size_m(), kSearchIterations) || t->gap_m > reach_) return;
  t->id = make_id(Feature::corner_a, vertex, 0);
  t->rim_m = mine_.skin().calc_rim_radius_m(vertex);
  out_.push_back(*t);
}

bool Pass::find_brim(const Sample& sample, const Vec3& x, double d, Touch& t) const {
  const Mesh& mesh = theirs_.mesh();
  const double brim = kCornerOverhangRatio * std::min(mine_.get_size_m(), theirs_.get_size_m());
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

bool Pass::add_rim(const Sample& sample, Touch t) {
  const double reach = kWalk * std::max(1.5 * sample.reach_m, 2.0 * mine_.samples().spacing_m);
  const double brim = kCornerOverhangRatio * std::min(mine_.get_size_m(), theirs_.get_size_m());
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
  settle(t, mine_, fm_, &theirs_, ft_, reach);  // centres the spring at the current point
  return add(t);
}

void Pass::add_smooth(const Sample& sample) {
  constexpr int kMax = 4;  // facets tried
  const Mesh& mesh = theirs_.mesh();
  const double reach = std::max(1.5 * sample.reach_m, 2.0 * mine_.samples().spacing_m), brim = kCornerOverhangRatio * mine_.get_size_m();
  Spot spot = mine_.skin().locate(sample.point, sample.face);
  const Vec3 x = to_theirs(spot.point);
  Nearest at = surface_.find_nearest(x);
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
    bool settled = settle(t, mine_, fm_, &theirs_, ft_, facing.side == Side::plane ? kWalk * reach : reach, kSearchIterations);
    if (settled && facing.side == Side::plane && is_level(t, mine_, fm_, &theirs_, ft_)) {
      t = before;
      t.stays = true;
      settled = settle(t, mine_, fm_, &theirs_, ft_, kWalk * reach);
    }
    if (settled && facing.side == Side::plane) settle(t, mine_, fm_, &theirs_, ft_, reach);
    if (facing.side == Side::plane || facing.side == Side::line) {
      const Nearest foot = mesh.find_nearest(t.station_b, Box::kFar, at.face);
      if (foot.distance2 > brim * brim || (facing.side == Side::line && !is_between(t, foot))) {
        // Past the facet or the edge: continue on its neighbour.
        at = foot;
        if (facing.side == Side::line && foot.distance2 <= brim * brim) {
          at = surface_.find_nearest(to_theirs(t.station_a));
          const Facing other = describe(mesh, theirs_.skin(), at);
          if (other.side == Side::line && std::abs(dot(other.axis, facing.axis)) > 0.99) return;
        }
        facing = describe(mesh, theirs_.skin(), at);
        if (i + 1 == kMax) return;
        continue;
      }
    }
    if (facing.side == Side::point) {
      const Nearest other = surface_.find_nearest(to_theirs(t.station_a));
      const Facing beyond = describe(mesh, theirs_.skin(), other);
      if (beyond.side != Side::point && i + 1 < kMax) {
        at = other;
        facing = beyond;
        spot = mine_.skin().locate(t.station_a, t.face_a);
        continue;
      }
    }
    if (settled) break;
    // Still descending at the end of the reach: belongs to another sample, unless nearly parallel.
    const Vec3 outward = rotation_ * mine_.skin().calc_normal(spot.face, spot.weights);
    if (facing.side != Side::plane || norm(outward + n) > kParallelSlope) return;
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

bool Pass::is_between(const Touch& t, const Nearest& foot) const {
  const Mesh& mesh = theirs_.mesh();
  const Vec3 n = turn_back(ft_.rotation, t.normal);
  const auto fits = [&](int e) {
    if (!theirs_.skin().is_sharp(e)) return false;
    const Vec3 along = normalise(mesh.vertices[mesh.vertex_of(Mesh::next(e))] - mesh.vertices[mesh.vertex_of(e)]);
    if (std::abs(dot(along, t.axis_b)) < 0.99) return false;
    const Vec3 in = cross(find_normal(theirs_, e / 3, foot.place), along);
    const Vec3 out = cross(along, find_normal(theirs_, mesh.opposite[e] / 3, foot.place));
    return dot(n, in) <= kParallelSlope && dot(n, out) <= kParallelSlope;
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

}  // namespace carillon::geometry
