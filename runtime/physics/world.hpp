// Rigid-body world: moving bodies and static ones such as shelves; produces their contact events.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/physics/events.hpp"
#include "runtime/physics/joints/mechanism.hpp"

namespace carillon::physics {

/// One body. Surface, rigid-body data and material come from its bank; `initial` is the pose of the bank's mesh frame.
struct BodySpec {
  std::string name;                  // for messages
  const bank::Bank* bank = nullptr;  // not owned; must outlive the world
  bool fixed = false;                // a shelf: does not move, but is struck and sounds
  Pose initial;                      // time_s is ignored; the quaternion is normalised
  Vec3 velocity_m_s{};               // of the centre of mass, world frame
  Vec3 angular_velocity_rad_s{};     // world frame
  double restitution = 0.5;          // 0..1; a contact uses the geometric mean of both bodies
  double friction = 0.4;             // Coulomb, >= 0; a contact uses the geometric mean of both bodies
  double rolling_resistance = 1e-3;  // couple over radius times load, >= 0; a contact uses the larger one of both bodies
  double roughness_m = 2e-6;         // rms height of the surface; used by the contact player only
  bool absent = false;               // not in the world until World::add()
};

/// Floor: the half space z <= height_m. It is rigid ground without sound. Its `body` index in impulses is -1.
struct GroundSpec {
  double height_m = 0.0;
  double young_modulus_pa = 30e9;  // concrete
  double poisson_ratio = 0.2;
  double restitution = 0.5;
  double friction = 0.5;
  double rolling_resistance = 1e-3;
  double density_kg_m3 = 2400.0;
  double roughness_m = 20e-6;  // as above; smooth trowelled concrete
};

// Largest values of bodies in scenes and of bodies moved from outside; beyond them steps become too many, and motions not finite.
inline constexpr double kFarthestM = 1e4;     // of positions; half a minute at the speed of sound
inline constexpr double kMaxSpeedMS = 300.0;  // below the speed of sound in air
inline constexpr double kMaxSpinRadS = 1e4;

/// Limit of hinge stops, from the start: beyond 180 degrees the angle wraps around.
inline constexpr double kWidestHingeDeg = 175.0;

/// Connects a body to another one, or to the world. Positions and axes are in world coordinates, in the start poses. Two bodies connected
/// by a joint do not collide.
struct JointSpec {
  joints::Kind kind = joints::Kind::kHinge;
  int body = 0, to = -1;  // in the list of bodies; -1, or a fixed one: the world
  Vec3 at_m{};
  Vec3 axis{};                                    // of a hinge or slider; the first of a universal joint, fixed in `to`
  Vec3 second_axis{};                             // of a universal joint, perpendicular to the first, fixed in `body`
  double damping = 0.0;                           // N m s per rad, slider: N s/m; >= 0
  std::optional<std::array<double, 2>> limits{};  // hinge [rad], slider [m]: range of `body` relative to `to`; <= 0, >= 0
  double stop_restitution = 0.0;                  // of the stops, 0..1
  std::string place{};                            // source location for messages; may be empty
};

/// Massless inextensible cord. Its ends are world positions at the start.
struct CordSpec {
  int body = 0, to = -1;  // -1: the world
  Vec3 from_m{}, to_m{};
  std::optional<double> length_m{};  // nullopt: taut at the start
  double restitution = 0.0;          // when becoming taut, 0..1
  std::string place{};               // source location for messages; may be empty
};

struct WorldSpec {
  std::vector<BodySpec> bodies;
  std::optional<GroundSpec> ground;
  Vec3 gravity_m_s2{0.0, 0.0, -9.81};
  std::vector<JointSpec> joints;  // without loops
  std::vector<CordSpec> cords;
};

/// A damped spring that holds a body, as a hand would.
struct GrabSpec {
  double frequency_hz = 4.0;   // of the body's mass on the spring; 0.1 to 100
  double damping_ratio = 1.0;  // 1: critical; 0 to 10
  double max_force_n = 0.0;    // 0: 30 times the mass times 9.81 m/s^2
};

/// Where, and how fast, a body enters the world.
struct Entry {
  Pose pose;                      // of the mesh frame; time_s is ignored, the quaternion is normalised
  Vec3 velocity_m_s{};            // of the centre of mass, world frame
  Vec3 angular_velocity_rad_s{};  // world frame
};

/// World of bodies, ground, joints and cords, and its time. Invariant: all events up to the time returned by advance() have been passed to
/// its sink, and none depends on how the calls divide time. Bodies that cannot touch each other at present are integrated separately, each
/// group with its own steps (docs/decisions/contact.md). [main-thread]: allocates and throws.
class World {
 public:
  /// Copies the spec; its banks must outlive the world. Throws InputError for an invalid spec (the message names the body: missing bank,
  /// invalid number, open or non-manifold surface, bodies that overlap at the start, loops of joints).
  explicit World(const WorldSpec& spec, const WorldOptions& options = {});
  ~World();
  World(World&&) noexcept;
  World& operator=(World&&) noexcept;

