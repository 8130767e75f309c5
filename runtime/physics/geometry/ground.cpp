// Method: corners of a polyhedron by height; for other bodies the samples within the margin that are local minima, each moved to the lowest
// point of the skin around it.
#include "runtime/physics/geometry/mesh.hpp"
#include "runtime/physics/geometry/polyhedron.hpp"
#include "runtime/physics/geometry/reduce.hpp"
#include "runtime/physics/geometry/search.hpp"
#include "runtime/physics/geometry/skin.hpp"

namespace carillon::geometry {
namespace {

constexpr double kMaxDownNormal = -0.7;  // vertical component of the normal of a facet whose corners may all touch the ground

Touch make_ground_touch(const Shape& a, const Frame& fa, const Vec3& x, double height) {
  Touch t;
  t.station_a = x;
  t.normal = {0, 0, 1};
  t.axis_b = {0, 0, 1};
  const Vec3 at = to_world(fa, x);
  t.station_b = {at[0], at[1], height};
  t.gap_m = at[2] - height;
  t.where_m = {at[0], at[1], 0.5 * (at[2] + height)};
  t.curvature_a_per_m = a.get_corner_curvature_per_m();
  return t;
}

/// True if no neighbour of the sample is lower.
bool is_lowest(const Shape& a, const Sample& sample, const Vec3& up) {
  if (sample.kind != VertexKind::smooth) return carries(a.mesh(), sample.vertex, up);
  const Samples& s = a.samples();
  const double h = dot(up, sample.point);
  for (int k = 0; k < sample.neighbours; ++k) {
    const Vec3& x = s.samples[s.neighbours[sample.first_neighbour + k]].point;
    if (dot(up, x) - h < -kFlatPatchSlope * norm(x - sample.point)) return false;
  }
  return true;
}

/// Touches of a sample: at the sample, or at the lowest point of the skin around it.
void add_candidates(const Shape& a, const Frame& fa, double height, double margin, const Sample& sample, std::vector<Touch>& out) {
  Touch t = make_ground_touch(a, fa, sample.point, height);
  t.id = make_id(Feature::corner_a, sample.vertex, 0);
  if (sample.kind != VertexKind::corner && !a.skin().is_flat(sample.face)) {
    t.side_a = Side::skin;
    t.face_a = sample.face;
    t.smooth = true;
    const double reach = kWalk * std::max(1.5 * sample.reach_m, 2.0 * a.samples().spacing_m);
    Touch before = t;
    before.stays = true;
    bool settled = settle(t, a, fa, nullptr, fa, reach);
    if (settled && is_level(t, a, fa, nullptr, fa)) {
      t = before;
      settled = settle(t, a, fa, nullptr, fa, reach);
    } else if (norm(t.station_a - sample.point) > kGuard * a.get_size_m() && settle(before, a, fa, nullptr, fa, reach) &&
               before.gap_m <= margin) {
      out.push_back(before);
    }
    if (settled) {
      settle(t, a, fa, nullptr, fa, reach);  // centres the spring at the current point
    } else {
      // Still descending at the end of the reach: belongs to another sample, unless the skin is nearly parallel to the ground.
      t = before;
      settle(t, a, fa, nullptr, fa, reach);
      const Spot spot = a.skin().locate(t.station_a, t.face_a);
      if (norm(a.skin().calc_normal(spot.face, spot.weights) + fa.rotation[2]) > kParallelSlope) return;
    }
  }
  if (t.gap_m <= margin) out.push_back(t);
}

void find_candidates(const Shape& a, const Frame& fa, double height, double margin, std::vector<Touch>& out) {
  const Samples& s = a.samples();
  const Vec3& up = fa.rotation[2];  // world axis in the frame of a
  const double below = height + margin - fa.position_m[2];
  for_near(
      s.sample_tree, [&](const Ball& ball) { return dot(up, ball.middle) - ball.radius_m > below; },
      [&](int i) {
        const Sample& sample = s.samples[i];
        if (dot(up, sample.point) - sample.reach_m <= below && is_lowest(a, sample, up)) add_candidates(a, fa, height, margin, sample, out);
      });
}

}  // namespace

Touch make_ground_touch(const Shape& a, const Frame& fa, double height, int vertex) {
  Touch t = make_ground_touch(a, fa, a.mesh().vertices[vertex], height);
  t.id = make_id(Feature::corner_a, vertex, a.is_polyhedron() ? 0 : kMissedTouchId);
  t.curvature_a_per_m = calc_vertex_curvature(a, vertex);
  return t;
}

bool carries(const Mesh& mesh, int vertex, const Vec3& normal) {
  const int start = mesh.any_half_edge[vertex];
  int e = start;
  do {
    const Vec3 d = mesh.vertices[mesh.vertex_of(Mesh::next(e))] - mesh.vertices[vertex];
    const double h = dot(d, normal);
    if (h < 0.0 && h * h > kFlatPatchSlope * kFlatPatchSlope * norm2(d)) return false;
    e = Mesh::next(mesh.opposite[e]);
  } while (e != start);
  return true;
}

Frame calc_relative(const Frame& a, const Frame& b) {
  Frame relative{.rotation = {}, .position_m = to_body(b, a.position_m)};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) relative.rotation[i][j] += b.rotation[k][i] * a.rotation[k][j];
  return relative;
}

