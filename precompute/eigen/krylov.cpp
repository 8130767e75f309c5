// Method:     Block Lanczos or Krylov-Schur on (K - sigma M)^-1 M in the M inner product; eigenvalues theta of the operator give
//             lambda = sigma + 1 / theta. The starting block is a fixed function of the nodes' positions, so that the partition has no say.
// Source:     Ericsson, Ruhe, Math. Comp. 35, 1980 (shift and invert); Hernandez, Roman, Vidal, SLEPc, ACM TOMS 31(3), 2005; Stewart,
//             A Krylov-Schur algorithm for large eigenproblems, SIAM J. Matrix Anal. Appl. 23(3), 2001. Block Lanczos: block_lanczos.cpp.
// Deviations: none. Gram-Schmidt of Krylov-Schur repeats as SLEPc decides: sparing its second pass lost orthogonality now and then.
#include "precompute/eigen/krylov.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <string>

#include "precompute/eigen/slepc_block_lanczos.hpp"
#include "precompute/eigen/solver_options.hpp"
#include "precompute/la/local_columns.hpp"
#include "precompute/petsc/guard.hpp"
#include "precompute/petsc/noise.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/petsc/work.hpp"

namespace carillon::eigen {
namespace {

using la::LocalColumns;
using petsc::check;
using petsc::guard;

constexpr PetscInt kBlock = 16;

struct ShellContext {
  const KrylovRequest* request = nullptr;
  KrylovStatistics statistics;
  std::int64_t converged = 0;  // pairs, when they were last looked at

