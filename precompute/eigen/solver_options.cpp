#include "precompute/eigen/solver_options.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "precompute/eigen/slepc_block_lanczos.hpp"
#include "precompute/eigen/types.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

struct Known {
  std::string_view type;
  Family family;
};
constexpr std::array kKnown{Known{kBlockLanczosType, Family::block}, Known{EPSKRYLOVSCHUR, Family::krylov},
                            Known{EPSARNOLDI, Family::krylov},       Known{EPSLANCZOS, Family::krylov},
                            Known{EPSSUBSPACE, Family::plain},       Known{EPSGD, Family::davidson},
                            Known{EPSJD, Family::davidson},          Known{EPSLAPACK, Family::dense}};

struct Refused {
  std::string_view name;
  const char* why;
};

constexpr const char* kOnlyLowest = "it seeks the lowest eigenvalues only, and a band has a lower end and rigid modes below it";
constexpr std::array kRefusedTypes{
    Refused{EPSLOBPCG, kOnlyLowest},
    Refused{EPSRQCG, kOnlyLowest},
    Refused{EPSPOWER, "it seeks one mode at a time and does not come to an end where two lie about as far from the shift"},
    Refused{EPSCISS, "it seeks within a contour and would need factorisations of its own, of complex matrices"},
    Refused{"lyapii", "it seeks the rightmost eigenvalues of matrices that are not symmetric"},
    Refused{"scalapack", "it knows no shift"},
    Refused{"elpa", "it knows no shift"},
};

constexpr const char* kBand = "the band is \"band_hz\" of the job, and a shorter search \"max_modes\"";
constexpr const char* kShift =
    "the shift and its factorisation are the program's, which counts modes by them; \"solver.factorisation\" of the "
    "job says who factorises";
constexpr const char* kProblem = "K and M are symmetric and M is positive definite, which the count of the modes rests on";
constexpr std::array kRefusedOptions{
    Refused{"-eps_nev", kBand},
    Refused{"-eps_interval", kBand},
    Refused{"-eps_all", kBand},
    Refused{"-eps_largest_magnitude", kBand},
    Refused{"-eps_smallest_magnitude", kBand},
    Refused{"-eps_largest_real", kBand},
    Refused{"-eps_smallest_real", kBand},
    Refused{"-eps_largest_imaginary", kBand},
    Refused{"-eps_smallest_imaginary", kBand},
    Refused{"-eps_target_magnitude", kBand},
    Refused{"-eps_target_real", kBand},
    Refused{"-eps_target_imaginary", kBand},
    Refused{"-eps_target", kShift},
    Refused{"-st_shift", kShift},
    Refused{"-st_type", kShift},
    Refused{"-st_matmode", kShift},
    Refused{"-st_pc_type", kShift},
    Refused{"-eps_hermitian", kProblem},
    Refused{"-eps_gen_hermitian", kProblem},
    Refused{"-eps_gen_indefinite", kProblem},
    Refused{"-eps_non_hermitian", kProblem},
    Refused{"-eps_gen_non_hermitian", kProblem},
    Refused{"-eps_pos_gen_non_hermitian", kProblem},
};

// Those that SLEPc knows, ours among them.
std::vector<std::string> list_types() {
  check(EPSInitializePackage());
  check(register_block_lanczos());
  const char** names = nullptr;
  int count = 0;
  check(PetscFunctionListGet(EPSList, &names, &count));
  std::vector<std::string> types;
  for (int i = 0; i < count; ++i)
    if (names[i] != nullptr) types.emplace_back(names[i]);  // The count has the closing null in it.
  check(PetscFree(names));
  std::sort(types.begin(), types.end());
  return types;
}

bool is_refused(const std::string& type) {
  return std::any_of(kRefusedTypes.begin(), kRefusedTypes.end(), [&](const Refused& refused) { return refused.name == type; });
}

void check_type(const std::string& type, PetscInt unknowns) {
  std::vector<std::string> types = list_types();
  const bool is_there = std::find(types.begin(), types.end(), type) != types.end();
  std::erase_if(types, is_refused);
  std::string choice;
  for (const std::string& name : types) choice += (choice.empty() ? "" : ", ") + name;
  if (type.empty()) throw InputError(fmt::format("\"-eps_type\" names no type; take one of {}", choice));
  if (!is_there) throw InputError(fmt::format("\"-eps_type {}\": SLEPc has no such type; take one of {}", type, choice));
  for (const Refused& refused : kRefusedTypes) {
    if (refused.name == type) throw InputError(fmt::format("\"-eps_type {}\": {}; take one of {}", type, refused.why, choice));
  }
  if (type == EPSLAPACK && unknowns > kMaxDenseUnknowns)
    throw InputError(
        fmt::format("\"-eps_type lapack\": LAPACK solves up to {} unknowns, and there are {}; take another type or a coarser mesh",
                    kMaxDenseUnknowns, unknowns));
}

}  // namespace

Family find_family(EPS eps) {
  const char* type = nullptr;
  check(EPSGetType(eps, &type));
  for (const Known& known : kKnown) {
    if (type != nullptr && known.type == type) return known.family;
  }
  return Family::plain;
}

void check_solver_options(PetscInt unknowns) {
  std::string type(128, '\0');
  PetscBool is_given = PETSC_FALSE;
  check(PetscOptionsGetString(nullptr, nullptr, "-eps_type", type.data(), type.size(), &is_given));
  if (is_given == PETSC_TRUE) check_type(type.c_str(), unknowns);
  for (const Refused& refused : kRefusedOptions) {
    check(PetscOptionsHasName(nullptr, nullptr, std::string(refused.name).c_str(), &is_given));
    if (is_given == PETSC_TRUE) throw InputError(fmt::format("\"{}\" cannot be given: {}", refused.name, refused.why));
  }
}

}  // namespace carillon::eigen
