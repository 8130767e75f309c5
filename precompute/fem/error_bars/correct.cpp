// Method: for a consistent mass and to first order, lambda_h - lambda is the energy of the error, estimated from recovered strains as a
//   share I of lambda_h. T10: lambda = lambda_h (1 + G) / (1 + I), without a fitted constant; G is Hadamard's shift to the smooth surface.
//   T4 recover less, and less on coarser meshes: two polynomials in I and the share L of a lumped mass, 1 - I + L to first order except for
//   the coefficient of I, fitted to the bodies of docs/error-bars.md. Shapes of modes that are degenerate to rounding are an arbitrary
//   basis: they get the mean of their parts, which is independent of the basis. Bars: half of the mesh's bar around the corrected value,
//   0.4 of it for T4. If the estimate is a large share of lambda, the mesh's own interval is kept, which lies below the mesh's frequency
//   except for the uncertainty of lumping and geometry (of T4, its part within 0.45 of the bar). Two meshes agree if |lambda' -
//   lambda'_coarser| is less than half of the difference of their corrections, and the coarser's correction is 1.5 times as large; a mesh
//   that agrees with one coarser mesh is not disputed by another. T10 nearly agree up to the whole difference, with a bar as much longer:
//   on the bodies of docs/error-bars.md the error was at most 0.95 of it. For the undetectable part in curved elements that are
//   wide compared with their wall, see parts.hpp, calc_excess().
// Source: Naga, Zhang and Zhou 2006, SIAM J. Sci. Comput. 28, 1289 (eigenvalues less the energy of the recovered error); Zienkiewicz and
//   Zhu 1992.
// Deviations: strains are recovered (error_bars.cpp), not displacements; the rational form instead of the difference keeps lambda > 0.
#include "precompute/fem/error_bars/correct.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "runtime/base/sort_order.hpp"

