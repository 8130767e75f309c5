#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "precompute/coupling/condense.hpp"
#include "precompute/fem/assemble.hpp"
#include "precompute/run/stages.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::run {
namespace {

static_assert(job::kMaxCoupledModes == coupling::kMaxModes && static_cast<std::size_t>(coupling::kMaxModes) <= bank::kMaxCoupledModes);

coupling::CondenseOptions make_condense_options(Run& run, const Solution& found, std::vector<std::int32_t> kept) {
  coupling::CondenseOptions options;
  options.is_stretch = run.job.nonlinear->is_stretch;
  options.modes = std::min(run.job.nonlinear->modes, static_cast<int>(kept.size()));
  options.below_hz = run.job.nonlinear->below_hz;
  options.energy_error = run.job.nonlinear->energy_error;
  options.eligible = std::move(kept);
  options.thickness_m = run.comm.broadcast([&] {
    return bank::calc_thickness_m(found.body.surface.vertices_m, found.body.surface.triangles, found.solved.properties.rigid.volume_m3);
  });
  options.report = [&run, tenths = 0](const std::string& text, double share) mutable {
    const int now = static_cast<int>(10.0 * share);
    if (std::exchange(tenths, now) != now) run.log.print(text);
  };
  return options;
}

std::string describe_condensed(const coupling::Condensed& result) {
  const bank::QuarticEnergy& energy = result.energy;
  return fmt::format("{} coupled modes up to {:.0f} Hz of {} that bend or twist, {} {}{}, error {:.1e}, {} solves; {}", energy.mode_count(),
                     result.top_hz, result.bending_count, energy.row_count(), energy.row_count() == 1 ? "field" : "fields",
                     energy.is_of_points() ? fmt::format(" at {} points", energy.point_count()) : "", energy.error, result.solves,
                     energy.linear.empty() ? "flat" : fmt::format("curved ({:.2g})", result.curvature));
}

void warn(Run& run, const coupling::Condensed& result) {
  const job::Nonlinear& asked = *run.job.nonlinear;
  if (result.energy.is_empty()) {
    run.log.warn(fmt::format(
        "no mode below {:g} Hz bends or twists a slender part: the bank stays linear, and \"nonlinear\" can be removed", asked.below_hz));
    return;
  }
  if (static_cast<int>(result.energy.mode_count()) < asked.modes && !result.splits_pair)
    run.log.print(fmt::format("{} modes bend or twist below {:g} Hz, fewer than the {} that \"nonlinear\" asks for",
                              result.energy.mode_count(), asked.below_hz, asked.modes));
  if (result.splits_pair) run.log.print("one mode fewer is coupled than requested: the next two are degenerate and stay together");
  if (result.energy.membrane_ratio > bank::kMaxMembraneRatio) {
    const std::string cause =
        result.membrane_hz > 0
            ? fmt::format("stretching begins at {:.0f} Hz, and the highest coupled mode has {:.0f} Hz", result.membrane_hz, result.top_hz)
            : fmt::format("no mode of the band stretches the body, and the highest coupled mode has {:.0f} Hz", result.top_hz);
    run.log.warn(
        fmt::format("{}: above half of it the neglected inertia of stretching is audible; {}", cause,
                    result.membrane_hz > 0 ? "lower \"nonlinear.below_hz\"" : "a wider \"band_hz\" or more \"max_modes\" would show it"));
  }
}

}  // namespace

void check_coupling(const job::JobSpec&) {}

CouplingReport couple_modes(Run& run, const Solution& found) {
  CouplingReport report;
  if (!run.job.nonlinear) return report;
  run.log.begin("coupling", fmt::format("quartic energy of {} modes below {:g} Hz", run.job.nonlinear->modes, run.job.nonlinear->below_hz));
  const SolvedBody& solved = found.solved;
  std::vector<std::int32_t> kept;
  for (const std::size_t mode : find_bank_modes(run.job, solved.errors.bars.corrected)) kept.push_back(static_cast<std::int32_t>(mode));
  const coupling::CondenseOptions options = make_condense_options(run, found, kept);
  coupling::Condensed result = name_errors(found.body.source, run, [&] {
    if (solved.modes.lambda.empty()) throw InputError("\"nonlinear\" couples modes, and there are none in the band: widen \"band_hz\"");
    const fem::Materials& materials = solved.properties.materials;
    const fem::System system = fem::assemble(run.comm, found.body.pieces.local, materials, run.job.mass);
    return coupling::condense_modes(run.comm,
                                    {found.body.pieces.local, materials, system.stiffness, system.mass, solved.modes.lambda,
                                     solved.modes.shapes, found.body.pieces.components},
                                    options);
  });
  warn(run, result);
  if (run.comm.is_root() && !result.energy.is_empty()) {
    report.result = describe_condensed(result);
    report.energy = std::move(result.energy);
    run.log.print(report.result);
    for (std::int32_t& mode : report.energy.modes)
      mode = static_cast<std::int32_t>(std::lower_bound(kept.begin(), kept.end(), mode) - kept.begin());
  }
  run.log.end();
  return report;
}

}  // namespace carillon::run
