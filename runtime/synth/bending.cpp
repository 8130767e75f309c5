// Method:     displacement of a vertex = sum over modes of phi q, at the antinodes of the lowest modes and at vertices spread over the
//             surface; at the end of sub-blocks with forces, and every four samples without. The sum at a vertex ends once the bound on its
//             remaining terms cannot exceed the maximum.
// Source:     docs/equations.md E4, E13.
// Deviations: under forces, and between these vertices, the true maximum is up to a few per cent larger.
#include "runtime/synth/bending.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "runtime/bank/surface.hpp"

namespace carillon::synth {
namespace {

using Lanes = std::array<float, kGroup>;

float add_up(const Lanes& lanes) noexcept {
  float sum = 0.0F;
  for (const float x : lanes) sum += x;
  return sum;
}

}  // namespace

double find_judged_thickness_m(const bank::Bank& bank) {
  if (!bank.quartic.is_empty()) return 0.0;
  const auto names = [&](std::string_view kind) { return bank.provenance.find(kind) != std::string::npos; };
  if (bank.element == "analytic" && (names("\"string\"") || names("\"membrane\""))) return 0.0;
  return bank::calc_thickness_m(bank.vertices_m, bank.triangles, bank.rigid.volume_m3);
}

BendingWatch::BendingWatch(const Model& model) : model_(&model) {
  const ModelBending& bending = model.get_bending();
  if (!(bending.thickness_m > 0.0)) return;
  move_.resize(bending.step_m.size());
  re_.resize(model.get_damped_column(0));
  im_.resize(model.get_damped_column(0));
  rest_.resize(im_.size() / kGroup + 1);
}

void BendingWatch::look(const ModeState* states, const ColumnStates* starts, int column, int groups, std::span<const DampedState> damped,
                        bool acted) noexcept {
  const ModelBending& bending = model_->get_bending();
  left_ = acted ? bending.watched : left_ - 1;
  Lanes swing{};  // bound on the displacement in free motion from now on
  for (int g = 0; g < groups; ++g) {
    const std::size_t first = static_cast<std::size_t>(g) * kGroup;
    for (std::size_t lane = 0; lane < kGroup; ++lane) {
      const bool is_last = column == kColumns;
      const float re = is_last ? static_cast<float>(states[g].re[lane]) : starts[g].re[column][lane];
      const float im = is_last ? static_cast<float>(states[g].im[lane]) : starts[g].im[column][lane];
      re_[first + lane] = re;
      im_[first + lane] = im;
      swing[lane] += bending.step_m[first + lane] * bending.largest[first + lane] * (std::abs(re) + std::abs(im));
    }
  }
  const double limit_m = bending.thickness_m * std::max(kLinearThicknesses, largest_);
  // Damped modes are watched as long as the others.
  if (add_up(swing) <= limit_m && damped.empty()) {
    left_ = 0;
    return;
  }
  for (int back = 0; back <= (acted ? 0 : ModelBending::kBack); ++back) look_at(back, groups, damped);
}

/// Evaluates at `back` steps before the end of the sub-block.
void BendingWatch::look_at(int back, int groups, std::span<const DampedState> damped) noexcept {
  const ModelBending& bending = model_->get_bending();
  const std::size_t lanes = im_.size(), turn = static_cast<std::size_t>(std::max(0, back - 1)) * lanes;
  Lanes bound{};
  for (std::size_t first = 0; first < static_cast<std::size_t>(groups) * kGroup; first += kGroup) {
    for (std::size_t lane = 0; lane < kGroup; ++lane) {
      const std::size_t c = first + lane;
      const float im = back == 0 ? im_[c] : im_[c] * bending.back_re[turn + c] + re_[c] * bending.back_im[turn + c];
      move_[c] = bending.step_m[c] * im;
      bound[lane] += bending.largest[c] * std::abs(move_[c]);
    }
  }
  double bound_m = add_up(bound);
  for (std::size_t m = 0; m < damped.size(); ++m) {  // state at the end: they are slow, or decayed
    const std::size_t c = lanes + m;
    move_[c] = bending.step_m[c] * static_cast<float>(damped[m].q);
    bound_m += static_cast<double>(bending.largest[c] * std::abs(move_[c]));
  }
  const double limit_m = bending.thickness_m * std::max(kLinearThicknesses, largest_);
  if (!(bound_m > limit_m)) return;
  const double found_m = calc_deflection_m(groups, limit_m);
  if (found_m > limit_m) largest_ = found_m / bending.thickness_m;
}

/// Largest displacement of the vertices of ModelBending [m]; at least `limit_m`.
double BendingWatch::calc_deflection_m(int groups, double limit_m) noexcept {
  const ModelBending& bending = model_->get_bending();
  const std::size_t last = groups;
  rest_[last] = 0.0F;
  for (std::size_t g = last; g-- > 0;) {
    Lanes bound{};
    for (std::size_t lane = 0; lane < kGroup; ++lane) bound[lane] = bending.largest[g * kGroup + lane] * std::abs(move_[g * kGroup + lane]);
    rest_[g] = rest_[g + 1] + add_up(bound);
  }
  double largest = limit_m;
  for (const std::int32_t vertex : bending.vertex) {
    std::array<const std::int16_t*, 3> rows{};
    std::array<double, 3> moved{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      rows[axis] = model_->get_row(vertex, static_cast<int>(axis));
      for (std::size_t c = im_.size(); c < move_.size(); ++c)
        moved[axis] += static_cast<double>(static_cast<float>(rows[axis][c]) * move_[c]);
    }
    const auto calc_size = [&] { return norm(moved); };
    std::size_t g = 0;
    for (; g < last && calc_size() + static_cast<double>(rest_[g]) > largest; ++g) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        Lanes sum;
        for (std::size_t lane = 0; lane < kGroup; ++lane)
          sum[lane] = static_cast<float>(rows[axis][g * kGroup + lane]) * move_[g * kGroup + lane];
        moved[axis] += static_cast<double>(add_up(sum));
      }
    }
    if (g == last) largest = std::max(largest, calc_size());
  }
  return largest;
}

}  // namespace carillon::synth
