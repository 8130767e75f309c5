// Persistent contacts in one step: simultaneous impulses of all touching points.
#pragma once

#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/physics/rigid/linkage.hpp"
#include "runtime/physics/rigid/sweeps.hpp"

namespace carillon::rigid {

/// Response of a body to impulses in a step, world axes. Fixed bodies and the ground have no mover; their index is -1.
struct Mover {
  double inverse_mass = 0.0;         // 1/kg
  Mat3 inverse_inertia{};            // 1/(kg m^2)
  Vec3 velocity{}, spin{};           // m/s of the centre, rad/s; in: at the end of the step without contacts; out: with contacts
  const Linkage* linkage = nullptr;  // on joints: holds the response to impulses
  int member = 0;                    // index in the linkage
};

/// One touching point. u is the velocity of a minus that of b there.
struct Point {
  int a = -1, b = -1;
  Vec3 arm_a{}, arm_b{};     // from the centres [m]
  Vec3 normal{};             // unit, from b to a
  Vec3 wanted{};             // u at the end: minimum along the normal, exact tangentially while sticking [m/s]
  double friction = 0.0;     // Coulomb coefficient
  double rolling_m = 0.0;    // rolling resistance arm: couple bound over the normal impulse
  double twisting_m = 0.0;   // twisting resistance arm, about the normal
  Vec3 impulse{}, couple{};  // on a [N s, N m s]; in: initial values
};

/// Solves the complementarity problem of all points of a step. Invariant: after every call the normal impulses push, the tangential ones
/// lie inside the cone, and the couples inside their bounds, converged or not. Members are work memory: no call affects the result of the
/// next.
class Solver {
 public:
  explicit Solver(const sweeps::Functions& functions = sweeps::get_functions()) : functions_(&functions) {}
  /// Updates the points' impulses and couples, and the velocities and spins, until the largest velocity change of a sweep is below
  /// `tolerance_m_s`, in at most `max_sweeps` alternating sweeps in the given order. Returns the change of the last sweep [m/s].
  double solve(std::vector<Mover>& movers, std::vector<Point>& points, double tolerance_m_s, int max_sweeps);
  /// solve() from zero impulses, with the load first shared evenly between redundant points: `shares` simultaneous updates of all points,
  /// damped by their number. A box that lands flat keeps its symmetry.
  double solve_evenly(std::vector<Mover>& movers, std::vector<Point>& points, int shares, double tolerance_m_s, int max_sweeps);
  /// The same problem by factorisation, for slowly converging cases (towers, unequal masses): guesses the load-bearing and sticking points,
  /// solves, and corrects the guess from the solution, at most `max_guesses` times. Redundant points share their load evenly. True if the
  /// guess was confirmed; the impulses obey all bounds in any case. False if bodies are on joints. `are_swept`: the given impulses are a
  /// solution of sweeps or of the previous step, and points at their bound slide in the first guess; otherwise all load-bearing points
  /// stick in it.
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

/// Velocity of a minus that of b at the point.
Vec3 calc_relative_velocity(const std::vector<Mover>& movers, const Point& point);

Vec3 calc_relative_spin(const std::vector<Mover>& movers, const Point& point);
/// Applies an impulse, or a couple, to both bodies of a point.
void apply(std::vector<Mover>& movers, const Point& point, const Vec3& impulse);
void turn(std::vector<Mover>& movers, const Point& point, const Vec3& couple);

/// Scale of the couples at a point: couple per spin [kg m^2], as without joints. 0: no couple.
double calc_turning_mass(const std::vector<Mover>& movers, const Point& point);

/// Mobility at a point [1/kg]: change of u per impulse.
Mat3 calc_mobility(const std::vector<Mover>& movers, const Point& point);

}  // namespace carillon::rigid
