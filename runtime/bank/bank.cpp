#include "runtime/bank/bank.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace carillon::bank {

double Bank::freq_hz(std::size_t mode) const { return std::sqrt(eigenvalue_rad2_s2[mode]) / (2.0 * std::numbers::pi); }

double calc_wave_impedance(const Material& material) {
  const double nu = std::min(material.poisson_ratio, 0.45);
  const double modulus = material.young_modulus_pa * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu));
  return std::sqrt(modulus * material.density_kg_m3);
}

double calc_decay(const Damping& damping, const Material& material, double eigenvalue_rad2_s2) {
  const double omega = std::sqrt(eigenvalue_rad2_s2);
  if (damping.law == "internal_friction") return damping.coefficient[0] * omega / 2.0;
  if (damping.law == "caughey") {
    double c = 0.0;
    for (std::size_t j = 0; j < damping.power.size(); ++j) c += damping.coefficient[j] * std::pow(eigenvalue_rad2_s2, damping.power[j]);
    return c / 2.0;
  }
  if (damping.law == "loss_table") {
    const auto& freq = damping.freq_hz;
    const auto& eta = damping.loss_factor;
    const double f = omega / (2.0 * std::numbers::pi);
    const std::size_t above = std::upper_bound(freq.begin(), freq.end(), f) - freq.begin();
    if (above == 0) return eta.front() * omega / 2.0;
    if (above == freq.size()) return eta.back() * omega / 2.0;
    const double part = std::log(f / freq[above - 1]) / std::log(freq[above] / freq[above - 1]);
    return std::lerp(eta[above - 1], eta[above], part) * omega / 2.0;
  }
  return (material.alpha1_s * eigenvalue_rad2_s2 + material.alpha2_per_s) / 2.0;
}

std::vector<double> calc_shapes(const Bank& bank, std::int32_t triangle, const Vec3& barycentric) {
  const std::size_t values = 3 * bank.mode_count();
  std::vector<double> shapes(values, 0.0);
  const auto& corners = bank.triangles[triangle];
  for (std::size_t c = 0; c < 3; ++c) {
    const std::int16_t* row = bank.shape.data() + static_cast<std::size_t>(corners[c]) * values;
    for (std::size_t i = 0; i < values; ++i) shapes[i] += barycentric[c] * bank.shape_scale[i / 3] * row[i];
  }
  return shapes;
}

Vec3 calc_point(const Bank& bank, std::int32_t triangle, const Vec3& barycentric) {
  Vec3 point{};
  for (std::size_t c = 0; c < 3; ++c) point = point + barycentric[c] * bank.vertices_m[bank.triangles[triangle][c]];
  return point;
}

double calc_shape_scale(double largest) {
  // A subnormal step would violate the error bound; physical shapes are far larger.
  return largest > 0.0 ? std::max(largest / 32767.0, std::numeric_limits<double>::min()) : 0.0;
}

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
  for (std::size_t mode = 0; mode < modes; ++mode) bank.shape_scale[mode] = calc_shape_scale(largest[mode]);
  bank.shape.resize(shapes.size());
  for (std::size_t i = 0; i < shapes.size(); ++i) bank.shape[i] = find_step(shapes[i], bank.shape_scale[i % row / 3]);
}

}  // namespace carillon::bank
