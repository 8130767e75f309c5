// Method:     Cubature of the energy: weights x >= 0, few of them nonzero, with sum over p of x_p c_p = c, where c_p is the contribution of
//   a point to <s(q_l), E2(q_k)> for random pairs of motions and c the total. At the chosen points, stress is fitted to all pairs of modes
//   (ridge regression). Candidates are ordered by element numbers of the mesh, so results do not depend on the partition.
// Source:     An, Kim, James, ACM Trans. Graph. 27, 165, 2008 (cubature); Farhat, Avery, Chapman, Cortial, Int. J. Numer. Meth. Eng. 98,
//   2014 (energy-conserving weights); docs/equations.md E13.
// Deviations: The cubature is applied to each field's coupling, not to the energy: the energy is a sum of squares and stays nonnegative for
//   any points.
#include "precompute/coupling/points.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <numeric>

#include "precompute/comm/exchange.hpp"
#include "precompute/coupling/products.hpp"
#include "runtime/base/chance.hpp"

namespace carillon::coupling {
namespace {

// Method:     Active set: the entry with the steepest descent joins; the least-squares solution on the active entries replaces x, stopped
//   where an entry would become negative, which then leaves. Normal equations of the active columns.
// Source:     Lawson, Hanson, Solving Least Squares Problems, 1974, chapter 23.
// Deviations: early stopping, to keep few entries.

/// A^T A and A^T b of the active columns.
struct Normal {
  std::vector<std::ptrdiff_t> joined;
  la::Matrix products;  // (capacity, capacity), the first joined.size() used
  la::Vector sides;

