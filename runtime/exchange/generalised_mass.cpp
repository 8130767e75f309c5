// Method: quadrature with 4 points (degree 2) on straight tetrahedra of four nodes, and with 15 points (degree 5, exact for straight
//   edges) on those of ten.
// Source: Keast 1986, "Moderate-degree tetrahedral quadrature formulas"; Stroud 1971, T3: 5-1.
#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/exchange/solved_model.hpp"

namespace carillon::exchange {
namespace {

/// A point in volume coordinates; the weights of a rule sum to 1.
struct RulePoint {
  std::array<double, 4> at;
  double weight;
};

std::vector<RulePoint> make_rule(bool is_quadratic) {
  std::vector<RulePoint> rule;
  const auto add_corners = [&](double other, double weight) {  // near a corner, or across from it
    for (int k = 0; k < 4; ++k) {
      RulePoint point{{other, other, other, other}, weight};
      point.at[k] = 1.0 - 3.0 * other;
      rule.push_back(point);
    }
  };
  if (!is_quadratic) {
    add_corners((5.0 - std::sqrt(5.0)) / 20.0, 0.25);
    return rule;
  }
  const double root = std::sqrt(15.0);
  rule.push_back({{0.25, 0.25, 0.25, 0.25}, 16.0 / 135.0});
  add_corners((7.0 - root) / 34.0, (2665.0 + 14.0 * root) / 37800.0);
  add_corners((7.0 + root) / 34.0, (2665.0 - 14.0 * root) / 37800.0);
  for (int a = 0; a < 4; ++a)
    for (int b = a + 1; b < 4; ++b) {
      RulePoint point{{}, 20.0 / 378.0};
      point.at.fill((5.0 + root) / 20.0);
      point.at[a] = point.at[b] = (5.0 - root) / 20.0;
      rule.push_back(point);
    }
  return rule;
}

constexpr std::array<std::array<int, 2>, 6> kEdges{{{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}}};

/// Shape functions of a tetrahedron at a point, and their derivatives by the volume coordinates.
struct Functions {
  std::array<double, 10> value{};
  std::array<std::array<double, 4>, 10> slope{};
};

Functions calc_functions(const std::array<double, 4>& at, bool is_quadratic) {
  Functions f;
  for (int k = 0; k < 4; ++k) {
    f.value[k] = is_quadratic ? at[k] * (2.0 * at[k] - 1.0) : at[k];
    f.slope[k][k] = is_quadratic ? 4.0 * at[k] - 1.0 : 1.0;
  }
  for (std::size_t e = 0; is_quadratic && e < 6; ++e) {
    const auto [a, b] = kEdges[e];
    f.value[4 + e] = 4.0 * at[a] * at[b];
    f.slope[4 + e][a] = 4.0 * at[b];
    f.slope[4 + e][b] = 4.0 * at[a];
  }
  return f;
}

}  // namespace

std::vector<double> calc_generalised_masses(const SolvedModel& model, double density) {
  std::vector<double> masses(model.modes.size(), 0.0);
  if (model.tets.empty()) return masses;
  const std::size_t count = model.tets.front().size();
  const std::vector<RulePoint> rule = make_rule(count == 10);
  std::vector<Functions> functions;
  for (const RulePoint& point : rule) functions.push_back(calc_functions(point.at, count == 10));
  std::vector<double> weights(rule.size());
  for (const std::vector<std::size_t>& tet : model.tets) {
    for (std::size_t p = 0; p < rule.size(); ++p) {
      std::array<Vec3, 3> tangent{};
      for (std::size_t i = 0; i < count; ++i)
        for (std::size_t k = 0; k < 3; ++k)
          tangent[k] = tangent[k] + (functions[p].slope[i][k + 1] - functions[p].slope[i][0]) * model.nodes[tet[i]];
      weights[p] = density * rule[p].weight / 6.0 * std::abs(dot(cross(tangent[0], tangent[1]), tangent[2]));
    }
    for (std::size_t m = 0; m < masses.size(); ++m) {
      const std::vector<Vec3>& shape = model.modes[m].shape;
      std::array<Vec3, 10> u{};
      for (std::size_t i = 0; i < count; ++i) u[i] = shape[tet[i]];
      for (std::size_t p = 0; p < rule.size(); ++p) {
        Vec3 at{};
        for (std::size_t i = 0; i < count; ++i) at = at + functions[p].value[i] * u[i];
        masses[m] += weights[p] * dot(at, at);
      }
    }
  }
  return masses;
}

}  // namespace carillon::exchange
