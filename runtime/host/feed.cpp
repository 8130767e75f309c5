// Method:     a pulse must be known when it begins. Between two waypoints a body is where both say, so the second must be known at the time
//             of the first; likewise of two records of a contact. Where a body is turned is asked for in the middle of its strike: ways are
//             known longer ahead by half the longest pulse. Events are read once as the sound goes on, a little ahead of it; those few that
//             are due long before they happen (after a pause of a contact or a body) are found beforehand.
// Source:     none.
// Deviations: none.
#include "runtime/host/feed.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <map>

#include "runtime/synth/kernels.hpp"
#include "runtime/synth/pulse.hpp"

namespace carillon::host {
namespace {

constexpr double kEver = -std::numeric_limits<double>::infinity();
constexpr double kAheadS = 1.0;     // what is due longer than this before it happens is in Feed::early_
constexpr double kDisorderS = 1.0;  // by which an event may be earlier than one before it

double calc_half_length_s(const stream::Impulse& impulse) { return 0.5 * synth::calc_pulse_length(impulse.shape, impulse.duration_s); }

}  // namespace

class Feed::Times {
 public:
  explicit Times(const Feed& feed) : feed_(&feed), last_s_(feed.bodies_.size() + 1, kEver) {}

  /// Calls work(Item) for what an event gives to hand on: nothing, itself, or itself twice.
  template <class Work>
  void find(const stream::Event& event, std::uint64_t number, Work&& work) {
    if (const auto* impulse = std::get_if<stream::Impulse>(&event)) {
      const FedBody* body = feed_->find(impulse->body);
      if (body == nullptr) return;
      const double due_s = impulse->time_s - calc_half_length_s(*impulse) - body->lead_s;
      work(Item{std::isnan(due_s) ? kEver : due_s, number});
    } else if (const auto* force = std::get_if<stream::Force>(&event)) {
      const FedBody* body = feed_->find(force->body);
      if (body == nullptr) return;
      const double due_s = force->time_s - body->lead_s;
      work(Item{std::isnan(due_s) ? kEver : due_s, number});
    } else if (const auto* contact = std::get_if<stream::Contact>(&event)) {
      if (feed_->find(contact->body) == nullptr) return;
      const auto [last, is_first] = contacts_.try_emplace({contact->body, contact->id}, contact->time_s);
      work(Item{last->second - feed_->margin_s_, number});
      last->second = contact->time_s;
      if (contact->state == stream::ContactState::kEnd) contacts_.erase(last);
    } else if (const auto* motion = std::get_if<stream::Motion>(&event)) {
      const FedBody* body = feed_->find(motion->body);
      if (body != nullptr && body->moves) find_waypoint(static_cast<std::size_t>(motion->body), motion->time_s, number, work);
    }
  }

  /// A waypoint is due at the time of the one before; the first also says that it rested there until then.
  template <class Work>
  void find_waypoint(std::size_t track, double time_s, std::uint64_t number, Work&& work) {
    double& last_s = last_s_[track];
    const bool is_first = last_s == kEver;
    const double due_s = is_first ? kEver : last_s - feed_->margin_s_;
    if (is_first && time_s > 0.0) work(Item{due_s, number, true});
    work(Item{due_s, number});
    last_s = time_s;
  }

