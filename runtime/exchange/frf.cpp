// Source: Ewins 2000, "Modal Testing", 2.4 (viscous damping) and 2.10 (free bodies).
#include "runtime/exchange/frf.hpp"

#include <cmath>
#include <cstdlib>
#include <numbers>

namespace carillon::exchange {
namespace {

constexpr std::int64_t kFreeModes = 6;

/// Acceleration along `response_axis` per force along `reference_axis` of the rigid body [1/kg].
double calc_rigid(const bank::Bank& bank, const Vec3& response_m, const Vec3& response_axis, const Vec3& reference_m,
                  const Vec3& reference_axis) {
  const Mat3 inertia = make_matrix(bank.rigid.inertia_kg_m2);
  const Vec3 torque = cross(reference_m - bank.rigid.centre_m, reference_axis);
  const double det = calc_det(inertia[0], inertia[1], inertia[2]);
  const Vec3 spin = (1.0 / det) * (torque[0] * cross(inertia[1], inertia[2]) + torque[1] * cross(inertia[2], inertia[0]) +
                                   torque[2] * cross(inertia[0], inertia[1]));  // symmetric
  return dot(response_axis, (1.0 / bank.rigid.mass_kg) * reference_axis + cross(spin, response_m - bank.rigid.centre_m));
}

}  // namespace

Vec3 find_axis(int direction) {
  Vec3 axis{};
  if (const int k = std::abs(direction); k >= 1 && k <= 3) axis[static_cast<std::size_t>(k - 1)] = direction > 0 ? 1.0 : -1.0;
  return axis;
}

int find_direction(const Vec3& along) {
  std::size_t k = 0;
  for (std::size_t c = 1; c < 3; ++c)
    if (std::abs(along[c]) > std::abs(along[k])) k = c;
  return along[k] < 0.0 ? -static_cast<int>(k) - 1 : static_cast<int>(k) + 1;
}

std::vector<std::complex<double>> calc_frf(const bank::Bank& bank, const StruckPoint& response, const Vec3& response_axis,
                                           const StruckPoint& reference, const Vec3& reference_axis, Motion motion,
                                           const std::vector<double>& freq_hz) {
  const double rigid =
      bank.counts.rigid_modes == kFreeModes ? calc_rigid(bank, response.point_m, response_axis, reference.point_m, reference_axis) : 0.0;
  std::vector<double> residue;
  for (std::size_t m = 0; m < bank.mode_count(); ++m)
    residue.push_back(dot(response.shape[m], response_axis) * dot(reference.shape[m], reference_axis));
  std::vector<std::complex<double>> values;
  values.reserve(freq_hz.size());
  for (const double hz : freq_hz) {
    const double omega = 2.0 * std::numbers::pi * hz;
    std::complex<double> sum = -rigid / (omega * omega);
    for (std::size_t m = 0; m < residue.size(); ++m) {
      const double stiff = bank.eigenvalue_rad2_s2[m] - omega * omega, loss = 2.0 * bank.decay_per_s[m] * omega;
      sum += residue[m] / (stiff * stiff + loss * loss) * std::complex(stiff, -loss);
    }
    values.push_back(motion == Motion::kDisplacement ? sum
                     : motion == Motion::kVelocity   ? std::complex(0.0, omega) * sum
                                                     : -omega * omega * sum);
  }
  return values;
}

}  // namespace carillon::exchange
