// Method: Plan, values and workspace behind one interface; a factorisation is accepted by the backward error of a solve with known
// solution. If element growth is large, because pivots are sought within blocks only, solves get one step of iterative refinement. The
// matrix is equilibrated first. The infinity norm of K - sigma M is bounded by ||K|| + |sigma| ||M||.
// Source: Rigal and Gaches 1967 (normwise backward error); Higham 2002, sections 7.1, 12.1 (fixed precision refinement).
#include "precompute/ldlt/factor.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "precompute/la/node_rows.hpp"
#include "precompute/la/pencil.hpp"
#include "precompute/ldlt/numeric.hpp"
#include "precompute/petsc/diagonal.hpp"
#include "precompute/petsc/handle.hpp"
#include "precompute/petsc/noise.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/petsc/work.hpp"
#include "runtime/base/failure.hpp"

namespace carillon::ldlt {

using petsc::check;

// Method: Symmetric scaling to a unit diagonal by powers of two, which change no digit; one factor per node, so that pivoting sees rigid
// motions of a node unchanged; none if the diagonal spans less than six decades.
// Source: van der Sluis, Condition numbers and equilibration of matrices, Numer. Math. 14, 1969; Higham 2002, section 7.3.

/// S K S and S M S, S a power of two per node that scales the diagonal of K to about one: a soft part next to a stiff one, or an element a
/// thousand times thinner than its neighbours, then has pivots of its own magnitude instead of the rounding of others. Bodies of uniform
/// stiffness are not copied. Refers to K and M, which must not change: their values are read once, at construction.
class EquilibratedPencil {
 public:
  /// K, M: (3n, 3n) AIJ, whole nodes per rank. Collective. Throws SystemError on every rank if memory runs out.
  explicit EquilibratedPencil(const la::Pencil& given);

  const la::Pencil& get() const { return pencil_; }
  bool is_scaled() const { return static_cast<bool>(scaled_stiffness_); }
  /// X <- S X on this rank's rows, column-major.
  void scale(double* x, int stride, int columns) const;

 private:
  la::Pencil pencil_;
  petsc::MatHandle scaled_stiffness_;  // null if S is the identity
  petsc::MatHandle scaled_mass_;
  std::vector<double> factor_;  // (own rows), empty if S is the identity
};

namespace {

constexpr double kWide = 1e6;  // Stiffest over softest node; well-shaped meshes of one material span three decades.

/// Largest diagonal entry of each own node. Collective.
std::vector<double> find_stiffness(const la::Pencil& pencil) {
  std::vector<double> largest = petsc::read_diagonal(pencil.stiffness);
  const std::size_t nodes = largest.size() / 3;
  for (std::size_t node = 0; node < nodes; ++node)
    largest[node] = pencil.stiffness_factor * std::max({largest[3 * node], largest[3 * node + 1], largest[3 * node + 2]});
  largest.resize(nodes);
  return largest;
}

/// Ratio of the stiffest to the softest node, of all nodes with stiffness; 0 if there is none. Collective.
double find_width(const comm::Communicator& comm, const std::vector<double>& stiffness) {
  std::array<double, 2> ends{0, 0};  // largest value, largest inverse
  for (const double k : stiffness)
    if (k > 0) ends = {std::max(ends[0], k), std::max(ends[1], 1 / k)};
  comm.max(ends);
  return ends[0] * ends[1];
}

}  // namespace

EquilibratedPencil::EquilibratedPencil(const la::Pencil& given) : pencil_(given) {
  const Mat stiffness = given.stiffness, mass = given.mass;
  const comm::Communicator comm = petsc::get_communicator(stiffness);
  const std::vector<double> node_stiffness = find_stiffness(given);
  const double width = find_width(comm, node_stiffness);
  if (!(width > kWide) || !std::isfinite(width)) return;
  petsc::VecHandle factor;
  check(MatCreateVecs(stiffness, nullptr, factor.out()));
  comm.agree([&] {  // Copies of this rank's rows: allocation may fail on one rank alone.
    factor_.resize(3 * node_stiffness.size());
    check(MatDuplicate(stiffness, MAT_COPY_VALUES, scaled_stiffness_.out()));
    check(MatDuplicate(mass, MAT_COPY_VALUES, scaled_mass_.out()));
  });
  for (std::size_t i = 0; i < factor_.size(); ++i) {
    const double k = node_stiffness[i / 3];
    factor_[i] = std::ldexp(1.0, k > 0 ? -static_cast<int>(std::lround(0.5 * std::log2(k))) : 0);
  }
  PetscScalar* values = nullptr;
  check(VecGetArray(factor, &values));
  std::copy(factor_.begin(), factor_.end(), values);
  check(VecRestoreArray(factor, &values));
  check(MatDiagonalScale(scaled_stiffness_, factor, factor));
  check(MatDiagonalScale(scaled_mass_, factor, factor));
  pencil_.stiffness = scaled_stiffness_;
  pencil_.mass = scaled_mass_;
}

void EquilibratedPencil::scale(double* x, int stride, int columns) const {
  if (factor_.empty()) return;
  for (int j = 0; j < columns; ++j)
    for (std::size_t i = 0; i < factor_.size(); ++i) x[std::ptrdiff_t{j} * stride + static_cast<std::ptrdiff_t>(i)] *= factor_[i];
}

namespace {

constexpr double kWorstBackwardError = 1e-10;
constexpr double kRefinedBackwardError = 3e-13;  // Above this, solves are refined; typical bodies have 1e-15 to 1e-13.
constexpr double kVanishedPivot = 64 * std::numeric_limits<double>::epsilon();  // relative to ||A||_inf

}  // namespace

struct Factor::State {
  State(const la::Pencil& given_pencil, const MeshOrder* order)
      : given(given_pencil), plan(make_plan(given.stiffness, given.mass, order)) {}

  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() { BufferReuse::give_back_waiting(); }

