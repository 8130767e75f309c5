// One space, whose windows, pairs and groups every step changes together; longer than most files.
// Method: windows, in which bodies that can meet nothing fly; pairs that are near and their touches; groups of bodies, each of which goes
//   through the small steps by itself (step.cpp).
// Source: B. Mirtich, "Impulse-based dynamic simulation of rigid body systems" (1996): bounds on what can meet, flight in closed form.
// Deviations: windows have a length; what an impact makes faster than its window was planned for is looked at again.
#include "runtime/rigid/space.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <tuple>

#include "runtime/base/error.hpp"
#include "runtime/rigid/groups.hpp"
#include "runtime/rigid/limits.hpp"

namespace carillon::rigid {
namespace {

constexpr double kReach = 0.3;            // of the size of the smaller body: from so far touches are found
constexpr double kMaxSteps = 1024;        // of a window
constexpr double kThin = 0.15;            // of the thickness of the thinner body: what moves as far in a long step takes short ones
constexpr double kSag = 5e-6;             // m; a point on an arc may leave its chord by this in a step,
constexpr double kSagOfThickness = 5e-4;  // or by so much of the thickness of its body
constexpr double kFlatSteps = 2.0;        // times the step of others: that of groups in which flat bodies alone touch

}  // namespace

Space::Space(std::vector<Solid> solids, std::vector<State> states, std::optional<Ground> ground, const Vec3& gravity,
             const Options& options, const Links& links)
    : solids_(std::move(solids)), states_(std::move(states)), ground_(ground), gravity_(gravity), options_(options) {
  placed_.resize(solids_.size());
  asleep_.assign(solids_.size(), 0);
  flying_.assign(solids_.size(), 0);
  stride_.assign(solids_.size(), 1);
  in_ringing_.assign(solids_.size(), 0);
  paces_.resize(solids_.size());
  reach_m_s_.assign(solids_.size(), 0.0);
  flew_from_ = states_;
  index_.assign(solids_.size(), -1);
  rings_.resize(solids_.size());
  for (std::size_t i = 0; i < solids_.size(); ++i) place_body(static_cast<int>(i));
  link(links);
  cords_ = links.cords;
  cord_pairs_.resize(cords_.size());
  for (std::size_t n = 0; n < cords_.size(); ++n) {
    cord_pairs_[n].a = cords_[n].a;
    cord_pairs_[n].b = cords_[n].b;
    cord_pairs_[n].cord = static_cast<int>(n);
    stretch(cord_pairs_[n]);
  }
}

void Space::place_body(int body) {
  const auto i = static_cast<std::size_t>(body);
  placed_[i] = place(solids_[i], states_[i]);
}

bool Space::is_all_asleep() const {
  for (std::size_t i = 0; i < solids_.size(); ++i)
    if (!solids_[i].fixed && !asleep_[i]) return false;
  return true;
}

void Space::list_contacts(std::vector<const Contact*>& out) const {
  out.clear();
  for (const Pair* pair : near_)
    if (pair->cord < 0 && (moves(pair->a) || moves(pair->b)))
      for (const Contact& c : pair->contacts) out.push_back(&c);
}

double Space::calc_pair_friction(int a, int b) const {
  return std::sqrt(solid(a).friction * (b >= 0 ? solid(b).friction : ground_->friction));
}

double Space::calc_pair_restitution(int a, int b) const {
  return std::sqrt(solid(a).restitution * (b >= 0 ? solid(b).restitution : ground_->restitution));
}

Vec3 Space::calc_velocity(int body, const Vec3& where) const {
  if (is_fixed(body)) return {};
  const auto i = static_cast<std::size_t>(body);
  return states_[i].velocity + cross(placed_[i].spin, where - states_[i].centre);
}

/// How fast the surfaces close at a contact [m/s].
double Space::calc_approach(const Contact& c) const {
  return -dot(calc_velocity(c.a, c.touch.where_m) - calc_velocity(c.b, c.touch.where_m), c.touch.normal);
}

/// How fast any two points of a pair can come nearer [m/s].
double Space::calc_pair_speed(int a, int b) const {
  Vec3 v{};
  double turning = 0.0;
  for (const int body : {a, b}) {
    if (!moves(body)) continue;
    const auto i = static_cast<std::size_t>(body);
    v = body == a ? v + states_[i].velocity : v - states_[i].velocity;
    turning += norm(placed_[i].spin) * solids_[i].radius_m;
  }
  return norm(v) + turning;
}

double Space::calc_pair_size(int a, int b) const {
  const double size = solid(a).shape->get_size_m();
  return b >= 0 ? std::min(size, solid(b).shape->get_size_m()) : size;
}

double Space::calc_pair_thickness(int a, int b) const {
  const double thickness = solid(a).shape->get_thickness_m();
  return b >= 0 ? std::min(thickness, solid(b).shape->get_thickness_m()) : thickness;
}

shape::Box Space::calc_box(int body, double grown_m) const {
  const auto i = static_cast<std::size_t>(body);
  shape::Box box = solids_[i].shape->calc_box(placed_[i].frame);
  for (std::size_t k = 0; k < 3; ++k) box.low[k] -= grown_m, box.high[k] += grown_m;
  return box;
}

void Space::add_pair(int a, int b) {
  if (b >= 0 && a > b) std::swap(a, b);
  if (!joined_.empty() && is_joined(a, b)) return;
  Pair& pair = pairs_[{a, b}];
  pair.a = a;
  pair.b = b;
  if (pair.window == window_) return;
  pair.window = window_;
  near_.push_back(&pair);
  near_is_sorted_ = false;
}

void Space::sort_near() {
  if (near_is_sorted_) return;
  std::sort(near_.begin(), near_.end(),
            [](const Pair* x, const Pair* y) { return std::tuple(x->a, x->b, x->cord) < std::tuple(y->a, y->b, y->cord); });
  near_is_sorted_ = true;
}

void Space::open_window(double end_s) {
  ++window_;
  window_start_s_ = time_s_;
  window_end_s_ = std::min(static_cast<double>(window_) * kWindow, end_s);
  const double length = window_end_s_ - window_start_s_, g = norm(gravity_);
  near_.clear();
  near_is_sorted_ = true;
  const int count = static_cast<int>(solids_.size());
  std::vector<int> order;
  std::vector<shape::Box> boxes(solids_.size());
  std::vector<char> active(solids_.size(), 0);
  for (int i = 0; i < count; ++i) {
    const auto n = static_cast<std::size_t>(i);
    flying_[n] = 0;
    reach_m_s_[n] = moves(i) ? norm(states_[n].velocity) + norm(placed_[n].spin) * solids_[n].radius_m + g * length : 0.0;
    if (const Linked* linked = find_linked(i); linked != nullptr && moves(i)) reach_m_s_[n] += calc_linked_pull(*linked) * length;
    boxes[n] = calc_box(i, moves(i) ? reach_m_s_[n] * length + 1e-4 : 0.0);
    order.push_back(i);
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](int x, int y) { return boxes[static_cast<std::size_t>(x)].low[0] < boxes[static_cast<std::size_t>(y)].low[0]; });
  for (std::size_t p = 0; p < order.size(); ++p) {
    const int i = order[p];
    const shape::Box& x = boxes[static_cast<std::size_t>(i)];
    if (moves(i) && ground_ && x.low[2] < ground_->height_m) add_pair(i, -1), active[static_cast<std::size_t>(i)] = 1;
    for (std::size_t q = p + 1; q < order.size(); ++q) {
      const int j = order[q];
      const shape::Box& y = boxes[static_cast<std::size_t>(j)];
      if (y.low[0] > x.high[0]) break;
      if (y.low[1] > x.high[1] || x.low[1] > y.high[1] || y.low[2] > x.high[2] || x.low[2] > y.high[2]) continue;
      if (!moves(i) && !moves(j)) continue;
      if (!joined_.empty() && is_joined(i, j)) continue;
      add_pair(i, j);
      active[static_cast<std::size_t>(i)] = active[static_cast<std::size_t>(j)] = 1;
    }
  }
  open_cords(active, length);
  for (const Ringing& ringing : ringings_)
    for (const int body : ringing.bodies) active[static_cast<std::size_t>(body)] = 1;
  activate_linked(active);
  sort_near();
  // What has gone apart is forgotten; what sleeps keeps its contacts.
  std::erase_if(pairs_, [&](const auto& entry) {
    const Pair& pair = entry.second;
    return pair.window != window_ && (moves(pair.a) || moves(pair.b));
  });
  any_active_ = false;
  bool any = false;
  for (int i = 0; i < count; ++i) {
    const auto n = static_cast<std::size_t>(i);
    if (!moves(i)) continue;
    any = true;
    if (active[n] || !options_.islands) {
      any_active_ = true;
      continue;
    }
    if (find_linked(i) != nullptr) continue;
    flying_[n] = 1;
    flew_from_[n] = states_[n];
    states_[n] = fly(solids_[n], states_[n], gravity_, length);
    check_finite(i);
    place_body(i);
    paces_[n].slow_s = 0.0;
    ++costs_.body_steps;
  }
  fly_windows_of_linked(active, length);
  if (any) ++costs_.steps;
  choose_steps(length);
}

