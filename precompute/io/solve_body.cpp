#include "precompute/io/solve_body.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "precompute/eigen/search_keeper.hpp"
#include "precompute/eigen/solver_options.hpp"
#include "precompute/fem/element.hpp"
#include "precompute/fem/energy.hpp"
#include "precompute/io/checkpoint_file.hpp"
#include "precompute/io/fingerprint.hpp"
#include "precompute/io/matrices.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::io {
namespace {

/// A line whenever the phase changes or another tenth of the modes is done.
class ProgressLines {
 public:
  explicit ProgressLines(const Run& run) : stations_(run.stations), file_(run.progress.get()) {}
  void operator()(const eigen::Progress& progress) {
    if (file_ != nullptr) file_->advance(progress);
    const std::int64_t tenth = progress.modes_wanted > 0 ? 10 * progress.modes_done / progress.modes_wanted : 0;
    if (progress.phase == phase_ && tenth == tenth_) return;
    phase_ = progress.phase;
    tenth_ = tenth;
    stations_.say(describe(progress));
  }

 private:
  static std::string describe(const eigen::Progress& progress) {
    switch (progress.phase) {
      case eigen::Phase::kRigid:
        return "rigid motions in closed form";
      case eigen::Phase::kAnalyse:
        return "elimination order";
      case eigen::Phase::kCount:
        return "counting the modes of the band";
      case eigen::Phase::kFactor:
        return "factorising K - sigma M";
      case eigen::Phase::kIterate:
        return fmt::format("{} of {} modes", std::min(progress.modes_done, progress.modes_wanted), progress.modes_wanted);
      case eigen::Phase::kCheck:
        return "residuals and orthogonality";
    }
    return {};
  }

