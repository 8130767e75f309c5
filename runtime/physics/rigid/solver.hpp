// Contacts that last, in one step: the impulses of all points that touch, found together.
#pragma once

#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/physics/rigid/linkage.hpp"
#include "runtime/physics/rigid/sweeps.hpp"

namespace carillon::rigid {

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

/// Solves the complementarity problem of all points of a step. Invariant: after every call the normal impulses push, the tangential ones
/// lie inside the cone, and the couples inside their bounds, converged or not. Members are work memory: no call changes the result of the
/// next.
class Solver {
 public:
  explicit Solver(const sweeps::Functions& functions = sweeps::get_functions()) : functions_(&functions) {}
  /// Changes the points' impulses and couples, and velocities and spins with them, until the largest change of a velocity by a sweep is
  /// below `tolerance_m_s`, in at most `max_sweeps` sweeps to and fro over the points as they are ordered. Returns the change of the last
  /// sweep [m/s].
  double solve(std::vector<Mover>& movers, std::vector<Point>& points, double tolerance_m_s, int max_sweeps);
  /// The same from zero impulses, and the load shared evenly first between points that are redundant: `shares` times all points change at
  /// once, damped by their number. A box that lands flat keeps its symmetry.
  double solve_evenly(std::vector<Mover>& movers, std::vector<Point>& points, int shares, double tolerance_m_s, int max_sweeps);
  /// The same problem by factorisation, for what sweeps take too long for (towers, unequal masses): guesses which points carry and stick,
  /// solves, corrects the guess from the answer, in at most `max_guesses`. Redundant points share their load evenly. True where the guess
  /// was confirmed; the impulses obey all bounds in any case. False where bodies are on joints.
  /// `are_swept`: the impulses given are an answer of sweeps or of the step before, and points at their bound slide in the first guess;
  /// otherwise all that carry stick in it.
  bool solve_directly(std::vector<Mover>& movers, std::vector<Point>& points, int max_guesses, bool are_swept = false);
  int get_sweeps() const { return sweeps_; }

 private:
  void prepare(const std::vector<Mover>& movers, const std::vector<Point>& points);
  void lock(const std::vector<Mover>& movers, const Point& point, const Mat3& axes, sweeps::Row& row);
  void add_turning(const std::vector<Mover>& movers, const Point& point, const Mat3& axes, sweeps::Row& row);
  void add_responses(const std::vector<Mover>& movers, int body, const Vec3& arm, double sign, bool are_impulses, const Mat3& axes);
  double run(double tolerance_m_s, int max_sweeps);
  void take(std::vector<Mover>& movers, std::vector<Point>& points) const;

  const sweeps::Functions* functions_;
  sweeps::Problem problem_;
  std::vector<sweeps::Change> before_, way_;
  int sweeps_ = 0;
};

/// Velocity of the point of a less that of b.
Vec3 calc_relative_velocity(const std::vector<Mover>& movers, const Point& point);

Vec3 calc_relative_spin(const std::vector<Mover>& movers, const Point& point);
/// Gives both bodies of a point an impulse, or a couple.
void apply(std::vector<Mover>& movers, const Point& point, const Vec3& impulse);
void turn(std::vector<Mover>& movers, const Point& point, const Vec3& couple);

/// Scale of the couples at a point: couple per spin [kg m^2], as without joints. 0: the point has no couple.
double calc_turning_mass(const std::vector<Mover>& movers, const Point& point);

/// The mobility at a point [1/kg]: u gained per impulse.
Mat3 calc_mobility(const std::vector<Mover>& movers, const Point& point);

}  // namespace carillon::rigid
