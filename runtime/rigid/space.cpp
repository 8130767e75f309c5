// Method: a touch that lasts is a row of one velocity problem a step; impulses act at the middle of the step and places follow from the
// mean of the
//   velocities at its two ends. With the arm from x0 + h v0 / 2 momentum and angular momentum of a free group are conserved to rounding,
//   and a contact that neither slides nor strikes does no work. Fast touches end the step at their instant, found on the paths of the step.
// Source: J. J. Moreau, "Unilateral contact and dry friction in finite freedom dynamics" (1988), the step with the impulse at its middle;
//   B. Mirtich, "Impulse-based dynamic simulation of rigid body systems" (1996), instants of impact.
// Deviations: impacts are no part of the step's problem; rest is proven by a solution with zero velocities.
#include "runtime/rigid/space.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <set>

#include "runtime/config/error.hpp"
#include "runtime/impact/predict.hpp"

namespace carillon::rigid {
namespace {

using impact::cross;
using impact::dot;

constexpr double kSlowest = 1e-3;   // m/s; a touch slower than this is no impact (a fall from 0.05 um)
constexpr double kTogether = 1e-4;  // s; touches nearer in time than this are one impact
constexpr double kLongestHertz = 20e-3;
constexpr double kTouch = 1e-7;       // m; nearer than this is in touch
constexpr double kInstant = 1e-9;     // m, s; how well an instant of impact is found
constexpr double kShortest = 1e-9;    // s; what is left of a step and shorter than this is not made
constexpr double kDeep = 2e-6;        // m; what is deeper comes up ...
constexpr double kFarTooDeep = 5e-5;  // m; ... from here on at any price
constexpr double kSettling = 0.02;    // m/s; a group that is slower is about to rest
constexpr double kAtRest = 1e-6;      // m/s
constexpr double kSlow = 5e-3;        // m/s; of what may be about to rest
constexpr double kPatience = 0.02;    // s; for so long
constexpr double kBalanced = 1e-4;    // of gravity: what a solution with zero velocity may leave
constexpr double kReach = 0.3;        // of the size of the smaller body: from so far touches are found
constexpr double kMostSteps = 1000;   // of a window
constexpr int kMostMissed = 30;       // in a step: instants at which nothing struck after all
constexpr int kMostImpacts = 8;       // of a group in a step

}  // namespace

double calc_hertz_duration(double young_a, double poisson_a, double young_b, double poisson_b, double curvature, double mass, double speed,
                           double largest_radius) {
  const double compliance = (1 - poisson_a * poisson_a) / young_a + (1 - poisson_b * poisson_b) / young_b;
  const double radius = 1.0 / std::clamp(std::max(curvature, 0.0), 1.0 / std::max(largest_radius, 0.5e-3), 1.0 / 0.5e-3);
  const double duration = 2.87 * std::pow(mass * mass * compliance * compliance / (radius * std::max(speed, 1e-3)), 0.2);
  return std::clamp(duration, 5e-6, kLongestHertz);
}

Space::Space(std::vector<Solid> solids, std::vector<State> states, std::optional<Ground> ground, const Vec3& gravity,
             const Options& options)
    : solids_(std::move(solids)), states_(std::move(states)), ground_(ground), gravity_(gravity), options_(options) {
  placed_.resize(solids_.size());
  asleep_.assign(solids_.size(), 0);
  flying_.assign(solids_.size(), 0);
  in_ringing_.assign(solids_.size(), 0);
  slow_s_.assign(solids_.size(), 0.0);
  reach_m_s_.assign(solids_.size(), 0.0);
  flew_from_ = states_;
  index_.assign(solids_.size(), -1);
  rings_.resize(solids_.size());
  for (std::size_t i = 0; i < solids_.size(); ++i) place_body(static_cast<int>(i));
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
    if (moves(pair->a) || (pair->b >= 0 && moves(pair->b)))
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

Space::Box Space::calc_box(int body, double grown_m) const {
  const auto i = static_cast<std::size_t>(body);
  auto [low, high] = solids_[i].shape->calc_box(placed_[i].frame);
  for (std::size_t k = 0; k < 3; ++k) low[k] -= grown_m, high[k] += grown_m;
  return {low, high};
}

void Space::add_pair(int a, int b) {
  if (b >= 0 && a > b) std::swap(a, b);
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
  std::sort(near_.begin(), near_.end(), [](const Pair* x, const Pair* y) { return std::pair(x->a, x->b) < std::pair(y->a, y->b); });
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
  std::vector<Box> boxes(solids_.size());
  std::vector<char> active(solids_.size(), 0);
  for (int i = 0; i < count; ++i) {
    const auto n = static_cast<std::size_t>(i);
    flying_[n] = 0;
    reach_m_s_[n] = moves(i) ? norm(states_[n].velocity) + norm(placed_[n].spin) * solids_[n].radius_m + g * length : 0.0;
    boxes[n] = calc_box(i, moves(i) ? reach_m_s_[n] * length + 1e-4 : 0.0);
    order.push_back(i);
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](int x, int y) { return boxes[static_cast<std::size_t>(x)].low[0] < boxes[static_cast<std::size_t>(y)].low[0]; });
  for (std::size_t p = 0; p < order.size(); ++p) {
    const int i = order[p];
    const Box& x = boxes[static_cast<std::size_t>(i)];
    if (moves(i) && ground_ && x.low[2] < ground_->height_m) add_pair(i, -1), active[static_cast<std::size_t>(i)] = 1;
    for (std::size_t q = p + 1; q < order.size(); ++q) {
      const int j = order[q];
      const Box& y = boxes[static_cast<std::size_t>(j)];
      if (y.low[0] > x.high[0]) break;
      if (y.low[1] > x.high[1] || x.low[1] > y.high[1] || y.low[2] > x.high[2] || x.low[2] > y.high[2]) continue;
      if (!moves(i) && !moves(j)) continue;
      add_pair(i, j);
      active[static_cast<std::size_t>(i)] = active[static_cast<std::size_t>(j)] = 1;
    }
  }
  for (const Ringing& ringing : ringings_)
    for (const int body : ringing.bodies) active[static_cast<std::size_t>(body)] = 1;
  sort_near();
  // What has gone apart is forgotten; what sleeps keeps its contacts.
  std::erase_if(pairs_, [&](const auto& entry) {
    const Pair& pair = entry.second;
    return pair.window != window_ && (moves(pair.a) || (pair.b >= 0 && moves(pair.b)));
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
    flying_[n] = 1;
    flew_from_[n] = states_[n];
    states_[n] = fly(solids_[n], states_[n], gravity_, length);
    check_finite(i);
    place_body(i);
    slow_s_[n] = 0.0;
    ++costs_.body_steps;
  }
  // What is fast for its size must not pass through another between two looks.
  double steps = length / options_.step_s;
  for (const Pair* pair : near_)
    steps = std::max(steps, 2.0 * length * (calc_pair_speed(pair->a, pair->b) + g * length) / (kReach * calc_pair_size(pair->a, pair->b)));
  steps_in_window_ = any_active_ ? std::max(1, static_cast<int>(std::ceil(std::min(steps, kMostSteps) - 1e-6))) : 1;
  step_in_window_ = 0;
  if (any) ++costs_.steps;
  count_groups(boxes);
}

void Space::skip_window(double end_s) {
  ++window_;
  near_.clear();
  time_s_ = window_start_s_ = window_end_s_ = std::min(static_cast<double>(window_) * kWindow, end_s);
}

/// Bodies that may meet in this window, as groups.
void Space::count_groups(const std::vector<Box>&) {
  std::vector<int> parent(solids_.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto find = [&](int i) {
    while (parent[static_cast<std::size_t>(i)] != i) i = parent[static_cast<std::size_t>(i)];
    return i;
  };
  for (const Pair* pair : near_)
    if (moves(pair->a) && pair->b >= 0 && moves(pair->b)) parent[static_cast<std::size_t>(find(pair->b))] = find(pair->a);
  islands_ = 0;
  for (int i = 0; i < static_cast<int>(solids_.size()); ++i)
    if (!solids_[static_cast<std::size_t>(i)].fixed && find(i) == i) ++islands_;
}

void Space::check_finite(int body) const {
  const State& s = states_[static_cast<std::size_t>(body)];
  double sum = 0.0;
  for (std::size_t k = 0; k < 3; ++k) sum += s.centre[k] + s.velocity[k] + s.momentum[k] + s.rotation[k];
  if (!std::isfinite(sum)) throw SolveError(fmt::format("the motion of body {} is not finite after {:.6f} s", body, time_s_));
}

void Space::search(Pair& pair, double step_s) {
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
      contact.since_s = time_s_;
      contact.presses = is_pressed(pair, touch.where_m);
    }
    contact.touch = touch;
    pair.contacts.push_back(contact);
  }
}

void Space::refresh(Pair& pair) {
  const auto a = static_cast<std::size_t>(pair.a);
  static const shape::Frame kWorld{{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}, {}};
  for (Contact& c : pair.contacts) {
    if (pair.b < 0)
      shape::refresh(c.touch, *solids_[a].shape, placed_[a].frame, nullptr, kWorld, pair.memory);
    else
      shape::refresh(c.touch, *solids_[a].shape, placed_[a].frame, solids_[static_cast<std::size_t>(pair.b)].shape.get(),
                     placed_[static_cast<std::size_t>(pair.b)].frame, pair.memory);
  }
}

void Space::wake(int body) {
  std::vector<int> woken{body};
  while (!woken.empty()) {
    const int i = woken.back();
    woken.pop_back();
    const auto n = static_cast<std::size_t>(i);
    if (!asleep_[n]) continue;
    asleep_[n] = 0;
    slow_s_[n] = 0.0;
    flying_[n] = 0;
    reach_m_s_[n] = norm(gravity_) * kWindow;
    for (auto& [key, pair] : pairs_) {
      if (key.first != i && key.second != i) continue;
      add_pair(key.first, key.second);
      const int other = key.first == i ? key.second : key.first;
      const bool touching = std::any_of(pair.contacts.begin(), pair.contacts.end(), [](const Contact& c) { return c.touching; });
      if (touching && other >= 0 && asleep_[static_cast<std::size_t>(other)]) woken.push_back(other);
    }
  }
}

/// A body that an impact made faster than its window was planned for: what it may meet now.
void Space::reach_out(int body) {
  const auto n = static_cast<std::size_t>(body);
  const double left = window_end_s_ - time_s_;
  const double speed = norm(states_[n].velocity) + norm(placed_[n].spin) * solids_[n].radius_m + norm(gravity_) * left;
  if (speed <= reach_m_s_[n]) return;
  reach_m_s_[n] = speed;
  const Box box = calc_box(body, speed * left + 1e-4);
  if (ground_ && box.low[2] < ground_->height_m) add_pair(body, -1);
  for (int j = 0; j < static_cast<int>(solids_.size()); ++j) {
    if (j == body) continue;
    const auto m = static_cast<std::size_t>(j);
    const Box other = calc_box(j, moves(j) ? reach_m_s_[m] * (flying_[m] ? kWindow : left) + 1e-4 : 0.0);
    bool apart = false;
    for (std::size_t k = 0; k < 3; ++k) apart = apart || other.low[k] > box.high[k] || box.low[k] > other.high[k];
    if (apart) continue;
    if (flying_[m]) {
      // Back from the end of the window to where it is now.
      flying_[m] = 0;
      states_[m] = fly(solids_[m], flew_from_[m], gravity_, time_s_ - window_start_s_);
      place_body(j);
    }
    add_pair(body, j);
  }
}

std::vector<Space::Island> Space::make_islands() {
  std::vector<int> parent(solids_.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto find = [&](int i) {
    while (parent[static_cast<std::size_t>(i)] != i)
      i = parent[static_cast<std::size_t>(i)] = parent[static_cast<std::size_t>(parent[static_cast<std::size_t>(i)])];
    return i;
  };
  for (const Pair* pair : near_) {
    if (pair->contacts.empty() || pair->b < 0 || !moves(pair->a) || !moves(pair->b)) continue;
    const auto [low, high] = std::minmax({find(pair->a), find(pair->b)});
    parent[static_cast<std::size_t>(high)] = low;
  }
  for (const Ringing& ringing : ringings_) {
    int first = -1;
    for (const int body : ringing.bodies) {
      if (!moves(body)) continue;
      if (first < 0) first = body;
      const auto [low, high] = std::minmax({find(first), find(body)});
      parent[static_cast<std::size_t>(high)] = low;
    }
  }
  if (!options_.islands)
    for (int i = 0; i < static_cast<int>(solids_.size()); ++i)
      if (moves(i)) parent[static_cast<std::size_t>(i)] = 0;
  std::vector<Island> islands;
  std::vector<int> number(solids_.size(), -1);
  for (int i = 0; i < static_cast<int>(solids_.size()); ++i) {
    if (!moves(i) || flying_[static_cast<std::size_t>(i)]) continue;
    int& n = number[static_cast<std::size_t>(find(i))];
    if (n < 0) {
      n = static_cast<int>(islands.size());
      islands.emplace_back();
    }
    islands[static_cast<std::size_t>(n)].bodies.push_back(i);
  }
  for (Pair* pair : near_) {
    const int body = moves(pair->a) ? pair->a : pair->b;
    if (body < 0 || !moves(body)) continue;
    const int n = number[static_cast<std::size_t>(find(body))];
    if (n >= 0) islands[static_cast<std::size_t>(n)].pairs.push_back(pair);
  }
  return islands;
}

void Space::step(double end_s) {
  if (at_window_) {
    open_window(end_s);
    at_window_ = false;
  } else if (any_active_) {
    ++costs_.steps;
  }
  const double from = window_start_s_ + (window_end_s_ - window_start_s_) * step_in_window_ / steps_in_window_;
  const double to = step_in_window_ + 1 == steps_in_window_
                        ? window_end_s_
                        : window_start_s_ + (window_end_s_ - window_start_s_) * (step_in_window_ + 1) / steps_in_window_;
  time_s_ = from;
  if (any_active_) {
    const double step_s = to - from;
    for (std::size_t n = 0; n < near_.size(); ++n) {  // waking adds pairs
      Pair& pair = *near_[n];
      const bool a_moves = moves(pair.a), b_moves = pair.b >= 0 && moves(pair.b);
      if (!a_moves && !b_moves) continue;
      update(pair, step_s);
      if (pair.b < 0 || (a_moves && b_moves)) continue;
      for (const int body : {pair.a, pair.b}) {
        if (!asleep_[static_cast<std::size_t>(body)]) continue;
        for (const Contact& c : pair.contacts) {
          const double approach = dot(calc_velocity(pair.b, c.touch.where_m) - calc_velocity(pair.a, c.touch.where_m), c.touch.normal);
          if (c.touch.gap_m - approach * step_s - 0.5 * norm(gravity_) * step_s * step_s > kTouch) continue;
          wake(body);
          break;
        }
      }
    }
    sort_near();
    for (Island& island : make_islands()) {
      step_island(island, from, step_s);
      costs_.body_steps += static_cast<std::int64_t>(island.bodies.size());
    }
  }
  time_s_ = to;
  ++step_in_window_;
  if (step_in_window_ == steps_in_window_) at_window_ = true;
}

/// The touches of a pair as of now, good for a step.
void Space::update(Pair& pair, double step_s) {
  const double way = (calc_pair_speed(pair.a, pair.b) + norm(gravity_) * step_s) * step_s;
  if (!pair.searched || pair.travelled_m + way > pair.margin_m)
    search(pair, step_s);
  else if (!pair.contacts.empty() && (pair.travelled_m > 0.0))
    refresh(pair);
}

State Space::calc_moved(int body, const Mover& mover, const Vec3& turned, double part_s, double step_s) const {
  const auto i = static_cast<std::size_t>(body);
  State to = fly(solids_[i], states_[i], gravity_, part_s);
  const Vec3 gained = (1.0 / step_s) * (mover.velocity - (states_[i].velocity + step_s * gravity_));
  to.velocity = to.velocity + part_s * gained;
  to.centre = to.centre + (0.5 * part_s * part_s) * gained;
  const Vec3 spun = mover.spin - free_spin_[static_cast<std::size_t>(index_[i])];
  to.rotation = normalise(multiply(make_turn((0.5 * part_s * part_s / step_s) * spun), to.rotation));
  to.momentum = to.momentum + (part_s / step_s) * turned;
  return to;
}

void Space::step_island(Island& island, double start_s, double step_s) {
  for (std::size_t n = 0; n < island.bodies.size(); ++n) index_[static_cast<std::size_t>(island.bodies[n])] = static_cast<int>(n);
  stepped_ = &island.bodies;
  double done = 0.0;
  int impacts = 0, missed = 0;
  const double g = norm(gravity_);
  while (step_s - done > kShortest) {
    const double h = step_s - done;
    time_s_ = start_s + done;
    const bool slow = impacts == 0 && done == 0.0 && may_rest(island);
    if (slow && rests(island, h)) break;
    release_what_rests(island);
    predict(island, h, false);
    make_points(island, h, impacts < kMostImpacts);
    const double tolerance = options_.tolerance * std::max(g, 1.0) * h;
    const double energy_before = calc_energy(island);
    solve(tolerance);
    double at = h;
    std::vector<std::pair<Pair*, std::size_t>> first;
    const bool struck = impacts < kMostImpacts && find_impact(island, h, at, first);
    // Places and velocities at the end of the part, and what the contacts took along.
    std::vector<Vec3> turned(island.bodies.size());
    for (const Point& p : points_) {
      if (p.a >= 0) turned[static_cast<std::size_t>(p.a)] = turned[static_cast<std::size_t>(p.a)] + cross(p.arm_a, p.impulse) + p.couple;
      if (p.b >= 0) turned[static_cast<std::size_t>(p.b)] = turned[static_cast<std::size_t>(p.b)] - cross(p.arm_b, p.impulse) - p.couple;
    }
    for (std::size_t n = 0; n < points_.size(); ++n) {
      Contact& c = rows_[n].pair->contacts[rows_[n].contact];
      c.impulse = points_[n].impulse;
      c.couple = points_[n].couple;
      c.step_s = h;
      c.lost_j = calc_loss(points_[n], 1.0);
      lost_j_ += at < h ? calc_loss(points_[n], at / h) : c.lost_j;
      const double push = dot(c.impulse, c.touch.normal);
      const bool touching = push > 0.0 || (c.touching && c.touch.gap_m <= kTouch);
      if (touching != c.touching) c.since_s = time_s_;
      c.touching = touching;
    }
    for (Pair* pair : island.pairs) pair->travelled_m += (calc_pair_speed(pair->a, pair->b) + g * h) * at + 1e-12;
    bool rings = false;
    std::vector<State> moved;
    std::vector<char> is_ringing;  // one that ends in this part has been moved by it, too
    for (std::size_t n = 0; n < island.bodies.size(); ++n) {
      is_ringing.push_back(in_ringing_[static_cast<std::size_t>(island.bodies[n])]);
      rings = rings || is_ringing.back() != 0;
      moved.push_back(calc_moved(island.bodies[n], movers_[n], turned[n], at, h));
    }
    if (rings) advance_ringings(island, start_s + done + at, at, h);
    for (std::size_t n = 0; n < island.bodies.size(); ++n) {
      const int body = island.bodies[n];
      if (!is_ringing[n]) states_[static_cast<std::size_t>(body)] = moved[n];
      check_finite(body);
    }
    for (const int body : island.bodies) place_body(body);
    if (!rings) take_gain(island, energy_before);
    done += at;
    if (struck) {
      time_s_ = start_s + done;
      for (Pair* pair : island.pairs)
        if (!pair->contacts.empty()) refresh(*pair);
      if (confirm_impact(first, step_s - done, kDeep * (1 + missed))) {
        strike(island, first, time_s_);
        ++costs_.impacts;
        ++impacts;
      } else if (++missed > kMostMissed) {
        impacts = kMostImpacts;
      }
    }
    if (step_s - done > kShortest)
      for (Pair* pair : island.pairs) update(*pair, step_s - done);
  }
  for (const int body : island.bodies) index_[static_cast<std::size_t>(body)] = -1;
}

/// Small groups at once; large ones in sweeps, which begin at the impulses of the step before.
void Space::solve(double tolerance_m_s) {
  ++costs_.solves;
  if (points_.empty()) return;
  const std::vector<Mover> free = movers_;
  const std::vector<Point> begun = points_;
  // Contacts take energy from the motion without them, or none.
  const auto gains = [&] {
    double gained = 0.0, size = 0.0;
    for (const Point& p : points_) {
      const double work = 0.5 * dot(p.impulse, calc_relative_velocity(free, p) + calc_relative_velocity(movers_, p));
      gained += work;
      size += std::abs(work);
    }
    return gained > 1e-9 * size;
  };
  // What is about to rest is worth it: sweeps would let a pile tremble for long.
  double fastest = 0.0;
  for (std::size_t n = 0; n < stepped_->size(); ++n) {
    const auto i = static_cast<std::size_t>((*stepped_)[n]);
    fastest = std::max(fastest, norm(states_[i].velocity) + norm(placed_[i].spin) * solids_[i].radius_m);
  }
  const int most_direct = fastest < kSettling ? options_.most_settling : options_.most_direct;
  if (static_cast<int>(movers_.size()) <= most_direct) {
    if (solver_.solve_directly(movers_, points_, 12) && !gains()) return;
    movers_ = free;
    points_ = begun;
  }
  solver_.solve(movers_, points_, tolerance_m_s, options_.most_sweeps);
  costs_.sweeps += solver_.get_sweeps();
  if (!gains()) return;
  // Sweeps that begin at zero impulses never add any.
  movers_ = free;
  points_ = begun;
  for (Point& p : points_) p.impulse = p.couple = {};
  solver_.solve(movers_, points_, tolerance_m_s, options_.most_sweeps);
  costs_.sweeps += solver_.get_sweeps();
}

/// Kinetic and of gravity [J].
double Space::calc_energy(const Island& island) const {
  double sum = 0.0;
  for (const int body : island.bodies) {
    const auto i = static_cast<std::size_t>(body);
    sum += rigid::calc_kinetic(solids_[i], states_[i], placed_[i]) - solids_[i].mass_kg * dot(gravity_, states_[i].centre);
  }
  return sum;
}

/// Contacts do no work on a group, but for rounding, for what comes up from too deep and for surfaces whose curvature changes within a
/// step. What the group gained by that its motion pays back, where it touches what does not move (a free group would lose momentum).
void Space::take_gain(const Island& island, double before_j) {
  const double gained = calc_energy(island) - before_j;
  if (!(gained > 0.0)) return;
  bool leans = false;
  for (const RowOf& row : rows_)
    leans = leans || is_fixed(row.pair->a) || is_fixed(row.pair->b) || !moves(row.pair->a) || !moves(row.pair->b);
  if (!leans) return;
  double kinetic = 0.0;
  for (const int body : island.bodies) {
    const auto i = static_cast<std::size_t>(body);
    kinetic += rigid::calc_kinetic(solids_[i], states_[i], placed_[i]);
  }
  lost_j_ += std::min(gained, kinetic);
  const double part = kinetic > gained ? std::sqrt(1.0 - gained / kinetic) : 0.0;
  for (const int body : island.bodies) {
    State& s = states_[static_cast<std::size_t>(body)];
    s.velocity = part * s.velocity;
    s.momentum = part * s.momentum;
    place_body(body);
  }
}

/// What a point took from the motion in the first part of a step [J]: its impulses times the means of the velocities before and after.
double Space::calc_loss(const Point& p, double part) const {
  Vec3 u = part * calc_relative_velocity(movers_, p), w = part * calc_relative_spin(movers_, p);
  const auto add = [&](int index, const Vec3& arm, double sign) {
    if (index < 0) return;
    const auto i = static_cast<std::size_t>((*stepped_)[static_cast<std::size_t>(index)]);
    u = u + ((2.0 - part) * sign) * (states_[i].velocity + cross(placed_[i].spin, arm));
    w = w + ((2.0 - part) * sign) * placed_[i].spin;
  };
  add(p.a, p.arm_a, 1.0);
  add(p.b, p.arm_b, -1.0);
  return -0.5 * part * (dot(p.impulse, u) + dot(p.couple, w));
}

/// What every body of the group does without contacts; `at_rest`: as if it had no velocity.
void Space::predict(const Island& island, double h, bool at_rest) {
  movers_.resize(island.bodies.size());
  free_spin_.resize(island.bodies.size());
  free_.resize(island.bodies.size());
  for (std::size_t n = 0; n < island.bodies.size(); ++n) {
    const auto i = static_cast<std::size_t>(island.bodies[n]);
    State from = states_[i];
    if (at_rest) from.velocity = from.momentum = {};
    const State to = fly(solids_[i], from, gravity_, h);
    const Placed there = place(solids_[i], to);
    movers_[n] = {1.0 / solids_[i].mass_kg, there.inverse_inertia, to.velocity, there.spin};
    free_spin_[n] = there.spin;
    free_[n] = there;
  }
}

void Space::make_points(Island& island, double h, bool leaves_impacts) {
  points_.clear();
  rows_.clear();
  for (Pair* pair : island.pairs) {
    if (!is_stepped(*pair)) continue;
    const double friction = calc_pair_friction(pair->a, pair->b);
    for (std::size_t k = 0; k < pair->contacts.size(); ++k) {
      Contact& c = pair->contacts[k];
      const shape::Touch& t = c.touch;
      const Vec3 u0 = calc_velocity(pair->a, t.where_m) - calc_velocity(pair->b, t.where_m);
      const double approach = -dot(u0, t.normal);
      if (c.presses || (leaves_impacts && is_fast(c, approach, h))) continue;
      // The impact has these bodies; what stands still and rings goes on carrying others.
      if (has_impact(pair->a) || has_impact(pair->b)) continue;
      if (t.gap_m > kTouch + 2.0 * h * std::max(approach, 0.0) + 4.0 * norm(gravity_) * h * h && !c.touching) continue;
      Point p;
      p.a = moves(pair->a) ? index_[static_cast<std::size_t>(pair->a)] : -1;
      p.b = pair->b >= 0 && moves(pair->b) ? index_[static_cast<std::size_t>(pair->b)] : -1;
      p.normal = t.normal;
      p.friction = friction;
      // Where the impulse acts: half a step on, the same point for both bodies.
      struct Side {
        Vec3 middle{}, first{}, last{};  // centre half a step on; arms at both ends
      };
      const auto make_side = [&](int body, int index) {
        const auto i = static_cast<std::size_t>(body), n = static_cast<std::size_t>(index);
        Side side;
        side.middle = states_[i].centre + (0.5 * h) * states_[i].velocity;
        side.first = t.where_m - states_[i].centre;
        side.last = t.smooth ? side.first : free_[n].rotation * (transpose(placed_[i].rotation) * side.first);
        return side;
      };
      Vec3 where{};
      Side sa, sb;
      if (p.a >= 0) sa = make_side(pair->a, p.a), where = sa.middle + 0.5 * (sa.first + sa.last);
      if (p.b >= 0) {
        sb = make_side(pair->b, p.b);
        const Vec3 other = sb.middle + 0.5 * (sb.first + sb.last);
        where = p.a >= 0 ? 0.5 * (where + other) : other;
      }
      // What the arms turn beyond that point until the end of the step belongs to the velocity there.
      Vec3 beyond{};
      if (p.a >= 0) {
        p.arm_a = where - sa.middle;
        beyond = beyond + cross(free_spin_[static_cast<std::size_t>(p.a)], 0.5 * (sa.last - sa.first));
      }
      if (p.b >= 0) {
        p.arm_b = where - sb.middle;
        beyond = beyond - cross(free_spin_[static_cast<std::size_t>(p.b)], 0.5 * (sb.last - sb.first));
      }
      // What touches and is at rest stays so exactly: a picometre is no gap, and would be a force.
      const bool rests = t.gap_m <= kTouch && c.touching && std::abs(approach) < kAtRest;
      double least = rests ? 0.0 : std::min(0.0, approach - 2.0 * t.gap_m / h);
      // What is too deep comes up, at half the power that the contact loses, so that no energy comes of it.
      if (t.gap_m < -kDeep) {
        const double push = dot(c.impulse, t.normal), paid = push > 0.0 ? 0.5 * c.lost_j / push : 0.0;
        const double up = std::min(0.02 * (-kDeep - t.gap_m) / h, t.gap_m < -kFarTooDeep ? 0.005 : paid);
        if (approach > -up) least = up;
      }
      p.wanted = least * t.normal - beyond;
      const double curvature = t.curvature_a_per_m + t.curvature_b_per_m;
      if (t.smooth && curvature > 0.0) {
        p.rolling_m = options_.rolling_resistance / curvature;
        p.twisting_m = 1e-2 * friction / curvature;
      }
      p.impulse = (c.step_s > 0.0 ? h / c.step_s : 0.0) * c.impulse;
      p.couple = (c.step_s > 0.0 ? h / c.step_s : 0.0) * c.couple;
      points_.push_back(p);
      rows_.push_back({pair, k});
    }
  }
  // From below to above, so that a sweep carries the weight down a pile.
  order_.resize(points_.size());
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  const auto height = [&](std::size_t n) { return -dot(rows_[n].pair->contacts[rows_[n].contact].touch.where_m, gravity_); };
  std::stable_sort(order_.begin(), order_.end(), [&](std::size_t x, std::size_t y) { return height(x) < height(y); });
  std::vector<Point> points;
  std::vector<RowOf> rows;
  for (const std::size_t n : order_) points.push_back(points_[n]), rows.push_back(rows_[n]);
  points_.swap(points);
  rows_.swap(rows);
}

/// Will this touch come so fast within the step that it strikes?
bool Space::is_fast(const Contact& c, double approach, double h) const {
  if (c.presses || (c.touching && c.touch.gap_m <= kTouch)) return false;
  const double gap = std::max(c.touch.gap_m, 0.0);
  double pull = 0.0;  // closing acceleration in flight
  if (moves(c.a)) pull -= dot(gravity_, c.touch.normal);
  if (c.b >= 0 && moves(c.b)) pull += dot(gravity_, c.touch.normal);
  const double square = approach * approach + 2.0 * std::max(pull, 0.0) * gap;
  if (square <= kSlowest * kSlowest) return false;
  // What has just rebounded comes back within the step only if it is slow.
  if (approach < 0.0) return pull > 0.0 && -approach + std::sqrt(square) <= pull * h;
  return gap <= approach * h + 0.5 * norm(gravity_) * h * h + 1e-6;
}

/// The first instant, from now, at which a fast touch closes on the paths of the step.
bool Space::find_impact(const Island& island, double h, double& at_s, std::vector<std::pair<Pair*, std::size_t>>& first) {
  struct Candidate {
    Pair* pair;
    std::size_t contact;
    double at;
  };
  std::vector<Candidate> candidates;
  for (Pair* pair : island.pairs)
    for (std::size_t k = 0; k < pair->contacts.size() && is_stepped(*pair); ++k) {
      const Contact& c = pair->contacts[k];
      const Vec3 u0 = calc_velocity(pair->a, c.touch.where_m) - calc_velocity(pair->b, c.touch.where_m);
      const double approach = -dot(u0, c.touch.normal);
      if (!is_fast(c, approach, h)) continue;
      Point p;
      p.a = moves(pair->a) ? index_[static_cast<std::size_t>(pair->a)] : -1;
      p.b = pair->b >= 0 && moves(pair->b) ? index_[static_cast<std::size_t>(pair->b)] : -1;
      if (p.a >= 0) p.arm_a = c.touch.where_m - states_[static_cast<std::size_t>(pair->a)].centre;
      if (p.b >= 0) p.arm_b = c.touch.where_m - states_[static_cast<std::size_t>(pair->b)].centre;
      const double later = -dot(calc_relative_velocity(movers_, p), c.touch.normal), rate = (later - approach) / h;
      // gap = approach s + rate s^2 / 2
      const double gap = std::max(c.touch.gap_m, 0.0), root = approach * approach + 2.0 * rate * gap;
      if (root < 0.0) continue;
      if (approach <= 0.0 && rate <= 0.0) continue;
      const double at = approach > 0.0 ? 2.0 * gap / (approach + std::sqrt(root)) : (std::sqrt(root) - approach) / rate;
      if (at <= h) candidates.push_back({pair, k, at});
    }
  if (candidates.empty()) return false;
  const auto earliest = std::min_element(candidates.begin(), candidates.end(), [](const auto& x, const auto& y) { return x.at < y.at; });
  // The path is not quite straight: the instant of the first is looked for on it.
  double at = earliest->at;
  Contact trial = earliest->pair->contacts[earliest->contact];
  std::vector<Vec3> turned(island.bodies.size());
  for (const Point& p : points_) {
    if (p.a >= 0) turned[static_cast<std::size_t>(p.a)] = turned[static_cast<std::size_t>(p.a)] + cross(p.arm_a, p.impulse) + p.couple;
    if (p.b >= 0) turned[static_cast<std::size_t>(p.b)] = turned[static_cast<std::size_t>(p.b)] - cross(p.arm_b, p.impulse) - p.couple;
  }
  const auto look = [&](double s) {
    static const shape::Frame kWorld{{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}, {}};
    const auto get_frame = [&](int body) {
      if (body < 0) return kWorld;
      const auto i = static_cast<std::size_t>(body);
      if (!moves(body)) return placed_[i].frame;
      return place(solids_[i],
                   calc_moved(body, movers_[static_cast<std::size_t>(index_[i])], turned[static_cast<std::size_t>(index_[i])], s, h))
          .frame;
    };
    trial.touch = earliest->pair->contacts[earliest->contact].touch;
    const Pair& pair = *earliest->pair;
    shape::refresh(trial.touch, *solid(pair.a).shape, get_frame(pair.a), pair.b >= 0 ? solid(pair.b).shape.get() : nullptr,
                   get_frame(pair.b), earliest->pair->memory);
    return trial.touch.gap_m;
  };
  if (at > 0.0) {
    double s0 = 0.0, g0 = earliest->pair->contacts[earliest->contact].touch.gap_m, s1 = at, g1 = look(s1);
    for (int n = 0; n < 8 && std::abs(g1) > kInstant && s1 != s0 && g1 != g0; ++n) {
      const double s2 = std::clamp(s1 - g1 * (s1 - s0) / (g1 - g0), 0.0, h);
      s0 = s1;
      g0 = g1;
      s1 = s2;
      g1 = look(s1);
    }
    at = s1;
    if (g1 > 1e-6) return false;  // it does not come so far within the step after all
  }
  at_s = at;
  for (const Candidate& c : candidates)
    if (c.at <= earliest->at + kTogether) first.emplace_back(c.pair, c.contact);
  return true;
}

/// Looks at the pairs of an impact again, as they are at its instant: an edge that passes another one close by was taken for a plane until
/// now. Leaves what really strikes.
bool Space::confirm_impact(std::vector<std::pair<Pair*, std::size_t>>& first, double step_s, double near_m) {
  std::vector<Pair*> pairs;
  for (const auto& [pair, contact] : first)
    if (std::find(pairs.begin(), pairs.end(), pair) == pairs.end()) pairs.push_back(pair);
  first.clear();
  bool any = false;
  for (Pair* pair : pairs) {
    search(*pair, std::max(step_s, 1e-5));
    refresh(*pair);
    for (std::size_t k = 0; k < pair->contacts.size(); ++k) {
      const Contact& c = pair->contacts[k];
      const double approach = -dot(calc_velocity(pair->a, c.touch.where_m) - calc_velocity(pair->b, c.touch.where_m), c.touch.normal);
      if (c.presses || approach <= 0.5 * kSlowest || (c.touching && c.touch.gap_m <= kTouch) ||
          c.touch.gap_m > std::max(approach * kTogether + kTouch, near_m))
        continue;
      first.emplace_back(pair, k);
      any = any || c.touch.gap_m <= near_m;
    }
  }
  return any;
}

void Space::strike(Island& island, const std::vector<std::pair<Pair*, std::size_t>>& first, double time_s) {
  // The points that strike now, and those in touch with the bodies that they move, three bodies far.
  std::vector<std::pair<Pair*, std::size_t>> taken = first;
  std::set<int> bodies;
  for (const auto& [pair, k] : first) bodies.insert(pair->a), bodies.insert(pair->b);
  for (int far = 0; far < 3; ++far) {
    std::set<int> next = bodies;
    for (Pair* pair : island.pairs) {
      if (!is_stepped(*pair)) continue;
      if (!bodies.contains(moves(pair->a) ? pair->a : -2) && !bodies.contains(pair->b >= 0 && moves(pair->b) ? pair->b : -2)) continue;
      for (std::size_t k = 0; k < pair->contacts.size(); ++k) {
        const Contact& c = pair->contacts[k];
        const double approach = -dot(calc_velocity(pair->a, c.touch.where_m) - calc_velocity(pair->b, c.touch.where_m), c.touch.normal);
        if (c.presses) continue;
        const bool soon = c.touch.gap_m - approach * kTogether <= kTouch;
        if (!soon && !(c.touching && c.touch.gap_m <= kDeep)) continue;
        const std::pair<Pair*, std::size_t> entry{pair, k};
        if (std::find(taken.begin(), taken.end(), entry) == taken.end()) taken.push_back(entry);
        next.insert(pair->a);
        next.insert(pair->b);
      }
    }
    if (next == bodies) break;
    bodies = next;
  }
  std::sort(taken.begin(), taken.end(), [](const auto& x, const auto& y) {
    return std::tuple(x.first->a, x.first->b, x.second) < std::tuple(y.first->a, y.first->b, y.second);
  });
  Strike record;
  record.time_s = time_s;
  for (std::size_t n = 0; n < island.bodies.size(); ++n) {
    const auto i = static_cast<std::size_t>(island.bodies[n]);
    movers_[n] = {1.0 / solids_[i].mass_kg, placed_[i].inverse_inertia, states_[i].velocity, placed_[i].spin};
  }
  const std::vector<Mover> before = movers_;
  std::vector<Point> points;
  double scale = kSlowest;
  for (const auto& [pair, k] : taken) {
    const Contact& c = pair->contacts[k];
    Point p;
    p.a = moves(pair->a) ? index_[static_cast<std::size_t>(pair->a)] : -1;
    p.b = pair->b >= 0 && moves(pair->b) ? index_[static_cast<std::size_t>(pair->b)] : -1;
    p.normal = c.touch.normal;
    if (p.a >= 0) p.arm_a = c.touch.where_m - states_[static_cast<std::size_t>(pair->a)].centre;
    if (p.b >= 0) p.arm_b = c.touch.where_m - states_[static_cast<std::size_t>(pair->b)].centre;
    p.friction = calc_pair_friction(pair->a, pair->b);
    Hit hit;
    hit.a = pair->a;
    hit.b = pair->b;
    hit.touch = c.touch;
    hit.approach_m_s = -dot(calc_relative_velocity(movers_, p), p.normal);
    scale = std::max(scale, std::abs(hit.approach_m_s));
    const double inverse_mass = dot(p.normal, calc_mobility(movers_, p) * p.normal);
    const double e = calc_pair_restitution(pair->a, pair->b);
    if (hit.approach_m_s > kSlowest && !(c.touching && c.touch.gap_m <= kTouch)) {
      // A rebound whose flight, 2 e v / g, is shorter than the contact itself is none: weight keeps the surfaces together.
      const double pull = std::abs(dot(gravity_, p.normal)), flight = 2.0 * e * hit.approach_m_s;
      hit.restitution = flight > pull * calc_contact_time(hit, 1.0 / inverse_mass, hit.approach_m_s) ? e : 0.0;
    }
    p.wanted = (hit.approach_m_s > kSlowest ? hit.restitution * hit.approach_m_s : 0.0) * p.normal;
    // Across, it may stick where it stops.
    points.push_back(p);
    record.hits.push_back(hit);
  }
  if (!record.hits.empty() && predict_hits(taken, record.hits, points) && begin_ringing(taken, record.hits, time_s)) return;
  // A rigid impact ends the impacts with modes that its bodies were moved by.
  for (const Hit& hit : record.hits)
    for (const int body : {hit.a, hit.b})
      if (has_impact(body)) {
        release(*find_ringing(body), time_s);
        ringings_.remove_if([](const Ringing& r) { return r.impact == nullptr; });
      }
  solver_.share(movers_, points, static_cast<int>(std::min<std::size_t>(20 * points.size(), 400)));
  solver_.solve_on(movers_, points, 1e-9 * scale, points.size() <= 16 ? 1000 : 60);
  // With friction Newton's restitution can gain energy (Kane 1984): then all impulses are scaled back to where it does not.
  double linear = 0.0, square = 0.0;
  for (const Point& p : points) {
    const Vec3 u0 = calc_relative_velocity(before, p), u1 = calc_relative_velocity(movers_, p);
    linear += dot(p.impulse, u0);
    square += 0.5 * dot(p.impulse, u1 - u0);
  }
  const double part = linear + square <= 0.0 || square <= 0.0 ? 1.0 : std::clamp(-linear / square, 0.0, 1.0);
  std::set<int> moved;
  for (std::size_t n = 0; n < points.size(); ++n) {
    const Point& p = points[n];
    const Vec3 impulse = part * p.impulse;
    record.hits[n].impulse = impulse;
    if (impulse == Vec3{}) continue;
    for (const bool is_a : {true, false}) {
      const int index = is_a ? p.a : p.b;
      if (index >= 0) moved.insert(is_a ? record.hits[n].a : record.hits[n].b);
    }
  }
  for (const int body : moved) {
    record.bodies.push_back(body);
    record.before.push_back(states_[static_cast<std::size_t>(body)]);
  }
  for (std::size_t n = 0; n < points.size(); ++n) {
    const Point& p = points[n];
    const Vec3& impulse = record.hits[n].impulse;
    if (p.a >= 0) {
      State& s = states_[static_cast<std::size_t>(record.hits[n].a)];
      s.velocity = s.velocity + movers_[static_cast<std::size_t>(p.a)].inverse_mass * impulse;
      s.momentum = s.momentum + cross(p.arm_a, impulse);
    }
    if (p.b >= 0) {
      State& s = states_[static_cast<std::size_t>(record.hits[n].b)];
      s.velocity = s.velocity - movers_[static_cast<std::size_t>(p.b)].inverse_mass * impulse;
      s.momentum = s.momentum - cross(p.arm_b, impulse);
    }
  }
  double taken_j = 0.0;
  for (std::size_t n = 0; n < record.bodies.size(); ++n) {
    const auto i = static_cast<std::size_t>(record.bodies[n]);
    taken_j += rigid::calc_kinetic(solids_[i], record.before[n]) - rigid::calc_kinetic(solids_[i], states_[i]);
  }
  give_to_modes(record, taken_j);
  for (const int body : moved) {
    place_body(body);
    slow_s_[static_cast<std::size_t>(body)] = 0.0;
    record.after.push_back(states_[static_cast<std::size_t>(body)]);
    reach_out(body);
  }
  for (std::size_t n = 0; n < taken.size(); ++n) {
    Contact& c = taken[n].first->contacts[taken[n].second];
    const bool rebounds = record.hits[n].restitution > 0.0;
    if (record.hits[n].approach_m_s > kSlowest) c.since_s = time_s;
    c.touching = !rebounds && c.touch.gap_m <= kDeep;
    if (rebounds) c.impulse = c.couple = {};
  }
  strikes_.push_back(std::move(record));
}

/// What the pulses of a rigid impact give the modes, at most what the motion lost; the rest of that is lost.
void Space::give_to_modes(Strike& record, double taken_j) {
  struct Share {
    int body;
    std::vector<double> kick;
    double at_s;
  };
  std::vector<Share> shares;
  double given = 0.0;
  for (const Hit& hit : record.hits) {
    if (hit.impulse == Vec3{} || !(hit.approach_m_s > kSlowest)) continue;
    for (const bool is_a : {true, false}) {
      const int body = is_a ? hit.a : hit.b;
      if (!rings(body) || in_ringing_[static_cast<std::size_t>(body)]) continue;
      const auto i = static_cast<std::size_t>(body);
      const Vec3 impulse = transpose(placed_[i].rotation) * ((is_a ? 1.0 : -1.0) * hit.impulse);
      const std::vector<double> shape = solids_[i].find_shape(find_place(body, hit.touch, is_a));
      const double push = dot(hit.impulse, hit.touch.normal);
      const double mass = push > 0.0 ? push / ((1.0 + hit.restitution) * hit.approach_m_s) : 0.0;
      if (!(mass > 0.0)) continue;
      const double length = calc_contact_time(hit, mass, hit.approach_m_s);
      Ring& ring = ring_until(body, std::max(record.time_s + 0.5 * length, rings_[i].time_s));
      const auto& omega = solids_[i].modes->get_omega();
      Share share{body, std::vector<double>(omega.size()), ring.time_s};
      const double before = solids_[i].modes->calc_energy(ring.q, ring.q_dot);
      for (std::size_t m = 0; m < omega.size(); ++m) {
        share.kick[m] = (shape[3 * m] * impulse[0] + shape[3 * m + 1] * impulse[1] + shape[3 * m + 2] * impulse[2]) *
                        std::sqrt(impact::calc_pulse_spectrum(omega[m] * length));
        ring.q_dot[m] += share.kick[m];
      }
      given += solids_[i].modes->calc_energy(ring.q, ring.q_dot) - before;
      shares.push_back(std::move(share));
    }
  }
  if (given > std::max(taken_j, 0.0) && !shares.empty()) {
    // More than there was: the pulses are given as far as it goes. A rigid impact is only taken where modes get next to nothing.
    for (const Share& share : shares)
      for (std::size_t m = 0; m < share.kick.size(); ++m) rings_[static_cast<std::size_t>(share.body)].q_dot[m] -= share.kick[m];
    given = 0.0;
  }
  record.modes_j = given;
  lost_j_ += taken_j - given;
}

double Space::calc_contact_time(const Hit& hit, double mass_kg, double speed_m_s) const {
  const Solid& a = solid(hit.a);
  double largest = 0.5 * a.shape->get_size_m();
  double young = 0.0, poisson = 0.0;
  if (hit.b >= 0) {
    largest = std::min(largest, 0.5 * solid(hit.b).shape->get_size_m());
    young = solid(hit.b).young_modulus_pa;
    poisson = solid(hit.b).poisson_ratio;
  } else {
    young = ground_->young_modulus_pa;
    poisson = ground_->poisson_ratio;
  }
  return calc_hertz_duration(a.young_modulus_pa, a.poisson_ratio, young, poisson, hit.touch.curvature_a_per_m + hit.touch.curvature_b_per_m,
                             mass_kg, speed_m_s, largest);
}

/// Counts how long the bodies of a group have been slow; true once all have been for long enough.
bool Space::may_rest(const Island& island) {
  bool all = true;
  for (const int body : island.bodies) {
    const auto i = static_cast<std::size_t>(body);
    const double speed = norm(states_[i].velocity) + norm(placed_[i].spin) * solids_[i].radius_m;
    if (in_ringing_[i]) slow_s_[i] = 0.0;
    slow_s_[i] = speed < kSlow && !in_ringing_[i] ? slow_s_[i] + options_.step_s : 0.0;
    all = all && slow_s_[i] > kPatience;
  }
  return all;
}

/// Puts the group to sleep if contact forces exist that balance all of its bodies at rest.
bool Space::rests(Island& island, double h) {
  bool touches = false;
  for (const Pair* pair : island.pairs)
    touches = touches || std::any_of(pair->contacts.begin(), pair->contacts.end(), [](const Contact& c) { return c.touch.gap_m <= kDeep; });
  if (!touches) return false;
  std::vector<State> kept;
  for (const int body : island.bodies) {
    State& s = states_[static_cast<std::size_t>(body)];
    kept.push_back(s);
    s.velocity = s.momentum = {};
    place_body(body);
  }
  predict(island, h, true);
  make_points(island, h, false);
  const double g = std::max(norm(gravity_), 1e-9);
  for (Point& p : points_) p.impulse = p.couple = {};
  const bool found = solver_.solve_directly(movers_, points_, 12);
  if (!found) {
    predict(island, h, true);
    solver_.solve(movers_, points_, 1e-2 * kBalanced * g * h, 4 * options_.most_sweeps);
    costs_.sweeps += solver_.get_sweeps();
  }
  ++costs_.solves;
  bool balanced = true;
  std::vector<char> carried(island.bodies.size(), 0);  // what drifts where nothing pulls is at rest nowhere
  for (const Point& p : points_)
    for (const int n : {p.a, p.b})
      if (n >= 0 && dot(p.impulse, p.normal) > 0.0) carried[static_cast<std::size_t>(n)] = 1;
  for (std::size_t n = 0; n < island.bodies.size(); ++n) {
    const auto i = static_cast<std::size_t>(island.bodies[n]);
    balanced = balanced && carried[n] && norm(movers_[n].velocity) + norm(movers_[n].spin) * solids_[i].radius_m < kBalanced * g * h;
  }
  for (std::size_t n = 0; n < island.bodies.size(); ++n) {
    const auto i = static_cast<std::size_t>(island.bodies[n]);
    if (balanced) {
      asleep_[i] = 1;
      lost_j_ += rigid::calc_kinetic(solids_[i], kept[n]);
    } else {
      states_[i] = kept[n];
      slow_s_[i] = 0.5 * kPatience;
      place_body(island.bodies[n]);
    }
  }
  if (balanced)
    for (std::size_t n = 0; n < points_.size(); ++n) {
      Contact& c = rows_[n].pair->contacts[rows_[n].contact];
      c.impulse = points_[n].impulse;
      c.couple = points_[n].couple;
      c.step_s = h;
      c.touching = dot(c.impulse, c.touch.normal) > 0.0;
    }
  return balanced;
}

}  // namespace carillon::rigid
