// Method: Modes that agree to the tolerance may be mixtures of modes that differ by more than rounding. Their span is far more accurate
// than the modes: Rayleigh-Ritz in it with K - mean M, so that differences keep their digits, separates them as far as possible
// (split_clusters). For a remaining cluster Phi, the symmetric matrix Phi^T D Phi, D = diag(m_i w_d(x_i)) with smooth weights w_d without
// symmetry, has eigenvectors that depend only on the span. The basis is Phi times these, by ascending eigenvalue. If two eigenvalues of one
// form nearly coincide, another form is used: the first of a fixed list that separates them well, or the best of the list.
// Source: Stewart, Sun, Matrix perturbation theory, 1990, chapter V: an eigenvector moves by the perturbation over the gap. Parlett, The
// symmetric eigenvalue problem, 1998, section 11.4 (Rayleigh-Ritz in a span).
#include "precompute/eigen/canonical.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "precompute/comm/communicator.hpp"
#include "precompute/la/lapack.hpp"
#include "precompute/la/local_columns.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {
namespace {

using la::LocalColumns;
using petsc::check;

constexpr int kForms = 12;
constexpr double kMixture = 0.25;    // Relative to the tolerance: a mixture of modes this close has residuals below the tolerance.
constexpr double kLoosest = 2.5e-9;  // Upper limit, for loose tolerances,
constexpr double kTightest = 1e-12;  // and lower limit by rounding.
constexpr double kGoodGap = 0.05;    // Relative to 1 / size^2, as the eigenvalues of a large cluster are dense.

// Bounding box of all bodies: centre and half the diagonal, the same for every partition.
struct Box {
  Vec3 centre{};
  double size = 1;
};

Box find_box(const comm::Communicator& comm, const std::vector<Vec3>& nodes_m) {
  std::array<double, 6> ends;  // largest x, y, z and largest -x, -y, -z
  ends.fill(-std::numeric_limits<double>::infinity());
  for (const Vec3& x : nodes_m) {
    for (std::size_t d = 0; d < 3; ++d) {
      ends[d] = std::max(ends[d], x[d]);
      ends[3 + d] = std::max(ends[3 + d], -x[d]);
    }
  }
  comm.max(ends);
  Box box;
  double square = 0;
  for (std::size_t d = 0; d < 3; ++d) {
    box.centre[d] = 0.5 * (ends[d] - ends[3 + d]);
    square += std::pow(0.5 * (ends[d] + ends[3 + d]), 2);
  }
  if (square > 0) box.size = std::sqrt(square);
  return box;
}

// Weight of a displacement at a node, without symmetry in position, direction and component. Frequencies and phases are multiples of
// irrational numbers, so that no two forms agree.
double calc_weight(const Box& box, const Vec3& x, std::int32_t component, std::size_t direction, int form) {
  const double f = 1.0 + form;
  const auto d = static_cast<double>(direction);
  const std::array<double, 3> wave{std::fmod(1.3247179572 * f, 2.0) + 0.7, std::fmod(1.7548776662 * f, 2.0) + 0.9,
                                   std::fmod(1.4655712319 * f, 2.0) + 0.8};
  double phase = 0.6180339887 * f + 1.2360679775 * d + 0.8191725134 * component;
  for (std::size_t i = 0; i < 3; ++i) phase += wave[i] * (x[i] - box.centre[i]) / box.size;
  return std::sin(phase) + 0.31 * std::cos(1.8392867552 * phase + 0.5 * d);
}

// Eigenvalues, ascending, of a symmetric matrix known on every rank; it is replaced by its eigenvectors. All ranks take the results of rank
// 0, so that decisions agree. Collective. Throws SolveError(failure) on every rank if LAPACK fails.
la::Vector diagonalise(const comm::Communicator& comm, la::Matrix& matrix, const std::string& failure) {
  la::Vector values(matrix.rows());
  comm.agree([&] {
    if (comm.is_root() && la::calc_eigenpairs(matrix, values) != 0) throw SolveError(failure + " (LAPACK dsyev failed).");
  });
  comm.broadcast_into(la::entries(matrix));
  comm.broadcast_into(la::entries(values));
  return values;
}

struct Basis {
  la::Matrix rotation;  // columns by ascending eigenvalue
  double gap = 0;       // smallest distance between two eigenvalues
};

Basis calc_basis(const Operators& operators, const NodeLayout& nodes, const Box& box, const Columns& phi, int form) {
  const std::size_t count = phi.count;
  std::vector<double> weight(phi.rows);
  for (std::size_t i = 0; i < weight.size(); ++i)
    weight[i] = operators.mass_diagonal[i] * calc_weight(box, nodes.nodes_m[i / 3], nodes.component[i / 3], i % 3, form);
  std::vector<double> space(weight.size() * count);
  const Columns weighted{space.data(), phi.rows, phi.rows, phi.count};
  for (int j = 0; j < phi.count; ++j) {
    for (std::size_t i = 0; i < weight.size(); ++i) weighted.column(j)[i] = weight[i] * phi.column(j)[i];
  }
  Basis basis{multiply_transposed(operators.comm, phi, weighted), std::numeric_limits<double>::infinity()};
  const la::Vector values = diagonalise(operators.comm, basis.rotation, "A cluster of degenerate modes has no canonical basis");
  for (Eigen::Index i = 1; i < values.size(); ++i) basis.gap = std::min(basis.gap, values[i] - values[i - 1]);
  return basis;
}

// Groups of consecutive modes whose neighbours agree to `equal`, or to rounding.
std::vector<Cluster> find_runs(const std::vector<double>& lambda, const ModeErrors& errors, double equal) {
  std::vector<Cluster> runs;
  for (std::size_t j = 1; j < lambda.size(); ++j) {
    const double open = std::max(equal, kMixture * std::min(errors.floor[j - 1], errors.floor[j]));
    if (lambda[j] - lambda[j - 1] > open * lambda[j]) continue;
    const auto at = static_cast<std::int64_t>(j);
    if (runs.empty() || runs.back().first + runs.back().count != at) runs.push_back({at - 1, 1});
    ++runs.back().count;
  }
  return runs;
}

// Eigenvectors of Phi^T (K - mean M) Phi and its eigenvalues, ascending; the same on every rank.
la::Vector calc_differences(const Operators& operators, const Columns& phi, double mean, la::Matrix& rotation) {
  const auto size = static_cast<std::size_t>(phi.rows) * static_cast<std::size_t>(phi.count);
  std::vector<double> space(2 * size);
  const Columns k_phi{space.data(), phi.rows, phi.rows, phi.count};
  const Columns m_phi{space.data() + size, phi.rows, phi.rows, phi.count};
  operators.stiffness.multiply(phi, k_phi);
  operators.mass.multiply(phi, m_phi);
  for (std::size_t i = 0; i < size; ++i) k_phi.values[i] -= mean * m_phi.values[i];
  rotation = multiply_transposed(operators.comm, phi, k_phi);
  return diagonalise(operators.comm, rotation, "A group of nearly degenerate modes cannot be separated");
}

}  // namespace