  void report() const {
    if (request->progress) request->progress(converged, statistics.solves);
  }
};

// x = (K - sigma M)^-1 b
void solve_columns(ShellContext& context, const Columns& b, const Columns& x) {
  const petsc::WorkScope scope(petsc::WorkPhase::kSolve);
  const double start = MPI_Wtime();
  context.request->factor->solve(b.values, x.values, x.stride, x.count);
  context.statistics.solve_seconds += MPI_Wtime() - start;
  context.statistics.solves += x.count;
  context.report();
}

PetscErrorCode apply_inverse(PC pc, Vec b, Vec x) {
  return guard([&] {
    ShellContext* context = nullptr;
    check(PCShellGetContext(pc, &context));
    check(VecCopy(b, x));
    PetscInt rows = 0;
    PetscScalar* values = nullptr;
    check(VecGetLocalSize(x, &rows));
    check(VecGetArray(x, &values));
    const Columns column{values, rows, rows, 1};
    solve_columns(*context, column, column);
    check(VecRestoreArray(x, &values));
  });
}

PetscErrorCode apply_inverse_to_block(PC pc, Mat b, Mat x) {
  return guard([&] {
    ShellContext* context = nullptr;
    check(PCShellGetContext(pc, &context));
    const LocalColumns to(x);
    {
      const LocalColumns from(b);
      if (from.stride == to.stride) return solve_columns(*context, from.view(), to.view());
      for (int j = 0; j < to.view().count; ++j) std::copy_n(from.view().column(j), to.rows, to.view().column(j));
    }
    solve_columns(*context, to.view(), to.view());
  });
}

// K and M of the pencil as SLEPc sees them: single vectors through PETSc's matrices, blocks by M through ours.
PetscErrorCode multiply_stiffness(Mat shell, Vec x, Vec y) {
  const KrylovRequest* request = nullptr;
  PetscCall(MatShellGetContext(shell, &request));
  PetscCall(MatMult(request->pencil.stiffness, x, y));
  return VecScale(y, request->pencil.stiffness_factor);
}

PetscErrorCode multiply_mass(Mat shell, Vec x, Vec y) {
  const KrylovRequest* request = nullptr;
  PetscCall(MatShellGetContext(shell, &request));
  PetscCall(MatMult(request->pencil.mass, x, y));
  return VecScale(y, request->pencil.mass_factor);
}

PetscErrorCode multiply_mass_block(Mat shell, Mat x, Mat y, void*) {
  return guard([&] {
    const KrylovRequest* request = nullptr;
    check(MatShellGetContext(shell, &request));
    const LocalColumns from(x);
    const LocalColumns to(y);
    request->mass_blocks->multiply(from.view(), to.view());
  });
}

petsc::MatHandle make_shell(const KrylovRequest& request, PetscErrorCode (*multiply)(Mat, Vec, Vec)) {
  PetscInt rows = 0;
  PetscInt n = 0;
  const Mat matrix = request.pencil.mass;
  const comm::Communicator comm = petsc::get_communicator(matrix);
  check(MatGetLocalSize(matrix, &rows, nullptr));
  check(MatGetSize(matrix, &n, nullptr));
  petsc::MatHandle shell;
  check(MatCreateShell(comm, rows, rows, n, n, const_cast<KrylovRequest*>(&request), shell.out()));
  check(MatShellSetOperation(shell, MATOP_MULT, reinterpret_cast<void (*)()>(multiply)));
  check(MatShellSetOperation(shell, MATOP_MULT_TRANSPOSE, reinterpret_cast<void (*)()>(multiply)));
  return shell;
}

petsc::MatHandle make_mass_shell(const KrylovRequest& request) {
  petsc::MatHandle shell = make_shell(request, multiply_mass);
  check(MatShellSetMatProductOperation(shell, MATPRODUCT_AB, nullptr, multiply_mass_block, nullptr, MATDENSE, MATDENSE));
  return shell;
}

PetscErrorCode report_progress(EPS, PetscInt, PetscInt converged, PetscScalar*, PetscScalar*, PetscReal*, PetscInt, void* context) {
  auto& shell = *static_cast<ShellContext*>(context);
  shell.converged = converged;
  shell.report();
  return 0;
}

// Error of lambda = sigma + 1 / theta relative to lambda, where that is more than the error of theta relative to theta: a mode near zero
// keeps its digits though the shift is far above it. Beyond kDigits the operator's own rounding would let nothing converge.
PetscErrorCode calc_error(EPS, PetscScalar theta, PetscScalar, PetscReal residual, PetscReal* error, void* context) {
  constexpr double kDigits = 1e3;
  const double sigma = static_cast<const KrylovRequest*>(context)->sigma;
  const double lambda = std::abs(sigma + 1 / theta);
  const double loss = std::min(std::abs(1 / theta) / std::max(lambda, PETSC_MACHINE_EPSILON), kDigits);
  *error = residual / std::abs(theta) * std::max(loss, 1.0);
  return 0;
}

// Of K x - lambda M x: relative to what is not small against the shift, or the rounding of K x would let the lowest modes never converge.
PetscErrorCode calc_error_of_pair(EPS, PetscScalar lambda, PetscScalar, PetscReal residual, PetscReal* error, void* context) {
  *error = residual / std::max(std::abs(lambda), std::abs(static_cast<const KrylovRequest*>(context)->sigma));
  return 0;
}

// A number in (-1/2, 1/2) from a position and two more numbers.
double make_noise(const Vec3& x, std::uint64_t a, std::uint64_t b) {
  std::uint64_t state = a * 0x9E3779B97F4A7C15ull + b * 0xD1B54A32D192ED03ull;
  for (const double coordinate : x) {
    state = petsc::scramble(state ^ std::bit_cast<std::uint64_t>(coordinate + 0.0));  // + 0.0: minus zero is zero
  }
  return petsc::to_noise(state);
}

void set_starting_block(EPS eps, const KrylovRequest& request) {
  std::vector<petsc::VecHandle> vectors(kBlock);
  std::vector<Vec> plain;
  for (std::size_t j = 0; j < vectors.size(); ++j) {
    check(MatCreateVecs(request.pencil.stiffness, vectors[j].out(), nullptr));
    PetscScalar* values = nullptr;
    check(VecGetArray(vectors[j], &values));
    for (std::size_t node = 0; node < request.nodes_m->size(); ++node) {
      for (std::size_t d = 0; d < 3; ++d)
        values[3 * node + d] = make_noise((*request.nodes_m)[node], 3 * j + d + 1, static_cast<std::uint64_t>(request.round));
    }
    check(VecRestoreArray(vectors[j], &values));
    plain.push_back(vectors[j]);
  }
  check(EPSSetInitialSpace(eps, static_cast<PetscInt>(plain.size()), plain.data()));
}

// With its factor, where the entries themselves are needed.
petsc::MatHandle copy_scaled(Mat matrix, double factor) {
  petsc::MatHandle copy;
  check(MatDuplicate(matrix, MAT_COPY_VALUES, copy.out()));
  check(MatScale(copy, factor));
  return copy;
}

// K and M in the form that the family needs.
struct Operands {
  Operands(const KrylovRequest& request, Family family) {
    const la::Pencil& pencil = request.pencil;
    stiffness = family == Family::dense ? copy_scaled(pencil.stiffness, pencil.stiffness_factor) : make_shell(request, multiply_stiffness);
    mass = family == Family::dense ? copy_scaled(pencil.mass, pencil.mass_factor) : make_mass_shell(request);
  }
  petsc::MatHandle stiffness, mass;
};

// The factor at hand as the operator's inverse, or as a preconditioner.
void set_operator(EPS eps, const KrylovRequest& request, Family family, ShellContext& shell, const Operands& operands) {
  ST st = nullptr;
  KSP ksp = nullptr;
  PC pc = nullptr;
  check(EPSSetOperators(eps, operands.stiffness, operands.mass));
  check(EPSSetProblemType(eps, EPS_GHEP));
  check(EPSSetTarget(eps, request.sigma));
  check(EPSGetST(eps, &st));
  if (family == Family::dense) return check(STSetType(st, STSHIFT));
  check(STSetType(st, family == Family::davidson ? STPRECOND : STSINVERT));
  check(STSetShift(st, request.sigma));
  check(STSetMatMode(st, ST_MATMODE_SHELL));  // K - sigma M itself is formed where it is factorised.
  check(STGetKSP(st, &ksp));
  PetscBool is_jd = PETSC_FALSE;
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(eps), EPSJD, &is_jd));
  if (is_jd == PETSC_TRUE) {
    check(STPrecondSetKSPHasMat(st, PETSC_TRUE));
    check(KSPSetType(ksp, KSPBCGSL));
    check(KSPSetTolerances(ksp, 1e-4, PETSC_DEFAULT, PETSC_DEFAULT, 90));
  } else {
    check(KSPSetType(ksp, KSPPREONLY));
  }
  check(KSPGetPC(ksp, &pc));
  check(PCSetType(pc, PCSHELL));
  check(PCShellSetContext(pc, &shell));
  check(PCShellSetApply(pc, apply_inverse));
  check(PCShellSetMatApply(pc, apply_inverse_to_block));
}

