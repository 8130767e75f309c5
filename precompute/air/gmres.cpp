// Method:     Arnoldi by classical Gram-Schmidt with reorthogonalisation, Givens rotations; one Krylov space per right-hand side.
// Source:     Y. Saad, M. Schultz (1986).
#include "precompute/air/gmres.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace carillon::air {
namespace {

using Double = std::complex<double>;

/// Sum over the unknowns of conj(a) b, per side.
void calc_products(const Sides& a, const Sides& b, std::vector<Double>& products) {
  std::vector<double> re(a.padded), im(a.padded);
  for (std::size_t i = 0; i < a.unknowns; ++i) {
    const float *ar = a.get_real(i), *ai = a.get_imaginary(i), *br = b.get_real(i), *bi = b.get_imaginary(i);
    for (std::size_t m = 0; m < a.padded; ++m) {
      re[m] += static_cast<double>(ar[m]) * static_cast<double>(br[m]) + static_cast<double>(ai[m]) * static_cast<double>(bi[m]);
      im[m] += static_cast<double>(ar[m]) * static_cast<double>(bi[m]) - static_cast<double>(ai[m]) * static_cast<double>(br[m]);
    }
  }
  products.resize(a.count);
  for (std::size_t m = 0; m < a.count; ++m) products[m] = {re[m], im[m]};
}

/// b += factor a, per side.
void add_scaled(const Sides& a, const std::vector<Double>& factors, Sides& b) {
  std::vector<float> re(a.padded), im(a.padded);
  for (std::size_t m = 0; m < a.count; ++m) {
    re[m] = static_cast<float>(factors[m].real());
    im[m] = static_cast<float>(factors[m].imag());
  }
  for (std::size_t i = 0; i < a.unknowns; ++i) {
    const float *ar = a.get_real(i), *ai = a.get_imaginary(i);
    float *br = b.get_real(i), *bi = b.get_imaginary(i);
    for (std::size_t m = 0; m < a.padded; ++m) {
      br[m] += ar[m] * re[m] - ai[m] * im[m];
      bi[m] += ar[m] * im[m] + ai[m] * re[m];
    }
  }
}

std::vector<double> calc_norms(const Sides& block) {
  std::vector<Double> squares;
  calc_products(block, block, squares);
  std::vector<double> norms;
  for (const Double& square : squares) norms.push_back(std::sqrt(square.real()));
  return norms;
}

void scale(Sides& block, const std::vector<double>& norms) {
  std::vector<float> factor(block.padded);
  for (std::size_t m = 0; m < block.count; ++m) factor[m] = norms[m] > 0.0 ? static_cast<float>(1.0 / norms[m]) : 0.0F;
  for (std::size_t i = 0; i < 2 * block.unknowns; ++i)
    for (std::size_t m = 0; m < block.padded; ++m) block.values[i * block.padded + m] *= factor[m];
}

void subtract(const Sides& a, const Sides& b, Sides& difference) {
  for (std::size_t i = 0; i < a.values.size(); ++i) difference.values[i] = a.values[i] - b.values[i];
}

/// Least-squares problem of one side: R of the rotated Hessenberg matrix and the rotated right-hand side.
struct Small {
  std::vector<std::vector<Double>> columns;
  std::vector<Double> cosine, sine, right;

