// Method: Multifrontal L D L^T of K - sigma M with 1x1 and 2x2 pivots; the entries stay on the ranks that assembled them, the analysis is
// sequential with a given METIS order, right-hand sides and solutions are distributed. PETSc's interface to MUMPS is not used: it cannot
// pass an order for a distributed matrix, and the MUMPS of Debian linked by PETSc has no METIS.
// Source: MUMPS 5.5.1 users' guide, sections 3, 5 and 6. Inertia: Parlett, The symmetric eigenvalue problem, 1998, section 3.3.
#include <dmumps_c.h>
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "precompute/eigen/shifted_factor.hpp"
#include "precompute/petsc/handle.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/failure.hpp"

namespace carillon::eigen {
namespace {

constexpr int kJobInit = -1;
constexpr int kJobEnd = -2;
constexpr int kJobAnalyse = 1;
constexpr int kJobFactorise = 2;
constexpr int kJobSolve = 3;

// ICNTL(7) of MUMPS for the names of "-mumps_ordering". Debian's libmumps-5.5, linked by PETSc, has neither METIS, whose order is passed
// in, nor SCOTCH.
constexpr std::array<std::pair<std::string_view, int>, 4> kOwnOrderings{{{"amd", 0}, {"amf", 2}, {"pord", 4}, {"qamd", 6}}};

using petsc::check;

// Calls visit(row, column, k, m) for every entry of the lower triangle of the union of both patterns, own rows in order.
template <typename Visit>
void visit_lower_entries(const la::Pencil& pencil, Visit&& visit) {
  const auto [stiffness, mass, stiffness_factor, mass_factor] = pencil;
  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(stiffness, &first, &last));
  for (PetscInt row = first; row < last; ++row) {
    PetscInt k_count = 0, m_count = 0;
    const PetscInt* k_columns = nullptr;
    const PetscInt* m_columns = nullptr;
    const PetscScalar* k_values = nullptr;
    const PetscScalar* m_values = nullptr;
    check(MatGetRow(stiffness, row, &k_count, &k_columns, &k_values));
    check(MatGetRow(mass, row, &m_count, &m_columns, &m_values));
    PetscInt k = 0, m = 0;
    while (true) {
      const PetscInt k_column = k < k_count ? k_columns[k] : PETSC_MAX_INT;
      const PetscInt m_column = m < m_count ? m_columns[m] : PETSC_MAX_INT;
      const PetscInt column = std::min(k_column, m_column);
      if (column > row) break;
      visit(row, column, k_column == column ? stiffness_factor * k_values[k] : 0.0, m_column == column ? mass_factor * m_values[m] : 0.0);
      if (k_column == column) ++k;
      if (m_column == column) ++m;
    }
    check(MatRestoreRow(mass, row, &m_count, &m_columns, &m_values));
    check(MatRestoreRow(stiffness, row, &k_count, &k_columns, &k_values));
  }
}

const char* find_ordering_name(int infog7) {
  switch (infog7) {
    case 0:
      return "AMD";
    case 1:
      return "METIS nested dissection (given)";
    case 2:
      return "AMF";
    case 3:
      return "SCOTCH";
    case 4:
      return "PORD";
    case 5:
      return "METIS";
    case 6:
      return "QAMD";
    default:
      return "unknown";
  }
}

/// ICNTL(7) requested by "-mumps_ordering"; -1 if not given: the order of the caller. Not collective.
int find_own_ordering() {
  std::string name(64, '\0');
  PetscBool is_given = PETSC_FALSE;
  check(PetscOptionsGetString(nullptr, nullptr, "-mumps_ordering", name.data(), name.size(), &is_given));
  if (is_given == PETSC_FALSE) return -1;
  name.resize(name.find('\0'));
  for (const auto& [own, icntl7] : kOwnOrderings)
    if (name == own) return icntl7;
  throw InputError(fmt::format("\"-mumps_ordering {}\": take one of amd, amf, pord, qamd", name));
}

class MumpsFactor final : public ShiftedFactor {
 public:
  MumpsFactor(const la::Pencil& pencil, const std::vector<std::int32_t>& elimination_position);
  ~MumpsFactor() override;

  bool try_factorise(double sigma) override;
  void solve(const double* b, double* x, std::ptrdiff_t stride, int columns) override;
  std::int64_t get_negative_pivots() const override;
  double get_backward_error() const override { return 0; }
  std::int64_t get_peak_bytes() const override;
  std::string get_solver() const override;
  std::string get_ordering() const override;
  std::int64_t get_entries() const override;
  double get_flops() const override;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

bool lacks_workspace(int code) { return code == -8 || code == -9 || code == -14 || code == -15 || code == -17 || code == -20; }
bool lacks_memory(int code) { return code == -5 || code == -7 || code == -13 || code == -19; }

struct MumpsFactor::State {
  la::Pencil pencil;
  int size = 1;
  bool is_alive = false;
  int analysis_megabytes = 0;
  DMUMPS_STRUC_C mumps{};
  std::vector<MUMPS_INT> rows;
  std::vector<MUMPS_INT> columns;
  std::vector<double> values;
  std::vector<MUMPS_INT> permutation;
  std::vector<MUMPS_INT> own_rows;
  std::vector<MUMPS_INT> solution_rows;
  std::vector<double> solution;
  petsc::VecHandle solution_vec;
  petsc::VecHandle result_vec;
  petsc::ScatterHandle scatter;

