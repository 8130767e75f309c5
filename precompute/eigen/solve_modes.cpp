// Method: 1. The rigid modes are built in closed form and deflated. 2. The inertia of K - lambda M at both ends of the band gives the
// number of modes (band.cpp). 3. These are searched slice by slice (search.cpp). 4. Every count, including those at the shifts, must agree
// with the modes found below it (proof.cpp). 5. Modes are refined, clusters get a canonical basis, residuals and orthonormality are
// measured from K and M (finish.cpp). Small problems are solved densely.
// Source: Grimes, Lewis, Simon, A shifted block Lanczos algorithm, SIAM J. Matrix Anal. Appl. 15(1), 1994 (counts and slices); Parlett, The
// symmetric eigenvalue problem, 1998, section 3.3 (inertia).
#include "precompute/eigen/solve_modes.hpp"

#include <fmt/core.h>
#include <petscmat.h>

#include <algorithm>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "precompute/eigen/band.hpp"
#include "precompute/eigen/check_input.hpp"
#include "precompute/eigen/finish.hpp"
#include "precompute/eigen/memory.hpp"
#include "precompute/eigen/predict_cost.hpp"
#include "precompute/eigen/proof.hpp"
#include "precompute/eigen/search.hpp"
#include "precompute/eigen/timer.hpp"
#include "precompute/la/lapack.hpp"
#include "precompute/la/local_columns.hpp"
#include "precompute/la/pencil.hpp"
#include "precompute/petsc/handle.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/petsc/work.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {
namespace {

using la::LocalColumns;
using petsc::check;

// Method: Cholesky of M, L^-1 K L^-T to tridiagonal form, divide and conquer. Rank 0 solves the gathered matrices; every rank keeps its
// rows of the result.
// Source: Golub, Van Loan, Matrix Computations, sections 8.4 and 8.7; LAPACK dsygvd (five times as fast as the QR of dsygv).

struct DensePairs {
  std::vector<double> lambda;  // (n), ascending
  petsc::MatHandle vectors;    // (n, n) dense, M-orthonormal columns, the row distribution of K
};

constexpr double kEigenFlops =
    9;  // times n^3 at most: reduction of both matrices, divide and conquer, back-transformation (Golub, Van Loan, 8.3 to 8.7)

// `factor` times the whole matrix, on every rank.
la::Matrix gather_dense(Mat matrix, double factor, PetscInt n) {
  const comm::Communicator comm = petsc::get_communicator(matrix);
  la::Matrix dense = comm.agree([&] { return la::Matrix(la::Matrix::Zero(n, n)); });
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(matrix, &first, &last));
  for (PetscInt row = first; row < last; ++row) {
    PetscInt count = 0;
    const PetscInt* columns = nullptr;
    const PetscScalar* values = nullptr;
    check(MatGetRow(matrix, row, &count, &columns, &values));
    for (PetscInt k = 0; k < count; ++k) dense(row, columns[k]) = factor * values[k];
    check(MatRestoreRow(matrix, row, &count, &columns, &values));
  }
  comm.sum(la::entries(dense));
  return dense;
}

/// Solves K x = lambda M x completely with dense matrices on every rank. Collective; memory per rank grows as n^2, time as n^3. Throws
/// SolveError if M is not positive definite.
DensePairs solve_dense(const la::Pencil& pencil) {
  const Mat stiffness = pencil.stiffness;
  PetscInt n = 0;
  check(MatGetSize(stiffness, &n, nullptr));
  la::Matrix k = gather_dense(stiffness, pencil.stiffness_factor, n);
  la::Matrix m = gather_dense(pencil.mass, pencil.mass_factor, n);
  la::Vector lambda(n);
  const comm::Communicator comm = petsc::get_communicator(stiffness);
  comm.agree([&] {
    if (!comm.is_root()) return;
    const int info = la::calc_generalised_eigenpairs_by_division(k, m, lambda);
    petsc::add_flops(kEigenFlops * static_cast<double>(n) * n * n);
    if (info != 0) {
      throw SolveError(fmt::format("The dense eigensolver failed (LAPACK dsygvd: {}){}", info,
                                   info > n ? ": the mass matrix is not positive definite. Look for elements without volume." : "."));
    }
  });
  m.resize(0, 0);
  comm.broadcast_into(la::entries(k));
  comm.broadcast_into(la::entries(lambda));
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(stiffness, &first, &last));
  DensePairs pairs;
  pairs.lambda.assign(lambda.begin(), lambda.end());
  check(MatCreateDense(comm, last - first, PETSC_DECIDE, n, n, nullptr, pairs.vectors.out()));
  {
    const LocalColumns own(pairs.vectors);
    for (PetscInt j = 0; j < n; ++j) std::copy_n(k.col(j).data() + first, last - first, own.column(j));
  }
  check(MatAssemblyBegin(pairs.vectors, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(pairs.vectors, MAT_FINAL_ASSEMBLY));
  return pairs;
}