/// Joins the groups that an impact may make one in this window: what sleeps between them wakes with it.
void Space::join_sleeping(Groups& groups) const {
  if (std::none_of(asleep_.begin(), asleep_.end(), [](char sleeps) { return sleeps != 0; })) return;
  const auto join = [&](const Pair& pair, bool touches) {
    if (touches && !is_fixed(pair.a) && !is_fixed(pair.b)) groups.join(pair.a, pair.b);
  };
  for (const Pair* pair : near_) join(*pair, true);
  for (const auto& [key, pair] : pairs_) join(pair, pair.touches());
  for (const Pair& pair : cord_pairs_) join(pair, pair.touches());
  for (const Linked& linked : linked_)
    for (const int body : linked.bodies) groups.join(linked.bodies.front(), body);
}

/// How finely each group of bodies that may meet in this window goes through it: some take several of the small steps at once.
void Space::choose_steps(double length_s) {
  const int count = static_cast<int>(solids_.size());
  Groups groups(count);
  for (const Pair* pair : near_)
    if (moves(pair->a) && moves(pair->b)) groups.join(pair->a, pair->b);
  islands_ = 0;
  for (int i = 0; i < count; ++i)
    if (!is_fixed(i) && groups.find(i) == i) ++islands_;
  join_sleeping(groups);
  const double g = norm(gravity_);
  std::vector<double> steps(solids_.size(), std::max(1.0, length_s / (kFlatSteps * options_.step_s)));
  const auto ask = [&](int body, double asked) {
    double& max = steps[static_cast<std::size_t>(groups.find(body))];
    max = std::max(max, asked);
  };
  for (const Pair* pair : near_) {
    const int body = moves(pair->a) ? pair->a : pair->b;
    if (!moves(body)) continue;
    // What is fast for its size must not pass through another between two looks, and what is thin must not sink in.
    const double speed = calc_pair_speed(pair->a, pair->b) + g * length_s;
    ask(body, 2.0 * length_s * speed / (kReach * calc_pair_size(pair->a, pair->b)));
    const bool is_thin = kFlatSteps * options_.step_s * speed > kThin * calc_pair_thickness(pair->a, pair->b);
    if (is_thin || pair->cord >= 0 || !is_flat(pair->a) || !is_flat(pair->b)) ask(body, length_s / options_.step_s);
  }
  for (int i = 0; i < count; ++i) {
    if (!moves(i)) continue;
    if (find_linked(i) != nullptr || has_impact(i)) ask(i, length_s / options_.step_s);
    // The arc of what turns fast leaves its chord by r (w h)^2 / 2 within a step.
    const auto n = static_cast<std::size_t>(i);
    const double sag = std::max(kSag, kSagOfThickness * solids_[n].shape->get_thickness_m());
    ask(i, length_s * norm(placed_[n].spin) * std::sqrt(solids_[n].radius_m / (2.0 * sag)));
  }
  // Powers of two: then the steps of a group are the same whatever others ask for.
  const auto round = [](double n) {
    return static_cast<int>(std::bit_ceil(static_cast<unsigned>(std::ceil(std::min(n, kMaxSteps) - 1e-6))));
  };
  steps_in_window_ = 1;
  for (int i = 0; i < count; ++i)
    if (any_active_ && moves(i)) steps_in_window_ = std::max(steps_in_window_, round(steps[static_cast<std::size_t>(groups.find(i))]));
  for (int i = 0; i < count; ++i) {
    const auto n = static_cast<std::size_t>(i);
    const int asked = round(options_.islands ? steps[static_cast<std::size_t>(groups.find(i))] : steps_in_window_);
    stride_[n] = std::max(1, steps_in_window_ / asked);
  }
  step_in_window_ = 0;
}