  std::ptrdiff_t size() const { return static_cast<std::ptrdiff_t>(joined.size()); }
  void add(const la::Matrix& a, const la::Vector& b, std::ptrdiff_t column) {
    const std::ptrdiff_t n = size();
    for (std::ptrdiff_t i = 0; i < n; ++i) products(i, n) = products(n, i) = a.col(joined[i]).dot(a.col(column));
    products(n, n) = a.col(column).squaredNorm();
    sides[n] = a.col(column).dot(b);
    joined.push_back(column);
  }
  void remove(std::ptrdiff_t at) {
    for (std::ptrdiff_t i = at; i + 1 < size(); ++i) {
      products.row(i).head(size()) = products.row(i + 1).head(size()).eval();
      sides[i] = sides[i + 1];
    }
    for (std::ptrdiff_t i = at; i + 1 < size(); ++i) products.col(i).head(size()) = products.col(i + 1).head(size()).eval();
    joined.erase(joined.begin() + at);
  }
  la::Vector solve() const { return products.topLeftCorner(size(), size()).ldlt().solve(sides.head(size())); }
};

/// Moves x towards the least-squares solution on the active columns; entries that would become negative leave one by one.
void settle(Normal& normal, la::Vector& x) {
  while (normal.size() > 0) {
    const la::Vector wanted = normal.solve();
    double step = 1;
    std::ptrdiff_t leaves = -1;
    for (std::ptrdiff_t i = 0; i < normal.size(); ++i) {
      const double from = x[normal.joined[i]];
      if (wanted[i] > 0 || (leaves >= 0 && from / (from - wanted[i]) >= step)) continue;
      step = from > 0 ? from / (from - wanted[i]) : 0.0;
      leaves = i;
    }
    for (std::ptrdiff_t i = 0; i < normal.size(); ++i) {
      double& value = x[normal.joined[i]];
      value += step * (wanted[i] - value);
    }
    if (leaves < 0) return;
    x[normal.joined[leaves]] = 0;
    normal.remove(leaves);
  }
}

constexpr std::int64_t kCandidates = 4000;
constexpr std::uint64_t kTrainingSeed = 1000;
constexpr double kRidge = 1e-9;   // relative to the mean square of the strains
constexpr double kGrowth = 1.25;  // of the number of points per attempt

/// Candidates of all ranks, in mesh order. Rank 0.
struct Candidates {
  la::Matrix gradient;  // (9 C, N)
  la::Matrix stress;    // (6 C, R), times the volume of the point
};

/// Gradients and stresses of a candidate, preceded by its number.
std::vector<double> list_candidates(const CoupledBody& body, const mesh::LocalMesh& local, const StressFields& fields,
                                    std::int64_t all_points) {
  const Strains& strains = body.strains;
  std::vector<double> list;
  ElementPoints points;
  RowMatrix shape, gradients;
  for (std::int32_t e = 0; e < strains.element_count(); ++e) {
    bool is_calculated = false;
    for (int p = 0; p < (strains.row_count(e) / 6); ++p) {
      const auto number = static_cast<std::uint64_t>(local.tet_in_mesh[e]) * 16 + static_cast<std::uint64_t>(p);
      if (base::to_unit(base::scramble(number + 1)) * static_cast<double>(all_points) >= static_cast<double>(kCandidates)) continue;
      if (!std::exchange(is_calculated, true)) {
        strains.calc_points(e, points);
        strains.gather(e, body.shapes.data(), body.pairs.modes, shape);
        Strains::calc_gradients(points, shape, gradients);
      }
      list.push_back(static_cast<double>(number));
      for (int row = 0; row < 9; ++row) {
        const auto g = gradients.row(9 * p + row);
        list.insert(list.end(), g.data(), g.data() + g.size());
      }
      const la::Matrix stress = strains.calc_stress(e, points, p, fields.values.middleRows(strains.first_row(e), strains.row_count(e)));
      list.insert(list.end(), stress.data(), stress.data() + stress.size());
    }
  }
  return list;
}

Candidates sort_candidates(const std::vector<double>& list, std::ptrdiff_t modes, std::ptrdiff_t rows) {
  const std::ptrdiff_t width = 1 + 9 * modes + 6 * rows, count = static_cast<std::ptrdiff_t>(list.size()) / width;
  std::vector<std::ptrdiff_t> order(count);
  std::iota(order.begin(), order.end(), std::ptrdiff_t{0});
  std::sort(order.begin(), order.end(), [&](std::ptrdiff_t a, std::ptrdiff_t b) { return list[a * width] < list[b * width]; });
  Candidates candidates{la::Matrix(9 * count, modes), la::Matrix(6 * count, rows)};
  for (std::ptrdiff_t c = 0; c < count; ++c) {
    const double* from = list.data() + order[c] * width;
    candidates.gradient.middleRows(9 * c, 9) = Eigen::Map<const RowMatrix>(from + 1, 9, modes);
    candidates.stress.middleRows(6 * c, 6) = Eigen::Map<const la::Matrix>(from + 1 + 9 * modes, 6, rows);
  }
  return candidates;
}

Candidates gather_candidates(const CoupledBody& body, const mesh::LocalMesh& local, const StressFields& fields) {
  const std::ptrdiff_t modes = body.pairs.modes, rows = fields.form.rows();
  const std::int64_t all_points = body.comm.sum(body.strains.first_row(body.strains.element_count()) / 6);
  const std::vector<double> list = comm::gather(body.comm, [&] { return list_candidates(body, local, fields, all_points); });
  return body.comm.agree([&] { return sort_candidates(list, modes, rows); });
}

/// (6 P, columns) engineering strains of motions: columns of q.
la::Matrix calc_strains(const la::Matrix& gradient, const la::Matrix& q) {
  const la::Matrix h = multiply(gradient, q);
  la::Matrix strain = la::Matrix::Zero(h.rows() / 9 * 6, q.cols());
  for (std::ptrdiff_t p = 0; p < h.rows() / 9; ++p)
    for (int c = 0; c < 6; ++c) {
      const auto [a, b] = kComponents[c];
      for (int k = 0; k < 3; ++k)
        strain.row(6 * p + c) += (c < 3 ? 0.5 : 1.0) * h.row(9 * p + 3 * k + a).cwiseProduct(h.row(9 * p + 3 * k + b));
    }
  return strain;
}

/// (6 P, pairs) the same of pairs of modes, for sums over i <= j of q_i q_j.
la::Matrix calc_pair_strains(const la::Matrix& gradient, const Pairs& pairs) {
  la::Matrix strain = la::Matrix::Zero(gradient.rows() / 9 * 6, pairs.count());
  for (std::ptrdiff_t j = 0; j < pairs.modes; ++j)
    for (std::ptrdiff_t i = 0; i <= j; ++i)
      for (std::ptrdiff_t p = 0; p < gradient.rows() / 9; ++p)
        for (int c = 0; c < 6; ++c) {
          const auto [a, b] = kComponents[c];
          double sum = 0;
          for (int k = 0; k < 3; ++k)
            sum += gradient(9 * p + 3 * k + a, i) * gradient(9 * p + 3 * k + b, j) +
                   gradient(9 * p + 3 * k + b, i) * gradient(9 * p + 3 * k + a, j);
          strain(6 * p + c, pairs.find(i, j)) = (c < 3 ? 0.5 : 1.0) * (i == j ? 0.5 : 1.0) * sum;
        }
  return strain;
}

/// The sums that the weights have to reproduce: (equations, candidates), and their totals.
struct Equations {
  la::Matrix parts;
  la::Vector whole;
};

Equations make_equations(const CoupledBody& body, const StressFields& fields, const Candidates& candidates) {
  constexpr int kPartners = 4;  // per motion: itself, and random fields
  const auto motions = static_cast<int>(3 * body.pairs.modes);
  const Samples samples = make_samples(body.omega, motions, kTrainingSeed);
  const la::Matrix eta = fields.form * samples.products;  // (R, motions)
  const la::Matrix strain = calc_strains(candidates.gradient, samples.q);
  const std::ptrdiff_t count = strain.rows() / 6, rows = eta.rows();
  Equations equations{la::Matrix(static_cast<std::ptrdiff_t>(kPartners) * motions, count),
                      la::Vector(static_cast<std::ptrdiff_t>(kPartners) * motions)};
  std::uint64_t state = base::scramble(kTrainingSeed);
  for (int partner = 0; partner < kPartners; ++partner) {
    la::Matrix direction = eta;
    if (partner > 0)
      for (std::ptrdiff_t k = 0; k < motions; ++k)
        for (std::ptrdiff_t r = 0; r < rows; ++r) direction(r, k) = (base::to_unit(base::draw(state)) - 0.5) * fields.form.row(r).norm();
    direction.colwise().normalize();
    const la::Matrix stress = multiply(candidates.stress, direction);
    for (std::ptrdiff_t k = 0; k < motions; ++k) {
      const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(partner) * motions + k;
      const double unit = 1 / eta.col(k).norm();
      for (std::ptrdiff_t p = 0; p < count; ++p)
        equations.parts(row, p) = unit * stress.col(k).segment<6>(6 * p).dot(strain.col(k).segment<6>(6 * p));
      equations.whole[row] = unit * direction.col(k).dot(eta.col(k));
    }
  }
  return equations;
}

/// The points with nonzero weight, with the stress that fits all pairs best.
CouplingPoints fit(const CoupledBody& body, const StressFields& fields, const Candidates& candidates, const la::Vector& x) {
  CouplingPoints points;
  const std::ptrdiff_t count = (x.array() > 0).count();
  points.gradient.resize(9 * count, body.pairs.modes);
  points.weight.resize(count);
  la::Matrix prior(6 * count, fields.form.rows());
  for (std::ptrdiff_t c = 0, p = 0; c < x.size(); ++c) {
    if (!(x[c] > 0)) continue;
    points.gradient.middleRows(9 * p, 9) = candidates.gradient.middleRows(9 * c, 9);
    prior.middleRows(6 * p, 6) = x[c] * candidates.stress.middleRows(6 * c, 6);
    points.weight[p++] = x[c];
  }
  const la::Vector scale = calc_pair_scale(body.omega);
  const la::Matrix strain = calc_pair_strains(points.gradient, body.pairs) * scale.asDiagonal();
  la::Matrix left = fields.form * scale.asDiagonal();
  left -= multiply_transposed(prior, strain);
  const la::Matrix columns = strain.transpose();
  la::Matrix square = multiply_transposed(columns, columns);
  square.diagonal().array() += kRidge * square.diagonal().mean();
  points.stress = prior + square.llt().solve(multiply(strain, left.transpose()));
  for (std::ptrdiff_t p = 0; p < count; ++p) points.stress.middleRows(6 * p, 6) /= points.weight[p];
  return points;
}

double calc_points_error(const StressFields& fields, const CouplingPoints& points) {
  la::Matrix strain = calc_strains(points.gradient, fields.tests.q);
  for (std::ptrdiff_t p = 0; p < points.weight.size(); ++p) strain.middleRows(6 * p, 6) *= points.weight[p];
  const la::Matrix eta = multiply_transposed(points.stress, strain);
  const la::Vector energy = 0.5 * eta.colwise().squaredNorm().transpose();
  const la::Vector cubic = eta.cwiseProduct(fields.linear * fields.tests.q).colwise().sum().transpose();
  return calc_error(energy, cubic, fields.full, fields.cubic);
}

}  // namespace

la::Vector solve_nonnegative(const la::Matrix& a, const la::Vector& b, double tolerance, std::ptrdiff_t most) {
  constexpr double kSlope = 1e-12;  // relative to |b|: stationary
  la::Vector x = la::Vector::Zero(a.cols());
  const la::Vector norms = a.colwise().norm().transpose();
  std::vector<char> barred(a.cols(), 0);  // entries that left immediately after joining
  Normal normal{{}, la::Matrix(most, most), la::Vector(most)};
  la::Vector residual = b;
  while (normal.size() < most && residual.norm() > tolerance * b.norm()) {
    const la::Vector slope = a.transpose() * residual;
    std::ptrdiff_t best = -1;
    double steepest = kSlope * b.norm();
    for (std::ptrdiff_t j = 0; j < a.cols(); ++j)
      if (x[j] == 0 && barred[j] == 0 && slope[j] > steepest * norms[j]) {
        steepest = slope[j] / norms[j];
        best = j;
      }
    if (best < 0) break;
    normal.add(a, b, best);
    settle(normal, x);
    if (x[best] > 0)
      std::fill(barred.begin(), barred.end(), char{0});
    else
      barred[best] = 1;
    residual = b - a * x;
  }
  return x;
}

CouplingPoints choose_points(const CoupledBody& body, const mesh::LocalMesh& local, const StressFields& fields, double error,
                             std::ptrdiff_t most) {
  const Candidates candidates = gather_candidates(body, local, fields);
  return body.comm.agree([&] {
    CouplingPoints points;
    points.error = 1;
    if (!body.comm.is_root()) return points;
    const Equations equations = make_equations(body, fields, candidates);
    most = std::min(most, std::min(equations.parts.rows(), equations.parts.cols()));
    for (std::ptrdiff_t wanted = std::min(most, body.pairs.modes);;
         wanted = std::min(most, static_cast<std::ptrdiff_t>(kGrowth * static_cast<double>(wanted)))) {
      points = fit(body, fields, candidates, solve_nonnegative(equations.parts, equations.whole, 0.1 * error, wanted));
      points.error = calc_points_error(fields, points);
      if (points.error <= error || wanted >= most || points.weight.size() < wanted) break;
    }
    return points;
  });
}

}  // namespace carillon::coupling