constexpr double kDenseMechanismTolerance =
    1e3;  // Factor on BandProblem::rounding(): smaller eigenvalues are zero within the accuracy of LAPACK.

// Sets lambda and band_count; returns the order of the wanted modes.
WantedModes take_wanted(const BandProblem& body, const BandLimits& limits, const std::vector<double>& lambda, Modes& modes) {
  WantedModes wanted = select_wanted(lambda, limits, body.options.max_modes);
  // The counts were taken slightly outside the band.
  if (!body.options.max_modes || wanted.within < std::min(modes.band_count, *body.options.max_modes)) modes.band_count = wanted.within;
  for (const std::size_t i : wanted.order) modes.lambda.push_back(lambda[i]);
  return wanted;
}

petsc::MatHandle copy_columns(const BandProblem& body, Mat vectors, const std::vector<std::size_t>& order) {
  petsc::MatHandle shapes;
  check(MatCreateDense(body.comm, body.rows, PETSC_DECIDE, body.n, petsc::to_petsc_int(static_cast<std::int64_t>(order.size())), nullptr,
                       shapes.out()));
  {
    const la::LocalColumns from(vectors);
    const la::LocalColumns to(shapes);
    for (std::size_t j = 0; j < order.size(); ++j)
      std::copy_n(from.column(static_cast<PetscInt>(order[j])), from.rows, to.column(static_cast<PetscInt>(j)));
  }
  check(MatAssemblyBegin(shapes, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(shapes, MAT_FINAL_ASSEMBLY));
  return shapes;
}

// Counts slightly outside the band, but not beyond the next mode: all eigenvalues are known.
void prove_dense(const BandProblem& body, const BandLimits& limits, const std::vector<double>& lambda, Modes& modes) {
  const auto count_under = [&](double x) -> std::int64_t { return std::lower_bound(lambda.begin(), lambda.end(), x) - lambda.begin(); };
  double low = limits.low * (1 - kEdgeNudge), high = limits.high * (1 + kEdgeNudge);
  for (const double x : lambda) {
    if (limits.is_below(x)) low = std::max(low, std::midpoint(x, limits.low));
    if (limits.is_above(x)) high = std::min(high, std::midpoint(x, limits.high));
  }
  modes.count_below_low = count_under(low);
  modes.band_count = count_under(high) - modes.count_below_low;
  modes.mechanism_count = std::max<std::int64_t>(0, count_under(kDenseMechanismTolerance * body.rounding()) - modes.rigid_count);
  Proof& proof = modes.proof;
  proof.found = modes.band_count;
  proof.method = fmt::format("all {} eigenvalues of the dense problem (LAPACK dsygvd), counted", body.n);
  for (const double end : {low, high}) proof.counts.push_back({body.to_hz(end), count_under(end), find_margin(lambda, end)});
}

// Returns lambda of the modes not wanted.
std::vector<double> solve_dense_band(const BandProblem& body, const BandLimits& limits, const ProgressReport& report, Modes& modes) {
  check_memory(body.comm, calc_dense_bytes(body.n, body.comm.is_root()), body.options.memory_limit_bytes, "The dense solve");
  DensePairs pairs;
  {
    const Timer timer(modes.seconds.iterate);
    report(Phase::kIterate, 0);
    pairs = solve_dense(body.pencil);
  }
  modes.factor = {};
  modes.factor.solver = "LAPACK dsygvd (dense)";
  modes.factor.ordering = "none";
  prove_dense(body, limits, pairs.lambda, modes);
  WantedModes wanted = take_wanted(body, limits, pairs.lambda, modes);
  if (!wanted.order.empty()) modes.shapes = copy_columns(body, pairs.vectors, wanted.order);
  return std::move(wanted.others);
}

// Records the counts verified by the modes found.
void describe_proof(const BandProblem& body, const Search& search, const BandCounts& band, const std::vector<double>& lambda,
                    Modes& modes) {
  Proof& proof = modes.proof;
  std::vector<Inertia> counts = sort_counts(search.counts());
  // If rounding moved the shift up, and only the rigid modes are below it, nothing else is below the band either.
  const double asked = body.asked.low * (1 - 2 * kEdgeNudge);
  if (counts.front().below == modes.rigid_count) counts.front().lambda = std::min(counts.front().lambda, asked);
  for (const Inertia& count : counts) proof.counts.push_back({body.to_hz(count.lambda), count.below, find_margin(lambda, count.lambda)});
  proof.found = count_found(lambda, counts.front().lambda, counts.back().lambda);
  proof.factor_backward_error = search.get_worst_backward_error();
  proof.method = fmt::format("signs of the pivots of K - lambda M = L D L^T ({}){}", modes.factor.solver,
                             band.is_low_derived ? "; below the band lies what the first shift counts less the modes found up to it" : "");
}

// True if so many of the lowest modes are wanted that LAPACK is faster.
bool is_mostly_wanted(const BandProblem& body, const BandCounts& counts) {
  const Slice& band = counts.band;
  const std::int64_t last = std::min(band.below_high, band.below_low + body.options.max_modes.value_or(band.count()));
  return body.n <= kDenseRowsFull && static_cast<double>(last) > kDenseShare * body.n && is_dense_exact(body, counts.limits);
}

// Adds what the modes of the lower band took.
void add_work(const Modes& known, Modes& modes) {
  modes.factor.factorisations += known.factor.factorisations;
  modes.factor.solves += known.factor.solves;
  modes.proof.factor_backward_error = std::max(modes.proof.factor_backward_error, known.proof.factor_backward_error);
  Seconds known_seconds = known.seconds;
  const auto before = comm::list_numbers(known_seconds);
  const auto seconds = comm::list_numbers(modes.seconds);
  for (std::size_t i = 0; i < before.size(); ++i) seconds[i] += before[i];
}

/// Findings about the band so far, for messages and for the next stage.
class Solve {
 public:
  explicit Solve(const BandProblem& body, Modes& modes) : limits(body.asked), body_(body), modes_(modes), report_{body, modes.factor} {}

  void run() {
    const bool is_dense = body_.n <= kDenseRows || body_.options.method == Method::kDense;
    if (is_dense && is_dense_exact(body_, limits)) {
      others_ = solve_dense_band(body_, limits, report_, modes_);
    } else {
      solve_sparse_band();
    }
    const Timer timer(modes_.seconds.check);
    report_.band_count = modes_.band_count;
    report_(Phase::kCheck, static_cast<std::int64_t>(modes_.lambda.size()));
    finish_modes(body_, search_ ? &search_->counter() : nullptr, others_, modes_);
  }

  BandLimits limits;  // of the band, as counted

 private:
  void solve_sparse_band();

  const BandProblem& body_;
  Modes& modes_;
  ProgressReport report_;
  std::optional<Search> search_;
  std::vector<double> others_;  // modes found but not wanted: outside the band, or beyond max_modes
};

void Solve::solve_sparse_band() {
  report_(Phase::kAnalyse, 0);
  Search& search = search_.emplace(body_, report_, modes_.factor, modes_.seconds);
  report_(Phase::kCount, 0);
  const bool is_continued = body_.options.known != nullptr && !body_.options.known->lambda.empty();
  BandCounts counts = is_continued ? search.continue_from(*body_.options.known) : count_band(body_, search.get_band_counter());
  limits = counts.limits;
  modes_.mechanism_count = counts.mechanism_count;
  report_.band_count = modes_.band_count = counts.band_count;
  modes_.count_below_low = counts.count_below_low;
  if (counts.band_count == 0) return describe_proof(body_, search, counts, {}, modes_);
  if (!is_continued && is_mostly_wanted(body_, counts)) {
    search_.reset();
    others_ = solve_dense_band(body_, limits, report_, modes_);
    return;
  }
  if (!is_continued) search.run(counts);
  search.complete(counts);
  limits = counts.limits;
  modes_.mechanism_count = counts.mechanism_count;
  modes_.band_count = counts.band_count;
  modes_.count_below_low = counts.count_below_low;
  FoundModes& found = search.found();
  describe_proof(body_, search, counts, found.lambda, modes_);
  WantedModes wanted = take_wanted(body_, limits, found.lambda, modes_);
  modes_.shapes = found.take(wanted.order);
  others_ = std::move(wanted.others);
}

}  // namespace

Modes solve_modes(const Problem& problem, const Options& options) {
  check_input(problem, options);
  if (options.checkpoint != nullptr) {
    if (std::optional<Modes> known = load_modes(problem.stiffness, *options.checkpoint)) return std::move(*known);
  }
  const comm::Communicator comm = petsc::get_communicator(problem.stiffness);
  Modes modes;
  {
    const Timer total(modes.seconds.total);
    std::optional<BandProblem> body;
    {
      const Timer timer(modes.seconds.rigid);
      if (options.progress && comm.is_root()) options.progress({});
      body.emplace(problem, options);
    }
    modes.rigid_count = body->rigid_count();
    modes.proof.rigid_per_component = body->rigid_per_component;
    Solve solve(*body, modes);
    try {
      solve.run();
    } catch (const SolveError& error) {
      throw SolveError(error.what() + explain_rounding(*body, solve.limits));
    }
  }
  comm.max(comm::list_numbers(modes.seconds));
  if (options.known != nullptr) add_work(*options.known, modes);
  return modes;
}

}  // namespace carillon::eigen
