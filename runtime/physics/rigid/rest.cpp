// Method: a body that has been slow for a while sleeps if contact forces exist that balance it at rest. An island sleeps as a whole. If
// other bodies of the island move, bodies sleep separately under the current forces of the others. These forces are monitored: if they
// change by more than a fraction of its weight, the sleeping body wakes, and then possibly the bodies it supports, one after another. On
// curved surfaces the proof of balance may fail; an island whose bodies have stayed in place for kLongSlowS sleeps without it.
// Source: J. J. Moreau, "Unilateral contact and dry friction in finite freedom dynamics" (1988), the solution with zero velocities.
#include "runtime/physics/rigid/rest.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "runtime/base/groups.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::rigid {
namespace {

constexpr double kSlowDelayS = 0.02;       // s; minimum time below kSlowSpeedMS before a test of rest
constexpr double kSleepDelayS = 0.1;       // s; minimum slow time of a body that may sleep among moving ones,
constexpr double kNeighbourSlowS = 0.05;   // s; and of the bodies that it touches,
constexpr double kMaxTouchSpeedMS = 5e-4;  // m/s; with no faster contact
constexpr double kStillM = 5e-5;           // m; a body stays in place while no point moves farther
constexpr double kWakeForceRatio = 0.05;   // fraction of the weight: change of the forces that wakes a body
constexpr double kSwingRatio = 0.8;        // movement of a swing in place, relative to the radius of the body
constexpr double kSwingDelayS = 0.5;       // s; swing in place before the rolling resistance grows
constexpr double kSettlingPerS = 20.0;     // 1/s; growth of the resistance, relative to its value
constexpr double kMaxSettling = 30.0;      // largest resistance, likewise

/// Upper bound of the distance of any point of a body between two poses [m].
double calc_distance(const Solid& solid, const State& a, const State& b) {
  double same = 0.0;
  for (int k = 0; k < 4; ++k) same += a.rotation[k] * b.rotation[k];
  return norm(a.centre - b.centre) + 2.0 * std::sqrt(std::max(0.0, 1.0 - same * same)) * solid.radius_m;
}

}  // namespace

void Rest::reset(const std::vector<int>& bodies) {
  for (const int body : bodies) paces_[body].slow_s = 0.0;
}

bool Rest::may_sleep(const std::vector<int>& bodies, double time_s) {
  bool all = true;
  for (const int body : bodies) {
    Pace& pace = paces_[body];
    const bool is_slow = bodies_.calc_speed(body) < kSlowSpeedMS && !bodies_.is_moved_by_impact(body) && bodies_.get_pull(body) == 0.0;
    pace.slow_s = is_slow ? pace.slow_s + time_s : 0.0;
    all = all && pace.slow_s > kSlowDelayS && bodies_.get_time() >= pace.next_proof_s;
  }
  return all;
}

void Rest::note_still() {
  for (int i = 0; i < bodies_.count(); ++i) {
    Pace& pace = paces_[i];
    if (!bodies_.moves(i) || calc_distance(bodies_.solid(i), bodies_.state(i), pace.anchor) <= kStillM) continue;
    pace.anchor = bodies_.state(i);
    pace.anchored_s = bodies_.get_time();
  }
}

void Rest::note_swings() {
  constexpr int kNone = -2, kMany = -3;
  std::vector<int> supports(bodies_.count(), kNone);  // of each body: the static one (-1: ground), or kMany, also for a moving one
  for (const Pair* pair : windows_.near()) {
    if (pair->cord >= 0 || !pair->touches()) continue;
    for (const bool is_a : {true, false}) {
      const int body = is_a ? pair->a : pair->b, other = is_a ? pair->b : pair->a;
      if (body < 0) continue;
      const bool is_static = other < 0 || bodies_.solid(other).fixed;
      supports[body] = is_static && (supports[body] == kNone || supports[body] == other) ? other : kMany;
    }
  }
  const double now_s = bodies_.get_time();
  for (int i = 0; i < bodies_.count(); ++i) {
    if (!bodies_.moves(i)) continue;
    Pace& pace = paces_[i];
    const bool swings = supports[i] == kMany && bodies_.get_pull(i) == 0.0 && bodies_.find_articulation(i) == nullptr &&
                        calc_distance(bodies_.solid(i), bodies_.state(i), pace.swing) <= kSwingRatio * bodies_.solid(i).radius_m;
    if (!swings) {
      pace.swing = bodies_.state(i);
      pace.swings_s = now_s;
    }
    bodies_.set_settling(i, std::clamp(1.0 + kSettlingPerS * (now_s - pace.swings_s - kSwingDelayS), 1.0, kMaxSettling));
  }
}

