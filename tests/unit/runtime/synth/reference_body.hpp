// One ringing body in double precision, sample by sample: oracle of synth::ResonatorBank.
//
//   testing::ReferenceBody body(bank, 48000.0);
//   body.strike({.sample = 100.37, .duration_s = 80e-6, .triangle = 12, .barycentric = {0.2, 0.3, 0.5}, .impulse_n_s = {0, 0, 0.01}});
//   body.process(block);  // adds pascals
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/synth/pulse.hpp"

namespace carillon::testing {

using synth::kMoments;
using synth::Moments;

/// A contact pulse (sin^1.5, see pulse.hpp) on the surface of a body.
struct Strike {
  double sample = 0.0;        // centre of the pulse in samples since the body was made; any fraction
  double duration_s = 0.0;    // >= 0; zero is an ideal impulse
  std::int32_t triangle = 0;  // of the bank
  Vec3 barycentric{1.0, 0.0, 0.0};
  Vec3 impulse_n_s{};  // in the frame of the mesh
};

struct ReferenceBodyOptions {
  int max_strikes = 256;      // pulses that may be waiting or acting at once
  double silence_pa = 1e-10;  // below this bound on its pressure at 1 m (-106 dB re 20 uPa) a body sleeps
};

struct ReferenceBodyCounters {
  std::int64_t accepted = 0;  // strikes taken
  std::int64_t refused = 0;   // not finite, outside the surface, or no room
  std::int64_t late = 0;      // began before the block to come and were moved to its start
  std::int64_t resets = 0;    // times that the state was not finite and was cleared
};

/// All modes of one bank below the Nyquist frequency, in double precision, each by its exact map. Allocates in the constructor only. One
/// thread calls strike() and process().
class ReferenceBody {
 public:
  /// The bank is not owned and must outlive the body. Throws InputError when arrays of the bank disagree or the rate is not positive.
  ReferenceBody(const bank::Bank& bank, double sample_rate_hz, ReferenceBodyOptions options = {});

  /// Registers a pulse; it acts once process() reaches its beginning, or at once when that is past. False when it was refused.
  /// [audio-thread]: no heap, no lock, no throw.
  bool strike(const Strike& strike) noexcept;

  /// Adds the pressure at 1 m [Pa] of the next pressure_pa.size() samples. Calls of any size give the same sound.
  /// [audio-thread]: no heap, no lock, no throw. A body without energy costs nothing.
  void process(std::span<double> pressure_pa) noexcept;

  /// Samples processed so far: the time of the next sample.
  std::int64_t get_position() const { return position_; }
  /// Modes that are below Nyquist, and thus sounded.
  int get_mode_count() const { return mode_count_; }
  /// Modes that are advanced at this moment (in whole tiles).
  int get_live_mode_count() const;
  bool is_awake() const { return awake_; }
  const ReferenceBodyCounters& get_counters() const { return counters_; }
  /// Sum over the sounded modes of (q'^2 + lambda q^2) / 2 [J].
  double calc_energy_j() const noexcept;

  static constexpr int kChunk = 32;  // samples that are advanced together
  static constexpr int kLanes = 8;   // modes that are advanced together

 private:
  using Lanes = std::array<double, kLanes>;

  /// Eight under-damped modes as complex numbers z = (q' + d q) + i omega_d q, so that z(t + h) = e^{(-d + i omega_d) h} z(t).
  struct alignas(64) Tile {
    Lanes re{}, im{};                                    // state
    Lanes turn_re{}, turn_im{};                          // e^{(-d + i omega_d) h}
    Lanes out_re{}, out_im{};                            // p = out_re re + out_im im = g q'
    std::array<Lanes, kMoments> force_re{}, force_im{};  // Chebyshev coefficients of the answer within a sample
    std::array<std::int32_t, kLanes> mode{};             // of the bank; -1 is padding
    bool live = false;
  };

  /// A mode at, near or above critical damping, as (q, q'). Stiff ones take several substeps a sample while a pulse acts.
  struct DampedMode {
    double q = 0.0, v = 0.0;
    double qq, qv, vq, vv;                  // map over one sample
    double sub_qq, sub_qv, sub_vq, sub_vv;  // map over one substep
    Moments force_q, force_v;
    double gain = 0.0;
    std::int32_t mode = 0;
    int substeps = 1;
  };

  /// A strike on its way: begin and duration in samples.
  struct Pulse {
    double begin = 0.0;
    double duration = 0.0;
    std::array<std::int32_t, 3> vertex{};
    Vec3 barycentric{};
    Vec3 impulse_n_s{};
  };

  void add_tile_mode(std::size_t mode);
  void add_damped_mode(std::size_t mode);
  void process_chunk(std::span<double> pressure_pa) noexcept;
  int find_acting_pulses(int samples) noexcept;
  double calc_projection(const Pulse& pulse, std::int32_t mode) const noexcept;
  void calc_forcing(const Tile& tile, int acting, int samples) noexcept;
  void advance_tile(Tile& tile, int samples, bool driven) noexcept;
  void advance_damped_modes(std::span<double> pressure, bool driven) noexcept;
  void retire_pulses() noexcept;
  void fall_asleep_if_silent() noexcept;
  void reset() noexcept;

  const bank::Bank* bank_ = nullptr;
  double rate_hz_ = 0.0;
  double silence_pa_ = 0.0;
  std::int64_t position_ = 0;
  int mode_count_ = 0;
  int tile_modes_ = 0;
  bool awake_ = false;
  bool damped_live_ = false;
  ReferenceBodyCounters counters_;

  std::vector<Tile> tiles_;
  std::vector<DampedMode> damped_;                    // ascending in substeps
  std::vector<Pulse> pulses_;                         // capacity max_strikes, never grown
  std::vector<int> acting_;                           // indices into pulses_ that touch the chunk
  std::vector<std::array<Moments, kChunk>> moments_;  // per acting pulse and sample
  std::array<Lanes, kChunk> forcing_re_{}, forcing_im_{}, sum_{};
};

}  // namespace carillon::testing
