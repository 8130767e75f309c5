// Largest deflection of a body with linear modes, above the linear range.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/synth/damped_modes.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/model.hpp"

namespace carillon::synth {

/// Limit of linear modes in thicknesses: a plate clamped at its edges is then about 100 cents sharp.
inline constexpr double kLinearThicknesses = 0.5;

/// Reference thickness of deflections [m], bank::calc_thickness_m(). 0, no judgement: nonlinear banks, banks without a volume, and strings
/// and membranes, whose tension grows with the slope.
double find_judged_thickness_m(const bank::Bank& bank);

/// Running maximum of the modal deflection, during and shortly after forces. A bound, the sum over modes of amplitude times largest shape,
/// comes first; above the limit and the maximum, displacements are summed over all modes at the vertices of ModelBending. Allocates in the
/// constructor only. [audio-thread]
class BendingWatch {
 public:
  /// The model must outlive the result.
  explicit BendingWatch(const Model& model);

  /// True for some time after the last force.
  bool is_watching() const noexcept { return left_ > 0; }
  /// Evaluates the states at the end of a sub-block with forces, or of a watched one: at the start of `column`, kColumns for the end of the
  /// block. Without forces also at times within the sub-block.
  void look(const ModeState* states, const ColumnStates* starts, int column, int groups, std::span<const DampedState> damped,
            bool acted) noexcept;

  /// In thicknesses; 0 up to kLinearThicknesses.
  double get_largest() const noexcept { return largest_; }
  void take_over(const BendingWatch& other) noexcept { largest_ = other.largest_; }

 private:
  void look_at(int back, int groups, std::span<const DampedState> damped) noexcept;
  double calc_deflection_m(int groups, double limit_m) noexcept;

  const Model* model_;
  double largest_ = 0.0;
  int left_ = 0;  // remaining sub-blocks to watch
  // By column: states of the ringing modes, and the displacement per step of each shape [m].
  std::vector<float> re_, im_, move_;
  std::vector<float> rest_;  // by group: bound on the displacement by it and all later ones [m]
};

}  // namespace carillon::synth
