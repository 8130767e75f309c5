// Method: Refinement reduces residuals below the tolerance; residuals limited by rounding of K are measured through the inverse; a cluster
// of degenerate modes gets a basis that depends only on its span.
// Source: Parlett, The symmetric eigenvalue problem, 1998, section 4.5. Refinement: refine.cpp.
#include "precompute/eigen/finish.hpp"

#include <fmt/core.h>
#include <petscmat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/eigen/check_modes.hpp"
#include "precompute/eigen/proof.hpp"
#include "precompute/eigen/refine.hpp"
#include "precompute/eigen/types.hpp"
#include "precompute/la/lapack.hpp"
#include "precompute/la/local_columns.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {
namespace {

using la::LocalColumns;
using petsc::check;

// Method: Modes that agree to the tolerance may be mixtures of modes that differ by more than rounding. Their span is far more accurate
// than the modes: Rayleigh-Ritz in it with K - mean M, so that differences keep their digits, separates them as far as possible
// (split_clusters). For a remaining cluster Phi, the symmetric matrix Phi^T D Phi, D = diag(m_i w_d(x_i)) with smooth weights w_d without
// symmetry, has eigenvectors that depend only on the span. The basis is Phi times these, by ascending eigenvalue. If two eigenvalues of one
// form nearly coincide, another form is used: the first of a fixed list that separates them well, or the best of the list.
// Source: Stewart, Sun, Matrix perturbation theory, 1990, chapter V: an eigenvector moves by the perturbation over the gap. Parlett, The
// symmetric eigenvalue problem, 1998, section 11.4 (Rayleigh-Ritz in a span).

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

/// Groups of consecutive modes that agree in lambda to a quarter of the tolerance, or to the rounding of K (errors.floor), so that the
/// iteration may have mixed them. lambda: ascending. Not collective.
std::vector<Cluster> find_groups(const std::vector<double>& lambda, const ModeErrors& errors, double tolerance) {
  return find_runs(lambda, errors, std::clamp(kMixture * tolerance, kTightest, kLoosest));
}

/// Separates the modes of each group as far as rounding allows and returns the remaining clusters: neighbours that agree to 1e-12 of
/// lambda, or to the rounding of K. Shapes and lambda become those of the separated modes, ascending. Collective.
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

/// Replaces the shapes of each cluster by the basis that diagonalises a fixed quadratic form of node positions, masses and displacements,
/// ascending; it depends only on the span. All modes of a cluster get its mean lambda. Collective.
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

constexpr double kMaxResidual = 1e-4;  // Largest residual accepted as rounding; a bank rejects larger ones.
constexpr int kMaxBases = 3;           // attempts at a basis of degenerate modes whose residuals added up

/// lambda, shapes and errors of the same modes; each step leaves errors as last measured.
class Finisher {
 public:
  Finisher(const BandProblem& body, InertiaCounter* counter, Modes& modes) : body_(body), counter_(counter), modes_(modes) {}
  void run();

 private:
  RefineRequest make_request(double tolerance);
  InertiaCounter& get_counter();
  template <class Step>
  void add_cost(Step&& step);
  void bound_errors();
  void refine(double tolerance);
  void canonicalise();
  double find_worst() const;
  void check_residuals() const;

