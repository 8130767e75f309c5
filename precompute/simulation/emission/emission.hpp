// From the motion of surfaces to sound at receivers (docs/equations.md E14).
//
//   emission::Emission sound(comm, part, options);
//   for (n = 0; n <= frames * steps_per_sample; ++n) sound.add_step(displacement_of_step_n);
//   sound.finish();
//   const std::vector<double> pressure_pa = sound.calc_sound(receiver);
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/simulation/emission/receivers.hpp"
#include "precompute/simulation/emission/visibility.hpp"
#include "precompute/job/obstacles.hpp"
#include "runtime/base/triangle.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::emission {

/// The triangles of this rank: each triangle of the surfaces is on one rank. A thin sheet has its triangles twice, once from either side.
struct SurfacePart {
  std::vector<Vec3> nodes_m;                  // (N) at rest: those that displacements are given for, on the surface or not
  std::vector<std::int64_t> node_number;      // (N) the same number on every rank that has the node
  std::vector<Triangle> triangles;            // nodes, counter-clockwise from the side of the air
  std::vector<std::int64_t> triangle_number;  // each once over all ranks
  std::vector<std::int32_t> body;             // of each triangle, from 0
  std::vector<Triangle> silent;               // silent surfaces that hide others, for visibility; each on one rank
};

/// kKirchhoff: Kirchhoff and Helmholtz with one pole a body [Pa]. kRayleigh: rho a_n A delta / (2 pi r) [Pa], right for a flat surface in
/// a wall. kPaper2001: OCE01 eq. 2 to 10 as printed, in arbitrary units: low notes of small bodies are up to 30 dB too loud or too soft.
enum class Radiation : std::uint8_t { kKirchhoff, kRayleigh, kPaper2001 };

/// Of the DC blocker of kPaper2001 as printed: a corner of 738 Hz at 44,100 Hz.
inline constexpr double kAlpha2001 = 0.1;

struct Options {
  double sample_rate_hz = 48000.0;  // kPaper2001: 44,100 Hz as printed; its fmax is half of it
  int steps_per_sample = 0;         // m: the step is 1 / (m fs). A multiple of 4 but with kPaper2001; find_steps() has cheap ones
  std::uint64_t frames = 0;         // samples of the run
  Radiation radiation = Radiation::kKirchhoff;
  std::optional<double> high_pass_hz;  // corner of the DC blocker, 0: none; unset: 20 Hz, or alpha = 0.1 with kPaper2001
  double air_density_kg_m3 = 1.21, sound_speed_m_s = 343.0;
  std::vector<Microphone> receivers;
  bool has_visibility = true;             // delta of kRayleigh and kPaper2001; without it 1 everywhere
  std::vector<job::RigidObstacle> walls;  // screens, as the silent triangles and the moving balls of set_balls()
  std::vector<double> ball_radius_m;
  std::filesystem::path surface_file;  // recorded surface; empty: none. kKirchhoff and kRayleigh
  double keep_hz = 1000.0;             // rate of its places
  bool is_resumed = false;             // load() follows: the recorded surface is continued
};

/// The least m >= `least` that can be filtered at little cost: a multiple of 16, 8 or 4, at most 7 % more than `least`, or 3 more.
int find_steps(int least);

/// Invariant: all sound has the same bits on any number of ranks, for surfaces that move with the same bits; a surface in uniform
/// motion is silent, before the first step, too. The velocity of a node between two steps is the difference of its displacements over the
/// step, as in every integrator that moves nodes by the step times their velocity. Collective calls: the constructor, add_step() where
/// there is visibility or a file, finish(), calc_sound().
class Emission {
 public:
  /// Throws InputError, the same on all ranks.
  Emission(const comm::Communicator& comm, const SurfacePart& part, Options options);
  ~Emission();
  Emission(const Emission&) = delete;
  Emission& operator=(const Emission&) = delete;

  /// displacement_m: (N, 4), the fourth number unused, at step 0, 1, ...: `&quads[0].x`. Throws SystemError when the file cannot be
  /// written. Steps behind the end of the run are ignored. A pressure beyond 1e4 Pa or a number that is not finite does not throw but sets
  /// has_fault(), so that no rank ends alone.
  void add_step(const double* displacement_m);
  /// Centres of the balls of ball_radius_m [m], the same on every rank. Call before add_step() at the beginning of a sample,
  /// is_at_sample().
  void set_balls(std::span<const Vec3> centres_m);
  bool has_fault() const;

  /// Another m from the next step on, which must be the first of a sample (is_at_sample()). Throws InputError unless m is a multiple of 4.
  void set_steps_per_sample(int steps);
  bool is_at_sample() const;

  /// The last sample and the file are made; no more steps. What follows the last step is uniform motion. Throws SolveError on all ranks
  /// when any has a fault or when steps are missing.
  void finish();
  /// (frames) pressure at a receiver [Pa], high-passed.
  std::vector<double> calc_sound(std::size_t receiver) const;

  /// Everything that changes, of this rank; for the same surfaces, options and ranks. load() throws InputError when it is of others. Local.
  std::vector<std::byte> save() const;
  void load(std::span<const std::byte> state);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace carillon::emission
