// Method: for a consistent mass and to first order, lambda_h - lambda is the energy of the error, estimated from recovered strains as a
//   share I of lambda_h. T10: lambda = lambda_h (1 + G) / (1 + I), without a fitted constant; G is Hadamard's shift to the smooth surface.
//   T4 recover less, and less on coarser meshes: two polynomials in I and the share L of a lumped mass, 1 - I + L to first order except for
//   the coefficient of I, fitted to the bodies of docs/error-bars.md. Shapes of modes that are degenerate to rounding are an arbitrary
//   basis: they get the mean of their parts, which is independent of the basis. Bars: half of the mesh's bar around the corrected value,
//   0.4 of it for T4. If the estimate is a large share of lambda, the mesh's own interval is kept, which lies below the mesh's frequency
//   except for the uncertainty of lumping and geometry (of T4, its part within 0.45 of the bar). Two meshes agree if |lambda' -
//   lambda'_coarser| is less than half of the difference of their corrections, and the coarser's correction is 1.5 times as large; a mesh
//   that agrees with one coarser mesh is not disputed by another. For the undetectable part in curved elements that are wide
//   compared with their wall, see parts.hpp, calc_excess().
// Source: Naga, Zhang and Zhou 2006, SIAM J. Sci. Comput. 28, 1289 (eigenvalues less the energy of the recovered error); Zienkiewicz and
//   Zhu 1992.
// Deviations: strains are recovered (error_bars.cpp), not displacements; the rational form instead of the difference keeps lambda > 0.
#include "precompute/fem/error_bars/correct.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/base/sort_order.hpp"

