#include "runtime/physics/watch.hpp"

#include <algorithm>

namespace carillon::physics {
namespace {

/// Current penetration of the bodies; b: -1 for the ground.
Depth measure(const rigid::Space& space, int a, int b) {
  const rigid::Solid& solid = space.solid(a);
  const geometry::Frame frame = space.get_frame(a);
  Depth depth{.body = a, .other = b, .thickness_m = solid.shape->get_thickness_m(), .time_s = space.get_time()};
  if (b < 0) {
    depth.depth_m = -geometry::find_lowest(*solid.shape, frame, space.ground()->height_m).gap_m;
  } else {
    const geometry::Shape& other = *space.solid(b).shape;
    const geometry::Frame frame_b = space.get_frame(b);
    depth.thickness_m = std::min(depth.thickness_m, other.get_thickness_m());
    geometry::PairMemory memory;
    if (solid.shape->is_polyhedron() && other.is_polyhedron()) {
      std::vector<geometry::Touch> touches;
      geometry::find_touches(*solid.shape, frame, other, frame_b, 0.0, memory, touches);
      for (const geometry::Touch& touch : touches) depth.depth_m = std::max(depth.depth_m, -touch.gap_m);
    } else {
      depth.depth_m = -geometry::find_deepest(*solid.shape, frame, other, frame_b, 0.0, memory).gap_m;
    }
  }
  depth.depth_m = std::max(0.0, depth.depth_m);
  depth.unexplained_m = std::max(0.0, depth.depth_m - space.calc_explained_depth(a, b));
  return depth;
}

}  // namespace

void ContactWatch::Recent::add(double time_s, Bodies bodies) {
  hits.emplace_back(time_s, bodies);
  ++counts[bodies];
}

void ContactWatch::Recent::forget(double now_s) {
  for (; !hits.empty() && hits.front().first <= now_s - length_s; hits.pop_front())
    if (const auto at = counts.find(hits.front().second); --at->second == 0) counts.erase(at);
}

HitRate ContactWatch::Recent::find_worst() const {
  HitRate worst;
  for (const auto& [bodies, count] : counts)
    if (count / length_s > worst.per_s) worst = {bodies.first, bodies.second, count / length_s, hits.back().first};
  return worst;
}

void ContactWatch::keep(const Depth& depth) {
  if (depth.depth_m > deepest_.depth_m) deepest_ = depth;
  if (depth.calc_excess() > unexplained_.calc_excess()) unexplained_ = depth;
}

void ContactWatch::look_at_ground(const rigid::Space& space) {
  if (!space.ground()) return;
  for (int i = 0; i < static_cast<int>(space.states().size()); ++i)
    if (!space.is_still(i) && !space.is_absent(i)) keep(measure(space, i, -1));
}

void ContactWatch::look_at_pairs(const rigid::Space& space, const std::vector<Bodies>& pairs, bool is_start) {
  for (const auto& [a, b] : pairs)
    if (b >= 0 && (is_start || !space.is_still(a) || !space.is_still(b))) keep(measure(space, a, b));
}

void ContactWatch::add_hit(double time_s, int a, int b) {
  Bodies bodies = b < 0 ? Bodies{a, b} : Bodies{std::min(a, b), std::max(a, b)};
  for (Recent* recent : {&second_, &half_}) {
    recent->forget(time_s);
    recent->add(time_s, bodies);
  }
  const double rate = half_.counts[bodies] / half_.length_s;
  if (rate > busiest_.per_s) busiest_ = {bodies.first, bodies.second, rate, time_s};
}

ContactAudit ContactWatch::find(const rigid::Space& space) const {
  ContactAudit audit;
  audit.deepest = deepest_;
  audit.unexplained = unexplained_;
  const auto take = [&](int a, int b) {
    if (const Depth depth = measure(space, a, b); depth.depth_m > audit.now.depth_m) audit.now = depth;
  };
  for (int i = 0; space.ground() && i < static_cast<int>(space.states().size()); ++i)
    if (!space.solid(i).fixed && !space.is_absent(i)) take(i, -1);
  for (const auto& [bodies, pair] : space.pairs())
    if (bodies.second >= 0) take(bodies.first, bodies.second);
  Recent second = second_;
  second.forget(space.get_time());
  audit.hits_per_s = static_cast<double>(second.hits.size()) / second.length_s;
  audit.worst_pair = second.find_worst();
  audit.busiest = busiest_;
  const rigid::Costs& costs = space.get_costs();
  audit.pushes = costs.pushes;
  audit.ended_impacts = costs.ended_impacts;
  audit.longest_impact_s = costs.longest_impact_s;
  return audit;
}

}  // namespace carillon::physics