  /// Continues until at least `until_s` [s], or until `cpu_s` seconds of CPU are spent, checked after every step; at least one step is
  /// made. Returns the time reached: on a grid of 2 ms, or the end of the world. Events are passed to `sink` per grid interval, in time
  /// order and ended by a Mark: all poses at 0; the impulses; contacts that have lasted for 5 ms, each at most every 1 ms and not while its
  /// bodies are at rest; poses of moving bodies every 2 ms, and immediately before and after every impact (two with one time); at the end
  /// all poses again. A pulse may be centred up to half its duration beyond the Mark that follows it. The same spec gives the same bits for
  /// any division into calls. Throws SolveError if the integration fails.
  using Sink = std::function<void(const events::Event&)>;
  double advance(double until_s, double cpu_s, const Sink& sink);

  // Between two calls of advance(), at the time that it returned; a window that it left unfinished is completed first. The same calls at
  // the same times give the same bits. Bodies that sleep wake. Energy from outside is EnergyAudit::given_j; a hand makes no sound. Throw
  // InputError, and change nothing, for numbers out of range, a body that is absent or does not move, or one that would overlap another.
  /// Gives a moving body an impulse [N s] at a world point.
  void push(int body, const Vec3& at_m, const Vec3& impulse_n_s);
  /// Holds a moving body at the point of it that is now at `at_m`, with a target at the same place; replaces an earlier grab of the body.
  void grab(int body, const Vec3& at_m, const GrabSpec& spec = {});
  /// Moves the target of a grab evenly to `target_m` within `over_s` seconds, 1e-3 to 1e3.
  void drag(int body, const Vec3& target_m, double over_s = 0.02);
  /// Ends a grab; the body keeps its velocity. Nothing happens if there is none.
  void release(int body);
  /// False: from now on impacts are rigid, and modes only reduce their restitution. For hosts that fall behind real time.
  void allow_modal_impacts(bool may_begin);
  /// Puts an absent body into the world.
  void add(int body, const Entry& entry);
  /// Puts a new body, without joints and cords, into the world, as one of the spec: the same checks and messages. Its bank must outlive the
  /// world; bodies of one bank share what is prepared from it. Returns its number, the next one.
  int add(const BodySpec& body);
  /// Takes a body, moving or fixed, without joints and cords, out of the world. It stays in the list, and rings on.
  void remove(int body);

  Statistics get_statistics() const;
  /// Current pose of a body's mesh frame.
  Pose get_pose(int body) const;
  /// Current centre of mass in the world [m].
  Vec3 get_centre(int body) const;
  bool is_absent(int body) const;

 private:
  class Course;
  std::unique_ptr<Course> course_;
};

/// Questions about suspicious joints and cords, far from their bodies. One line each.
std::vector<std::string> ask_about_links(const WorldSpec& spec);

/// Pose of the mesh frame of a body with its centre of mass at `centre_m` in that frame: x - R(q) c.
Pose calc_pose(const events::BodyMotion& motion, const Vec3& centre_m);

/// Reassembles the event stream of a world. `centres_m[i]`: centre of mass of body i in its mesh frame; one per body. Events of other
/// bodies are ignored.
Simulation collect(const std::vector<events::Event>& events, const std::vector<Vec3>& centres_m);

/// Runs the world from 0 to `duration_s` and returns every contact pulse and the path of every body. Deterministic: the same spec gives the
/// same bits. `progress` (may be empty) is called occasionally with the finished fraction, 0..1. Throws like World.
Simulation simulate(const WorldSpec& spec, double duration_s, const std::function<void(double fraction)>& progress = {});

}  // namespace carillon::physics