bool Rest::try_still(Island& island, double h) {
  for (const int body : island.bodies) {
    const bool is_still = bodies_.get_time() - paces_[body].anchored_s > kLongSlowS && bodies_.calc_speed(body) < kSlowSpeedMS &&
                          !bodies_.is_moved_by_impact(body) && bodies_.get_pull(body) == 0.0 && bodies_.find_articulation(body) == nullptr;
    if (!is_still) return false;
  }
  const auto carries = [&](const Contact& c, int body) {
    const Vec3 force_n = (c.a == body ? 1.0 : -1.0) * c.calc_force();
    return (c.a == body || c.b == body) && dot(force_n, bodies_.gravity()) < 0.0;
  };
  for (const int body : island.bodies)
    if (std::none_of(island.pairs.begin(), island.pairs.end(), [&](const Pair* pair) {
          return std::any_of(pair->contacts.begin(), pair->contacts.end(), [&](const Contact& c) { return carries(c, body); });
        }))
      return false;
  for (const Pair* pair : island.pairs)
    if (pair->cord >= 0 || pair->sag_m > kDeepM ||
        std::any_of(pair->contacts.begin(), pair->contacts.end(), [](const Contact& c) { return c.touch.gap_m < -kMaxDepthM; }))
      return false;
  for (const int body : island.bodies) {
    State& s = bodies_.state(body);
    ledger_.lose(calc_kinetic(bodies_.solid(body), s));
    s.velocity = s.momentum = {};
    bodies_.place(body);
    bodies_.set_asleep(body, true);
  }
  for (Pair* pair : island.pairs) {
    ledger_.lose(pair->take_stopped_j());
    for (Contact& c : pair->contacts) fall_asleep(c, h * c.calc_force(), h);
  }
  return true;
}

/// Keeps the impulse of a step of `h` seconds as the force of a sleeping contact.
void Rest::fall_asleep(Contact& c, const Vec3& impulse, double h) {
  c.impulse = impulse;
  c.step_s = h;
  c.touching = dot(c.impulse, c.touch.normal) > 0.0;
  c.rests = c.is_load = c.touch.gap_m <= kDeepM;
  c.rest_n = (1.0 / h) * c.impulse;
}

bool Rest::try_articulation(Articulation& articulation, double length_s) {
  if (!articulation.is_anchored || !may_sleep(articulation.bodies, length_s) || !bodies_.is_balanced(articulation)) return false;
  for (const int body : articulation.bodies) ledger_.lose(calc_kinetic(bodies_.solid(body), bodies_.state(body)));
  std::fill(articulation.now.u.begin(), articulation.now.u.end(), 0.0);
  bodies_.place(articulation);
  for (const int body : articulation.bodies) bodies_.set_asleep(body, true);
  return true;
}

