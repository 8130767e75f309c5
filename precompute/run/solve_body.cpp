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

error_bars::ErrorBars calc_bars(const Run& run, const Body& body, const AssembledSystem& system, const error_bars::Solution& solution) {
  const fem::Materials& materials = system.properties.materials;
  std::vector<error_bars::Solid> solids;
  for (const material::Material& material : materials.list) solids.push_back({material.calc_elasticity_pa(), material.density_kg_m3});
  return error_bars::calc_error_bars(run.comm, body.pieces.local, system.matrices.stiffness, system.matrices.mass, solids, materials.of_tet,
                                     run.job.mass, solution);
}

error_bars::Solution describe(const Run& run, const eigen::Modes& modes) {
  const bool is_cut = modes.band_count > static_cast<std::int64_t>(modes.lambda.size());
  const double last_hz = modes.lambda.empty() ? 0.0 : std::sqrt(modes.lambda.back()) / (2 * std::numbers::pi);
  error_bars::Solution solution{modes.lambda, modes.residual, modes.shapes, find_low_hz(run.job, modes),
                                is_cut || modes.proof.counts.empty() ? last_hz : modes.proof.counts.back().freq_hz};
  solution.below = std::max<std::int64_t>(0, modes.count_below_low - modes.rigid_count - modes.mechanism_count);
  return solution;
}

/// Upper end of the mesh's band [Hz] beyond which no corrected frequency lies in the job's, predicted from the modes near its present end;
/// 0 if it is there already, or the job takes only some of the modes. It includes what error bars reach, unless they are long.
double find_wider_end(const Run& run, const eigen::Modes& modes, const error_bars::Corrections& corrected) {
  constexpr double kGrowth = 1.1, kBeyond = 50.0, kMost = 1700.0;  // of corrections towards higher modes; cents: for bars, and in all
  if (modes.lambda.empty() || modes.band_count > std::ssize(modes.lambda)) return 0.0;
  const double high_hz = run.job.band_hz[1], solved_hz = modes.proof.counts.back().freq_hz;
  const auto calc_cents = [&](double lambda) { return 1200 * std::log2(solved_hz / (std::sqrt(lambda) / (2 * std::numbers::pi))); };
  const double stated = calc_cents(corrected.stated_above), reach = calc_cents(corrected.complete_below);
  if (1200 * std::log2(solved_hz / high_hz) >= stated) return 0.0;
  const double cents = std::min(kGrowth * std::min(reach, stated + kBeyond), kMost);
  const double end_hz = high_hz * std::exp2(std::ceil(cents) / 1200);  // whole cents: the same on any number of ranks
  return end_hz > solved_hz ? end_hz : 0.0;
}

/// Collective. Throws on every rank: SolveError, SystemError, naming the body and the job.
error_bars::ErrorBars calc_errors(Run& run, const Body& body, const AssembledSystem& system, const eigen::Modes& modes) {
  run.log.begin("errors", "error bars");
  error_bars::ErrorBars bars = name_errors(body.source, run, [&] { return calc_bars(run, body, system, describe(run, modes)); });
  if (bars.level.is_guessed)
    run.log.warn_once(
        "some faces of the mesh are one element wide and meet at 50 to 80 degrees: they may be planes of the body or a coarse round "
        "surface. The frequencies are those of planes; the change for a round surface is stated as \"facets in doubt\". Smaller elements, "
        "or mid-side nodes on the surface, remove the doubt");
  run.log.end();
  return bars;
}

/// Collective.
ModeProperties calc_properties(Run& run, const Body& body, const AssembledSystem& system, const eigen::Modes& modes,
                               error_bars::ErrorBars bars) {
  run.log.begin("errors", "decays and forces on supports");
  const mesh::LocalMesh& mesh = body.pieces.local;
  const fem::Materials& materials = system.properties.materials;
  ModeProperties properties;
  fem::Decay decay = fem::calc_decay(run.comm, mesh, materials, run.job.mass, modes.lambda, modes.shapes);
  properties.decay_per_s = std::move(decay.decay_per_s);
  properties.shares = std::move(decay.shares);
  properties.supports = fem::calc_supports(run.comm, mesh, materials, run.job.mass, modes.lambda, modes.shapes);
  properties.bars = std::move(bars);
  run.log.end();
  return properties;
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
  const eigen::Problem problem{system.matrices.stiffness, system.matrices.mass, make_layout(body)};
  solved.modes = find_modes(run, setting, body, problem);
  save_if_requested(run, solved.modes);
  error_bars::ErrorBars bars = calc_errors(run, body, system, solved.modes);
  for (double end_hz = 0.0; (end_hz = find_wider_end(run, solved.modes, bars.corrected)) > 0.0;) {
    solved.modes = find_more_modes(run, setting, body, problem, end_hz, solved.modes);
    bars = calc_errors(run, body, system, solved.modes);
  }
  solved.errors = calc_properties(run, body, system, solved.modes, std::move(bars));
  if (find_bank_modes(run.job, solved.errors.bars.corrected).empty()) run.log.warn("no mode in the band: the bank will be silent");
  save_if_requested(run, solved.modes, has_later_stages(run.job));  // later stages may take longer than the modes
  if (run.checkpoint) run.checkpoint->end();
  solved.properties = std::move(system.properties);
  return solved;
}

}  // namespace carillon::run