void Space::skip_window(double end_s) {
  ++window_;
  near_.clear();
  time_s_ = window_start_s_ = window_end_s_ = std::min(static_cast<double>(window_) * kWindow, end_s);
}

void Space::check_finite(int body) const {
  const State& s = states_[static_cast<std::size_t>(body)];
  double sum = 0.0;
  for (std::size_t k = 0; k < 3; ++k) sum += s.centre[k] + s.velocity[k] + s.momentum[k] + s.rotation[k];
  if (!std::isfinite(sum)) throw SolveError(fmt::format("the motion of body {} is not finite after {:.6f} s", body, time_s_));
}

void Space::search(Pair& pair, double step_s) {
  if (pair.cord >= 0) return stretch(pair);
  ++costs_.searches;
  const double speed = calc_pair_speed(pair.a, pair.b) + norm(gravity_) * step_s;
  pair.margin_m = std::min(std::max(2e-4, 4.0 * step_s * speed), kReach * calc_pair_size(pair.a, pair.b));
  pair.travelled_m = 0.0;
  pair.searched = true;
  std::vector<Contact> old = std::exchange(pair.contacts, {});
  touches_.clear();
  const auto a = static_cast<std::size_t>(pair.a);
  if (pair.b < 0) {
    shape::find_ground_touches(*solids_[a].shape, placed_[a].frame, ground_->height_m, pair.margin_m, pair.memory, touches_);
  } else {
    const auto b = static_cast<std::size_t>(pair.b);
    shape::find_touches(*solids_[a].shape, placed_[a].frame, *solids_[b].shape, placed_[b].frame, pair.margin_m, pair.memory, touches_);
  }
  for (const shape::Touch& touch : touches_) {
    const auto same = std::find_if(old.begin(), old.end(), [&](const Contact& c) { return c.touch.id == touch.id; });
    Contact contact;
    if (same != old.end()) {
      contact = *same;
    } else {
      contact.a = pair.a;
      contact.b = pair.b;
      contact.presses = is_pressed(pair, touch.where_m);
    }
    contact.touch = touch;
    pair.contacts.push_back(contact);
  }
}

