#include "precompute/run/solve_body.hpp"

#include <utility>

#include "precompute/eigen/search_checkpoint.hpp"
#include "precompute/run/error_bars_stage.hpp"
#include "precompute/run/io/checkpoint_file.hpp"
#include "precompute/run/io/fingerprint.hpp"
#include "precompute/run/io/matrices.hpp"
#include "precompute/run/modes.hpp"
#include "precompute/run/system.hpp"

namespace carillon::run {
namespace {

void write_matrices(Run& run, const Body& body, const AssembledSystem& system) {
  const auto& folder = run.options.matrices;
  if (folder.empty()) return;
  run.log.begin("matrices", folder.string());
  io::write_matrices(run.comm, folder, body.pieces.local, system.matrices);
  run.log.end();
}

void begin_checkpoint(Run& run, const Setting& setting, const Body& body) {
  if (!run.checkpoint) return;
  const io::Fingerprint job = io::find_job_fingerprint(run.job, run.options.solver_options);
  run.checkpoint->begin(setting, io::find_system_fingerprint(run.comm, job, setting, body.pieces.local), body.pieces.local);
}

/// Between stages, with all modes. must: save in any case. Throws eigen::Stopped when a signal requested it.
void save_if_requested(Run& run, const eigen::Modes& modes, bool must = false) {
  if (!run.checkpoint) return;
  const eigen::CheckpointRequest request = run.checkpoint->vote();
  if (request.stop || request.save || must) eigen::save_modes(modes, run.checkpoint->get());
  if (request.stop) throw eigen::Stopped();
}

}  // namespace

bool has_later_stages(const job::JobSpec& job) { return job.air.method != job::AirMethod::none || job.nonlinear.has_value(); }

SolvedBody solve_body(Run& run, const Setting& setting, Body& body) {
  AssembledSystem system = assemble_system(run, setting, body);
  write_matrices(run, body, system);
  begin_checkpoint(run, setting, body);
  SolvedBody solved;
  solved.modes = find_modes(run, setting, body, system);
  save_if_requested(run, solved.modes);
  solved.errors = calc_errors(run, body, system, solved.modes);
  save_if_requested(run, solved.modes, has_later_stages(run.job));  // later stages may take longer than the modes
  if (run.checkpoint) run.checkpoint->end();
  solved.properties = std::move(system.properties);
  return solved;
}

}  // namespace carillon::run
