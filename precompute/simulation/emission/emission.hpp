// Surface motion to sound at receivers (docs/equations.md E14).
//
//   emission::Emission sound(comm, part, options);
//   for (n = 0; n <= frames * steps_per_sample; ++n) sound.add_step(displacement_of_step_n);
//   sound.finish();
//   const std::vector<double> pressure_pa = sound.calc_sound(receiver);
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/job/obstacles.hpp"
#include "precompute/simulation/emission/receivers.hpp"
#include "precompute/simulation/emission/visibility.hpp"
#include "runtime/base/triangle.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::emission {

/// Triangles of this rank: each surface triangle is on one rank. Thin sheets have each triangle twice, once per side.
struct SurfacePart {
  std::vector<Vec3> nodes_m;                  // (N) rest positions of all nodes with displacements, on the surface or not
  std::vector<std::int64_t> node_number;      // (N) global numbers
  std::vector<Triangle> triangles;            // nodes, counter-clockwise seen from the air
  std::vector<std::int64_t> triangle_number;  // unique over all ranks
  std::vector<std::int32_t> body;             // per triangle, from 0
  std::vector<Triangle> silent;               // silent occluders, for visibility; each on one rank
};

/// kKirchhoff: Kirchhoff-Helmholtz with one pole per body [Pa]. kRayleigh: rho a_n A delta / (2 pi r) [Pa], exact for a flat surface in a
/// baffle. kPaper2001: OCE01 eq. 2 to 10 as printed, in arbitrary units: low notes of small bodies deviate by up to 30 dB.
enum class Radiation : std::uint8_t { kKirchhoff, kRayleigh, kPaper2001 };

/// DC blocker of kPaper2001 as printed: corner 738 Hz at 44,100 Hz.
inline constexpr double kAlpha2001 = 0.1;

struct Options {
  double sample_rate_hz = 48000.0;  // kPaper2001: 44,100 Hz as printed, fmax is half of it
  int steps_per_sample = 0;         // m: step is 1 / (m fs). A multiple of 4 except with kPaper2001; find_steps() gives cheap ones
  std::uint64_t frames = 0;         // samples of the run
  Radiation radiation = Radiation::kKirchhoff;
  std::optional<double> high_pass_hz;  // corner of the DC blocker, 0: none; default 20 Hz, or alpha = 0.1 with kPaper2001
  double air_density_kg_m3 = 1.21, sound_speed_m_s = 343.0;
  std::vector<Microphone> receivers;
  bool has_visibility = true;             // delta of kRayleigh and kPaper2001; without it 1 everywhere
  std::vector<job::RigidObstacle> walls;  // occluders, like the silent triangles and the balls of set_balls()
  std::vector<double> ball_radius_m;
  std::filesystem::path surface_file;  // recorded surface; empty: none. kKirchhoff and kRayleigh
  double keep_hz = 1000.0;             // sample rate of its positions
  bool is_resumed = false;             // load() follows: continues the recorded surface
};

/// Least efficient m >= `least`: a multiple of 16, 8 or 4, at most 7 % or 3 above `least`.
int find_steps(int least);

/// Invariant: the sound is bit-identical on any number of ranks for bit-identical motion; uniform motion is silent, also before the first
/// step. A node's velocity between two steps is its displacement difference over the step, as in the integrator. Collective calls: the
/// constructor, add_step() with visibility or a file, finish(), calc_sound().
class Emission {
 public:
  /// Throws InputError, the same on all ranks.
  Emission(const comm::Communicator& comm, const SurfacePart& part, Options options);
  ~Emission();
  Emission(const Emission&) = delete;
  Emission& operator=(const Emission&) = delete;

  /// displacement_m: (N, 4), fourth component unused, at step 0, 1, ...: `&quads[0].x`. Throws SystemError for write errors. Ignores steps
  /// after the end of the run. A pressure beyond 1e4 Pa or a non-finite number sets has_fault() instead of throwing, so that no rank ends
  /// alone.
  void add_step(const double* displacement_m);
  /// Centres of the balls of ball_radius_m [m], the same on every rank. Call before add_step() at the beginning of a sample,
  /// is_at_sample().
  void set_balls(std::span<const Vec3> centres_m);
  bool has_fault() const;

  /// Changes m from the next step on, which must be the first of a sample (is_at_sample()). Throws InputError unless m is a multiple of 4.
  void set_steps_per_sample(int steps);
  bool is_at_sample() const;

  /// Completes the last samples and the file; motion continues uniformly after the last step. Throws SolveError on all ranks for a fault on
  /// any rank or missing steps.
  void finish();
  /// (frames) high-passed pressure at a receiver [Pa].
  std::vector<double> calc_sound(std::size_t receiver) const;

  /// State of this rank, for the same surfaces, options and ranks. load() throws InputError for others. Local.
  std::vector<std::byte> save() const;
  void load(std::span<const std::byte> state);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace carillon::emission
