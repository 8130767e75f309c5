// Method:     symmetric eigenproblem of all modes with the approximate mass matrix, then of the few modes in one mixture with the mass at
//   its own wave number. Eigenvectors of equal eigenvalues are arbitrary: the previous mixture is projected onto their space, so that two
//   modes never become equal.
// Source:     docs/equations.md E10.
#include "precompute/air/coupling.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "precompute/la/lapack.hpp"
#include "runtime/base/error.hpp"

namespace carillon::air {
namespace {

constexpr double kOneWave = 1e-4;  // relative difference of k^2 of degenerate modes
constexpr std::size_t kRunFacets = 128;

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct Problem {
  la::Matrix inertia;  // 1 + M
  la::Vector squares;  // k_i^2
  la::Matrix vectors;
  la::Vector values;

  Problem(std::span<const double> wave_number_1_m, std::span<const double> mass) {
    const auto n = static_cast<Eigen::Index>(wave_number_1_m.size());
    inertia = Eigen::Map<const Matrix>(mass.data(), n, n);
    inertia.diagonal().array() += 1.0;
    squares = Eigen::Map<const Eigen::VectorXd>(wave_number_1_m.data(), n).cwiseAbs2();
    vectors = squares.asDiagonal();
    la::Matrix destroyed = inertia;
    if (n == 0 || la::calc_generalised_eigenpairs(vectors, destroyed, values) != 0)
      throw InputError(
          "the added mass of a mode is below minus its modal mass, as in a cavity resonance, which this method cannot couple; "
          "end the band lower, or leave the air out with \"radiation\": \"none\"");
  }
};

Mixture make_mixture(const Problem& problem, Eigen::VectorXd parts, std::vector<std::int32_t> motions) {
  parts /= std::sqrt(parts.dot(problem.inertia * parts));
  const double own = parts.squaredNorm();
  return {.motions = std::move(motions),
          .parts = {parts.data(), parts.data() + parts.size()},
          .wave_number_1_m = std::sqrt(parts.cwiseAbs2().dot(problem.squares)),
          .added_mass = (1.0 - own) / own};
}

}  // namespace

std::vector<Mixture> couple_modes(std::span<const double> wave_number_1_m, std::span<const double> mass, double kept) {
  const Problem problem(wave_number_1_m, mass);
  const la::Matrix& vectors = problem.vectors;
  const std::size_t n = vectors.cols();
  // By decreasing part: each motion gets the mode in which it is largest.
  std::vector<std::size_t> order(n * n);
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return std::abs(vectors.data()[a]) > std::abs(vectors.data()[b]); });
  std::vector<bool> is_taken(n);
  std::vector<Mixture> mixtures(n);
  for (const std::size_t at : order) {
    const std::size_t motion = at % n, mode = at / n;  // column-major
    if (is_taken[mode] || !mixtures[motion].is_empty()) continue;
    is_taken[mode] = true;
    Eigen::VectorXd parts = vectors.col(static_cast<Eigen::Index>(mode));
    if (parts[static_cast<Eigen::Index>(motion)] < 0.0) parts = -parts;
    const double least = kept * parts.cwiseAbs().maxCoeff();
    Mixture& mixture = mixtures[motion];
    for (std::size_t i = 0; i < n; ++i) {
      const double part = parts[static_cast<Eigen::Index>(i)];
      if (std::abs(part) < least && i != motion) continue;
      mixture.motions.push_back(static_cast<std::int32_t>(i));
      mixture.parts.push_back(part);
    }
    mixture.wave_number_1_m = std::sqrt(std::max(0.0, problem.values[static_cast<Eigen::Index>(mode)]));
    mixture.added_mass = 1.0 / parts.squaredNorm() - 1.0;
  }
  return mixtures;
}

Mixture follow_mode(std::span<const double> wave_number_1_m, std::span<const double> mass, const Mixture& before) {
  const Problem problem(wave_number_1_m, mass);
  const la::Matrix& vectors = problem.vectors;
  const la::Vector& values = problem.values;
  const Eigen::VectorXd old = Eigen::Map<const Eigen::VectorXd>(before.parts.data(), static_cast<Eigen::Index>(before.parts.size()));
  const Eigen::VectorXd overlap = vectors.transpose() * (problem.inertia * old);
  Eigen::Index best = 0;
  overlap.cwiseAbs().maxCoeff(&best);
  Eigen::VectorXd parts = Eigen::VectorXd::Zero(old.size());
  for (Eigen::Index i = 0; i < values.size(); ++i)
    if (std::abs(values[i] - values[best]) <= kOneWave * std::abs(values[best])) parts += overlap[i] * vectors.col(i);
  return make_mixture(problem, parts, before.motions);
}

std::vector<std::complex<double>> calc_reaction_rows(const BoundaryEquations& equations, std::span<const std::complex<float>> pressure,
                                                     std::size_t sides) {
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const std::vector<Facet>& facets = equations.get_surface().get_facets();
  const std::size_t count = equations.count_velocities();
  const auto columns = static_cast<Eigen::Index>(2 * sides);
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(columns, static_cast<Eigen::Index>(count));
  for (std::size_t first = 0; first < facets.size(); first += kRunFacets) {
    const std::size_t run = std::min(kRunFacets, facets.size() - first);
    Rows loads(static_cast<Eigen::Index>(3 * run), columns);  // pressure times the facet's mass matrix, at its corners
    for (std::size_t t = 0; t < run; ++t) {
      const Facet& facet = facets[first + t];
      const auto share = static_cast<float>(facet.area_m2 / 12.0);
      std::array<const float*, 3> p{};
      for (std::size_t c = 0; c < 3; ++c)
        p[c] = reinterpret_cast<const float*>(&pressure[static_cast<std::size_t>(facet.corners[c]) * sides]);
      for (std::size_t c = 0; c < 3; ++c)
        for (Eigen::Index m = 0; m < columns; ++m)
          loads(static_cast<Eigen::Index>(3 * t + c), m) = share * (p[0][m] + p[1][m] + p[2][m] + p[c][m]);
    }
    const Eigen::Map<const Rows> velocity(equations.get_velocity().data() + first * 3 * count, static_cast<Eigen::Index>(3 * run),
                                          static_cast<Eigen::Index>(count));
    sums += (loads.transpose() * velocity).cast<double>();
  }
  std::vector<std::complex<double>> rows(sides * count);
  for (std::size_t m = 0; m < sides; ++m)
    for (std::size_t i = 0; i < count; ++i) {
      const auto at = static_cast<Eigen::Index>(2 * m), column = static_cast<Eigen::Index>(i);
      rows[m * count + i] = {sums(at, column), sums(at + 1, column)};
    }
  return rows;
}

}  // namespace carillon::air
