#include "precompute/run/phase_names.hpp"

#include <fmt/core.h>

#include <algorithm>

namespace carillon::run {
namespace {

struct PhaseName {
  const char* key;
  const char* text;
};

PhaseName find_name(eigen::Phase phase) {
  switch (phase) {
    case eigen::Phase::kRigid:
      return {"rigid", "rigid modes in closed form"};
    case eigen::Phase::kAnalyse:
      return {"analyse", "elimination order"};
    case eigen::Phase::kCount:
      return {"count", "counting the modes of the band"};
    case eigen::Phase::kFactor:
      return {"factor", "factorising K - sigma M"};
    case eigen::Phase::kIterate:
      return {"iterate", ""};
    case eigen::Phase::kCheck:
      return {"check", "residuals and orthogonality"};
  }
  return {"", ""};
}

}  // namespace

eigen::Factorisation to_eigen(job::Factorisation factorisation) {
  switch (factorisation) {
    case job::Factorisation::ldlt:
      return eigen::Factorisation::kLdlt;
    case job::Factorisation::mumps:
      return eigen::Factorisation::kMumps;
    default:
      return eigen::Factorisation::kAutomatic;
  }
}

eigen::Method to_eigen(job::Method method) {
  switch (method) {
    case job::Method::block_lanczos:
      return eigen::Method::kBlockLanczos;
    case job::Method::krylov_schur:
      return eigen::Method::kKrylovSchur;
    case job::Method::dense:
      return eigen::Method::kDense;
    default:
      return eigen::Method::kAutomatic;
  }
}

std::string get_key(eigen::Phase phase) { return find_name(phase).key; }

std::string describe(const eigen::Progress& progress) {
  if (progress.phase != eigen::Phase::kIterate) return find_name(progress.phase).text;
  return fmt::format("{} of {} modes", std::min(progress.modes_done, progress.modes_wanted), progress.modes_wanted);
}

}  // namespace carillon::run
