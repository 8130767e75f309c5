#include <fmt/core.h>

#include <cstdint>
#include <string>

#include "precompute/petsc/session.hpp"
#include "precompute/run/known_body.hpp"
#include "precompute/run/run.hpp"
#include "precompute/run/same_start.hpp"
#include "precompute/run/stages.hpp"
#include "runtime/base/file.hpp"

namespace carillon::run {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxJobBytes = 16 << 20;

/// Rank 0 reads the text; all ranks parse it, so that all fail alike.
job::JobSpec read_shared_job(const Run& run, const fs::path& file, job::BankKey bank) {
  const std::string text = run.comm.broadcast([&] { return base::read_file(file, "job file", kMaxJobBytes); });
  check_same(run.comm, "jobs", look_at_job(file, kMaxJobBytes));
  return run.comm.agree([&] { return job::parse_job(text, fs::absolute(file), bank); });
}

void check_job(const Run& run) {
  comm::Communicator(run.comm).agree([&] {
    for (const std::string& word : run.options.solver_options)
      if (word.starts_with("-eps_") || word.starts_with("-st_"))
        throw InputError(
            fmt::format("\"{}\": the eigensolver takes no options; choose \"solver.method\" of the job: \"block-lanczos\" or "
                        "\"krylov-schur\"",
                        word));
    check_known_body(run.job);
    check_air(run.job);
    check_coupling(run.job);
    if (!run.comm.is_root() || run.bank.empty()) return;
    base::check_writable(run.bank, "bank");
    base::check_writable(job::find_resolved_path(run.bank), "resolved job");
  });
}

}  // namespace

void open_job(Run& run, const fs::path& file, job::BankKey bank) {
  run.job = read_shared_job(run, file, run.options.bank.empty() ? bank : job::BankKey::optional);
  run.bank = job::find_opened(run.job.bank, run.job.file, file);
  if (!run.options.bank.empty()) {
    run.bank = run.options.bank;
    run.job.bank = fs::absolute(run.options.bank).lexically_normal();
  }
  check_same(run.comm, "banks to write", look_at_place(run.job.bank));
  check_job(run);
  for (const std::string& warning : run.job.warnings) run.log.warn(warning);
}

}  // namespace carillon::run
