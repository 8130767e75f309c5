// Method: sum of the parts without cancellation, each with a safety factor, as a ratio of frequencies.
// Source: rates: Strang and Fix 1973, An Analysis of the Finite Element Method, ch. 6 and 8; Williams 1952, J. Appl. Mech. 19, 526.
// Factors: measured, docs/error-bars.md.
#include <algorithm>
#include <cmath>

#include "precompute/fem/error_bars/parts.hpp"

namespace carillon::error_bars {
namespace {

/// Bound on the relative shift of lambda by the alternative surface.
double calc_shift(double shift, double noise) {
  constexpr double kShift = 1.5, kNoise = 0.15;
  return kShift * std::abs(shift) + kNoise * noise;
}

}  // namespace

double find_order(Kind kind) { return kind == Kind::kT4 ? 2.0 : 4.0; }

ErrorParts predict_parts(const ErrorParts& parts, Kind kind, double order, double edge_ratio) {
  const double second = edge_ratio * edge_ratio, interpolation = std::pow(edge_ratio, order),
               singular = std::pow(edge_ratio, std::min(order, kSingularOrder));
  const double geometry = kind == Kind::kT10Curved ? second * second : second;
  ErrorParts then = parts;
  then.interpolation = (parts.interpolation - parts.singular) * interpolation + parts.singular * singular;
  then.singular *= singular;
  then.bent *= interpolation * second;
  then.lumping *= second;
  then.geometry *= geometry;
  then.geometry_noise *= geometry;
  return then;
}

// Single-layer elements that rise by q of the wall's thickness stretch where the wall only bends, and so do their neighbours: recovered
// strains show only part of the error. Measured on hollow spheres and tubes of the table: a factor of 1 + (3.5 to 6) q^2.
double calc_excess(const ErrorParts& parts, Kind kind) {
  constexpr double kBent = 4.0;
  return parts.interpolation + (kind == Kind::kT4 ? 0.0 : kBent * parts.bent);
}

double calc_cents(const ErrorParts& parts, Kind kind) {
  constexpr double kMaxOfEnergy = 0.99, kT10 = 3.5, kT10Lumped = 4.5;
  const double interpolation = calc_excess(parts, kind), lumping = std::abs(parts.lumping);
  // Converts a share of the computed lambda to one of the true, smaller lambda, times a safety factor.
  const auto enlarge = [&](double factor, double share) {
    const double s = std::clamp(share, 0.0, kMaxOfEnergy);
    return factor * s / (1.0 - s);
  };
  // Interpolation raises lambda, a lumped mass lowers it; cancellation is trusted within limits only.
  double mesh = enlarge(kind == Kind::kT4 ? 2.0 : kT10, interpolation);
  if (lumping > 0.0 && kind == Kind::kT4)
    mesh = enlarge(2.0, std::abs(interpolation - lumping)) + 0.4 * std::min(interpolation, lumping);
  else if (lumping > 0.0)  // upward and downward
    mesh = std::max(enlarge(kT10Lumped, interpolation) - lumping, 1.75 * lumping - 0.65 * interpolation);
  return 600.0 * std::log2(1.0 + mesh + calc_shift(parts.geometry, parts.geometry_noise));
}

double calc_facet_cents(const ErrorParts& parts) { return 600.0 * std::log2(1.0 + calc_shift(parts.doubt, parts.doubt_noise)); }

}  // namespace carillon::error_bars
