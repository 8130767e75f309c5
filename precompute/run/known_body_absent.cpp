// Known modes in a build without the component ANALYTIC.
#include "precompute/run/known_body.hpp"
#include "runtime/base/component.hpp"

namespace carillon::run {

void check_known_body(const job::JobSpec& job) {
  if (job.analytic) base::refuse_missing(job.file.string() + ": a body with known modes", "ANALYTIC");
}

RunSummary write_known_body(Run& run) {
  check_known_body(run.job);
  return {};
}

std::string validate_known_body(const Run& run) {
  check_known_body(run.job);
  return {};
}

std::string list_modes_at(const comm::Communicator&, const std::filesystem::path&, const RunOptions&) {
  base::refuse_missing("--at", "ANALYTIC");
}

}  // namespace carillon::run