// Sizes for the type that the options left: the block method seeks the interval, the others what is nearest.
void set_goal(EPS eps, const KrylovRequest& request, Family family, PetscInt locked) {
  PetscInt n = 0;
  check(MatGetSize(request.pencil.stiffness, &n, nullptr));
  const PetscInt room = n - locked;
  if (family == Family::block) {
    const PetscInt wanted = std::min(request.count, room);
    check(EPSSetWhichEigenpairs(eps, EPS_ALL));
    check(EPSSetInterval(eps, request.low, request.high));
    const auto basis = calc_basis_size(wanted, locked, request.is_count_known) - kBlock;  // SLEPc's basis is without the residuals.
    check(EPSSetDimensions(eps, wanted, static_cast<PetscInt>(std::min<std::int64_t>(n, basis)), PETSC_DEFAULT));
    return;
  }
  // A basis of this size converges without a restart, as a rule; a restart throws away half of its solves. A shift within the band has the
  // modes on both sides of it and needs less.
  const bool meets_locked = family == Family::plain;
  const PetscInt wanted = meets_locked ? std::min(request.nearest + locked, n) : std::min(request.nearest, room);
  const PetscInt ncv = std::min(meets_locked ? n : room, wanted + (request.sigma > 0 ? wanted / 2 : wanted) + 30);
  PetscBool has_ncv = PETSC_FALSE;  // Where the user sizes the basis, or its part in use, the other follows as SLEPc does it.
  PetscBool has_mpd = PETSC_FALSE;
  check(PetscOptionsHasName(nullptr, nullptr, "-eps_ncv", &has_ncv));
  check(PetscOptionsHasName(nullptr, nullptr, "-eps_mpd", &has_mpd));
  const bool is_sized = has_ncv == PETSC_TRUE || has_mpd == PETSC_TRUE;
  check(EPSSetWhichEigenpairs(eps, EPS_TARGET_MAGNITUDE));
  check(EPSSetDimensions(eps, wanted, is_sized ? PETSC_DEFAULT : ncv, family == Family::krylov && !is_sized ? ncv : PETSC_DEFAULT));
  // Without an end to its steps a search for what it cannot find takes hours.
  if (family == Family::davidson) check(EPSSetTolerances(eps, PETSC_DEFAULT, 50 * wanted + 200));
}

// For the types without support of locked columns.
void set_deflation_space(EPS eps, const KrylovRequest& request, const LockedModes& locked) {
  if (locked.count() == 0) return;
  std::vector<petsc::VecHandle> vectors;
  std::vector<Vec> plain;
  for (const Columns& set : locked.sets) {
    for (int j = 0; j < set.count; ++j) {
      petsc::VecHandle& vector = vectors.emplace_back();
      check(MatCreateVecs(request.pencil.stiffness, vector.out(), nullptr));
      PetscScalar* values = nullptr;
      check(VecGetArrayWrite(vector, &values));
      std::copy_n(set.column(j), set.rows, values);
      check(VecRestoreArrayWrite(vector, &values));
      plain.push_back(vector);
    }
  }
  check(EPSSetDeflationSpace(eps, static_cast<PetscInt>(plain.size()), plain.data()));
}

