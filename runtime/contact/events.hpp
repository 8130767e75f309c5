// What the rigid-body simulation tells the sound: impulses at points of surfaces, and where the bodies are.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace carillon::contact {

using Vec3 = std::array<double, 3>;

/// One contact pulse on one body. The force is impulse_n_s / duration_s times a unit-area pulse (sin^1.5) centred on time_s.
/// A contact between two sounding bodies gives two of these, with opposite impulses.
struct Impulse {
  double time_s = 0.0;        // centre of the pulse, finer than any step or sample
  std::int32_t body = 0;      // index in the scene
  std::int32_t triangle = 0;  // of the body's bank
  Vec3 barycentric{};         // of the contact point in that triangle, sum 1
  Vec3 impulse_n_s{};         // on the body, in the body's own frame (the frame of its mesh)
  double duration_s = 0.0;    // Hertz contact time with the real materials of both bodies
  std::int32_t other = -1;    // the other body's index
};

/// A rigid pose: x_world = R(q) x_body + p.
struct Pose {
  double time_s = 0.0;
  Vec3 position_m{};                             // of the origin of the mesh frame
  std::array<double, 4> rotation{1.0, 0, 0, 0};  // unit quaternion w x y z
};

/// A finished simulation: impulses in order of time; per body, poses in order of time (at least at 0 and at the end).
struct Simulation {
  std::vector<Impulse> impulses;
  std::vector<std::vector<Pose>> poses;
  double seconds_cpu = 0.0;
  std::int64_t steps = 0;
};

}  // namespace carillon::contact