void Space::refresh(Pair& pair) {
  if (pair.cord >= 0) return stretch(pair);
  const shape::Frame& a = placed_[static_cast<std::size_t>(pair.a)].frame;
  const shape::Frame b = pair.b >= 0 ? placed_[static_cast<std::size_t>(pair.b)].frame : shape::Frame{};
  for (Contact& c : pair.contacts) shape::refresh(c.touch, *solid(pair.a).shape, a, get_shape(pair.b), b, pair.memory);
}

/// The touches of a pair as of now, good for a step.
void Space::update(Pair& pair, double step_s) {
  if (pair.cord >= 0) return stretch(pair);
  const double way = (calc_pair_speed(pair.a, pair.b) + norm(gravity_) * step_s) * step_s;
  if (!pair.searched || pair.travelled_m + way > pair.margin_m)
    search(pair, step_s);
  else if (!pair.contacts.empty() && (pair.travelled_m > 0.0))
    refresh(pair);
  if (!(pair.sag_m > 0.0)) return;
  double deepest = 0.0;
  for (const Contact& c : pair.contacts) deepest = std::max(deepest, -c.touch.gap_m);
  pair.sag_m = std::min(pair.sag_m, deepest);
}

/// Wakes a body and what it carries, or it alone. They take the steps of the one that wakes them, which is due: so theirs do not depend on
/// other groups.
std::vector<int> Space::wake(int body, int by, bool alone) {
  std::vector<int> woken{body}, awake;
  while (!woken.empty()) {
    const int i = woken.back();
    woken.pop_back();
    const auto n = static_cast<std::size_t>(i);
    if (!asleep_[n]) continue;
    asleep_[n] = 0;
    awake.push_back(i);
    paces_[n].slow_s = 0.0;
    flying_[n] = 0;
    stride_[n] = stride_[static_cast<std::size_t>(by)];
    reach_m_s_[n] = norm(gravity_) * kWindow;
    for (auto& [key, pair] : pairs_) {
      if (key.first != i && key.second != i) continue;
      add_pair(key.first, key.second);
      const int other = key.first == i ? key.second : key.first;
      const bool sleeps = other >= 0 && asleep_[static_cast<std::size_t>(other)];
      if (!alone && pair.touches() && sleeps) woken.push_back(other);
      for (Contact& c : pair.contacts)
        if (!sleeps)
          c.rests = c.is_load = false;
        else if (dot((c.a == i ? 1.0 : -1.0) * c.rest_n, gravity_) <= 0.0)
          c.is_load = false;  // what sleeps under it bears what it gets
    }
    for (Pair& pair : cord_pairs_) {
      if (pair.a != i && pair.b != i) continue;
      add_cord(pair);
      const int other = pair.a == i ? pair.b : pair.a;
      Contact& c = pair.contacts.front();
      c.rests = c.is_load = false;
      if (c.touching && other >= 0) woken.push_back(other);
    }
    if (const Linked* linked = find_linked(i); linked != nullptr) woken.insert(woken.end(), linked->bodies.begin(), linked->bodies.end());
  }
  return awake;
}

