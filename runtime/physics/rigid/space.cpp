// Method: loop over windows, steps, islands and the impacts within a step; the work is done by the stages.
#include "runtime/physics/rigid/space.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>
#include <vector>

#include "runtime/physics/rigid/limits.hpp"

namespace carillon::rigid {
namespace {

constexpr double kMinStepS = 1e-9;        // s; shorter remainders of a step are skipped
constexpr double kMaxStruckStepS = 5e-5;  // s; longest part of a step after the start of a modal impact
constexpr int kMaxMissed = 30;            // per step: instants at which no touch struck
constexpr int kMaxSought = 3;             // of these, with a search for closings on the path
constexpr int kMaxCompleted = 4;          // repeated solutions of a step with missing touches added
constexpr int kMaxShortened = 8;          // times that a step without impacts is shortened
constexpr int kMaxHalved = 3;             // halvings of a step in which nothing strikes
constexpr double kMaxAheadM = 5e-5;       // m; permitted depth at its end: the gaps of fast turning bodies are not linear
constexpr int kMaxImpacts = 4;            // individual impacts of an island per step; an island with more is crowded
constexpr int kMinImpacts = 2;            // the same for the largest islands, whose impacts cost more
constexpr int kMaxStruckBodies = 48;      // bodies of an island times its impacts per step

}  // namespace

Space::Space(std::vector<Solid> solids, std::vector<State> states, std::optional<Ground> ground, const Vec3& gravity,
             const Options& options, const Links& links)
    : options_(options),
      bodies_(std::move(solids), std::move(states), ground, gravity, links.joints, options.joint_tolerance),
      modal_states_(bodies_, ledger_),
      modal_impacts_(bodies_, modal_states_, ledger_),
      touches_(bodies_, links.cords, modal_impacts_, ledger_),
      windows_(bodies_, touches_, options_, ledger_),
      projection_(bodies_, touches_, modal_states_, ledger_),
      problem_(bodies_, touches_, options_, ledger_),
      instants_(bodies_, touches_),
      rigid_impact_(bodies_, touches_),
      rest_(bodies_, touches_, windows_, problem_, options_, ledger_),
      step_(bodies_) {}

void Space::list_contacts(std::vector<const Contact*>& out) const {
  out.clear();
  for (const Pair* pair : windows_.near())
    if (pair->cord < 0 && (bodies_.moves(pair->a) || bodies_.moves(pair->b)))
      for (const Contact& c : pair->contacts) out.push_back(&c);
}

Books Space::calc_books() const {
  Books books;
  bodies_.add_to(books);
  modal_states_.add_to(books, get_time());
  modal_impacts_.add_to(books);
  touches_.add_to(books);
  ledger_.add_to(books);
  return books;
}

void Space::skip_window(double end_s) {
  windows_.skip(end_s);
  bodies_.set_time(windows_.get_end());
}

void Space::step(double end_s) {
  if (at_window_)
    open_window(end_s);
  else if (windows_.has_steps())
    ++ledger_.costs.steps;
  const double from_s = windows_.get_time();
  bodies_.set_time(from_s);
  if (windows_.has_steps()) {
    for (std::size_t n = 0; n < windows_.near().size(); ++n) {  // waking adds pairs
      Pair& pair = *windows_.near()[n];
      if (const int stride = windows_.find_stride(pair); stride > 0) rest_.watch(pair, windows_.calc_length(stride));
    }
    rest_.wake_unbalanced();
    windows_.sort_near();
    for (Island& island : windows_.make_islands(modal_impacts_.list())) {
      step_island(island, from_s, windows_.calc_length(island.stride));
      ledger_.costs.body_steps += static_cast<std::int64_t>(island.bodies.size());
    }
  }
  windows_.next_step();
  bodies_.set_time(windows_.get_time());
  at_window_ = windows_.is_over();
}

void Space::open_window(double end_s) {
  rest_.note_still();
  rest_.note_swings();
  if (options_.islands) rest_.try_parts();
  windows_.open(end_s, modal_impacts_.list());
  rest_.reset(windows_.fly_bodies());
  for (Articulation& articulation : bodies_.articulations())
    if (windows_.may_fly(articulation) && !rest_.try_articulation(articulation, windows_.get_length())) windows_.fly(articulation);
  windows_.choose_steps();
}

/// Depth from which the bodies of an island are moved apart [m].
double Space::calc_open_depth(const Island& island) const {
  const bool is_on_ground =
      island.bodies.size() == 1 && std::all_of(island.pairs.begin(), island.pairs.end(), [](const Pair* pair) { return pair->b < 0; });
  if (is_on_ground) return kDeepM;
  const bool wobbles = std::any_of(island.bodies.begin(), island.bodies.end(),
                                   [&](int body) { return !bodies_.is_flat(body) && bodies_.calc_speed(body) > kSlowSpeedMS; });
  return wobbles ? kMaxDepthM - kMissingDepthM : kMaxDepthM;
}

/// Prepares the impacts with modes and the touches of a part of a step, at most `left_s` long; returns its length. `has_struck`: in this
/// step.
double Space::begin_part(double left_s, double open_m, bool& has_struck) {
  const auto limit = [&] { return has_struck && !modal_impacts_.list().empty() ? std::min(left_s, kMaxStruckStepS) : left_s; };
  has_struck = modal_impacts_.begin_early(step_, limit(), instants_) || has_struck;
  double h = limit();
  modal_impacts_.end_where_touching(step_, touches_);
  extend_in_impacts();
  if (h > kMaxStruckStepS && modal_impacts_.may_meet_others(step_, h, touches_)) h = kMaxStruckStepS;
  h = modal_impacts_.limit_part(step_, h);
  projection_.collect(step_);
  projection_.run(step_, open_m, h);
  modal_impacts_.follow(step_, h, touches_);
  return h;
}

void Space::step_island(Island& island, double start_s, double length_s) {
  pull_joints(island, length_s);
  step_.begin(island);
  double done = 0.0;
  int impacts = 0, missed = 0, more = 0;
  bool begun = false, has_struck = false;
  const double open_m = calc_open_depth(island);
  const int max_impacts = std::clamp(kMaxStruckBodies / step_.count(), kMinImpacts, kMaxImpacts);
  if (instants_.is_crowded(island, start_s)) {
    strike_at_once(start_s, length_s);
    impacts = max_impacts;
  }
  while (length_s - done > kMinStepS) {
    bodies_.set_time(start_s + done);
    const bool begins = !std::exchange(begun, true), may_sleep = begins && rest_.may_sleep(island.bodies, length_s - done);
    has_struck = has_struck || impacts > 0;
    double h = begin_part(length_s - done, open_m, has_struck);
    if ((may_sleep && try_rest(island, h)) || (begins && rest_.try_still(island, h))) break;
    touches_.forget_closing(step_);
    double depth_m = 0.0;     // at the end of the step
    const auto solve = [&] {  // true: touches were missing
      for (int n = 0; n <= kMaxCompleted; ++n) {
        problem_.predict(step_, h, false);
        problem_.make_points(step_, impacts < max_impacts);
        problem_.solve(step_);
        const TouchSets::Ahead ahead = touches_.complete(step_, missed < kMaxSought);
        depth_m = ahead.depth_m;
        if (!ahead.was_missing) return n > 0;
      }
      return true;
    };
    const bool is_completed = solve();
    // Rows stop a touch only at the end of a step, when half of its movement is already penetration: missing touches strike at the start,
    // and steps without impacts are shortened.
    if (is_completed && impacts >= max_impacts && more++ < kMaxCompleted && strike_at_once(start_s + done, h)) continue;
    for (int n = 0; n < kMaxShortened && impacts >= max_impacts; ++n) {
      const double stops_s = instants_.calc_stopping_time(step_);
      if (stops_s >= h) break;
      h = stops_s;
      solve();
    }
    double at = h;
    std::vector<ContactRef> first;
    step_.together_s = kSimultaneousS;
    bool struck = false;
    for (int n = 0;; ++n) {
      at = h;
      struck = impacts < max_impacts && instants_.find(step_, at, first);
      if (struck || depth_m <= kMaxAheadM || n == kMaxHalved) break;
      h *= 0.5;
      solve();
    }
    problem_.keep_impulses(step_, at);
    for (Pair* pair : island.pairs) touches_.travel(*pair, at, h);
    move(start_s + done + at, at);
    done += at;
    if (struck) {
      bodies_.set_time(start_s + done);
      for (Pair* pair : island.pairs)
        if (!pair->contacts.empty()) touches_.refresh(*pair);
      if (instants_.confirm(step_, first, length_s - done, kDeepM * (1 + missed))) {
        strike(first);
        if (++impacts == max_impacts) instants_.set_crowded(island, start_s + length_s);
      } else if ((missed += at > kMinStepS ? 1 : missed + 1) > kMaxMissed) {  // an immediate instant would be missed again
        impacts = max_impacts;
      }
    }
    if (length_s - done > kMinStepS)
      for (Pair* pair : island.pairs) touches_.update(*pair, length_s - done);
  }
  step_.end();
}

/// Puts an island to sleep if contact forces balance it: first with its bodies separated to kDeepM, then unchanged. If neither balances, no
/// body is displaced: bodies falling back from a displacement would never come to rest.
bool Space::try_rest(Island& island, double length_s) {
  std::vector<std::tuple<State, double, ModalState>> kept;  // and the energy owed
  std::vector<std::tuple<double, double, Pair::Errors>> kept_pairs;
  for (const int body : island.bodies) kept.emplace_back(bodies_.state(body), projection_.get_owed(body), modal_states_.get(body));
  for (const Pair* pair : island.pairs) kept_pairs.emplace_back(pair->stored_j, pair->stopped_j, pair->errors);
  Books before, after;
  ledger_.add_to(before);
  const std::int64_t pushes = ledger_.costs.pushes;
  // A body that has come to rest may have more touches than while rocking.
  for (Pair* pair : island.pairs) {
    if (pair->b >= 0 || pair->contacts.size() != 1 || !pair->touches()) continue;
    pair->memory.known = false;
    touches_.search(*pair, length_s);
  }
  projection_.run(step_, kDeepM, 0.0);
  if (rest_.try_island(island, length_s)) return true;
  if (ledger_.costs.pushes == pushes) return false;
  ledger_.add_to(after);
  ledger_.lose(before.lost_j - after.lost_j);
  ledger_.lift(before.lifted_j - after.lifted_j);
  for (int n = 0; const int body : island.bodies) {
    auto& [state, owed_j, modes] = kept[n++];
    projection_.set_owed(body, owed_j);
    bodies_.state(body) = state;
    bodies_.place(body);
    if (bodies_.has_modes(body) && !bodies_.is_in_impact(body)) modal_states_.set(body, std::move(modes));
  }
  for (int n = 0; Pair * pair : island.pairs) {
    if (!pair->contacts.empty()) touches_.refresh(*pair);
    std::tie(pair->stored_j, pair->stopped_j, pair->errors) = kept_pairs[n++];
  }
  return rest_.try_island(island, length_s);
}

/// Impacts of a crowded island: all touches that close within a step strike at its start. False: none closes, touches unchanged.
bool Space::strike_at_once(double start_s, double length_s) {
  bodies_.set_time(start_s);
  step_.together_s = length_s;
  std::vector<ContactRef> first = instants_.list_closing(step_, length_s);
  if (first.empty()) return false;
  if (!instants_.confirm(step_, first, length_s, std::numeric_limits<double>::infinity())) return true;
  if (first.front().pair != first.back().pair) instants_.set_crowded(step_.island(), start_s + length_s);
  strike(first);
  return true;
}

/// Advances the bodies of an island through the completed part of a step.
void Space::move(double to_s, double part_s) {
  const double before_j = bodies_.calc_energy(step_.island().bodies);
  std::vector<State> moved, before;
  for (int n = 0; n < step_.count() && !step_.pulls.empty(); ++n) before.push_back(bodies_.state(step_.body(n)));
  std::vector<char> in_impact;  // includes impacts that end in this part, which have moved their bodies
  double loads_j = 0.0;         // work of sleeping bodies supported by these
  for (int n = 0; n < step_.count(); ++n) {
    in_impact.push_back(bodies_.is_moved_by_impact(step_.body(n)) ? 1 : 0);
    const bool is_free = step_.free[n].articulation < 0;
    moved.push_back(is_free ? step_.calc_moved(n, part_s) : State{});
    if (is_free && in_impact.back() == 0) loads_j += step_.calc_load_work(n, moved.back(), part_s);
  }
  ledger_.lose(-loads_j);  // a load does not descend with its support until it wakes, within kDeepM: this energy is a gain
  std::vector<const ArticulationStep*> flown;
  for (const ArticulationStep& a : step_.articulations)
    if (a.articulation->struck < 0) flown.push_back(&a);
  const bool has_impacts = std::any_of(in_impact.begin(), in_impact.end(), [](char is_in) { return is_in != 0; });
  if (has_impacts) modal_impacts_.advance(step_, to_s, part_s, windows_.get_end(), touches_);
  for (const ArticulationStep* a : flown) {
    a->articulation->now = step_.calc_moved(*a, part_s);
    bodies_.place(*a->articulation);
  }
  for (int n = 0; n < step_.count(); ++n) {
    if (step_.free[n].articulation >= 0) continue;
    if (!in_impact[n]) bodies_.state(step_.body(n)) = moved[n];
    bodies_.place(step_.body(n));
  }
  const double pulls_j = before.empty() ? 0.0 : give_pulls(before, in_impact, part_s);
  if (!has_impacts) return problem_.remove_gain(step_, before_j + loads_j + pulls_j);
  std::vector<int> struck;
  for (int n = 0; n < step_.count(); ++n)
    if (in_impact[n] != 0) struck.push_back(step_.body(n));
  extend(struck);
}

/// Adds the pairs that bodies in impacts reach at twice the fastest speed of an impact: a heavy body may pass it to a light one.
void Space::extend_in_impacts() {
  std::vector<int> struck;
  double fastest_m_s = 0.0;
  for (const int body : step_.island().bodies) {
    if (!bodies_.is_moved_by_impact(body)) continue;
    struck.push_back(body);
    fastest_m_s = std::max(fastest_m_s, bodies_.calc_speed(body));
  }
  extend(struck, 2.0 * fastest_m_s);
}

/// Adds the pairs that come into reach of struck bodies, at a speed of at least `least_m_s`, to the present step; those with other islands
/// wait for the next.
void Space::extend(const std::vector<int>& struck, double least_m_s) {
  const std::size_t before = windows_.near().size();
  for (const int body : struck) windows_.extend(body, least_m_s);
  for (std::size_t n = before; n < windows_.near().size(); ++n)
    if (step_.has(*windows_.near()[n])) step_.island().pairs.push_back(windows_.near()[n]);
}

/// Applies all current strikes, rigid or modal.
void Space::strike(const std::vector<ContactRef>& first) {
  ++ledger_.costs.impacts;
  std::vector<ContactRef> contacts = rigid_impact_.gather(step_, first);
  while (rest_.wake_struck(step_, contacts)) contacts = rigid_impact_.gather(step_, first);
  Collision collision = rigid_impact_.make(step_, std::move(contacts));
  instants_.note(collision.contacts, collision.hits, get_time());
  const auto keep_triangles = [&](const std::vector<Hit>& hits) {
    for (int n = 0; const Hit& hit : hits) collision.contacts[n++].get().triangles = hit.triangles;
  };
  if (modal_impacts_.predict(step_, collision) && modal_impacts_.begin(step_, collision, instants_, touches_))
    return keep_triangles(collision.hits);
  modal_impacts_.end(collision.hits, touches_);
  rigid_impact_.solve(collision);
  double lost_j = 0.0;
  Strike& strike = strikes_.emplace_back(rigid_impact_.apply(collision, lost_j));
  strike.time_s = get_time();
  strike.together_s = step_.together_s;
  modal_states_.excite(strike, lost_j);
  rest_.reset(strike.bodies);
  extend(strike.bodies);
  keep_triangles(strike.hits);
}

}  // namespace carillon::rigid
