// Method: coefficients as pairs of float, mode by mode in the order of the model. The 16-bit steps of a bank are exact as float, up to the
//   rounding of a mode's scale.
// Source: docs/gltf-multipoles.md; docs/equations.md E10.
// Deviations: none.
#include "runtime/exchange/glb_multipoles.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdint>
#include <numbers>
#include <string>

#include "runtime/bank/mixing.hpp"
#include "runtime/base/error.hpp"

namespace carillon::exchange {
namespace {

using base::Json;
using gltf::Component;

constexpr double kRounding = 1e-5;        // relative; of numbers stored as float
constexpr double kStepRounding = 0.02;    // steps of a coefficient
constexpr double kMaxDecayExcess = 1e-5;  // decay by radiation over the whole decay of a mode
constexpr double kSmallest = 1e-30;       // numbers below are imprecise as float
constexpr std::size_t kMaxModes = 10'000'000;

/// First component of each mode, and the end.
std::vector<std::size_t> find_first_components(const bank::Multipoles& air) {
  std::vector<std::size_t> first{0};
  for (const std::int32_t order : air.order) first.push_back(first.back() + 2 * bank::count_coefficients(order));
  return first;
}

int add_coupled_shapes(const bank::Bank& bank, const std::vector<std::size_t>& modes, gltf::Writer& writer) {
  bank::Bank coupled = bank;
  bank::mix_modes(coupled);
  return writer.add_rows(modes.size(), coupled.vertex_count(), [&](std::size_t k, std::span<float> numbers) {
    for (std::size_t v = 0; v < coupled.vertex_count(); ++v) {
      const Vec3 phi = coupled.shape_at(v, modes[k]);
      for (std::size_t c = 0; c < 3; ++c) numbers[3 * v + c] = static_cast<float>(phi[c]);
    }
  });
}

/// Finite numbers of an accessor of `count` entries.
gltf::Numbers read_numbers(gltf::File& file, base::Object& own, const char* key, const char* type, std::size_t count, const char* what) {
  if (!own.has(key)) own.fail(key, "is missing, the index of an accessor; export it again");
  const gltf::Numbers numbers = file.read(own, key, type, {Component::kFloat});
  if (numbers.count() != count) own.fail(key, fmt::format("has {} entries, but {} need {}; export it again", numbers.count(), what, count));
  return numbers;
}

std::vector<double> read_finite(const gltf::Numbers& numbers, std::size_t columns, base::Object& own, const char* key) {
  std::vector<double> values;
  values.reserve(columns * numbers.count());
  for (std::size_t i = 0; i < numbers.count(); ++i)
    for (std::size_t c = 0; c < columns; ++c) {
      values.push_back(numbers.get(i, c));
      if (!std::isfinite(values.back()))
        own.fail(key, fmt::format("entry {} is {}, not a finite number; export it again", i, values.back()));
    }
  return values;
}

void read_orders(base::Object& own, std::size_t modes, bank::Multipoles& air) {
  const std::vector<double> orders = own.number_list("orders", kMaxModes);
  if (orders.size() != modes)
    own.fail("orders", fmt::format("has {} numbers, but the model has {} modes; export it again", orders.size(), modes));
  for (std::size_t m = 0; m < modes; ++m) {
    if (!(orders[m] >= 0.0 && orders[m] <= bank::kMaxOrder && orders[m] == std::floor(orders[m])))
      own.fail("orders", fmt::format("number {} is {:g}; an order is a whole number from 0 to {}", m, orders[m], bank::kMaxOrder));
    air.order.push_back(static_cast<std::int32_t>(orders[m]));
  }
}

}  // namespace

Json describe_multipoles(const bank::Bank& bank, const std::vector<std::size_t>& modes, gltf::Writer& writer) {
  const bank::Multipoles& air = bank.multipoles;
  const std::vector<std::size_t> first = find_first_components(air);
  std::vector<std::int32_t> orders;
  std::vector<float> coefficients, decays, errors;
  for (const std::size_t m : modes) {
    orders.push_back(air.order[m]);
    for (std::size_t i = first[m]; i < first[m + 1]; ++i) coefficients.push_back(static_cast<float>(air.scale[m] * air.coefficient[i]));
    decays.push_back(static_cast<float>(air.decay_per_s[m]));
    errors.push_back(static_cast<float>(air.error_db[m]));
  }
  Json own = Json::object();
  own.set("center", Json::array(air.centre_m)).set("radius", air.radius_m).set("validRadius", air.nearest_m);
  own.set("airDensity", air.air_density_kg_m3).set("speedOfSound", air.sound_speed_ms).set("orders", Json::array(orders));
  own.set("coefficients", writer.add_pairs(coefficients)).set("decayRates", writer.add_scalars(decays));
  own.set("errors", writer.add_scalars(errors));
  if (!air.mixing.is_empty()) own.set("shapes", add_coupled_shapes(bank, modes, writer));
  return own;
}

std::optional<GlbMultipoles> read_multipoles(gltf::File& file, base::Object& model, const GlbModes& modes) {
  std::optional<base::Object> extensions = model.object_if("extensions");
  std::optional<base::Object> own = extensions ? extensions->object_if(kMultipoles) : std::nullopt;
  if (!own) return std::nullopt;
  const std::size_t count = modes.freq_hz.size();
  GlbMultipoles read;
  bank::Multipoles air;
  air.centre_m = own->numbers<3>("center");
  air.radius_m = own->number("radius", base::kPositive);
  air.nearest_m = own->number_or("validRadius", air.radius_m, base::kPositive);
  if (air.nearest_m < air.radius_m)
    own->fail("validRadius", fmt::format("is {:g} m, inside the sphere of {:g} m; give at least its radius", air.nearest_m, air.radius_m));
  air.air_density_kg_m3 = own->number("airDensity", base::kPositive);
  air.sound_speed_ms = own->number("speedOfSound", base::kPositive);
  air.method = fmt::format("imported from {}", kMultipoles);
  bank::Multipoles orders;
  read_orders(*own, count, orders);
  std::size_t rows = 0;
  for (const std::int32_t order : orders.order) rows += bank::count_coefficients(order);
  const std::vector<double> numbers =
      read_finite(read_numbers(file, *own, "coefficients", "VEC2", rows, "multipoles of these orders"), 2, *own, "coefficients");
  air.decay_per_s = read_finite(read_numbers(file, *own, "decayRates", "SCALAR", count, "the modes"), 1, *own, "decayRates");
  air.error_db.assign(count, 0.0);
  if (own->has("errors")) air.error_db = read_finite(read_numbers(file, *own, "errors", "SCALAR", count, "the modes"), 1, *own, "errors");
  std::vector<std::complex<double>> coefficients;
  for (std::size_t m = 0, at = 0; m < count; ++m) {
    const double whole = modes.decay_per_s[m];
    if (!(air.decay_per_s[m] >= 0.0 && air.decay_per_s[m] <= whole * (1.0 + kMaxDecayExcess)))
      own->fail("decayRates", fmt::format("number {} is {:g} 1/s, not between 0 and the whole decay of the mode, {:g} 1/s", m,
                                          air.decay_per_s[m], whole));
    if (!(air.error_db[m] <= 0.0)) own->fail("errors", fmt::format("number {} is {:g} dB; an error is at most 0 dB", m, air.error_db[m]));
    coefficients.clear();
    for (std::size_t i = 0; i < bank::count_coefficients(orders.order[m]); ++i, at += 2)
      coefficients.emplace_back(numbers[at], numbers[at + 1]);
    bank::add_coefficients(air, orders.order[m], coefficients);
    air.freq_hz.push_back(std::hypot(modes.freq_hz[m], whole / (2.0 * std::numbers::pi)));
  }
  air.added_mass.assign(count, 0.0);
  if (own->has("shapes")) {
    read.shapes = read_numbers(file, *own, "shapes", "VEC3", count * modes.points, "the modes at the points of the model");
    read_finite(*read.shapes, 3, *own, "shapes");
  }
  read.multipoles = std::move(air);
  return read;
}

bool are_multipoles_of(const GlbMultipoles& read, const bank::Multipoles& own, const std::vector<std::size_t>& modes) {
  const bank::Multipoles& air = read.multipoles;
  if (own.is_empty() || air.centre_m != own.centre_m || air.radius_m != own.radius_m || air.nearest_m != own.nearest_m ||
      air.air_density_kg_m3 != own.air_density_kg_m3 || air.sound_speed_ms != own.sound_speed_ms)
    return false;
  const std::vector<std::size_t> first = find_first_components(own);
  const auto is_near = [](double a, double b) { return std::abs(a - b) <= kRounding * std::abs(b) + kSmallest; };
  std::size_t at = 0;
  for (std::size_t k = 0; k < modes.size(); ++k) {
    const std::size_t m = modes[k];
    if (air.order[k] != own.order[m] || !is_near(air.decay_per_s[k], own.decay_per_s[m]) || !is_near(air.error_db[k], own.error_db[m]))
      return false;
    for (std::size_t i = first[m]; i < first[m + 1]; ++i, ++at)
      if (!(std::abs(air.scale[k] * air.coefficient[at] - own.scale[m] * own.coefficient[i]) <= kStepRounding * own.scale[m])) return false;
  }
  return true;
}

}  // namespace carillon::exchange