  const la::Pencil given;
  Plan plan;
  std::optional<EquilibratedPencil> equilibrated;  // the matrix that is factorised and measured; set by the first factorisation
  double stiffness_norm = 0;                       // of the equilibrated K; mass_norm: of M
  double mass_norm = 0;
  Numbers numbers;
  Workspace workspace;
  double sigma = 0, norm = 0;
  bool needs_refinement = false;
  double backward_error = 0;  // of solves as performed, with refinement if any
  bool is_allocated = false;
  bool has_scratch = false;  // memory of the last factorisation, kept for the next

  /// Frees the memory that only a factorisation needs. It is kept until the first solve, as a count of eigenvalues is often followed
  /// directly by another factorisation, which would wait for fresh pages.
  void drop_scratch();
  /// Runs work; adds the memory requirement to an out-of-memory error. Collective.
  template <typename Work>
  void name_need(Work&& work) const;
  /// Preparation shared by all factorisations. Collective.
  void prepare();
  /// y = (K - sigma M) x on this rank's rows. Collective.
  void apply(Vec x, Vec y, Vec scratch) const;
  double measure_backward_error(bool is_refined);
  /// X <- A^-1 B, A equilibrated, without refinement. Collective.
  void solve(const double* b, double* x, int stride, int columns);
  /// X <- A^-1 X with one step of iterative refinement. Collective.
  void solve_refined(double* x, int stride, int columns);
};

template <typename Work>
void Factor::State::name_need(Work&& work) const {
  try {
    work();
  } catch (const MemoryError&) {
    throw MemoryError(
        fmt::format("Out of memory: L D L^T of K - sigma M needs {:.3f} GB, {:.3f} GB on the fullest of {} ranks. Take a coarser mesh, or "
                    "more machines.",
                    1e-9 * static_cast<double>(plan.analysis.peak_bytes), 1e-9 * static_cast<double>(plan.analysis.largest_peak_bytes),
                    plan.analysis.ranks.size()),
        static_cast<double>(plan.analysis.peak_bytes));
  }
}

void Factor::State::drop_scratch() {
  if (!std::exchange(has_scratch, false)) return;
  numbers.panels.give_back_tail(plan.room.solve_begin() + plan.room.solve_blocks * plan.count_block());
  BufferReuse::give_back_waiting();
}

void Factor::State::prepare() {
  if (!equilibrated) {
    EquilibratedPencil candidate(given);
    const la::Pencil& pencil = candidate.get();
    check(MatNorm(pencil.stiffness, NORM_INFINITY, &stiffness_norm));
    check(MatNorm(pencil.mass, NORM_INFINITY, &mass_norm));
    stiffness_norm *= pencil.stiffness_factor;
    mass_norm *= pencil.mass_factor;
    equilibrated = std::move(candidate);
  }
  if (is_allocated) return;
  comm::Communicator(plan.comm).agree([&] { numbers = make_numbers(plan); });
  is_allocated = true;
}

void Factor::State::apply(Vec x, Vec y, Vec scratch) const {
  const la::Pencil& pencil = equilibrated->get();
  check(MatMult(pencil.stiffness, x, y));
  check(VecScale(y, pencil.stiffness_factor));
  check(MatMult(pencil.mass, x, scratch));
  check(VecAXPY(y, -sigma * pencil.mass_factor, scratch));
}

double Factor::State::measure_backward_error(bool is_refined) {
  petsc::VecHandle x;
  petsc::VecHandle b;
  petsc::VecHandle scratch;
  check(MatCreateVecs(given.stiffness, x.out(), b.out()));
  check(VecDuplicate(x, scratch.out()));
  PetscInt first = 0, last = 0;
  check(VecGetOwnershipRange(x, &first, &last));
  PetscScalar* values = nullptr;
  check(VecGetArray(x, &values));
  for (PetscInt i = first; i < last; ++i) values[i - first] = petsc::make_noise(static_cast<std::uint64_t>(i), 0);
  check(VecRestoreArray(x, &values));
  apply(x, b, scratch);
  check(VecCopy(b, x));
  check(VecGetArray(x, &values));
  const int stride = std::max<int>(static_cast<int>(last - first), 1);
  if (is_refined)
    solve_refined(values, stride, 1);
  else
    solve(values, values, stride, 1);
  check(VecRestoreArray(x, &values));
  double b_norm = 0, x_norm = 0, residual = 0;
  check(VecNorm(b, NORM_INFINITY, &b_norm));
  check(VecNorm(x, NORM_INFINITY, &x_norm));
  petsc::VecHandle image;
  check(VecDuplicate(b, image.out()));
  apply(x, image, scratch);
  check(VecAXPY(image, -1.0, b));
  check(VecNorm(image, NORM_INFINITY, &residual));
  const double scale = norm * x_norm + b_norm;
  const double error = scale > 0 ? residual / scale : 0;
  return std::isfinite(error) ? error : std::numeric_limits<double>::infinity();
}

Factor::Factor(const la::Pencil& pencil, const MeshOrder* order) : state_(std::make_unique<State>(pencil, order)) {}

Factor::~Factor() = default;
Factor::Factor(Factor&&) noexcept = default;
Factor& Factor::operator=(Factor&&) noexcept = default;

const Analysis& Factor::get_analysis() const { return state_->plan.analysis; }

bool Factor::factorise(double sigma) {
  State& s = *state_;
  s.sigma = sigma;
  s.name_need([&] {
    s.prepare();
    s.norm = s.stiffness_norm + std::abs(sigma) * s.mass_norm;
    s.has_scratch = true;
    try {
      factorise_fronts(s.plan, s.equilibrated->get(), sigma, s.numbers, s.workspace);
    } catch (...) {
      s.drop_scratch();
      throw;
    }
    petsc::add_flops(s.plan.analysis.ranks[s.plan.rank].flops);
  });
  s.backward_error = std::numeric_limits<double>::infinity();
  if (!s.numbers.outcome.is_complete || s.numbers.outcome.smallest <= kVanishedPivot * s.norm) return false;
  s.backward_error = s.measure_backward_error(false);
  s.needs_refinement = s.backward_error > kRefinedBackwardError;
  if (s.backward_error > kWorstBackwardError) return false;
  if (s.needs_refinement) s.backward_error = s.measure_backward_error(true);
  return true;
}

std::int64_t Factor::get_negative_pivots() const { return state_->numbers.outcome.negative; }
double Factor::get_backward_error() const { return state_->backward_error; }
double Factor::get_growth() const { return state_->numbers.outcome.growth; }

void Factor::State::solve(const double* b, double* x, int stride, int columns) {
  petsc::add_flops(4.0 * static_cast<double>(plan.analysis.ranks[plan.rank].entries) * columns);
  for (int first = 0; first < columns; first += kSolveColumns) {
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(first) * stride;
    solve_columns(plan, numbers, workspace, b + at, x + at, stride, std::min(kSolveColumns, columns - first));
  }
}

void Factor::State::solve_refined(double* x, int stride, int columns) {
  petsc::VecHandle from;
  petsc::VecHandle to;
  petsc::VecHandle scratch;
  check(MatCreateVecs(given.stiffness, from.out(), to.out()));
  check(VecDuplicate(from, scratch.out()));
  PetscInt rows = 0;
  check(VecGetLocalSize(from, &rows));
  const std::ptrdiff_t n = rows;
  std::vector<double> rest(n * columns);  // B - A X
  for (int j = 0; j < columns; ++j) std::copy_n(x + std::ptrdiff_t{j} * stride, n, rest.data() + j * n);
  solve(x, x, stride, columns);
  for (int j = 0; j < columns; ++j) {
    check(VecPlaceArray(from, x + std::ptrdiff_t{j} * stride));
    apply(from, to, scratch);
    check(VecResetArray(from));
    const PetscScalar* image = nullptr;
    check(VecGetArrayRead(to, &image));
    for (std::ptrdiff_t i = 0; i < n; ++i) rest[j * n + i] -= image[i];
    check(VecRestoreArrayRead(to, &image));
  }
  solve(rest.data(), rest.data(), std::max<int>(rows, 1), columns);
  for (int j = 0; j < columns; ++j)
    for (std::ptrdiff_t i = 0; i < n; ++i) x[std::ptrdiff_t{j} * stride + i] += rest[j * n + i];
}

void Factor::solve(const double* b, double* x, int stride, int columns) {
  State& s = *state_;
  s.drop_scratch();
  if (s.equilibrated->is_scaled() || s.needs_refinement) {
    for (int j = 0; j < columns && b != x; ++j) {
      const std::ptrdiff_t at = std::ptrdiff_t{j} * stride;
      std::copy_n(b + at, 3 * s.plan.own_nodes, x + at);
    }
    b = x;
  }
  s.equilibrated->scale(x, stride, columns);
  if (s.needs_refinement)
    s.solve_refined(x, stride, columns);
  else
    s.solve(b, x, stride, columns);
  s.equilibrated->scale(x, stride, columns);
}

}  // namespace carillon::ldlt
