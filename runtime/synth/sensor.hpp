// Sensors on a body: acceleration, velocity, displacement or strain at a point of its surface, as an accelerometer, a vibrometer or a
// strain gauge reads them.
//
//   const auto sensor = std::make_unique<synth::Sensor>(model, bank, synth::SensorSettings{.triangle = 12, .direction = {0, 0, 1}});
//   sensors.attach(*sensor);  // SoundingBody does
//   sensor->read(samples);    // SI units
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/synth/damped_modes.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/strike_queue.hpp"

namespace carillon::synth {

enum class Quantity : std::uint8_t { kAcceleration, kVelocity, kDisplacement, kStrain };
/// "acceleration" [m/s2], "velocity" [m/s], "displacement" [m], "strain" [1]; in the order of Quantity.
inline constexpr std::array<std::string_view, 4> kQuantityNames{"acceleration", "velocity", "displacement", "strain"};

struct SensorSettings {
  std::int32_t triangle = 0;  // of the bank
  Vec3 barycentric{1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0};
  Vec3 direction{0.0, 0.0, 1.0};  // mesh axes, any length; strain: axis of the gauge, projected onto the surface
  Quantity quantity = Quantity::kAcceleration;
  double rate_hz = 0.0;   // of its samples; 0: that of the model
  bool is_held = false;   // the body does not move as a rigid body
  double buffer_s = 1.0;  // samples that wait for read()
};

/// True for a body that moves as a rigid body: with a mass, and not held anywhere.
bool moves_freely(const bank::Bank& bank);

/// Rates of sensors [Hz].
inline constexpr double kSlowestSensorHz = 50.0, kFastestSensorHz = 192000.0;

/// Readings of one point: with n the direction, s the struck and p the sensor's point, a = n . [F / m + (I^-1 (r_s x F)) x r_p + sum_i
/// phi_i(p) (phi_i(s) . F - omega_i^2 q_i - 2 d_i q_i')]; velocity and displacement accordingly, from rest; strain is e . grad u e along
/// the surface, without a rigid part.
///
/// The forces are those of strikes and the noise of lasting contacts; weight, loads at rest, joints and cords are not among them: at rest
/// an accelerometer reads 0, in free fall too, and a velocity is that by the blows alone. A force counts as its mean over the sample about
/// each instant. Modes in single precision, relative to the largest; force and rigid part in double precision. Modes beyond the Nyquist
/// frequency or the band of the bank are missing: within millimetres of a blow the local indentation is not there.
///
/// Invariant: sample n is the reading at time get_begin_s() + n / rate, without delay; the samples do not depend on block sizes. Allocates
/// in the constructor only. One thread renders, one reads.
class Sensor {
 public:
  /// `bank`: that of the model, not kept. Throws InputError for a missing triangle, a direction of no length (strain: normal to the
  /// surface), barycentric coordinates that are not finite, and a rate out of range. [main-thread]
  Sensor(const std::shared_ptr<const Model>& model, const bank::Bank& bank, const SensorSettings& settings);

  double get_rate_hz() const noexcept { return rate_hz_; }
  Quantity get_quantity() const noexcept { return quantity_; }
  /// Time of its first sample; the body's first block with it. [any-thread]
  double get_begin_s() const noexcept { return begin_s_.load(std::memory_order_relaxed); }
  /// Samples that read() would give now, or fewer. [any-thread]
  std::size_t count_ready() const noexcept { return written_.load(std::memory_order_acquire) - taken_.load(std::memory_order_acquire); }
  /// The next samples, as many as are ready; returns their number. [one thread]: no heap, no lock, no throw.
  std::size_t read(std::span<double> samples) noexcept;
  /// Samples lost because none were read for SensorSettings::buffer_s. [any-thread]
  std::int64_t get_lost() const noexcept { return lost_.load(std::memory_order_relaxed); }

  /// All that follows: [audio-thread], for BodySensors; no heap, no lock, no throw. Samples count from the first of this call.

  void begin(double time_s) noexcept { begin_s_.store(time_s, std::memory_order_relaxed); }
  /// Ringing modes of sub-blocks `first` to `first` + `sub_blocks` of the block, at sample `offset`.
  void emit(const Kernels& kernels, const ColumnStates* starts, int groups, int first, int sub_blocks, int offset) noexcept;
  /// Responses to forces in a sub-block.
  void weigh(const Kernels& kernels, const SampleStates* kept, int groups, int offset) noexcept;
  /// Damped modes, kSubBlock states of each.
  void add_damped(std::span<const DampedState> states, int offset) noexcept;
  /// The forces themselves, of the sub-block from `sample` on.
  void add_forces(const StrikeQueue& strikes, const ContactBlock* drive, std::int64_t sample, int offset) noexcept;
  /// Drops the modes' readings from a sample on.
  void silence(int from, int samples) noexcept;
  /// Passes on the samples of the call.
  void finish(int samples) noexcept;
  /// Bound on the reading per size of the state of a mode, over that of silence.
  double get_bound(int mode) const noexcept { return bound_[mode]; }
  /// Largest reading of the damped modes in the last call, over that of silence.
  double get_damped_level() const noexcept { return damped_level_; }
  void clear_damped_level() noexcept { damped_level_ = 0.0; }

