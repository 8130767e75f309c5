#include "runtime/render/event_playback.hpp"

#include <algorithm>
#include <deque>
#include <limits>

namespace carillon::render {
namespace {

constexpr double kNever = -std::numeric_limits<double>::infinity();

/// Waypoints of one track that are in use at the same time.
struct PathMemory {
  double reach_s = 0.0;
  std::deque<double> times_s;  // times still in use
  std::size_t largest = 2;

  /// Waypoint `last` is needed once sound that left `reach_s` before its predecessor is still travelling.
  void add(double time_s) {
    while (times_s.size() > 1 && times_s[1] < times_s.back() - reach_s) times_s.pop_front();
    times_s.push_back(time_s);
    if (times_s.size() > 1) largest = std::max(largest, times_s.size());
  }
};

}  // namespace

EventPlayback::Survey EventPlayback::survey(const scene::Events& events, const std::vector<scene::ScheduledBody>& bodies) {
  const scene::DueTimes times(bodies, 0.0);
  double margin_s = 0.0, end_s = -1e300;
  bool has_contacts = false;
  events.for_each([&](const events::Event& event) {
    end_s = std::max(end_s, events::get_time_s(event));
    if (const auto* contact = std::get_if<events::LastingContact>(&event))
      has_contacts = has_contacts || times.find_body(contact->body) != nullptr;
    const auto* impulse = std::get_if<events::Impulse>(&event);
    const auto* force = std::get_if<events::Force>(&event);
    const scene::ScheduledBody* body = impulse != nullptr ? times.find_body(impulse->body)
                                       : force != nullptr ? times.find_body(force->body)
                                                          : nullptr;
    if (body == nullptr) return;
    const double ahead_s = scene::calc_half_length_s(event) + body->lead_s;
    if (ahead_s < 10.0) margin_s = std::max(margin_s, ahead_s);  // false for NaN
  });
  return {margin_s, has_contacts ? end_s : kNever};
}

EventPlayback::EventPlayback(const scene::Events& events, const std::vector<scene::ScheduledBody>& bodies,
                             std::span<const events::Listener> path)
    : EventPlayback(events, bodies, path, survey(events, bodies)) {}

EventPlayback::EventPlayback(const scene::Events& events, const std::vector<scene::ScheduledBody>& bodies,
                             std::span<const events::Listener> path, Survey survey)
    : events_(&events), path_(path), bodies_(bodies), survey_(survey), scheduler_(bodies, survey.margin_s), reader_(events) {
  scene::DueTimes times(bodies_, survey.margin_s);
  events.for_each([&](const events::Event& event) {
    const double time_s = events::get_time_s(event);
    times.find(event, [&](const scene::DueEvent& due) {
      if (time_s - due.due_s > kAheadS) early_.push_back(due);
    });
  });
  std::sort(early_.begin(), early_.end(), [](const scene::DueEvent& a, const scene::DueEvent& b) { return b > a; });
  scheduler_.add_listener(path);
}

std::vector<int> EventPlayback::count_waypoints(std::span<const double> longest_s) const {
  std::vector<PathMemory> tracks(bodies_.size() + 1);
  for (std::size_t i = 0; i < tracks.size(); ++i) tracks[i].reach_s = (i < longest_s.size() ? longest_s[i] : 0.0) + survey_.margin_s + 0.1;
  scene::DueTimes times(bodies_, survey_.margin_s);
  events_->for_each([&](const events::Event& event) {
    const auto* motion = std::get_if<events::BodyMotion>(&event);
    times.find(event, [&](const scene::DueEvent&) {
      if (motion != nullptr) tracks[motion->body].add(motion->time_s);
    });
  });
  for (const events::Listener& waypoint : path_) {
    times.find_listener(waypoint, [&](const scene::DueEvent&) { tracks.back().add(waypoint.time_s); });
  }
  std::vector<int> counts;
  for (const PathMemory& track : tracks)
    counts.push_back(static_cast<int>(std::min<std::size_t>(track.largest + 2, std::numeric_limits<int>::max() / 2)));
  return counts;
}

/// Events due before a time occur at most kAheadS later, or are early, or out of order.
void EventPlayback::read_until(double until_s) {
  for (; next_early_ < early_.size() && early_[next_early_].due_s < until_s; ++next_early_)
    scheduler_.add(early_[next_early_], events_->get(early_[next_early_].number));
  for (const events::Event* event = reader_.peek(); event != nullptr && read_s_ < until_s + kAheadS + kDisorderS; event = reader_.peek()) {
    const double time_s = events::get_time_s(*event);
    if (time_s > read_s_) read_s_ = time_s;  // false for NaN
    scheduler_.add(*event, [&](const scene::DueEvent& due) { return !(time_s - due.due_s > kAheadS); });
    reader_.next();
  }
}

void EventPlayback::push_until(double until_s, synth::Synthesiser& synthesiser) {
  read_until(until_s);
  std::size_t waiting = 0;
  scheduler_.push_until(until_s, survey_.known_s, [&](const events::Event& event) {
    if (waiting == synthesiser.get_ring_room()) {
      synthesiser.process(nullptr, 0, 0);
      waiting = 0;
    }
    (void)synthesiser.push(event);  // rejected events are counted by the synthesiser
    ++waiting;
    return true;
  });
}

}  // namespace carillon::render
