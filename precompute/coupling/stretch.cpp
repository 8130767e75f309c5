// Method:     the mean stress of a body without loads is the sum of position times traction over its surface, 0 if nothing holds it. A
//   field with a nonzero mean is therefore due to held edges, and the ones with the largest energy are the tension that rises as the body
//   bends.
// Source:     docs/equations.md E13.
#include "precompute/coupling/stretch.hpp"

#include <algorithm>
#include <cmath>

#include "precompute/coupling/products.hpp"

namespace carillon::coupling {

la::Vector calc_mean_shares(const CoupledBody& body, const StressFields& fields, std::ptrdiff_t count) {
  std::vector<double> sums(6 * count + 1, 0.0);  // per field, and the volume
  body.comm.agree([&] {
    ElementPoints points;
    for (std::int32_t e = 0; e < body.strains.element_count(); ++e) {
      body.strains.calc_points(e, points);
      for (int p = 0; p < points.point_count(); ++p) {
        const double volume = points.volume_m3[p];
        sums.back() += volume;
        for (std::ptrdiff_t r = 0; r < count; ++r)
          for (int c = 0; c < 6; ++c) sums[6 * r + c] += std::sqrt(volume) * fields.values(body.strains.first_row(e) + 6 * p + c, r);
      }
    }
  });
  body.comm.sum(sums);
  la::Vector shares(count);
  for (std::ptrdiff_t r = 0; r < count; ++r) shares[r] = Eigen::Map<const la::Vector>(&sums[6 * r], 6).squaredNorm() / sums.back();
  return shares;
}

void keep_stretch(const CoupledBody& body, StressFields& fields) {
  constexpr std::ptrdiff_t kSeen = 12;
  const la::Vector shares = calc_mean_shares(body, fields, std::min(kSeen, fields.form.rows()));
  body.comm.agree([&] {
    std::vector<std::ptrdiff_t> kept;
    for (std::ptrdiff_t r = 0; r < shares.size() && static_cast<std::ptrdiff_t>(kept.size()) < kMaxStretchRows; ++r)
      if (shares[r] >= kMeanShare) kept.push_back(r);
    fields.form = la::Matrix(fields.form(kept, Eigen::all));
    fields.linear = la::Matrix(fields.linear(kept, Eigen::all));
    fields.values = la::Matrix(fields.values(Eigen::all, kept));
    const la::Matrix eta = multiply(fields.form, fields.tests.products), bias = multiply(fields.linear, fields.tests.q);
    const la::Vector energy = 0.5 * eta.colwise().squaredNorm().transpose(), cubic = eta.cwiseProduct(bias).colwise().sum().transpose();
    fields.error = calc_error(energy, cubic, fields.full, fields.cubic);
  });
}

}  // namespace carillon::coupling
