// Stage "coupling" of a build without the component NONLINEAR.
#include "precompute/run/stages.hpp"
#include "runtime/base/component.hpp"

namespace carillon::run {

void check_coupling(const job::JobSpec& job) {
  if (job.nonlinear) base::refuse_missing(job.file.string() + ": \"nonlinear\"", "NONLINEAR");
}

CouplingReport couple_modes(Run& run, const Solution&) {
  check_coupling(run.job);
  return {};
}

}  // namespace carillon::run