/// Puts an island, or a part of one under external forces, to sleep if it is balanced at rest.
Rest::Balance Rest::try_sleep(Island& island, double h, const std::vector<joints::Spatial>& pulls) {
  bool touches = !pulls.empty();
  double slow_s = std::numeric_limits<double>::infinity();
  for (const Pair* pair : island.pairs) {
    if (pair->sag_m > kDeepM) return Balance::none;  // must recover first
    touches = touches || pair->has_closed_gap();
  }
  bodies_.for_articulations(island.bodies, [&](const Articulation& articulation) { touches = touches || articulation.is_anchored; });
  if (!touches) return Balance::none;
  std::vector<State> kept;
  std::vector<joints::Coordinates> kept_coordinates;
  bodies_.for_articulations(island.bodies, [&](Articulation& articulation) {
    kept_coordinates.push_back(articulation.now);
    std::fill(articulation.now.u.begin(), articulation.now.u.end(), 0.0);
  });
  for (const int body : island.bodies) {
    State& s = bodies_.state(body);
    kept.push_back(s);
    slow_s = std::min(slow_s, paces_[body].slow_s);
    s.velocity = s.momentum = {};
    bodies_.place(body);
  }
  trial_.begin(island);
  const bool balanced = problem_.solve_rest(trial_, h, pulls, slow_s);
  std::vector<Point> points = trial_.points;
  const std::vector<ContactRef> rows = trial_.rows;
  const bool stands = !balanced || pulls.empty() || problem_.solve_rest(trial_, h, {}, slow_s);
  trial_.end();
  for (int n = 0; const int body : island.bodies) {
    const State& before = kept[n++];
    if (balanced) {
      bodies_.set_asleep(body, true);
      ledger_.lose(calc_kinetic(bodies_.solid(body), before));
    } else {
      bodies_.state(body) = before;
      (pulls.empty() ? paces_[body].next_proof_s : paces_[body].next_part_s) = bodies_.get_time() + std::min(0.5 * slow_s, kLongSlowS);
      bodies_.place(body);
    }
  }
  if (!balanced) {
    bodies_.for_articulations(island.bodies, [&, k = 0](Articulation& articulation) mutable {
      articulation.now = kept_coordinates[k++];
      bodies_.place(articulation);
    });
    return Balance::none;
  }
  for (Pair* pair : island.pairs) ledger_.lose(pair->take_stopped_j());
  for (int n = 0; const Point& p : points) {
    Contact& c = rows[n++].get();
    c.couple = p.couple;
    fall_asleep(c, c.is_load ? p.impulse + h * c.rest_n : p.impulse, h);
  }
  return stands ? Balance::stands : Balance::leans;
}

/// Bodies that may sleep while others of their island move.
std::vector<char> Rest::find_slow() const {
  std::vector<char> is_slow(bodies_.count(), 0);
  for (int i = 0; i < bodies_.count(); ++i)
    is_slow[i] = bodies_.moves(i) && paces_[i].slow_s > kSleepDelayS && bodies_.get_time() >= paces_[i].next_part_s &&
                 !bodies_.is_moved_by_impact(i) && bodies_.find_articulation(i) == nullptr;
  if (std::none_of(is_slow.begin(), is_slow.end(), [](char slow) { return slow != 0; })) return {};
  const auto is_one = [&](int body) { return body >= 0 && is_slow[body] != 0; };
  for (const Pair* pair : windows_.near()) {
    if ((!is_one(pair->a) && !is_one(pair->b)) || !(pair->touches() || pair->sag_m > kDeepM)) continue;
    const bool moves_there = std::any_of(pair->contacts.begin(), pair->contacts.end(), [&](const Contact& c) {
      return c.touching &&
             norm(bodies_.calc_velocity(c.a, c.touch.where_m) - bodies_.calc_velocity(c.b, c.touch.where_m)) > kMaxTouchSpeedMS;
    });
    for (const bool is_a : {true, false}) {
      const int body = is_a ? pair->a : pair->b, other = is_a ? pair->b : pair->a;
      // Forces on articulated bodies belong to the joints.
      const bool is_calm = !bodies_.moves(other) || (paces_[other].slow_s > kNeighbourSlowS && !bodies_.is_moved_by_impact(other) &&
                                                     bodies_.find_articulation(other) == nullptr);
      if (is_one(body) && (pair->cord >= 0 || moves_there || !is_calm || pair->sag_m > kDeepM)) is_slow[body] = 0;
    }
  }
  return is_slow;
}

