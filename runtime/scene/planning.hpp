// Plan of a scene: the effects that its bodies need.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/base/spool.hpp"
#include "runtime/events/events.hpp"
#include "runtime/scene/effects/effect_selector.hpp"
#include "runtime/scene/events.hpp"
#include "runtime/scene/microphones.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::scene {

/// Contact surfaces of a body and of the ground. The seed of a body's roughness profile comes from its name, so it does not depend on other
/// bodies.
synth::ContactSurface make_surface(const SceneBody& body);
synth::ContactSurface make_ground(const Scene& scene);

/// Facts known before the simulation. Every body's spec has its bank, and the scene outlives the result. `moves`: bodies that are not fixed
/// may move.
effects::SceneFacts make_facts(const Scene& scene, const Microphones& microphones, bool moves);

/// Effects of a body from this time on.
struct PlanStep {
  double time_s = 0.0;
  std::int32_t body = 0;
  synth::EffectSet effects;
};

/// A selector that has seen all events of a scene, and its decisions.
struct Plan {
  effects::SceneFacts facts;
  effects::EffectSelector selector;
  base::Records<PlanStep> steps{};               // in order of time; the first of every body at 0
  std::vector<effects::EffectChange> changes{};  // the same with reasons, at most kMaxReported
};
inline constexpr std::size_t kMaxReported = 10000;  // listed changes

/// `events` as in EventPlayback.
Plan make_plan(effects::SceneFacts facts, const Events& events, const effects::Costs& costs);

}  // namespace carillon::scene