/// What flew to the end of the window, to the end of the present step of the one that may meet it, whose steps it takes from there on.
void Space::call_back(int body, int by) {
  if (body < 0 || !flying_[static_cast<std::size_t>(body)]) return;
  const int stride = stride_[static_cast<std::size_t>(by)];
  const double flown_s = find_time(step_in_window_ + stride) - window_start_s_;
  if (Linked* linked = find_linked(body); linked != nullptr) {
    linked->now = fly_linked(*linked, linked->flew_from, flown_s);
    place_linked(*linked);
    for (const int other : linked->bodies) flying_[static_cast<std::size_t>(other)] = 0, stride_[static_cast<std::size_t>(other)] = stride;
    return;
  }
  const auto m = static_cast<std::size_t>(body);
  flying_[m] = 0;
  stride_[m] = stride;
  states_[m] = fly(solids_[m], flew_from_[m], gravity_, flown_s);
  place_body(body);
}

/// A body that an impact made faster than its window was planned for: what it may meet now.
void Space::reach_out(int body) {
  const auto n = static_cast<std::size_t>(body);
  const double left = window_end_s_ - time_s_;
  const double others_left = window_end_s_ - find_time(step_in_window_);  // of groups whose step is still to be made
  const double speed = norm(states_[n].velocity) + norm(placed_[n].spin) * solids_[n].radius_m + norm(gravity_) * left;
  if (speed <= reach_m_s_[n]) return;
  reach_m_s_[n] = speed;
  const shape::Box box = calc_box(body, speed * left + 1e-4);
  if (ground_ && box.low[2] < ground_->height_m) add_pair(body, -1);
  for (int j = 0; j < static_cast<int>(solids_.size()); ++j) {
    if (j == body) continue;
    const auto m = static_cast<std::size_t>(j);
    const shape::Box other = calc_box(j, moves(j) ? reach_m_s_[m] * (flying_[m] ? kWindow : others_left) + 1e-4 : 0.0);
    bool apart = false;
    for (std::size_t k = 0; k < 3; ++k) apart = apart || other.low[k] > box.high[k] || box.low[k] > other.high[k];
    if (apart) continue;
    if (!joined_.empty() && is_joined(body, j)) continue;
    call_back(j, body);
    add_pair(body, j);
  }
  for (Pair& pair : cord_pairs_)
    if (pair.a == body || pair.b == body) {
      call_back(pair.a, body);
      call_back(pair.b, body);
      add_cord(pair);
    }
}

