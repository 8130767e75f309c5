// Method: time is cut into windows on an absolute grid. At the start of a window bodies that may come to touch within it, by balls and
// boxes
//   about them grown by what they may move, are put together (union and find); each group is an island with a Simbody system of its own and
//   steps of its own, and goes through the window alone. Afterwards the way that every body really went is held against the others':
//   islands that may have met are joined and go through the window again. What is done in which order follows from the scene alone, so that
//   neither the slices in which the caller asks for time nor the clock change a bit.
// Source: D. Baraff, "Analytical methods for dynamic simulation of non-penetrating rigid bodies" (1989) and B. Mirtich, "Timewarp rigid
//   body simulation" (2000), section 3: bodies that do not interact need not wait for each other; a wrong guess is taken back.
// Deviations: what stands still is in every island, and the windows are of one length for all.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <functional>
#include <limits>
#include <numeric>

#include "runtime/config/error.hpp"
#include "runtime/contact/island.hpp"
#include "runtime/contact/model.hpp"
#include "runtime/contact/touch.hpp"

namespace carillon::contact {
namespace {

using SimTK::Transform;
using Point = SimTK::Vec3;

constexpr double kWindow = 2e-3;      // s; also from pose to pose
constexpr double kShortest = 2e-7;    // s; what is nearer than this to the end of a window has reached it
constexpr double kEarliest = 1e-4;    // s; an impact found in a window may have begun so much before it
constexpr double kSlackMoved = 1e-5;  // m
constexpr double kKeep = 0.02;        // of the smaller size: bodies stay together until they are this far apart

/// CPU time of this thread alone: sound rendered on another thread is not counted.
double get_cpu_s() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

struct Place {
  Transform pose;
  double moved_m = 0.0;  // that any of its points may move within the window
};

Transform make_transform(const Pose& pose) {
  const auto& q = pose.rotation;
  const auto& p = pose.position_m;
  return {SimTK::Rotation(SimTK::Quaternion(SimTK::Vec4(q[0], q[1], q[2], q[3]))), Point(p[0], p[1], p[2])};  // normalises
}

/// Sets of numbers that grow together.
class Groups {
 public:
  explicit Groups(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }
  int find(int i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  /// The smaller number leads.
  void join(int i, int j) {
    const auto [low, high] = std::minmax({find(i), find(j)});  // a list: by value
    parent_[high] = low;
  }

 private:
  std::vector<int> parent_;
};

}  // namespace

class Runner::Parts {
 public:
  Parts(WorldModel world, const WorldOptions& options);

  double advance(double until_s, double cpu_s, const std::function<void(const stream::Event&)>& sink);
  Statistics get_statistics() const;

 private:
  using Sink = std::function<void(const stream::Event&)>;

  bool is_over() const { return options_.end_s - reached_s_ <= kShortest; }
  void begin(const Sink& sink);
  void step(const Sink& sink);
  void open_window();
  void close_window(const Sink& sink);
  bool join_what_met();
  /// Joins what may come near: bodies at their places, with what each may move.
  void join_near(const std::vector<Place>& places, Groups& groups) const;
  void add_island(const std::vector<int>& moving);
  std::vector<std::vector<int>> list_groups(Groups& groups) const;
  std::vector<int> find_moving(const Island& island) const;
  void retire(const std::vector<std::unique_ptr<Island>>& gone);
  void audit();
  void emit(std::vector<stream::Event>& events, double mark_s, const Sink& sink) const;
  stream::Motion make_motion(std::size_t body, double time_s) const;
  const Surface& surface(int body) const { return *surfaces_.at(world_.bodies[body].vertices_m); }