void Rest::try_parts() {
  const std::vector<char> is_slow = find_slow();
  if (is_slow.empty()) return;
  const auto is_one = [&](int body) { return body >= 0 && is_slow[body] != 0; };
  base::Groups groups(bodies_.count());
  for (const Pair* pair : windows_.near())
    if (is_one(pair->a) && is_one(pair->b) && pair->touches()) groups.join(pair->a, pair->b);
  struct Part {
    Island island;
    std::vector<Pair*> bounds;  // pairs with bodies that keep moving, with or without forces
  };
  std::map<int, Part> parts;
  for (Pair* pair : windows_.near()) {
    if (!is_one(pair->a) && !is_one(pair->b)) continue;
    Part& part = parts[groups.find(is_one(pair->a) ? pair->a : pair->b)];
    const auto is_bound_to = [&](int body) { return bodies_.moves(body) && !is_one(body); };
    if (!is_bound_to(pair->a) && !is_bound_to(pair->b))
      part.island.pairs.push_back(pair);
    else if (pair->touches() || pair->has_closed_gap())
      part.bounds.push_back(pair);
  }
  for (int i = 0; i < bodies_.count(); ++i)
    if (is_one(i)) parts[groups.find(i)].island.bodies.push_back(i);
  for (auto& [first, part] : parts) {
    if (part.bounds.empty()) continue;  // a separate island: handled by try_island()
    std::vector<joints::Spatial> pulls(part.island.bodies.size());
    for (const Pair* pair : part.bounds) {
      const bool is_a = is_one(pair->a);
      const auto at = std::find(part.island.bodies.begin(), part.island.bodies.end(), is_a ? pair->a : pair->b);
      for (const Contact& c : pair->contacts) add_pull(bodies_, c, is_a, c.calc_force(), pulls[at - part.island.bodies.begin()]);
    }
    for (Pair* pair : part.island.pairs) touches_.refresh(*pair);
    // A part that is stable without the others supports them like a fixed body; a part that leans on them, or is carried, is their load.
    const Balance found = try_sleep(part.island, options_.step_s, pulls);
    if (found == Balance::none) continue;
    for (Pair* pair : part.bounds)
      for (Contact& c : pair->contacts) {
        c.rests = c.touch.gap_m <= kDeepM;
        c.is_load = found == Balance::leans && c.rests;
        c.rest_n = c.calc_force();
      }
  }
}

/// Wakes a body and all connected sleeping bodies, or it alone.
std::vector<int> Rest::wake(int body, int by, bool alone) {
  std::vector<int> woken{body}, awake;
  while (!woken.empty()) {
    const int i = woken.back();
    woken.pop_back();
    if (!bodies_.is_asleep(i)) continue;
    bodies_.set_asleep(i, false);
    awake.push_back(i);
    paces_[i].slow_s = 0.0;
    paces_[i].swings_s = bodies_.get_time();
    // Waking is no motion: to sleep again the body must stay in place for kSleepDelayS only.
    paces_[i].anchored_s = std::max(paces_[i].anchored_s, bodies_.get_time() + kSleepDelayS - kLongSlowS);
    windows_.wake(i, by);
    for (auto& [key, pair] : touches_.pairs()) {
      if (key.first != i && key.second != i) continue;
      windows_.add(pair);
      const int other = key.first == i ? key.second : key.first;
      const bool sleeps = bodies_.is_asleep(other);
      if (!alone && pair.touches() && sleeps) woken.push_back(other);
      for (Contact& c : pair.contacts)
        if (!sleeps)
          c.rests = c.is_load = false;
        else if (dot((c.a == i ? 1.0 : -1.0) * c.rest_n, bodies_.gravity()) <= 0.0)
          c.is_load = false;  // the sleeping body below bears all loads
    }
    for (Pair& pair : touches_.cord_pairs()) {
      if (pair.a != i && pair.b != i) continue;
      windows_.add(pair);
      const int other = pair.a == i ? pair.b : pair.a;
      Contact& c = pair.contacts.front();
      c.rests = c.is_load = false;
      if (c.touching && other >= 0) woken.push_back(other);
    }
    if (const Articulation* articulation = bodies_.find_articulation(i); articulation != nullptr)
      woken.insert(woken.end(), articulation->bodies.begin(), articulation->bodies.end());
  }
  return awake;
}

