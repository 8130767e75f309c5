#include "runtime/host/planning.hpp"

#include <algorithm>
#include <limits>

#include "runtime/host/pose.hpp"

namespace carillon::host {

synth::Surface make_surface(const SceneBody& body) {
  // FNV-1a (Fowler, Noll and Vo 1991).
  std::uint64_t seed = 0xcbf29ce484222325U;
  for (const char c : body.name) seed = (seed ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
  return {.roughness_m = body.spec.roughness_m, .friction = body.spec.friction, .seed = seed};
}

synth::Surface make_ground(const Scene& scene) {
  synth::Surface surface = synth::kGroundSurface;
  if (!scene.ground) return surface;
  surface.roughness_m = scene.ground->roughness_m;
  surface.friction = scene.ground->friction;
  surface.modulus_pa = scene.ground->young_modulus_pa / (1.0 - scene.ground->poisson_ratio * scene.ground->poisson_ratio);
  return surface;
}

plan::SceneFacts make_facts(const Scene& scene, const Microphones& microphones, bool moves) {
  plan::SceneFacts facts;
  facts.rate_hz = scene.sample_rate_hz;
  facts.duration_s = scene.duration_s;
  facts.microphones_m = microphones.offset_m;
  facts.moves = moves;
  facts.strictness = scene.quality.planner;
  facts.ground = make_ground(scene);
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
                            .wish = body.wish,
                            .surface = make_surface(body)});
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
