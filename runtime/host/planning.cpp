#include "runtime/host/planning.hpp"

#include <algorithm>
#include <limits>

#include "runtime/host/pose.hpp"

namespace carillon::host {

plan::SceneFacts make_facts(const Scene& scene, const Microphones& microphones, bool moves) {
  plan::SceneFacts facts;
  facts.rate_hz = scene.sample_rate_hz;
  facts.duration_s = scene.duration_s;
  facts.microphones_m = microphones.offset_m;
  facts.moves = moves;
  facts.strictness = scene.quality.planner;
  if (scene.microphones_m.empty()) {
    facts.listener = scene.listener.path;
    if (facts.listener.empty()) facts.listener.push_back({0.0, scene.listener.position_m});
  }
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const SceneBody& body = scene.bodies[i];
    const bool struck =
        std::any_of(scene.strikes.begin(), scene.strikes.end(), [i](const SceneStrike& strike) { return strike.body == i; });
    facts.bodies.push_back({.name = body.name,
                            .bank = body.spec.bank,
                            .fixed = body.spec.fixed,
                            .struck = struck,
                            .position_m = calc_world_point(body.spec.initial, body.spec.bank->rigid.centre_m),
                            .wish = body.wish});
  }
  return facts;
}

Plan make_plan(plan::SceneFacts facts, std::span<const stream::Event> events, const plan::Costs& costs) {
  plan::Planner planner(facts, costs);
  for (const stream::Event& event : events) planner.watch(event);
  std::vector<plan::Change> changes = planner.advance(std::numeric_limits<double>::infinity());
  return {std::move(facts), std::move(planner), std::move(changes)};
}

}  // namespace carillon::host
