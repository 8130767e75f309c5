// Stage "air" of a build without the component AIR.
#include "precompute/run/stages.hpp"
#include "runtime/base/component.hpp"

namespace carillon::run {

void check_air(const job::JobSpec& job) {
  if (job.air.method != job::AirMethod::none) base::refuse_missing(job.file.string() + ": \"radiation\"", "AIR");
}

AirReport add_air(Run& run, bank::Bank&) {
  check_air(run.job);
  return {};
}

RunSummary radiate_bank(const comm::Communicator&, const RunOptions&) { base::refuse_missing("--radiate", "AIR"); }

}  // namespace carillon::run