  WorldModel world_;  // bodies as they are at the start of the window
  WorldOptions options_;
  SurfaceSet surfaces_;
  std::vector<OldPoint> recent_;     // of all islands, at the start of the window
  std::vector<RestedPoint> rested_;  // the same
  std::vector<Spot> spots_;          // the same
  TouchCounts touches_;              // the same
  std::vector<std::unique_ptr<Island>> islands_;
  std::vector<int> group_;   // of each body, in the window before: the lowest number in its island
  std::size_t current_ = 0;  // the island that is on its way through the window
  bool begun_ = false, open_ = false;
  bool was_asleep_ = false;  // all of it, when the window opened
  bool asleep_ = false;      // all of it, since the window before: who may meet whom is as it was, and so is all else
  double reached_s_ = 0.0;   // start of the window
  double until_s_ = 0.0;     // its end
  std::int64_t window_ = 0;
  std::int64_t old_steps_ = 0, old_body_steps_ = 0;  // of islands that are no more
  std::int64_t made_ = 0;
  double seconds_cpu_ = 0.0;
  EnergyAudit energy_;
  double taken_j_ = 0.0;                                      // by hits
  double least_j_ = std::numeric_limits<double>::infinity();  // energy there has been, with what hits took
};

Runner::Parts::Parts(WorldModel world, const WorldOptions& options) : world_(std::move(world)), options_(options) {
  Engine(world_, surfaces_, 0.0, options_).check_overlaps();
  group_.assign(world_.bodies.size(), -1);
  const auto& g = world_.gravity_m_s2;
  for (const BodyModel& body : world_.bodies) {
    if (options_.audits_energy && !body.fixed) energy_.weight_n += body.mass_kg * std::hypot(g[0], g[1], g[2]);
  }
}

stream::Motion Runner::Parts::make_motion(std::size_t body, double time_s) const {
  const BodyModel& b = world_.bodies[body];
  const Transform pose = make_transform(b.initial);
  const SimTK::Quaternion q = pose.R().convertRotationToQuaternion();
  const Point x = pose * Point(b.centre_m[0], b.centre_m[1], b.centre_m[2]);
  return {time_s, static_cast<std::int32_t>(body), {x[0], x[1], x[2]}, b.velocity_m_s, {q[0], q[1], q[2], q[3]}};
}

void Runner::Parts::emit(std::vector<stream::Event>& events, double mark_s, const Sink& sink) const {
  const auto earlier = [](const stream::Event& x, const stream::Event& y) { return stream::get_time_s(x) < stream::get_time_s(y); };
  std::stable_sort(events.begin(), events.end(), earlier);
  for (const stream::Event& event : events) sink(event);
  sink(stream::Mark{mark_s});
}

void Runner::Parts::begin(const Sink& sink) {
  std::vector<stream::Event> events;
  for (std::size_t i = 0; i < world_.bodies.size(); ++i) events.push_back(make_motion(i, 0.0));
  emit(events, 0.0, sink);
  begun_ = true;
}

void Runner::Parts::add_island(const std::vector<int>& moving) {
  WorldModel part;
  part.ground = world_.ground;
  part.gravity_m_s2 = world_.gravity_m_s2;
  std::vector<int> members;
  for (std::size_t i = 0; i < world_.bodies.size(); ++i) {
    const auto body = static_cast<int>(i);
    if (!world_.bodies[i].fixed && !std::binary_search(moving.begin(), moving.end(), body)) continue;
    members.push_back(body);
    part.bodies.push_back(world_.bodies[i]);
  }
  islands_.push_back(
      std::make_unique<Island>(std::move(part), std::move(members), surfaces_, reached_s_, recent_, rested_, spots_, touches_, options_));
  ++made_;
}

void Runner::Parts::join_near(const std::vector<Place>& places, Groups& groups) const {
  // Along x, so that not every pair is looked at.
  struct Span {
    double low = 0.0, high = 0.0;
    int body = 0;
  };
  std::vector<Span> spans;
  double widest = 0.0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto body = static_cast<int>(i);
    if (world_.bodies[i].fixed) continue;
    const double middle = (places[i].pose * surface(body).middle_m())[0];
    const double reach = (1.0 + kKeep) * surface(body).size_m() + places[i].moved_m;
    spans.push_back({middle - reach, middle + reach, body});
    widest = std::max(widest, 2.0 * reach);
  }
  std::stable_sort(spans.begin(), spans.end(), [](const Span& x, const Span& y) { return x.low < y.low; });
  for (std::size_t i = 0; i < spans.size(); ++i) {
    for (std::size_t j = i + 1; j < spans.size() && spans[j].low <= spans[i].high; ++j) {
      const int a = spans[i].body, b = spans[j].body;
      if (groups.find(a) == groups.find(b)) continue;
      double margin = places[a].moved_m + places[b].moved_m;
      if (group_[a] == group_[b] && group_[a] >= 0) margin += kKeep * std::min(surface(a).size_m(), surface(b).size_m());
      if (may_be_near(surface(a), places[a].pose, surface(b), places[b].pose, margin)) groups.join(a, b);
    }
  }
}

std::vector<std::vector<int>> Runner::Parts::list_groups(Groups& groups) const {
  std::vector<std::vector<int>> lists(world_.bodies.size());
  for (std::size_t i = 0; i < world_.bodies.size(); ++i) {
    if (!world_.bodies[i].fixed) lists[groups.find(static_cast<int>(i))].push_back(static_cast<int>(i));
  }
  lists.erase(std::remove_if(lists.begin(), lists.end(), [](const auto& list) { return list.empty(); }), lists.end());
  return lists;
}

std::vector<int> Runner::Parts::find_moving(const Island& island) const {
  std::vector<int> moving;
  for (const int body : island.get_members()) {
    if (!world_.bodies[body].fixed) moving.push_back(body);
  }
  return moving;
}

void Runner::Parts::open_window() {
  while (static_cast<double>(window_) * kWindow <= reached_s_ + kShortest) ++window_;
  until_s_ = std::min(options_.end_s, static_cast<double>(window_) * kWindow);
  const auto sleeps = [](const auto& island) { return island->is_asleep(); };
  asleep_ = was_asleep_ && std::all_of(islands_.begin(), islands_.end(), sleeps);
  was_asleep_ = !islands_.empty() && std::all_of(islands_.begin(), islands_.end(), sleeps);
  current_ = 0;
  open_ = true;
  if (asleep_) {
    for (const auto& island : islands_) island->begin_window();
    return;
  }
  const double length = until_s_ - reached_s_;
  const auto& g = world_.gravity_m_s2;
  const double fallen = 0.5 * std::hypot(g[0], g[1], g[2]) * length * length;
  Groups groups(world_.bodies.size());
  std::vector<Place> places;
  int first = -1;
  for (std::size_t i = 0; i < world_.bodies.size(); ++i) {
    const BodyModel& b = world_.bodies[i];
    const auto &v = b.velocity_m_s, &w = b.angular_velocity_rad_s;
    const double speed = std::hypot(v[0], v[1], v[2]) + std::hypot(w[0], w[1], w[2]) * surface(static_cast<int>(i)).size_m();
    places.push_back({make_transform(b.initial), speed * length + fallen + kSlackMoved});
    if (options_.islands || b.fixed) continue;
    if (first < 0) first = static_cast<int>(i);
    groups.join(first, static_cast<int>(i));
  }
  join_near(places, groups);
  std::vector<std::unique_ptr<Island>> before = std::move(islands_);
  islands_.clear();
  for (const std::vector<int>& moving : list_groups(groups)) {
    const auto same = [&](const auto& island) { return island && find_moving(*island) == moving; };
    const auto kept = std::find_if(before.begin(), before.end(), same);
    if (kept != before.end()) {
      islands_.push_back(std::move(*kept));
    } else {
      add_island(moving);
    }
    for (const int body : moving) group_[body] = moving.front();
  }
  retire(before);
  for (const auto& island : islands_) island->begin_window();
}

/// Islands whose bodies may have met on their ways are made anew, together, as they were at the start of the window. False: there are none.
bool Runner::Parts::join_what_met() {
  Groups groups(world_.bodies.size());
  std::vector<Place> places(world_.bodies.size());
  for (std::size_t i = 0; i < world_.bodies.size(); ++i) {
    places[i].pose = make_transform(world_.bodies[i].initial);
  }
  for (const auto& island : islands_) {
    const std::vector<int>& members = island->get_members();
    const int lead = find_moving(*island).front();
    for (std::size_t k = 0; k < members.size(); ++k) {
      if (world_.bodies[members[k]].fixed) continue;
      groups.join(lead, members[k]);
      places[members[k]].moved_m = island->get_moved_m(k);
    }
  }
  join_near(places, groups);
  const auto lists = list_groups(groups);
  if (lists.size() == islands_.size()) return false;
  std::vector<std::unique_ptr<Island>> before = std::move(islands_);
  islands_.clear();
  std::vector<std::vector<int>> anew;
  for (const std::vector<int>& moving : lists) {
    const auto same = [&](const auto& island) { return island && find_moving(*island) == moving; };
    const auto kept = std::find_if(before.begin(), before.end(), same);
    if (kept != before.end()) {
      islands_.push_back(std::move(*kept));
    } else {
      anew.push_back(moving);
    }
  }
  retire(before);
  current_ = islands_.size();  // those that met nobody are through
  for (const std::vector<int>& moving : anew) {
    add_island(moving);
    islands_.back()->begin_window();
    for (const int body : moving) group_[body] = moving.front();
  }
  return true;
}

void Runner::Parts::close_window(const Sink& sink) {
  if (!asleep_ && join_what_met()) return;
  recent_.clear();
  rested_.clear();
  spots_.clear();
  std::vector<stream::Event> events;
  for (const auto& island : islands_) {
    island->store(world_);
    island->add_recent(recent_);
    island->add_rested(rested_);
    island->add_spots(spots_);
    for (const auto& [pair, count] : island->get_touches()) touches_[pair] = count;
    events.insert(events.end(), island->get_events().begin(), island->get_events().end());
  }
  if (options_.audits_energy) audit();
  reached_s_ = until_s_;
  open_ = false;
  if (is_over()) {
    for (std::size_t i = 0; i < world_.bodies.size(); ++i) {
      if (world_.bodies[i].fixed) events.push_back(make_motion(i, options_.end_s));
    }
  }
  emit(events, is_over() ? options_.end_s : std::max(0.0, reached_s_ - kEarliest), sink);
}

void Runner::Parts::audit() {
  double now = 0.0, kinetic = 0.0;
  for (const auto& island : islands_) {
    now += island->calc_energy_j();
    kinetic += island->calc_kinetic_j();
    taken_j_ += island->get_taken_j();
    energy_.hit_rise_j = std::max(energy_.hit_rise_j, -island->get_least_taken_j());
  }
  energy_.rise_j = std::max(energy_.rise_j, now + taken_j_ - least_j_);
  energy_.kinetic_j = std::max(energy_.kinetic_j, kinetic);
  least_j_ = std::min(least_j_, now + taken_j_);
}

void Runner::Parts::step(const Sink& sink) {
  if (!begun_) {
    begin(sink);
  } else if (!open_) {
    open_window();
  } else if (current_ < islands_.size()) {
    if (islands_[current_]->step(until_s_)) ++current_;
  } else {
    close_window(sink);
  }
}

double Runner::Parts::advance(double until_s, double cpu_s, const Sink& sink) {
  const double started_s = get_cpu_s();
  const auto spent = [&] { return get_cpu_s() - started_s; };
  while (!begun_ || (until_s - reached_s_ > kShortest && !is_over())) {
    step(sink);
    if (spent() >= cpu_s) break;
  }
  seconds_cpu_ += spent();
  return reached_s_;
}

/// Keeps the cost of islands that go; those that live on have left an empty place.
void Runner::Parts::retire(const std::vector<std::unique_ptr<Island>>& gone) {
  for (const auto& island : gone) {
    if (!island) continue;
    old_steps_ += island->get_steps();
    old_body_steps_ += island->calc_body_steps();
  }
}

Statistics Runner::Parts::get_statistics() const {
  Statistics s;
  s.steps = old_steps_;
  s.body_steps = old_body_steps_;
  for (const auto& island : islands_) {
    s.steps += island->get_steps();
    s.body_steps += island->calc_body_steps();
  }
  s.islands = static_cast<std::int64_t>(islands_.size());
  s.made = made_;
  s.seconds_cpu = seconds_cpu_;
  s.energy = energy_;
  return s;
}

Runner::Runner(WorldModel world, const WorldOptions& options) {
  const std::string names = list_names(world);
  try {
    parts_ = std::make_unique<Parts>(std::move(world), options);
  } catch (const SimTK::Exception::Base& e) {
    throw SolveError(fmt::format("Simbody gave up on the world of {}: {}", names, e.what()));
  }
}

Runner::~Runner() = default;

double Runner::advance(double until_s, double cpu_s, const std::function<void(const stream::Event&)>& sink) {
  try {
    return parts_->advance(until_s, cpu_s, sink);
  } catch (const SimTK::Exception::Base& e) {
    throw SolveError(fmt::format("Simbody gave up: {}", e.what()));
  }
}

Statistics Runner::get_statistics() const { return parts_->get_statistics(); }

}  // namespace carillon::contact