  void begin(double norm) {
    columns.clear();
    cosine.clear();
    sine.clear();
    right.assign(1, norm);
  }
  void add(std::vector<Double> column) {
    const std::size_t n = cosine.size();
    for (std::size_t i = 0; i < n; ++i) {
      const Double a = column[i], b = column[i + 1];
      column[i] = cosine[i] * a + sine[i] * b;
      column[i + 1] = -std::conj(sine[i]) * a + std::conj(cosine[i]) * b;
    }
    const double length = std::hypot(std::abs(column[n]), std::abs(column[n + 1]));
    cosine.push_back(length > 0.0 ? std::conj(column[n]) / length : Double(1.0));
    sine.push_back(length > 0.0 ? std::conj(column[n + 1]) / length : Double(0.0));
    column[n] = length;
    right.push_back(-std::conj(sine[n]) * right[n]);
    right[n] *= cosine[n];
    columns.push_back(std::move(column));
  }
  double get_residual() const { return std::abs(right.back()); }
  std::vector<Double> solve() const {
    std::vector<Double> y(columns.size());
    for (std::size_t i = columns.size(); i-- > 0;) {
      Double value = right[i];
      for (std::size_t j = i + 1; j < columns.size(); ++j) value -= columns[j][i] * y[j];
      y[i] = std::abs(columns[i][i]) > 0.0 ? value / columns[i][i] : Double(0.0);
    }
    return y;
  }
};

}  // namespace

GmresResult solve_gmres(const Multiply& multiply, const Sides& right, const GmresOptions& options, Sides& solution) {
  GmresResult result;
  const std::size_t sides = right.count;
  if (sides == 0) return {.products = 0, .residual = 0.0, .is_converged = true};
  const std::vector<double> wanted = calc_norms(right);
  Sides work(right.unknowns, sides), residual(right);
  std::vector<Double> factors(sides);
  if (std::any_of(solution.values.begin(), solution.values.end(), [](float x) { return x != 0.0F; })) {
    multiply(solution, work);
    ++result.products;
    subtract(right, work, residual);
  }
  while (true) {
    std::vector<double> norms = calc_norms(residual);
    result.residual = 0.0;
    for (std::size_t m = 0; m < sides; ++m) {
      if (wanted[m] == 0.0) continue;
      const double share = norms[m] / wanted[m];  // NaN if the right-hand side is 0
      result.residual = std::max(result.residual, std::isfinite(share) ? share : std::numeric_limits<double>::infinity());
    }
    result.is_converged = result.residual <= options.tolerance;
    if (result.is_converged || result.products >= options.max_products || !std::isfinite(result.residual)) return result;
    std::vector<Small> small(sides);
    for (std::size_t m = 0; m < sides; ++m) small[m].begin(norms[m]);
    std::vector<Sides> basis{residual};
    scale(basis[0], norms);
    for (int step = 0; step < options.restart && result.products < options.max_products; ++step) {
      multiply(basis.back(), work);
      ++result.products;
      std::vector<std::vector<Double>> columns(sides, std::vector<Double>(basis.size() + 1));
      for (int pass = 0; pass < 2; ++pass) {
        std::vector<std::vector<Double>> found(basis.size());
        for (std::size_t j = 0; j < basis.size(); ++j) calc_products(basis[j], work, found[j]);
        for (std::size_t j = 0; j < basis.size(); ++j) {
          for (std::size_t m = 0; m < sides; ++m) {
            columns[m][j] += found[j][m];
            factors[m] = -found[j][m];
          }
          add_scaled(basis[j], factors, work);
        }
      }
      norms = calc_norms(work);
      double worst = 0.0;
      for (std::size_t m = 0; m < sides; ++m) {
        columns[m].back() = norms[m];
        small[m].add(std::move(columns[m]));
        if (wanted[m] > 0.0) worst = std::max(worst, small[m].get_residual() / wanted[m]);
      }
      basis.push_back(work);
      scale(basis.back(), norms);
      if (worst <= 0.5 * options.tolerance) break;
    }
    std::vector<std::vector<Double>> steps;
    for (const Small& one : small) steps.push_back(one.solve());
    for (std::size_t j = 0; j < steps[0].size(); ++j) {
      for (std::size_t m = 0; m < sides; ++m) factors[m] = steps[m][j];
      add_scaled(basis[j], factors, solution);
    }
    multiply(solution, work);
    ++result.products;
    subtract(right, work, residual);
  }
}

}  // namespace carillon::air