  int& icntl(int i) { return mumps.icntl[i - 1]; }
  int infog(int i) const { return mumps.infog[i - 1]; }
  int call(int job) {
    mumps.job = job;
    dmumps_c(&mumps);
    return infog(1);
  }
  void set_controls();
  void prepare_solution(int columns);
  void make_scatter();
};

void MumpsFactor::State::set_controls() {
  icntl(1) = icntl(2) = icntl(3) = -1;  // No output: errors are returned as codes.
  icntl(4) = 0;
  icntl(5) = 0;     // Assembled entries ...
  icntl(18) = 3;    // ... distributed over the ranks.
  icntl(6) = 0;     // No column permutation, as the diagonal is good.
  icntl(12) = 1;    // Use the order as given, without compression around 2x2 pivots.
  icntl(13) = 1;    // No ScaLAPACK at the root, which does not count negative pivots.
  icntl(14) = 30;   // Per cent of workspace beyond the estimate, for delayed pivots.
  icntl(28) = 1;    // Sequential analysis.
  icntl(10) = 0;    // No iterative refinement.
  icntl(27) = -32;  // Right-hand sides per block.
  icntl(20) = size > 1 ? 10 : 0;
  icntl(21) = size > 1 ? 1 : 0;
}

MumpsFactor::MumpsFactor(const la::Pencil& pencil, const std::vector<std::int32_t>& elimination_position)
    : state_(std::make_unique<State>()) {
  const int own_ordering = find_own_ordering();
  State& s = *state_;
  s.pencil = pencil;
  const comm::Communicator comm = petsc::get_communicator(pencil.stiffness);
  s.size = comm.size();
  PetscInt n = 0;
  check(MatGetSize(pencil.stiffness, &n, nullptr));

  s.mumps.comm_fortran = static_cast<MUMPS_INT>(MPI_Comm_c2f(comm));
  s.mumps.par = 1;
  s.mumps.sym = 2;
  if (s.call(kJobInit) != 0) throw SystemError(fmt::format("MUMPS does not start (code {}).", s.infog(1)));
  s.is_alive = true;
  s.set_controls();

  visit_lower_entries(pencil, [&](PetscInt row, PetscInt column, double, double) {
    s.rows.push_back(row + 1);
    s.columns.push_back(column + 1);
  });
  s.values.resize(s.rows.size());
  s.mumps.n = n;
  s.mumps.nnz_loc = static_cast<MUMPS_INT8>(s.rows.size());
  s.mumps.irn_loc = s.rows.data();
  s.mumps.jcn_loc = s.columns.data();
  s.mumps.a_loc = s.values.data();

  const bool is_given = comm.broadcast(!elimination_position.empty() && own_ordering < 0);
  constexpr int kOrderGiven = 1, kOrderChosen = 7;
  s.icntl(7) = is_given ? kOrderGiven : own_ordering >= 0 ? own_ordering : kOrderChosen;
  if (is_given && comm.is_root()) {
    s.permutation.resize(n);
    for (std::size_t node = 0; node < elimination_position.size(); ++node) {
      for (std::size_t d = 0; d < 3; ++d) s.permutation[3 * node + d] = static_cast<MUMPS_INT>(3 * elimination_position[node] + d + 1);
    }
    s.mumps.perm_in = s.permutation.data();
  }
  const int code = s.call(kJobAnalyse);
  if (lacks_memory(code))
    throw MemoryError("Out of memory in the analysis of K - sigma M. Take a coarser mesh or more ranks on more machines.");
  if (code < 0) throw SolveError(fmt::format("MUMPS cannot analyse K - sigma M: code {}, {}.", code, s.infog(2)));
  s.analysis_megabytes = s.mumps.info[14];  // INFO(15): predicted memory of the factorisation on this rank.

  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(pencil.stiffness, &first, &last));
  for (PetscInt row = first; row < last; ++row) s.own_rows.push_back(row + 1);
}

MumpsFactor::~MumpsFactor() {
  // Ending MUMPS is collective. A rank that unwinds alone (out of memory) must not wait for the others here: the process ends anyway.
  const bool unwinds = std::uncaught_exceptions() > 0;
  if (state_ != nullptr && state_->is_alive && !(unwinds && state_->size > 1)) (void)state_->call(kJobEnd);
}

bool MumpsFactor::try_factorise(double sigma) {
  State& s = *state_;
  std::size_t entry = 0;
  visit_lower_entries(s.pencil, [&](PetscInt, PetscInt, double k, double m) { s.values[entry++] = k - sigma * m; });
  constexpr int kAttempts = 8;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const int code = s.call(kJobFactorise);
    if (code >= 0) {
      s.scatter.reset();  // The distribution of the solution is known after the first solve.
      return true;
    }
    if (code == -10) return false;
    if (lacks_workspace(code)) {
      s.icntl(14) *= 2;
      continue;
    }
    if (lacks_memory(code)) {
      throw MemoryError("Out of memory in the factorisation of K - sigma M. Take a coarser mesh or more ranks on more machines.");
    }
    throw SolveError(fmt::format("MUMPS cannot factorise K - sigma M at sigma = {:.9g}: code {}, {}.", sigma, code, s.infog(2)));
  }
  throw SolveError(
      fmt::format("MUMPS cannot factorise K - sigma M at sigma = {:.9g}: its workspace did not suffice (code {}).", sigma, s.infog(1)));
}

