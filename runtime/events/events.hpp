// Events from physics to sound, independent of the physics engine: impulses, samples of forces and lasting contacts at points of surfaces,
// and where bodies and listener are.
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

/// Course of a contact force in time: sin^1.5 (Hertz), or the Gaussian of O'Brien, Shen and Gatchalian 2002, of the same variance.
enum class PulseShape : std::uint8_t { kHertz, kGaussian };

/// One contact pulse on one body; a contact between two sounding bodies gives two of these, with opposite impulses. Vectors are in the
/// frame of the body's mesh.
struct Impulse {
  double time_s = 0.0;        // centre of the pulse, finer than any step or sample
  std::int32_t body = 0;      // index in the scene
  std::int32_t other = -1;    // the other body's index; -1: the ground, or unknown
  std::int32_t triangle = 0;  // of the body's bank
  PulseShape shape = PulseShape::kHertz;
  Vec3 barycentric{1.0, 0.0, 0.0};  // of the contact point in that triangle, sum 1
  Vec3 impulse_n_s{};               // on the body
  double duration_s = 0.0;          // contact time; 0: an ideal impulse
};

/// Steps of a Force: a pulse of an impact has 20 to 40. An event is copied from queue to queue, so a longer pulse is several events.
inline constexpr int kMaxForceSteps = 16;

/// The force of a contact on one body, known step by step: constant in each of `count` steps of equal length. A pulse that has more steps
/// continues in another Force, which begins where this one ends. Vectors are in the frame of the body's mesh.
struct Force {
  double time_s = 0.0;  // when the first step begins
  double step_s = 0.0;  // above 0
  std::int32_t body = 0;
  std::int32_t other = -1;
  std::int32_t triangle = 0;
  std::int16_t count = 0;  // steps, 1 to kMaxForceSteps
  bool continues = false;  // the pulse of the Force before it of this body and place
  Vec3 barycentric{1.0, 0.0, 0.0};
  std::array<std::array<float, 3>, kMaxForceSteps> impulse_n_s{};  // on the body, of each step; zero beyond `count`

  double calc_length_s() const noexcept { return count * step_s; }
};

/// Hands a pulse of any length to `sink` as Forces. `first` has everything but count and samples; `impulses_n_s`: a Vec3 for each step.
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

/// The sum of a Force [N s].
Vec3 calc_impulse(const Force& force) noexcept;

/// The same impulse at once, at the middle of the force in time.
Impulse to_impulse(const Force& force) noexcept;

enum class ContactState : std::uint8_t { kBegin, kHold, kEnd };

/// One sample of a contact that lasts, on one of its two bodies; both get one, with the same id. Between records values change linearly.
/// Vectors are in the frame of the body's mesh.
struct LastingContact {
  /// As impedance_n_s_m: that of a plane wave into the other body over the patch, by its material (synth::find_impedance).
  static constexpr double kByMaterial = -1.0;

  double time_s = 0.0;
  std::uint64_t id = 0;  // of the pair and the spot; the same while the touch lasts
  std::int32_t body = 0;
  std::int32_t other = -1;
  std::int32_t triangle = 0;
  ContactState state = ContactState::kHold;
  Vec3 barycentric{1.0, 0.0, 0.0};
  Vec3 normal{};                         // unit, from the other body into this one
  Vec3 slip_m_s{};                       // velocity of this surface against the other's
  double force_n = 0.0;                  // normal, at least 0
  double sweep_m_s = 0.0;                // speed of the contact over this body's surface; 0 for a box that slides flat
  double other_sweep_m_s = 0.0;          // over the other's
  double spin_rad_s = 0.0;               // relative angular speed about the tangents: rolling
  double patch_radius_m = 0.0;           // Hertz radius of the touch under force_n, above 0
  double impedance_n_s_m = kByMaterial;  // of the other body at the point, as a dashpot; 0: takes nothing
};

/// Where a body is: its centre of mass and attitude.
struct BodyMotion {
  double time_s = 0.0;
  std::int32_t body = 0;
  Vec3 position_m{};
  Vec3 velocity_m_s{};
  Quaternion rotation{1.0, 0.0, 0.0, 0.0};
};

/// Where the listener is; microphones lie in this frame (x right, y forward, z up).
struct Listener {
  double time_s = 0.0;
  Vec3 position_m{};
  Vec3 velocity_m_s{};
  Quaternion rotation{1.0, 0.0, 0.0, 0.0};
};

/// Physics has run so far: nothing earlier than this follows.
struct TimeWatermark {
  double time_s = 0.0;
};

using Event = std::variant<TimeWatermark, Impulse, Force, LastingContact, BodyMotion, Listener>;

double get_time_s(const Event& event) noexcept;

/// What is wrong with an event, as part of a sentence; nullptr when it can be played: all numbers finite, indices not negative, barycentric
/// coordinates in [-1e-6, 1 + 1e-6] with sum 1, quaternions of unit length to 1e-3, durations, radii and the normal force of a
/// LastingContact not negative, a Force of 1 to kMaxForceSteps steps of a positive length.
const char* find_fault(const Event& event) noexcept;

}  // namespace carillon::events
