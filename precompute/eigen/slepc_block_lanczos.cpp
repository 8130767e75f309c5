// All that block Lanczos has to do with SLEPc: what a solver of its family must offer, and its settings and results in SLEPc's fields.
#include "precompute/eigen/slepc_block_lanczos.hpp"

#include <slepc/private/epsimpl.h>

#include <algorithm>
#include <utility>

#include "precompute/eigen/block_lanczos.hpp"
#include "precompute/petsc/guard.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;
using petsc::guard;

constexpr PetscInt kDefaultBlock = 16;

// What the type keeps in eps->data.
struct Settings {
  PetscInt block = PETSC_DEFAULT;
  PetscBool is_count_known = PETSC_TRUE;
  const LockedModes* locked = nullptr;
  const double* mass_diagonal = nullptr;
  LanczosCheckpoint* checkpoint = nullptr;
};

Settings& get_settings(EPS eps) { return *static_cast<Settings*>(eps->data); }

// The columns of SLEPc's basis while they are worked on, deflation space first.
class OpenBasis {
 public:
  OpenBasis(EPS eps, int columns) : eps_(eps) {
    check(BVGetArray(eps->V, &values_));
    memory = {values_, eps->nloc, eps->nloc, columns};
  }
  ~OpenBasis() { (void)BVRestoreArray(eps_->V, &values_); }
  OpenBasis(const OpenBasis&) = delete;
  OpenBasis& operator=(const OpenBasis&) = delete;

  Columns memory;

 private:
  EPS eps_;
  PetscScalar* values_ = nullptr;
};

RitzGoal make_goal(EPS eps) {
  RitzGoal goal;
  goal.is_interval = eps->which == EPS_ALL;
  goal.low = eps->inta;
  goal.high = eps->intb;
  goal.wanted = eps->nev;
  goal.is_count_known = get_settings(eps).is_count_known == PETSC_TRUE;
  check(STGetShift(eps->st, &goal.sigma));
  goal.tolerance = eps->tol;
  goal.error = [eps](double theta, double residual) {
    PetscReal error = 0;
    check((*eps->converged)(eps, theta, 0, residual, &error, eps->convergedctx));
    return error;
  };
  goal.to_lambda = [eps](double theta) {
    PetscScalar imaginary = 0;
    check(STBackTransform(eps->st, 1, &theta, &imaginary));
    return theta;
  };
  goal.comes_first = [eps](double a, double b) {
    PetscInt result = 0;
    check((*eps->sc->comparison)(a, 0, b, 0, &result, eps->sc->comparisonctx));
    return result < 0;
  };
  return goal;
}

// Says how far the iteration is and asks SLEPc whether it is to end.
bool report(EPS eps, const RitzPairs& pairs, const RitzSelection& selection, int steps) {
  const std::size_t n = pairs.theta.size();
  eps->its = steps;
  eps->nconv = static_cast<PetscInt>(std::min<std::int64_t>(selection.converged, pairs.theta.size()));
  for (std::size_t j = 0; j < n; ++j) {
    eps->eigr[j] = pairs.theta[selection.order[j]];
    eps->eigi[j] = 0;
    eps->errest[j] = selection.error[selection.order[j]];
  }
  const PetscInt nev = eps->which == EPS_ALL && !selection.is_complete ? std::max(eps->nev, eps->nconv + 1) : eps->nev;
  check((*eps->stopping)(eps, eps->its, eps->max_it, eps->nconv, nev, &eps->reason, eps->stoppingctx));
  if (eps->reason == EPS_CONVERGED_ITERATING && selection.is_complete) eps->reason = EPS_CONVERGED_TOL;
  check(EPSMonitor(eps, eps->its, eps->nconv, eps->eigr, eps->eigi, eps->errest, static_cast<PetscInt>(n)));
  return eps->reason != EPS_CONVERGED_ITERATING;
}

