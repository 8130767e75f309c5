// Method: phi'_i = sum over j of part_ij phi_j, quantised again, each mode with its own scale. The solid's damping does no work between its
//   modes: decays are sums with squared parts. Modal masses including the air are 1.
// Source: docs/equations.md E10.
// Deviations: strain energy shares near supports neglect cross terms of modes.
#include "runtime/bank/mixing.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace carillon::bank {
namespace {

/// Shapes of the modes in air, vertex by vertex.
class MixedRows {
 public:
  explicit MixedRows(const Bank& bank) : bank_(bank), rigid_(bank.rigid), row_(bank.mode_count()) {}

  /// (m) at a vertex.
  const std::vector<Vec3>& calc(std::size_t vertex) {
    const Mixing& mixing = bank_.multipoles.mixing;
    std::array<Vec3, kRigidMotions> rigid{};
    for (std::size_t r = 0; r < kRigidMotions; ++r) rigid[r] = rigid_.find(r, bank_.vertices_m[vertex]);
    std::size_t at = 0;
    for (std::size_t i = 0; i < row_.size(); ++i) {
      Vec3 sum{};
      for (std::int32_t k = 0; k < mixing.count[i]; ++k, ++at) {
        const std::size_t j = mixing.motion[at];
        sum = sum + mixing.part[at] * (j < row_.size() ? bank_.shape_at(vertex, j) : rigid[j - row_.size()]);
      }
      row_[i] = sum;
    }
    return row_;
  }

 private:
  const Bank& bank_;
  RigidMotions rigid_;
  std::vector<Vec3> row_;
};

void mix_shapes(Bank& bank) {
  MixedRows rows(bank);
  const std::size_t modes = bank.mode_count();
  std::vector<double> scale(modes, 0.0);
  for (std::size_t v = 0; v < bank.vertex_count(); ++v) {
    const std::vector<Vec3>& row = rows.calc(v);
    for (std::size_t i = 0; i < modes; ++i)
      for (const double x : row[i]) scale[i] = std::max(scale[i], std::abs(x));
  }
  for (double& s : scale) s = calc_shape_scale(s);
  for (std::size_t v = 0; v < bank.vertex_count(); ++v) {
    const std::vector<Vec3>& row = rows.calc(v);  // read before it is overwritten
    for (std::size_t i = 0; i < modes; ++i)
      for (std::size_t c = 0; c < 3; ++c) bank.shape[(v * modes + i) * 3 + c] = find_step(row[i][c], scale[i]);
  }
  bank.shape_scale = std::move(scale);
  bank.shape_bytes = 2;
  bank.packing.reset();
}

}  // namespace

RigidMotions::RigidMotions(const RigidBody& rigid) : centre_m_(rigid.centre_m), translation_(1.0 / std::sqrt(rigid.mass_kg)) {
  const std::array<double, 9>& inertia = rigid.inertia_kg_m2;
  std::array<std::array<double, 3>, 3> lower{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = inertia[3 * i + j];
      for (std::size_t k = 0; k < j; ++k) sum -= lower[i][k] * lower[j][k];
      lower[i][j] = i == j ? std::sqrt(sum) : sum / lower[j][j];
    }
  for (std::size_t motion = 0; motion < 3; ++motion)  // L^T x = unit vector
    for (std::size_t i = 3; i-- > 0;) {
      double sum = i == motion ? 1.0 : 0.0;
      for (std::size_t k = i + 1; k < 3; ++k) sum -= lower[k][i] * rotation_[motion][k];
      rotation_[motion][i] = sum / lower[i][i];
    }
}

Vec3 RigidMotions::find(std::size_t motion, const Vec3& place_m) const {
  if (motion >= 3) return cross(rotation_[motion - 3], place_m - centre_m_);
  Vec3 shift{};
  shift[motion] = translation_;
  return shift;
}

void mix_modes(Bank& bank) {
  Mixing& mixing = bank.multipoles.mixing;
  if (mixing.is_empty()) return;
  mix_shapes(bank);
  const std::size_t modes = bank.mode_count(), supports = bank.supports.count();
  const bool is_corrected = !bank.corrected.is_empty();  // not yet applied
  std::vector<double> decay(modes), corrected(is_corrected ? modes : 0), reaction(bank.supports.reaction.size()),
      energy(bank.supports.energy.size());
  std::size_t at = 0;
  for (std::size_t i = 0; i < modes; ++i) {
    double strain = 0.0;
    for (std::int32_t k = 0; k < mixing.count[i]; ++k, ++at) {
      const std::size_t j = mixing.motion[at];
      if (j >= modes) continue;  // rigid motion: undamped, unsupported
      const double part = mixing.part[at], share = part * part * bank.eigenvalue_rad2_s2[j];
      decay[i] += part * part * bank.decay_per_s[j];
      if (is_corrected) corrected[i] += part * part * bank.corrected.decay_per_s[j];
      strain += share;
      for (std::size_t s = 0; s < 6 * supports; ++s) reaction[i * 6 * supports + s] += part * bank.supports.reaction[j * 6 * supports + s];
      for (std::size_t s = 0; s < supports; ++s) energy[i * supports + s] += share * bank.supports.energy[j * supports + s];
    }
    for (std::size_t s = 0; s < supports && strain > 0.0; ++s) energy[i * supports + s] /= strain;
  }
  bank.decay_per_s = std::move(decay);
  bank.corrected.decay_per_s = std::move(corrected);
  bank.supports.reaction = std::move(reaction);
  bank.supports.energy = std::move(energy);
  mixing = {};
}

}  // namespace carillon::bank
