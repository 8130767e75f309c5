#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "precompute/eigen/search_checkpoint.hpp"
#include "precompute/fem/energy.hpp"
#include "precompute/run/io/checkpoint_file.hpp"
#include "precompute/run/io/fingerprint.hpp"
#include "precompute/run/io/matrices.hpp"
#include "precompute/run/stages.hpp"

namespace carillon::run {
namespace {

error_bars::ErrorBars calc_bars(Run& run, const Body& body, const AssembledSystem& system, const eigen::Modes& modes) {
  const fem::Materials& materials = system.properties.materials;
  std::vector<error_bars::Solid> solids;
  for (const material::Material& material : materials.list) solids.push_back({material.calc_elasticity_pa(), material.density_kg_m3});
  const bool is_cut = modes.band_count > static_cast<std::int64_t>(modes.lambda.size());
  const double last_hz = modes.lambda.empty() ? 0.0 : std::sqrt(modes.lambda.back()) / (2 * std::numbers::pi);
  error_bars::Solution solution{modes.lambda, modes.residual, modes.shapes, find_low_hz(run.job, modes),
                                is_cut ? last_hz : run.job.band_hz[1]};
  solution.below = std::max<std::int64_t>(0, modes.count_below_low - modes.rigid_count - modes.mechanism_count);
  return error_bars::calc_error_bars(run.comm, body.pieces.local, system.matrices.stiffness, system.matrices.mass, solids, materials.of_tet,
                                     run.job.mass, solution);
}

/// Collective. Throws on every rank: SolveError, SystemError, naming the body and the job.
ModeProperties calc_errors(Run& run, const Body& body, const AssembledSystem& system, const eigen::Modes& modes) {
  run.log.begin("errors", "error bars and decays");
  const mesh::LocalMesh& mesh = body.pieces.local;
  const fem::Materials& materials = system.properties.materials;
  ModeProperties errors;
  fem::Decay decay = fem::calc_decay(run.comm, mesh, materials, run.job.mass, modes.lambda, modes.shapes);
  errors.decay_per_s = std::move(decay.decay_per_s);
  errors.shares = std::move(decay.shares);
  errors.supports = fem::calc_supports(run.comm, mesh, materials, run.job.mass, modes.lambda, modes.shapes);
  errors.bars = name_errors(body.source, run, [&] { return calc_bars(run, body, system, modes); });
  if (errors.bars.level.is_guessed)
    run.log.warn_once(
        "some faces of the mesh are one element wide and meet at 50 to 80 degrees: they may be planes of the body or a coarse round "
        "surface. The frequencies are those of planes; the change for a round surface is stated as \"facets in doubt\". Smaller elements, "
        "or mid-side nodes on the surface, remove the doubt");
  run.log.end();
  return errors;
}

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
