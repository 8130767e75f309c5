#include "runtime/scene/effects/table.hpp"

#include <fmt/format.h>

#include <iterator>

namespace carillon::effects {

std::string format_plan(const EffectSelector& selector, const SceneFacts& facts) {
  std::string text;
  auto out = std::back_inserter(text);
  for (std::size_t i = 0; i < facts.bodies.size(); ++i) {
    const BodyPlan plan = selector.get_plan(static_cast<int>(i));
    fmt::format_to(out, "{}{}, {} modes\n", facts.bodies[i].name, facts.bodies[i].fixed ? ", fixed" : "",
                   facts.bodies[i].bank->mode_count());
    for (const Effect effect : EffectSet::all())
      fmt::format_to(out, "  {:<19} {:<5} {}\n", synth::get_name(effect), plan[effect].on ? "on" : "off", describe(plan[effect].reason));
  }
  return text;
}

base::Json make_plan_json(const EffectSelector& selector, int body) {
  base::Json json = base::Json::object();
  const BodyPlan plan = selector.get_plan(body);
  for (const Effect effect : EffectSet::all())
    json[synth::get_name(effect)].set("on", plan[effect].on).set("why", describe(plan[effect].reason));
  return json;
}

}  // namespace carillon::effects
