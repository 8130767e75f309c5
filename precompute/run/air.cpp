#include "runtime/bank/air.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include "precompute/air/radiate.hpp"
#include "precompute/eigen/checkpoint.hpp"
#include "precompute/run/interrupt.hpp"
#include "precompute/run/meshing.hpp"
#include "precompute/run/stages.hpp"
#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/base/file.hpp"

namespace carillon::run {
namespace {

/// "auto" uses boundary elements above this ratio of radiation to material damping: without them the mode would ring 1.3 times as long.
/// Measured by tests/bench/air (docs/reports/radiation.md).
constexpr double kLostToAir = 0.3;

/// Largest ratio of radiation to material damping of all modes, from the gains of a sphere of the same surface: within a factor of two for
/// compact bodies.
double calc_loss_ratio(const bank::Bank& bank) {
  const std::vector<double>& decay_per_s = bank.corrected.is_empty() ? bank.decay_per_s : bank.corrected.decay_per_s;
  const std::vector<double> gains = radiation::calc_gains(bank, radiation::GainKind::kSphere);
  double ratio = 0.0;
  for (std::size_t m = 0; m < gains.size(); ++m) {
    const double by_air = bank::calc_radiation_decay(gains[m]);
    if (by_air > 0.0) ratio = std::max(ratio, decay_per_s[m] > 0.0 ? by_air / decay_per_s[m] : std::numeric_limits<double>::infinity());
  }
  return ratio;
}

/// Decision on boundary elements, with the reason; rank 0.
AirReport choose(const Run& run, const bank::Bank& bank) {
  if (run.job.air.method == job::AirMethod::bem) return {true, "the job asks for it", {}};
  const double roundness = air::calc_roundness(bank);
  const std::string measure = fmt::format("the surface has a roundness of {:.2f}", roundness);
  if (bank.mode_count() == 0) return {false, "no modes", {}};
  if (roundness < air::kCompact)
    return {true, fmt::format("{}, below {:g}: flat, thin or open bodies do not radiate like a sphere", measure, air::kCompact), {}};
  const double ratio = calc_loss_ratio(bank);
  const std::string loss = fmt::format("by the gains of a sphere, radiation damping is up to {:.2g} times material damping", ratio);
  if (ratio > kLostToAir)
    return {
        true, fmt::format("{}, but {}, above {:g}: without boundary elements modes would ring too long", measure, loss, kLostToAir), {}};
  return {false, fmt::format("{}, and the gains of a sphere suffice above {:g}; {}", measure, air::kCompact, loss), {}};
}

air::AirOptions make_air_options(const job::Air& air) {
  air::AirOptions options;
  options.solve.error_db = air.error_db;
  options.most_nodes = air.skin_nodes;
  options.coarsen = coarsen_surface;
  if (air.half_space) options.half_space = air::Plane{air.half_space->point_m, normalise(air.half_space->normal)};
  return options;
}

std::string describe_multipoles(const bank::Multipoles& multipoles) {
  if (multipoles.is_empty()) return "no mode";
  const auto worst = std::max_element(multipoles.error_db.begin(), multipoles.error_db.end());
  const auto heaviest = std::max_element(multipoles.added_mass.begin(), multipoles.added_mass.end());
  return fmt::format("{}\nerror at most {:.1f} dB (mode {}), orders up to {}, added mass up to {:.2g}", multipoles.method, *worst,
                     worst - multipoles.error_db.begin() + 1, *std::max_element(multipoles.order.begin(), multipoles.order.end()),
                     *heaviest);
}

}  // namespace

void check_air(const job::JobSpec&) {}

RunSummary radiate_bank(const comm::Communicator& comm, const RunOptions& options) {
  Run run(comm, options);
  run.job.air.method = job::AirMethod::bem;
  run.job.file = options.radiate;
  bank::Bank bank;
  RunSummary summary;
  comm.agree([&] {
    if (options.bank.empty()) throw InputError("--bank is missing: give the file for the bank with its multipoles");
    if (!comm.is_root()) return;
    bank = bank::read_bank(options.radiate);
    base::check_writable(options.bank, "bank");
  });
  AirReport report;
  try {
    report = add_air(run, bank);
  } catch (const eigen::Stopped&) {
    summary.is_stopped = true;
    summary.result = fmt::format("stopped by {}; the same command resumes from {}", find_stop_name(), options.checkpoint.string());
    return summary;
  }
  comm.agree([&] {
    if (!comm.is_root()) return;
    bank::write_bank(bank, options.bank);
    summary.bank = options.bank;
    summary.result = report.result;
  });
  return summary;
}

AirReport add_air(Run& run, bank::Bank& bank) {
  AirReport report;
  if (run.job.air.method == job::AirMethod::none) return report;
  run.log.begin("air", "sound outside the body");
  run.comm.agree([&] {
    if (run.comm.is_root()) report = choose(run, bank);
  });
  report.is_solved = run.comm.broadcast(static_cast<std::int32_t>(report.is_solved)) != 0;
  run.log.print(fmt::format("boundary elements: {}; {}", report.is_solved ? "yes" : "no", report.why));
  if (!report.is_solved) {
    run.log.end();
    return report;
  }
  air::AirOptions options = make_air_options(run.job.air);
  options.warn = [&run](const std::string& text) { run.log.warn(text); };
  air::Keeper keeper;
  keeper.report = [&run, tenths = 0](const std::string& text, double share) mutable {
    const int now = static_cast<int>(10.0 * share);
    if (std::exchange(tenths, now) != now) run.log.print(text);
  };
  std::filesystem::path answers;
  if (!run.options.checkpoint.empty()) {
    answers = run.options.checkpoint;
    if (run.checkpoint) answers += ".air";  // the modes' checkpoint has the plain name
    keeper.is_stop_asked = is_stop_asked;
    set_news(true);
  }
  try {
    const std::string source = run.comm.broadcast(run.job.file.string());
    bank::Multipoles found =
        name_errors(source, run, [&] { return air::calc_multipoles(run.comm, bank, options, std::move(keeper), answers); });
    if (run.comm.is_root()) {
      report.result = describe_multipoles(found);
      run.log.print(report.result);
      bank.multipoles = std::move(found);
    }
  } catch (const air::SolveStopped&) {
    throw eigen::Stopped();
  }
  run.log.end();
  return report;
}

}  // namespace carillon::run
