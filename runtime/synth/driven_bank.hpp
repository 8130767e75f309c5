// A body as a filter: a force at one fixed point in, pressure at 1 m out. For instruments and robots whose force never rests.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/model.hpp"

namespace carillon::synth {

/// All modes of a model below the Nyquist frequency that ring (those near and above critical damping do not take part), driven by a force
/// that may differ in every sample. Samples are worked on in periods of kPeriod from the first one on: a call that ends a period takes
/// nearly all the time, and sizes of calls do not change a bit. Memory is taken in the constructor only; the model is not needed
/// afterwards. One thread at a time.
class DrivenBank {
 public:
  /// The force acts at a point of a triangle, along `direction` (a unit vector; its length scales the force). Throws InputError when the
  /// bank has no such triangle or a number is not finite.
  DrivenBank(const Model& model, std::int32_t triangle, const Vec3& barycentric, const Vec3& direction, Isa isa = Isa::kBest);

  /// Adds the pressure at 1 m [Pa]: sample n is that at its instant when force_n[n] [N] acts from the instant of sample n - 1 to that of n.
  /// Any length, both the same. No delay. A force that is not finite counts as the one before it; should a sum overflow all the same, the
  /// body is silenced: nothing that is not finite is added. Denormal numbers are flushed to zero inside. [audio-thread]: no heap, no lock,
  /// no throw.
  void process(std::span<const float> force_n, std::span<float> pressure_pa) noexcept;

  /// How often a force was not finite, or a sum.
  std::int64_t get_fault_count() const { return faults_; }
  /// Memory of the tables and states.
  std::size_t calc_bytes() const;

 private:
  struct Mode;
  void place(std::vector<Mode>& modes);
  void add_grid_modes(std::span<const Mode> modes);
  void add_direct_modes(std::span<const Mode> modes);
  bool take(std::span<const float> force_n, std::span<float, kQuantum> answer) noexcept;
  void replace_faults(std::span<const float> force_n) noexcept;
  void end_period() noexcept;
  void silence() noexcept;

  const Kernels* kernels_ = nullptr;
  FilterBank bank_;
  ResponseTable response_ = {};  // within the period
  std::vector<FilterTurn> turns_;
  std::vector<GridWindow> windows_;
  std::vector<LaneRow> weights_;  // [point][re, im]
  std::vector<GridRun> runs_;
  std::vector<LaneRow> rows_;
  std::vector<DirectTable> direct_;
  std::vector<ModeState> states_;
  std::vector<LaneRow> starts_;  // re of all groups, im of all groups
  std::vector<LaneRow> copies_;
  alignas(64) float input_[kPeriod] = {};    // force less the held one, zero from at_ on
  alignas(64) float ringing_[kPeriod] = {};  // what the held force and the periods before make in this one
  int at_ = 0;                               // samples of the period that are done
  double held_force_n_ = 0.0;                // mean of the period before
  float last_input_ = 0.0F;                  // that of the sample before the period
  std::int64_t faults_ = 0;
};

}  // namespace carillon::synth