std::vector<Cluster> find_groups(const std::vector<double>& lambda, const ModeErrors& errors, double tolerance) {
  return find_runs(lambda, errors, std::clamp(kMixture * tolerance, kTightest, kLoosest));
}

std::vector<Cluster> split_clusters(const Operators& operators, const std::vector<Cluster>& groups, const ModeErrors& errors,
                                    std::vector<double>& lambda, Mat shapes) {
  if (groups.empty()) return {};
  const LocalColumns access(shapes);
  for (const Cluster& group : groups) {
    const Columns phi = access.view().part(static_cast<int>(group.first), static_cast<int>(group.count));
    const auto begin = lambda.begin() + group.first;
    const double mean = std::accumulate(begin, begin + group.count, 0.0) / static_cast<double>(group.count);
    la::Matrix rotation;
    const la::Vector differences = calc_differences(operators, phi, mean, rotation);
    combine_columns(phi, rotation.data(), phi.count);
    std::transform(differences.begin(), differences.end(), begin, [mean](double difference) { return mean + difference; });
  }
  return find_runs(lambda, errors, kTightest);
}

void make_canonical(const Operators& operators, const NodeLayout& nodes, const std::vector<Cluster>& clusters, std::vector<double>& lambda,
                    Mat shapes) {
  if (clusters.empty()) return;
  const Box box = find_box(operators.comm, nodes.nodes_m);
  const LocalColumns access(shapes);
  for (const Cluster& cluster : clusters) {
    const Columns phi = access.view().part(static_cast<int>(cluster.first), static_cast<int>(cluster.count));
    const double good = kGoodGap / static_cast<double>(cluster.count * cluster.count);
    Basis best = calc_basis(operators, nodes, box, phi, 0);
    for (int form = 1; form < kForms && best.gap < good; ++form) {
      Basis other = calc_basis(operators, nodes, box, phi, form);
      if (other.gap > best.gap) best = std::move(other);
    }
    combine_columns(phi, best.rotation.data(), phi.count);
    const auto begin = lambda.begin() + cluster.first;
    const double mean = std::accumulate(begin, begin + cluster.count, 0.0) / static_cast<double>(cluster.count);
    std::fill(begin, begin + cluster.count, mean);
  }
}

}  // namespace carillon::eigen
