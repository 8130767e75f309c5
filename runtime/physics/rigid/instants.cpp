// Method: candidates from constant relative accelerations; instants by bracketing on the paths, while a candidate is earlier than the first
// instant found.
// Source: B. Mirtich, "Impulse-based dynamic simulation of rigid body systems" (1996).
#include "runtime/physics/rigid/instants.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "runtime/base/crossing.hpp"
#include "runtime/physics/rigid/cords.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::rigid {
namespace {

constexpr double kGapToleranceM = 1e-9;  // m; gap tolerance of an instant of impact,
constexpr int kMaxEvaluations = 20;      // maximum number of evaluations
constexpr double kStrikeGapM = 1e-6;     // m; a touch nearer than this at the end of a step strikes there
constexpr double kMaxStopM = 5e-5;       // m; depth of a touch that a row stops,
constexpr double kMinPartS = 4e-6;       // s; unless the step becomes shorter
constexpr double kCrowdedS = 2e-3;       // s; duration of the crowded state of an island

/// True if this touch closes within the step, faster than `slowest`.
bool is_faster(const Bodies& bodies, const Contact& c, double h, double slowest) {
  if (c.presses || c.is_closed()) return false;
  const double approach = bodies.calc_approach(c.touch, c.a, c.b), gap = std::max(c.touch.gap_m, 0.0);
  double pull = 0.0;  // closing acceleration in flight
  if (bodies.moves(c.a)) pull -= dot(bodies.gravity(), c.touch.normal);
  if (bodies.moves(c.b)) pull += dot(bodies.gravity(), c.touch.normal);
  const double square = approach * approach + 2.0 * std::max(pull, 0.0) * gap;
  if (square <= slowest * slowest) return false;
  // A touch that has just rebounded returns within the step only if it is slow.
  if (approach < 0.0) return pull > 0.0 && -approach + std::sqrt(square) <= pull * h;
  return gap <= approach * h + 0.5 * norm(bodies.gravity()) * h * h + 1e-6;
}

bool rattles(const Bodies& bodies, const Pair& pair) { return bodies.get_time() < pair.rattles_until_s; }

}  // namespace

bool is_fast(const Bodies& bodies, const Pair& pair, const Contact& c, double h) {
  return is_faster(bodies, c, h, rattles(bodies, pair) ? kRattleSpeedMS : kMinImpactSpeedMS);
}

