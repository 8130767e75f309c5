// An impact, integrated: contact springs, the rigid motion of all its bodies and all their modes.
//
// At a contact with the unit normal n (from b to a) the compression is y = gap closed by rigid motion less what the modes yield,
//     y = -n . (x_a + w_a - x_b - w_b),   w(c) = sum_i phi_i(c) q_i,   q_i'' + 2 d_i q_i' + w_i^2 q_i = phi_i(c) . F(c),
// and the spring gives F(y). A step of length h has a constant force, under which rigid and modal motion are exact; the force is the
// discrete gradient of the spring's energy (spring.hpp), found with the motion that it makes (solve.hpp). So the books close to rounding
// whatever h: motion + spring + modal + dissipated - work of the accelerations given = constant.
//
//     Impact impact(bodies, contacts);
//     while (!impact.advance(grid_time)) { ... }     // may be left and taken up again; the bits are those of one go
//     impact.get_bodies(), impact.get_books(), impact.take_pulses()
//
// [main-thread] all of it. Same input, same bits.
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

/// Velocity and spin (rows) per impulse and couple at the centre (columns) of a body on joints, world axes.
using Mobility = std::array<std::array<double, 6>, 6>;

/// A body at the instant of the first touch; world axes. A mallet is one without modes, a clamped plate one without mass.
struct Body {
  double mass_kg = 0.0;  // 0: does not move as a whole
  Mat3 inertia_kg_m2{};  // about the centre; zero: does not turn
  Vec3 centre_m{}, velocity_m_s{}, spin_rad_s{};
  Vec3 acceleration_m_s2{};         // gravity; constant, its work is booked
  Vec3 spin_acceleration_rad_s2{};  // -I^-1 (spin x I spin); the same
  const Modes* modes = nullptr;     // kept by the caller as long as the Impact lives
  std::vector<double> q, q_dot;     // modal state (n each) [m sqrt(kg)], [m sqrt(kg)/s]; empty: at rest
  Vec3 moved_m{}, turned_rad{};     // out: since the beginning or the last update() (the turn as a small vector)
  // On joints: the mobility stands for mass and inertia, and the work of the accelerations is the joints' affair. The books have the work
  // that the contacts do on it as `rigid`.
  bool on_joints = false;
  Mobility mobility{};
  Vec3 impulse_n_s{}, couple_n_m_s{};   // out: what the contacts gave it since the beginning or the last update(), and ...
  Vec3 shift_n_s2{}, turning_n_m_s2{};  // ... how far that moves it: its integral over time
  double work_j = 0.0;                  // out: that the contacts did on it meanwhile
};

/// A point where two of the bodies touch. Frame and mobilities are constant until update().
struct Contact {
  int a = 0, b = -1;                         // indices of the bodies; -1: what neither moves nor rings
  Vec3 where_m{}, normal{};                  // normal: unit, from b to a
  double gap_m = 0.0;                        // at the beginning; negative: compressed by that much
  double yielded_m = 0.0;                    // compression without a force at the beginning; recovers on parting
  Spring spring;                             // its hysteresis is set by `restitution`
  double restitution = 1.0;                  // of what the modes do not show: loss in the spring at the approach speed
  bool is_limit = false;                     // it limits the whole rebound, too: that of the rigid bodies, whatever modes throw back
  double friction = 0.0;                     // mu
  double tangential_ratio = 0.82;            // k_t over the secant of the normal spring at its peak: 2 (1 - nu)/(2 - nu) (Mindlin 1949)
  bool rests = false;                        // touched before the impact: it is over when the others have parted and this has settled
  std::span<const double> shape_a, shape_b;  // (n, 3) mode shapes there [1/sqrt(kg)], world axes; empty: does not ring there
};

struct Options {
  double steps_per_pulse = 20.0;  // of the shortest elastic pulse; see docs/decisions/impact.md for what it costs
  double longest_step_s = 1e-3;
  double settling_s = 3e-3;  // how long contacts that rest may take to settle after the others have parted
  double part_s = 0.0;       // it is over when there was no force for so long; 0: the length of the longest elastic pulse
  bool above_band = true;    // modes above the band of plate-like bodies (modes.hpp)
};

/// The force on body a of a contact, as impulses of equal steps; world axes.
struct Pulse {
  int contact = 0;
  double start_s = 0.0, step_s = 0.0;  // since the beginning of the impact
  std::vector<Vec3> impulse_n_s;       // one a step, from the first step with a force to the last
};

/// Energies [J]. start + given = rigid + spring + yielded + modal + dissipated + error.
struct Books {
  double start = 0.0;                // all of the motion, springs and modes at the beginning
  double given = 0.0;                // work of the bodies' accelerations
  double rigid = 0.0, spring = 0.0;  // now; spring: normal and tangential
  double yielded = 0.0;              // now: taken by compression without a force, until it has recovered
  double modal = 0.0;                // now, inside the band
  double dissipated_modes = 0.0;     // by the modes' own damping
  double dissipated_contact = 0.0;   // hysteresis
  double dissipated_friction = 0.0;
  double above_band = 0.0;    // gone into the modes above the band
  double calc_error() const;  // start + given - all the rest, over the largest of them
};

