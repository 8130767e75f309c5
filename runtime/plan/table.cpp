#include "runtime/plan/table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "runtime/base/document.hpp"

namespace carillon::plan {
namespace {

double find_duration(const Planner& planner, const SceneFacts& facts) {
  return std::max(std::min(facts.duration_s, planner.get_time_s()), 1e-9);
}

std::string describe_time(const EffectPlan& plan, double duration_s) {
  if (!plan.ever) return "off";
  if (plan.switched == 1 && plan.on_s >= duration_s - 1.5 * kTickS) return "on";
  if (plan.switched == 1) return fmt::format("on {:.2f} - {:.2f} s", plan.first_s, plan.last_s);
  return fmt::format("on {:.0f} % of the time", 100.0 * plan.on_s / duration_s);
}

/// Bytes of UTF-8 are columns here: names of effects and our words are ASCII.
std::string quote(const std::string& text) { return base::quote(text); }

}  // namespace

std::string format_plan(const Planner& planner, const SceneFacts& facts) {
  std::string text;
  auto out = std::back_inserter(text);
  const double duration = find_duration(planner, facts);
  double all = 0.0;
  for (std::size_t i = 0; i < facts.bodies.size(); ++i) {
    const BodyPlan plan = planner.get_plan(static_cast<int>(i));
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

std::string make_plan_json(const Planner& planner, const SceneFacts& facts, int body, const MoreJson& more) {
  std::string json = "{";
  auto out = std::back_inserter(json);
  const double duration = find_duration(planner, facts);
  const BodyPlan plan = planner.get_plan(body);
  for (const Effect effect : EffectSet::all()) {
    const EffectPlan& of = plan[effect];
    fmt::format_to(out, "{}\"{}\": {{\"on_s\": {:.3f}, \"switched\": {}, \"predicted_us_per_s\": {:.4g}, \"why\": {}{}{}}}",
                   json.size() == 1 ? "" : ",\n   ", synth::get_name(effect), of.on_s, of.switched, of.cost_us / duration,
                   quote(describe(of.reason)), more[effect].empty() ? "" : ", ", more[effect]);
  }
  return json + "}";
}

std::string make_changes_json(std::span<const Change> changes, const SceneFacts& facts, std::size_t most) {
  std::string json = "[";
  auto out = std::back_inserter(json);
  std::size_t count = 0;
  for (const Change& change : changes) {
    for (const Switch& one : change.switches) {
      if (count == most) return json + "\n ]";
      fmt::format_to(out, "{}\n  {{\"time_s\": {:.3f}, \"body\": {}, \"effect\": \"{}\", \"on\": {}, \"why\": {}}}", count == 0 ? "" : ",",
                     change.time_s, quote(facts.bodies[static_cast<std::size_t>(change.body)].name), synth::get_name(one.effect), one.on,
                     quote(describe(one.reason)));
      ++count;
    }
  }
  return json + (count == 0 ? "]" : "\n ]");
}

}  // namespace carillon::plan
