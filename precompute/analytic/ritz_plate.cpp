#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "precompute/analytic/flat_bodies.hpp"
#include "precompute/analytic/polynomials.hpp"
#include "precompute/la/decompositions.hpp"
#include "runtime/base/error.hpp"

namespace carillon::analytic {
namespace {

using job::Edge;
using std::numbers::pi;

constexpr int kMaxUnknowns = 3600;  // of one dense eigenproblem: about a minute
constexpr double kSlowRitz = 3.0;   // error ratio for an eighth more functions where a clamped edge meets a free one, at most 3
constexpr double kZero = 1e-9;      // mechanisms: relative to the largest requested eigenvalue

EndConditions get_conditions(Edge edge) {
  return {edge == Edge::hinged || edge == Edge::clamped, edge == Edge::clamped || edge == Edge::sliding};
}

}  // namespace

RitzPlate::RitzPlate(const job::PlateBody& body, const material::Material& material)
    : body_(body), density_kg_m2_(material.density_kg_m3 * body.thickness_m), poisson_ratio_(material.poisson_ratio) {
  thickness_m_ = body.thickness_m;
  rate_ = calc_plate_rate(material, thickness_m_);
  theory = fmt::format("rectangular plate (Kirchhoff), edges {}, {}, {}, {}", to_text(body.edges[0]), to_text(body.edges[1]),
                       to_text(body.edges[2]), to_text(body.edges[3]));
  set_rigid(density_kg_m2_);
}

/// The functions are polynomial beam modes with these end conditions, split by parity if both ends are alike, so a symmetric plate splits
/// into four small problems.
std::vector<RitzPlate::Line> RitzPlate::make_lines(int polynomials, Edge first, Edge last) const {
  const la::Matrix slopes = calc_products(polynomials, 1, 1), mixed = calc_products(polynomials, 0, 2);
  const la::Matrix bending = calc_weighted(polynomials, 2);  // squared last to keep the precision of products of low functions
  std::vector<Line> lines;
  const bool is_symmetric = first == last;
  for (int parity = 0; parity < (is_symmetric ? 2 : 1); ++parity) {
    la::Matrix basis = make_conditioned_basis(polynomials, {get_conditions(first), get_conditions(last)});
    if (is_symmetric) {
      // Equal end conditions preserve parity: the subspace of one parity is spanned by its polynomials.
      la::Matrix even = basis;
      for (int k = 0; k < polynomials; ++k)
        if (k % 2 != parity) even.row(k).setZero();
      basis = la::calc_column_space(even, 1e-8);
    }
    const la::Matrix bent = bending * basis;
    la::Matrix stiffness = bent.transpose() * bent;
    la::Vector values(stiffness.rows());
    if (la::calc_eigenpairs_by_division(stiffness, values) != 0) throw SolveError("the dense eigensolver failed on a beam of the plate");
    Line line;
    line.functions = basis * stiffness;
    line.slopes = line.functions.transpose() * slopes * line.functions;
    const la::Matrix curvatures = bending * line.functions;
    line.bends = curvatures.transpose() * curvatures;
    line.mixed = line.functions.transpose() * mixed * line.functions;
    lines.push_back(std::move(line));
  }
  return lines;
}

/// Energy D / 2 integral of w_xx^2 + w_yy^2 + 2 nu w_xx w_yy + 2 (1 - nu) w_xy^2 over products of functions with identity mass.
RitzPlate::Solved RitzPlate::solve(int x_polynomials, int y_polynomials, double high_lambda) {
  const double a = body_.length_m, b = body_.width_m, nu = poisson_ratio_;
  x_lines_ = make_lines(x_polynomials, body_.edges[0], body_.edges[1]);
  y_lines_ = make_lines(y_polynomials, body_.edges[2], body_.edges[3]);
  x_polynomials_ = x_polynomials;
  y_polynomials_ = y_polynomials;
  struct Found {
    double lambda;
    Shape shape;
  };
  std::vector<Found> found;
  for (int i = 0; i < static_cast<int>(x_lines_.size()); ++i)
    for (int j = 0; j < static_cast<int>(y_lines_.size()); ++j) {
      const Line &x = x_lines_[i], &y = y_lines_[j];
      const Eigen::Index nx = x.functions.cols(), ny = y.functions.cols();
      la::Matrix k(nx * ny, nx * ny);  // unknown (p, q) is p + nx q
      for (Eigen::Index q = 0; q < ny; ++q)
        for (Eigen::Index s = 0; s < ny; ++s) {
          auto block = k.block(nx * q, nx * s, nx, nx);
          block = (nu * y.mixed(q, s) / square(a * b)) * x.mixed.transpose() + (nu * y.mixed(s, q) / square(a * b)) * x.mixed +
                  (2.0 * (1.0 - nu) * y.slopes(q, s) / square(a * b)) * x.slopes;
          if (q == s) block += x.bends / square(a * a);
          block.diagonal().array() += y.bends(q, s) / square(b * b);
        }
      k *= rate_;
      const la::Matrix energy = k;
      la::Vector values(k.rows());
      if (la::calc_eigenpairs_by_division(k, values) != 0) throw SolveError("the dense eigensolver failed on the plate");
      for (Eigen::Index m = 0; m < values.size() && values(m) <= high_lambda; ++m) {
        // The solver's rounding error scales with the highest eigenvalue, that of the Rayleigh quotient with this one.
        const auto shape = k.col(m);
        const double lambda = shape.dot(energy.selfadjointView<Eigen::Upper>() * shape) / shape.squaredNorm();
        found.push_back({lambda, {i, j, Eigen::Map<const la::Matrix>(shape.data(), nx, ny)}});
      }
    }
  std::stable_sort(found.begin(), found.end(), [](const Found& one, const Found& other) { return one.lambda < other.lambda; });
  Solved solved;
  for (Found& one : found) {
    solved.lambda.push_back(one.lambda);
    solved.shapes.push_back(std::move(one.shape));
  }
  return solved;
}

ModeList RitzPlate::list_modes(double high_hz, std::int64_t max_modes) {
  const double a = body_.length_m, b = body_.width_m;
  const double enough = find_wave_number(a * b, 2.0 * (a + b), 1.1 * static_cast<double>(max_modes) + 10.0);
  const double asked_k = std::sqrt(2.0 * pi * high_hz / std::sqrt(rate_)), k = std::min(asked_k, enough);
  ModeList list{{}, k < asked_k ? std::sqrt(rate_) * k * k / (2.0 * pi) : high_hz};
  const auto count = [&](double side) { return 18 + static_cast<int>(std::ceil(1.7 * k * side / pi)); };
  const bool halves_x = body_.edges[0] == body_.edges[1], halves_y = body_.edges[2] == body_.edges[3];
  const double unknowns = static_cast<double>(count(a)) * count(b) / (halves_x ? 2.0 : 1.0) / (halves_y ? 2.0 : 1.0);
  if (unknowns > kMaxUnknowns)
    throw InputError(
        fmt::format("the plate has about {:.0f} by {:.0f} half-waves at {:g} Hz, more than Ritz's method can resolve ({:.0f} unknowns, at "
                    "most {}); lower the end of \"band_hz\", or give \"max_modes\"",
                    k * a / pi, k * b / pi, list.complete_below_hz, unknowns, kMaxUnknowns));
  const double high = square(2.0 * pi * list.complete_below_hz);
  const std::vector<double> coarse = solve(count(a) * 7 / 8, count(b) * 7 / 8, 2.0 * high).lambda;
  Solved fine = solve(count(a), count(b), high);
  shapes_ = std::move(fine.shapes);
  int mechanisms = 0;
  for (std::size_t m = 0; m < fine.lambda.size(); ++m) {
    const double lambda = fine.lambda[m];
    if (lambda < kZero * high && lambda < 1e-6 * square(square(pi / std::max(a, b))) * rate_) {
      ++mechanisms;
      continue;
    }
    const double apart = m < coarse.size() ? kSlowRitz * std::abs(coarse[m] - lambda) : lambda;
    list.modes.push_back(
        {lambda, 600.0 * std::log2(1.0 + apart / lambda), {static_cast<int>(m), 0, 0, 0}, fmt::format("{}", list.modes.size() + 1)});
  }
  const bool is_free = std::all_of(body_.edges.begin(), body_.edges.end(), [](Edge edge) { return edge == Edge::free; });
  rigid_modes = is_free ? 6 : mechanisms;
  method = fmt::format("Ritz's method on products of Legendre polynomials; all eigenvalues of the dense problem up to {:.6g} Hz",
                       list.complete_below_hz);
  return list;
}

void RitzPlate::calc_deflections(const Point2& point_m, std::span<const Mode> modes, std::span<double> w) const {
  const double x = std::clamp(point_m[0] / body_.length_m, 0.0, 1.0), y = std::clamp(point_m[1] / body_.width_m, 0.0, 1.0);
  const auto calc_values = [](const std::vector<Line>& lines, const la::Vector& polynomials) {
    std::vector<la::Vector> values;
    for (const Line& line : lines) values.push_back(line.functions.transpose() * polynomials);
    return values;
  };
  const std::vector<la::Vector> xs = calc_values(x_lines_, calc_legendre(x_polynomials_, x)),
                                ys = calc_values(y_lines_, calc_legendre(y_polynomials_, y));
  const double scale = 1.0 / std::sqrt(density_kg_m2_ * body_.length_m * body_.width_m);
  for (std::size_t i = 0; i < modes.size(); ++i) {
    const Shape& shape = shapes_[modes[i].index[0]];
    w[i] = scale * xs[shape.x_line].dot(shape.coefficients * ys[shape.y_line]);
  }
}

la::Matrix RitzPlate::calc_slope_products(std::span<const Mode> modes) const {
  const double a = body_.length_m, b = body_.width_m;
  const auto count = static_cast<Eigen::Index>(modes.size());
  la::Matrix products = la::Matrix::Zero(count, count);
  for (Eigen::Index j = 0; j < count; ++j) {
    const Shape& shape = shapes_[modes[j].index[0]];
    const la::Matrix turned =
        x_lines_[shape.x_line].slopes * shape.coefficients / square(a) + shape.coefficients * y_lines_[shape.y_line].slopes / square(b);
    for (Eigen::Index i = 0; i <= j; ++i) {
      const Shape& other = shapes_[modes[i].index[0]];
      if (other.x_line != shape.x_line || other.y_line != shape.y_line) continue;
      products(i, j) = products(j, i) = other.coefficients.cwiseProduct(turned).sum() / density_kg_m2_;
    }
  }
  return products;
}

Net RitzPlate::make_net(int grid) const {
  const double longest = std::max(body_.length_m, body_.width_m);
  const auto cut = [&](double side) { return std::max(2, static_cast<int>(std::lround(grid * side / longest))); };
  return make_rectangle_net(body_.length_m, body_.width_m, cut(body_.length_m), cut(body_.width_m));
}

int RitzPlate::choose_grid(std::span<const Mode> modes) const {
  const double k = std::sqrt(std::sqrt(modes.empty() ? 0.0 : modes.back().lambda_rad2_s2 / rate_));
  const int wanted = 10 * static_cast<int>(std::ceil(0.4 * k * std::max(body_.length_m, body_.width_m) / pi));
  return std::clamp(wanted, 40, kMaxDefaultGrid);
}

}  // namespace carillon::analytic
