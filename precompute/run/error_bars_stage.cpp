#include "precompute/run/error_bars_stage.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "precompute/fem/energy.hpp"
#include "precompute/run/modes.hpp"

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

}  // namespace

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
  run.log.end();
  return errors;
}

}  // namespace carillon::run