namespace carillon::error_bars {
namespace {

using bank::Correction;

// Shares of lambda. Above the first limit the estimate is rough, above the second unreliable.
constexpr double kRoughT4 = 0.5, kStiffT4 = 1.0, kRoughT10 = 0.3, kStiffT10 = 0.6;
constexpr double kRoughWidthT4 = 0.45, kRoughWidthLumped = 0.5;  // of the mesh's bar
constexpr double kSingularShare = 0.25;                          // of the estimate's energy
constexpr double kHalf = 0.5, kHalfT4 = 0.4;                     // of the mesh's bar
constexpr double kAgreed = 0.25, kAgreedT10 = 0.125;             // of the mesh's bar, two meshes; T10: straight ones
constexpr double kApart = 1.5;                                   // of the corrections of two meshes
constexpr double kOverlaid = 12.0;        // rough: a T4 mode whose bar others make so many times its own; results are the same from 2 to 12
constexpr double kSameEigenvalue = 1e-6;  // of lambda

double to_cents(double share) { return 600 * std::log2(share); }

Correction find_correction(const ErrorParts& parts, const Level& level) {
  const Kind kind = level.kind;
  if (level.is_lumped && kind != Kind::kT4) return Correction::kLumped;
  const bool is_t4 = kind == Kind::kT4;
  const double excess = calc_excess(parts, kind);
  if (excess > (is_t4 ? kStiffT4 : kStiffT10)) return Correction::kStiff;
  if (excess > (is_t4 ? kRoughT4 : kRoughT10)) return Correction::kRough;
  // At inward edges T10 are trusted (kInwardShare), at rims of fixed faces they underestimate.
  if ((is_t4 || level.has_rims) && parts.singular > kSingularShare * parts.interpolation) return Correction::kRough;
  constexpr double kDoubt = 0.25;  // of the mesh's bar: half of the corrected one
  if (level.is_guessed && calc_facet_cents(parts) > kDoubt * calc_cents(parts, kind)) return Correction::kRough;
  return Correction::kOneMesh;
}

bool is_reliable(Correction correction) { return correction == Correction::kOneMesh || correction == Correction::kTwoMeshes; }

/// Averages the parts of degenerate modes.
std::vector<ErrorParts> share_parts(const Level& level) {
  std::vector<ErrorParts> shared = level.parts;
  for (std::size_t first = 0, end = 0; first < shared.size(); first = end) {
    for (end = first + 1; end < shared.size() && level.lambda[end] <= level.lambda[end - 1] * (1 + kSameEigenvalue);) ++end;
    for (double ErrorParts::*part : {&ErrorParts::interpolation, &ErrorParts::singular, &ErrorParts::bent, &ErrorParts::lumping,
                                     &ErrorParts::geometry, &ErrorParts::geometry_noise, &ErrorParts::doubt, &ErrorParts::doubt_noise}) {
      double sum = 0.0;
      for (std::size_t m = first; m < end; ++m) sum += level.parts[m].*part;
      for (std::size_t m = first; m < end; ++m) shared[m].*part = sum / static_cast<double>(end - first);
    }
  }
  return shared;
}

/// Verdict on each mode, and the minimum length of its bar.
struct Verdict {
  std::vector<Correction> correction;  // (m)
  std::vector<double> least_cents;     // (m) distance to a contradicting coarser mesh, of disputed modes; else 0
};

/// Interval of each mode around its stated value.
OwnIntervals find_intervals(const Level& level, const std::vector<ErrorParts>& parts, const Corrections& corrections,
                            const std::vector<double>& least_cents) {
  OwnIntervals own;
  for (std::size_t m = 0; m < parts.size(); ++m) {
    ErrorParts one_sided = parts[m];
    one_sided.interpolation = one_sided.singular = one_sided.bent = 0.0;
    const double all = calc_cents(parts[m], level.kind), above = calc_cents(one_sided, level.kind);
    const double stated = to_cents(corrections.lambda[m] / level.lambda[m]);
    double low = -std::max(all, least_cents[m]), high = -low;
    if (corrections.correction[m] == Correction::kRough) {
      const double part = level.is_lumped ? kRoughWidthLumped : kRoughWidthT4;
      const double width = level.kind == Kind::kT4 ? std::max(part * all, above) : HUGE_VAL;
      high = std::min(std::max(above, stated), stated + width);
      low = std::max(std::min(-all, stated), stated - width);
    } else if (bank::is_corrected(corrections.correction[m])) {
      const double alone = level.kind == Kind::kT4 && !level.is_lumped ? kHalfT4 : kHalf,
                   both = level.kind == Kind::kT10 ? kAgreedT10 : kAgreed;
      const double factor = corrections.correction[m] == Correction::kOneMesh ? alone : both;
      low = stated - factor * all;
      high = stated + factor * all;
    }
    own.stated.push_back(stated);
    own.low.push_back(low);
    own.high.push_back(high);
    own.above.push_back(above);
  }
  return own;
}

}  // namespace

double calc_share_left(const ErrorParts& parts, Kind kind, bool is_lumped) {
  const double i = calc_excess(parts, kind), l = parts.lumping;
  double left = 1.0;
  if (kind != Kind::kT4)
    left = 1 / (1 + i);
  else if (is_lumped)
    left = 1 - 0.93 * i + 0.19 * i * i + l + 0.11 * i * l + 0.35 * l * l;
  else
    left = 1 - i * (0.94 - i * (0.62 - 0.5 * i));
  return std::max(left * (1 + parts.geometry), 1e-3);
}

namespace {

/// Corrections for the verdicts.
Corrections correct(const Level& level, const std::vector<ErrorParts>& parts, const Verdict& verdict) {
  Corrections corrections;
  corrections.correction = verdict.correction;
  for (std::size_t m = 0; m < parts.size(); ++m) {
    const double left = bank::is_corrected(verdict.correction[m]) ? calc_share_left(parts[m], level.kind, level.is_lumped) : 1.0;
    corrections.lambda.push_back(left * level.lambda[m]);
  }
  const OwnIntervals own = find_intervals(level, parts, corrections, verdict.least_cents);
  corrections.cents = widen_for_order(level.lambda, own, level.unlisted);
  for (std::size_t m = 0; m < parts.size(); ++m)
    corrections.own_cents.push_back(std::max(own.stated[m] - own.low[m], own.high[m] - own.stated[m]));
  corrections.complete_below = find_lowest_unlisted(level.lambda, own, level.unlisted);
  if (level.kind == Kind::kT4)  // where bending is octaves too high, the k-th of the list need not be the k-th of the body
    for (std::size_t m = 0; m < parts.size(); ++m)
      if (is_reliable(corrections.correction[m]) && corrections.cents[m] > kOverlaid * (own.high[m] - own.stated[m]))
        corrections.correction[m] = Correction::kRough;
  corrections.facet_cents = find_facet_cents(level, own, corrections.cents);
  if (is_too_short(level))
    for (auto* bars : {&corrections.cents, &corrections.own_cents}) bars->assign(bars->size(), std::numeric_limits<double>::infinity());
  return corrections;
}

/// Verdict on the modes of a mesh compared with coarser ones, k-th against k-th. On contradiction the estimate and its bar are wrong: the
/// finer mesh is then closer to the truth than to the coarser mesh.
Verdict compare(const Level& level, const Corrections& corrections, std::span<const Level> coarser) {
  const std::vector<std::size_t> order = base::find_sort_order(corrections.lambda);
  Verdict verdict{corrections.correction, std::vector<double>(corrections.correction.size(), 0.0)};
  for (const Level& before : coarser) {
    const Corrections other = calc_corrections(before);
    const std::vector<std::size_t> other_order = base::find_sort_order(other.lambda);
    for (std::size_t k = 0; k < std::min(order.size(), other_order.size()); ++k) {
      const std::size_t m = order[k], n = other_order[k];
      if (corrections.correction[m] != Correction::kOneMesh || other.correction[n] != Correction::kOneMesh) continue;
      const double fine = corrections.lambda[m], coarse = other.lambda[n];
      const double fine_by = level.lambda[m] - fine, coarse_by = before.lambda[n] - coarse;
      if (std::abs(coarse - fine) <= 0.5 * std::abs(coarse_by - fine_by) && std::abs(coarse_by) >= kApart * std::abs(fine_by)) {
        verdict.correction[m] = Correction::kTwoMeshes;
      } else if (verdict.correction[m] != Correction::kTwoMeshes &&
                 std::abs(to_cents(coarse / fine)) > corrections.cents[m] + other.cents[n]) {
        verdict.correction[m] = Correction::kDisputed;
        verdict.least_cents[m] = std::abs(to_cents(before.lambda[n] / level.lambda[m]));
      }
    }
  }
  return verdict;
}

/// Limits each interval to the bar of the k-th frequency of a coarser mesh.
void keep_within(const Corrections& coarser, Corrections& corrections) {
  const std::vector<std::size_t> order = base::find_sort_order(corrections.lambda), before = base::find_sort_order(coarser.lambda);
  for (std::size_t k = 0; k < std::min(order.size(), before.size()); ++k) {
    const std::size_t m = order[k], n = before[k];
    if (corrections.correction[m] == Correction::kDisputed) continue;
    corrections.cents[m] = std::min(corrections.cents[m], coarser.cents[n] + std::abs(to_cents(coarser.lambda[n] / corrections.lambda[m])));
  }
}

}  // namespace

Corrections calc_corrections(const Level& level, std::span<const Level> coarser) {
  const std::vector<ErrorParts> parts = share_parts(level);
  Verdict verdict{{}, std::vector<double>(parts.size(), 0.0)};
  for (const ErrorParts& mode : parts) verdict.correction.push_back(find_correction(mode, level));
  Corrections alone = correct(level, parts, verdict);
  if (coarser.empty()) return alone;
  Corrections corrections = correct(level, parts, compare(level, alone, coarser));
  if (corrections.facet_cents.empty() && !is_too_short(level))  // facet_cents are on top of the level's own bars
    keep_within(calc_corrections(coarser.back(), coarser.first(coarser.size() - 1)), corrections);
  return corrections;
}

std::vector<double> find_facet_cents(const Level& level, const OwnIntervals& own, const std::vector<double>& cents) {
  if (std::all_of(level.parts.begin(), level.parts.end(), [](const ErrorParts& parts) { return calc_facet_cents(parts) == 0.0; }))
    return {};
  const std::vector<ErrorParts> parts = share_parts(level);
  OwnIntervals either = own;
  for (std::size_t m = 0; m < parts.size(); ++m) {
    const double facets = calc_facet_cents(parts[m]);
    either.low[m] -= facets;
    either.high[m] += facets;
    either.above[m] += facets;
  }
  std::vector<double> beyond = widen_for_order(level.lambda, either, level.unlisted);
  for (std::size_t m = 0; m < beyond.size(); ++m) beyond[m] = std::max(beyond[m] - cents[m], 0.0);
  return beyond;
}

double find_order(const Level& level, const Level* coarser, double edge_ratio) {
  constexpr double kThin = 0.5, kMinRatio = 1.2, kMin = 1.0;  // of a crack: 2 alpha, its stress growing with r^(alpha - 1)
  const double known = find_order(level.kind);
  if (coarser != nullptr && edge_ratio > kMinRatio) {
    std::vector<double> orders;
    for (std::size_t m = 0; m < std::min(level.parts.size(), coarser->parts.size()); ++m) {
      const double fine = level.parts[m].interpolation - level.parts[m].singular,
                   coarse = coarser->parts[m].interpolation - coarser->parts[m].singular;
      if (fine > 0 && coarse > 0) orders.push_back(std::log(coarse / fine) / std::log(edge_ratio));
    }
    if (!orders.empty()) {
      const auto middle = orders.begin() + static_cast<std::ptrdiff_t>(orders.size() / 2);
      std::nth_element(orders.begin(), middle, orders.end());
      return std::clamp(*middle, std::min(kMin, known), known);
    }
  }
  return level.kind != Kind::kT4 && level.one_layer > kThin ? 2.0 : known;
}

Level predict_level(const Level& level, double power, bool keeps_geometry, double edge_ratio) {
  Level then = level;
  for (std::size_t m = 0; m < then.parts.size(); ++m) {
    then.parts[m] = predict_parts(level.parts[m], level.kind, power, edge_ratio);
    if (keeps_geometry) {
      then.parts[m].geometry = level.parts[m].geometry;
      then.parts[m].geometry_noise = level.parts[m].geometry_noise;
    }
  }
  for (std::size_t m = 0; m < then.parts.size(); ++m)
    then.lambda[m] *=
        calc_share_left(level.parts[m], level.kind, level.is_lumped) / calc_share_left(then.parts[m], level.kind, level.is_lumped);
  const std::vector<std::size_t> order = base::find_sort_order(then.lambda);
  const Level moved = then;
  for (std::size_t m = 0; m < order.size(); ++m) {
    then.lambda[m] = moved.lambda[order[m]];
    then.parts[m] = moved.parts[order[m]];
  }
  return then;
}

bool is_too_short(const Level& level) {
  constexpr std::size_t kFew = 4;
  return level.is_lumped && level.kind == Kind::kT4 && level.lambda.size() < kFew;
}

std::size_t find_computed_count(std::size_t wanted) {
  constexpr std::size_t kLeast = 12, kMost = 20;  // additional modes of a short list
  return std::max(wanted + std::min((wanted + 4) / 5, kMost), kLeast);
}

std::vector<std::size_t> find_lowest(const Corrections& corrections, std::size_t wanted) {
  std::vector<std::size_t> lowest = base::find_sort_order(corrections.lambda);
  lowest.resize(std::min(lowest.size(), wanted));
  std::sort(lowest.begin(), lowest.end());
  return lowest;
}

}  // namespace carillon::error_bars
