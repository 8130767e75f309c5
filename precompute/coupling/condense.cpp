// Method:     choice of the modes (choose.hpp); fields spanned by their pairs (stresses.hpp); integration points, where cheaper than rows
//   (points.hpp).
// Source:     docs/equations.md E13.
#include "precompute/coupling/condense.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "precompute/coupling/choose.hpp"
#include "precompute/coupling/points.hpp"
#include "precompute/coupling/products.hpp"
#include "precompute/coupling/static_answer.hpp"
#include "precompute/coupling/stresses.hpp"
#include "precompute/job/cost/calibration.hpp"
#include "precompute/la/local_columns.hpp"
#include "runtime/base/error.hpp"

namespace carillon::coupling {
namespace {

// Method:     the mean stress of a body without loads is the sum of position times traction over its surface, 0 if nothing holds it. A
//   field with a nonzero mean is therefore due to held edges, and the ones with the largest energy are the tension that rises as the body
//   bends.
// Source:     docs/equations.md E13.

constexpr std::ptrdiff_t kMaxStretchRows = 3;  // of a sheet: two directions and shear

/// Fraction of a field's energy in its mean over the body from which it counts as stretch. Bodies without opposite held edges have zero
/// mean: a mean needs surface forces.
constexpr double kMeanShare = 0.2;

/// (count) of the first fields: fraction of the energy in the mean over the body, 0 to 1. fields: with values. Collective.
la::Vector calc_mean_shares(const CoupledBody& body, const StressFields& fields, std::ptrdiff_t count) {
  std::vector<double> sums(6 * count + 1, 0.0);  // per field, and the volume
  body.comm.agree([&] {
    ElementPoints points;
    for (std::int32_t e = 0; e < body.strains.element_count(); ++e) {
      body.strains.calc_points(e, points);
      for (int p = 0; p < points.point_count(); ++p) {
        const double volume = points.volume_m3[p];
        sums.back() += volume;
        for (std::ptrdiff_t r = 0; r < count; ++r)
          for (int c = 0; c < 6; ++c) sums[6 * r + c] += std::sqrt(volume) * fields.values(body.strains.first_row(e) + 6 * p + c, r);
      }
    }
  });
  body.comm.sum(sums);
  la::Vector shares(count);
  for (std::ptrdiff_t r = 0; r < count; ++r) shares[r] = Eigen::Map<const la::Vector>(&sums[6 * r], 6).squaredNorm() / sums.back();
  return shares;
}

/// Keeps the fields of the largest energy that stretch the body, at most kMaxStretchRows; none if it is not held. `error` becomes that of
/// the rest. fields: with values. Collective.
void keep_stretch(const CoupledBody& body, StressFields& fields) {
  constexpr std::ptrdiff_t kSeen = 12;
  const la::Vector shares = calc_mean_shares(body, fields, std::min(kSeen, fields.form.rows()));
  body.comm.agree([&] {
    std::vector<std::ptrdiff_t> kept;
    for (std::ptrdiff_t r = 0; r < shares.size() && static_cast<std::ptrdiff_t>(kept.size()) < kMaxStretchRows; ++r)
      if (shares[r] >= kMeanShare) kept.push_back(r);
    fields.form = la::Matrix(fields.form(kept, Eigen::all));
    fields.linear = la::Matrix(fields.linear(kept, Eigen::all));
    fields.values = la::Matrix(fields.values(Eigen::all, kept));
    const la::Matrix eta = multiply(fields.form, fields.tests.products), bias = multiply(fields.linear, fields.tests.q);
    const la::Vector energy = 0.5 * eta.colwise().squaredNorm().transpose(), cubic = eta.cwiseProduct(bias).colwise().sum().transpose();
    fields.error = calc_error(energy, cubic, fields.full, fields.cubic);
  });
}

constexpr double kFieldsShare = 0.5;  // share of the error budget for omitted fields; the rest is for the points

/// Multiply-adds of one evaluation of the energy and its gradient.
double count_rows_cost(double rows, double modes) { return rows * modes * (modes + 1); }
double count_points_cost(double points, double rows, double modes) { return 2 * points * (9 * modes + 6 * rows); }

void check(const SolvedModes& solved, const CondenseOptions& options) {
  if (solved.components != 1)
    throw InputError(
        fmt::format("nonlinear coupling needs a connected body, and this one has {} parts: solve each part separately", solved.components));
  const std::size_t eligible = options.eligible.empty() ? solved.lambda.size() : options.eligible.size();
  if (static_cast<std::size_t>(options.modes) > eligible)
    throw InputError(
        fmt::format("\"nonlinear\" asks for {} coupled modes, and the body has {} in its band: ask for {} at most, or widen "
                    "\"band_hz\"",
                    options.modes, eligible, eligible));
}

std::vector<double> calc_freq_hz(std::span<const double> lambda) {
  std::vector<double> freq;
  for (const double value : lambda) freq.push_back(std::sqrt(value) / (2 * std::numbers::pi));
  return freq;
}

/// Columns of the chosen modes, one after the other.
std::vector<double> copy_columns(const la::Columns& shapes, std::span<const std::int32_t> modes) {
  std::vector<double> copied;
  copied.reserve(static_cast<std::size_t>(shapes.rows) * modes.size());
  for (const std::int32_t mode : modes) copied.insert(copied.end(), shapes.column(mode), shapes.column(mode) + shapes.rows);
  return copied;
}

void set_rows(const StressFields& fields, bank::QuarticEnergy& energy) {
  const Pairs pairs{static_cast<std::ptrdiff_t>(energy.mode_count())};
  for (std::ptrdiff_t r = 0; r < fields.form.rows(); ++r)
    for (std::ptrdiff_t j = 0; j < pairs.modes; ++j)
      for (std::ptrdiff_t i = 0; i <= j; ++i)
        energy.rows.push_back(static_cast<float>((i == j ? 1.0 : 0.5) * fields.form(r, pairs.find(i, j))));
}

void set_points(const CouplingPoints& points, bank::QuarticEnergy& energy) {
  const auto append = [](std::vector<float>& list, double value) { list.push_back(static_cast<float>(value)); };
  for (std::ptrdiff_t row = 0; row < points.gradient.rows(); ++row)
    for (std::ptrdiff_t i = 0; i < points.gradient.cols(); ++i) append(energy.gradient, points.gradient(row, i));
  for (std::ptrdiff_t r = 0; r < points.stress.cols(); ++r)
    for (std::ptrdiff_t i = 0; i < points.stress.rows(); ++i) append(energy.stress, points.stress(i, r));
  energy.weight.assign(points.weight.data(), points.weight.data() + points.weight.size());
}

double calc_peak(const comm::Communicator& comm, const double* shape, std::ptrdiff_t rows) {
  double peak = 0;
  for (std::ptrdiff_t row = 0; row + 2 < rows; row += 3) peak = std::max(peak, std::hypot(shape[row], shape[row + 1], shape[row + 2]));
  return comm.max(peak);
}

}  // namespace

Condensed condense_modes(const comm::Communicator& comm, const SolvedModes& solved, const CondenseOptions& options) {
  check(solved, options);
  Condensed result;
  const std::vector<double> freq_hz = calc_freq_hz(solved.lambda);
  const la::LocalColumns shapes(solved.shapes);
  const Strains strains = comm.agree([&] { return Strains(solved.local, solved.materials); });
  std::vector<std::int32_t> eligible = options.eligible;
  if (eligible.empty()) {
    eligible.resize(solved.lambda.size());
    std::iota(eligible.begin(), eligible.end(), 0);
  }
  Choice choice =
      choose_modes(freq_hz, calc_slenderness(comm, strains, solved.local, shapes.view()), eligible, options.modes, options.below_hz);
  result.bending_count = choice.bending_count;
  result.splits_pair = choice.splits_pair;
  result.top_hz = choice.top_hz;
  result.membrane_hz = choice.membrane_hz;
  if (choice.modes.empty()) return result;

  std::vector<double> kept = comm.agree([&] { return copy_columns(shapes.view(), choice.modes); });
  const auto modes = static_cast<int>(choice.modes.size());
  const la::Columns columns{kept.data(), shapes.rows, shapes.rows, modes};
  std::vector<double> omega;
  for (const std::int32_t mode : choice.modes) omega.push_back(std::sqrt(solved.lambda[mode]));
  if (options.report) options.report("factorisation of K", 0.0);
  StaticAnswer answer(comm, solved.local, solved.stiffness, solved.mass, columns, solved.lambda.front());
  const Nodal nodal = answer.spread(columns);
  const auto proceed = [&](double share) {
    if (options.report) options.report(fmt::format("{:.0f} % of the pairs of {} modes", 100 * share, modes), share);
  };
  const CoupledBody body{comm, strains, answer, nodal, omega, Pairs{modes}, proceed};
  const bool wants_points = modes > cost::kModesOfAllPairs && !options.is_stretch;
  const double fields_error = kFieldsShare * options.energy_error;
  StressFields fields = modes > cost::kModesOfAllPairs ? calc_fields_of_samples(body, fields_error)
                                                       : calc_fields_of_pairs(body, fields_error, options.is_stretch);
  if (options.is_stretch) {
    keep_stretch(body, fields);
    if (fields.form.rows() == 0)
      throw InputError(
          "\"nonlinear\": \"stretch\" needs a body held on opposite sides, and no stress field of this one has a nonzero mean: "
          "fix opposite sides (\"fixed\"), or couple the modes in full, {\"modes\": 30}");
  }
  result.solves = fields.solves;
  result.curvature = fields.curvature;
  const double first_peak = calc_peak(comm, columns.column(0), columns.rows);

  bank::QuarticEnergy& energy = result.energy;
  energy.modes = choice.modes;
  energy.error = fields.error;
  energy.thickness_m = options.thickness_m;
  energy.membrane_ratio = choice.top_hz / (choice.membrane_hz > 0 ? choice.membrane_hz : freq_hz.back());
  const double rows = static_cast<double>(fields.form.rows()), rows_cost = count_rows_cost(rows, modes);
  CouplingPoints points;
  if (wants_points) {
    const auto most = static_cast<std::ptrdiff_t>(rows_cost / count_points_cost(1, rows, modes));
    points = choose_points(body, solved.local, fields, options.energy_error, most);
  }
  comm.agree([&] {
    if (!comm.is_root()) return;
    if (wants_points && points.error <= options.energy_error) {
      set_points(points, energy);
      energy.error = points.error;
    } else {
      set_rows(fields, energy);
    }
    if (fields.curvature < kCurved) return;
    for (std::ptrdiff_t r = 0; r < fields.linear.rows(); ++r)
      for (std::ptrdiff_t i = 0; i < fields.linear.cols(); ++i) energy.linear.push_back(fields.linear(r, i));
    // For the lowest mode at a thousandth of the thickness
    const double q = 1e-3 * options.thickness_m / first_peak;
    energy.rest_energy_j = 0.5 * omega.front() * omega.front() * q * q;
  });
  return result;
}

double calc_hardening(double self_coupling, double lambda, double peak, double length_m) {
  return 2 * self_coupling * length_m * length_m / (lambda * peak * peak);
}

}  // namespace carillon::coupling