std::vector<Space::Island> Space::make_islands() {
  Groups groups(static_cast<int>(solids_.size()));
  for (const Pair* pair : near_)
    if (!pair->contacts.empty() && moves(pair->a) && moves(pair->b) && is_due(pair->a) && is_due(pair->b)) groups.join(pair->a, pair->b);
  for (const Ringing& ringing : ringings_) {
    int first = -1;
    for (const int body : ringing.bodies) {
      if (!moves(body)) continue;
      if (first < 0) first = body;
      groups.join(first, body);
    }
  }
  for (const Linked& linked : linked_)
    if (moves(linked.bodies.front()))
      for (const int body : linked.bodies) groups.join(linked.bodies.front(), body);
  if (!options_.islands)
    for (int i = 0; i < static_cast<int>(solids_.size()); ++i)
      if (moves(i)) groups.join(0, i);
  std::vector<Island> islands;
  std::vector<int> number(solids_.size(), -1);
  for (int i = 0; i < static_cast<int>(solids_.size()); ++i) {
    if (!moves(i) || flying_[static_cast<std::size_t>(i)] || !is_due(i)) continue;
    int& n = number[static_cast<std::size_t>(groups.find(i))];
    if (n < 0) {
      n = static_cast<int>(islands.size());
      islands.emplace_back();
    }
    Island& island = islands[static_cast<std::size_t>(n)];
    island.stride =
        island.bodies.empty() ? stride_[static_cast<std::size_t>(i)] : std::min(island.stride, stride_[static_cast<std::size_t>(i)]);
    island.bodies.push_back(i);
  }
  for (const Island& island : islands)
    for (const int body : island.bodies) stride_[static_cast<std::size_t>(body)] = island.stride;
  for (Pair* pair : near_) {
    const int body = moves(pair->a) ? pair->a : pair->b;
    if (!moves(body) || !is_due(body)) continue;
    const int n = number[static_cast<std::size_t>(groups.find(body))];
    if (n >= 0) islands[static_cast<std::size_t>(n)].pairs.push_back(pair);
  }
  return islands;
}

/// When a small step of this window begins.
double Space::find_time(int step) const {
  return step >= steps_in_window_ ? window_end_s_ : window_start_s_ + (window_end_s_ - window_start_s_) * step / steps_in_window_;
}

void Space::step(double end_s) {
  if (at_window_) {
    if (options_.islands) rest_apart();
    open_window(end_s);
    at_window_ = false;
  } else if (any_active_) {
    ++costs_.steps;
  }
  const double from = find_time(step_in_window_);
  time_s_ = from;
  if (any_active_) {
    for (std::size_t n = 0; n < near_.size(); ++n) {  // waking adds pairs
      Pair& pair = *near_[n];
      const bool a_moves = moves(pair.a), b_moves = moves(pair.b);
      if ((!a_moves && !b_moves) || (a_moves && !is_due(pair.a)) || (b_moves && !is_due(pair.b))) continue;
      // Until both are due again.
      const int stride =
          std::max(a_moves ? stride_[static_cast<std::size_t>(pair.a)] : 1, b_moves ? stride_[static_cast<std::size_t>(pair.b)] : 1);
      const double step_s = find_time(step_in_window_ + stride) - from;
      watch(pair, step_s);
    }
    wake_unbalanced();
    sort_near();
    for (Island& island : make_islands()) {
      step_island(island, from, find_time(step_in_window_ + island.stride) - from);
      costs_.body_steps += static_cast<std::int64_t>(island.bodies.size());
    }
  }
  ++step_in_window_;
  time_s_ = find_time(step_in_window_);
  if (step_in_window_ == steps_in_window_) at_window_ = true;
}

}  // namespace carillon::rigid
