#include "runtime/scene/effects/table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

namespace carillon::effects {
namespace {

double find_duration(const EffectSelector& selector, const SceneFacts& facts) {
  return std::max(std::min(facts.duration_s, selector.get_time_s()), 1e-9);
}

std::string describe_time(const EffectPlan& plan, double duration_s) {
  if (!plan.ever) return "off";
  if (plan.switched == 1 && plan.on_s >= duration_s - 1.5 * kTickS) return "on";
  if (plan.switched == 1) return fmt::format("on {:.2f} - {:.2f} s", plan.first_s, plan.last_s);
  return fmt::format("on {:.0f} % of the time", 100.0 * plan.on_s / duration_s);
}

}  // namespace

std::string format_plan(const EffectSelector& selector, const SceneFacts& facts) {
  std::string text;
  auto out = std::back_inserter(text);
  const double duration = find_duration(selector, facts);
  double all = 0.0;
  for (std::size_t i = 0; i < facts.bodies.size(); ++i) {
    const BodyPlan plan = selector.get_plan(static_cast<int>(i));
    double total = 0.0;
    for (const EffectPlan& effect : plan.effects) total += effect.cost_us / duration;
    fmt::format_to(out, "{}{}, {} modes: {:.0f} us of CPU per second\n", facts.bodies[i].name, facts.bodies[i].fixed ? ", fixed" : "",
                   facts.bodies[i].bank->mode_count(), total);
    all += total;
    for (const Effect effect : EffectSet::all()) {
      const EffectPlan& of = plan[effect];
      fmt::format_to(out, "  {:<19} {:<21} {:>7.1f} us/s  {}\n", synth::get_name(effect), describe_time(of, duration),
                     of.cost_us / duration, describe(of.reason));
    }
  }
  fmt::format_to(out, "all bodies: {:.0f} us of CPU per second predicted, {:.3f} % of a core\n", all, 1e-4 * all);
  return text;
}

base::Json make_plan_json(const EffectSelector& selector, const SceneFacts& facts, int body) {
  base::Json json = base::Json::object();
  const double duration = find_duration(selector, facts);
  const BodyPlan plan = selector.get_plan(body);
  for (const Effect effect : EffectSet::all()) {
    const EffectPlan& of = plan[effect];
    json[synth::get_name(effect)]
        .set("on_s", base::decimals(of.on_s, 3))
        .set("switched", of.switched)
        .set("predicted_us_per_s", base::significant(of.cost_us / duration, 4))
        .set("why", describe(of.reason));
  }
  return json;
}

base::Json make_changes_json(std::span<const EffectChange> changes, const SceneFacts& facts, std::size_t max_count) {
  base::Json json = base::Json::array();
  std::size_t count = 0;
  for (const EffectChange& change : changes) {
    for (const EffectSwitch& one : change.switches) {
      if (count++ == max_count) return json;
      json.add(base::Json::object()
                   .set("time_s", base::decimals(change.time_s, 3))
                   .set("body", facts.bodies[change.body].name)
                   .set("effect", synth::get_name(one.effect))
                   .set("on", one.on)
                   .set("why", describe(one.reason)));
    }
  }
  return json;
}

}  // namespace carillon::effects
