// Bodies with a nonlinear energy in closed form, and measures of their motion.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include "runtime/synth/nonlinear/coupled_modes.hpp"

namespace carillon::nonlinear::bodies {

inline constexpr double kPi = std::numbers::pi;

struct Body {
  bank::QuarticEnergy energy;
  std::vector<ModeConstants> modes;
};

inline double to_eigenvalue(double hz) { return 4.0 * kPi * kPi * hz * hz; }

/// q'' + lambda q + b q^3 = 0.
inline Body make_duffing(double hz, double b) {
  Body body;
  body.energy.modes = {0};
  body.energy.rows = {static_cast<float>(std::sqrt(b / 2.0))};
  body.modes = {{to_eigenvalue(hz), 0.0}};
  return body;
}

/// Complete elliptic integral of the first kind by the arithmetic-geometric mean; parameter m.
inline double calc_elliptic_k(double m) {
  double a = 1.0, b = std::sqrt(1.0 - m);
  for (int i = 0; i < 40; ++i) {
    const double mean = 0.5 * (a + b);
    b = std::sqrt(a * b);
    a = mean;
  }
  return kPi / (2.0 * a);
}

/// Frequency over that of soft motion, alpha = b amplitude^2 / lambda.
inline double calc_duffing_ratio(double alpha) {
  return kPi * std::sqrt(1.0 + alpha) / (2.0 * calc_elliptic_k(alpha / (2.0 * (1.0 + alpha))));
}

/// From upward crossings of zero, each by a cubic through four samples' worth of slope: linear interpolation would be too coarse.
inline double measure_hz(CoupledModes& modes, int mode, double rate_hz, int samples) {
  std::vector<double> q;
  for (int n = 0; n < samples; ++n) {
    modes.step();
    q.push_back(modes.get_amplitude(mode));
  }
  double first = -1.0, last = -1.0;
  int count = -1;
  for (std::size_t n = 2; n + 2 < q.size(); ++n) {
    if (!(q[n] < 0.0 && q[n + 1] >= 0.0)) continue;
    double t = q[n] / (q[n] - q[n + 1]);
    for (int i = 0; i < 8; ++i) {  // Newton on the cubic through samples n - 1 to n + 2
      const auto at = [&](double x) {
        return -q[n - 1] * x * (x - 1) * (x - 2) / 6 + q[n] * (x + 1) * (x - 1) * (x - 2) / 2 - q[n + 1] * (x + 1) * x * (x - 2) / 2 +
               q[n + 2] * (x + 1) * x * (x - 1) / 6;
      };
      t -= at(t) * 2e-6 / (at(t + 1e-6) - at(t - 1e-6));
    }
    last = static_cast<double>(n) + t;
    if (count++ < 0) first = last;
  }
  return count * rate_hz / (last - first);
}

/// A rectangular plate, simply supported, with edges that stay straight and do not move in.
struct Plate {
  double a_m = 0.4, b_m = 0.3, thickness_m = 1e-3, young_pa = 200e9, poisson = 0.3, density_kg_m3 = 7850.0;

  struct Number {
    int m, n;
    double omega;
  };
  std::vector<Number> find_modes(std::size_t count) const {
    const double d = young_pa * std::pow(thickness_m, 3) / (12.0 * (1.0 - poisson * poisson));
    std::vector<Number> all;
    for (int m = 1; m < 60; ++m)
      for (int n = 1; n < 60; ++n)
        all.push_back({m, n, std::sqrt(d / (density_kg_m3 * thickness_m)) * kPi * kPi * (m * m / (a_m * a_m) + n * n / (b_m * b_m))});
    std::sort(all.begin(), all.end(), [](const Number& x, const Number& y) { return x.omega < y.omega; });
    all.resize(count);
    return all;
  }
  double calc_amplitude() const { return 2.0 / std::sqrt(density_kg_m3 * thickness_m * a_m * b_m); }
  double calc_phi(const Number& mode, double x, double y) const {
    return calc_amplitude() * std::sin(mode.m * kPi * x / a_m) * std::sin(mode.n * kPi * y / b_m);
  }

  /// Stress functions cos(k pi x / a) cos(l pi y / b) with (del^4 F = E h (w_xy^2 - w_xx w_yy)), and the two mean strains.
  Body make(std::size_t count, double (*decay)(double omega)) const {
    const std::vector<Number> modes = find_modes(count);
    const double c = calc_amplitude(), eh = young_pa * thickness_m, area = a_m * b_m;
    std::map<std::pair<int, int>, std::vector<double>> rows;  // by k and l
    std::vector<std::vector<double>> mean(2, std::vector<double>(bank::count_pairs(count)));
    for (std::size_t j = 0; j < count; ++j)
      for (std::size_t i = 0; i <= j; ++i) {
        const Number &u = modes[i], &v = modes[j];
        const double um = u.m * kPi / a_m, un = u.n * kPi / b_m, vm = v.m * kPi / a_m, vn = v.n * kPi / b_m;
        for (const int sx : {1, -1})
          for (const int sy : {1, -1}) {
            const int k = sx > 0 ? std::abs(u.m - v.m) : u.m + v.m, l = sy > 0 ? std::abs(u.n - v.n) : u.n + v.n;
            const double g = c * c / 4.0 * (um * vm * un * vn - 0.5 * sx * sy * (um * um * vn * vn + vm * vm * un * un));
            if (k == 0 && l == 0) continue;
            const double norm = area * (k > 0 && l > 0 ? 0.25 : 0.5);
            const double square = std::pow(k * kPi / a_m, 2) + std::pow(l * kPi / b_m, 2);
            auto& row = rows.try_emplace({k, l}, bank::count_pairs(count)).first->second;
            row[bank::find_pair(i, j)] += std::sqrt(eh * norm) * g / square;
          }
        if (i != j) continue;
        const double x = 0.125 * c * c * um * um, y = 0.125 * c * c * un * un;
        mean[0][bank::find_pair(i, i)] = std::sqrt(area * eh * (1.0 + poisson) / (2.0 * (1.0 - poisson * poisson))) * (x + y);
        mean[1][bank::find_pair(i, i)] = std::sqrt(area * eh * (1.0 - poisson) / (2.0 * (1.0 - poisson * poisson))) * (x - y);
      }
    Body body;
    for (std::size_t i = 0; i < count; ++i) {
      body.energy.modes.push_back(static_cast<std::int32_t>(i));
      body.modes.push_back({modes[i].omega * modes[i].omega, decay(modes[i].omega)});
    }
    for (const auto& row : mean) body.energy.rows.insert(body.energy.rows.end(), row.begin(), row.end());
    for (const auto& [number, row] : rows) body.energy.rows.insert(body.energy.rows.end(), row.begin(), row.end());
    return body;
  }
};

}  // namespace carillon::nonlinear::bodies
