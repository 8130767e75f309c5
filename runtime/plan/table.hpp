// A plan as people and programs read it.
#pragma once

#include <span>
#include <string>

#include "runtime/plan/planner.hpp"

namespace carillon::plan {

/// A table a body: each effect, on, off or for how long, what it costs [us of CPU per second of the scene], and why. `facts` are those of
/// the planner. Lines end in a newline.
std::string format_plan(const Planner& planner, const SceneFacts& facts);

/// The plan of one body as a JSON object: per effect "on_s", "switched", "predicted_us_per_s", "why", and `more`: further members of its
/// object, as JSON text.
using MoreJson = synth::PerEffect<std::string>;
std::string make_plan_json(const Planner& planner, const SceneFacts& facts, int body, const MoreJson& more = {});

/// Changes as a JSON list, in order of time: {"time_s", "body", "effect", "on", "why"}, one an effect; at most `most`.
std::string make_changes_json(std::span<const Change> changes, const SceneFacts& facts, std::size_t most);

}  // namespace carillon::plan