 private:
  /// Weights of the rows of the shapes: vertex * 3 + axis, weight.
  using Weights = std::vector<std::pair<std::size_t, double>>;
  struct Reading {
    double of_q, of_v;
  };

  void check(const bank::Bank& bank, const SensorSettings& settings) const;
  Weights find_weights(const bank::Bank& bank, const SensorSettings& settings) const;
  void add_modes(const Weights& weights);
  void add_rigid(const bank::Bank& bank, const SensorSettings& settings);
  double find_share(const std::vector<double>& field, const std::int16_t* const* row, const float* weight) const noexcept;
  template <class MakeMoments>
  void add_pulse(double direct, double rigid, double begin, double end, int offset, const MakeMoments& make) noexcept;
  void add_contacts(const ContactBlock& drive, int offset) noexcept;
  void add_rigid_way(std::span<double> values) noexcept;
  void convert(double value) noexcept;
  void put(std::span<const double> values) noexcept;

  std::shared_ptr<const Model> model_;
  Quantity quantity_;
  double rate_hz_ = 0.0, step_s_ = 0.0;  // step: of the model
  std::vector<SoundTable> sound_;        // reading of the ringing modes over a column
  std::vector<ModeWeight> weight_;       // of their states
  std::vector<Reading> damped_;
  std::vector<double> bound_;
  std::vector<double> direct_;  // (V, 3) acceleration per force at a vertex, of modes and rigid body [1/kg]; empty: none
  std::vector<double> rigid_;   // (V, 3) of the rigid body, for velocity and displacement; empty: none
  alignas(64) std::array<float, kBlock> modal_{};
  // Sample 0 is the last one of the previous call: half of the mean of its force lies in this one.
  std::array<double, kBlock + 1> other_{};             // all but the ringing modes
  std::array<double, kBlock + 1> gained_{}, moved_{};  // rigid velocity gained in the interval of a sample, and way by it
  double velocity_ = 0.0, way_ = 0.0;
  double last_modal_ = 0.0;
  bool has_last_ = false;
  double damped_level_ = 0.0;
  std::atomic<double> begin_s_{0.0};
  // Conversion to another rate; without: empty.
  std::vector<double> history_;  // the last inputs, a ring
  double ratio_ = 1.0, stretch_ = 1.0;
  std::int64_t inputs_ = 0, outputs_ = 0;
  std::vector<double> ring_;  // SPSC
  std::atomic<std::uint64_t> written_{0}, taken_{0};
  std::atomic<std::int64_t> lost_{0};
};

/// The sensors of one body. [audio-thread]: no heap, no lock, no throw, except for make_trace().
class BodySensors {
 public:
  static constexpr std::size_t kMax = 64;
  /// Buffers for the states within a sub-block.
  struct Trace {
    std::vector<SampleStates> kept;
    std::vector<DampedState> damped;  // (kSubBlock, damped modes)
  };
  /// [main-thread]
  static Trace make_trace(const Model& model);

  explicit BodySensors(Trace trace) : trace_(std::move(trace)) {}
  /// No effect beyond kMax. Raises `weights`, bounds on the pressure per state, so that a mode is not dropped while the sensor reads it.
  void attach(Sensor& sensor, const Model& model, double silence_pa, double time_s) noexcept;
  std::span<const std::array<float, kGroup>> get_weights() const noexcept { return bounds_; }
  /// Prepares the bounds. [main-thread]
  void set_bounds(std::span<const std::array<float, kGroup>> audible) { bounds_.assign(audible.begin(), audible.end()); }

  /// Before the next `samples` samples, of whole sub-blocks within one block.
  void begin(int samples) noexcept;
  SampleStates* get_kept() noexcept { return trace_.kept.data(); }
  DampedState* get_damped() noexcept { return trace_.damped.data(); }
  void emit(const Kernels& kernels, const ColumnStates* starts, int groups, int first, int sub_blocks, int offset) noexcept;
  void weigh(const Kernels& kernels, const SampleStates* kept, int groups, int offset) noexcept;
  void add_damped(int offset) noexcept;
  void add_forces(const StrikeQueue& strikes, const ContactBlock* drive, std::int64_t sample, int offset) noexcept;
  void silence(int from) noexcept;
  /// True while a sensor reads the damped modes.
  bool reads_damped() const noexcept;
  /// Passes on `samples` samples of every sensor.
  void finish(int samples) noexcept;

 private:
  Trace trace_;
  std::array<Sensor*, kMax> sensors_{};
  std::size_t count_ = 0;
  int samples_ = 0;
  std::vector<std::array<float, kGroup>> bounds_;
};

}  // namespace carillon::synth
