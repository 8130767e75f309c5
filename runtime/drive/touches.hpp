// Contact events from the steps of any physics engine: poses, velocities and contact points in; pulses, forces, lasting contacts, motions
// and marks out.
//
// Method: a hit needs a speed of approach before the step, so that weight and recovery from overlap are none; it lasts until the surfaces
// part, and its impulse is the sum over its steps without the weight. Positions of contact are tracked by nearness, and their load is
// averaged over a few steps. Hits of bodies with modes are integrated (runtime/physics/impact), others are Hertz pulses.
// docs/howto/my-engine.md explains every field.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>

#include "runtime/bank/bank.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/events/events.hpp"

namespace carillon::drive {

struct TouchesOptions {
  int max_points = 4096;      // per step; of more the weakest are left out
  bool points_after = false;  // points are of the poses after the step, otherwise of those before it
  bool compliant = false;     // a hit lasts many steps: it ends when its force has decayed
  bool early = false;         // hits are reported when they begin, with the impulse predicted from the restitution
  int max_impacts = 8;        // work limit, in mean impacts with modes at once; further hits: limited Hertz pulses
  Vec3 gravity_m_s2{0.0, 0.0, -9.81};
  double slowest_m_s = 0.0;  // slower approaches are no hits; 0: 1 mm/s, or half of gravity times the step if that is more
  double longest_hit_s = 0.06;
  // The ground, body -1: concrete.
  double ground_young_pa = 30e9, ground_poisson = 0.2, ground_density_kg_m3 = 2400.0;
  double ground_restitution = 0.5, ground_friction = 0.5;
};

/// A body of the engine. Zeros: the values of the bank.
struct TouchesBody {
  int body = 0;                      // number in events; -1: silent, but strikes others
  bool fixed = false;                // static, or moved by the program
  const bank::Bank* bank = nullptr;  // not owned; must outlive the Touches. Null: only for silent bodies
  std::uint64_t name_hash = 0;       // seeds the ids of contacts
  double mass_kg = 0.0;
  std::array<double, 9> inertia_kg_m2{};  // about the centre of mass, mesh axes; without bank: of a ball of size_m
  double young_pa = 0.0, poisson = 0.0, density_kg_m3 = 0.0;
  double size_m = 0.0;                       // diagonal of the bounding box
  double restitution = 0.5, friction = 0.4;  // a contact uses the geometric means of both bodies
};

/// Motion at the end of a step; world axes.
struct TouchesPose {
  Vec3 position_m{};                                // of the centre of mass
  events::Quaternion rotation{1.0, 0.0, 0.0, 0.0};  // of the mesh frame, unit to 1e-3
  Vec3 velocity_m_s{}, spin_rad_s{};
  bool asleep = false;
  bool teleported = false;  // moved by the program in this step
  bool jointed = false;     // on joints: effective masses are measured from the step
};

/// A contact point of a step.
struct TouchPoint {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  int a = 0, b = -1;                                // -1: the ground
  Vec3 point_m{};                                   // on b
  Vec3 normal{};                                    // unit, from b into a
  double gap_m = 0.0;                               // on a the point is point_m + gap_m normal
  double impulse_n_s = kUnknown;                    // on a along the normal, of the whole step; NaN: found from the velocities
  Vec3 friction_n_s{kUnknown, kUnknown, kUnknown};  // on a; NaN: likewise
  double curvature_per_m = kUnknown;                // of both surfaces; NaN: of the banks' shapes
};

struct TouchesCounters {
  std::int64_t steps = 0;
  std::int64_t points = 0;          // accepted
  std::int64_t bad_points = 0;      // left out: invalid numbers or bodies
  std::int64_t dropped_points = 0;  // left out: more than max_points
  std::int64_t hits = 0;            // sounded
  std::int64_t impacts = 0;         // of them integrated with modes
  std::int64_t simplified = 0;      // beyond the work of max_impacts
  std::int64_t limited = 0;         // pulses reduced to the energy of the blow
  std::int64_t masked = 0;          // hits left out: inaudible next to others
  std::int64_t weights = 0;         // impulses that were load only
  std::int64_t settled = 0;         // pulses of lasting contacts taken for load
  std::int64_t cut = 0;             // hits ended by longest_hit_s
  std::int64_t touches = 0;         // lasting contacts begun
  std::int64_t records = 0;         // events::LastingContact
  std::int64_t teleports = 0;
  std::int64_t waiting = 0;  // events that the sink did not take, kept for the next step
  std::int64_t lost = 0;     // events dropped: too many were waiting, or numbers out of range
  double longest_hit_s = 0.0;
};

/// The bodies of an engine and their contacts. Invariant: all events up to get_mark_s() have been passed to the sink; none depends on the
/// order of bodies and points. [main-thread]: allocates and throws; an InputError leaves everything unchanged.
class Touches {
 public:
  /// Receives events in time order, each step's ended by a TimeWatermark. False: no room; the event is passed again at the next step.
  using Sink = std::function<bool(const events::Event&)>;

  /// Throws InputError for numbers out of range.
  Touches(const TouchesOptions& options, Sink sink);
  ~Touches();
  Touches(const Touches&) = delete;
  Touches& operator=(const Touches&) = delete;

  /// Index of the body in the poses from the next step on: the lowest that is free. Throws InputError for an open surface, and for a body
  /// without mass, modulus or size.
  int add(const TouchesBody& body);
  /// Ends its contacts. Throws InputError for an unknown index.
  void remove(int index);
  /// Time and poses before the first step, or after a break. `poses`: one per index, those of removed bodies are ignored.
  void start(double time_s, std::span<const TouchesPose> poses);
  /// A step that ends at `time_s`. Throws InputError, naming the fault, for a time that does not advance, a wrong number of poses and poses
  /// that are not finite. Points with invalid numbers are left out and counted. False if events wait for room.
  bool step(double time_s, std::span<const TouchesPose> poses, std::span<const TouchPoint> points);
  /// No earlier events follow. [any thread]
  double get_mark_s() const noexcept;
  const TouchesCounters& get_counters() const noexcept;
  /// Number of poses that start() and step() expect.
  int count() const noexcept;

 private:
  class Course;
  std::unique_ptr<Course> course_;
};

}  // namespace carillon::drive
