// Method: min 1/2 dx^T M dx with n.(da - db) >= -gap - allowance for all touches of an island: the velocity problem without friction, with
// velocities read as displacements. Open touches may close, but not overlap. The work is paid by the motion along the displacement, then by
// all motion of the displaced bodies, now or later, when they move: otherwise a rocking body would gain energy at each reversal.
// Source: V. Acary, "Projected event-capturing time-stepping schemes for nonsmooth mechanical systems with unilateral contact and Coulomb's
//   friction", Comput. Methods Appl. Mech. Eng. 256 (2013) 224.
#include "runtime/physics/rigid/projection.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/physics/rigid/limits.hpp"

namespace carillon::rigid {
namespace {

constexpr int kIterations = 3;           // iterations, each with the remaining gaps
constexpr int kMaxFactorised = 60;       // touches of an island
constexpr double kToleranceM = 1e-7;     // m; tolerance of sweeps,
constexpr int kMaxSweeps = 200;          // maximum number of sweeps
constexpr double kMaxRatio = 10.0;       // displacement of any point relative to the excess of the deepest touch
constexpr double kMaxPaidRatio = 0.5;    // fraction of the kinetic energy
constexpr double kDisplacedRatio = 0.1;  // relative to the largest displacement: bodies that pay

}  // namespace

bool Projection::can_part(const Step& step, const Pair& pair) const {
  if (pair.cord >= 0 || !step.has(pair)) return false;
  return is_movable(pair.a) || is_movable(pair.b);
}

/// Excess of the deepest touch over its allowance [m].
double Projection::find_excess(const Step& step, double step_s) const {
  double excess = 0.0;
  for (const Pair* pair : step.island().pairs) {
    if (!can_part(step, *pair)) continue;
    for (const Contact& c : pair->contacts)
      excess = std::max(excess, -c.touch.gap_m - touches_.calc_explained_depth(*pair, c.touch, step_s));
  }
  return excess;
}

/// `is_held`: a static body or the ground is among them.
std::vector<Point> Projection::make_points(const Step& step, double step_s, bool& is_held) const {
  std::vector<Point> points;
  for (const Pair* pair : step.island().pairs) {
    if (!can_part(step, *pair)) continue;
    for (const Contact& c : pair->contacts) {
      Point p = make_point(bodies_, step, c);
      if (!is_movable(c.a)) p.a = -1;
      if (!is_movable(c.b)) p.b = -1;
      p.friction = 0.0;
      p.wanted = -(c.touch.gap_m + touches_.calc_explained_depth(*pair, c.touch, step_s)) * p.normal;
      is_held = is_held || p.a < 0 || p.b < 0;
      points.push_back(p);
    }
  }
  return points;
}

void Projection::collect(const Step& step) {
  const auto is_owing = [&](int body) { return owed_j_[body] > 0.0; };
  if (std::none_of(step.island().bodies.begin(), step.island().bodies.end(), is_owing)) return;
  const bool is_held = std::any_of(step.island().pairs.begin(), step.island().pairs.end(), [&](const Pair* pair) {
    return can_part(step, *pair) && (pair->touches() || pair->presses()) && !(is_movable(pair->a) && is_movable(pair->b));
  });
  if (!is_held) return;  // a free island keeps its momentum
  for (const int i : step.island().bodies) {
    // A slow body that pays goes on creeping: a heap would not come to rest.
    if (!is_owing(i) || !is_movable(i) || bodies_.calc_speed(i) < kSlowSpeedMS) continue;
    State& s = bodies_.state(i);
    const double kinetic_j = calc_kinetic(bodies_.solid(i), s, bodies_.placed(i)), paid_j = std::min(owed_j_[i], kMaxPaidRatio * kinetic_j);
    if (!(paid_j > 0.0)) continue;
    const double part = std::sqrt(1.0 - paid_j / kinetic_j);
    s.velocity = part * s.velocity;
    s.momentum = part * s.momentum;
    bodies_.place(i);
    owed_j_[i] -= paid_j;
    ledger_.lift(-paid_j);
  }
}

void Projection::run(const Step& step, double allowed_m, double step_s) {
  for (int round = 0; round < kIterations; ++round) {
    const double excess = find_excess(step, step_s);
    if (excess <= allowed_m) return;
    std::vector<Mover> resting(step.count());
    for (int n = 0; n < step.count(); ++n) {
      const int i = step.body(n);
      if (is_movable(i)) resting[n] = {1.0 / bodies_.solid(i).mass_kg, bodies_.placed(i).inverse_inertia, {}, {}};
    }
    bool is_held = false;
    std::vector<Point> points = make_points(step, step_s, is_held);
    std::vector<Mover> displacements = resting;
    if (static_cast<int>(points.size()) > kMaxFactorised || !solver_.solve_directly(displacements, points, kMaxGuesses)) {
      displacements = resting;
      solver_.solve(displacements, points, kToleranceM, kMaxSweeps);
    }
    limit(step, kMaxRatio * excess, displacements);
    move(step, displacements, is_held);
    ++ledger_.costs.pushes;
  }
}

/// Conflicting touches, as in a jam, have no solution: scales all displacements so that no point of a body moves farther than `most_m`.
void Projection::limit(const Step& step, double most_m, std::vector<Mover>& displacements) const {
  double farthest = 0.0;
  for (int n = 0; n < step.count(); ++n)
    farthest = std::max(farthest, norm(displacements[n].velocity) + norm(displacements[n].spin) * bodies_.solid(step.body(n)).radius_m);
  if (farthest <= most_m) return;
  for (Mover& d : displacements) {
    d.velocity = (most_m / farthest) * d.velocity;
    d.spin = (most_m / farthest) * d.spin;
  }
}

/// Displaces every body by the velocity and spin of its mover. In an island held by static bodies the spin in body axes is kept, otherwise
/// the total angular momentum.
void Projection::move(const Step& step, const std::vector<Mover>& displacements, bool is_held) {
  const double before_j = bodies_.calc_energy(step.island().bodies);
  const Vec3 turning = is_held ? Vec3{} : calc_angular_momentum(step);
  for (int n = 0; n < step.count(); ++n) {
    const int i = step.body(n);
    if (!is_movable(i)) continue;
    State& s = bodies_.state(i);
    const Quaternion turn = make_turn(displacements[n].spin);
    const Vec3 spin = bodies_.placed(i).spin;
    s.centre = s.centre + displacements[n].velocity;
    s.rotation = normalise(multiply(turn, s.rotation));
    bodies_.place(i);
    if (bodies_.is_moved_by_impact(i))
      s.momentum = bodies_.calc_inertia(i) * spin;  // as in the impact
    else if (is_held)
      s.momentum = make_rotation(turn) * s.momentum;
    bodies_.place(i);
  }
  if (!is_held) turn(step, turning - calc_angular_momentum(step));
  for (Pair* pair : step.island().pairs) {
    double moved_m = 0.0;
    for (const int body : {pair->a, pair->b})
      if (const int n = step.find(body); n >= 0)
        moved_m += norm(displacements[n].velocity) + norm(displacements[n].spin) * bodies_.solid(body).radius_m;
    pair->travelled_m += moved_m;
    if (!pair->contacts.empty()) {
      touches_.refresh(*pair);
      touches_.remove_false(*pair);
    }
    if (moved_m > kMaxDepthM && can_part(step, *pair)) touches_.complete_in_flight(*pair, 0.0);
  }
  if (const double owed_j = bodies_.calc_energy(step.island().bodies) - before_j; is_held && owed_j > 0.0) pay(step, displacements, owed_j);
  double gained_j = bodies_.calc_energy(step.island().bodies) - before_j;
  for (Pair* pair : step.island().pairs) {
    for (double* source : {&pair->stored_j, &pair->stopped_j}) {
      const double spent_j = std::clamp(gained_j, 0.0, *source);
      *source -= spent_j;
      gained_j -= spent_j;
    }
  }
  // Bent bodies push themselves off.
  for (int n = 0; n < step.count() && gained_j > 0.0; ++n)
    if (is_movable(step.body(n)) && displacements[n].velocity != Vec3{}) gained_j -= modes_.take(step.body(n), gained_j);
  if (!(gained_j > 0.0)) return ledger_.lose(-gained_j);
  ledger_.lift(gained_j);
  if (is_held && bodies_.get_time() > 0.0) owe(step, displacements, gained_j);
}

/// Divides gained energy between the displaced bodies by the squares of their displacements in the mass norm.
void Projection::owe(const Step& step, const std::vector<Mover>& displacements, double gained_j) {
  std::vector<double> squares(step.count(), 0.0);
  double sum = 0.0;
  for (int n = 0; n < step.count(); ++n) {
    const int i = step.body(n);
    const Mover& d = displacements[n];
    if (is_movable(i)) squares[n] = bodies_.solid(i).mass_kg * dot(d.velocity, d.velocity) + dot(d.spin, bodies_.calc_inertia(i) * d.spin);
    sum += squares[n];
  }
  for (int n = 0; n < step.count() && sum > 0.0; ++n) owed_j_[step.body(n)] += gained_j * squares[n] / sum;
}

void Projection::pay(const Step& step, const std::vector<Mover>& displacements, double owed_j) {
  double farthest = 0.0;
  for (const Mover& d : displacements) farthest = std::max(farthest, norm(d.velocity));
  const auto for_displaced = [&](auto&& act) {
    for (int n = 0; n < step.count(); ++n)
      if (can_pay(step.body(n)) && norm(displacements[n].velocity) >= kDisplacedRatio * farthest) act(step.body(n), displacements[n]);
  };
  double momentum = 0.0,
         mass = 0.0;  // along the displacement: reducing the speed by s reduces the kinetic energy by momentum s - mass s^2 / 2
  for_displaced([&](int i, const Mover& d) {
    momentum += bodies_.solid(i).mass_kg * dot(d.velocity, bodies_.state(i).velocity) + dot(d.spin, bodies_.state(i).momentum);
    mass += bodies_.solid(i).mass_kg * dot(d.velocity, d.velocity) + dot(d.spin, bodies_.calc_inertia(i) * d.spin);
  });
  const double most_j = mass > 0.0 ? 0.5 * momentum * momentum / mass : 0.0;
  const double less = most_j > 0.0 ? momentum / mass * (1.0 - std::sqrt(std::max(0.0, 1.0 - owed_j / most_j))) : 0.0;
  double kinetic_j = 0.0;
  for_displaced([&](int i, const Mover& d) {
    State& s = bodies_.state(i);
    s.velocity = s.velocity - less * d.velocity;
    s.momentum = s.momentum - less * (bodies_.calc_inertia(i) * d.spin);
    bodies_.place(i);
    kinetic_j += calc_kinetic(bodies_.solid(i), s, bodies_.placed(i));
  });
  const double rest_j = std::min(owed_j - most_j, kMaxPaidRatio * kinetic_j);
  if (!(rest_j > 0.0)) return;
  const double part = std::sqrt(1.0 - rest_j / kinetic_j);
  for_displaced([&](int i, const Mover&) {
    State& s = bodies_.state(i);
    s.velocity = part * s.velocity;
    s.momentum = part * s.momentum;
    bodies_.place(i);
  });
}

/// About the origin [kg m^2/s].
Vec3 Projection::calc_angular_momentum(const Step& step) const {
  Vec3 sum{};
  for (const int i : step.island().bodies)
    sum = sum + bodies_.state(i).momentum + cross(bodies_.state(i).centre, bodies_.solid(i).mass_kg * bodies_.state(i).velocity);
  return sum;
}

/// Adds angular momentum to an island by a rigid spin of the whole.
void Projection::turn(const Step& step, const Vec3& gained) {
  double mass = 0.0;
  Vec3 centre{};
  for (const int i : step.island().bodies) {
    mass += bodies_.solid(i).mass_kg;
    centre = centre + bodies_.solid(i).mass_kg * bodies_.state(i).centre;
  }
  centre = (1.0 / mass) * centre;
  Mat3 inertia{};
  for (const int i : step.island().bodies) {
    const Mat3 own = bodies_.calc_inertia(i);
    const Vec3 r = bodies_.state(i).centre - centre;
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t l = 0; l < 3; ++l)
        inertia[k][l] += own[k][l] + bodies_.solid(i).mass_kg * ((k == l ? dot(r, r) : 0.0) - r[k] * r[l]);
  }
  const Vec3 spin = calc_inverse(inertia) * gained;
  for (const int i : step.island().bodies) {
    State& s = bodies_.state(i);
    s.velocity = s.velocity + cross(spin, s.centre - centre);
    s.momentum = s.momentum + bodies_.calc_inertia(i) * spin;
    bodies_.place(i);
  }
}

}  // namespace carillon::rigid
