// Method: Refinement reduces residuals below the tolerance; residuals limited by rounding of K are measured through the inverse; a cluster
// of degenerate modes gets a basis that depends only on its span.
// Source: Parlett, The symmetric eigenvalue problem, 1998, section 4.5. Refinement: refine.cpp; clusters: canonical.cpp.
#include "precompute/eigen/finish.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "precompute/eigen/canonical.hpp"
#include "precompute/eigen/check_modes.hpp"
#include "precompute/eigen/proof.hpp"
#include "precompute/eigen/refine.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

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
