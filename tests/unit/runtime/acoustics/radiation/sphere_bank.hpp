// Meshed spheres that move in known patterns, and their far field in closed form (data/spheres.csv).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <map>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::testing {

/// Sphere about the origin: an icosahedron, every triangle divided `level` times in four (20 * 4^level triangles).
inline bank::Bank make_sphere_surface(double radius_m, int level) {
  const double g = std::numbers::phi;
  bank::Bank bank;
  bank.vertices_m = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                     {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  bank.triangles = {{0, 11, 5}, {0, 5, 1}, {0, 1, 7}, {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                    {3, 9, 4},  {3, 4, 2}, {3, 2, 6}, {3, 6, 8},  {3, 8, 9},   {4, 9, 5}, {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  for (int cut = 0; cut < level; ++cut) {
    std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> middles;
    const auto find_middle = [&](std::int32_t a, std::int32_t b) {
      const auto [at, fresh] = middles.try_emplace(std::minmax(a, b), static_cast<std::int32_t>(bank.vertices_m.size()));
      if (fresh) {
        const Vec3 x = bank.vertices_m[a], y = bank.vertices_m[b];
        const double size = std::hypot(x[0] + y[0], x[1] + y[1], x[2] + y[2]) / std::hypot(x[0], x[1], x[2]);
        bank.vertices_m.push_back({(x[0] + y[0]) / size, (x[1] + y[1]) / size, (x[2] + y[2]) / size});
      }
      return at->second;
    };
    std::vector<std::array<std::int32_t, 3>> finer;
    for (const auto& [a, b, c] : bank.triangles) {
      const std::int32_t x = find_middle(a, b), y = find_middle(b, c), z = find_middle(c, a);
      finer.insert(finer.end(), {{a, x, z}, {b, y, x}, {c, z, y}, {x, y, z}});
    }
    bank.triangles = finer;
  }
  const double scale = radius_m / std::hypot(1.0, g);
  for (Vec3& x : bank.vertices_m)
    for (double& component : x) component *= scale;
  return bank;
}

/// Sets the modes of a bank: frequency by k times `radius_m`, motion of each vertex as a function of its position.
template <class Motion>
void set_modes(bank::Bank& bank, const std::vector<double>& ka, double radius_m, Motion motion) {
  const std::size_t modes = ka.size();
  std::vector<double> shapes;
  for (const double one : ka) bank.eigenvalue_rad2_s2.push_back(std::pow(one / radius_m * bank::kSoundSpeedMs, 2));
  bank.decay_per_s.assign(modes, 1.0);
  bank.radiation_gain.assign(modes, 7.0);
  for (const Vec3& x : bank.vertices_m)
    for (std::size_t m = 0; m < modes; ++m)
      for (const double component : motion(x, m)) shapes.push_back(component);
  bank::quantise_shapes(bank, shapes);
}

/// P_l(x), l = 0 .. 4.
inline double calc_legendre(int l, double x) {
  const double x2 = x * x;
  return std::array{1.0, x, (3 * x2 - 1) / 2, (5 * x2 - 3) * x / 2, ((35 * x2 - 30) * x2 + 3) / 8}.at(l);
}

struct SphereRow {
  int l = 0;
  double ka = 0.0;
  double far_factor = 0.0;  // |p| r / (rho0 c0 U a |P_l|)
};

inline std::vector<SphereRow> read_sphere_rows(const std::string& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  std::vector<SphereRow> rows;
  for (char comma = ','; std::getline(in, line);) {
    std::size_t at = 0;
    SphereRow row;
    row.l = std::stoi(line, &at);
    line.erase(0, line.find(comma) + 1);
    row.ka = std::stod(line);
    row.far_factor = std::stod(line.substr(line.find(comma) + 1));
    rows.push_back(row);
  }
  if (rows.size() != 45) throw std::runtime_error("tests/unit/runtime/acoustics/radiation/data/spheres.csv is not whole");
  return rows;
}

/// One mode per row: radial motion P_l about a generic axis, velocity 1 for unit modal velocity.
inline bank::Bank make_lobed_sphere(const std::vector<SphereRow>& rows, double radius_m, int level) {
  bank::Bank bank = make_sphere_surface(radius_m, level);
  std::vector<double> ka;
  for (const SphereRow& row : rows) ka.push_back(row.ka);
  set_modes(bank, ka, radius_m, [&](const Vec3& x, std::size_t m) {
    const double cosine = (0.48 * x[0] + 0.6 * x[1] + 0.64 * x[2]) / radius_m;
    const double size = calc_legendre(rows[m].l, cosine) / radius_m;
    return Vec3{size * x[0], size * x[1], size * x[2]};
  });
  return bank;
}

/// Gain of such a row: root mean square over directions, 1 / sqrt(2 l + 1) for P_l.
inline double calc_exact_gain(const SphereRow& row, double radius_m) {
  return bank::kAirDensityKgM3 * bank::kSoundSpeedMs * radius_m * row.far_factor / std::sqrt(2.0 * row.l + 1.0);
}

}  // namespace carillon::testing