 private:
  const Feed* feed_;
  std::vector<double> last_s_;                                         // of the waypoints of each body, then of the listener
  std::map<std::pair<std::int32_t, std::uint64_t>, double> contacts_;  // time of the last record
};

Feed::Feed(const Events& events, std::vector<FedBody> bodies, std::span<const stream::Listener> walk)
    : events_(&events), walk_(walk), bodies_(std::move(bodies)), reader_(events) {
  events.for_each([this](const stream::Event& event) {
    end_s_ = std::max(end_s_, stream::get_time_s(event));
    if (const auto* contact = std::get_if<stream::Contact>(&event)) has_contacts_ = has_contacts_ || find(contact->body) != nullptr;
    const auto* impulse = std::get_if<stream::Impulse>(&event);
    const auto* force = std::get_if<stream::Force>(&event);
    const FedBody* body = impulse != nullptr ? find(impulse->body) : force != nullptr ? find(force->body) : nullptr;
    if (body == nullptr) return;
    const double ahead_s = (impulse != nullptr ? calc_half_length_s(*impulse) : 0.0) + body->lead_s;
    if (ahead_s < 10.0) margin_s_ = std::max(margin_s_, ahead_s);  // false for what is no number
  });
  times_ = std::make_shared<Times>(*this);
  Times times(*this);
  std::uint64_t number = 0;
  events.for_each([&](const stream::Event& event) {
    const double time_s = stream::get_time_s(event);
    times.find(event, number++, [&](const Item& item) {
      if (time_s - item.due_s > kAheadS) early_.push_back(item);
    });
  });
  for (std::size_t i = 0; i < walk.size(); ++i) {
    times.find_waypoint(bodies_.size(), walk[i].time_s, events.size() + i, [&](const Item& item) { early_.push_back(item); });
  }
  std::sort(early_.begin(), early_.end(), [](const Item& a, const Item& b) { return b > a; });
}

const FedBody* Feed::find(std::int32_t body) const {
  return body >= 0 && static_cast<std::size_t>(body) < bodies_.size() && bodies_[static_cast<std::size_t>(body)].number >= 0
             ? &bodies_[static_cast<std::size_t>(body)]
             : nullptr;
}

stream::Event Feed::make_event(const Item& item, stream::Event event) const {
  const auto get_number = [this](std::int32_t body) { return bodies_[static_cast<std::size_t>(body)].number; };
  if (auto* impulse = std::get_if<stream::Impulse>(&event)) impulse->body = get_number(impulse->body);
  if (auto* force = std::get_if<stream::Force>(&event)) force->body = get_number(force->body);
  if (auto* contact = std::get_if<stream::Contact>(&event)) {
    contact->body = get_number(contact->body);
    const bool is_known = contact->other >= 0 && static_cast<std::size_t>(contact->other) < bodies_.size();
    contact->other = is_known ? get_number(contact->other) : -1;
  }
  if (auto* motion = std::get_if<stream::Motion>(&event)) {
    motion->body = get_number(motion->body);
    if (item.is_still) motion->velocity_m_s = {};
  }
  if (auto* listener = std::get_if<stream::Listener>(&event); listener != nullptr && item.is_still) listener->velocity_m_s = {};
  return event;
}

std::vector<int> Feed::count_waypoints(std::span<const double> longest_s) const {
  struct Way {
    double reach_s = 0.0;
    std::deque<double> times_s;  // of waypoints, those that may still count
    std::size_t most = 2;
  };
  std::vector<Way> ways(bodies_.size() + 1);
  // The waypoint `last` is known when what left `reach` before the one before it is still under way.
  for (std::size_t i = 0; i < ways.size(); ++i) ways[i].reach_s = (i < longest_s.size() ? longest_s[i] : 0.0) + margin_s_ + 0.1;
  Times times(*this);
  const auto take = [&](std::size_t track, double time_s) {
    Way& way = ways[track];
    std::deque<double>& known = way.times_s;
    while (known.size() > 1 && known[1] < known.back() - way.reach_s) known.pop_front();
    known.push_back(time_s);
    if (known.size() > 1) way.most = std::max(way.most, known.size());
  };
  std::uint64_t number = 0;
  events_->for_each([&](const stream::Event& event) {
    const auto* motion = std::get_if<stream::Motion>(&event);
    times.find(event, number++, [&](const Item&) {
      if (motion != nullptr) take(static_cast<std::size_t>(motion->body), motion->time_s);
    });
  });
  for (std::size_t i = 0; i < walk_.size(); ++i) {
    times.find_waypoint(bodies_.size(), walk_[i].time_s, 0, [&](const Item&) { take(bodies_.size(), walk_[i].time_s); });
  }
  std::vector<int> counts;
  for (const Way& way : ways) counts.push_back(static_cast<int>(std::min<std::size_t>(way.most + 2, std::numeric_limits<int>::max() / 2)));
  return counts;
}

/// Whatever is due before a time happens at most kAheadS later, or is early, or comes out of order.
void Feed::read_until(double until_s) {
  for (const stream::Event* event = reader_.peek(); event != nullptr && read_s_ < until_s + kAheadS + kDisorderS; event = reader_.peek()) {
    const double time_s = stream::get_time_s(*event);
    if (time_s > read_s_) read_s_ = time_s;  // false for what is no number
    times_->find(*event, reader_.get_number(), [&](const Item& item) {
      if (!(time_s - item.due_s > kAheadS)) held_.push({item, *event});
    });
    reader_.next();
  }
}

void Feed::hand_on(double until_s, synth::Synthesiser& synthesiser) {
  std::size_t waiting = 0;
  const auto push = [&](const stream::Event& event) {
    if (waiting == synthesiser.get_ring_room()) {
      synthesiser.process(nullptr, 0, 0);
      waiting = 0;
    }
    (void)synthesiser.push(event);  // what cannot be played is counted there
    ++waiting;
  };
  read_until(until_s);
  while (true) {
    const Item* early = next_early_ < early_.size() && early_[next_early_].due_s < until_s ? &early_[next_early_] : nullptr;
    const Held* held = !held_.empty() && held_.top().item.due_s < until_s ? &held_.top() : nullptr;
    if (early == nullptr && held == nullptr) break;
    if (held == nullptr || (early != nullptr && held->item > *early)) {
      const bool walks = early->event >= events_->size();
      push(make_event(*early, walks ? stream::Event(walk_[early->event - events_->size()]) : events_->get(early->event)));
      ++next_early_;
    } else {
      push(make_event(held->item, held->event));
      held_.pop();
    }
  }
  if (!has_contacts_) return;
  if (waiting == synthesiser.get_ring_room()) synthesiser.process(nullptr, 0, 0);
  (void)synthesiser.push(stream::Mark{std::min(until_s, end_s_)});
}

}  // namespace carillon::host
