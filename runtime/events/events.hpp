// Events from physics to sound, independent of the physics engine: impulses, sampled forces and lasting contacts at surface points, motions
// of bodies and listener.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <variant>

#include "runtime/base/quaternion.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::events {

using carillon::Quaternion;

/// Pulse shape of a contact force: sin^1.5 (Hertz), or a Gaussian of equal variance (O'Brien, Shen and Gatchalian 2002).
enum class PulseShape : std::uint8_t { kHertz, kGaussian };

/// Contact pulse on one body; a contact between two sounding bodies gives two with opposite impulses. Vectors in mesh axes of the body.
struct Impulse {
  double time_s = 0.0;        // centre of the pulse, sub-sample
  std::int32_t body = 0;      // index in the scene
  std::int32_t other = -1;    // index of the other body; -1: ground, or unknown
  std::int32_t triangle = 0;  // of the body's bank
  PulseShape shape = PulseShape::kHertz;
  Vec3 barycentric{1.0, 0.0, 0.0};  // contact point in that triangle, sum 1
  Vec3 impulse_n_s{};               // on the body
  double duration_s = 0.0;          // contact time; 0: ideal impulse
};

/// Steps of a Force; impact pulses have 20 to 40. Events are copied between queues, so longer pulses are split.
inline constexpr int kMaxForceSteps = 16;

/// Contact force on one body, piecewise constant in `count` steps of equal length. Longer pulses continue in another Force that begins at
/// the end of this one. Vectors in mesh axes of the body.
struct Force {
  double time_s = 0.0;  // start of the first step
  double step_s = 0.0;  // above 0
  std::int32_t body = 0;
  std::int32_t other = -1;
  std::int32_t triangle = 0;
  std::int16_t count = 0;  // 1 to kMaxForceSteps
  bool continues = false;  // continues the previous Force of this body and place
  Vec3 barycentric{1.0, 0.0, 0.0};
  std::array<std::array<float, 3>, kMaxForceSteps> impulse_n_s{};  // on the body, per step; zero beyond `count`

  double calc_length_s() const noexcept { return count * step_s; }
};

/// Splits a pulse of any length into Forces for `sink`. `first`: all but count and samples; `impulses_n_s`: a Vec3 per step.
template <class Impulses, class Sink>
void split_force(Force first, const Impulses& impulses_n_s, Sink&& sink) {
  const double begin_s = first.time_s;
  for (std::size_t done = 0; done < impulses_n_s.size(); done += kMaxForceSteps) {
    const std::size_t count = std::min<std::size_t>(kMaxForceSteps, impulses_n_s.size() - done);
    Force piece = first;
    piece.time_s = begin_s + static_cast<double>(done) * first.step_s;
    piece.count = static_cast<std::int16_t>(count);
    piece.continues = first.continues || done > 0;
    for (std::size_t k = 0; k < count; ++k) {
      for (std::size_t axis = 0; axis < 3; ++axis) piece.impulse_n_s[k][axis] = static_cast<float>(impulses_n_s[done + k][axis]);
    }
    sink(piece);
  }
}

/// Total impulse [N s].
Vec3 calc_impulse(const Force& force) noexcept;

/// Equivalent Impulse at the temporal centroid of the force.
Impulse to_impulse(const Force& force) noexcept;

enum class ContactState : std::uint8_t { kBegin, kHold, kEnd };

/// Sample of a lasting contact on one of its two bodies; both get one with the same id. Values are interpolated linearly between samples.
/// Vectors in mesh axes of the body.
struct LastingContact {
  /// impedance_n_s_m by the other body's material: plane wave over the patch (synth::find_impedance).
  static constexpr double kByMaterial = -1.0;

  double time_s = 0.0;
  std::uint64_t id = 0;  // of pair and contact point, constant during the contact
  std::int32_t body = 0;
  std::int32_t other = -1;
  std::int32_t triangle = 0;
  ContactState state = ContactState::kHold;
  Vec3 barycentric{1.0, 0.0, 0.0};
  Vec3 normal{};                         // unit, into this body
  Vec3 slip_m_s{};                       // velocity of this surface relative to the other
  double force_n = 0.0;                  // normal force, >= 0
  double sweep_m_s = 0.0;                // speed of the contact over this surface; 0 for a box sliding on its face
  double other_sweep_m_s = 0.0;          // speed over the other surface
  double spin_rad_s = 0.0;               // relative angular speed about tangents (rolling)
  double patch_radius_m = 0.0;           // Hertz contact radius under force_n, > 0
  double impedance_n_s_m = kByMaterial;  // impedance of the other body at the point (dashpot); 0: no absorption
};

/// Pose of a body: centre of mass and attitude.
struct BodyMotion {
  double time_s = 0.0;
  std::int32_t body = 0;
  Vec3 position_m{};
  Vec3 velocity_m_s{};
  Quaternion rotation{1.0, 0.0, 0.0, 0.0};
  bool cut = false;  // jumps here (a teleport): no path from the motion before
};

/// Pose of the listener; microphones are given in this frame (x right, y forward, z up).
struct Listener {
  double time_s = 0.0;
  Vec3 position_m{};
  Vec3 velocity_m_s{};
  Quaternion rotation{1.0, 0.0, 0.0, 0.0};
};

/// Progress of the physics: all later events have later times.
struct TimeWatermark {
  double time_s = 0.0;
};

using Event = std::variant<TimeWatermark, Impulse, Force, LastingContact, BodyMotion, Listener>;

double get_time_s(const Event& event) noexcept;

/// Fault of an event, for messages; nullptr if playable: numbers finite, indices not negative, barycentric coordinates in [-1e-6, 1 + 1e-6]
/// with sum 1, unit quaternions to 1e-3, durations, radii and normal force of a LastingContact not negative, 1 to kMaxForceSteps steps of
/// positive length in a Force.
const char* find_fault(const Event& event) noexcept;

}  // namespace carillon::events
