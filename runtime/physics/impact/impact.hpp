// Integration of an impact: contact springs, rigid motion of all bodies and all their modes.
//
// At a contact with the unit normal n (from b to a) the compression y is the gap closed by rigid motion minus the modal displacement,
//     y = -n . (x_a + w_a - x_b - w_b),   w(c) = sum_i phi_i(c) q_i,   q_i'' + 2 d_i q_i' + w_i^2 q_i = phi_i(c) . F(c),
// and the spring gives F(y). Within a step of length h the force is constant, and rigid and modal motion under it are exact. The force is
// the discrete gradient of the spring's energy (spring.hpp), solved together with the motion (solve.hpp). The energy balance therefore
// closes to rounding for any h: motion + spring + modal + dissipated - work of the given accelerations = constant.
//
//     Impact impact(bodies, contacts);
//     while (!impact.advance(grid_time)) { ... }     // may be interrupted; results are those of a single call, bit for bit
//     impact.get_bodies(), impact.get_books(), impact.take_pulses()
//
// [main-thread] Deterministic: same input, same bits.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/physics/impact/modal_groups.hpp"
#include "runtime/physics/impact/modes.hpp"
#include "runtime/physics/impact/solve.hpp"
#include "runtime/physics/impact/spring.hpp"

namespace carillon::impact {

/// Linear and angular velocity (rows) per linear and angular impulse at the centre (columns) of a body on joints, world axes.
using Mobility = std::array<std::array<double, 6>, 6>;

/// A body at the instant of the first touch; world axes. A mallet has no modes, a clamped plate no mass.
struct Body {
  double mass_kg = 0.0;  // 0: fixed
  Mat3 inertia_kg_m2{};  // about the centre; zero: no rotation
  Vec3 centre_m{}, velocity_m_s{}, spin_rad_s{};
  Vec3 acceleration_m_s2{};         // gravity; constant, its work is booked
  Vec3 spin_acceleration_rad_s2{};  // -I^-1 (spin x I spin); constant, booked
  const Modes* modes = nullptr;     // must outlive the Impact
  std::vector<double> q, q_dot;     // modal state (n each) [m sqrt(kg)], [m sqrt(kg)/s]; empty: at rest
  Vec3 moved_m{}, turned_rad{};     // out: since the start or the last update() (rotation as a small vector)
  // On joints: the mobility replaces mass and inertia, and the work of the accelerations is accounted for by the joints. The books hold the
  // work of the contacts on it as `rigid`.
  bool on_joints = false;
  Mobility mobility{};
  Vec3 impulse_n_s{}, couple_n_m_s{};   // out: from the contacts since the start or the last update(),
  Vec3 shift_n_s2{}, turning_n_m_s2{};  // and their integrals over time (displacement)
  double work_j = 0.0;                  // out: work of the contacts since then
};

/// A contact point of two of the bodies. Frame and mobilities are constant until update().
struct Contact {
  int a = 0, b = -1;               // indices of the bodies; -1: rigid static body
  Vec3 where_m{}, normal{};        // normal: unit, from b to a
  double gap_m = 0.0;              // at the start; negative: compression
  double yielded_m = 0.0;          // compression without force at the start; recovers on separation
  Spring spring;                   // hysteresis is set from `restitution`
  double restitution = 1.0;        // losses other than modal ones: loss in the spring at the approach speed
  bool is_limit = false;           // also limits the whole rebound of the rigid bodies, including energy returned by modes
  double friction = 0.0;           // mu
  double tangential_ratio = 0.82;  // k_t over the secant stiffness of the normal spring at its peak: 2 (1 - nu)/(2 - nu) (Mindlin 1949)
  bool rests = false;              // touched before the impact: over when the others have separated and this one has settled
  std::span<const double> shape_a, shape_b;  // (n, 3) mode shapes at the contact [1/sqrt(kg)], world axes; empty: no modes there
};

struct Options {
  double steps_per_pulse = 20.0;  // steps per shortest elastic pulse; cost: docs/decisions/impact.md
  double longest_step_s = 1e-3;
  double settling_s = 3e-3;     // maximum settling time of resting contacts after the others have separated
  double part_s = 0.0;          // time without force that ends the impact; 0: the length of the longest elastic pulse
  bool above_band = true;       // modes above the band of plate-like bodies (modes.hpp)
  double max_yielded_m = 6e-5;  // compression without force by a limit of the rebound; infinite: bodies and modes get the same force
};

/// Force on the surface of body a at a contact, as impulses of equal steps; world axes. Rigid bodies may get less while their rebound is
/// limited.
struct Pulse {
  int contact = 0;
  double start_s = 0.0, step_s = 0.0;  // since the start of the impact
  std::vector<Vec3> impulse_n_s;       // one per step, from the first to the last step with a force
};

/// Energies [J]. start + given = rigid + spring + yielded + modal + dissipated + error.
struct Books {
  double start = 0.0;                // motion, springs and modes at the start
  double given = 0.0;                // work of the bodies' accelerations
  double rigid = 0.0, spring = 0.0;  // current; spring: normal and tangential
  double yielded = 0.0;              // current: taken by limits of the rebound, until their contacts open
  double modal = 0.0;                // current, inside the band
  double dissipated_modes = 0.0;     // by modal damping
  double dissipated_contact = 0.0;   // hysteresis
  double dissipated_friction = 0.0;
  double above_band = 0.0;    // transferred to modes above the band
  double calc_error() const;  // start + given - all other terms, relative to the largest of them
};

/// All bodies, contacts and modes of one impact, integrated with a constant step length. get_books() closes to rounding at any time: start
/// + given = rigid + spring + yielded + modal + dissipated + above_band.
class Impact {
 public:
  /// Throws std::invalid_argument for invalid indices, sizes, signs or values. Intended for up to 8 contacts; cost is cubic in their
  /// number.
  Impact(std::vector<Body> bodies, const std::vector<Contact>& contacts, const Options& options = {});

