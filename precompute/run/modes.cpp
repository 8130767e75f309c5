#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <utility>

#include "precompute/eigen/solve_modes.hpp"
#include "precompute/run/io/checkpoint_file.hpp"
#include "precompute/run/stages.hpp"
#include "runtime/base/error.hpp"

namespace carillon::run {
namespace {

// The band is one of corrected frequencies, so the mesh is solved beyond both ends, by the usual correction near the end of a band. Where
// it is larger, find_more_modes() takes two more factorisations.
constexpr double kUsualCents = 25.0, kUsualCentsT4 = 150.0;
constexpr double kEmptyWidening = 1.5;  // of a band without modes

/// Logs phase changes and every tenth of the modes; forwards all steps to the progress file.
class ProgressLines {
 public:
  explicit ProgressLines(const Run& run) : log_(&run.log), reporter_(run.progress.get()) {}
  void operator()(const eigen::Progress& progress) {
    if (reporter_ != nullptr) reporter_->advance(progress);
    const std::int64_t tenth = progress.modes_wanted > 0 ? 10 * progress.modes_done / progress.modes_wanted : 0;
    if (progress.phase == phase_ && tenth == tenth_) return;
    phase_ = progress.phase;
    tenth_ = tenth;
    log_->print(describe(progress));
  }

 private:
  const RunLog* log_;
  ProgressReporter* reporter_;
  std::optional<eigen::Phase> phase_;
  std::int64_t tenth_ = 0;
};

eigen::Modes solve(Run& run, const eigen::Problem& problem, eigen::Options options, bool is_first) {
  options.memory_limit_bytes = run.options.get_memory_limit_bytes();
  if (run.checkpoint && is_first) options.checkpoint = &run.checkpoint->get();
  options.progress = ProgressLines(run);
  run.log.begin("modes", fmt::format("{:g} Hz to {:g} Hz", options.low_hz, options.high_hz));
  eigen::Modes modes = eigen::solve_modes(problem, options);
  if (modes.lambda.empty() && is_first) {  // on a coarse mesh the first one may be above the band
    options.high_hz *= kEmptyWidening;
    modes = eigen::solve_modes(problem, options);
  }
  const double worst = modes.residual.empty() ? 0.0 : *std::max_element(modes.residual.begin(), modes.residual.end());
  run.log.print(fmt::format("{} modes, {} rigid ones deflated, worst residual {:.1e}, {}", modes.lambda.size(), modes.rigid_count, worst,
                            modes.factor.solver));
  run.log.end();
  return modes;
}

/// The user's solver options that can change the result.
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

/// A failure with solver options of the user is attributed to them.
eigen::Modes solve_named(Run& run, const Body& body, const eigen::Problem& problem, const eigen::Options& options, bool is_first) {
  const std::string changes = list_changes(run);
  const auto step = [&] { return solve(run, problem, options, is_first); };
  if (changes.empty()) return name_errors(body.source, run, step);
  try {
    return step();
  } catch (const SolveError& error) {
    throw InputError(
        fmt::format("the solve failed with the solver options \"{}\": {} Remove them to use the defaults.", changes, error.what()));
  }
}

double calc_diagonal(const mesh::CheckReport& check) {
  return std::hypot(check.box_high[0] - check.box_low[0], check.box_high[1] - check.box_low[1], check.box_high[2] - check.box_low[2]);
}

/// Often the mesh is in millimetres.
void warn_of_low_modes(Run& run, const Body& body, const eigen::Modes& modes, const error_bars::Corrections& corrected) {
  const std::int64_t below = modes.count_below_low - modes.rigid_count - modes.mechanism_count + count_below_band(run.job, corrected);
  if (below <= 0 || find_low_hz(run.job, modes) > run.job.band_hz[0]) return;
  run.log.warn(
      fmt::format("the fundamental is out of the band: {} mode{} below the band, which begins at {:g} Hz; the body measures {:.3g} m "
                  "across: if it is in millimetres, {}",
                  below, below == 1 ? " lies" : "s lie", run.job.band_hz[0], calc_diagonal(body.check), describe_scale_key(run.job)));
}

}  // namespace

void warn_of_band(Run& run, const Body& body, const eigen::Modes& modes, const error_bars::Corrections& corrected) {
  warn_of_low_modes(run, body, modes, corrected);
  if (const double low_hz = find_low_hz(run.job, modes); low_hz > run.job.band_hz[0]) {
    run.log.warn(fmt::format("the band begins at {:.3g} Hz: {} elastic modes below it cannot be resolved in double precision on this mesh",
                             low_hz, modes.count_below_low - modes.rigid_count));
  } else if (modes.mechanism_count > 0) {
    run.log.warn(
        fmt::format("the body has {} motions without stiffness in addition to the rigid ones (parts connected by a point, an edge or "
                    "a very thin link)",
                    modes.mechanism_count));
  }
}

namespace {

eigen::Factorisation to_eigen(job::Factorisation factorisation) {
  switch (factorisation) {
    case job::Factorisation::ldlt:
      return eigen::Factorisation::kLdlt;
    case job::Factorisation::mumps:
      return eigen::Factorisation::kMumps;
    default:
      return eigen::Factorisation::kAutomatic;
  }
}

eigen::Method to_eigen(job::Method method) {
  switch (method) {
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

}  // namespace

double find_low_hz(const job::JobSpec& job, const eigen::Modes& modes) {
  return modes.proof.counts.empty() ? job.band_hz[0] : std::max(job.band_hz[0], modes.proof.counts.front().freq_hz);
}

Range find_range(const job::JobSpec& job, const Setting& setting) {
  const double beyond = std::exp2((setting.element == job::Element::T10 ? kUsualCents : kUsualCentsT4) / 1200);
  // The lowest modes are counted from the lower end.
  return {job.max_modes ? job.band_hz[0] : job.band_hz[0] / beyond, job.band_hz[1] * beyond, find_computed_count(job)};
}

eigen::Options make_options(const job::JobSpec& job, const Setting& setting, const Range& range) {
  eigen::Options options;
  options.low_hz = range.low_hz;
  options.high_hz = range.high_hz;
  options.max_modes = range.max_modes;
  options.expected_hz = setting.expected_hz;
  options.tolerance = setting.tolerance;
  options.factorisation = to_eigen(job.factorisation);
  options.method = to_eigen(job.method);
  return options;
}

eigen::NodeLayout make_layout(Body& body) {
  mesh::DistributedMesh& pieces = body.pieces;
  eigen::NodeLayout layout;
  layout.order = std::move(body.order);
  const auto free_nodes = pieces.local.free_nodes;
  layout.nodes_m.assign(pieces.local.nodes_m.begin(), pieces.local.nodes_m.begin() + free_nodes);
  layout.component.assign(pieces.local.component.begin(), pieces.local.component.begin() + free_nodes);
  layout.component_count = pieces.components;
  layout.fixed = pieces.fixed_m;
  layout.elimination_position = std::move(pieces.elimination_position);
  return layout;
}

eigen::Modes find_modes(Run& run, const Setting& setting, const Body& body, const eigen::Problem& problem) {
  return solve_named(run, body, problem, make_options(run.job, setting, find_range(run.job, setting)), true);
}

eigen::Modes find_more_modes(Run& run, const Setting& setting, const Body& body, const eigen::Problem& problem, const Range& range,
                             const eigen::Modes& known) {
  eigen::Options options = make_options(run.job, setting, range);
  if (!range.max_modes) options.known = &known;
  return solve_named(run, body, problem, options, false);
}

}  // namespace carillon::run
