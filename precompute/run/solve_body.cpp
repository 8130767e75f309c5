#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "precompute/eigen/search_checkpoint.hpp"
#include "precompute/fem/energy.hpp"
#include "precompute/run/io/checkpoint_file.hpp"
#include "precompute/run/io/fingerprint.hpp"
#include "precompute/run/io/matrices.hpp"
#include "precompute/run/stages.hpp"
#include "runtime/bank/select.hpp"

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
  error_bars::Solution solution{modes.lambda, modes.residual, modes.shapes,
                                modes.proof.counts.empty() ? run.job.band_hz[0] : modes.proof.counts.front().freq_hz,
                                is_cut || modes.proof.counts.empty() ? last_hz : modes.proof.counts.back().freq_hz};
  solution.below = std::max<std::int64_t>(0, modes.count_below_low - modes.rigid_count - modes.mechanism_count);
  return solution;
}

constexpr double kMostCents = 1700.0;  // that a mesh is solved beyond an end of the band

/// How far the mesh must be solved beyond an end of the band [cents]. stated: until no corrected frequency is in it; reach: until no error
/// bar is.
double choose_cents(double stated, double reach) {
  constexpr double kGrowth = 1.1, kBeyond = 50.0;                                       // of corrections farther out; for bars
  return std::ceil(std::min(kGrowth * std::min(reach, stated + kBeyond), kMostCents));  // whole cents: the same on any number of ranks
}

/// Interval in cents from `from_hz` up to lambda.
double calc_cents(double from_hz, double lambda) { return 1200 * std::log2(std::sqrt(lambda) / (2 * std::numbers::pi) / from_hz); }

/// A list of few modes, or of less than an octave amid the modes, may lack a kind with larger corrections, as the second of two kinds that
/// begin in turn. It has to show some modes beyond the band, unless the mesh is solved that far. Returns how far it is to be solved
/// [cents]; 0: far enough.
double find_unseen_cents(const job::JobSpec& job, const eigen::Modes& modes, const error_bars::Corrections& corrected) {
  constexpr std::int64_t kShown = 12;
  constexpr double kLarger = 10.0;  // times the largest correction; torsion of a bar in coarse T10: eight times that of bending
  const double top_hz = modes.proof.counts.back().freq_hz, held = -calc_cents(top_hz, modes.lambda.front());
  if (corrected.stated_below > 0.0 ? held >= 1200.0 : std::ssize(modes.lambda) >= kShown) return 0.0;
  double largest = 0.0;
  std::int64_t beyond = 0;
  for (std::size_t m = 0; m < modes.lambda.size(); ++m) {
    largest = std::max(largest, std::abs(600 * std::log2(corrected.lambda[m] / modes.lambda[m])));
    beyond += bank::is_below_end(std::sqrt(corrected.lambda[m]) / (2 * std::numbers::pi), job.band_hz[1]) ? 0 : 1;
  }
  const double solved = 1200 * std::log2(top_hz / job.band_hz[1]), most = std::min(kLarger * largest, kMostCents);
  if (beyond >= kShown || solved >= most) return 0.0;
  const double spacing = held / static_cast<double>(modes.lambda.size());
  return std::ceil(std::min(std::max(2 * solved, solved + static_cast<double>(kShown - beyond) * spacing), most));
}

/// Range of the mesh beyond which no corrected frequency lies in the job's band, predicted from the modes near the ends of the present one;
/// nullopt if the present one is wide enough.
std::optional<Range> find_wider_range(const Run& run, const Range& range, const eigen::Modes& modes,
                                      const error_bars::Corrections& corrected) {
  if (modes.lambda.empty()) return std::nullopt;
  constexpr double kEdge = 1e-6;  // relative: counts are taken so near the ends
  const auto [low_hz, high_hz] = run.job.band_hz;
  Range wider = range;
  if (modes.band_count == std::ssize(modes.lambda)) {
    const double top_hz = modes.proof.counts.back().freq_hz, stated = -calc_cents(top_hz, corrected.stated_above);
    double cents = find_unseen_cents(run.job, modes, corrected);
    if (1200 * std::log2(top_hz / high_hz) < stated)
      cents = std::max(cents, choose_cents(stated, -calc_cents(top_hz, corrected.complete_below)));
    if (const double end_hz = high_hz * std::exp2(cents / 1200); end_hz > top_hz * (1 + kEdge)) wider.high_hz = end_hz;
  } else if (range.max_modes) {
    wider.max_modes = std::max(*range.max_modes, *find_computed_count(run.job) + count_below_band(run.job, corrected));
    const bool is_short = std::ssize(find_bank_modes(run.job, corrected)) < *run.job.max_modes;
    if (is_short && wider.max_modes == range.max_modes) *wider.max_modes *= 2;
  }
  const double bottom_hz = modes.proof.counts.front().freq_hz;
  if (corrected.stated_below > 0.0 && bottom_hz <= low_hz) {  // rounding may have moved it up
    const double stated = calc_cents(bottom_hz, corrected.stated_below);
    if (1200 * std::log2(low_hz / bottom_hz) < stated) {
      const double end_hz = low_hz / std::exp2(choose_cents(stated, calc_cents(bottom_hz, corrected.complete_above)) / 1200);
      if (end_hz < bottom_hz * (1 - kEdge)) wider.low_hz = end_hz;
    }
  }
  const bool is_wider = wider.low_hz != range.low_hz || wider.high_hz != range.high_hz || wider.max_modes != range.max_modes;
  return is_wider ? std::optional(wider) : std::nullopt;
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
  Range range = find_range(run.job, setting);
  while (const std::optional<Range> wider = find_wider_range(run, range, solved.modes, bars.corrected)) {
    range = *wider;
    solved.modes = find_more_modes(run, setting, body, problem, range, solved.modes);
    bars = calc_errors(run, body, system, solved.modes);
  }
  warn_of_band(run, body, solved.modes, bars.corrected);
  solved.errors = calc_properties(run, body, system, solved.modes, std::move(bars));
  if (find_bank_modes(run.job, solved.errors.bars.corrected).empty()) run.log.warn("no mode in the band: the bank will be silent");
  save_if_requested(run, solved.modes, has_later_stages(run.job));  // later stages may take longer than the modes
  if (run.checkpoint) run.checkpoint->end();
  solved.properties = std::move(system.properties);
  return solved;
}

}  // namespace carillon::run