void run(EPS eps) {
  const Settings& settings = get_settings(eps);
  const LockedModes locked = settings.locked != nullptr ? *settings.locked : LockedModes{};
  PetscInt fixed = 0, first_row = 0;
  Mat mass = nullptr;
  const comm::Communicator comm = petsc::get_communicator(eps);
  check(BVGetNumConstraints(eps->V, &fixed));
  check(BVGetMatrix(eps->V, &mass, nullptr));
  const auto room = static_cast<int>(std::min(eps->ncv, eps->n - fixed - locked.count()));
  const auto block = static_cast<int>(std::min<PetscInt>(settings.block, std::max<PetscInt>(room, 1)));
  for (PetscInt j = eps->nini; j < block; ++j) check(BVSetRandomColumn(eps->V, j));

  const ShiftInvert inverse(eps->st);
  const OpenBasis open(eps, static_cast<int>(fixed) + room + block);
  InnerProduct inner(comm, mass, eps->nloc, eps->n, block, settings.mass_diagonal);
  check(MatGetOwnershipRange(inner.w_mat(), &first_row, nullptr));
  LanczosBasis basis(open.memory, static_cast<int>(fixed), room, block);
  BlockLanczos lanczos({inverse, inner, basis, locked, eps->n, first_row}, make_goal(eps), static_cast<int>(eps->max_it),
                       settings.checkpoint);
  const BlockLanczos::End end = lanczos.run(
      [eps](const RitzPairs& pairs, const RitzSelection& selection, int steps) { return report(eps, pairs, selection, steps); });
  eps->its = lanczos.get_steps();
  if (end == BlockLanczos::End::kStopped) return;
  eps->nconv = 0;
  eps->reason = end == BlockLanczos::End::kExhausted ? EPS_CONVERGED_TOL : EPS_CONVERGED_USER;
}

PetscErrorCode set_up(EPS eps) {
  EPSCheckHermitianDefinite(eps);
  EPSCheckSinvert(eps);
  EPSCheckUnsupported(eps,
                      EPS_FEATURE_ARBITRARY | EPS_FEATURE_REGION | EPS_FEATURE_EXTRACTION | EPS_FEATURE_TWOSIDED | EPS_FEATURE_BALANCE);
  return guard([&] {
    Settings& settings = get_settings(eps);
    if (settings.block == PETSC_DEFAULT) settings.block = kDefaultBlock;
    if (eps->which == 0) eps->which = EPS_TARGET_MAGNITUDE;
    if (eps->ncv == PETSC_DEFAULT) eps->ncv = std::min(eps->n, 2 * eps->nev + 8 * settings.block);
    eps->ncv = std::min(eps->n, std::max(eps->ncv, std::min(eps->n, eps->nev + 3 * settings.block)));
    if (eps->mpd == PETSC_DEFAULT) eps->mpd = eps->ncv;
    if (eps->max_it == PETSC_DEFAULT) eps->max_it = std::max<PetscInt>(200, 20 * eps->ncv / settings.block);
    check(EPSAllocateSolution(eps, settings.block));  // One block more: the residuals', for the purification.
    check(EPS_SetInnerProduct(eps));
  });
}

PetscErrorCode set_up_sort(EPS eps) {
  switch (eps->which) {
    case EPS_LARGEST_MAGNITUDE:
      eps->sc->comparison = SlepcCompareLargestMagnitude;
      break;
    case EPS_SMALLEST_MAGNITUDE:
      eps->sc->comparison = SlepcCompareSmallestMagnitude;
      break;
    case EPS_LARGEST_REAL:
      eps->sc->comparison = SlepcCompareLargestReal;
      break;
    case EPS_TARGET_MAGNITUDE:
      eps->sc->comparison = SlepcCompareTargetMagnitude;
      break;
    case EPS_TARGET_REAL:
      eps->sc->comparison = SlepcCompareTargetReal;
      break;
    default:
      eps->sc->comparison = SlepcCompareSmallestReal;
  }
  eps->sc->comparisonctx = &eps->target;
  eps->sc->map = nullptr;
  eps->sc->mapobj = nullptr;
  return 0;
}