bool Instants::find(const Step& step, double& at_s, std::vector<ContactRef>& first) const {
  struct Candidate {
    ContactRef ref;
    double at;
    double apex;  // end of the separation
  };
  const double h = step.length_s;
  std::vector<Candidate> candidates;
  for (Pair* pair : step.island().pairs) {
    if (!step.has(*pair)) continue;
    for (int k = 0; const Contact& c : pair->contacts) {
      const ContactRef ref{pair, k++};
      if (!is_fast(bodies_, *pair, c, h)) {
        if (rattles(bodies_, *pair) && is_faster(bodies_, c, h, kMinImpactSpeedMS)) pair->quiet_until(bodies_.get_time() + h + kRattleS);
        if (c.closes_s >= 0.0 && !c.presses) candidates.push_back({ref, c.closes_s, 0.0});
        continue;
      }
      const double approach = bodies_.calc_approach(c.touch, c.a, c.b),
                   later = -dot(calc_relative_velocity(step.movers, make_point(bodies_, step, c)), c.touch.normal);
      const double rate = (later - approach) / h;
      // gap = approach s + rate s^2 / 2
      const double gap = std::max(c.touch.gap_m, 0.0), root = approach * approach + 2.0 * rate * gap;
      if (root < 0.0) {  // a mid-step impulse reverses it, maybe after it has closed
        if (approach * 0.5 * h >= gap) candidates.push_back({ref, gap / approach, 0.0});
        continue;
      }
      if (approach <= 0.0 && rate <= 0.0) continue;
      const double at = approach > 0.0 ? 2.0 * gap / (approach + std::sqrt(root)) : (std::sqrt(root) - approach) / rate;
      if (at <= h) candidates.push_back({ref, at, approach < 0.0 ? -approach / rate : 0.0});
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(), [](const auto& x, const auto& y) { return x.at < y.at; });
  // Paths are slightly curved: instants are searched on them while a guess is earlier than the first one found.
  double earliest = std::numeric_limits<double>::infinity();
  for (Candidate& c : candidates) {
    if (c.at >= earliest) break;
    c.at = find_instant(step, c.ref, c.apex, c.at).value_or(std::numeric_limits<double>::infinity());
    earliest = std::min(earliest, c.at);
  }
  if (!std::isfinite(earliest)) return false;
  at_s = earliest;
  for (const Candidate& c : candidates)
    if (c.at <= at_s + step.together_s) first.push_back(c.ref);
  return true;
}

/// Closing time on the path of the step of a touch that closes at about `guess_s`, not before `apex_s`; none if it does not close.
std::optional<double> Instants::find_instant(const Step& step, const ContactRef& ref, double apex_s, double guess_s) const {
  Pair& pair = *ref.pair;
  const geometry::Touch now = ref.get().touch;
  const auto look = [&](double s) {
    if (pair.cord >= 0) {
      const auto get_state = [&](int body) {
        return bodies_.moves(body) ? step.calc_moved(step.find(body), s) : body >= 0 ? bodies_.state(body) : State{};
      };
      return calc_cord_gap(touches_.cord(pair.cord), get_state(pair.a), get_state(pair.b));
    }
    const auto get_frame = [&](int body) {
      return bodies_.moves(body) ? place(bodies_.solid(body), step.calc_moved(step.find(body), s)).frame : bodies_.get_frame(body);
    };
    return touches_.find_moved(pair, now, get_frame(pair.a), get_frame(pair.b)).gap_m;
  };
  if (!(guess_s > 0.0)) return guess_s;
  double open = apex_s, open_m = apex_s > 0.0 ? look(apex_s) : now.gap_m;
  if (!(open_m > 0.0)) return guess_s;  // separates by less than its depth
  double shut = guess_s, shut_m = look(guess_s);
  if (shut_m > kGapToleranceM) {
    open = shut;
    open_m = shut_m;
    shut = step.length_s;
    shut_m = look(shut);
    if (shut_m > kStrikeGapM) return std::nullopt;
  }
  if (shut_m >= -kGapToleranceM) return shut;
  return base::find_crossing(look, open, open_m, shut, shut_m, kGapToleranceM, 0.0, kMaxEvaluations);
}

std::vector<ContactRef> Instants::list_closing(const Step& step, double step_s) const {
  std::vector<ContactRef> closing;
  for (Pair* pair : step.island().pairs) {
    if (!step.has(*pair)) continue;
    for (int k = 0; const Contact& c : pair->contacts) {
      const ContactRef ref{pair, k++};
      if (is_fast(bodies_, *pair, c, step_s) && bodies_.calc_approach(c.touch, c.a, c.b) > 0.0) closing.push_back(ref);
    }
  }
  return closing;
}

bool Instants::confirm(const Step& step, std::vector<ContactRef>& first, double step_s, double near_m) const {
  std::vector<Pair*> pairs;
  for (const ContactRef& ref : first)
    if (std::find(pairs.begin(), pairs.end(), ref.pair) == pairs.end()) pairs.push_back(ref.pair);
  first.clear();
  bool any = false;
  for (Pair* pair : pairs) {
    touches_.search(*pair, std::max(step_s, 1e-5));
    touches_.refresh(*pair);
    for (int k = 0; const Contact& c : pair->contacts) {
      const ContactRef ref{pair, k++};
      const double approach = bodies_.calc_approach(c.touch, c.a, c.b);
      if (c.presses || approach <= 0.5 * kMinImpactSpeedMS || c.is_closed() ||
          c.touch.gap_m > std::max(approach * step.together_s + kTouchGapM, std::isfinite(near_m) ? near_m : 0.0))
        continue;
      first.push_back(ref);
      any = any || c.touch.gap_m <= near_m;
    }
  }
  return any;
}

double Instants::calc_stopping_time(const Step& step) const {
  double time_s = step.length_s;
  for (const ContactRef& row : step.rows) {
    const Contact& c = row.get();
    const double approach = bodies_.calc_approach(c.touch, c.a, c.b);
    if (c.cord < 0 && approach > 0.0)
      time_s = std::min(time_s, std::max(2.0 * (std::max(c.touch.gap_m, 0.0) + kMaxStopM) / approach, kMinPartS));
  }
  return time_s;
}

void Instants::note(const std::vector<ContactRef>& contacts, const std::vector<Hit>& hits, double time_s) const {
  std::map<Pair*, double> fastest;
  for (int n = 0; const ContactRef& ref : contacts) {
    const Hit& hit = hits[n++];
    if (!hit.is_cord) fastest[ref.pair] = std::max(fastest[ref.pair], hit.approach_m_s);
  }
  for (const auto& [pair, speed] : fastest) {
    if (speed <= kMinImpactSpeedMS || speed >= kRattleSpeedMS) continue;
    // A ball bouncing to rest also strikes often, but each time slower by its restitution e: by e^4 over these.
    const Pair::SlowHit& first = pair->slow_hits.front();
    const bool decays = speed < std::pow(bodies_.calc_restitution(pair->a, pair->b), 2.0) * first.speed_m_s;
    if (first.time_s >= 0.0 && time_s - first.time_s < kRattleS && !decays) pair->quiet_until(time_s + kRattleS);
    std::shift_left(pair->slow_hits.begin(), pair->slow_hits.end(), 1);
    pair->slow_hits.back() = {time_s, speed};
  }
}

void Instants::set_crowded(const Island& island, double time_s) {
  for (const int body : island.bodies) crowded_until_s_[body] = time_s + kCrowdedS;
}

bool Instants::is_crowded(const Island& island, double time_s) const {
  return std::any_of(island.bodies.begin(), island.bodies.end(), [&](int body) { return is_crowded(body, time_s); });
}

}  // namespace carillon::rigid
