#include "runtime/bank/bank.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace carillon::bank {

double Bank::freq_hz(std::size_t mode) const { return std::sqrt(eigenvalue_rad2_s2[mode]) / (2.0 * std::numbers::pi); }

void quantise_shapes(Bank& bank, std::span<const double> shapes) {
  const std::size_t modes = bank.mode_count();
  const std::size_t row = 3 * modes;
  if (shapes.size() != bank.vertex_count() * row) {
    throw InputError(
        fmt::format("{} shape values were given for {} vertices and {} modes; give (V, m, 3)", shapes.size(), bank.vertex_count(), modes));
  }
  std::vector<double> largest(modes, 0.0);
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    const std::size_t mode = i % row / 3;
    if (!std::isfinite(shapes[i]))
      throw InputError(fmt::format("the shape of mode {} at vertex {} is not finite; solve again", mode, i / row));
    largest[mode] = std::max(largest[mode], std::abs(shapes[i]));
  }
  bank.shape_scale.resize(modes);
  for (std::size_t mode = 0; mode < modes; ++mode) {
    // A step too small for a normal double would not hold the error bound; no real shape comes near.
    bank.shape_scale[mode] = largest[mode] > 0.0 ? std::max(largest[mode] / 32767.0, std::numeric_limits<double>::min()) : 0.0;
  }
  bank.shape.resize(shapes.size());
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    const double scale = bank.shape_scale[i % row / 3];
    bank.shape[i] = scale > 0.0 ? static_cast<std::int16_t>(std::lround(shapes[i] / scale)) : std::int16_t{0};
  }
}

}  // namespace carillon::bank
