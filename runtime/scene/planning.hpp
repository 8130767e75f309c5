// The plan of a scene: which effects its bodies call for, from the scene and from what happens in it.
#pragma once

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

/// Choice of effects for a scene, by a selector that has judged all of its events.
struct Plan {
  effects::SceneFacts facts;
  effects::EffectSelector selector;
};

/// `events` as EventPlayback takes them.
Plan make_plan(effects::SceneFacts facts, const Events& events);

}  // namespace carillon::scene
