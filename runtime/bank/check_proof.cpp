// Checks of a bank's proof of completeness and of its error bars.
// Method: the number of eigenvalues below sigma is the number of negative pivots of K - sigma M = L D L^T. The modes between two cuts must
//   equal the difference of the counts; a cut inside the error bar of a mode would make its count uncertain.
// Source: Sylvester's law of inertia; Parlett 1998, The symmetric eigenvalue problem, section 3.3.
// Deviations: counts cannot be repeated without K and M; they are trusted if the backward error of the factorisation is far below the
//   distance to the nearest mode.
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/faults.hpp"

namespace carillon::bank {
namespace {

constexpr double kOrthonormalityLimit = 1e-6;
constexpr double kBackwardLimit = 1e-8;
constexpr double kBandTolerance = 1e-9;  // relative rounding of band_hz and cut_hz
constexpr double kZeroFraction = 1e-5;   // relative to the upper end of the band: zero to working precision below
constexpr double kMarginTolerance = 1e-6;
constexpr double kClusterSpread = 1e-4;  // of lambda

double calc_lambda(double freq_hz) {
  const double omega = 2.0 * std::numbers::pi * freq_hz;
  return omega * omega;
}

/// Number of modes of the bank below the cut.
std::int64_t count_modes_below(const Bank& bank, double cut_hz) {
  const auto& lambda = bank.eigenvalue_rad2_s2;
  return std::lower_bound(lambda.begin(), lambda.end(), calc_lambda(cut_hz)) - lambda.begin();
}

/// Number of modes of the mesh that were left out below the band, and lie below the cut.
std::int64_t count_left_below(const Proof& proof, double cut_hz) {
  return std::lower_bound(proof.below_band_hz.begin(), proof.below_band_hz.end(), cut_hz) - proof.below_band_hz.begin();
}

/// Relative uncertainty of the eigenvalue: its error bar, else its residual.
double calc_uncertainty(const Bank& bank, std::size_t mode) {
  if (bank.algebraic_error_cents.empty()) return bank.residual[mode];
  return std::exp2(bank.algebraic_error_cents[mode] / 600.0) - 1.0;
}

/// "6 + 6" for few, "6 each" for many equal ones.
std::string describe_rigid(const std::vector<std::int64_t>& rigid) {
  if (rigid.empty()) return "none";
  if (std::equal(rigid.begin() + 1, rigid.end(), rigid.begin()))
    return rigid.size() == 1 ? fmt::format("{} of the one component", rigid[0])
                             : fmt::format("{} of each of {} components", rigid[0], rigid.size());
  const auto shown = std::min<std::size_t>(rigid.size(), 12);
  return fmt::format("{}{} of {} components", fmt::join(rigid.begin(), rigid.begin() + static_cast<std::ptrdiff_t>(shown), " + "),
                     shown < rigid.size() ? " + ..." : "", rigid.size());
}

/// Sizes and order of the counts; prerequisite of the other checks.
Check check_cuts(const Bank& bank, const Proof& proof) {
  Faults faults;
  const std::size_t cuts = proof.cut_hz.size();
  if (cuts < 2 || proof.below.size() != cuts || proof.margin.size() != cuts) {
    faults.add("the proof has {} cuts, {} counts and {} margins: two or more of each are wanted, as many of one as of the others", cuts,
               proof.below.size(), proof.margin.size());
    return {"counts", "", faults.take()};
  }
  for (std::size_t i = 0; i < cuts; ++i) {
    if (!(proof.cut_hz[i] > (i == 0 ? 0.0 : proof.cut_hz[i - 1])))
      faults.add("cut {} at {:.6g} Hz is not above the one before", i, proof.cut_hz[i]);
    if (proof.below[i] < (i == 0 ? 0 : proof.below[i - 1])) {
      faults.add("{} eigenvalues below {:.6g} Hz are fewer than below the cut before: counts cannot fall", proof.below[i], proof.cut_hz[i]);
    }
  }
  const double low = std::max(bank.band_hz[0], kZeroFraction * bank.band_hz[1]);
  if (!(proof.cut_hz.front() <= low * (1.0 + kBandTolerance)))
    faults.add("the first cut at {:.6g} Hz is inside the band", proof.cut_hz.front());
  if (!(proof.cut_hz.back() >= bank.band_hz[1] * (1.0 - kBandTolerance)))
    faults.add("the last cut at {:.6g} Hz is inside the band", proof.cut_hz.back());
  return {"counts",
          fmt::format("{} eigenvalues below {:.6g} Hz, {} below {:.6g} Hz, {} cut{} between", proof.below.front(), proof.cut_hz.front(),
                      proof.below.back(), proof.cut_hz.back(), cuts - 2, cuts == 3 ? "" : "s"),
          faults.take()};
}

/// Modes of the bank against the counts, in each interval between cuts.
Check check_completeness(const Bank& bank, const Proof& proof) {
  Faults faults;
  const auto modes = static_cast<std::int64_t>(bank.mode_count()), left_out = static_cast<std::int64_t>(proof.below_band_hz.size());
  const std::int64_t counted = proof.below.back() - proof.below.front();
  for (std::size_t i = 0; i + 1 < proof.cut_hz.size(); ++i) {
    const std::int64_t wanted = proof.below[i + 1] - proof.below[i];
    const std::int64_t left = count_left_below(proof, proof.cut_hz[i + 1]) - count_left_below(proof, proof.cut_hz[i]);
    const std::int64_t held = count_modes_below(bank, proof.cut_hz[i + 1]) - count_modes_below(bank, proof.cut_hz[i]) + left;
    // The lowest modes are kept, or those of the band, by their corrected frequencies: only past the end of the list may counts exceed it.
    const bool is_cut_here = proof.complete_below_hz > 0.0 ? proof.cut_hz[i + 1] > proof.complete_below_hz
                                                           : !bank.complete && count_modes_below(bank, proof.cut_hz[i + 1]) == modes;
    if (held == wanted || (is_cut_here && held < wanted)) continue;
    faults.add("{} modes lie between {:.6g} and {:.6g} Hz by the counts, and the bank holds {}", wanted, proof.cut_hz[i],
               proof.cut_hz[i + 1], held);
  }
  const bool is_whole = bank.complete && proof.complete_below_hz == 0.0;
  const std::int64_t known = modes + left_out;
  const bool adds_up = is_whole ? proof.found == counted && known == counted : proof.found >= known && proof.found <= counted;
  if (!adds_up) {
    faults.add("{} modes were found, {} are stored, and the counts give {} - {} = {}", proof.found, modes, proof.below.back(),
               proof.below.front(), counted);
  }
  const bool is_corrected = modes == 0 || !bank.corrected.is_empty();
  if (left_out > 0 && !is_corrected) faults.add("below_band_hz has {} modes, and none has a corrected frequency", left_out);
  if (!std::is_sorted(proof.below_band_hz.begin(), proof.below_band_hz.end())) faults.add("below_band_hz does not ascend");
  // A complete bank without modes of the mesh lacks those whose corrected frequencies are above the band.
  const bool may_lack = !bank.complete || (is_corrected && proof.found == counted && proof.found > known);
  if (may_lack ? !(proof.complete_below_hz >= 0.0) : proof.complete_below_hz != 0.0)
    faults.add("complete_below_hz is {:.6g}, of a bank that is {}", proof.complete_below_hz, bank.complete ? "complete" : "cut");
  return {"complete",
          is_whole && left_out == 0 ? fmt::format("{} - {} = {} modes, all of them found; every interval between cuts agrees",
                                                  proof.below.back(), proof.below.front(), counted)
          : bank.complete
              ? fmt::format("{} - {} = {} modes of the mesh, {} of them in the band once corrected; every interval between cuts agrees",
                            proof.below.back(), proof.below.front(), counted, modes)
              : fmt::format("the lowest {} of {} - {} = {} modes; every interval between cuts agrees", modes, proof.below.back(),
                            proof.below.front(), counted),
          faults.take()};
}

/// Cuts must lie outside the modes' error bars, with the recorded margins.
Check check_margins(const Bank& bank, const Proof& proof) {
  Faults faults;
  double min = 1.0, min_hz = proof.cut_hz.front();
  for (std::size_t i = 0; i < proof.cut_hz.size(); ++i) {
    const double sigma = calc_lambda(proof.cut_hz[i]);
    double nearest = 1.0;
    const std::size_t above = count_modes_below(bank, proof.cut_hz[i]);
    for (const std::size_t mode : {above - 1, above}) {  // above = 0 wraps around: no mode
      if (mode >= bank.mode_count()) continue;
      const double lambda = bank.eigenvalue_rad2_s2[mode];
      nearest = std::min(nearest, std::abs(lambda - sigma) / sigma);
      if (!(std::abs(lambda - sigma) > calc_uncertainty(bank, mode) * lambda))
        faults.add("the cut at {:.9g} Hz lies inside the error bar of mode {} at {:.9g} Hz: its count is uncertain", proof.cut_hz[i], mode,
                   bank.freq_hz(mode));
    }
    const double recorded = proof.margin[i];
    const bool agrees = recorded <= nearest * (1.0 + kMarginTolerance) + 1e-12;  // a mode outside the list may be closer
    if (!(recorded > 0.0 && agrees))
      faults.add("margin[{}] is {:.6g}, and the nearest mode is {:.6g} of lambda from the cut", i, recorded, nearest);
    if (recorded < min) {
      min = recorded;
      min_hz = proof.cut_hz[i];
    }
  }
  return {"cuts", fmt::format("clear of every mode: the nearest is {:.2g} of lambda away, at {:.6g} Hz", min, min_hz), faults.take()};
}

Check check_rigid(const Bank& bank, const Proof& proof) {
  Faults faults;
  const auto& rigid = proof.rigid_per_component;
  if (rigid.size() != static_cast<std::size_t>(std::max<std::int64_t>(bank.counts.components, 0)))
    faults.add("rigid motions are recorded for {} components, and there are {}", rigid.size(), bank.counts.components);
  std::int64_t sum = 0;
  for (std::size_t i = 0; i < rigid.size(); ++i) {
    if (rigid[i] < 0 || rigid[i] > 6) faults.add("component {} has {} rigid motions", i, rigid[i]);
    sum += std::clamp<std::int64_t>(rigid[i], 0, 6);
  }
  if (sum != bank.counts.rigid_modes)
    faults.add("the components have {} rigid motions together, and {} were deflated", sum, bank.counts.rigid_modes);
  if (proof.below.front() < sum) faults.add("{} eigenvalues below the band are fewer than {} rigid motions", proof.below.front(), sum);
  const std::int64_t others = proof.below.front() - sum;
  return {
      "rigid modes",
      fmt::format("{}{}", describe_rigid(rigid),
                  others > 0 ? fmt::format(", and {} more below the band (slow modes, or parts that hang on a point or an edge)", others)
                             : ", and nothing else below the band"),
      faults.take()};
}

Check check_arithmetic(const Bank& bank, const Proof& proof) {
  Faults faults;
  if (!(proof.orthonormality >= 0.0 && proof.orthonormality <= kOrthonormalityLimit))
    faults.add("phi_i^T M phi_j is off by {:.3g}, beyond {:.0e}: modes may be duplicated", proof.orthonormality, kOrthonormalityLimit);
  if (!(proof.backward_error >= 0.0 && proof.backward_error <= kBackwardLimit))
    faults.add("the factorisation's backward error is {:.3g}, beyond {:.0e}: its counts are uncertain", proof.backward_error,
               kBackwardLimit);
  if (bank.element == "analytic") return {"arithmetic", "shapes are normalised by their theory, and nothing was factorised", faults.take()};
  return {"arithmetic",
          fmt::format("phi_i^T M phi_j = delta_ij to {:.1e}; backward error of the factorisations {:.1e}", proof.orthonormality,
                      proof.backward_error),
          faults.take()};
}

Check check_clusters(const Bank& bank, const Proof& proof) {
  Faults faults;
  const auto modes = static_cast<std::int64_t>(bank.mode_count());
  if (proof.cluster_first.size() != proof.cluster_count.size()) {
    faults.add("groups of degenerate modes: {} begin and {} have a size", proof.cluster_first.size(), proof.cluster_count.size());
    return {"degenerate modes", "", faults.take()};
  }
  std::int64_t next = 0, largest = 0;
  for (std::size_t i = 0; i < proof.cluster_first.size(); ++i) {
    const std::int64_t first = proof.cluster_first[i], count = proof.cluster_count[i];
    if (first < next || count < 2 || count > modes || first > modes - count) {
      faults.add("group {} of {} degenerate modes from mode {} cannot be", i, count, first);
      break;
    }
    next = first + count;
    largest = std::max(largest, count);
    const double low = bank.eigenvalue_rad2_s2[first], high = bank.eigenvalue_rad2_s2[next - 1];
    if (!(high - low <= kClusterSpread * high))
      faults.add("group {} of degenerate modes spreads over {:.2g} of lambda", i, (high - low) / high);
  }
  const std::size_t groups = proof.cluster_first.size();
  return {"degenerate modes",
          groups == 0 ? std::string("none: every shape stands for itself")
                      : fmt::format("{} group{} of up to {}: shapes of one subspace, in its canonical basis", groups,
                                    groups == 1 ? "" : "s", largest),
          faults.take()};
}

}  // namespace

Check check_error_bars(const Bank& bank) {
  Faults faults;
  std::string figure;
  for (const auto& [name, cents] :
       {std::pair("algebraic", &bank.algebraic_error_cents), std::pair("discretisation", &bank.discretisation_error_cents),
        std::pair("facet", &bank.facet_error_cents)}) {
    if (cents == &bank.facet_error_cents && cents->empty()) continue;
    for (std::size_t i = 0; i < cents->size(); ++i)
      if (!((*cents)[i] >= 0.0)) faults.add("{}_error_cents[{}] is {:.6g}, negative", name, i, (*cents)[i]);
    if (!figure.empty()) figure += "; ";
    if (cents->empty()) {
      figure += fmt::format("{} not given", name);
      continue;
    }
    std::vector<double> sorted = *cents;
    std::sort(sorted.begin(), sorted.end(), [](double a, double b) { return a < b || (std::isnan(b) && !std::isnan(a)); });
    figure += std::isfinite(sorted.back())
                  ? fmt::format("{} at most {:.2g} cent, median {:.2g}", name, sorted.back(), sorted[sorted.size() / 2])
                  : fmt::format("{} not known of all modes", name);
  }
  return {"error bars", figure, faults.take()};
}

std::vector<Check> check_proof(const Bank& bank) {
  if (!bank.proof)
    return {{"proof", "none: nothing but residuals speaks for this bank (version 1.0, made by hand, or the loudest modes of another)", {}}};
  const Proof& proof = *bank.proof;
  std::vector<Check> checks{check_cuts(bank, proof)};
  if (!checks[0].faults.empty()) return checks;
  checks.push_back(check_completeness(bank, proof));
  checks.push_back(check_margins(bank, proof));
  checks.push_back(check_rigid(bank, proof));
  checks.push_back(check_arithmetic(bank, proof));
  checks.push_back(check_clusters(bank, proof));
  return checks;
}

std::string describe_completeness(const Bank& bank) {
  const auto modes = bank.mode_count();
  const auto [low, high] = bank.band_hz;
  if (!bank.proof && modes == 0 && !bank.complete) return "none: a body without modes, which collides and does not vibrate";
  if (!bank.proof)
    return fmt::format("none: {}", bank.complete ? fmt::format("nothing shows that the band holds no more than these {} modes", modes)
                                                 : fmt::format("{} modes of the band were kept, not all", modes));
  const Proof& proof = *bank.proof;
  const std::int64_t counted = proof.below.back() - proof.below.front();
  std::string text = bank.complete ? fmt::format("{} modes in {:g} .. {:g} Hz and no more", modes, low, high)
                     : std::ssize(bank.eigenvalue_rad2_s2) + std::ssize(proof.below_band_hz) == counted
                         ? fmt::format("{} modes in {:g} .. {:g} Hz, perhaps not all", modes, low, high)
                         : fmt::format("the lowest {} of {} modes in {:g} .. {:g} Hz", modes, counted, low, high);
  std::int64_t rigid = 0;
  for (const std::int64_t count : proof.rigid_per_component) rigid += count;
  text += fmt::format(": {} below {:.6g} Hz and {} below {:.6g} Hz {}, {} rigid", proof.below.front(), proof.cut_hz.front(),
                      proof.below.back(), proof.cut_hz.back(), bank.element == "analytic" ? "by enumeration" : "by inertia", rigid);
  if (const std::size_t left = proof.below_band_hz.size(); left > 0)
    text += fmt::format(", {} of the mesh below the band once corrected", left);
  return text;
}

std::string describe_accuracy(const Bank& bank) {
  const auto describe_largest = [](const std::vector<double>& cents, const char* known, const char* kind, const char* unknown) {
    return cents.empty() || std::isinf(*std::max_element(cents.begin(), cents.end()))
               ? std::string(unknown)
               : fmt::format("{} {:.2g} cent ({})", known, *std::max_element(cents.begin(), cents.end()), kind);
  };
  if (bank.mode_count() == 0 && !bank.proof && !bank.complete) return "there are no frequencies";
  if (bank.element == "imported") return "unknown: the frequencies are those of another program";
  if (bank.element == "analytic") {
    const std::vector<double>& cents = bank.discretisation_error_cents;
    const bool is_exact = std::all_of(cents.begin(), cents.end(), [](double c) { return c == 0.0; });
    return is_exact ? "frequencies are those of the theory, to rounding"
                    : describe_largest(cents, "frequencies are those of the theory to", "an estimate", "no estimates against the theory");
  }
  const bool is_corrected = !bank.corrected.is_empty();
  return describe_largest(bank.algebraic_error_cents, "frequencies are those of the mesh to", "a bound", "no bounds against the mesh") +
         describe_largest(is_corrected ? bank.corrected.error_cents : bank.discretisation_error_cents,
                          is_corrected ? ", corrected ones those of the body to about" : " and those of the body to about", "an estimate",
                          ", no estimates against the body") +
         (bank.facet_error_cents.empty() ? "" : "; " + describe_facets(bank));
}

std::string describe_facets(const Bank& bank) {
  if (bank.facet_error_cents.empty()) return {};
  return fmt::format("facets in doubt: {:.2g} cent more in the other case (planes of the body, or samples of a smooth surface)",
                     *std::max_element(bank.facet_error_cents.begin(), bank.facet_error_cents.end()));
}

}  // namespace carillon::bank
