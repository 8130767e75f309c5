// How far a body bends, where that is too far for modes that do not know of each other.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/synth/damped_modes.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/model.hpp"

namespace carillon::synth {

/// Linear modes hold up to this deflection, in thicknesses: a plate that is held at its edges is then some 100 cents sharp.
inline constexpr double kLinearThicknesses = 0.5;

/// The thickness [m] by which the deflections of a bank are judged, bank::calc_thickness_m(). 0 where deflections are not judged: of banks
/// with a nonlinear energy, of strings and membranes, whose tension grows with the slope and not with the thickness, and where the bank has
/// no volume.
double find_judged_thickness_m(const bank::Bank& bank);

/// The largest deflection of a voice so far. It is looked for where something acts on the body and for some time after, and only while a
/// bound on it, the sum over modes of amplitude times largest shape, is above the limit and above what was found before. Then the
/// displacement is summed over all modes at the places of ModelBending. Memory is taken in the constructor only. [audio-thread]
class BendingWatch {
 public:
  /// The model must outlive the result.
  explicit BendingWatch(const Model& model);

  /// Whether the body is looked at although nothing acts on it.
  bool is_watching() const noexcept { return left_ > 0; }
  /// At the end of a sub-block in which something acted, or which is watched: at the start of a column of the block, or behind the last
  /// one. Where nothing acted, times within the sub-block are looked at, too.
  void look(const ModeState* states, const ColumnStates* starts, int column, int groups, std::span<const DampedState> damped,
            bool acted) noexcept;

  /// In thicknesses; 0 while it has not been above kLinearThicknesses.
  double get_largest() const noexcept { return largest_; }
  void take_over(const BendingWatch& other) noexcept { largest_ = other.largest_; }
  std::size_t calc_bytes() const noexcept { return (re_.capacity() + im_.capacity() + move_.capacity()) * sizeof(float); }

 private:
  void look_at(int back, int groups, std::span<const DampedState> damped) noexcept;
  double calc_deflection_m(int groups) const noexcept;

  const Model* model_;
  double largest_ = 0.0;
  int left_ = 0;  // sub-blocks that are watched from now on
  // Of the moment, by column: the states of the ringing modes, and by how much a step of each shape moves [m].
  std::vector<float> re_, im_, move_;
};

}  // namespace carillon::synth