/// All bodies, contacts and modes of one impact, integrated with one step length, which never changes. At any time get_books() closes to
/// rounding: start + given = rigid + spring + yielded + modal + dissipated + above_band.
class Impact {
 public:
  /// Throws std::invalid_argument where indices, sizes, signs or values are wrong. Meant for up to 8 contacts; cost grows with the cube.
  Impact(std::vector<Body> bodies, const std::vector<Contact>& contacts, const Options& options = {});

  /// Continues until all have parted (true) or until the first step that ends at or after `until_s` since the beginning (false). What is
  /// pressed together by its accelerations never parts: give a time.
  bool advance(double until_s);

  /// One more body from now on (its index), or one more contact (`gap_m` is that of now); the step stays what it is.
  int join(const Body& body);
  void join(const Contact& contact);
  /// Updates the same bodies and contacts: centres, inertias and accelerations of `bodies`, velocities of bodies on joints; places, normals
  /// and shape values of `contacts`, gaps of open ones, springs. Everything else is ignored. Compressions, anchors, modal states and the
  /// step stay; moved_m and turned_rad begin again. A new spring takes the energy of the old one; the rest of the compression has yielded.
  /// The energy change of an unchanged spin by a turned inertia is booked as given. Throws as the constructor does.
  void update(std::span<const Body> bodies, std::span<const Contact> contacts);

  /// Changes the motion of a body at once, as other contacts do; what that does to the energy is booked as given. Throws where it is not
  /// finite.
  void push(int body, const Vec3& velocity_m_s, const Vec3& spin_rad_s);

  bool has_ended() const { return ended_; }
  double get_time() const { return static_cast<double>(steps_) * h_; }
  double get_step_length() const { return h_; }
  int get_steps() const { return steps_; }
  /// Steps that went without friction, since forces with it were not found (solve.hpp). 0 in every test.
  int get_misses() const { return misses_; }
  /// Last step's force on a [N], world axes; compression [m].
  Vec3 get_force(int contact) const;
  double get_compression(int contact) const { return laws_[contact].compression_m; }
  const Contact& get_contact(int contact) const { return contacts_[contact].given; }  // without its shapes
  /// Depth of the rigid surfaces in each other that the spring and the modes of both bodies explain [m].
  double calc_depth(int contact) const;
  double get_impulse(int contact) const { return contacts_[contact].impulse_n_s; }  // normal, since the beginning [N s]
  /// Rigid approach speed of a contact [m/s], > 0 closing.
  double calc_approach(int contact) const;

  /// The bodies with their states of now.
  std::vector<Body> get_bodies() const;
  Books get_books() const;
  /// The samples since the last call; a pulse that continues comes in pieces.
  std::vector<Pulse> take_pulses();

 private:
  /// A row of the step's unknowns: relative motion along `axis` at a contact.
  struct Row {
    int contact = 0;
    Vec3 axis{};
    std::array<int, 2> body{-1, -1};
    std::array<Vec3, 2> linear{}, angular{};       // relative motion of the row by the motion of the body
    std::array<Vec3, 2> to_velocity{}, to_spin{};  // and the accelerations of the body by its force
  };

  /// A contact since its beginning.
  struct History {
    Contact given;             // without its shapes
    double pressed_s = 0.0;    // how long it has been pressed
    double closing_m_s = 0.0;  // the largest speed of approach
    double impulse_n_s = 0.0;  // normal
    bool is_limited = false;   // do modes push against a limit?
    Pulse pulse;
    double yielded_m = 0.0;  // compression without a force, by the limit of the rebound,
    double yielded_j = 0.0;  // and the energy that the limit took
    bool is_open = false;    // not closed yet at its present place
    int silent = 0;          // steps without a force that the pulse does not have yet
  };

  void check_contact(const Contact& contact) const;
  static void check_body(const Body& body);
  void place_body(Body body);
  void add_contact(const Contact& contact);
  void place_contact(const Contact& contact, int index, int row);
  void choose_step(const Options& options);
  ElasticPulse set_law(int contact, double inverse_mass, double speed_m_s);
  void close_contacts();
  void exchange_spring(int contact, const Spring& spring);
  void set_up_step();
  void step();
  double calc_row_speed(const Row& row) const;
  void solve_forces();
  bool limit_forces();
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
  int step_index_ = 0, steps_ = 0, quiet_ = 0, misses_ = 0;
  double hysteresis_of_ = -1.0, hysteresis_ = 0.0;  // the last restitution, and its hysteresis at 1 m/s: contacts often have the same
  double h_ = 0.0, part_s_ = 0.0, settling_s_ = 0.0, fastest_ = 0.0;
  double on_joints_j_ = 0.0;  // work done on bodies on joints
  Books books_;
};

}  // namespace carillon::impact