// The solution is distributed by pivots; prepare_solution() allocates it, make_scatter() maps it to the owners of the rows.
void MumpsFactor::State::prepare_solution(int columns) {
  const int local = std::max(mumps.info[22], 1);  // INFO(23): number of pivots on this rank.
  solution.assign(static_cast<std::size_t>(local) * static_cast<std::size_t>(columns), 0.0);
  solution_rows.assign(local, 0);
  mumps.sol_loc = solution.data();
  mumps.isol_loc = solution_rows.data();
  mumps.lsol_loc = local;
}

void MumpsFactor::State::make_scatter() {
  const int local = mumps.info[22];
  check(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, local, nullptr, solution_vec.out()));
  check(MatCreateVecs(pencil.stiffness, result_vec.out(), nullptr));
  std::vector<PetscInt> rows(local);
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = solution_rows[i] - 1;
  petsc::IsHandle to;
  petsc::IsHandle from;
  check(ISCreateGeneral(petsc::get_communicator(pencil.stiffness), local, rows.data(), PETSC_COPY_VALUES, to.out()));
  check(ISCreateStride(PETSC_COMM_SELF, local, 0, 1, from.out()));
  check(VecScatterCreate(solution_vec, from, result_vec, to, scatter.out()));
}

void MumpsFactor::solve(const double* b, double* x, std::ptrdiff_t stride, int columns) {
  State& s = *state_;
  for (int j = 0; j < columns && b != x; ++j) std::copy_n(b + j * stride, s.own_rows.size(), x + j * stride);
  s.mumps.nrhs = columns;
  const auto leading = static_cast<MUMPS_INT>(std::max<std::ptrdiff_t>(stride, 1));
  if (s.size == 1) {
    s.mumps.rhs = x;
    s.mumps.lrhs = leading;
  } else {
    s.mumps.rhs_loc = x;
    s.mumps.irhs_loc = s.own_rows.data();
    s.mumps.nloc_rhs = static_cast<MUMPS_INT>(s.own_rows.size());
    s.mumps.lrhs_loc = std::max(leading, std::max(s.mumps.nloc_rhs, 1));
    s.prepare_solution(columns);
  }
  const int code = s.call(kJobSolve);
  if (lacks_memory(code))
    throw MemoryError("Out of memory in a solve with the factor. Take a coarser mesh or more ranks on more machines.");
  if (code < 0) throw SolveError(fmt::format("MUMPS cannot solve with its factor: code {}, {}.", code, s.infog(2)));
  if (s.size == 1) return;
  if (s.scatter.get() == nullptr) s.make_scatter();
  for (int j = 0; j < columns; ++j) {
    check(VecPlaceArray(s.solution_vec, s.solution.data() + static_cast<std::ptrdiff_t>(j) * s.mumps.lsol_loc));
    check(VecPlaceArray(s.result_vec, x + j * stride));
    check(VecScatterBegin(s.scatter, s.solution_vec, s.result_vec, INSERT_VALUES, SCATTER_FORWARD));
    check(VecScatterEnd(s.scatter, s.solution_vec, s.result_vec, INSERT_VALUES, SCATTER_FORWARD));
    check(VecResetArray(s.result_vec));
    check(VecResetArray(s.solution_vec));
  }
}

std::int64_t MumpsFactor::get_negative_pivots() const { return state_->infog(12); }
std::string MumpsFactor::get_solver() const { return fmt::format("MUMPS {} L D L^T", state_->mumps.version_number); }
std::string MumpsFactor::get_ordering() const { return find_ordering_name(state_->infog(7)); }

std::int64_t MumpsFactor::get_entries() const {
  const std::int64_t entries = state_->infog(29);
  return entries < 0 ? -entries * 1'000'000 : entries;  // Large counts are in millions, negated.
}

std::int64_t MumpsFactor::get_peak_bytes() const { return std::int64_t{1'000'000} * state_->analysis_megabytes; }
double MumpsFactor::get_flops() const { return state_->mumps.rinfog[2]; }

}  // namespace

std::unique_ptr<ShiftedFactor> make_mumps_factor(const la::Pencil& pencil, const std::vector<std::int32_t>& elimination_position) {
  return std::make_unique<MumpsFactor>(pencil, elimination_position);
}

}  // namespace carillon::eigen
