// Plan of a scene: the effects that its bodies need.
#pragma once

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

/// Choice of effects for a scene, by a selector that has judged all of its events.
struct Plan {
  effects::SceneFacts facts;
  effects::EffectSelector selector;
};

/// `events` as in EventPlayback.
Plan make_plan(effects::SceneFacts facts, const Events& events);

}  // namespace carillon::scene
