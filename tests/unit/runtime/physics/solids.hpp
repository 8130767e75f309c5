// Banks of simple solids made in memory: closed surfaces with the exact rigid-body data of the body they stand for.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "tests/unit/runtime/physics/geometry/solids.hpp"

namespace carillon::physics::tests {

inline bank::Material ceramic() { return {5.45e9, 0.33, 2700.0, 1e-6, 10.0}; }

/// Mass, centre and inertia of the solid inside a closed surface, by the divergence theorem over its tetrahedra from the origin.
inline void set_rigid_of_solid(bank::Bank& bank) {
  const double density = bank.material.density_kg_m3;
  double volume = 0.0;
  std::array<double, 3> first{};
  std::array<std::array<double, 3>, 3> second{};  // integral of x_i x_j
  for (const auto& t : bank.triangles) {
    const auto &a = bank.vertices_m[t[0]], &b = bank.vertices_m[t[1]], &c = bank.vertices_m[t[2]];
    const double v = (a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])) / 6.0;
    volume += v;
    for (int i = 0; i < 3; ++i) {
      first[i] += v * (a[i] + b[i] + c[i]) / 4.0;
      for (int j = 0; j < 3; ++j) {
        const double sum_i = a[i] + b[i] + c[i], sum_j = a[j] + b[j] + c[j];
        second[i][j] += v / 20.0 * (a[i] * a[j] + b[i] * b[j] + c[i] * c[j] + sum_i * sum_j);
      }
    }
  }
  auto& r = bank.rigid;
  r.volume_m3 = volume;
  r.mass_kg = density * volume;
  for (int i = 0; i < 3; ++i) r.centre_m[i] = first[i] / volume;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) second[i][j] = density * (second[i][j] - volume * r.centre_m[i] * r.centre_m[j]);
  }
  const double trace = second[0][0] + second[1][1] + second[2][2];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) r.inertia_kg_m2[3 * i + j] = (i == j ? trace : 0.0) - second[i][j];
  }
}

/// A ball: an octahedron divided `levels` times, corners on the sphere; mass and inertia are those of the true ball.
inline bank::Bank make_ball(double radius_m, int levels = 4) {
  bank::Bank bank;
  bank.material = ceramic();
  auto& x = bank.vertices_m;
  x = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  bank.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> middles;
    const auto middle = [&](std::int32_t a, std::int32_t b) {
      const auto [it, fresh] = middles.emplace(std::minmax(a, b), static_cast<std::int32_t>(x.size()));
      if (fresh) {
        Vec3 m{x[a][0] + x[b][0], x[a][1] + x[b][1], x[a][2] + x[b][2]};
        const double norm = std::hypot(m[0], m[1], m[2]);
        x.push_back({m[0] / norm, m[1] / norm, m[2] / norm});
      }
      return it->second;
    };
    std::vector<std::array<std::int32_t, 3>> finer;
    for (const auto& t : bank.triangles) {
      const auto ab = middle(t[0], t[1]), bc = middle(t[1], t[2]), ca = middle(t[2], t[0]);
      finer.push_back({t[0], ab, ca});
      finer.push_back({ab, t[1], bc});
      finer.push_back({ca, bc, t[2]});
      finer.push_back({ab, bc, ca});
    }
    bank.triangles = finer;
  }
  for (auto& v : x) {
    for (double& c : v) c *= radius_m;
  }
  const double volume = 4.0 / 3.0 * M_PI * std::pow(radius_m, 3), mass = volume * bank.material.density_kg_m3;
  const double inertia = 0.4 * mass * radius_m * radius_m;
  bank.rigid = {mass, {0, 0, 0}, {inertia, 0, 0, 0, inertia, 0, 0, 0, inertia}, volume};
  return bank;
}

/// A body of uniform density with the surface of a solid.
inline bank::Bank make_bank(const geometry::tests::Solid& solid, const bank::Material& material = ceramic()) {
  bank::Bank bank;
  bank.material = material;
  bank.vertices_m.assign(solid.vertices.begin(), solid.vertices.end());
  bank.triangles.assign(solid.triangles.begin(), solid.triangles.end());
  set_rigid_of_solid(bank);
  return bank;
}

/// A box about the origin, each face divided into n[k] cells along axis k.
inline bank::Bank make_box(const Vec3& size_m, const std::array<int, 3>& n = {1, 1, 1}) {
  return make_bank(geometry::tests::make_box(size_m, n));
}

/// Cubes of side `side_m` at whole-numbered places, glued at their faces; cubes that meet in a corner only share that vertex.
inline bank::Bank make_cells(const std::vector<std::array<int, 3>>& cells, double side_m) {
  bank::Bank bank;
  bank.material = ceramic();
  const std::set<std::array<int, 3>> filled(cells.begin(), cells.end());
  std::map<std::array<int, 3>, std::int32_t> index;
  const auto vertex = [&](const std::array<int, 3>& i) {
    const auto [it, fresh] = index.emplace(i, static_cast<std::int32_t>(bank.vertices_m.size()));
    if (fresh) bank.vertices_m.push_back({side_m * i[0], side_m * i[1], side_m * i[2]});
    return it->second;
  };
  for (const auto& cell : filled) {
    for (int axis = 0; axis < 3; ++axis) {
      for (int side = 0; side < 2; ++side) {
        auto next = cell;
        next[axis] += side == 1 ? 1 : -1;
        if (filled.count(next) != 0) continue;
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        const auto at = [&](int du, int dv) {
          auto i = cell;
          i[axis] += side;
          i[u] += du;
          i[v] += dv;
          return vertex(i);
        };
        const auto a = at(0, 0), b = at(1, 0), c = at(1, 1), d = at(0, 1);
        if (side == 1) {
          bank.triangles.insert(bank.triangles.end(), {{a, b, c}, {a, c, d}});
        } else {
          bank.triangles.insert(bank.triangles.end(), {{a, c, b}, {a, d, c}});
        }
      }
    }
  }
  set_rigid_of_solid(bank);
  return bank;
}

/// A lumpy head with two ears and hollows between them: smooth, neither convex nor symmetric, the edges as fine as a real mesh's.
inline bank::Bank make_eared_ball(double radius_m, int levels) {
  bank::Bank bank = make_ball(radius_m, levels);
  const Vec3 ears[2] = {{0.48, 0.36, 0.8}, {-0.6, 0.0, 0.8}};
  for (auto& x : bank.vertices_m) {
    double stretch = 1.0 + 0.05 * std::sin(9.0 * x[0] / radius_m) * std::sin(7.0 * x[1] / radius_m + 1.0);
    for (const auto& ear : ears) {
      const double cosine = (x[0] * ear[0] + x[1] * ear[1] + x[2] * ear[2]) / radius_m;
      stretch += 1.0 * std::exp(-(1.0 - cosine) / 0.03);
    }
    for (double& c : x) c *= stretch;
  }
  set_rigid_of_solid(bank);
  return bank;
}

}  // namespace carillon::physics::tests
