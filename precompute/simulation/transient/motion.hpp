// Motion of bodies: explicit steps of a Domain's nodes under elastic forces, damping, gravity, impulses, supports and external forces.
//
//   Motion motion(domain, options, constraints, impulses);
//   motion.set_start([](std::int32_t node, const Vec3& rest_m) { return Motion::Start{}; });
//   while (motion.get_time_s() < 1.0) {
//     motion.advance();
//     if (motion.is_at_sample()) record(motion.get_u(), motion.get_v());
//   }
//   const EnergyBook book = motion.calc_book();
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "precompute/simulation/transient/domain.hpp"
#include "precompute/simulation/transient/path.hpp"
#include "precompute/simulation/transient/rigid_motion.hpp"
#include "precompute/simulation/transient/stable_step.hpp"

namespace carillon::transient {

struct MotionOptions {
  double sample_rate_hz = 48000.0;  // an integer number of steps per sample
  double longest_step_s = std::numeric_limits<double>::infinity();
  Vec3 gravity_m_s2{};
  double settle_s = 0.0;       // duration of gravity's ramp from 0, with continuous second derivative
  double step_check_s = 1e-3;  // of simulated time: interval between stable-step computations
  int inversion_check_steps = 100;
  std::function<int(int)> round_steps;  // steps per sample, at least the given number; empty: identity
};

/// Nodes with prescribed displacement: fixed (Dirichlet) at their initial position (set_start()), or driven along a path from there.
struct Constraint {
  std::vector<std::int32_t> nodes;                             // assembly numbers
  Path path;                                                   // empty: fixed
  bool is_hinge = false;                                       // collinear nodes: the body swings about them, exempt from mass damping
  double release_s = std::numeric_limits<double>::infinity();  // time of release
};

/// J (1 - cos(2 pi (t - t0) / T)) / T for t0 <= t <= t0 + T, shared among nodes (find_shares()).
struct Impulse {
  double time_s = 0.0, duration_s = 0.0;
  Vec3 impulse_n_s{};
  std::vector<NodeShare> shares;
};

/// Time of a force evaluation, and duration of its effect.
struct StepTime {
  std::int64_t step = 0;
  double time_s = 0.0;
  double act_s = 0.0;         // duration by which the forces change m v
  double act_before_s = 0.0;  // the same for the previous step, 0 at the first
  double step_s = 0.0;        // of the subsequent displacements
  double step_before_s = 0.0;
};

/// External forces on nodes: contact, strikers, friction. The energy book includes their nodal work automatically (EnergyBook::work_j);
/// their own energies are the counterpart: stored + dissipated - put in = - work on the nodes.
class ExternalForces {
 public:
  virtual ~ExternalForces() = default;
  /// f += forces [N] on own nodes at time_s. u [m] is at time_s, v [m/s] half a step earlier; both have Domain::node_count() entries with a
  /// valid halo. Called once per step, in order, on all ranks, so it may be collective. The previous step's work can be accumulated here:
  /// act_before_s f (v before + v) / 2. Nodal forces must not depend on the number of ranks. Throws on all ranks alike or not at all.
  virtual void add_forces(const StepTime& time, const Quad* u, const Quad* v, Quad* f) = 0;
  /// Longest step [s] allowed by its stiffness in addition to that of a body with the given highest frequency (bodies) [rad/s]. Collective.
  virtual double calc_longest_step_s(const std::vector<double>& omega_rad_s) const {
    static_cast<void>(omega_rad_s);
    return std::numeric_limits<double>::infinity();
  }
  struct Energy {
    double stored_j = 0.0;      // contact springs, striker motion
    double dissipated_j = 0.0;  // friction, contact damping
    double put_in_j = 0.0;      // by moving it from outside
  };
  /// Over all ranks, the same on each. Collective.
  virtual Energy calc_energy() = 0;
};

/// kinetic + elastic + dissipated - work = const. At time_s, over all ranks, bit-identical on any number of ranks.
struct EnergyBook {
  double time_s = 0.0;
  std::int64_t step = 0;
  double kinetic_j = 0.0;  // sum of m v_{n-1/2} v_{n+1/2} / 2, conserved by the steps
  double elastic_j = 0.0;
  double dissipated_j = 0.0;    // by strain rate and mass damping
  double work_j = 0.0;          // of moving supports, impulses, gravity, external forces
  double error_j = 0.0;         // kinetic + elastic + dissipated - work, minus the initial value
  double relative_error = 0.0;  // over the largest kinetic + elastic + dissipated of all books so far
};

/// Leapfrog: v_{n+1/2} = v_{n-1/2} + h f_n / m, u_{n+1} = u_n + h v_{n+1/2}. Between calls u and f are at get_time_s(), v half a step
/// earlier, and halo values are current. The step divides a sample. Bit-identical on any number of ranks. All methods are collective except
/// get_ and is_.
///
/// Step: initially 0.9 of the longest stable one, from 50 power iterations at the initial shape. Every step_check_s the stable step is
/// recomputed (20 more iterations); if the step exceeds 0.95 of it, it is reduced to at most 0.8 of it from that output sample on. More
/// than 8 times the initial steps per sample: SolveError with time and step. Inverted elements (det F <= 0) or non-finite values end the
/// run with SolveError naming element, time and step.
class Motion {
 public:
  struct Start {
    Vec3 displacement_m{}, velocity_m_s{};
    double angle_rad = 0.0;  // for a sheet edge, instead of both
  };

