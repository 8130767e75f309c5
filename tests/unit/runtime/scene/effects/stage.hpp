// Scenes of an EffectSelector: a struck cube in front of two ears.
#pragma once

#include <limits>
#include <vector>

#include "runtime/scene/effects/effect_selector.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::effects {

using testing::make_cube_bank;

inline constexpr double kC = 343.0;

/// A fixed cube of 10 cm, 2 m in front of two ears.
struct Stage {
  bank::Bank bank = make_cube_bank({{1000.0, 20.0, 0.05}});
  SceneFacts facts;

  Stage() {
    facts.duration_s = 4.0;
    facts.microphones_m = {{-0.1, 0.0, 0.0}, {0.1, 0.0, 0.0}};
    facts.bodies.push_back({.name = "cube", .bank = &bank, .fixed = true, .struck = true, .position_m = {0.4, 2.0, 0.0}});
    facts.moves = false;
  }
  BodyFacts& body() { return facts.bodies[0]; }
};

inline events::Impulse make_strike(double time_s, double impulse_n_s, double duration_s = 0.0) {
  return {.time_s = time_s, .triangle = 3, .impulse_n_s = {0, 0, impulse_n_s}, .duration_s = duration_s};
}

/// Effects of the body after these events.
inline EffectSet play(const SceneFacts& facts, const std::vector<events::Event>& events) {
  EffectSelector selector(facts);
  for (const events::Event& event : events) selector.watch(event);
  selector.advance(std::numeric_limits<double>::infinity());
  return selector.choose(0);
}

}  // namespace carillon::effects
