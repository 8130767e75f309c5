// Method: gradients from the Jacobian of the map at the kernel's points; diagonal of the consistent mass of curved T10 by a conical product
//   of the five-point Gauss rule (exact), scaled to the volume.
// Source: docs/equations.md E11; Hinton, Rock and Zienkiewicz 1976, Earthquake Eng. Struct. Dyn. 4, 245; Stroud 1971 (conical product).
#include "precompute/simulation/transient/element.hpp"

#include <cmath>
#include <cstdint>

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/simulation/transient/kernel.hpp"

namespace carillon::transient {
namespace {

using Barycentric = std::array<double, 4>;

/// dN_a / dL_k of T10, with the four coordinates as independent variables.
std::array<Barycentric, 10> calc_derivatives(const Barycentric& L) {
  std::array<Barycentric, 10> d{};
  for (std::size_t k = 0; k < 4; ++k) d[k][k] = 4.0 * L[k] - 1.0;
  for (std::size_t e = 0; e < 6; ++e) {
    const std::size_t i = mesh::kEdges[e][0], j = mesh::kEdges[e][1];
    d[4 + e][i] = 4.0 * L[j];
    d[4 + e][j] = 4.0 * L[i];
  }
  return d;
}

std::array<double, 10> calc_values(const Barycentric& L) {
  std::array<double, 10> n{};
  for (std::size_t k = 0; k < 4; ++k) n[k] = L[k] * (2.0 * L[k] - 1.0);
  for (std::size_t e = 0; e < 6; ++e) n[4 + e] = 4.0 * L[mesh::kEdges[e][0]] * L[mesh::kEdges[e][1]];
  return n;
}

/// Gradients of L1, L2, L3 from the columns dx/dL_k; returns the determinant.
double calc_gradients(const std::array<Vec3, 3>& column, std::array<Vec3, 3>& gradient) {
  const Vec3 a = cross(column[1], column[2]), b = cross(column[2], column[0]), c = cross(column[0], column[1]);
  const double det = dot(column[0], a);
  gradient = {(1.0 / det) * a, (1.0 / det) * b, (1.0 / det) * c};
  return det;
}

std::array<Vec3, 3> calc_columns(std::span<const Vec3> x, const Barycentric& L) {
  const auto d = calc_derivatives(L);
  std::array<Vec3, 3> column{};
  for (std::size_t a = 0; a < 10; ++a)
    for (std::size_t k = 0; k < 3; ++k) column[k] = column[k] + (d[a][k + 1] - d[a][0]) * x[a];
  return column;
}

constexpr Barycentric make_point(std::size_t q) {
  Barycentric L{kFar, kFar, kFar, kFar};
  L[q] = kNear;
  return L;
}

/// Integral of N_a^2 of each node, scaled so that the sum is the volume.
bool lump_curved(std::span<const Vec3> x, std::array<double, 10>& lumped) {
  constexpr std::array<double, 5> kPlace{0.04691007703066800, 0.23076534494715845, 0.5, 0.76923465505284155, 0.95308992296933200};
  constexpr std::array<double, 5> kWeight{0.11846344252809454, 0.23931433524968324, 0.28444444444444444, 0.23931433524968324,
                                          0.11846344252809454};
  std::array<double, 10> diagonal{};
  double volume = 0.0, sum = 0.0;
  for (std::size_t i = 0; i < 5; ++i)
    for (std::size_t j = 0; j < 5; ++j)
      for (std::size_t k = 0; k < 5; ++k) {
        const double r = kPlace[i], s = kPlace[j] * (1.0 - r), t = kPlace[k] * (1.0 - r) * (1.0 - kPlace[j]);
        const Barycentric L{1.0 - r - s - t, r, s, t};
        const auto c = calc_columns(x, L);
        const double det = dot(c[0], cross(c[1], c[2]));
        if (!(det > 0.0)) return false;
        const double weight = det * kWeight[i] * kWeight[j] * kWeight[k] * (1.0 - r) * (1.0 - r) * (1.0 - kPlace[j]);
        const auto n = calc_values(L);
        volume += weight;
        for (std::size_t a = 0; a < 10; ++a) diagonal[a] += weight * n[a] * n[a];
      }
  for (const double value : diagonal) sum += value;
  for (std::size_t a = 0; a < 10; ++a) lumped[a] = diagonal[a] * volume / sum;
  return true;
}

}  // namespace

bool is_curved(std::span<const Vec3> x_m) {
  for (std::size_t e = 0; e < 6; ++e) {
    const Vec3 &a = x_m[mesh::kEdges[e][0]], &b = x_m[mesh::kEdges[e][1]];
    if (norm(x_m[4 + e] - 0.5 * (a + b)) > 1e-6 * norm(b - a)) return true;
  }
  return false;
}

bool make_shape(Kind kind, std::span<const Vec3> x_m, ElementShape& shape) {
  shape = {};
  shape.kind = kind;
  if (kind == Kind::kCurvedT10) {
    for (std::size_t q = 0; q < 4; ++q) {
      const double det = calc_gradients(calc_columns(x_m, make_point(q)), shape.gradient[q]);
      if (!(det > 0.0)) return false;
      shape.weight_m3[q] = det / 24.0;
    }
    return lump_curved(x_m, shape.lumped_m3);
  }
  const double det = calc_gradients({x_m[1] - x_m[0], x_m[2] - x_m[0], x_m[3] - x_m[0]}, shape.gradient[0]);
  if (!(det > 0.0)) return false;
  const double volume = det / 6.0;
  if (kind == Kind::kT4) {
    shape.weight_m3[0] = volume;
    for (std::size_t a = 0; a < 4; ++a) shape.lumped_m3[a] = volume / 4.0;
    return true;
  }
  for (std::size_t q = 0; q < 4; ++q) {
    shape.gradient[q] = shape.gradient[0];
    shape.weight_m3[q] = volume / 4.0;
  }
  for (std::size_t a = 0; a < 10; ++a) shape.lumped_m3[a] = a < 4 ? volume / 36.0 : volume * 4.0 / 27.0;
  return true;
}

double calc_omega(const ElementShape& shape, const Law& law) {
  constexpr int kIterations = 40;
  const std::size_t nodes = count_nodes(shape.kind), points = count_points(shape.kind);
  // Gradients of the shape functions at the points.
  std::array<std::array<Vec3, 10>, 4> b{};
  for (std::size_t q = 0; q < points; ++q) {
    const auto& g = shape.gradient[q];
    const std::array<Vec3, 4> of_corner{-1.0 * (g[0] + g[1] + g[2]), g[0], g[1], g[2]};
    if (shape.kind == Kind::kT4) {
      for (std::size_t a = 0; a < 4; ++a) b[q][a] = of_corner[a];
      continue;
    }
    const auto d = calc_derivatives(make_point(q));
    for (std::size_t a = 0; a < 10; ++a)
      for (std::size_t k = 0; k < 4; ++k) b[q][a] = b[q][a] + d[a][k] * of_corner[k];
  }
  std::array<Vec3, 10> p{}, f{};
  std::uint32_t seed = 1;
  for (std::size_t a = 0; a < nodes; ++a)
    for (double& value : p[a]) value = static_cast<double>((seed = seed * 1664525U + 1013904223U) >> 8) / 8388608.0 - 1.0;
  double lambda = 0.0;
  for (int n = 0; n < kIterations; ++n) {
    f.fill({});
    for (std::size_t q = 0; q < points; ++q) {
      Mat3 h{};
      for (std::size_t a = 0; a < nodes; ++a)
        for (std::size_t i = 0; i < 3; ++i) h[i] = h[i] + p[a][i] * b[q][a];
      const double dilatation = law.lambda_pa * (h[0][0] + h[1][1] + h[2][2]);
      Mat3 stress{};
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j)
          stress[i][j] = shape.weight_m3[q] * (law.mu_pa * (h[i][j] + h[j][i]) + (i == j ? dilatation : 0.0));
      for (std::size_t a = 0; a < nodes; ++a) f[a] = f[a] + stress * b[q][a];
    }
    double above = 0.0, below = 0.0, most = 0.0;
    for (std::size_t a = 0; a < nodes; ++a) {
      const double mass = law.density_kg_m3 * shape.lumped_m3[a];
      above += dot(p[a], f[a]);
      below += mass * dot(p[a], p[a]);
      p[a] = (1.0 / mass) * f[a];
      for (const double value : p[a]) most = std::max(most, std::abs(value));
    }
    lambda = above / below;
    if (!(most > 0.0)) break;
    for (std::size_t a = 0; a < nodes; ++a) p[a] = (1.0 / most) * p[a];
  }
  return std::sqrt(std::max(lambda, 0.0));
}

}  // namespace carillon::transient
