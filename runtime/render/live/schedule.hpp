// Effects planned ahead of time.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include "runtime/scene/effects/effect_selector.hpp"
#include "runtime/synth/effects.hpp"

namespace carillon::live {

/// Planned effects of the bodies over time. A body has all effects planned within a period, so that they exist before the events and remain
/// until the last of them is heard.
class Schedule {
 public:
  explicit Schedule(std::size_t bodies) : of_(bodies) {}

  void add(const effects::EffectChange& change) { of_[change.body].steps.push_back({change.time_s, change.effects}); }

  /// Calls `set(body, effects)` for each body whose effects between `now_s` and `until_s` differ from those set last.
  template <typename Set>
  void apply(double now_s, double until_s, Set&& set) {
    for (std::size_t body = 0; body < of_.size(); ++body) {
      auto& [steps, given] = of_[body];
      while (steps.size() > 1 && steps[1].time_s <= now_s) steps.pop_front();
      synth::EffectSet wanted;
      for (std::size_t n = 0; n < steps.size() && (n == 0 || steps[n].time_s <= until_s); ++n) wanted = wanted.with(steps[n].effects);
      if (steps.empty() || wanted == given) continue;
      given = wanted;
      set(body, wanted);
    }
  }

 private:
  struct Step {
    double time_s = 0.0;
    synth::EffectSet effects;
  };
  struct OfBody {
    std::deque<Step> steps;  // the first one is in force
    std::optional<synth::EffectSet> given;
  };
  std::vector<OfBody> of_;
};

}  // namespace carillon::live
