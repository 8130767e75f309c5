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
/// that may differ in every sample. Modes from 1 kHz on in single precision, those below, whose coefficients would round to another pitch,
/// in double. Memory is taken in the constructor only; the model is not needed afterwards. One thread at a time.
class DrivenBank {
 public:
  /// The force acts at a point of a triangle, along `direction` (a unit vector; its length scales the force). Throws InputError when the
  /// bank has no such triangle or a number is not finite.
  DrivenBank(const Model& model, std::int32_t triangle, const bank::Vec3& barycentric, const bank::Vec3& direction, Isa isa = Isa::kBest);

  /// Adds the pressure at 1 m [Pa]: sample n is that at its instant when force_n[n] [N] acts from the instant of sample n - 1 to that of n.
  /// Any length, both the same. Denormal numbers are flushed to zero inside. [audio-thread]: no heap, no lock, no throw.
  void process(std::span<const float> force_n, std::span<float> pressure_pa) noexcept;

 private:
  const Kernels* kernels_ = nullptr;
  std::vector<FilterGroup<float>> high_;
  std::vector<FilterGroup<double>> low_;
  float last_force_n_ = 0.0F;
};

}  // namespace carillon::synth