void Rest::watch(Pair& pair, double step_s) {
  const auto resting = std::count_if(pair.contacts.begin(), pair.contacts.end(), [](const Contact& c) { return c.rests; });
  touches_.update(pair, step_s);
  const bool a_moves = bodies_.moves(pair.a);
  const int body = a_moves ? pair.b : pair.a, by = a_moves ? pair.a : pair.b;
  if (!bodies_.is_asleep(body)) return;
  const auto left =
      std::count_if(pair.contacts.begin(), pair.contacts.end(), [](const Contact& c) { return c.rests && c.touch.gap_m <= kDeepM; });
  if (left < resting) {
    wake(body, by, bodies_.find_articulation(body) == nullptr);
    return;
  }
  const bool comes = std::any_of(pair.contacts.begin(), pair.contacts.end(), [&](const Contact& c) {
    const double approach = bodies_.calc_approach(c.touch, c.a, c.b);
    const double pull = (a_moves ? -1.0 : 1.0) * dot(bodies_.gravity(), c.touch.normal);
    const double fallen_m = 0.5 * std::max(pull, 0.0) * step_s * step_s;
    // If the two rest on each other, slow changes are handled by wake_unbalanced().
    return (resting == 0 || approach > kMinImpactSpeedMS) && c.touch.gap_m - approach * step_s - fallen_m <= kTouchGapM;
  });
  if (comes) wake(body, by);
}

void Rest::wake_unbalanced() {
  struct Change {
    joints::Spatial pull;
    int by = -1;
    bool is_struck = false;
  };
  std::map<int, Change> changes;
  for (const Pair* pair : windows_.near()) {
    if (pair->b < 0 || pair->cord >= 0) continue;
    const bool is_a = bodies_.is_asleep(pair->a);
    const int body = is_a ? pair->a : pair->b, other = is_a ? pair->b : pair->a;
    if (!bodies_.is_asleep(body) || !bodies_.moves(other) || !windows_.is_due(other)) continue;
    for (const Contact& c : pair->contacts) {
      if (!c.rests && !c.touching) continue;
      Change& change = changes[body];
      change.by = other;
      change.is_struck = change.is_struck || bodies_.is_moved_by_impact(other);
      add_pull(bodies_, c, is_a, c.calc_force() - (c.rests ? c.rest_n : Vec3{}), change.pull);
    }
  }
  for (const auto& [body, change] : changes) {
    const Solid& solid = bodies_.solid(body);
    const double size = norm(change.pull.linear) + norm(change.pull.angular) / solid.radius_m;
    if (change.is_struck || size > kWakeForceRatio * solid.mass_kg * norm(bodies_.gravity()))
      wake(body, change.by, bodies_.find_articulation(body) == nullptr);
  }
}

bool Rest::wake_struck(Step& step, const std::vector<ContactRef>& contacts) {
  bool any = false;
  std::vector<Pair*>& pairs = step.island().pairs;
  const auto add = [&](int body) {
    step.add(body);
    for (Pair* pair : windows_.near())
      if ((pair->a == body || pair->b == body) && step.has(*pair) && std::find(pairs.begin(), pairs.end(), pair) == pairs.end())
        pairs.push_back(pair);
  };
  for (const ContactRef& ref : contacts)
    for (const int body : {ref.pair->a, ref.pair->b}) {
      if (!bodies_.is_asleep(body)) continue;
      any = true;
      for (const int woken : wake(body, step.body(0), true)) add(woken);
    }
  return any;
}

}  // namespace carillon::rigid
