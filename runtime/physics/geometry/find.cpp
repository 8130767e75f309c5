// Method: convex polyhedra by clipping; other pairs by one pass in each direction (pass.hpp), then ridges against ridges. Candidates and
// near samples are cached with a slack: a distance changes by at most the relative movement of the pair.
#include <algorithm>

#include "runtime/physics/geometry/lowest.hpp"
#include "runtime/physics/geometry/pass.hpp"
#include "runtime/physics/geometry/reduce.hpp"

namespace carillon::geometry {
namespace {

constexpr double kNearMovementRatio = 0.01;  // fraction of the smaller body's size: movement for which near samples stay valid

/// Swaps the sides of a touch.
void turn_round(Touch& t) {
  t.normal = -1.0 * t.normal;
  std::swap(t.station_a, t.station_b);
  std::swap(t.curvature_a_per_m, t.curvature_b_per_m);
  std::swap(t.side_a, t.side_b);
  std::swap(t.axis_a, t.axis_b);
  std::swap(t.face_a, t.face_b);
  t.id ^= static_cast<std::uint64_t>(Feature::corner_a) << 56 ^ static_cast<std::uint64_t>(Feature::corner_b) << 56;
}

/// Updates the near samples if `wanted` and the movement since the last update exceed their reach. Returns that movement.
double update_near(const Shape& a, const Frame& fa, const Shape& b, const Frame& fb, double wanted, NearSamples& near) {
  const Frame relative = calc_relative(fa, fb);
  if (near.known) {
    const double way = calc_way(near.pose, relative, a);
    if (wanted + way <= near.reach_m) return way;
  }
  near.known = true;
  near.pose = relative;
  near.reach_m = std::max(wanted, near.wanted_m) + kNearMovementRatio * std::min(a.get_size_m(), b.get_size_m());
  std::vector<Touch> none;
  Pass(a, fa, b, fb, 0.0, none).list(near.reach_m, near.samples[0]);
  Pass(b, fb, a, fa, 0.0, none).list(near.reach_m, near.samples[1]);
  near.last = relative;
  near.gone_m = 0.0;
  for (std::size_t k : {0, 1}) {
    near.least_m[k].clear();
    for (const auto& [sample, distance] : near.samples[k]) near.least_m[k].push_back(distance - (k == 0 ? b : a).get_sag_m());
  }
  return 0.0;
}

void find_candidates(const Shape& a, const Frame& fa, const Shape& b, const Frame& fb, double reach, NearSamples& near,
                     std::vector<Touch>& out) {
  static thread_local Distances distances_a, distances_b;
  // An entirely curved body that is not much larger than the other has dense enough samples for a one-sided search.
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

/// Takes the facet above whose plane the body's lowest vertex is highest. If that vertex is inside the polyhedron and deeper than
/// found.gap_m, it becomes `found`. False: that plane separates the skin from the polyhedron, up to that gap. `pose`: of the body in
/// `other`, the polyhedron.
bool find_lowest_over(const Shape& body, const Frame& pose, const Shape& other, Deepest& found) {
  const Polyhedron& polyhedron = *other.polyhedron();
  std::pair<int, double> best{-1, -Box::kFar};
  for (std::size_t f = 0; f < polyhedron.normals.size(); ++f) {
    const Vec3& n = polyhedron.normals[f];
    const double over = dot(n, pose.position_m) - polyhedron.offsets_m[f];
    const auto [vertex, height] = body.low_vertices().find(body, turn_back(pose.rotation, n));
    if (height + over > best.second) best = {vertex, height + over};
    if (best.second - body.get_sag_m() >= found.gap_m) return false;
  }
  const double gap = SurfaceProbe(other).calc_gap(to_world(pose, body.mesh().vertices[best.first]), found.gap_m);
  if (gap < found.gap_m) found = {.place = best.first, .gap_m = gap};
  return true;
}

}  // namespace

Deepest find_deepest(const Shape& a, const Frame& fa, const Shape& b, const Frame& fb, double gap, PairMemory& memory) {
  Deepest found{.gap_m = gap};
  const double far = a.get_radius_m() + b.get_radius_m() + std::max(gap, 0.0);
  if (norm2(to_world(fa, a.get_middle_m()) - to_world(fb, b.get_middle_m())) > far * far || (a.is_polyhedron() && b.is_polyhedron()))
    return found;
  const Frame relative = calc_relative(fa, fb);
  if (a.is_polyhedron() || b.is_polyhedron()) {
    const bool is_of_a = b.is_polyhedron();
    if (!(is_of_a ? find_lowest_over(a, relative, b, found) : find_lowest_over(b, calc_relative(fb, fa), a, found))) return found;
    if (found.place >= 0) found.is_of_a = is_of_a;
  }
  std::vector<Touch> none;
  NearSamples& near = memory.near;
  update_near(a, fa, b, fb, std::max({a.get_sag_m(), b.get_sag_m(), gap}), near);
  near.gone_m += calc_way(near.last, relative, a);
  near.last = relative;
  for (const bool is_of_a : {true, false}) {
    const std::size_t k = is_of_a ? 0 : 1;
    const Pass pass = is_of_a ? Pass(a, fa, b, fb, 0.0, none) : Pass(b, fb, a, fa, 0.0, none);
    if (const int place = pass.find_deepest(found.gap_m, near.samples[k], near.gone_m, near.least_m[k]); place >= 0)
      found = {.place = place, .gap_m = found.gap_m, .is_of_a = is_of_a, .is_vertex = false};
  }
  return found;
}

Touch make_touch(const Shape& a, const Frame& fa, const Shape& b, const Frame& fb, const Deepest& at) {
  std::vector<Touch> none;
  if (at.is_of_a) return Pass(a, fa, b, fb, 0.0, none).make_touch(at.place, at.is_vertex);
  Touch t = Pass(b, fb, a, fa, 0.0, none).make_touch(at.place, at.is_vertex);
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
  if (recall(memory, pose, a, margin) && answer(a, fa, &b, fb, margin, memory, out)) return;
  const double size = std::min(a.get_size_m(), b.get_size_m());
  begin_search(memory, pose, fa, fb, margin, size);
  find_candidates(a, fa, b, fb, memory.reach_m, memory.near, memory.candidates);
  thin(memory.candidates, 0.02 * size, kPatchDistanceRatio * size);
  answer(a, fa, &b, fb, margin, memory, out);
}

}  // namespace carillon::geometry