  const BandProblem& body_;
  InertiaCounter* counter_;
  Modes& modes_;
  std::optional<InertiaCounter> own_counter_;  // used if none was given
  ModeErrors errors_;
};

InertiaCounter& Finisher::get_counter() {
  if (counter_ == nullptr) {
    counter_ = &own_counter_.emplace(body_.pencil, body_.problem, body_.options, body_.rigid, modes_.seconds, modes_.factor,
                                     [this](double lambda) { return body_.to_hz(lambda); });
  }
  return *counter_;
}

RefineRequest Finisher::make_request(double tolerance) {
  RefineRequest request;
  request.operators = &body_.operators;
  request.tolerance = tolerance;
  if (counter_ != nullptr) request.at_hand = counter_->current_factor();
  request.get_factor = [this]() -> ShiftedFactor& { return get_counter().get_factor(); };
  request.switch_to_pivoting_solver = [this] { return get_counter().switch_to_mumps(); };
  return request;
}

/// Refinement uses its own factor: keeps the statistics of the solve and adds the costs.
template <class Step>
void Finisher::add_cost(Step&& step) {
  const FactorStatistics before = modes_.factor;
  const RefineCost cost = step();
  modes_.factor = before;
  modes_.factor.factorisations += cost.factorisations;
  modes_.factor.solves += cost.solves;
}

/// Measures modes whose residual is limited by rounding through the inverse.
void Finisher::bound_errors() {
  const RefineRequest request = make_request(body_.options.tolerance);
  add_cost([&] { return bound_error_by_inverse_residual(request, modes_.lambda, modes_.shapes, errors_); });
}

/// Reduces every residual below `tolerance` if possible; throws if the tolerance of the options is not reached.
void Finisher::refine(double tolerance) {
  const RefineRequest request = make_request(tolerance);
  add_cost([&] { return refine_modes(request, modes_.lambda, modes_.shapes, errors_); });
  for (std::size_t j = 0; j < errors_.residual.size(); ++j) {
    if (is_accepted(errors_, j, body_.options.tolerance)) continue;
    throw SolveError(
        fmt::format("Mode {} at {:.6g} Hz has the relative residual {:.2g}, above the tolerance {:.2g} and above what rounding "
                    "explains ({:.2g}). Take a looser tolerance, or correct the thinnest elements of the mesh.",
                    j, body_.to_hz(modes_.lambda[j]), errors_.residual[j], body_.options.tolerance, errors_.floor[j]));
  }
}

/// Makes the basis of degenerate or nearly degenerate modes canonical and measures all modes again.
void Finisher::canonicalise() {
  const std::vector<Cluster> groups = find_groups(modes_.lambda, errors_, body_.options.tolerance);
  modes_.proof.clusters = split_clusters(body_.operators, groups, errors_, modes_.lambda, modes_.shapes);
  if (groups.empty()) return;
  make_canonical(body_.operators, body_.problem.nodes, modes_.proof.clusters, modes_.lambda, modes_.shapes);
  std::vector<double> quotients = modes_.lambda;
  errors_ = normalise_and_measure(body_.operators, quotients, modes_.shapes);
}

/// Largest residual relative to its accepted value.
double Finisher::find_worst() const {
  double worst = 0;
  for (std::size_t j = 0; j < errors_.residual.size(); ++j)
    worst = std::max(worst, errors_.residual[j] / std::max(body_.options.tolerance, errors_.floor[j]));
  return worst;
}

void Finisher::check_residuals() const {
  for (std::size_t j = 0; j < errors_.residual.size(); ++j) {
    if (errors_.residual[j] <= std::max(kMaxResidual, body_.options.tolerance)) continue;
    throw SolveError(
        fmt::format("Mode {} at {:.6g} Hz: its relative residual of {:.2g} is limited by rounding of K, and above {:g}. Raise the "
                    "lower end of the band, or correct the stiffest elements: thin ones, or their material.",
                    j, body_.to_hz(modes_.lambda[j]), errors_.residual[j], kMaxResidual));
  }
}

void Finisher::run() {
  refine(body_.options.tolerance);
  bound_errors();
  canonicalise();
  // In a basis of degenerate modes residuals mix: many within the tolerance may add up to one above it.
  double aim = body_.options.tolerance;
  for (int i = 0; i < kMaxBases && find_worst() > 1; ++i) {
    aim *= 0.5 / find_worst();
    refine(aim);
    canonicalise();
  }
  bound_errors();
  check_residuals();
  if (counter_ != nullptr) counter_->release();
  modes_.residual = errors_.residual;
  modes_.orthonormality_error = errors_.orthonormality;
}

// Modes beyond max_modes that completed the cluster of the last one.
void drop_beyond(std::int64_t limit, Modes& modes) {
  if (static_cast<std::int64_t>(modes.lambda.size()) <= limit) return;
  modes.lambda.resize(limit);
  modes.residual.resize(limit);
  std::vector<Cluster>& clusters = modes.proof.clusters;
  for (Cluster& cluster : clusters) cluster.count = std::min(cluster.count, limit - cluster.first);
  std::erase_if(clusters, [](const Cluster& cluster) { return cluster.count < 2; });
  petsc::MatHandle kept;
  Mat view = nullptr;
  check(MatDenseGetSubMatrix(modes.shapes, PETSC_DECIDE, PETSC_DECIDE, 0, petsc::to_petsc_int(limit), &view));
  check(MatDuplicate(view, MAT_COPY_VALUES, kept.out()));
  check(MatDenseRestoreSubMatrix(modes.shapes, &view));
  modes.shapes = std::move(kept);
}

// The counts stay valid; refinement may have moved adjacent modes by some digits.
void measure_margins(const BandProblem& body, const std::vector<double>& others, Modes& modes) {
  for (Count& count : modes.proof.counts) {
    const double at = body.scaling.to_scaled(std::pow(2 * std::numbers::pi * count.freq_hz, 2));
    count.margin = std::min(find_margin(modes.lambda, at), find_margin(others, at));
  }
}

}  // namespace

void finish_modes(const BandProblem& body, InertiaCounter* counter, const std::vector<double>& others, Modes& modes) {
  if (modes.lambda.empty()) return;
  Finisher(body, counter, modes).run();
  measure_margins(body, others, modes);
  orient_shapes(modes.shapes, body.problem.nodes.nodes_m);
  drop_beyond(body.options.max_modes.value_or(std::numeric_limits<PetscInt>::max()), modes);
  modes.above_tolerance_count =
      std::count_if(modes.residual.begin(), modes.residual.end(), [&](double residual) { return residual > body.options.tolerance; });
  check(MatScale(modes.shapes, body.scaling.get_shape_factor()));
  for (double& lambda : modes.lambda) lambda = body.scaling.from_scaled(lambda);
}

}  // namespace carillon::eigen
