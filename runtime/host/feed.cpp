// Method:     a pulse must be known when it begins. Between two waypoints a body is where both say, so the second must be known at the time
//             of the first; likewise of two records of a contact. Where a body is turned is asked for in the middle of its strike: ways are
//             known longer ahead by half the longest pulse.
// Source:     none.
// Deviations: none.
#include "runtime/host/feed.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "runtime/synth/kernels.hpp"
#include "runtime/synth/pulse.hpp"

namespace carillon::host {
namespace {

constexpr double kEver = -std::numeric_limits<double>::infinity();

double calc_half_length_s(const stream::Impulse& impulse) { return 0.5 * synth::calc_pulse_length(impulse.shape, impulse.duration_s); }

}  // namespace

Feed::Feed(std::span<const stream::Event> events, std::vector<FedBody> bodies, std::span<const stream::Listener> walk)
    : events_(events), walk_(walk), bodies_(std::move(bodies)), times_s_(bodies_.size() + 1) {
  const auto find = [this](std::int32_t body) {
    return body >= 0 && static_cast<std::size_t>(body) < bodies_.size() && bodies_[static_cast<std::size_t>(body)].number >= 0
               ? &bodies_[static_cast<std::size_t>(body)]
               : nullptr;
  };
  for (const stream::Event& event : events) {
    const auto* impulse = std::get_if<stream::Impulse>(&event);
    const FedBody* body = impulse != nullptr ? find(impulse->body) : nullptr;
    if (body == nullptr) continue;
    const double ahead_s = calc_half_length_s(*impulse) + body->lead_s;
    if (ahead_s < 10.0) margin_s_ = std::max(margin_s_, ahead_s);  // false for what is no number
  }
  // A waypoint is due at the time of the one before; the first also says that it rested there until then.
  const auto add_waypoint = [this](std::size_t track, double time_s, std::size_t event) {
    std::vector<double>& times = times_s_[track];
    const double due_s = times.empty() ? kEver : times.back() - margin_s_;
    if (times.empty() && time_s > 0.0) {
      items_.push_back({due_s, event, true});
      times.push_back(time_s);
    }
    items_.push_back({due_s, event});
    times.push_back(time_s);
  };
  std::map<std::pair<std::int32_t, std::uint64_t>, double> contacts;  // time of the last record
  for (std::size_t i = 0; i < events.size(); ++i) {
    end_s_ = std::max(end_s_, stream::get_time_s(events[i]));
    if (const auto* impulse = std::get_if<stream::Impulse>(&events[i])) {
      const FedBody* body = find(impulse->body);
      if (body == nullptr) continue;
      const double due_s = impulse->time_s - calc_half_length_s(*impulse) - body->lead_s;
      items_.push_back({std::isnan(due_s) ? kEver : due_s, i});
    } else if (const auto* contact = std::get_if<stream::Contact>(&events[i])) {
      if (find(contact->body) == nullptr) continue;
      has_contacts_ = true;
      const auto [last, is_first] = contacts.try_emplace({contact->body, contact->id}, contact->time_s);
      items_.push_back({last->second - margin_s_, i});
      last->second = contact->time_s;
      if (contact->state == stream::ContactState::kEnd) contacts.erase(last);
    } else if (const auto* motion = std::get_if<stream::Motion>(&events[i])) {
      const FedBody* body = find(motion->body);
      if (body != nullptr && body->moves) add_waypoint(static_cast<std::size_t>(motion->body), motion->time_s, i);
    }
  }
  for (std::size_t i = 0; i < walk.size(); ++i) add_waypoint(bodies_.size(), walk[i].time_s, events.size() + i);
  std::stable_sort(items_.begin(), items_.end(), [](const Item& a, const Item& b) { return a.due_s < b.due_s; });
}

stream::Event Feed::make_event(const Item& item) const {
  if (item.event >= events_.size()) {
    stream::Listener listener = walk_[item.event - events_.size()];
    if (item.is_still) listener.velocity_m_s = {};
    return listener;
  }
  stream::Event event = events_[item.event];
  const auto get_number = [this](std::int32_t body) { return bodies_[static_cast<std::size_t>(body)].number; };
  if (auto* impulse = std::get_if<stream::Impulse>(&event)) impulse->body = get_number(impulse->body);
  if (auto* contact = std::get_if<stream::Contact>(&event)) {
    contact->body = get_number(contact->body);
    const bool is_known = contact->other >= 0 && static_cast<std::size_t>(contact->other) < bodies_.size();
    contact->other = is_known ? get_number(contact->other) : -1;
  }
  if (auto* motion = std::get_if<stream::Motion>(&event)) {
    motion->body = get_number(motion->body);
    if (item.is_still) motion->velocity_m_s = {};
  }
  return event;
}

int Feed::count_waypoints(int body, double longest_s) const {
  const std::vector<double>& times = times_s_[body < 0 ? bodies_.size() : static_cast<std::size_t>(body)];
  // The waypoint `last` is known when what left `reach` before the one before it is still under way.
  const double reach_s = longest_s + margin_s_ + 0.1;
  std::size_t most = 2, oldest = 0;
  for (std::size_t last = 1; last < times.size(); ++last) {
    while (oldest + 1 < last && times[oldest + 1] < times[last - 1] - reach_s) ++oldest;
    most = std::max(most, last - oldest + 1);
  }
  return static_cast<int>(std::min<std::size_t>(most + 2, std::numeric_limits<int>::max() / 2));
}

void Feed::hand_on(double until_s, synth::Synthesiser& synthesiser) {
  std::size_t waiting = 0;
  for (; next_ < items_.size() && items_[next_].due_s < until_s; ++next_) {
    if (waiting == synthesiser.get_ring_room()) {
      synthesiser.process(nullptr, 0, 0);
      waiting = 0;
    }
    (void)synthesiser.push(make_event(items_[next_]));  // what cannot be played is counted there
    ++waiting;
  }
  if (!has_contacts_) return;
  if (waiting == synthesiser.get_ring_room()) synthesiser.process(nullptr, 0, 0);
  (void)synthesiser.push(stream::Mark{std::min(until_s, end_s_)});
}

}  // namespace carillon::host