  /// Continues until all contacts have separated (true) or until the first step that ends at or after `until_s` since the start (false).
  /// Bodies pressed together by their accelerations never separate: pass a time limit.
  bool advance(double until_s);

  /// Adds a body (returns its index) or a contact (`gap_m`: current gap); the step length is unchanged.
  int join(const Body& body);
  void join(const Contact& contact);
  /// Updates the same bodies and contacts: centres, inertias and accelerations of `bodies`, velocities of bodies on joints; positions,
  /// normals and shape values of `contacts`, gaps of open ones, springs. Everything else is ignored. Compressions, anchors, modal states
  /// and the step length stay; moved_m and turned_rad are reset. A new spring takes over the energy of the old one; the remaining
  /// compression becomes yielded. The energy change of an unchanged spin with a rotated inertia is booked as given. Throws like the
  /// constructor.
  void update(std::span<const Body> bodies, std::span<const Contact> contacts);

  /// Replaces the spring of a contact, but for its hysteresis. Energies of spring and anchor stay; the compression that is left becomes
  /// yielded. A compressed contact keeps its spring if the new one is softer. Throws like the constructor.
  void exchange_spring(int contact, const Spring& spring);

  /// Changes the velocity of a body instantaneously, as other contacts do; the energy change is booked as given. Throws for non-finite
  /// values.
  void push(int body, const Vec3& velocity_m_s, const Vec3& spin_rad_s);

  bool has_ended() const { return ended_; }
  double get_time() const { return static_cast<double>(steps_) * h_; }
  double get_step_length() const { return h_; }
  int get_steps() const { return steps_; }
  /// Steps solved without friction because no frictional solution was found (solve.hpp). 0 in all tests.
  int get_misses() const { return misses_; }
  double get_compression(int contact) const { return laws_[contact].compression_m; }  // [m]
  const Contact& get_contact(int contact) const { return contacts_[contact].given; }  // without its shapes
  /// Rigid penetration explained by the compression of the spring and the displacement of the modes of both bodies [m].
  double calc_depth(int contact) const;
  double get_impulse(int contact) const { return contacts_[contact].impulse_n_s; }  // normal, since the start [N s]
  /// Rigid approach speed of a contact [m/s], > 0 closing.
  double calc_approach(int contact) const;

  /// Bodies in their current states.
  std::vector<Body> get_bodies() const;
  Books get_books() const;
  /// Samples since the last call; a pulse that continues is delivered in pieces.
  std::vector<Pulse> take_pulses();

 private:
  /// One unknown of the step: relative motion along `axis` at a contact.
  struct Row {
    int contact = 0;
    Vec3 axis{};
    std::array<int, 2> body{-1, -1};
    std::array<Vec3, 2> linear{}, angular{};       // relative motion of the row per motion of the body
    std::array<Vec3, 2> to_velocity{}, to_spin{};  // accelerations of the body per force of the row
  };

  /// State of a contact since its start.
  struct History {
    Contact given;             // without its shapes
    double pressed_s = 0.0;    // duration of the present compression
    double closing_m_s = 0.0;  // maximum approach speed
    double impulse_n_s = 0.0;  // normal
    bool is_limited = false;   // modes push against a limit
    Pulse pulse;
    double braked_n = 0.0;   // part of the force of this step kept from the rigid bodies by the limit of the rebound
    double yielded_j = 0.0;  // energy taken by the limit since the contact closed
    double yielded_m = 0.0;  // compression without force, by the limit, or left by an earlier impact or a softer spring
    bool is_open = false;    // not closed yet at its present position
    int silent = 0;          // steps without force after the last sample of the pulse
  };

  void check_contact(const Contact& contact) const;
  static void check_body(const Body& body);
  static void check_spring(const Spring& spring);
  void place_body(Body body);
  void add_contact(const Contact& contact);
  void place_contact(const Contact& contact, int index, int row);
  void choose_step(const Options& options);
  ElasticPulse set_law(int contact, double inverse_mass, double speed_m_s);
  void close_contacts();
  void set_up_step();
  void step();
  void calc_free_motion();
  void calc_motion();
  void compress(std::size_t contact);
  void slide(ContactLaw& law, Vec3& impulse);
  void record(History& contact, const Vec3& impulse);
  void move_body(std::size_t body);
  double calc_row_speed(const Row& row) const;
  void solve_forces();
  double calc_parting(int row) const;
  double calc_rigid_share(const History& contact) const;
  bool limit_forces(bool is_last);
  bool is_over() const;
  double calc_rigid_energy() const;
  double calc_spring_energies() const;

  std::vector<Body> bodies_;
  std::vector<Mat3> inverse_inertia_;
  std::vector<History> contacts_;
  std::vector<ContactLaw> laws_;  // of the contacts
  std::vector<Row> rows_;
  ModalGroups modes_;
  std::vector<double> A_, free_, force_, moved_;
  std::vector<double> mobility_;  // (rows, rows), of the rigid bodies: relative velocity per impulse
  StepSolver solver_;
  bool above_band_ = true, ended_ = false;
  double max_yielded_m_ = 0.0;
  int step_index_ = 0, steps_ = 0, quiet_ = 0, misses_ = 0;
  double hysteresis_of_ = -1.0, hysteresis_ = 0.0;  // cache: last restitution and its hysteresis at 1 m/s
  double h_ = 0.0, part_s_ = 0.0, settling_s_ = 0.0, fastest_ = 0.0;
  double on_joints_j_ = 0.0;  // work done on bodies on joints
  Books books_;
};

}  // namespace carillon::impact
