#include "precompute/run/known_body.hpp"

#include <fmt/core.h>

#include <cmath>
#include <numbers>

#include "precompute/analytic/make_bank.hpp"
#include "precompute/run/run.hpp"
#include "precompute/run/stages.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/host.hpp"
#include "runtime/base/json.hpp"

namespace carillon::run {
namespace {

namespace fs = std::filesystem;

void check_options(const Run& run) {
  if (!run.options.matrices.empty())
    throw InputError(fmt::format("{}: the modes of a \"{}\" are known, and there are no matrices; remove --matrices", run.job.file.string(),
                                 job::get_key(*run.job.analytic)));
  if (!run.options.solver_options.empty())
    throw InputError(fmt::format("the solver option \"{}\" is not used: the modes of a \"{}\" are known, and no solver runs",
                                 run.options.solver_options[0], job::get_key(*run.job.analytic)));
}

base::Json describe_known_body(const Run& run, const analytic::Made& made) {
  base::Json record = describe_program(run);
  record.set("theory", made.theory).set("method", made.method);
  if (!made.coupling.empty()) record["coupling"] = made.coupling;
  for (const std::string& name : made.names) record["mode_names"].append(name);
  for (const std::string& warning : run.log.get_warnings()) record["warnings"].append(warning);
  return record;
}

}  // namespace

void check_known_body(const job::JobSpec&) {}

RunSummary write_known_body(Run& run) {
  RunSummary summary;
  summary.bank = run.job.bank;
  summary.resolved = job::find_resolved_path(run.job.bank);
  comm::Communicator(run.comm).agree([&] { check_options(run); });
  analytic::Made made;
  run.log.begin("modes", job::get_key(*run.job.analytic));
  comm::Communicator(run.comm).agree([&] {
    if (run.comm.is_root()) made = analytic::make_bank(run.job);
  });
  run.log.end();
  run.log.begin("write", summary.bank.string());
  comm::Communicator(run.comm).agree([&] {
    if (!run.comm.is_root()) return;
    for (const std::string& warning : made.warnings) run.log.warn(warning);
    const std::string record =
        job::resolved_json(run.job, fs::absolute(summary.bank).parent_path(), describe_known_body(run, made).sorted_text());
    made.bank.provenance = record;
    write_bank(run, made.bank);
    base::write_file(job::find_resolved_path(run.bank), record);
    summary.result = fmt::format("{}\n{}\n{}", made.theory, bank::describe_completeness(made.bank), bank::describe_accuracy(made.bank));
    if (!made.coupling.empty()) summary.result += "\n" + made.coupling;
    if (const std::size_t count = made.bank.mode_count(); count > 0)
      summary.result += fmt::format("\n{:.2f} Hz to {:.2f} Hz", made.bank.freq_hz(0), made.bank.freq_hz(count - 1));
  });
  run.log.end();
  return summary;
}

std::string validate_known_body(const Run& run) {
  const double begin_s = base::get_process_cpu_s();
  const analytic::Made made = analytic::make_bank(run.job);
  const double seconds = base::get_process_cpu_s() - begin_s;
  const auto modes = static_cast<std::int64_t>(made.bank.mode_count());
  const std::int64_t bytes = base::find_memory().peak + 2 * static_cast<std::int64_t>(made.bank.shape.size());
  if (!run.options.json) {
    std::string text = fmt::format("{}: ok\n{}, {} vertices\n{} modes in {:g} .. {:g} Hz: {}\n1 rank: at most {:.2f} GB, about {:.1f} s",
                                   run.job.file.string(), made.theory, made.bank.vertex_count(), modes, made.bank.band_hz[0],
                                   made.bank.band_hz[1], made.method, 1e-9 * static_cast<double>(bytes), seconds);
    for (const std::string& warning : made.warnings) text += "\n" + warning;
    return text;
  }
  base::Json root;
  root["ok"] = true;
  root["mesh"].set("source", made.theory).set("nodes", made.bank.vertex_count());
  for (const char* key : {"count", "estimate", "low", "high"}) root["modes"][key] = modes;
  root["modes"]["how"] = "counted";
  for (const char* ranks : {"1", "2", "4"}) {
    root["memory_bytes"][ranks] = bytes;
    root["wall_seconds"][ranks] = seconds;
  }
  root.set("cpu_seconds", seconds).set("fits_here", true);
  for (const std::string& warning : run.log.get_warnings()) root["warnings"].append(warning);
  for (const std::string& warning : made.warnings) root["warnings"].append(warning);
  return root.sorted_text();
}

std::string list_modes_at(const comm::Communicator& comm, const fs::path& job_file, const RunOptions& options) {
  RunOptions silent = options;
  silent.quiet = true;
  Run run(comm, silent);
  open_job(run, job_file, job::BankKey::optional);
  const job::JobSpec& job = run.job;
  if (!job.analytic)
    throw InputError(
        fmt::format("{}: --at is for bodies whose modes are known (string, beam, membrane, plate, modes_csv)", job.file.string()));
  std::string text = "mode,name,frequency_hz,phi_x,phi_y,phi_z,amplitude\n";
  std::size_t number = 0;
  for (const analytic::ModeAtPoint& mode : analytic::calc_modes_at(job, *options.at_m))
    text += fmt::format("{},\"{}\",{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n", ++number, mode.name, mode.freq_hz, mode.phi[0], mode.phi[1],
                        mode.phi[2], std::hypot(mode.phi[0], mode.phi[1], mode.phi[2]) / (2.0 * std::numbers::pi * mode.freq_hz));
  return text;
}

}  // namespace carillon::run