  /// Bodies are at rest in their rest shape. Domain must outlive this; one Motion per Domain. Throws on every rank: InputError for a node
  /// that is constrained twice or does not exist, and for invalid impulses or options.
  Motion(Domain& domain, const MotionOptions& options, std::vector<Constraint> constraints = {}, std::vector<Impulse> impulses = {});
  Motion(const Motion&) = delete;
  Motion& operator=(const Motion&) = delete;

  /// Adds external forces, before the first step. They must outlive this.
  void add(ExternalForces& forces);
  /// Initial displacement and velocity of an assembly node by its rest position, the same on every rank; constrained nodes do not move.
  /// Before the first step.
  void set_start(const std::function<Start(std::int32_t node, const Vec3& rest_m)>& find_start);

  /// Computes the step if necessary, and returns get_steps_per_sample(). Throws on every rank alike.
  int prepare() {
    begin_if_new();
    return parts_;
  }
  /// One step. Throws on every rank alike.
  void advance();
  /// Advances to the next output sample.
  void advance_sample();

  double get_time_s() const { return (static_cast<double>(sample_) + static_cast<double>(part_) / parts_) / options_.sample_rate_hz; }
  bool is_at_sample() const { return part_ == 0; }
  std::int64_t get_sample() const { return sample_; }
  std::int64_t get_step_count() const { return step_; }
  double get_step_s() const { return step_s_; }
  int get_steps_per_sample() const { return parts_; }
  /// Per body at the last check [rad/s], and the longest stable step of all [s].
  const std::vector<double>& get_omega_rad_s() const { return omega_; }
  double get_longest_step_s() const { return longest_s_; }

  const std::vector<Quad>& get_u() const { return u_; }  // (Domain::node_count) [m] at get_time_s()
  const std::vector<Quad>& get_v() const { return v_; }  // (Domain::node_count) [m/s] half a step earlier
  const std::vector<Quad>& get_f() const { return f_; }  // (at least own_count) [N] elastic and viscous, at get_time_s()
  /// Total reaction [N] of a constraint's nodes on the body. Collective.
  Vec3 calc_reaction(std::size_t constraint);

  EnergyBook calc_book();
  /// Momentum [kg m/s] and angular momentum about the origin [kg m^2/s] half a step before get_time_s(), over all ranks.
  struct Momentum {
    Vec3 linear{}, angular{};
  };
  Momentum calc_momentum();

  /// Complete state as bytes on rank 0, empty elsewhere, independent of the number of ranks. Without state of external forces.
  std::vector<std::byte> save();
  /// Continues from there, bit-identical to an uninterrupted run. Uses `bytes` of rank 0. Throws InputError on every rank for truncated
  /// data or other bodies.
  void load(std::span<const std::byte> bytes);

 private:
  void check_input(const std::vector<Constraint>& constraints, const std::vector<Impulse>& impulses) const;
  void find_step(int iterations, bool is_start);
  void check_inversion();
  void calc_forces(bool halo_is_there);
  void move_halo();
  void set_external_forces();
  /// All hinges, with node positions `find_place(number)`.
  void find_hinges(const std::function<Vec3(std::int32_t)>& find_place);
  void update_carried();
  /// Releases constraints at their release_s.
  void release();
  void find_carried();
  double find_next_time_s() const;
  void begin();
  void begin_if_new() {
    if (!begun_) begin();
  }

  struct ConstrainedNode {
    std::int32_t place;
    std::int32_t constraint;
  };
  struct OwnShare {
    std::int32_t place;
    std::int32_t impulse;
    double share;
  };

  Domain& domain_;
  MotionOptions options_;
  std::vector<Constraint> constraints_;
  std::vector<Impulse> impulses_;
  std::vector<ExternalForces*> outside_;
  std::vector<ConstrainedNode> constrained_nodes_;
  std::vector<OwnShare> shares_;
  std::vector<char> is_constrained_;           // (own)
  std::vector<char> is_constrained_for_ever_;  // (own)
  double next_release_s_ = std::numeric_limits<double>::infinity();
  std::vector<double> inverse_kg_, braked_kg_s_;  // (own)
  std::vector<char> is_carried_;                  // (bodies) mass damping exempts rigid motion
  std::vector<Hinge> hinges_;                     // (bodies)
  bool is_braked_ = false, has_carried_ = false, has_external_ = false, begun_ = false;
  std::vector<Quad> u_, v_, f_, external_, work_, brake_loss_, carried_;
  std::vector<Quad> home_, reaction_;  // (own) constrained nodes: initial displacement, reaction force
  HighestFrequency highest_;
  std::vector<double> omega_;
  double longest_s_ = 0.0;

  std::int64_t sample_ = 0, step_ = 0;
  int part_ = 0, parts_ = 1, first_parts_ = 1;
  double step_s_ = 0.0, step_before_s_ = 0.0, act_s_ = 0.0, act_before_s_ = 0.0;
  double dissipated_j_ = 0.0, braked_j_ = 0.0, work_j_ = 0.0;  // up to the last book
  double start_j_ = 0.0, most_j_ = 0.0;
};

}  // namespace carillon::transient
