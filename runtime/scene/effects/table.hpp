// Choice of effects as text and as JSON.
#pragma once

#include <string>

#include "runtime/base/json.hpp"
#include "runtime/scene/effects/effect_selector.hpp"

namespace carillon::effects {

/// A table per body: each effect, on or off, and why. `facts` are those of the selector.
std::string format_plan(const EffectSelector& selector, const SceneFacts& facts);

/// Plan of one body: per effect {"on", "why"}.
base::Json make_plan_json(const EffectSelector& selector, int body);

}  // namespace carillon::effects