// For the types that know neither: takes the locked columns out of a vector. False if most of it goes with them: it is one of them.
bool clear_of_locked(const KrylovRequest& request, const LockedModes& locked, Vec shape) {
  if (locked.count() == 0) return true;
  const comm::Communicator comm = petsc::get_communicator(shape);
  const LockedRange all{0, locked.count()};
  petsc::VecHandle image;
  check(VecDuplicate(shape, image.out()));
  check(MatMult(request.pencil.mass, shape, image));
  check(VecScale(image, request.pencil.mass_factor));
  PetscInt rows = 0;
  PetscScalar* x = nullptr;
  PetscScalar* m_x = nullptr;
  check(VecGetLocalSize(shape, &rows));
  check(VecGetArray(image, &m_x));
  const la::Matrix parts = locked.multiply_transposed(comm, all, {m_x, rows, rows, 1});
  check(VecRestoreArray(image, &m_x));
  const double known = std::inner_product(parts.data(), parts.data() + parts.size(), parts.data(), 0.0);
  if (known > 0.5) return false;
  check(VecGetArray(shape, &x));
  locked.subtract_product(all, parts, {x, rows, rows, 1});
  check(VecRestoreArray(shape, &x));
  check(VecScale(shape, 1 / std::sqrt(1 - known)));
  return true;
}

}  // namespace

