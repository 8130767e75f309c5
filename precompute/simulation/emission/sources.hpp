// Volume accelerations of triangles and the pole of their pressure. Internal to carillon::emission.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "precompute/simulation/emission/motion_filter.hpp"
#include "precompute/simulation/emission/rows.hpp"
#include "precompute/simulation/emission/surfaces.hpp"
#include "runtime/acoustics/recording/pole.hpp"

namespace carillon::emission {

/// Invariant: the volume acceleration of a triangle is the derivative of its flux v . S, so that a closed surface radiates exactly its
/// change of volume; the second side of a sheet has the negative value of the first.
class Sources {
 public:
  /// has_twins: second sides of sheets have volume accelerations of their own.
  Sources(const Surfaces& surfaces, double sample_rate_hz, double sound_speed_m_s, bool has_poles, bool has_twins);

  /// Consumes the motion of samples k to k + kBatch - 1, called successively from -MotionFilter::kBefore on. Returns the first of kBatch
  /// samples that are ready for emission; none before sample 0.
  std::optional<std::int64_t> calc(const MotionFilter& motion, std::int64_t k);
  /// Volume accelerations of sample k of these [m3/s2], from a block-aligned slot on.
  Frames get(std::size_t slot, std::int64_t k) { return rates_.get(slot, k); }
  /// P of sample k of these (slots) [m3/s], E14.
  const double* get_poles(std::int64_t k) const { return poles_[static_cast<std::size_t>(k) % poles_.size()].get(); }
  double get_pole_rate(std::size_t run) const { return pole_[run].rate_per_s; }

  template <typename Visit>
  void visit_state(Visit&& visit) {
    visit(flux_.get_blocks(), rates_.get_blocks());
    for (Rows& one : poles_) visit(one.get_blocks());
  }

 private:
  void calc_poles(std::int64_t first);

  const Surfaces& surfaces_;
  const RowLoops* loops_ = &find_loops();
  double sample_rate_hz_;
  bool has_poles_, has_twins_;
  std::array<double, kDerivativeHalf + 1> derivative_ = make_derivative();
  std::vector<recording::Pole> pole_;   // (runs)
  Ring flux_, rates_;                   // m3 per sample times the sample rate; m3/s2
  std::array<Rows, kBatch + 1> poles_;  // (slots) of the last batch and the sample before it
};

}  // namespace carillon::emission
