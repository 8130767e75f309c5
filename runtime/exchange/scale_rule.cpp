#include "runtime/exchange/scale_rule.hpp"

#include <fmt/format.h>

#include <cmath>

namespace carillon::exchange {
namespace {

constexpr double kNoScale = 1e-6;           // relative difference from 1: rounding of a matrix in float
constexpr double kMassAgreement = 0.01;     // of two masses
constexpr double kDensityAgreement = 0.03;  // of a mass and density times volume
constexpr const char *kUnscaled = "unscaled", *kInitial = "of the initial node";

double calc_difference(double value, double expected) { return std::abs(value / expected - 1.0); }

std::string describe_taken(const ScaleFacts& facts, bool is_unscaled) {
  return is_unscaled ? fmt::format("frequencies are divided by {:.6g}", facts.scale) : "frequencies are unchanged";
}

}  // namespace

ScaleChoice choose_scale(const ScaleFacts& facts) {
  if (std::abs(facts.scale - 1.0) <= kNoScale) return {};
  const double cube = std::pow(facts.scale, 3);
  const auto begin = fmt::format("scale {:.6g}: the model is ", facts.scale);
  const auto choose = [&](bool is_unscaled, const std::string& why) {
    return ScaleChoice{is_unscaled, true,
                       fmt::format("{}{} ({}); {}", begin, is_unscaled ? kUnscaled : kInitial, why, describe_taken(facts, is_unscaled))};
  };
  if (facts.is_unscaled) return choose(*facts.is_unscaled, *facts.is_unscaled ? "--scale-frequencies yes" : "--scale-frequencies no");
  if (facts.body_kg && facts.model_kg) {
    const double unscaled = calc_difference(*facts.body_kg, *facts.model_kg * cube),
                 initial = calc_difference(*facts.body_kg, *facts.model_kg);
    // Both agree for scales near 1: the nearer one.
    if (unscaled <= kMassAgreement && unscaled <= initial) return choose(true, "motion.mass is massProperties.mass times scale^3");
    if (initial <= kMassAgreement) return choose(false, "motion.mass is massProperties.mass");
  } else if (!facts.body_kg && facts.model_kg && facts.density_kg_m3) {
    const double mass = *facts.density_kg_m3 * facts.volume_m3;
    const double unscaled = calc_difference(*facts.model_kg, mass), initial = calc_difference(*facts.model_kg, mass * cube);
    if (unscaled <= kDensityAgreement && unscaled <= initial) return choose(true, "massProperties.mass is density times volume as stored");
    if (initial <= kDensityAgreement) return choose(false, "massProperties.mass is density times scaled volume");
  }
  ScaleChoice choice = choose(false, "the masses do not say; the text of the extension says so");
  choice.is_sure = false;
  choice.reason += fmt::format(": the lowest is {:.6g} Hz, and would be {:.6g} Hz if the model is unscaled (--scale-frequencies yes)",
                               facts.lowest_hz, facts.lowest_hz / facts.scale);
  return choice;
}

}  // namespace carillon::exchange
