#include "precompute/eigen/mode_sums.hpp"

#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::eigen::HWY_NAMESPACE {
namespace {

using la::NodeMatrix;
using Row = NodeMatrix::Row;
constexpr int kWidth = CARILLON_REGISTER_BYTES / sizeof(double);
typedef double Vector __attribute__((vector_size(8 * kWidth), may_alias));
constexpr int kVectors = NodeMatrix::kStrip / kWidth;

// Loops over the sums are unrolled: GCC 12 spills them to memory otherwise.
void add_sums(std::size_t rows, const Row* phi_rows, const Row* m_rows, const Row* k_rows, const double* diagonal, const Row& lambda,
              Sums& sums) {
  const auto* phi = reinterpret_cast<const Vector*>(phi_rows);
  const auto* m_phi = reinterpret_cast<const Vector*>(m_rows);
  const auto* k_phi = reinterpret_cast<const Vector*>(k_rows);
  auto* total = reinterpret_cast<Vector*>(sums.data());
#pragma GCC unroll 2
  for (int v = 0; v < kVectors; ++v) {
    Vector sum[kSums];
#pragma GCC unroll 6
    for (int k = 0; k < kSums; ++k) sum[k] = Vector{};
    const Vector by = reinterpret_cast<const Vector*>(&lambda)[v];
    for (std::size_t i = 0; i < rows; ++i) {
      const Vector own = phi[i * kVectors + v];
      const Vector m = m_phi[i * kVectors + v];
      const Vector r = k_phi[i * kVectors + v] - by * m;
      const Vector d = diagonal[i] * own;
      sum[kPhiMPhi] += own * m;
      sum[kPhiR] += own * r;
      sum[kRR] += r * r;
      sum[kRMPhi] += r * m;
      sum[kMPhiMPhi] += m * m;
      sum[kDiagonal] += d * d;
    }
#pragma GCC unroll 6
    for (int k = 0; k < kSums; ++k) total[k * kVectors + v] += sum[k];
  }
}

}  // namespace
}  // namespace carillon::eigen::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::eigen {

HWY_EXPORT(add_sums);

void add_sums(std::size_t rows, const la::NodeMatrix::Row* phi, const la::NodeMatrix::Row* m_phi, const la::NodeMatrix::Row* k_phi,
              const double* diagonal, const la::NodeMatrix::Row& lambda, Sums& total) {
  base::choose(HWY_DISPATCH_TABLE(add_sums))(rows, phi, m_phi, k_phi, diagonal, lambda, total);
}

}  // namespace carillon::eigen
#endif
