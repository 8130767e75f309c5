// Trees of rigid bodies on joints, moved in joint coordinates, so that joints never separate.
//
//     auto mechanism = joints::make_mechanism(members, joints, gravity);
//     Coordinates now = mechanism->get_start();
//     now = mechanism->fly(now, 2e-3, kTolerance);              // free motion: gravity, joints, damping
//     mechanism->find_motions(now, motions);                    // of its members
//     mechanism->calc_mobility(now, member)                     // response of all members to an impulse on one
//     now = mechanism->move(now, mechanism->calc_push(now, impulses), 1.0, 0.0);
//
// The multibody engine is Simbody, loaded when the first mechanism is created.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "runtime/base/quaternion.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::joints {

using carillon::Quaternion;

enum class Kind { kWeld, kHinge, kSlider, kUniversal, kBall };

/// Motion of the centre of mass and about it; world axes.
struct Motion {
  Vec3 centre{}, velocity{};
  Quaternion rotation{{1, 0, 0, 0}};
  Vec3 spin{};
};

/// Velocity [m/s, rad/s], acceleration or impulse [N s, N m s] at the centre of mass, world axes.
struct Spatial {
  Vec3 linear{}, angular{};
};

struct Member {
  double mass_kg = 0.0;
  Mat3 inertia_kg_m2{};  // about the centre, body axes
  Motion start;
};

/// Connects `body` to `to` in their start poses.
struct Joint {
  Kind kind = Kind::kHinge;
  int body = 0, to = -1;  // members; -1: the world
  Vec3 at{};              // world position at the start [m]
  Vec3 axis{};            // world direction at the start: of a hinge or slider; the first of a universal joint, fixed in `to`
  Vec3 second_axis{};     // of a universal joint, perpendicular to the first, fixed in `body`
  double damping = 0.0;   // torque per rad/s [N m s]; slider: force per m/s [N s/m]
};

/// State of a mechanism.
struct Coordinates {
  std::vector<double> q, u;
  double lost_j = 0.0;  // by damping, since the start
  double step_s = 0.0;  // of the integration; 0: not known yet
};

/// Permitted error of a coordinate per integration step [rad, m].
inline constexpr double kTolerance = 1e-8;

/// Members, joints and start, all constant. Coordinates belong to the caller; joints are closed for any values. Results depend only on the
/// arguments of the call.
class Mechanism {
 public:
  virtual ~Mechanism() = default;

  virtual int count_members() const = 0;
  virtual int count_freedoms() const = 0;
  virtual const Coordinates& get_start() const = 0;
  /// Largest difference between the given and the permitted start velocities, of a member's centre or, times the radius of gyration, of its
  /// spin [m/s].
  virtual double get_start_error() const = 0;

  /// Free motion by `time_s`, which may be negative.
  virtual Coordinates fly(const Coordinates& from, double time_s, double tolerance) = 0;
  virtual void find_motions(const Coordinates& at, std::vector<Motion>& out) = 0;
  /// Accelerations without impulses.
  virtual void find_accelerations(const Coordinates& at, std::vector<Spatial>& out) = 0;
  /// Velocity change of all members per impulse on one: (6 n, 6), rows and columns linear first.
  virtual std::vector<double> calc_mobility(const Coordinates& at, int member) = 0;
  /// Change of u by impulses, one per member.
  virtual std::vector<double> calc_push(const Coordinates& at, const std::vector<Spatial>& impulses) = 0;
  /// u + part du, and q moved with the velocity `du` for `time_s`.
  virtual Coordinates move(const Coordinates& from, const std::vector<double>& du, double part, double time_s) = 0;
};

/// The joints must connect the members as a tree. Without a joint to the world the first member is free. Throws SystemError if the engine
/// cannot be loaded, std::invalid_argument if the members do not form a tree.
std::unique_ptr<Mechanism> make_mechanism(const std::vector<Member>& members, const std::vector<Joint>& joints, const Vec3& gravity);

}  // namespace carillon::joints
