#include "precompute/eigen/shift_invert.hpp"

#include <string>

#include "precompute/la/local_columns.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

// The preconditioner of a transformation that does nothing but apply it, if it is a shell; null otherwise, and where the user has set any
// option of the KSP, which may ask for output.
PC find_direct(ST st) {
  KSP ksp = nullptr;
  PC pc = nullptr;
  const char* prefix = nullptr;
  char* options = nullptr;
  PetscBool applies = PETSC_FALSE;
  PetscBool is_shell = PETSC_FALSE;
  check(STGetKSP(st, &ksp));
  check(KSPGetPC(ksp, &pc));
  check(KSPGetOptionsPrefix(ksp, &prefix));
  check(PetscOptionsGetAll(nullptr, &options));
  const std::string of_ksp = std::string("-") + (prefix != nullptr ? prefix : "") + "ksp_";
  const bool is_set = std::string(options).find(of_ksp) != std::string::npos;
  check(PetscFree(options));
  if (is_set) return nullptr;
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(ksp), KSPPREONLY, &applies));
  check(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), PCSHELL, &is_shell));
  return applies == PETSC_TRUE && is_shell == PETSC_TRUE ? pc : nullptr;
}

}  // namespace

ShiftInvert::ShiftInvert(ST st) : st_(st), direct_(find_direct(st)) { check(STGetShift(st, &sigma_)); }

void ShiftInvert::apply(Mat z, Mat w) const {
  la::mark_changed(w);
  la::mark_changed(z);
  if (direct_ != nullptr) return check(PCMatApply(direct_, z, w));
  check(STMatMatSolve(st_, z, w));
}

}  // namespace carillon::eigen