petsc::MatHandle FoundModes::make_columns(PetscInt count) const {
  PetscInt rows = 0;
  PetscInt n = 0;
  const comm::Communicator comm = petsc::get_communicator(stiffness_);
  check(MatGetLocalSize(stiffness_, &rows, nullptr));
  check(MatGetSize(stiffness_, &n, nullptr));
  petsc::MatHandle columns;
  check(MatCreateDense(comm, rows, PETSC_DECIDE, n, count, nullptr, columns.out()));
  check(MatAssemblyBegin(columns, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(columns, MAT_FINAL_ASSEMBLY));
  return columns;
}

void FoundModes::reset(Mat stiffness, PetscInt capacity, const std::vector<petsc::VecHandle>& rigid) {
  stiffness_ = stiffness;
  lambda.clear();
  capacity_ = capacity;
  columns_ = make_columns(capacity);
  rigid_count_ = static_cast<int>(rigid.size());
  rigid_ = make_columns(static_cast<PetscInt>(rigid.size()));
  const LocalColumns to(rigid_);
  for (std::size_t j = 0; j < rigid.size(); ++j) {
    const PetscScalar* values = nullptr;
    check(VecGetArrayRead(rigid[j], &values));
    std::copy_n(values, to.rows, to.column(static_cast<PetscInt>(j)));
    check(VecRestoreArrayRead(rigid[j], &values));
  }
}

void FoundModes::make_room(PetscInt count) {
  if (count <= capacity_) return;
  petsc::MatHandle larger = make_columns(count);
  {
    const LocalColumns from(columns_);
    const LocalColumns to(larger);
    for (PetscInt j = 0; j < static_cast<PetscInt>(lambda.size()); ++j) std::copy_n(from.column(j), from.rows, to.column(j));
  }
  columns_ = std::move(larger);
  capacity_ = count;
}

void FoundModes::add(double eigenvalue, const std::function<bool(Vec shape)>& write) {
  const auto count = static_cast<PetscInt>(lambda.size());
  if (count == capacity_) make_room(capacity_ + capacity_ / 8 + 8);
  Vec column = nullptr;
  check(MatDenseGetColumnVecWrite(columns_, count, &column));
  const bool is_new = write(column);
  check(MatDenseRestoreColumnVecWrite(columns_, count, &column));
  if (is_new) lambda.push_back(eigenvalue);
}

LockedModes FoundModes::find_above(double low) const {
  LockedModes locked;
  const auto first = static_cast<int>(std::find_if(lambda.begin(), lambda.end(), [&](double x) { return x > low; }) - lambda.begin());
  const int count = static_cast<int>(lambda.size()) - first;
  locked.lambda.assign(rigid_count_, 0.0);
  locked.lambda.insert(locked.lambda.end(), lambda.begin() + first, lambda.end());
  if (rigid_count_ > 0) locked.sets.push_back(LocalColumns(rigid_).view());
  if (count > 0) locked.sets.push_back(LocalColumns(columns_).view().part(first, count));
  return locked;
}

petsc::MatHandle FoundModes::take(const std::vector<std::size_t>& order) {
  petsc::MatHandle result;
  if (!order.empty()) {
    if (std::ssize(order) == capacity_) {
      const LocalColumns columns(columns_);
      permute_columns(columns.view(), order);
      result = std::move(columns_);
    } else {
      result = make_columns(static_cast<PetscInt>(order.size()));
      const LocalColumns from(columns_);
      const LocalColumns to(result);
      for (std::size_t j = 0; j < order.size(); ++j)
        std::copy_n(from.column(static_cast<PetscInt>(order[j])), from.rows, to.column(static_cast<PetscInt>(j)));
    }
  }
  columns_.reset();
  lambda.clear();
  capacity_ = 0;
  return result;
}

std::int64_t calc_basis_size(std::int64_t wanted, std::int64_t locked, bool is_count_known) {
  const std::int64_t neighbours = std::min(locked, wanted / 2) + (is_count_known ? 0 : wanted / 4);
  return 2 * wanted + 10 * kBlock + neighbours;
}

KrylovStatistics run_krylov(const KrylovRequest& request, FoundModes& found) {
  const comm::Communicator comm = petsc::get_communicator(request.pencil.stiffness);
  check(register_block_lanczos());
  ShellContext shell{&request, {}, 0};
  const LockedModes locked = found.find_above(request.locked_above);
  petsc::EpsHandle eps;
  check(EPSCreate(comm, eps.out()));
  check(EPSSetType(eps, request.method == Method::kKrylovSchur ? EPSKRYLOVSCHUR : kBlockLanczosType));
  std::string type(128, '\0');
  PetscBool is_chosen = PETSC_FALSE;  // What follows depends on the type, and options may change either.
  check(PetscOptionsGetString(nullptr, nullptr, "-eps_type", type.data(), type.size(), &is_chosen));
  if (is_chosen == PETSC_TRUE) check(EPSSetType(eps, type.c_str()));
  const Family family = find_family(eps);
  const Operands operands(request, family);
  set_operator(eps, request, family, shell, operands);
  check(set_block_size(eps, kBlock));
  check(set_count_known(eps, request.is_count_known ? PETSC_TRUE : PETSC_FALSE));
  check(EPSLanczosSetReorthog(eps, EPS_LANCZOS_REORTHOG_FULL));
  check(EPSSetTolerances(eps, request.tolerance, PETSC_DEFAULT));
  check(EPSSetPurify(eps, PETSC_FALSE));
  if (family == Family::block || family == Family::krylov)
    check(EPSSetConvergenceTestFunction(eps, calc_error, const_cast<KrylovRequest*>(&request), nullptr));
  if (family == Family::davidson)
    check(EPSSetConvergenceTestFunction(eps, calc_error_of_pair, const_cast<KrylovRequest*>(&request), nullptr));
  set_goal(eps, request, family, locked.count());
  check(EPSSetFromOptions(eps));
  if (family == Family::block) {
    check(set_locked(eps, &locked));
    check(set_mass_diagonal(eps, request.mass_blocks->get_diagonal()));
    check(set_checkpoint(eps, request.checkpoint));
    set_starting_block(eps, request);
  } else if (family == Family::krylov || family == Family::davidson) {
    set_deflation_space(eps, request, locked);
  }
  if (request.progress) check(EPSMonitorSet(eps, report_progress, &shell, nullptr));

  check(EPSSolve(eps));

  if (request.checkpoint != nullptr && request.checkpoint->was_stopped) return shell.statistics;
  EPSConvergedReason reason = EPS_CONVERGED_ITERATING;
  check(EPSGetConvergedReason(eps, &reason));
  PetscInt converged = 0;
  check(EPSGetConverged(eps, &converged));
  double highest = request.sigma;
  for (PetscInt i = 0; i < converged; ++i) {
    PetscScalar lambda = 0;
    check(EPSGetEigenvalue(eps, i, &lambda, nullptr));
    if (lambda < request.low || lambda > request.high) continue;
    found.add(lambda, [&](Vec shape) {
      check(EPSGetEigenvector(eps, i, shape, nullptr));
      return (family != Family::plain && family != Family::dense) ||
             clear_of_locked(request, found.find_above(request.locked_above), shape);
    });
    highest = std::max(highest, lambda);
  }
  // The block method ends when the interval is done, the others with the farthest of what is nearest.
  shell.statistics.solved_to = std::min(family == Family::block && reason > 0 ? request.high : highest, request.high);
  return shell.statistics;
}

}  // namespace carillon::eigen
