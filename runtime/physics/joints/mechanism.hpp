// Rigid bodies on joints: a tree, moved in the coordinates that its joints leave, so that no joint ever opens.
//
//     auto mechanism = joints::make_mechanism(members, joints, gravity);
//     Coordinates now = mechanism->get_start();
//     now = mechanism->fly(now, 2e-3, kTolerance);              // free motion: gravity, joints, damping
//     mechanism->find_motions(now, motions);                    // of its members
//     mechanism->calc_mobility(now, member)                     // what an impulse on one member does to all
//     now = mechanism->move(now, mechanism->calc_push(now, impulses), 1.0, 0.0);
//
// The multibody engine is Simbody. It is loaded when the first mechanism is made.
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

/// Of the centre of mass and about it; world axes.
struct Motion {
  Vec3 centre{}, velocity{};
  Quaternion rotation{{1, 0, 0, 0}};
  Vec3 spin{};
};

/// A velocity [m/s, rad/s], an acceleration or an impulse [N s, N m s] at the centre of mass, world axes.
struct Spatial {
  Vec3 linear{}, angular{};
};

struct Member {
  double mass_kg = 0.0;
  Mat3 inertia_kg_m2{};  // about the centre, axes of the body
  Motion start;
};

/// Joins `body` to `to`, as both are placed at the start.
struct Joint {
  Kind kind = Kind::kHinge;
  int body = 0, to = -1;  // members; -1: the world
  Vec3 at{};              // in the world at the start [m]
  Vec3 axis{};            // the same: of a hinge, a slider; the first of a universal joint, fixed in `to`
  Vec3 second_axis{};     // of a universal joint, across the first, fixed in `body`
  double damping = 0.0;   // moment per rad/s [N m s], of a slider force per m/s [N s/m]
};

/// Where a mechanism is and how it moves.
struct Coordinates {
  std::vector<double> q, u;
  double lost_j = 0.0;  // by damping, since the start
  double step_s = 0.0;  // of the integration; 0: not known yet
};

/// The error that a step of the integration may leave in a coordinate [rad, m].
inline constexpr double kTolerance = 1e-8;

/// Members, joints and start, which never change. Coordinates belong to the caller; whatever their values, no joint is open. Results depend
/// on the arguments of the call alone.
class Mechanism {
 public:
  virtual ~Mechanism() = default;

  virtual int count_members() const = 0;
  virtual int count_freedoms() const = 0;
  virtual const Coordinates& get_start() const = 0;
  /// The largest difference between the velocities asked for at the start and those that the joints allow, of a member's centre or, times
  /// the radius of gyration, of its spin [m/s].
  virtual double get_start_error() const = 0;

  /// `time_s` later (or earlier) without impulses.
  virtual Coordinates fly(const Coordinates& from, double time_s, double tolerance) = 0;
  virtual void find_motions(const Coordinates& at, std::vector<Motion>& out) = 0;
  /// Without impulses.
  virtual void find_accelerations(const Coordinates& at, std::vector<Spatial>& out) = 0;
  /// Velocity gained by all members per impulse on one: (6 n, 6), rows and columns linear first.
  virtual std::vector<double> calc_mobility(const Coordinates& at, int member) = 0;
  /// Change of u by impulses, one a member.
  virtual std::vector<double> calc_push(const Coordinates& at, const std::vector<Spatial>& impulses) = 0;
  /// u + du, and q moved with the velocity `du` for `time_s`.
  virtual Coordinates move(const Coordinates& from, const std::vector<double>& du, double part, double time_s) = 0;
};

/// The members must hang together by the joints, as a tree. Without a joint to the world the first member is free. Throws
/// SystemError where the engine cannot be loaded, std::invalid_argument where the members do not make a tree.
std::unique_ptr<Mechanism> make_mechanism(const std::vector<Member>& members, const std::vector<Joint>& joints, const Vec3& gravity);

}  // namespace carillon::joints
