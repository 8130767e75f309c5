#include "precompute/analytic/beam_functions.hpp"

#include <cmath>
#include <numbers>

#include "precompute/la/decompositions.hpp"

namespace carillon::analytic {
namespace {

using job::Edge;
using std::numbers::pi;

/// One characteristic equation, in a form without overflow, and a guess of its n-th root (n from 1).
struct Characteristic {
  enum Kind { cos_cosh_1, cos_cosh_minus_1, tan_tanh, tan_minus_tanh, sine, cosine } kind;

  double calc(double b) const {
    switch (kind) {
      case cos_cosh_1:
        return std::cos(b) - 1.0 / std::cosh(b);
      case cos_cosh_minus_1:
        return std::cos(b) + 1.0 / std::cosh(b);
      case tan_tanh:
        return std::sin(b) - std::tanh(b) * std::cos(b);
      case tan_minus_tanh:
        return std::sin(b) + std::tanh(b) * std::cos(b);
      case sine:
        return std::sin(b);
      default:
        return std::cos(b);
    }
  }
  double guess(int n) const {
    switch (kind) {
      case cos_cosh_1:
        return (2 * n + 1) * pi / 2;
      case cos_cosh_minus_1:
        return (2 * n - 1) * pi / 2;
      case tan_tanh:
        return (4 * n + 1) * pi / 4;
      case tan_minus_tanh:
        return (4 * n - 1) * pi / 4;
      case sine:
        return n * pi;
      default:
        return (2 * n - 1) * pi / 2;
    }
  }
};

Characteristic choose(std::array<Edge, 2> ends) {
  if (ends[0] > ends[1]) std::swap(ends[0], ends[1]);  // free < hinged < clamped < sliding
  const auto is = [&](Edge a, Edge b) { return ends[0] == a && ends[1] == b; };
  if (is(Edge::free, Edge::free) || is(Edge::clamped, Edge::clamped)) return {Characteristic::cos_cosh_1};
  if (is(Edge::free, Edge::clamped)) return {Characteristic::cos_cosh_minus_1};
  if (is(Edge::free, Edge::hinged) || is(Edge::hinged, Edge::clamped)) return {Characteristic::tan_tanh};
  if (is(Edge::free, Edge::sliding) || is(Edge::clamped, Edge::sliding)) return {Characteristic::tan_minus_tanh};
  if (is(Edge::hinged, Edge::sliding)) return {Characteristic::cosine};
  return {Characteristic::sine};  // both hinged, both sliding
}

/// The two vanishing derivatives at an end.
std::array<int, 2> get_conditions(Edge end) {
  switch (end) {
    case Edge::free:
      return {2, 3};
    case Edge::hinged:
      return {0, 2};
    case Edge::clamped:
      return {0, 1};
    default:
      return {1, 3};
  }
}

/// Derivatives of one order of the four functions, over beta^order.
std::array<double, 4> calc_parts(double beta, double x, int order) {
  const double c = std::cos(beta * x), s = std::sin(beta * x);
  const std::array<double, 4> cosine{c, -s, -c, s}, sine{s, c, -s, -c};
  return {cosine[order], sine[order], (order % 2 == 0 ? 1.0 : -1.0) * std::exp(-beta * x), std::exp(-beta * (1.0 - x))};
}

/// Integral of w^2 over the length, in closed form.
double calc_mean_square(double b, const std::array<double, 4>& k) {
  const double c = std::cos(b), s = std::sin(b), e = std::exp(-b), half = 1.0 / (2.0 * b);
  const double cc = 0.5 + c * s * half, ss = 0.5 - c * s * half, cs = s * s * half;
  const double ee = (1.0 - e * e) * half, cross = e;
  const double c_near = (e * (s - c) + 1.0) * half, s_near = (1.0 - e * (s + c)) * half;
  const double c_far = (c + s - e) * half, s_far = (s - c + e) * half;
  return k[0] * k[0] * cc + k[1] * k[1] * ss + (k[2] * k[2] + k[3] * k[3]) * ee +
         2.0 * (k[0] * k[1] * cs + k[0] * k[2] * c_near + k[0] * k[3] * c_far + k[1] * k[2] * s_near + k[1] * k[3] * s_far +
                k[2] * k[3] * cross);
}

}  // namespace

double BeamFunction::calc(double x, int order) const {
  const std::array<double, 4> parts = calc_parts(beta, x, order);
  double sum = 0.0;
  for (int k = 0; k < 4; ++k) sum += coefficients[k] * parts[k];
  return sum;
}

int count_mechanisms(const std::array<Edge, 2>& ends) {
  const auto both = [&](Edge a, Edge b) { return (ends[0] == a && ends[1] == b) || (ends[0] == b && ends[1] == a); };
  if (both(Edge::free, Edge::free)) return 2;
  return both(Edge::free, Edge::hinged) || both(Edge::free, Edge::sliding) || both(Edge::sliding, Edge::sliding) ? 1 : 0;
}

std::vector<double> find_beam_roots(const std::array<Edge, 2>& ends, double max_beta) {
  const Characteristic equation = choose(ends);
  std::vector<double> roots;
  for (int n = 1;; ++n) {
    // From the second root on, the guess is exact to exp(-beta); the first is within 0.35.
    double low = equation.guess(n) - 0.4, high = equation.guess(n) + 0.4;
    const bool is_rising = equation.calc(high) > 0.0;
    while (high - low > 4e-16 * high) {
      const double middle = 0.5 * (low + high);
      if (middle <= low || middle >= high) break;
      ((equation.calc(middle) > 0.0) == is_rising ? high : low) = middle;
    }
    const double root = 0.5 * (low + high);
    if (root > max_beta) return roots;
    roots.push_back(root);
  }
}

BeamFunction make_beam_function(const std::array<Edge, 2>& ends, double beta) {
  la::Matrix conditions(4, 4);
  for (int end = 0; end < 2; ++end) {
    const std::array<int, 2> orders = get_conditions(ends[end]);
    for (int i = 0; i < 2; ++i) {
      const std::array<double, 4> parts = calc_parts(beta, end, orders[i]);
      for (int k = 0; k < 4; ++k) conditions(2 * end + i, k) = parts[k];
    }
  }
  const la::Matrix v = la::calc_svd(conditions).v;
  BeamFunction function{beta, {}};
  for (int k = 0; k < 4; ++k) function.coefficients[k] = v(k, 3);
  // Normalise the sign: positive maximum at the first end if it moves there.
  double sign = function.calc(0.0);
  if (std::abs(sign) < 1e-3) sign = function.calc(0.0, 1);
  if (std::abs(sign) < 1e-3) sign = function.calc(0.0, 2);
  const double scale = std::copysign(1.0 / std::sqrt(calc_mean_square(beta, function.coefficients)), sign);
  for (double& k : function.coefficients) k *= scale;
  return function;
}

}  // namespace carillon::analytic
