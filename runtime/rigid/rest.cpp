// Method: what has been slow for a while sleeps if contact forces exist that balance it at rest. A group sleeps as a whole. Where others of
//   the group move, bodies sleep by themselves, with the forces of the others on them as they are. These forces are watched: where they
//   change by more than a part of its weight a sleeping body wakes, alone, and so may those that lean on it, one after another.
// Source: J. J. Moreau, "Unilateral contact and dry friction in finite freedom dynamics" (1988), the solution with zero velocities.
// Deviations: none.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "runtime/rigid/groups.hpp"
#include "runtime/rigid/limits.hpp"
#include "runtime/rigid/space.hpp"

namespace carillon::rigid {
namespace {

constexpr double kSlow = 5e-3;         // m/s; of what may be about to rest
constexpr double kPatience = 0.02;     // s; for so long
constexpr double kLong = 0.3;          // s; what was slow for so long is no faster than kSlow: less balance is enough
constexpr double kApart = 0.1;         // s; slow for so long, a body may sleep among others that move,
constexpr double kCalm = 0.05;         // s; if those that it touches have been slow for so long
constexpr double kStill = 5e-4;        // m/s; and nothing is faster where it touches
constexpr double kShift = 0.05;        // of its weight: change of the forces on it that wakes it
constexpr int kProofSweeps = 120;      // that look for rest,
constexpr int kMaxProofSweeps = 1200;  // of what was slow for kLong

/// That a contact gave a in its last step [N].
Vec3 calc_force(const Contact& c) { return c.touching && c.step_s > 0.0 ? (1.0 / c.step_s) * c.impulse : Vec3{}; }

}  // namespace

/// Counts how long the bodies of a group have been slow; true where it is time to look whether it rests.
bool Space::may_rest(const Island& island, double h) {
  bool all = true;
  for (const int body : island.bodies) {
    const auto i = static_cast<std::size_t>(body);
    const double speed = norm(states_[i].velocity) + norm(placed_[i].spin) * solids_[i].radius_m;
    paces_[i].slow_s = speed < kSlow && !has_impact(body) ? paces_[i].slow_s + h : 0.0;
    all = all && paces_[i].slow_s > kPatience && time_s_ >= paces_[i].next_proof_s;
  }
  return all;
}

/// Are there contact forces that balance the bodies of a group, which have no velocity? What has been slower than kSlow for so long that
/// its mean acceleration is below `bound` times gravity needs no better balance than that. `pulls`: forces and couples of others on each.
bool Space::is_balanced(Island& island, double h, const std::vector<joints::Spatial>& pulls, double slow_s) {
  predict(island, h, true);
  for (std::size_t n = 0; n < pulls.size(); ++n) {
    movers_[n].velocity = movers_[n].velocity + (h * movers_[n].inverse_mass) * pulls[n].linear;
    movers_[n].spin = movers_[n].spin + h * (movers_[n].inverse_inertia * pulls[n].angular);
  }
  make_points(island, h, false);
  // A gap that roughness bridges is none: here all that is near is in touch.
  for (std::size_t n = 0; n < points_.size(); ++n) {
    if (rows_[n].get().touch.gap_m <= kDeep) points_[n].wanted = {};
  }
  const std::vector<Point> moving = points_;
  for (Point& p : points_) p.impulse = p.couple = {};
  const std::vector<Point> unloaded = points_;
  const double g = std::max(norm(gravity_), 1e-9);
  const double bound = slow_s > kLong ? kSlow / (g * kLong) : kBalanced;
  const std::vector<Mover> free = movers_;
  const auto holds = [&] {
    std::vector<char> carried(island.bodies.size(), 0);  // what drifts where nothing pulls is at rest nowhere
    for (std::size_t n = 0; n < pulls.size(); ++n) carried[n] = dot(pulls[n].linear, gravity_) < 0.0 ? 1 : 0;
    for (const Point& p : points_)
      for (const int n : {p.a, p.b})
        if (n >= 0 && dot(p.impulse, p.normal) > 0.0) carried[static_cast<std::size_t>(n)] = 1;
    for_linked(island, [&](const Linked& linked) {
      const std::vector<int>& members = linked.linkage.movers;
      const bool any =
          linked.hangs || std::any_of(members.begin(), members.end(), [&](int n) { return carried[static_cast<std::size_t>(n)] != 0; });
      for (const int n : members) carried[static_cast<std::size_t>(n)] = any ? 1 : 0;
    });
    for (std::size_t n = 0; n < island.bodies.size(); ++n) {
      const double radius = solid(island.bodies[n]).radius_m;
      if (!carried[n] || norm(movers_[n].velocity) + norm(movers_[n].spin) * radius > bound * g * h) return false;
    }
    return true;
  };
  ++costs_.solves;
  const bool balanced = solver_.solve_directly(movers_, points_, kMaxGuesses) && holds();
  // By sweeps from the impulses of the motion, and from none.
  const auto sweep_from = [&](const std::vector<Point>& from, int max_sweeps) {
    movers_ = free;
    points_ = from;
    solver_.solve(movers_, points_, 1e-2 * bound * g * h, max_sweeps);
    costs_.sweeps += solver_.get_sweeps();
    return holds();
  };
  return balanced || sweep_from(moving, kProofSweeps) || sweep_from(unloaded, slow_s > kLong ? kMaxProofSweeps : kProofSweeps);
}

bool Space::Pair::has_closed_gap() const {
  return std::any_of(contacts.begin(), contacts.end(), [](const Contact& c) { return c.touch.gap_m <= kDeep; });
}

/// Puts the group to sleep if it is balanced at rest.
Space::Rest Space::rest(Island& island, double h, const std::vector<joints::Spatial>& pulls) {
  bool touches = !pulls.empty();
  double slow_s = std::numeric_limits<double>::infinity();
  for (const Pair* pair : island.pairs) touches = touches || pair->has_closed_gap();
  for_linked(island, [&](const Linked& linked) { touches = touches || linked.hangs; });
  if (!touches) return Rest::none;
  std::vector<State> kept;
  std::vector<joints::Coordinates> kept_linked;
  for_linked(island, [&](Linked& linked) {
    kept_linked.push_back(linked.now);
    std::fill(linked.now.u.begin(), linked.now.u.end(), 0.0);
  });
  for (const int body : island.bodies) {
    State& s = states_[static_cast<std::size_t>(body)];
    kept.push_back(s);
    slow_s = std::min(slow_s, paces_[static_cast<std::size_t>(body)].slow_s);
    s.velocity = s.momentum = {};
    place_body(body);
  }
  const bool balanced = is_balanced(island, h, pulls, slow_s);
  bool stands = true;
  if (balanced && !pulls.empty()) {
    const std::vector<Point> points = points_;
    const std::vector<Ref> rows = rows_;
    stands = is_balanced(island, h, {}, slow_s);
    points_ = points;
    rows_ = rows;
  }
  for (std::size_t n = 0; n < island.bodies.size(); ++n) {
    const auto i = static_cast<std::size_t>(island.bodies[n]);
    if (balanced) {
      asleep_[i] = 1;
      lost_j_ += rigid::calc_kinetic(solids_[i], kept[n]);
    } else {
      states_[i] = kept[n];
      (pulls.empty() ? paces_[i].next_proof_s : paces_[i].next_part_s) = time_s_ + std::min(0.5 * slow_s, kLong);
      place_body(island.bodies[n]);
    }
  }
  if (!balanced) {
    std::size_t k = 0;
    for_linked(island, [&](Linked& linked) {
      linked.now = kept_linked[k++];
      place_linked(linked);
    });
  }
  for (std::size_t n = 0; balanced && n < points_.size(); ++n) {
    Contact& c = rows_[n].get();
    c.impulse = points_[n].impulse;
    if (c.is_load) c.impulse = c.impulse + h * c.rest_n;
    c.couple = points_[n].couple;
    c.step_s = h;
    c.touching = dot(c.impulse, c.touch.normal) > 0.0;
    c.rests = c.is_load = c.touch.gap_m <= kDeep;
    c.rest_n = (1.0 / h) * c.impulse;
  }
  return !balanced ? Rest::none : stands ? Rest::stands : Rest::leans;
}

/// Is one of its gaps so small that it counts as closed when the other body sleeps?
bool Space::is_close(const Pair& pair) { return pair.touches() || pair.has_closed_gap(); }

/// Puts bodies to sleep whose group keeps moving elsewhere. At the beginning of a window, on the contacts of the last step.
void Space::rest_apart() {
  const auto get_slow = [&](int body) { return paces_[static_cast<std::size_t>(body)].slow_s; };
  std::vector<char> may(solids_.size(), 0);
  bool any = false;
  for (int i = 0; i < static_cast<int>(solids_.size()); ++i) {
    const auto n = static_cast<std::size_t>(i);
    const bool is_slow =
        moves(i) && get_slow(i) > kApart && time_s_ >= paces_[n].next_part_s && !has_impact(i) && find_linked(i) == nullptr;
    may[n] = is_slow ? 1 : 0;
    any = any || is_slow;
  }
  if (!any) return;
  const auto is_one = [&](int body) { return body >= 0 && may[static_cast<std::size_t>(body)] != 0; };
  for (const Pair* pair : near_) {
    if ((!is_one(pair->a) && !is_one(pair->b)) || !pair->touches()) continue;
    const bool moves_there = std::any_of(pair->contacts.begin(), pair->contacts.end(), [&](const Contact& c) {
      return c.touching && norm(calc_velocity(c.a, c.touch.where_m) - calc_velocity(c.b, c.touch.where_m)) > kStill;
    });
    for (const bool is_a : {true, false}) {
      const int body = is_a ? pair->a : pair->b, other = is_a ? pair->b : pair->a;
      // Forces on what is on joints are the joints' affair.
      const bool is_calm = other < 0 || !moves(other) || (get_slow(other) > kCalm && !has_impact(other) && find_linked(other) == nullptr);
      if (is_one(body) && (pair->cord >= 0 || moves_there || !is_calm)) may[static_cast<std::size_t>(body)] = 0;
    }
  }
  Groups groups(static_cast<int>(solids_.size()));
  for (const Pair* pair : near_)
    if (is_one(pair->a) && is_one(pair->b) && pair->touches()) groups.join(pair->a, pair->b);
  struct Part {
    Island island;
    std::vector<Pair*> bounds;  // to what keeps moving, with or without forces
  };
  std::map<int, Part> parts;
  for (Pair* pair : near_) {
    if (!is_one(pair->a) && !is_one(pair->b)) continue;
    Part& part = parts[groups.find(is_one(pair->a) ? pair->a : pair->b)];
    const bool is_bound = (moves(pair->a) && !is_one(pair->a)) || (pair->b >= 0 && moves(pair->b) && !is_one(pair->b));
    if (!is_bound)
      part.island.pairs.push_back(pair);
    else if (is_close(*pair))
      part.bounds.push_back(pair);
  }
  for (int i = 0; i < static_cast<int>(solids_.size()); ++i)
    if (is_one(i)) parts[groups.find(i)].island.bodies.push_back(i);
  for (auto& [first, part] : parts) {
    if (part.bounds.empty()) continue;  // a group of its own: step_island() handles it
    stepped_ = &part.island.bodies;
    std::vector<joints::Spatial> pulls(part.island.bodies.size());
    for (std::size_t n = 0; n < part.island.bodies.size(); ++n)
      index_[static_cast<std::size_t>(part.island.bodies[n])] = static_cast<int>(n);
    for (const Pair* pair : part.bounds)
      for (const Contact& c : pair->contacts)
        add_pull(c, is_one(pair->a), calc_force(c), pulls[static_cast<std::size_t>(find_index(is_one(pair->a) ? pair->a : pair->b))]);
    for (Pair* pair : part.island.pairs) refresh(*pair);
    // What stands without the others bears them as a fixed body does; what leans on them, or is carried, lies on them as a load.
    const Rest found = rest(part.island, options_.step_s, pulls);
    for (const int body : part.island.bodies) index_[static_cast<std::size_t>(body)] = -1;
    stepped_ = nullptr;
    for (Pair* pair : part.bounds)
      for (Contact& c : pair->contacts)
        if (found != Rest::none) {
          c.rests = c.touch.gap_m <= kDeep;
          c.is_load = found == Rest::leans && c.rests;
          c.rest_n = calc_force(c);
        }
  }
}

/// What sleeps on bodies of a group pulls on them as it did when it fell asleep.
void Space::add_loads(const Island& island, double h) {
  loads_.assign(island.bodies.size(), {});
  for (const Pair* pair : island.pairs) {
    if (moves(pair->a) == moves(pair->b)) continue;
    const bool is_a = moves(pair->a);
    const int n = find_index(is_a ? pair->a : pair->b);
    for (const Contact& c : pair->contacts)
      if (n >= 0 && movers_[static_cast<std::size_t>(n)].linkage == nullptr && c.is_load)
        add_pull(c, is_a, h * c.rest_n, loads_[static_cast<std::size_t>(n)]);
  }
  for (std::size_t n = 0; n < island.bodies.size(); ++n) {
    movers_[n].velocity = movers_[n].velocity + movers_[n].inverse_mass * loads_[n].linear;
    movers_[n].spin = movers_[n].spin + movers_[n].inverse_inertia * loads_[n].angular;
  }
}

/// What the loads on the nth body of the group do on its way through a part of a step, at whose end it is at `to` [J].
double Space::calc_load_work(std::size_t n, const State& to, double part_s, double step_s) const {
  const auto i = static_cast<std::size_t>((*stepped_)[n]);
  const double part = part_s / step_s;
  const Vec3 turn = part_s * (placed_[i].spin + (0.5 * part) * (movers_[n].spin - placed_[i].spin));
  return (1.0 / step_s) * (dot(loads_[n].linear, to.centre - states_[i].centre) + dot(loads_[n].angular, turn));
}

/// Adds a force at a contact, as a's or b's body feels it.
void Space::add_pull(const Contact& c, bool is_a, const Vec3& force_n, joints::Spatial& pull) const {
  const Vec3 force = (is_a ? 1.0 : -1.0) * force_n;
  pull.linear = pull.linear + force;
  pull.angular = pull.angular + cross(c.touch.where_m - state(is_a ? c.a : c.b).centre, force);
}

/// The touches of a pair, good for a step. What sleeps of it wakes where what it rested on has gone away, or where another is about to
/// touch it.
void Space::watch(Pair& pair, double step_s) {
  const auto resting = std::count_if(pair.contacts.begin(), pair.contacts.end(), [](const Contact& c) { return c.rests; });
  update(pair, step_s);
  const bool a_moves = moves(pair.a);
  const int body = a_moves ? pair.b : pair.a, by = a_moves ? pair.a : pair.b;
  if (is_fixed(body) || moves(body)) return;
  const auto left =
      std::count_if(pair.contacts.begin(), pair.contacts.end(), [](const Contact& c) { return c.rests && c.touch.gap_m <= kDeep; });
  if (left < resting) {
    wake(body, by, find_linked(body) == nullptr);
    return;
  }
  const bool comes = std::any_of(pair.contacts.begin(), pair.contacts.end(), [&](const Contact& c) {
    const double approach = calc_approach(c), pull = (a_moves ? -1.0 : 1.0) * dot(gravity_, c.touch.normal);
    const double fallen_m = 0.5 * std::max(pull, 0.0) * step_s * step_s;
    // Where the two rest on each other wake_unbalanced() watches what is slow.
    return (resting == 0 || approach > kSlowest) && c.touch.gap_m - approach * step_s - fallen_m <= kTouch;
  });
  if (comes) wake(body, by);
}

/// Wakes the bodies that sleep among others whose forces on them are no longer those under which they rest.
void Space::wake_unbalanced() {
  struct Change {
    joints::Spatial pull;
    int by = -1;
    bool is_struck = false;
  };
  std::map<int, Change> changes;
  for (const Pair* pair : near_) {
    if (pair->b < 0 || pair->cord >= 0) continue;
    const bool is_a = asleep_[static_cast<std::size_t>(pair->a)] != 0;
    const int body = is_a ? pair->a : pair->b, other = is_a ? pair->b : pair->a;
    if (!asleep_[static_cast<std::size_t>(body)] || !moves(other) || !is_due(other)) continue;
    for (const Contact& c : pair->contacts) {
      if (!c.rests && !c.touching) continue;
      Change& change = changes[body];
      change.by = other;
      change.is_struck = change.is_struck || has_impact(other);
      add_pull(c, is_a, calc_force(c) - (c.rests ? c.rest_n : Vec3{}), change.pull);
    }
  }
  for (const auto& [body, change] : changes) {
    const Solid& solid = solids_[static_cast<std::size_t>(body)];
    const double size = norm(change.pull.linear) + norm(change.pull.angular) / solid.radius_m;
    if (change.is_struck || size > kShift * solid.mass_kg * norm(gravity_)) wake(body, change.by, find_linked(body) == nullptr);
  }
}

/// Bodies of an impact that slept until now move from here on, in the group that is being stepped. True if there were any. If another group
/// touches them, too, that touch waits for the next step, in which the groups are one (they take the same steps: join_sleeping()).
bool Space::wake_struck(Island& island, const std::vector<Ref>& taken) {
  bool any = false;
  const auto take = [&](int body) {
    index_[static_cast<std::size_t>(body)] = static_cast<int>(island.bodies.size());
    island.bodies.push_back(body);
    for (Pair* pair : near_)
      if ((pair->a == body || pair->b == body) && is_stepped(*pair) &&
          std::find(island.pairs.begin(), island.pairs.end(), pair) == island.pairs.end())
        island.pairs.push_back(pair);
  };
  for (const Ref& ref : taken)
    for (const int body : {ref.pair->a, ref.pair->b}) {
      if (is_fixed(body) || moves(body)) continue;
      any = true;
      for (const int woken : wake(body, island.bodies.front(), true)) take(woken);
    }
  return any;
}

}  // namespace carillon::rigid