double calc_way(const Frame& from, const Frame& to, const Shape& a) {
  double turned = 0.0;
  Vec3 moved = to.position_m - from.position_m, swept{};  // of the centre; upper bound for the corners of the bounding box
  const Vec3 half = 0.5 * (a.mesh().box.high - a.mesh().box.low);
  for (int i = 0; i < 3; ++i) {
    const Vec3 row = to.rotation[i] - from.rotation[i];
    turned += norm2(row);
    moved[i] += dot(row, a.get_middle_m());
    for (int k = 0; k < 3; ++k) swept[i] += std::abs(row[k]) * (half[k] + a.skin().get_sag_m());
  }
  return norm(moved) + std::min(std::sqrt(turned) * a.get_radius_m(), norm(swept));
}

void begin_search(PairMemory& memory, const Frame& pose, const Frame& fa, const Frame& fb, double margin, double size) {
  memory.known = true;
  memory.searched = pose;
  memory.a = fa;
  memory.b = fb;
  memory.reach_m = margin + choose_slack(margin, size);
  memory.candidates.clear();
  memory.are_followed = false;
}

bool recall(const PairMemory& memory, const Frame& pose, const Shape& a, double margin) {
  return memory.known && margin + calc_way(memory.searched, pose, a) <= memory.reach_m;
}

void thin(std::vector<Touch>& touches, double spacing, double patch) {
  std::vector<Touch> apart;
  for (const Touch& t : touches) {
    bool same = false;
    for (Touch& other : apart) {
      if (t.smooth || other.smooth) {
        if (norm2(t.where_m - other.where_m) > 0.09 * spacing * spacing || dot(t.normal, other.normal) < 0.9) continue;
      } else if (t.id != other.id) {
        continue;
      }
      same = true;
      if (t.gap_m < other.gap_m) other = t;
      break;
    }
    if (!same) apart.push_back(t);
  }
  touches.swap(apart);
  reduce(touches, patch);
}

bool answer(const Shape& a, const Frame& fa, const Shape* b, const Frame& fb, double margin, PairMemory& memory, std::vector<Touch>& out) {
  const bool moved = memory.are_followed || memory.a != fa || memory.b != fb;
  memory.are_followed = moved;
  const double size = b != nullptr ? std::min(a.get_size_m(), b->get_size_m()) : a.get_size_m();
  for (Touch& candidate : memory.candidates) {
    if (moved && !follow(candidate, a, fa, b, fb, 0.1 * size)) return out.clear(), false;
    out.push_back(candidate);
    if (out.back().gap_m > margin) out.pop_back();
  }
  if (moved) thin(out, 0.02 * size, kPatchDistanceRatio * size);
  name(out, 0.1 * size, memory);
  return true;
}

void find_ground_touches(const Shape& a, const Frame& fa, double height, double margin, PairMemory& memory, std::vector<Touch>& out,
                         bool with_all) {
  out.clear();
  if (to_world(fa, a.get_middle_m())[2] - a.get_radius_m() > height + margin) return;
  if (const Polyhedron* body = a.polyhedron()) {
    std::vector<char> faces_down;
    if (with_all) faces_down.assign(body->corners.size(), 0);
    for (std::size_t f = 0; f < body->loops.size() && with_all; ++f)
      if (dot(fa.rotation[2], body->normals[f]) < kMaxDownNormal)
        for (const int c : body->loops[f]) faces_down[c] = 1;
    for (std::size_t c = 0; c < body->corners.size(); ++c) {
      const double h = dot(fa.rotation[2], body->corners[c]) + fa.position_m[2] - height;
      if (h > margin || (!(with_all && faces_down[c] != 0) && !carries(a.mesh(), body->corner_vertices[c], fa.rotation[2]))) continue;
      out.push_back(make_ground_touch(a, fa, body->corners[c], height));
      out.back().id = make_id(Feature::corner_a, body->corner_vertices[c], 0);
    }
    reduce(out, Box::kFar);
    return;
  }
  // Horizontal translation and yaw change stations only.
  const Frame pose{{Vec3{}, Vec3{}, fa.rotation[2]}, {0.0, 0.0, fa.position_m[2] - height}};
  if (recall(memory, pose, a, margin) && answer(a, fa, nullptr, fa, margin, memory, out)) return;
  begin_search(memory, pose, fa, fa, margin, a.get_size_m());
  find_candidates(a, fa, height, memory.reach_m, memory.candidates);
  thin(memory.candidates, a.samples().spacing_m, kPatchDistanceRatio * a.get_size_m());
  answer(a, fa, nullptr, fa, margin, memory, out);
}

}  // namespace carillon::geometry