namespace carillon::error_bars {
namespace {

using bank::Correction;

// Shares of lambda. Above the first limit the estimate is rough, above the second unreliable.
constexpr double kRoughT4 = 0.5, kStiffT4 = 1.0, kRoughT10 = 0.3, kStiffT10 = 0.6;
constexpr double kRoughWidthT4 = 0.45, kRoughWidthLumped = 0.5;  // of the mesh's bar
constexpr double kSingularShare = 0.25;                          // of the estimate's energy
constexpr double kHalf = 0.5, kHalfT4 = 0.4;                     // of the mesh's bar
constexpr double kAgreed = 0.25, kAgreedT10 = 0.125;             // of the mesh's bar, two meshes; T10: unless walls bend
constexpr double kAgree = 0.5, kNearlyAgree = 1.0;               // distance of two meshes, of the difference of their corrections
constexpr double kUnseen = 0.05;                                 // share of the estimate missing in recovered strains of curved T10
constexpr double kCurved = 0.25;                                 // of the estimate: the surface of curved T10
constexpr double kApart = 1.5;                                   // of the corrections of two meshes
constexpr double kOverlaid = 12.0;        // rough: a T4 mode whose bar others make so many times its own; results are the same from 2 to 12
constexpr double kSameEigenvalue = 1e-6;  // of lambda

double to_cents(double share) { return 600 * std::log2(share); }

/// has_rims: includes rims of fixed faces.
Correction find_correction(const ErrorParts& parts, const Level& level, bool has_rims) {
  const Kind kind = level.kind;
  if (level.is_lumped && kind != Kind::kT4) return Correction::kLumped;
  const bool is_t4 = kind == Kind::kT4;
  const double excess = calc_excess(parts, kind);
  if (excess > (is_t4 ? kStiffT4 : kStiffT10)) return Correction::kStiff;
  if (excess > (is_t4 ? kRoughT4 : kRoughT10)) return Correction::kRough;
  // At inward edges T10 are trusted (kInwardShare), at rims of fixed faces they underestimate.
  if ((is_t4 || has_rims) && parts.singular > kSingularShare * parts.interpolation) return Correction::kRough;
  constexpr double kDoubt = 0.25;  // of the mesh's bar: half of the corrected one
  if (level.is_guessed && calc_facet_cents(parts) > kDoubt * calc_cents(parts, kind)) return Correction::kRough;
  return Correction::kOneMesh;
}

/// Of T10: recovered strains show nearly all of the estimate, walls being flat or thick and surfaces well met (a cone's is not near its
/// tip).
bool is_seen(const ErrorParts& parts, Kind kind) {
  const double excess = calc_excess(parts, kind);
  return kind != Kind::kT4 && excess - parts.interpolation <= kUnseen * excess && std::abs(parts.geometry) <= kCurved * excess;
}

/// Averages the parts of degenerate modes.
std::vector<ErrorParts> share_parts(const Level& level) {
  std::vector<ErrorParts> shared = level.parts;
  for (std::size_t first = 0, end = 0; first < shared.size(); first = end) {
    for (end = first + 1; end < shared.size() && level.lambda[end] <= level.lambda[end - 1] * (1 + kSameEigenvalue);) ++end;
    for (double ErrorParts::*part :
         {&ErrorParts::interpolation, &ErrorParts::singular, &ErrorParts::bent, &ErrorParts::tractions, &ErrorParts::lumping,
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
  std::vector<double> agreed;          // (m) share of the mesh's bar that is left where two meshes agree
};

/// Interval of each mode around its stated value.
OwnIntervals find_intervals(const Level& level, const std::vector<ErrorParts>& parts, const Corrections& corrections,
                            const Verdict& verdict) {
  OwnIntervals own;
  for (std::size_t m = 0; m < parts.size(); ++m) {
    ErrorParts one_sided = parts[m];
    one_sided.interpolation = one_sided.singular = one_sided.bent = 0.0;
    const double all = calc_cents(parts[m], level.kind), above = calc_cents(one_sided, level.kind);
    const double stated = to_cents(corrections.lambda[m] / level.lambda[m]);
    double low = -std::max(all, verdict.least_cents[m]), high = -low;
    if (corrections.correction[m] == Correction::kRough) {
      const double part = level.is_lumped ? kRoughWidthLumped : kRoughWidthT4;
      const double width = level.kind == Kind::kT4 ? std::max(part * all, above) : HUGE_VAL;
      high = std::min(std::max(above, stated), stated + width);
      low = std::max(std::min(-all, stated), stated - width);
    } else if (bank::is_corrected(corrections.correction[m])) {
      const double alone = level.kind == Kind::kT4 && !level.is_lumped ? kHalfT4 : kHalf;
      const double factor = corrections.correction[m] == Correction::kOneMesh ? alone : verdict.agreed[m];
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
  const OwnIntervals own = find_intervals(level, parts, corrections, verdict);
  corrections.cents = widen_for_order(level.lambda, own, level.unlisted);
  for (std::size_t m = 0; m < parts.size(); ++m)
    corrections.own_cents.push_back(std::max(own.stated[m] - own.low[m], own.high[m] - own.stated[m]));
  corrections.complete_below = find_lowest_unlisted(level.lambda, own.low, level.unlisted);
  // No mode is corrected by more: it would be too stiff.
  const Unlisted& unlisted = level.unlisted;
  const double most = level.kind == Kind::kT4 ? 1 - kStiffT4 * (0.94 - kStiffT4 * (0.62 - 0.5 * kStiffT4)) : 1 / (1 + kStiffT10);
  const double top = std::max(level.lambda.back(), 4 * std::numbers::pi * std::numbers::pi * unlisted.high_hz * unlisted.high_hz);
  corrections.stated_above = std::max(find_lowest_unlisted(level.lambda, own.stated, unlisted), most * top);
  corrections.stated_below = find_highest_unlisted(level.lambda, own.stated, unlisted);
  corrections.complete_above = find_highest_unlisted(level.lambda, own.above, unlisted);
  if (level.kind == Kind::kT4)  // where bending is octaves too high, the k-th of the list need not be the k-th of the body
    for (std::size_t m = 0; m < parts.size(); ++m)
      if (bank::is_reliable(corrections.correction[m]) && corrections.cents[m] > kOverlaid * (own.high[m] - own.stated[m]))
        corrections.correction[m] = Correction::kRough;
  corrections.facet_cents = find_facet_cents(level, own, corrections.cents);
  if (is_too_short(level))
    for (auto* bars : {&corrections.cents, &corrections.own_cents}) bars->assign(bars->size(), std::numeric_limits<double>::infinity());
  return corrections;
}

/// Of T10, rough at rims only.
bool is_rough_at_rims(const ErrorParts& parts, const Level& level) {
  return level.kind != Kind::kT4 && level.has_rims && find_correction(parts, level, true) == Correction::kRough &&
         find_correction(parts, level, false) == Correction::kOneMesh;
}

Verdict make_verdict(std::vector<Correction> correction) {
  const std::size_t count = correction.size();
  return {std::move(correction), std::vector<double>(count, 0.0), std::vector<double>(count, kAgreed)};
}

/// Modes of one mesh with their error estimates.
struct Seen {
  const Level& level;
  const Corrections& corrections;

  double by(std::size_t m) const { return level.lambda[m] - corrections.lambda[m]; }
  bool may_exchange(std::size_t a, std::size_t b) const {
    return std::abs(to_cents(corrections.lambda[a] / corrections.lambda[b])) <= corrections.cents[a] + corrections.cents[b];
  }
};

/// Pairs (mode of the finer mesh, mode of the coarser): k-th with k-th, except that modes whose bars overlap are exchanged if both
/// corrections then fall as those of the other modes do.
std::vector<std::pair<std::size_t, std::size_t>> pair_modes(const Seen& fine, const Seen& coarse) {
  constexpr std::size_t kNear = 4;                           // places
  constexpr double kNone = 1e-6, kLeast = 0.7, kMost = 1.4;  // share of lambda; logarithms of factors 2 and 4
  const std::vector<std::size_t> order = base::find_sort_order(fine.corrections.lambda),
                                 others = base::find_sort_order(coarse.corrections.lambda);
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t k = 0; k < std::min(order.size(), others.size()); ++k) pairs.emplace_back(order[k], others[k]);
  const auto calc_fall = [&](std::size_t m, std::size_t n) {
    return std::log(std::max(std::abs(coarse.by(n)) / coarse.level.lambda[n], kNone) /
                    std::max(std::abs(fine.by(m)) / fine.level.lambda[m], kNone));
  };
  std::vector<double> falls;
  for (const auto& [m, n] : pairs) falls.push_back(calc_fall(m, n));
  if (falls.empty()) return pairs;
  const auto middle = falls.begin() + static_cast<std::ptrdiff_t>(falls.size() / 2);
  std::ranges::nth_element(falls, middle);
  const double usual = *middle;
  const auto calc_cost = [&](std::size_t m, std::size_t n) { return std::min(std::abs(calc_fall(m, n) - usual), kMost); };
  for (std::size_t j = 1; j < pairs.size(); ++j)
    for (std::size_t i = j - std::min(j, kNear); i < j; ++i) {
      auto& [m, a] = pairs[i];
      auto& [n, b] = pairs[j];
      const double gain = calc_cost(m, a) + calc_cost(n, b) - calc_cost(m, b) - calc_cost(n, a);
      if (gain > kLeast && coarse.may_exchange(a, b)) std::swap(a, b);
    }
  return pairs;
}

/// Verdict on the modes of a mesh compared with coarser ones. On contradiction the estimate and its bar are wrong: the finer mesh is then
/// closer to the truth than to the coarser mesh. A rough estimate of T10 may agree, but proves nothing wrong.
Verdict compare(const Level& level, const std::vector<ErrorParts>& parts, const Corrections& corrections, std::span<const Level> coarser) {
  Verdict verdict = make_verdict(corrections.correction);
  for (const Level& before : coarser) {
    const Corrections other = calc_corrections(before);
    const std::vector<ErrorParts> other_parts = share_parts(before);
    for (const auto& [m, n] : pair_modes({level, corrections}, {before, other})) {
      const bool is_rough = level.kind != Kind::kT4 && other.correction[n] == Correction::kRough;
      const bool is_rim = is_rough_at_rims(parts[m], level);
      if ((corrections.correction[m] != Correction::kOneMesh && !is_rim) || (other.correction[n] != Correction::kOneMesh && !is_rough))
        continue;
      const double fine = corrections.lambda[m], coarse = other.lambda[n];
      const double fine_by = level.lambda[m] - fine, coarse_by = before.lambda[n] - coarse;
      const bool are_seen = !is_rim && is_seen(parts[m], level.kind) && is_seen(other_parts[n], level.kind);
      // The k-th of T4 need not be the same mode, so that nearly is not enough.
      const double apart = std::abs(coarse - fine) / std::abs(coarse_by - fine_by), most = level.kind == Kind::kT4 ? kAgree : kNearlyAgree;
      if (apart <= most && std::abs(coarse_by) >= kApart * std::abs(fine_by)) {
        const double share = (are_seen ? kAgreedT10 : kAgreed) * std::max(1.0, apart / kAgree);
        verdict.agreed[m] = verdict.correction[m] == Correction::kTwoMeshes ? std::min(verdict.agreed[m], share) : share;
        verdict.correction[m] = Correction::kTwoMeshes;
      } else if (!is_rough && !is_rim && verdict.correction[m] != Correction::kTwoMeshes &&
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
  std::vector<Correction> found;
  for (const ErrorParts& mode : parts) found.push_back(find_correction(mode, level, level.has_rims));
  Corrections alone = correct(level, parts, make_verdict(std::move(found)));
  if (coarser.empty()) return alone;
  Corrections corrections = correct(level, parts, compare(level, parts, alone, coarser));
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
  if (level.kind == Kind::kT4 || level.one_layer <= kThin) return known;
  // Wide elements in bent walls are soon narrow enough to follow them.
  const bool is_bent = std::ranges::count_if(level.parts, [&](const ErrorParts& parts) { return !is_seen(parts, level.kind); }) * 2 >
                       std::ssize(level.parts);
  return is_bent ? 3.0 : 2.0;
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

}  // namespace carillon::error_bars
