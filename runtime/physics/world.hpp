// The rigid-body world: bodies that fall and shelves that stand, out of which comes what they do to each other.
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

/// One body. Its surface, rigid-body data and material come from its bank; `initial` places the frame of the bank's mesh in the world.
struct BodySpec {
  std::string name;                  // for messages
  const bank::Bank* bank = nullptr;  // not owned; must outlive the world
  bool fixed = false;                // a shelf: does not move, yet is struck and sounds
  Pose initial;                      // time_s is not used; the quaternion is normalised here
  Vec3 velocity_m_s{};               // of the centre of mass, in the world
  Vec3 angular_velocity_rad_s{};     // in the world
  double restitution = 0.5;          // 0..1; a contact of two bodies takes the geometric mean of theirs
  double friction = 0.4;             // Coulomb, >= 0; a contact of two bodies takes the geometric mean of theirs
  double roughness_m = 2e-6;         // rms height of the surface; for the player of the contacts; the world does not use it
};

/// The floor: the half space z <= height_m. It is hard ground and makes no sound of its own. Its `body` index in impulses is -1.
struct GroundSpec {
  double height_m = 0.0;
  double young_modulus_pa = 30e9;  // concrete
  double poisson_ratio = 0.2;
  double restitution = 0.5;
  double friction = 0.5;
  double density_kg_m3 = 2400.0;
  double roughness_m = 20e-6;  // likewise; concrete, smoothly trowelled
};

/// Of a hinge with limits, from the start: past 180 degrees the angle wraps round to the other side.
inline constexpr double kWidestHingeDeg = 175.0;

/// Joins a body to another one, or to the world. Places and axes are in the world, as all bodies are placed at the start. Two bodies with a
/// joint between them do not collide.
struct JointSpec {
  joints::Kind kind = joints::Kind::kHinge;
  int body = 0, to = -1;  // in the list of bodies; -1, or a fixed one: the world
  Vec3 at_m{};
  Vec3 axis{};                                    // of a hinge, a slider; the first of a universal joint, fixed in `to`
  Vec3 second_axis{};                             // of a universal joint, at right angles to the first, fixed in `body`
  double damping = 0.0;                           // N m s per rad, of a slider N s/m; >= 0
  std::optional<std::array<double, 2>> limits{};  // of a hinge [rad], a slider [m]: how far `body` may go against `to`; <= 0, >= 0
  double stop_restitution = 0.0;                  // there, 0..1
  std::string place{};                            // where it comes from, for messages; may be empty
};

/// A string without mass that does not stretch. Its ends are places in the world at the start.
struct CordSpec {
  int body = 0, to = -1;  // -1: the world
  Vec3 from_m{}, to_m{};
  std::optional<double> length_m{};  // nothing: taut at the start
  double restitution = 0.0;          // when it comes taut, 0..1
  std::string place{};               // where it comes from, for messages; may be empty
};

struct WorldSpec {
  std::vector<BodySpec> bodies;
  std::optional<GroundSpec> ground;
  Vec3 gravity_m_s2{0.0, 0.0, -9.81};
  std::vector<JointSpec> joints;  // they make no loop
  std::vector<CordSpec> cords;
};

/// A world of bodies, ground, joints and cords, and its time. Invariant: all events up to the time that advance() returned have been passed
/// to its sink, and none depends on how the calls divide time. Bodies that cannot touch each other for the moment are integrated apart,
/// each group with its own steps (docs/decisions/contact.md). All of it [main-thread]: it allocates and throws.
class World {
 public:
  /// Copies the spec; its banks must outlive the world. Throws InputError for a spec that cannot be simulated (the message names the body:
  /// missing bank, bad number, a surface that is open or not a manifold, bodies that start inside each other, joints
  /// that make a loop).
  explicit World(const WorldSpec& spec, const WorldOptions& options = {});
  ~World();
  World(World&&) noexcept;
  World& operator=(World&&) noexcept;

  /// Continues until at least `until_s` [s], or until `cpu_s` seconds of CPU are spent, which is looked at after every step; at least one
  /// step is made. Returns the time reached: it lies on a grid of 2 ms, or is the end of the world. Events come to `sink` grid interval by
  /// grid interval, each in order of time and ended by a Mark: where all bodies are at 0; the impulses; the contacts that have lasted for
  /// 5 ms, each at most every 1 ms and not while its bodies lie still; where the moving bodies are at every 2 ms, and right before and
  /// right after every impact (two with one time); at the end, all again. A pulse may be centred up to half its duration beyond the Mark
  /// that follows it. The same spec gives the same bits, in whatever slices of time and CPU it is asked for. Throws SolveError when the
  /// integration breaks down.
  using Sink = std::function<void(const events::Event&)>;
  double advance(double until_s, double cpu_s, const Sink& sink);

  Statistics get_statistics() const;

 private:
  class Course;
  std::unique_ptr<Course> course_;
};

/// Questions about joints and cords that may be meant otherwise: far from their bodies. A line each.
std::vector<std::string> ask_about_links(const WorldSpec& spec);

/// The pose of the mesh frame of a body whose centre of mass lies at `centre_m` in it: x - R(q) c.
Pose calc_pose(const events::BodyMotion& motion, const Vec3& centre_m);

/// Puts the stream of a world together again. `centres_m[i]`: centre of mass of body i in the frame of its mesh; as many as there are
/// bodies. Events of other bodies are left out.
Simulation collect(const std::vector<events::Event>& events, const std::vector<Vec3>& centres_m);

/// Lets the world run from 0 to `duration_s` and returns every contact pulse and the path of every body.
/// Two calls with the same spec give the same bits. `progress` (may be empty) is called now and then with the finished fraction, 0..1.
/// Throws as World does.
Simulation simulate(const WorldSpec& spec, double duration_s, const std::function<void(double fraction)>& progress = {});

}  // namespace carillon::physics