PetscErrorCode solve(EPS eps) {
  return guard([&] { run(eps); });
}

PetscErrorCode transform_back(EPS eps) { return STBackTransform(eps->st, eps->nconv, eps->eigr, eps->eigi); }

PetscErrorCode set_from_options(EPS eps, PetscOptionItems* PetscOptionsObject) {
  PetscOptionsHeadBegin(PetscOptionsObject, "EPS block Lanczos options");
  Settings& settings = get_settings(eps);
  PetscInt block = settings.block;
  PetscCall(PetscOptionsInt("-eps_blocklanczos_block_size", "Columns per block", "set_block_size", block, &block, nullptr));
  PetscOptionsHeadEnd();
  return set_block_size(eps, block);
}

PetscErrorCode view_settings(EPS eps, PetscViewer viewer) {
  return PetscViewerASCIIPrintf(viewer, "  block Lanczos: blocks of %d columns, basis of %d\n", static_cast<int>(get_settings(eps).block),
                                static_cast<int>(eps->ncv));
}

PetscErrorCode destroy(EPS eps) {
  delete static_cast<Settings*>(eps->data);
  eps->data = nullptr;
  return 0;
}

PetscErrorCode set_default_transformation(EPS eps) {
  const char* type = nullptr;
  PetscCall(STGetType(eps->st, &type));
  if (type == nullptr) PetscCall(STSetType(eps->st, STSINVERT));
  return 0;
}

PetscErrorCode create(EPS eps) {
  eps->data = new Settings;
  eps->useds = PETSC_FALSE;
  eps->categ = EPS_CATEGORY_KRYLOV;
  eps->ops->solve = solve;
  eps->ops->setup = set_up;
  eps->ops->setupsort = set_up_sort;
  eps->ops->setfromoptions = set_from_options;
  eps->ops->destroy = destroy;
  eps->ops->view = view_settings;
  eps->ops->backtransform = transform_back;
  eps->ops->setdefaultst = set_default_transformation;
  return 0;
}

}  // namespace

PetscErrorCode register_block_lanczos() { return EPSRegister(kBlockLanczosType, create); }

PetscErrorCode set_block_size(EPS eps, PetscInt columns) {
  PetscBool is_ours = PETSC_FALSE;
  PetscCall(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(eps), kBlockLanczosType, &is_ours));
  if (is_ours == PETSC_FALSE) return 0;
  if (columns != PETSC_DEFAULT && columns < 1)
    SETERRQ(PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "blocks of %d columns", static_cast<int>(columns));
  get_settings(eps).block = columns;
  eps->state = EPS_STATE_INITIAL;
  return 0;
}

PetscErrorCode set_count_known(EPS eps, PetscBool known) {
  PetscBool is_ours = PETSC_FALSE;
  PetscCall(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(eps), kBlockLanczosType, &is_ours));
  if (is_ours == PETSC_TRUE) get_settings(eps).is_count_known = known;
  return 0;
}

PetscErrorCode set_locked(EPS eps, const LockedModes* locked) {
  PetscBool is_ours = PETSC_FALSE;
  PetscCall(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(eps), kBlockLanczosType, &is_ours));
  if (is_ours == PETSC_TRUE) get_settings(eps).locked = locked;
  return 0;
}

PetscErrorCode set_mass_diagonal(EPS eps, const double* diagonal) {
  PetscBool is_ours = PETSC_FALSE;
  PetscCall(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(eps), kBlockLanczosType, &is_ours));
  if (is_ours == PETSC_TRUE) get_settings(eps).mass_diagonal = diagonal;
  return 0;
}

PetscErrorCode set_checkpoint(EPS eps, LanczosCheckpoint* checkpoint) {
  PetscBool is_ours = PETSC_FALSE;
  PetscCall(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(eps), kBlockLanczosType, &is_ours));
  if (is_ours == PETSC_TRUE) get_settings(eps).checkpoint = checkpoint;
  return 0;
}

}  // namespace carillon::eigen
