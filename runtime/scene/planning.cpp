#include "runtime/scene/planning.hpp"

#include <algorithm>
#include <limits>
#include <optional>

#include "runtime/base/chance.hpp"
#include "runtime/scene/pose.hpp"
#include "runtime/synth/pulse.hpp"

namespace carillon::scene {

synth::ContactSurface make_surface(const SceneBody& body) {
  return {.roughness_m = body.spec.roughness_m, .friction = body.spec.friction, .seed = base::hash_name(body.name)};
}

synth::ContactSurface make_ground(const Scene& scene) {
  synth::ContactSurface surface = synth::kGroundSurface;
  if (!scene.ground) return surface;
  surface.roughness_m = scene.ground->roughness_m;
  surface.friction = scene.ground->friction;
  surface.modulus_pa = scene.ground->young_modulus_pa / (1.0 - scene.ground->poisson_ratio * scene.ground->poisson_ratio);
  surface.wave_impedance_pa_s_m = bank::calc_wave_impedance({.young_modulus_pa = scene.ground->young_modulus_pa,
                                                             .poisson_ratio = scene.ground->poisson_ratio,
                                                             .density_kg_m3 = scene.ground->density_kg_m3});
  return surface;
}

effects::SceneFacts make_facts(const Scene& scene, const Microphones& microphones, bool moves) {
  effects::SceneFacts facts;
  facts.rate_hz = scene.sample_rate_hz;
  facts.duration_s = scene.duration_s;
  facts.microphones_m = microphones.offset_m;
  facts.moves = moves;
  facts.thresholds = scene.quality.thresholds;
  facts.ground = make_ground(scene);
  facts.floor = find_floor(scene);
  facts.has_head = has_head(scene);
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
                            .sphere_radius_m = body.sphere_radius_m,
                            .transfers = body.transfers,
                            .fixed = body.spec.fixed,
                            .struck = struck,
                            .position_m = calc_world_point(body.spec.initial, body.spec.bank->rigid.centre_m),
                            .overrides = body.overrides,
                            .surface = make_surface(body)});
  }
  return facts;
}

Plan make_plan(effects::SceneFacts facts, const Events& events) {
  // Events are judged once no earlier one can follow: a strike begins half its pulse, and the travel time of its click across the body,
  // before its time.
  constexpr double kDisorderS = 1.0;  // EventPlayback
  constexpr double kLargestCrossingS = 1.0;
  constexpr double kEveryS = 0.1;
  double longest_s = 0.0;
  std::optional<events::Event> first_listener;
  events.for_each([&](const events::Event& event) {
    if (!first_listener && std::holds_alternative<events::Listener>(event)) first_listener = event;
    const auto* impulse = std::get_if<events::Impulse>(&event);
    if (impulse == nullptr || events::find_fault(event) != nullptr) return;
    longest_s = std::max(longest_s, 0.5 * synth::calc_pulse_length(impulse->shape, impulse->duration_s));
  });
  const double behind_s = longest_s + kDisorderS + kLargestCrossingS;
  Plan plan{.facts = facts, .selector = effects::EffectSelector(std::move(facts))};
  if (first_listener) plan.selector.watch(*first_listener);  // from the beginning the listener counts as moving
  double decided_s = 0.0;
  events.for_each([&](const events::Event& event) {
    if (first_listener && std::holds_alternative<events::Listener>(event))
      first_listener.reset();  // already seen
    else
      plan.selector.watch(event);
    const double known_s = events::get_time_s(event) - behind_s;
    if (!(known_s > decided_s + kEveryS)) return;
    plan.selector.advance(known_s);
    decided_s = known_s;
  });
  plan.selector.advance(std::numeric_limits<double>::infinity());
  return plan;
}

}  // namespace carillon::scene
