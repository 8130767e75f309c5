// Method: one complementarity problem, by factorisation or by sweeps. Rest is proven by a solution with zero velocities. Fast touches end
// the step at their instant (instants.cpp).
// Source: J. J. Moreau, "Unilateral contact and dry friction in finite freedom dynamics" (1988).
#include "runtime/physics/rigid/step_problem.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "runtime/physics/rigid/limits.hpp"

namespace carillon::rigid {
namespace {

constexpr double kStrikeSpeedMS = 20e-3;                 // m/s; a gap that closes this fast at the end of a step strikes in the next one
constexpr double kSettlingSpeedMS = 0.02;                // m/s; a slower island is coming to rest
constexpr int kMaxDirectPoints = 24;                     // points of a small island
constexpr int kMaxDirectBodies = 12;                     // bodies coming to rest that are factorised without preceding sweeps
constexpr double kLooseRatio = 1000.0;                   // relative to the tolerance
constexpr double kLooseSpeedRatio = 1e-3;                // relative to the fastest of its bodies, if larger,
constexpr double kMaxLooseMS = 0.3 * kMinImpactSpeedMS;  // upper bound: standing bodies must not strike
constexpr int kMaxStepGuesses = 6;                       // of a factorised problem per step
constexpr double kRetryS = 4e-3;                         // s; time by sweeps after failed guesses,
constexpr double kExactRetryS = 1e-3;                    // s; where accuracy matters
constexpr int kProofSweeps = 600;                        // sweeps of a test of rest,
constexpr int kMaxProofSweeps = 1200;                    // for bodies slow for kLongSlowS

}  // namespace

/// True if the gain over the motion without contacts exceeds rounding.
bool StepProblem::gains_energy(const std::vector<Mover>& free, const Step& step) {
  double gained = 0.0, size = 0.0;
  for (const Point& p : step.points) {
    const double work = 0.5 * dot(p.impulse, calc_relative_velocity(free, p) + calc_relative_velocity(step.movers, p));
    gained += work;
    size += std::abs(work);
  }
  return gained > 1e-9 * size;
}

void StepProblem::solve(Step& step) {
  find_impulses(step);
  sum_impulses(step);
}

void StepProblem::find_impulses(Step& step) {
  ++ledger_.costs.solves;
  if (step.points.empty()) return;
  std::vector<Mover>& movers = step.movers;
  std::vector<Point>& points = step.points;
  const std::vector<int>& bodies = step.island().bodies;
  const double tolerance_m_s = options_.tolerance * std::max(norm(bodies_.gravity()), 1.0) * step.length_s;
  const std::vector<Mover> free = movers;
  const std::vector<Point> begun = points;
  double fastest = 0.0;
  for (const int body : bodies) fastest = std::max(fastest, bodies_.calc_speed(body));
  const int count = step.count();
  const bool settles = fastest < kSettlingSpeedMS;
  const bool is_small = count <= options_.max_direct && static_cast<int>(points.size()) <= kMaxDirectPoints;
  const bool rolls = std::any_of(points.begin(), points.end(), [](const Point& p) { return p.rolling_m > 0.0; });
  const bool is_exact = is_small && (count == 1 || rolls || !step.articulations.empty());  // fast bodies that tumble need less
  const auto factorise = [&](bool are_swept) {
    if (solver_.solve_directly(movers, points, is_exact ? kMaxGuesses : kMaxStepGuesses, are_swept) && !gains_energy(free, step))
      return true;
    // Rolling bodies conserve energy better this way, even if a guess fails occasionally.
    const double pause_s = !is_exact ? kRetryS : rolls ? 0.0 : kExactRetryS;
    for (const int body : bodies) next_guess_s_[body] = bodies_.get_time() + pause_s;
    return false;
  };
  const auto sweep = [&](int max) {
    const bool is_loose = !settles && !is_exact;  // fast motion needs less accuracy than bodies coming to rest
    const double tolerance =
                     is_loose ? std::max(kLooseRatio * tolerance_m_s, std::min(kLooseSpeedRatio * fastest, kMaxLooseMS)) : tolerance_m_s,
                 left = solver_.solve(movers, points, tolerance, max);
    ledger_.costs.sweeps += solver_.get_sweeps();
    return left <= tolerance && !gains_energy(free, step);
  };
  const bool may_guess = std::all_of(bodies.begin(), bodies.end(), [&](int body) { return bodies_.get_time() >= next_guess_s_[body]; });
  const bool at_once = is_small || (settles && count <= kMaxDirectBodies);
  if (at_once && may_guess) {
    // First guess: the sliding points of the last step.
    if (factorise(is_small)) return;
    movers = free;
    points = begun;
  }
  if (sweep(options_.max_sweeps)) return;
  if (!at_once && may_guess && settles && count <= options_.max_settling) {
    // Starts from the sweeps, which alone would let a pile tremble for long.
    const std::vector<Point> swept = points;
    movers = free;
    if (factorise(true)) return;
    movers = free;
    points = swept;
    sweep(2);
  }
  if (!gains_energy(free, step)) return;
  // Sweeps from zero impulses never add energy.
  movers = free;
  points = begun;
  for (Point& p : points) p.impulse = p.couple = {};
  sweep(options_.max_sweeps);
}

/// Angular impulses of all points on each body, and the resulting velocities of the articulations.
void StepProblem::sum_impulses(Step& step) const {
  step.turned.assign(step.count(), Vec3{});
  for (int n = 0; n < step.count(); ++n) step.turned[n] = step.loads[n].angular;
  for (std::size_t n = 0; n < step.pulls.size(); ++n) step.turned[n] = step.turned[n] + step.pulls[n].angular;
  for (const Point& p : step.points) {
    if (p.a >= 0) step.turned[p.a] = step.turned[p.a] + cross(p.arm_a, p.impulse) + p.couple;
    if (p.b >= 0) step.turned[p.b] = step.turned[p.b] - cross(p.arm_b, p.impulse) - p.couple;
  }
  for (ArticulationStep& a : step.articulations) {
    std::vector<joints::Spatial> impulses(a.articulation->bodies.size());
    bool any = false;
    const auto add = [&](int n, const Vec3& arm, const Vec3& impulse, const Vec3& couple) {
      if (n < 0 || step.movers[n].linkage != &a.linkage) return;
      joints::Spatial& on = impulses[step.movers[n].member];
      on.linear = on.linear + impulse;
      on.angular = on.angular + cross(arm, impulse) + couple;
      any = any || impulse != Vec3{} || couple != Vec3{};
    };
    for (const Point& p : step.points) {
      add(p.a, p.arm_a, p.impulse, p.couple);
      add(p.b, p.arm_b, -1.0 * p.impulse, -1.0 * p.couple);
    }
    a.push.clear();
    if (any) a.push = a.articulation->mechanism->calc_push(a.free, impulses);
  }
}

bool StepProblem::solve_rest(Step& step, double h, const std::vector<joints::Spatial>& pulls, double slow_s) {
  std::vector<Mover>& movers = step.movers;
  std::vector<Point>& points = step.points;
  predict(step, h, true);
  for (int n = 0; n < static_cast<int>(pulls.size()); ++n) {
    movers[n].velocity = movers[n].velocity + (h * movers[n].inverse_mass) * pulls[n].linear;
    movers[n].spin = movers[n].spin + h * (movers[n].inverse_inertia * pulls[n].angular);
  }
  make_points(step, false);
  // Gaps within the surface roughness count as contact.
  for (int n = 0; Point & p : points)
    if (step.rows[n++].get().touch.gap_m <= kDeepM) p.wanted = {};
  const std::vector<Point> moving = points;
  for (Point& p : points) p.impulse = p.couple = {};
  const std::vector<Point> unloaded = points;
  const double g = std::max(norm(bodies_.gravity()), 1e-9);
  const double bound = slow_s > kLongSlowS ? kSlowSpeedMS / (g * kLongSlowS) : kRestResidualRatio;
  const std::vector<Mover> free = movers;
  const auto holds = [&] {
    std::vector<char> carried(step.count(), 0);  // an unsupported body is not at rest, even without gravity
    for (int n = 0; n < static_cast<int>(pulls.size()); ++n) carried[n] = dot(pulls[n].linear, bodies_.gravity()) < 0.0 ? 1 : 0;
    for (const Point& p : points)
      for (const int n : {p.a, p.b})
        if (n >= 0 && dot(p.impulse, p.normal) > 0.0) carried[n] = 1;
    for (const ArticulationStep& a : step.articulations) {
      const std::vector<int>& members = a.linkage.movers;
      const bool any = a.articulation->is_anchored || std::any_of(members.begin(), members.end(), [&](int n) { return carried[n] != 0; });
      for (const int n : members) carried[n] = any ? 1 : 0;
    }
    for (int n = 0; n < step.count(); ++n) {
      const double radius = bodies_.solid(step.body(n)).radius_m;
      if (!carried[n] || norm(movers[n].velocity) + norm(movers[n].spin) * radius > bound * g * h) return false;
    }
    return true;
  };
  ++ledger_.costs.solves;
  const bool balanced = solver_.solve_directly(movers, points, kMaxGuesses) && holds();
  // Sweeps from the impulses of the motion, and from zero.
  const auto sweep_from = [&](const std::vector<Point>& from, int max_sweeps) {
    movers = free;
    points = from;
    solver_.solve(movers, points, 1e-2 * bound * g * h, max_sweeps);
    ledger_.costs.sweeps += solver_.get_sweeps();
    return holds();
  };
  return balanced || sweep_from(moving, kProofSweeps) || sweep_from(unloaded, slow_s > kLongSlowS ? kMaxProofSweeps : kProofSweeps);
}

void StepProblem::keep_impulses(const Step& step, double at_s) const {
  const double h = step.length_s;
  for (Pair* pair : step.island().pairs) ledger_.lose(pair->take_stopped_j());
  for (int n = 0; const Point& p : step.points) {
    const ContactRef& row = step.rows[n++];
    Contact& c = row.get();
    const bool closes = c.cord < 0 && !c.touching && c.touch.gap_m > kTouchGapM;
    c.impulse = p.impulse;
    if (c.is_load) c.impulse = c.impulse + h * c.rest_n;
    c.couple = p.couple;
    c.step_s = h;
    c.until_s = bodies_.get_time() + at_s;
    c.lost_j = step.calc_loss(p, 1.0);
    const double lost_j = at_s < h ? step.calc_loss(p, at_s / h) : c.lost_j;
    if (closes && lost_j > 0.0)
      row.pair->stopped_j += lost_j;
    else
      ledger_.lose(lost_j);
    const bool comes = c.touch.gap_m > kTouchGapM && dot(calc_relative_velocity(step.movers, p), p.normal) < -kStrikeSpeedMS;
    c.touching = (dot(c.impulse, c.touch.normal) > 0.0 && !comes) || c.is_closed();
  }
}

void StepProblem::remove_gain(const Step& step, double before_j) {
  const std::vector<int>& bodies = step.island().bodies;
  const double gained = bodies_.calc_energy(bodies) - before_j;
  if (!(gained > 0.0)) return;
  const auto is_free = [&](const ContactRef& row) { return bodies_.moves(row.pair->a) && bodies_.moves(row.pair->b); };
  if (std::all_of(step.rows.begin(), step.rows.end(), is_free)) return;
  const double kinetic = bodies_.calc_kinetic(bodies);
  ledger_.lose(std::min(gained, kinetic));
  const double part = kinetic > gained ? std::sqrt(1.0 - gained / kinetic) : 0.0;
  for (const ArticulationStep& a : step.articulations) {
    for (double& u : a.articulation->now.u) u *= part;
    bodies_.place(*a.articulation);
  }
  for (const int body : bodies) {
    if (bodies_.find_articulation(body) != nullptr) continue;
    State& s = bodies_.state(body);
    s.velocity = part * s.velocity;
    s.momentum = part * s.momentum;
    bodies_.place(body);
  }
}

}  // namespace carillon::rigid
