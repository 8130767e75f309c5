// The modes of a free square plate of steel, for impacts of bodies that move and bend.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "tests/unit/runtime/physics/impact/scenes.hpp"

namespace carillon::impact::tests {

/// A free square plate by Ritz with Legendre polynomials, orthonormal on -1 .. 1; stiffness by Gauss quadrature, modes by Jacobi rotations.
struct FreePlate {
  std::vector<double> omega;
  std::vector<std::vector<double>> coefficients;  // per mode, of the products
  std::vector<std::array<int, 2>> products;
  double side = 0.0, mass = 0.0;

  double calc_shape(std::size_t mode, double x, double y) const;  // x, y in -1 .. 1; 1/sqrt(kg)
};

inline constexpr int kDegree = 22;
/// Orthonormal Legendre polynomials and derivatives at x: values[k][order].
inline std::vector<std::array<double, 3>> calc_legendre(double x) {
  std::vector<std::array<double, 3>> p(kDegree + 1);
  p[0] = {1, 0, 0};
  p[1] = {x, 1, 0};
  for (int k = 1; k < kDegree; ++k) {
    const auto& one = p[k];
    const auto& before = p[k - 1];
    p[k + 1] = {((2 * k + 1) * x * one[0] - k * before[0]) / (k + 1), ((2 * k + 1) * (one[0] + x * one[1]) - k * before[1]) / (k + 1),
                ((2 * k + 1) * (2 * one[1] + x * one[2]) - k * before[2]) / (k + 1)};
  }
  for (int k = 0; k <= kDegree; ++k)
    for (double& value : p[k]) value *= std::sqrt(k + 0.5);
  return p;
}
inline double FreePlate::calc_shape(std::size_t mode, double x, double y) const {
  const auto px = calc_legendre(x), py = calc_legendre(y);
  double sum = 0.0;
  for (std::size_t k = 0; k < products.size(); ++k) sum += coefficients[mode][k] * px[products[k][0]][0] * py[products[k][1]][0];
  return 2.0 / std::sqrt(mass) * sum;  // mean of its square over the plate, times the mass: 1
}

/// Eigenvalues of the symmetric A (n, n) and vectors, one per row of V.
inline void solve_jacobi(std::vector<double>& A, std::vector<double>& V, std::size_t n) {
  V.assign(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) V[i * n + i] = 1.0;
  for (int sweep = 0; sweep < 30; ++sweep) {
    double off = 0.0, diagonal = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      diagonal += A[i * n + i] * A[i * n + i];
      for (std::size_t j = 0; j < i; ++j) off += A[i * n + j] * A[i * n + j];
    }
    if (off < 1e-26 * diagonal) break;
    for (std::size_t p = 0; p < n; ++p)
      for (std::size_t q = p + 1; q < n; ++q) {
        if (A[p * n + q] == 0.0) continue;
        const double theta = 0.5 * (A[q * n + q] - A[p * n + p]) / A[p * n + q];
        const double t = (theta < 0 ? -1.0 : 1.0) / (std::abs(theta) + std::sqrt(theta * theta + 1.0)), c = 1.0 / std::sqrt(t * t + 1.0),
                     s = t * c;
        for (std::size_t k = 0; k < n; ++k) {
          const double x = A[k * n + p], y = A[k * n + q];
          A[k * n + p] = c * x - s * y;
          A[k * n + q] = s * x + c * y;
        }
        for (std::size_t k = 0; k < n; ++k) {
          const double x = A[p * n + k], y = A[q * n + k];
          A[p * n + k] = c * x - s * y;
          A[q * n + k] = s * x + c * y;
          const double u = V[p * n + k], w = V[q * n + k];
          V[p * n + k] = c * u - s * w;
          V[q * n + k] = s * u + c * w;
        }
      }
  }
}

inline FreePlate make_free_plate(double side, double thickness, double highest_hz) {
  FreePlate plate;
  plate.side = side;
  plate.mass = kDensity * thickness * side * side;
  const double D = kYoung * std::pow(thickness, 3) / 12.0 / (1.0 - kPoisson * kPoisson);
  // Integrals of products of derivatives on -1 .. 1, by 3-point Gauss on many cells (polynomials of degree 44).
  constexpr std::size_t n = kDegree + 1;
  std::vector<double> I00(n * n), I11(n * n), I02(n * n), I22(n * n);
  constexpr int kCells = 1500;
  for (int cell = 0; cell < kCells; ++cell)
    for (const double g : {-std::sqrt(0.6), 0.0, std::sqrt(0.6)}) {
      const double x = -1.0 + (2.0 * cell + 1.0 + g) / kCells, weight = (g == 0.0 ? 8.0 : 5.0) / 9.0 / kCells;
      const auto p = calc_legendre(x);
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = 0; j < n; ++j) {
          I00[i * n + j] += weight * p[i][0] * p[j][0];
          I11[i * n + j] += weight * p[i][1] * p[j][1];
          I02[i * n + j] += weight * p[i][0] * p[j][2];
          I22[i * n + j] += weight * p[i][2] * p[j][2];
        }
    }
  for (int i = 0; i <= kDegree; ++i)
    for (int j = 0; j + i <= kDegree; ++j) plate.products.push_back({i, j});
  // lambda = w^2 rho h / D (L/2)^4, by classes of parity.
  for (int parity = 0; parity < 4; ++parity) {
    std::vector<std::size_t> members;
    for (std::size_t k = 0; k < plate.products.size(); ++k)
      if (plate.products[k][0] % 2 == parity % 2 && plate.products[k][1] % 2 == parity / 2) members.push_back(k);
    const std::size_t m = members.size();
    std::vector<double> A(m * m), V;
    for (std::size_t r = 0; r < m; ++r)
      for (std::size_t s = 0; s < m; ++s) {
        const std::size_t i = plate.products[members[r]][0], j = plate.products[members[r]][1];
        const std::size_t k = plate.products[members[s]][0], l = plate.products[members[s]][1];
        A[r * m + s] = I22[i * n + k] * I00[j * n + l] + I00[i * n + k] * I22[j * n + l] +
                       2.0 * (1.0 - kPoisson) * I11[i * n + k] * I11[j * n + l] +
                       kPoisson * (I02[k * n + i] * I02[j * n + l] + I02[i * n + k] * I02[l * n + j]);
      }
    solve_jacobi(A, V, m);
    for (std::size_t r = 0; r < m; ++r) {
      const double lambda = A[r * m + r];
      if (lambda < 1e-3) continue;  // rigid
      const double omega = std::sqrt(lambda * D / (kDensity * thickness)) * 4.0 / (side * side);
      if (omega > 2.0 * kPi * highest_hz) continue;
      plate.omega.push_back(omega);
      plate.coefficients.emplace_back(plate.products.size(), 0.0);
      for (std::size_t s = 0; s < m; ++s) plate.coefficients.back()[members[s]] = V[r * m + s];
    }
  }
  return plate;
}

}  // namespace carillon::impact::tests
