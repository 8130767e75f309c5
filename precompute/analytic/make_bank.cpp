#include "precompute/analytic/make_bank.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "precompute/analytic/known_body.hpp"
#include "precompute/analytic/measured.hpp"
#include "runtime/bank/of_material.hpp"
#include "runtime/bank/radiation_gain.hpp"
#include "runtime/bank/select.hpp"
#include "runtime/base/error.hpp"

namespace carillon::analytic {
namespace {

using std::numbers::pi;

constexpr double kEdge = 1e-9;          // relative frequency tolerance at the ends of the band
constexpr double kDegenerate = 1e-9;    // relative distance of equal eigenvalues
constexpr double kBeyond = 1.0 + 1e-6;  // search limit relative to the end of the band
constexpr std::int64_t kNoLimit = std::numeric_limits<std::int64_t>::max() / 4;
constexpr double kMaxNumbers = 6e8;  // maximum number of shape components in a bank

double to_hz(double lambda) { return std::sqrt(lambda) / (2.0 * pi); }

/// Modes of the band, and the counts that prove completeness.
struct Band {
  std::vector<Mode> modes;
  std::optional<bank::Proof> proof;  // none for a table: unmeasured modes are unknown
  std::array<double, 2> band_hz{};
  bool is_complete = true;
};

/// Midpoint between two modes, or the end of the band if no mode is near.
double choose_cut(double end_hz, double below_hz, double above_hz) {
  const bool is_clear = below_hz < end_hz * (1.0 - kEdge) && above_hz > end_hz * (1.0 + kEdge);
  return is_clear ? end_hz : 0.5 * (below_hz + above_hz);
}

/// Modes up to slightly above the end of the band (to locate the next one), or the lowest max_modes of the band.
ModeList list_band(KnownBody& body, const job::JobSpec& job, std::int64_t max_modes) {
  const double high_hz = job.band_hz[1] * kBeyond;
  for (std::int64_t wanted = max_modes;; wanted *= 2) {
    body.warnings.clear();
    ModeList list = body.list_modes(high_hz, wanted);
    const auto in_band = std::count_if(list.modes.begin(), list.modes.end(),
                                       [&](const Mode& mode) { return to_hz(mode.lambda_rad2_s2) >= job.band_hz[0] * (1.0 - kEdge); });
    if (list.complete_below_hz >= high_hz || in_band > max_modes) return list;
  }
}

/// One mode more than max_modes is known if it exists.
Band find_band(KnownBody& body, const job::JobSpec& job) {
  const auto max_modes = job.max_modes ? static_cast<std::int64_t>(*job.max_modes) : kNoLimit;
  ModeList list = list_band(body, job, max_modes);
  Band band;
  band.band_hz = {job.band_hz[0], std::min(job.band_hz[1], list.complete_below_hz / kBeyond)};
  const auto is_in = [&](double hz) { return hz >= band.band_hz[0] * (1.0 - kEdge) && hz <= band.band_hz[1] * (1.0 + kEdge); };
  double before_hz = 0.0, first_hz = 0.0, last_hz = 0.0, next_hz = list.complete_below_hz;
  std::int64_t below = body.rigid_modes;
  for (Mode& mode : list.modes) {
    const double hz = to_hz(mode.lambda_rad2_s2);
    if (hz > band.band_hz[1] * (1.0 + kEdge)) {
      next_hz = std::min(next_hz, hz);
      break;
    }
    if (is_in(hz)) {
      if (band.modes.empty()) first_hz = hz;
      last_hz = hz;
      band.modes.push_back(std::move(mode));
    } else {
      before_hz = hz;
      ++below;
    }
  }
  if (band.modes.empty()) first_hz = last_hz = 0.5 * (band.band_hz[0] + band.band_hz[1]);
  const double low_hz = choose_cut(band.band_hz[0], before_hz, first_hz), high_hz = choose_cut(band.band_hz[1], last_hz, next_hz);
  bank::Proof proof;
  proof.cut_hz = {std::min(low_hz, band.band_hz[0]), std::max(high_hz, band.band_hz[1])};
  proof.found = static_cast<std::int64_t>(band.modes.size());
  proof.below = {below, below + proof.found};
  const auto calc_margin = [](double cut_hz, double a_hz, double b_hz) {
    const auto apart = [&](double hz) { return std::abs(hz * hz / (cut_hz * cut_hz) - 1.0); };
    return std::min({apart(a_hz), apart(b_hz), 1.0}) * (1.0 - 1e-9);
  };
  proof.margin = {calc_margin(proof.cut_hz[0], before_hz, first_hz), calc_margin(proof.cut_hz[1], last_hz, next_hz)};
  proof.rigid_per_component = {body.rigid_modes};
  proof.method = body.method;
  if (std::ssize(band.modes) > max_modes) {
    band.modes.resize(max_modes);
    band.is_complete = false;
  }
  for (std::size_t m = 0; m < band.modes.size();) {
    std::size_t end = m + 1;
    while (end < band.modes.size() &&
           band.modes[end].lambda_rad2_s2 - band.modes[m].lambda_rad2_s2 <= kDegenerate * band.modes[m].lambda_rad2_s2)
      ++end;
    if (end - m > 1) {
      proof.cluster_first.push_back(static_cast<std::int64_t>(m));
      proof.cluster_count.push_back(static_cast<std::int64_t>(end - m));
    }
    m = end;
  }
  if (!std::holds_alternative<job::MeasuredBody>(job.analytic->kind)) band.proof = std::move(proof);
  return band;
}

/// The material's law, or loss factors fitted to a table of measured decays.
void set_damping(bank::Bank& bank, const KnownBody& body, const job::JobSpec& job, const std::vector<Mode>& modes) {
  const auto* measured = dynamic_cast<const MeasuredObject*>(&body);
  if (measured == nullptr) {
    bank.damping = bank::make_damping(job.material);
    if (job.material.law == material::DampingLaw::rayleigh) {
      bank.material.alpha1_s = job.material.alpha1_s;
      bank.material.alpha2_per_s = job.material.alpha2_per_s;
    }
    for (const double lambda : bank.eigenvalue_rad2_s2) bank.decay_per_s.push_back(bank::calc_decay(bank.damping, bank.material, lambda));
    return;
  }
  const ModesTable& table = measured->get_table();
  bool has_twins = false;
  for (std::size_t m = 0; m < modes.size(); ++m) {
    const std::size_t row = modes[m].index[0];
    const double hz = to_hz(bank.eigenvalue_rad2_s2[m]);
    bank.decay_per_s.push_back(table.decay_per_s[row]);
    if (!bank.damping.freq_hz.empty() && hz <= bank.damping.freq_hz.back()) {
      has_twins |= table.decay_per_s[row] != bank.decay_per_s[m - 1];
      continue;
    }
    bank.damping.freq_hz.push_back(hz);
    bank.damping.loss_factor.push_back(table.decay_per_s[row] / (pi * hz));
  }
  bank.damping.law = "loss_table";
  if (has_twins || modes.empty()) {  // two decays at one frequency define no law
    bank.damping = {};
    bank.damping.law = "mixed";
  }
}

struct Found {
  std::unique_ptr<KnownBody> body;
  Band band;
};

/// Throws InputError, prefixed with the place of the body in the job.
Found find(const job::JobSpec& job) {
  try {
    Found found{make_known_body(*job.analytic, job.material), {}};
    found.band = find_band(*found.body, job);
    return found;
  } catch (const InputError& error) {
    if (std::holds_alternative<job::MeasuredBody>(job.analytic->kind)) throw;  // already names the line of the table
    throw InputError(fmt::format("{}: {}", job.analytic->place, error.what()));
  }
}

/// The lowest modes that the job couples, as numbers among those of the band. Degenerate modes stay together.
std::vector<std::int32_t> choose_coupled(const KnownBody& body, const job::Nonlinear& asked, const std::vector<Mode>& modes) {
  std::vector<std::int32_t> chosen;
  for (std::size_t m = 0; m < modes.size(); ++m)
    if (body.is_coupled(modes[m]) && to_hz(modes[m].lambda_rad2_s2) <= asked.below_hz) chosen.push_back(static_cast<std::int32_t>(m));
  auto kept = std::min<std::size_t>(chosen.size(), asked.modes);
  const auto get_lambda = [&](std::size_t i) { return modes[chosen[i]].lambda_rad2_s2; };
  if (kept < chosen.size()) {
    while (kept > 0 && get_lambda(kept) - get_lambda(kept - 1) <= kDegenerate * get_lambda(kept)) --kept;
    if (kept == 0) kept = asked.modes;
  }
  chosen.resize(kept);
  return chosen;
}

void couple(const KnownBody& body, const job::JobSpec& job, const std::vector<Mode>& modes, Made& made) {
  const std::vector<std::int32_t> chosen = choose_coupled(body, *job.nonlinear, modes);
  if (chosen.empty()) {
    made.warnings.push_back(fmt::format("large motion couples no mode below {:g} Hz: the bank stays linear", job.nonlinear->below_hz));
    return;
  }
  std::vector<Mode> coupled;
  for (const std::int32_t mode : chosen) coupled.push_back(modes[mode]);
  bank::QuarticEnergy& energy = made.bank.quartic;
  energy = body.calc_coupling(coupled, job.material, job.nonlinear->is_stretch);
  energy.modes = chosen;
  const double membrane_hz = energy.membrane_ratio, top_hz = to_hz(coupled.back().lambda_rad2_s2);
  energy.membrane_ratio = top_hz / membrane_hz;
  if (energy.membrane_ratio > bank::kMaxMembraneRatio)
    made.warnings.push_back(
        fmt::format("stretching begins at {:.0f} Hz, and the highest coupled mode has {:.0f} Hz: above half of it the neglected "
                    "inertia of stretching is audible; lower \"nonlinear.below_hz\"",
                    membrane_hz, top_hz));
  made.coupling = fmt::format("{} coupled modes up to {:.0f} Hz, {} {}", energy.mode_count(), top_hz, energy.row_count(),
                              energy.row_count() == 1 ? "row" : "rows");
}

}  // namespace

Made make_bank(const job::JobSpec& job) {
  auto [body, band] = find(job);
  const std::size_t count = band.modes.size();
  Made made{{}, body->theory, body->method, {}, body->warnings, {}};
  bank::Bank& bank = made.bank;
  ClosedSurface surface = body->make_surface(job.analytic->grid.value_or(body->choose_grid(band.modes)));
  if (static_cast<double>(surface.vertices_m.size()) * static_cast<double>(count) * 3.0 > kMaxNumbers)
    throw InputError(
        fmt::format("{}: {} modes at {} points make a bank of {:.1f} GB; lower the end of \"band_hz\", give \"max_modes\", or a "
                    "smaller \"grid\"",
                    job.analytic->place, count, surface.vertices_m.size(),
                    6e-9 * static_cast<double>(surface.vertices_m.size()) * static_cast<double>(count)));
  bank.vertices_m = std::move(surface.vertices_m);
  bank.triangles = std::move(surface.triangles);
  std::vector<double> shapes(bank.vertices_m.size() * count * 3);
  std::vector<Vec3> row(count);
  for (std::size_t v = 0; v < bank.vertices_m.size(); ++v) {
    body->calc_shapes(bank.vertices_m[v], band.modes, row);
    for (std::size_t m = 0; m < count; ++m) std::copy(row[m].begin(), row[m].end(), &shapes[(v * count + m) * 3]);
  }
  for (const Mode& mode : band.modes) {
    bank.eigenvalue_rad2_s2.push_back(mode.lambda_rad2_s2);
    bank.discretisation_error_cents.push_back(mode.error_cents);
    made.names.push_back(mode.name);
  }
  bank.residual.assign(count, 0.0);
  bank.algebraic_error_cents.assign(count, 0.0);
  bank.rigid = body->rigid;
  bank.material = {job.material.young_modulus_pa, job.material.poisson_ratio, body->rigid.mass_kg / body->rigid.volume_m3, 0.0, 0.0};
  set_damping(bank, *body, job, band.modes);
  bank::set_radiation_gains(bank, shapes);
  bank::quantise_shapes(bank, shapes);
  bank.proof = std::move(band.proof);
  bank.counts = {static_cast<std::int64_t>(bank.vertices_m.size()), 1, 1, body->rigid_modes};
  bank.band_hz = band.band_hz;
  bank.complete = band.is_complete;
  bank.element = "analytic";
  bank.mass = "consistent";
  if (job.nonlinear) couple(*body, job, band.modes, made);
  made.method = body->method;
  return made;
}

std::vector<ModeAtPoint> calc_modes_at(const job::JobSpec& job, const Vec3& point_m) {
  const auto [body, band] = find(job);
  std::vector<Vec3> phi(band.modes.size());
  body->calc_shapes(point_m, band.modes, phi);
  std::vector<ModeAtPoint> found;
  for (std::size_t m = 0; m < phi.size(); ++m) found.push_back({to_hz(band.modes[m].lambda_rad2_s2), phi[m], band.modes[m].name});
  return found;
}

}  // namespace carillon::analytic
