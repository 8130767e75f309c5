// A plan as people and programs read it.
#pragma once

#include <span>
#include <string>

#include "runtime/base/json.hpp"
#include "runtime/scene/effects/effect_selector.hpp"

namespace carillon::effects {

/// A table a body: each effect, on, off or for how long, what it costs [us of CPU per second of the scene], and why. `facts` are those of
/// the selector. Lines end in a newline.
std::string format_plan(const EffectSelector& selector, const SceneFacts& facts);

/// The plan of one body: per effect {"on_s", "switched", "predicted_us_per_s", "why"}.
base::Json make_plan_json(const EffectSelector& selector, const SceneFacts& facts, int body);

/// Changes in order of time: a list of {"time_s", "body", "effect", "on", "why"}, one for each effect; at most `max_count`.
base::Json make_changes_json(std::span<const EffectChange> changes, const SceneFacts& facts, std::size_t max_count);

}  // namespace carillon::effects
