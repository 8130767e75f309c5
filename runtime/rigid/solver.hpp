// Contacts that last, in one step: the impulses of all points that touch, found together.
#pragma once

#include <vector>

#include "runtime/impact/vector.hpp"
#include "runtime/rigid/linkage.hpp"

namespace carillon::rigid {

using impact::Mat3;
using impact::Vec3;

/// A body in a step, world axes: what impulses do to it. Fixed ones and the ground have none of their own; their index is -1.
struct Mover {
  double inverse_mass = 0.0;         // 1/kg
  Mat3 inverse_inertia{};            // 1/(kg m^2)
  Vec3 velocity{}, spin{};           // m/s of the centre, rad/s; in: at the end of the step without contacts; out: with them
  const Linkage* linkage = nullptr;  // on joints: what impulses do is in there
  int member = 0;                    // of it
};

/// One point in touch. u is the velocity of a less that of b there.
struct Point {
  int a = -1, b = -1;
  Vec3 arm_a{}, arm_b{};     // from the centres [m]
  Vec3 normal{};             // unit, from b to a
  Vec3 wanted{};             // u at the end: along the normal at least this much, across it exactly while it sticks [m/s]
  double friction = 0.0;     // Coulomb's
  double rolling_m = 0.0;    // arm of the couple that resists rolling: bound over the normal impulse
  double twisting_m = 0.0;   // the same about the normal
  Vec3 impulse{}, couple{};  // on a [N s, N m s]; in: where the iteration begins
};

/// Changes the points' impulses and couples, and velocities and spins with them, until the largest change of a velocity by a sweep is below
/// `tolerance_m_s`, in at most `most_sweeps` sweeps to and fro over the points as they are ordered. Every normal impulse pushes, every
/// tangential one is inside the cone, and couples are inside their bounds. Returns the change of the last sweep [m/s].
class Solver {
 public:
  double solve(std::vector<Mover>& movers, std::vector<Point>& points, double tolerance_m_s, int most_sweeps);
  /// Shares the load evenly between points that are redundant, from zero impulses: sweeps in which all points change at once, damped by
  /// their number. A box that lands flat keeps its symmetry.
  void share(std::vector<Mover>& movers, std::vector<Point>& points, int sweeps);
  /// solve() from where share() ended.
  double solve_on(std::vector<Mover>& movers, std::vector<Point>& points, double tolerance_m_s, int most_sweeps);
  /// The same problem by factorisation, for what sweeps take too long for (towers, unequal masses): guesses which points carry and stick,
  /// solves, corrects the guess from the answer, in at most `most_guesses`. Redundant points share their load evenly. True where the guess
  /// was confirmed; the impulses obey all bounds in any case. False where bodies are on joints.
  /// `are_swept`: the impulses given are an answer of sweeps, and points at their bound slide in the first guess; otherwise all that carry
  /// stick in it.
  bool solve_directly(std::vector<Mover>& movers, std::vector<Point>& points, int most_guesses, bool are_swept = false);
  int get_sweeps() const { return sweeps_; }

 private:
  struct Row {
    Mat3 inverse{};             // of the mobility at the point: impulse per velocity
    double normal_mass = 0.0;   // 1 / (n . K n)
    double tangent_mass = 0.0;  // 1 / the largest eigenvalue of K across n, or less
    double turning_mass = 0.0;  // of the couple
    bool locked = false;        // joints do not allow all ways
    Mat3 range{};               // projects on those that they allow
    Mat3 across{};              // impulse per velocity across the normal, the motion along it given
    Vec3 by_push{};             // velocity across the normal per impulse along it
  };
  void prepare(const std::vector<Mover>& movers, const std::vector<Point>& points);
  Vec3 calc_impulse(const std::vector<Mover>& movers, const Point& point, const Row& row, double part) const;
  double sweep(std::vector<Mover>& movers, std::vector<Point>& points, bool forth);
  std::vector<Row> rows_;
  std::vector<Vec3> before_, way_;
  int sweeps_ = 0;
};

/// Velocity of the point of a less that of b.
Vec3 calc_relative_velocity(const std::vector<Mover>& movers, const Point& point);

Vec3 calc_relative_spin(const std::vector<Mover>& movers, const Point& point);
/// Gives both bodies of a point an impulse, or a couple.
void apply(std::vector<Mover>& movers, const Point& point, const Vec3& impulse);
void turn(std::vector<Mover>& movers, const Point& point, const Vec3& couple);

/// The mobility at a point [1/kg]: u gained per impulse.
Mat3 calc_mobility(const std::vector<Mover>& movers, const Point& point);

}  // namespace carillon::rigid