  const Stations& stations_;
  ProgressFile* file_;
  std::optional<eigen::Phase> phase_;
  std::int64_t tenth_ = 0;
};

eigen::Factorisation find_factorisation(job::Factorisation wanted) {
  switch (wanted) {
    case job::Factorisation::ldlt:
      return eigen::Factorisation::kLdlt;
    case job::Factorisation::mumps:
      return eigen::Factorisation::kMumps;
    case job::Factorisation::cholmod:
      return eigen::Factorisation::kCholmod;
    default:
      return eigen::Factorisation::kAutomatic;
  }
}

eigen::Method find_method(job::Method wanted) {
  switch (wanted) {
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

/// Said before anything is assembled.
void check_method(const Run& run, std::int64_t unknowns) {
  eigen::check_solver_options(petsc::to_petsc_int(unknowns));
  if (run.job.method != job::Method::dense || unknowns <= eigen::kMostDenseUnknowns) return;
  throw InputError(fmt::format("{}: \"solver.method\": \"dense\" solves up to {} unknowns, and the body has {}; take \"automatic\"",
                               run.job.file.string(), eigen::kMostDenseUnknowns, unknowns));
}

eigen::Modes solve(Run& run, const Setting& setting, const fem::System& system, eigen::NodeLayout layout) {
  eigen::Options options = make_options(run, setting);
  if (run.checkpoint) options.checkpoint = &run.checkpoint->get();
  ProgressLines lines(run);
  options.progress = [&lines](const eigen::Progress& progress) { lines(progress); };
  run.stations.begin("modes", fmt::format("{:g} Hz to {:g} Hz", options.low_hz, options.high_hz));
  eigen::Modes modes = eigen::solve_modes({system.stiffness, system.mass, std::move(layout)}, options);
  const double worst = modes.residual.empty() ? 0.0 : *std::max_element(modes.residual.begin(), modes.residual.end());
  run.stations.say(fmt::format("{} modes, {} rigid ones deflated, worst residual {:.1e}, {}", modes.lambda.size(), modes.rigid_count, worst,
                               modes.factor.solver));
  run.stations.end();
  return modes;
}

/// The words of PETSc and SLEPc that the user gave and that may change what is found.
std::string list_changes(const Run& run) {
  std::string text;
  bool counts = false;
  for (const std::string& word : run.options.solver_options) {
    const bool is_name = word.size() > 1 && word[0] == '-' && std::isdigit(static_cast<unsigned char>(word[1])) == 0;
    if (is_name) counts = word.find("_view") == std::string::npos && word.find("_monitor") == std::string::npos;
    if (counts) text += (text.empty() ? "" : " ") + word;
  }
  return text;
}

/// A solve that fails under the user's options fails by them, for all that is known; the body has no part in the message.
eigen::Modes solve_named(Run& run, const Setting& setting, const Body& body, const fem::System& system, eigen::NodeLayout layout) {
  const std::string changes = list_changes(run);
  const auto step = [&] { return solve(run, setting, system, std::move(layout)); };
  if (changes.empty()) return name_errors(body.source, run, step);
  try {
    return step();
  } catch (const SolveError& error) {
    throw InputError(
        fmt::format("the solve failed under the solver options \"{}\": {} Without the options it may not.", changes, error.what()));
  }
}

estimate::ErrorBars calc_bars(Run& run, const Body& body, const fem::System& system, const SolvedBody& solved) {
  const eigen::Modes& modes = solved.modes;
  std::vector<estimate::Solid> solids;
  for (const job::Material& material : solved.materials.list) solids.push_back({material.calc_elasticity_pa(), material.density_kg_m3});
  const bool is_cut = modes.band_count > static_cast<std::int64_t>(modes.lambda.size());
  const double last_hz = modes.lambda.empty() ? 0.0 : std::sqrt(modes.lambda.back()) / (2 * std::numbers::pi);
  estimate::Solution solution{modes.lambda, modes.residual, modes.shapes, find_low_hz(run.job, modes),
                              is_cut ? last_hz : run.job.band_hz[1]};
  solution.below = std::max<std::int64_t>(0, modes.count_below_low - modes.rigid_count - modes.mechanism_count);
  return estimate::calc_error_bars(run.comm, body.pieces.local, system.stiffness, system.mass, solids, solved.materials.of_tet,
                                   run.job.mass, solution);
}

void begin_checkpoint(Run& run, const Setting& setting, const Body& body) {
  if (!run.checkpoint) return;
  const Fingerprint job = find_job_fingerprint(run.job, run.options.solver_options);
  run.checkpoint->begin(setting, find_system_fingerprint(run.comm, job, setting, body.pieces.local), body.pieces.local);
}

/// All modes are there: a safe point. Throws eigen::Stopped.
void keep(Run& run, const eigen::Modes& modes) {
  if (!run.checkpoint) return;
  const eigen::Wish wish = run.checkpoint->vote();
  if (wish.stop || wish.save) eigen::save_modes(modes, run.checkpoint->get());
  if (wish.stop) throw eigen::Stopped();
}

double calc_diagonal(const mesh::CheckReport& check) {
  return std::hypot(check.box_high[0] - check.box_low[0], check.box_high[1] - check.box_low[1], check.box_high[2] - check.box_low[2]);
}

/// A body of which the fundamental is not heard is seldom what was meant; most often its mesh is in millimetres.
void warn_of_low_modes(Run& run, const Body& body, const eigen::Modes& modes) {
  const std::int64_t below = modes.count_below_low - modes.rigid_count - modes.mechanism_count;
  if (below <= 0 || find_low_hz(run.job, modes) > run.job.band_hz[0]) return;
  run.stations.warn(
      fmt::format("the fundamental is out of the band: {} mode{} below the band, which begins at {:g} Hz; the body measures {:.3g} m "
                  "across: if it was made in millimetres, {}",
                  below, below == 1 ? " lies" : "s lie", run.job.band_hz[0], calc_diagonal(body.check), describe_scale_key(run.job)));
}

void warn_of_oddities(Run& run, const Body& body, const eigen::Modes& modes) {
  warn_of_low_modes(run, body, modes);
  if (const double low_hz = find_low_hz(run.job, modes); low_hz > run.job.band_hz[0]) {
    run.stations.warn(fmt::format(
        "the band begins at {:.3g} Hz: of the {} motions below, the rigid ones left out, rounding beside what is stiffest leaves no digit",
        low_hz, modes.count_below_low - modes.rigid_count));
  } else if (modes.mechanism_count > 0) {
    run.stations.warn(fmt::format(
        "the body has {} motions without stiffness besides the rigid ones (parts that hang on a point, on an edge or on next to nothing)",
        modes.mechanism_count));
  }
  if (modes.lambda.empty()) run.stations.warn("no mode lies in the band: the bank will be silent");
}

/// Elements that cannot bend without straining in the one way that the solid hardly allows are too stiff; docs/elements.md.
void warn_of_locking(Run& run, const job::Material& material, bool is_linear) {
  constexpr double kStiff = 50;
  if (is_linear && material.poisson_ratio > 0.4)
    run.stations.warn(
        fmt::format("T4 locks at a Poisson's ratio of {:g}: its frequencies will be several per cent sharp; use \"element\": \"T10\"",
                    material.poisson_ratio));
  if (!material.orthotropic) return;
  job::Elasticity c = material.calc_elasticity_pa();
  const double mean = fem::calc_mean_lambda(c);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c[6 * i + j] -= mean;
  const auto stiffness = job::calc_eigenvalues(c);
  if (stiffness[5] > kStiff * stiffness[4])
    run.stations.warn(
        fmt::format("{}: the solid is {:.0f} times as stiff in one strain as in any other: coarse meshes lock and are some per cent sharp; "
                    "compare with a finer one",
                    material.place, stiffness[5] / stiffness[4]));
}

}  // namespace

double find_low_hz(const job::JobSpec& job, const eigen::Modes& modes) {
  return modes.proof.counts.empty() ? job.band_hz[0] : std::max(job.band_hz[0], modes.proof.counts.front().freq_hz);
}

eigen::Options make_options(const Run& run, const Setting& setting) {
  eigen::Options options;
  options.low_hz = run.job.band_hz[0];
  options.high_hz = run.job.band_hz[1];
  if (run.job.max_modes) options.max_modes = *run.job.max_modes;
  options.tolerance = setting.tolerance;
  options.factorisation = find_factorisation(run.job.factorisation);
  options.method = find_method(run.job.method);
  return options;
}

eigen::NodeLayout make_layout(fem::Distribution& pieces) {
  eigen::NodeLayout layout;
  const auto free_nodes = pieces.local.free_nodes;
  layout.position.assign(pieces.local.nodes_m.begin(), pieces.local.nodes_m.begin() + free_nodes);
  layout.component.assign(pieces.local.component.begin(), pieces.local.component.begin() + free_nodes);
  layout.component_count = pieces.components;
  layout.held = pieces.held_m;
  layout.elimination_position = std::move(pieces.elimination_position);
  return layout;
}

fem::System assemble_body(Run& run, const Setting& setting, Body& body, SolvedBody& solved) {
  check_method(run, 3 * body.pieces.free_nodes);
  const bool is_linear = setting.element == job::Element::T4;
  run.stations.begin("assemble", fmt::format("{} unknowns, {}, {} mass", 3 * body.pieces.free_nodes, job::to_text(setting.element),
                                             job::to_text(run.job.mass)));
  // Errors of the materials name the job's line by themselves.
  solved.materials = fem::find_materials(run.comm, body.pieces.local, run.job, body.region_names);
  fem::System system =
      name_errors(body.source, run, [&] { return fem::assemble(run.comm, body.pieces.local, solved.materials, run.job.mass); });
  solved.volume_m3 = fem::calc_volumes(run.comm, body.pieces.local, solved.materials);
  solved.rigid = fem::calc_rigid_body(run.comm, body.pieces.local, solved.materials);
  for (const job::Material& material : solved.materials.list) warn_of_locking(run, material, is_linear);
  run.stations.end();
  return system;
}

SolvedBody solve_body(Run& run, const Setting& setting, Body& body) {
  SolvedBody solved;
  const fem::System system = assemble_body(run, setting, body, solved);

  write_matrices(run, body, system);
  begin_checkpoint(run, setting, body);
  solved.modes = solve_named(run, setting, body, system, make_layout(body.pieces));
  keep(run, solved.modes);
  warn_of_oddities(run, body, solved.modes);

  run.stations.begin("errors", "error bars and decays");
  solved.decay_per_s =
      fem::calc_decay(run.comm, body.pieces.local, solved.materials, run.job.mass, solved.modes.lambda, solved.modes.shapes).decay_per_s;
  solved.supports =
      fem::calc_supports(run.comm, body.pieces.local, solved.materials, run.job.mass, solved.modes.lambda, solved.modes.shapes);
  solved.bars = name_errors(body.source, run, [&] { return calc_bars(run, body, system, solved); });
  run.stations.end();
  keep(run, solved.modes);
  if (run.checkpoint) run.checkpoint->end();
  return solved;
}

}  // namespace carillon::io
