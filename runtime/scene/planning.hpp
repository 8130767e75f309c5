// The plan of a scene: which effects its bodies call for, from the scene and from what happens in it.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/base/spool.hpp"
#include "runtime/scene/effects/effect_selector.hpp"
#include "runtime/events/events.hpp"
#include "runtime/scene/events.hpp"
#include "runtime/scene/microphones.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::scene {

/// A body and the ground as those feel them who slide on them. The seed of a body's surface comes from its name: other bodies of the scene
/// change nothing of it.
synth::ContactSurface make_surface(const SceneBody& body);
synth::ContactSurface make_ground(const Scene& scene);

/// What is known before anything moves. Every body's spec has its bank, and the scene outlives the result. `moves`: bodies that are not
/// fixed may move.
effects::SceneFacts make_facts(const Scene& scene, const Microphones& microphones, bool moves);

/// From that time on a body has these effects.
struct PlanStep {
  double time_s = 0.0;
  std::int32_t body = 0;
  synth::EffectSet effects;
};

/// A selector that has seen all of a scene, and what it decided.
struct Plan {
  effects::SceneFacts facts;
  effects::EffectSelector selector;
  base::Records<PlanStep> steps{};                        // in order of time; the first of every body at 0
  std::vector<effects::EffectChange> changes{};  // the same with reasons, as many as a report lists
};
inline constexpr std::size_t kMaxReported = 10000;  // switches of effects

/// `events` as EventPlayback takes them.
Plan make_plan(effects::SceneFacts facts, const Events& events, const effects::Costs& costs);

}  // namespace carillon::scene
