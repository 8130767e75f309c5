#include "runtime/scene/event_scheduler.hpp"

#include <algorithm>
#include <limits>

#include "runtime/synth/pulse.hpp"

namespace carillon::scene {
namespace {

constexpr double kFromTheStart = -std::numeric_limits<double>::infinity();  // a first waypoint has no predecessor

}  // namespace

double calc_half_length_s(const events::Event& event) {
  const auto* impulse = std::get_if<events::Impulse>(&event);
  return impulse != nullptr ? 0.5 * synth::calc_pulse_length(impulse->shape, impulse->duration_s) : 0.0;
}

DueTimes::DueTimes(const std::vector<ScheduledBody>& bodies, double margin_s)
    : bodies_(&bodies), margin_s_(margin_s), last_s_(bodies.size() + 1, kFromTheStart) {}

const ScheduledBody* DueTimes::find_body(std::int32_t body) const {
  const bool is_played = body >= 0 && body < std::ssize(*bodies_) && (*bodies_)[body].number >= 0;
  return is_played ? &(*bodies_)[body] : nullptr;
}

int DueTimes::find(const events::Event& event, DueEvent* due) {
  const std::uint64_t number = number_++;
  if (events::find_fault(event) != nullptr) {
    ++faults_;
    return 0;
  }
  if (const auto* impulse = std::get_if<events::Impulse>(&event)) {
    const ScheduledBody* body = find_body(impulse->body);
    if (body == nullptr) return 0;
    due[0] = {impulse->time_s - calc_half_length_s(event) - body->lead_s, number};
    return 1;
  }
  if (const auto* force = std::get_if<events::Force>(&event)) {
    const ScheduledBody* body = find_body(force->body);
    if (body == nullptr) return 0;
    due[0] = {force->time_s - body->lead_s, number};
    return 1;
  }
  if (const auto* contact = std::get_if<events::LastingContact>(&event)) {
    if (find_body(contact->body) == nullptr) return 0;
    const auto [last, is_first] = contacts_.try_emplace({contact->body, contact->id}, contact->time_s);
    due[0] = {last->second - margin_s_, number};
    last->second = contact->time_s;
    if (contact->state == events::ContactState::kEnd) contacts_.erase(last);
    return 1;
  }
  const auto* motion = std::get_if<events::BodyMotion>(&event);
  const ScheduledBody* body = motion != nullptr ? find_body(motion->body) : nullptr;
  if (body == nullptr || !body->moves) return 0;
  return find_waypoint(last_s_[motion->body], motion->time_s, number, due);
}

/// The first waypoint is also pushed as a state of rest before it.
int DueTimes::find_waypoint(double& last_s, double time_s, std::uint64_t number, DueEvent* due) const {
  const bool is_first = last_s == kFromTheStart;
  const double due_s = is_first ? kFromTheStart : last_s - margin_s_;
  last_s = time_s;
  int count = 0;
  if (is_first && time_s > 0.0) due[count++] = {due_s, number, true};
  due[count++] = {due_s, number};
  return count;
}

EventScheduler::EventScheduler(std::vector<ScheduledBody> bodies, double margin_s)
    : bodies_(std::move(bodies)), times_(bodies_, margin_s), marked_s_(kFromTheStart) {}

void EventScheduler::add_listener(std::span<const events::Listener> path) {
  for (const events::Listener& waypoint : path) times_.find_listener(waypoint, [&](const DueEvent& due) { add(due, waypoint); });
}

/// Translates body numbers to those of the synthesiser.
events::Event EventScheduler::make_event(const Queued& queued) const {
  events::Event event = queued.event;
  const auto get_number = [this](std::int32_t body) { return bodies_[body].number; };
  if (auto* impulse = std::get_if<events::Impulse>(&event)) impulse->body = get_number(impulse->body);
  if (auto* force = std::get_if<events::Force>(&event)) force->body = get_number(force->body);
  if (auto* contact = std::get_if<events::LastingContact>(&event)) {
    contact->body = get_number(contact->body);
    const bool is_known = contact->other >= 0 && contact->other < std::ssize(bodies_);
    contact->other = is_known ? get_number(contact->other) : -1;
  }
  if (auto* motion = std::get_if<events::BodyMotion>(&event)) {
    motion->body = get_number(motion->body);
    if (queued.due.is_still) motion->velocity_m_s = {};
  }
  if (auto* listener = std::get_if<events::Listener>(&event); listener != nullptr && queued.due.is_still) listener->velocity_m_s = {};
  return event;
}

bool EventScheduler::push_until(double until_s, double known_s, const Push& push) {
  for (; !queue_.empty() && queue_.top().due.due_s < until_s; queue_.pop()) {
    if (!push(make_event(queue_.top()))) return false;
  }
  const double mark_s = std::min(until_s, known_s);
  if (!(mark_s > marked_s_)) return true;
  if (!push(events::TimeWatermark{mark_s})) return false;
  marked_s_ = mark_s;
  return true;
}

}  // namespace carillon::scene
