// Loops over the points. Without contraction, so results do not depend on the instruction set.
#include "runtime/physics/rigid/sweeps.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/base/simd.hpp"

#pragma GCC diagnostic ignored "-Wpsabi"  // no vector is passed between instruction sets

HWY_BEFORE_NAMESPACE();
namespace carillon::rigid::sweeps::HWY_NAMESPACE {
namespace {

/// Matrix by columns times vector.
inline Four combine(const Four (&columns)[3], const Four& by) { return by[0] * columns[0] + (by[1] * columns[1] + by[2] * columns[2]); }

inline double dot(const Four& a, const Four& b) { return a[0] * b[0] + (a[1] * b[1] + a[2] * b[2]); }

/// Tangential part.
inline Four drop_normal(const Four& from) {
  Four a = from;
  a[0] = 0.0;
  return a;
}

/// Velocity of a minus that of b at the point; axes of the point.
inline Four calc_velocity(const Problem& problem, const Row& row) {
  const Body &a = problem.bodies[row.a], &b = problem.bodies[row.b];
  return combine(row.along, a.velocity - b.velocity) + (combine(row.turning_a, a.spin) + combine(row.turning_b, b.spin));
}

inline Four cross(const Four& a, const Four& b) {
  return Four{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0], 0.0};
}

inline void transpose(const Four (&rows)[3], Four (&columns)[3]) {
  for (int c = 0; c < 3; ++c) columns[c] = Four{rows[0][c], rows[1][c], rows[2][c], 0.0};
}

void prepare(Problem& problem) {
  for (std::size_t n = 0; n < problem.rows.size(); ++n) {
    Row& row = problem.rows[n];
    const Arms& arms = problem.arms[n];
    const Inertia &a = problem.inertias[row.a], &b = problem.inertias[row.b];
    transpose(row.axis, row.along);
    Four couples_a[3], couples_b[3];
    for (int j = 0; j < 3; ++j) {
      couples_a[j] = cross(arms.a, row.axis[j]);
      couples_b[j] = cross(row.axis[j], arms.b);
      row.spun_a[j] = combine(a.columns, couples_a[j]);
      row.spun_b[j] = combine(b.columns, couples_b[j]);
    }
    transpose(couples_a, row.turning_a);
    transpose(couples_b, row.turning_b);
    row.mass_a = a.inverse_mass;
    row.mass_b = -b.inverse_mass;
    if (row.locked >= 0) continue;
    Four k[3];  // mobility, axes of the point, by columns
    for (int j = 0; j < 3; ++j) {
      k[j] = combine(row.turning_a, row.spun_a[j]) + combine(row.turning_b, row.spun_b[j]);
      k[j][j] += row.mass_a - row.mass_b;
    }
    const Four x = cross(k[1], k[2]), y = cross(k[2], k[0]), z = cross(k[0], k[1]);
    const Four rows[3] = {x, y, z};
    transpose(rows, row.inverse);
    const double part = 1.0 / dot(k[0], x);
    for (Four& column : row.inverse) column *= part;
    row.mobility = k[0][0];
    row.normal_mass = 1.0 / k[0][0];
    row.tangent_mass = 1.0 / (k[1][1] + k[2][2]);  // sum of both tangential eigenvalues
  }
}

inline void respond(Problem& problem, const Range& range, const Four& by) {
  for (int n = range.begin; n < range.end; ++n) {
    const Response& r = problem.responses[n];
    Body& body = problem.bodies[r.body];
    body.velocity += combine(r.velocity, by);
    body.spin += combine(r.spin, by);
  }
}

inline void push(Problem& problem, const Row& row, const Four& impulse) {
  Body &a = problem.bodies[row.a], &b = problem.bodies[row.b];
  const Four world = combine(row.axis, impulse);
  a.velocity += row.mass_a * world;
  a.spin += combine(row.spun_a, impulse);
  b.velocity += row.mass_b * world;
  b.spin += combine(row.spun_b, impulse);
  if (row.locked >= 0) respond(problem, problem.locked[row.locked].pushed, impulse);
}

/// Impulse of a point required by the current velocities; `part` < 1: only this part of its change.
inline Four calc_impulse(const Problem& problem, const Row& row, double part) {
  const Four missing = row.wanted - calc_velocity(problem, row);
  const Locked* locked = row.locked >= 0 ? &problem.locked[row.locked] : nullptr;
  // No impulse along directions that joints block.
  bool may_stick = part == 1.0;
  if (locked != nullptr && may_stick) {
    const Four beyond = missing - combine(locked->allowed, missing);
    may_stick = dot(beyond, beyond) <= 1e-12 * dot(missing, missing);
  }
  if (may_stick) {
    const Four stuck = row.impulse + combine(row.inverse, missing);
    const double limit = row.friction * stuck[0];
    if (stuck[0] > 0.0 && stuck[1] * stuck[1] + stuck[2] * stuck[2] <= limit * limit) return stuck;
  }
  const double pushed = std::max(0.0, row.impulse[0] + part * row.normal_mass * missing[0]);
  Four next = drop_normal(row.impulse);
  if (locked != nullptr)
    next += part * combine(locked->across, drop_normal(missing) - (pushed - row.impulse[0]) * locked->by_push);
  else
    next += (part * row.tangent_mass) * drop_normal(missing);
  const double limit = row.friction * pushed, square = next[1] * next[1] + next[2] * next[2];
  if (square > limit * limit) next *= limit / std::sqrt(square);
  next[0] = pushed;
  return next;
}

inline void give_couple(Problem& problem, const Row& row, const Turning& turning, const Four& couple) {
  problem.bodies[row.a].spin += combine(turning.spun_a, couple);
  problem.bodies[row.b].spin += combine(turning.spun_b, couple);
  respond(problem, turning.turned, couple);
}

/// Updates the couple that resists rolling and twisting. Returns its squared change, as a velocity.
inline double turn(Problem& problem, const Row& row, Turning& turning) {
  const Body &a = problem.bodies[row.a], &b = problem.bodies[row.b];
  Four next = turning.couple - turning.mass * combine(row.along, a.spin - b.spin);
  const double pushed = row.impulse[0], limit = turning.rolling_m * pushed, square = next[1] * next[1] + next[2] * next[2];
  const double twist = std::clamp(next[0], -turning.twisting_m * pushed, turning.twisting_m * pushed);
  if (square > limit * limit) next *= limit / std::sqrt(square);
  next[0] = twist;
  const Four change = next - turning.couple;
  turning.couple = next;
  give_couple(problem, row, turning, change);
  const double size = turning.arm_m / turning.mass;
  return dot(change, change) * (size * size);
}

double sweep(Problem& problem, bool onward) {
  const std::size_t count = problem.rows.size();
  double largest = 0.0;
  for (std::size_t n = 0; n < count; ++n) {
    Row& row = problem.rows[onward ? n : count - 1 - n];
    const Four wanted = calc_impulse(problem, row, 1.0), change = wanted - row.impulse;
    const double square = dot(change, change);
    if (square != 0.0) {
      largest = std::max(largest, square * (row.mobility * row.mobility));
      push(problem, row, change);
      row.impulse = wanted;
    }
    if (row.turning >= 0) largest = std::max(largest, turn(problem, row, problem.turnings[row.turning]));
  }
  return largest;
}

void add(Problem& problem, const std::vector<Change>& changes) {
  for (std::size_t n = 0; n < problem.rows.size(); ++n) {
    push(problem, problem.rows[n], changes[n].by);
    problem.rows[n].impulse += changes[n].by;
  }
}

void begin(Problem& problem) {
  for (const Row& row : problem.rows) {
    push(problem, row, row.impulse);
    if (row.turning < 0) continue;
    const Turning& turning = problem.turnings[row.turning];
    give_couple(problem, row, turning, turning.couple);
  }
}

void share(Problem& problem, double part) {
  // All points use the velocities before any of them has changed.
  for (std::size_t n = 0; n < problem.rows.size(); ++n)
    problem.changes[n].by = calc_impulse(problem, problem.rows[n], part) - problem.rows[n].impulse;
  add(problem, problem.changes);
}

const Functions& get_table() {
  static constexpr Functions kFunctions{prepare, sweep, add, begin, share};
  return kFunctions;
}

}  // namespace
}  // namespace carillon::rigid::sweeps::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::rigid::sweeps {

HWY_EXPORT(get_table);
const Functions& get_functions(base::Instructions best) { return base::choose(HWY_DISPATCH_TABLE(get_table), best)(); }

}  // namespace carillon::rigid::sweeps
#endif
