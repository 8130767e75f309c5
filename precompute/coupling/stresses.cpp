// Method:     All pairs: eigenvectors of the Gram matrix of s_ij, in units of equal energy (q_i = g_i / omega_i). Many modes: fields of
//   random motions, orthonormalised block by block, until they span the fields of held-out motions. Then <s_r, s_ij> = <s_r, E_ij>, since
//   s_r does no work on condensed displacements: no pair needs its own solve.
// Source:     docs/equations.md E13; Halko, Martinsson, Tropp, SIAM Review 53, 2011 (randomised range finder).
// Deviations: In the work on condensed displacements, the modes' own linear stresses on products of modal and condensed rotations are
//   neglected: of order (thickness x wave number)² in flat bodies.
#include "precompute/coupling/stresses.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "precompute/coupling/products.hpp"
#include "runtime/base/chance.hpp"
#include "runtime/base/error.hpp"

namespace carillon::coupling {
namespace {

constexpr double kLeastShare = 1e-12;      // of the trace: smaller fields are rounding
constexpr int kPairsAtOnce = 64;           // right-hand sides of a solve
constexpr std::int64_t kRowsAtOnce = 768;  // of elements whose stresses are multiplied in one block
constexpr int kHeldOut = 48;
constexpr std::uint64_t kTest = 1;  // seed of the held-out motions; later seeds are for training

std::ptrdiff_t to_index(std::size_t value) { return static_cast<std::ptrdiff_t>(value); }

/// Calls visit(first element, last, rows) for runs of elements.
template <typename Visit>
void for_chunks(const Strains& strains, Visit&& visit) {
  for (std::int32_t e = 0; e < strains.element_count();) {
    std::int32_t end = e + 1;
    while (end < strains.element_count() && strains.first_row(end + 1) - strains.first_row(e) <= kRowsAtOnce) ++end;
    visit(e, end, strains.first_row(end) - strains.first_row(e));
    e = end;
  }
}

/// Strains of pairs of modes, one element at a time, with buffers.
struct PairStrains {
  const CoupledBody& body;
  ElementPoints points;
  RowMatrix shape, gradients, values;  // values: (rows of the element, pairs)

  void calc(std::int32_t e, std::ptrdiff_t first, std::ptrdiff_t count) {
    body.strains.calc_points(e, points);
    body.strains.gather(e, body.shapes.data(), body.pairs.modes, shape);
    Strains::calc_gradients(points, shape, gradients);
    body.strains.calc_pair_strains(e, points, gradients, body.pairs, first, count, values);
  }
};

/// Strains of all pairs, in runs of elements: change(element, strains) may modify them, then use(chunk, first row, rows).
template <typename Change, typename Use>
void for_pair_strains(const CoupledBody& body, Change&& change, Use&& use) {
  const Strains& strains = body.strains;
  PairStrains pair_strains{body, {}, {}, {}, {}};
  for_chunks(strains, [&](std::int32_t begin, std::int32_t end, std::int64_t rows) {
    la::Matrix chunk(rows, body.pairs.count());
    for (std::int32_t e = begin; e < end; ++e) {
      pair_strains.calc(e, 0, body.pairs.count());
      change(e, pair_strains);
      chunk.middleRows(strains.first_row(e) - strains.first_row(begin), strains.row_count(e)) = pair_strains.values;
    }
    use(chunk, strains.first_row(begin), rows);
  });
}

/// c += a^T b for a result c known to be symmetric: computes the upper blocks.
void add_products(const la::Matrix& a, std::ptrdiff_t rows, la::Matrix& c) {
  constexpr std::ptrdiff_t kBlock = 256;
  for (std::ptrdiff_t j = 0; j < c.cols(); j += kBlock) {
    const std::ptrdiff_t n = std::min(kBlock, c.cols() - j);
    la::gemm(la::Transpose::kYes, j + n, static_cast<int>(n), rows, 1, a.data(), a.rows(), a.col(j).data(), a.rows(), 1, c.col(j).data(),
             c.rows());
  }
}

void mirror(la::Matrix& c) {
  for (std::ptrdiff_t j = 0; j < c.cols(); ++j)
    for (std::ptrdiff_t i = 0; i < j; ++i) c(j, i) = c(i, j);
}

void add_loads(const Strains& strains, std::int32_t e, const RowMatrix& forces, Nodal& loads) {
  const auto nodes = strains.nodes(e);
  const std::ptrdiff_t width = forces.cols();
  for (std::size_t i = 0; i < nodes.size(); ++i)
    Eigen::Map<RowMatrix>(loads.data() + static_cast<std::ptrdiff_t>(nodes[i]) * 3 * width, 3, width) +=
        forces.middleRows(3 * to_index(i), 3);
}

std::size_t count_nodal(const CoupledBody& body, std::ptrdiff_t width) {
  return body.shapes.size() / static_cast<std::size_t>(body.pairs.modes) * static_cast<std::size_t>(width);
}

/// Eigenvalues, ascending, of a symmetric matrix known to all ranks; overwrites it with the eigenvectors. Rank 0's result is broadcast, so
/// that all ranks decide alike. Collective.
la::Vector diagonalise(const comm::Communicator& comm, la::Matrix& matrix, const char* failure) {
  la::Vector values = comm.agree([&] { return la::Vector(la::Vector::Zero(matrix.rows())); });
  comm.agree([&] {
    if (comm.is_root() && la::calc_eigenpairs_by_division(matrix, values) != 0) throw SolveError(failure);
  });
  comm.broadcast_into(la::entries(matrix));
  comm.broadcast_into(la::entries(values));
  return values;
}

/// find_rank() on rank 0, broadcast. Collective.
std::ptrdiff_t agree_on_rank(const comm::Communicator& comm, StressFields& fields) {
  std::ptrdiff_t rank = 0;
  comm.agree([&] {
    if (comm.is_root()) rank = find_rank(fields, fields.error);
  });
  fields.error = comm.broadcast(fields.error);
  return comm.broadcast(rank);
}

void fill_products(Samples& samples) {
  const Pairs pairs{samples.q.rows()};
  samples.products.resize(pairs.count(), samples.q.cols());
  for (std::ptrdiff_t i = 0; i < pairs.modes; ++i)
    for (std::ptrdiff_t j = i; j < pairs.modes; ++j)
      samples.products.row(pairs.find(i, j)) = samples.q.row(i).cwiseProduct(samples.q.row(j));
}

/// Fixes signs of eigenvectors: the entry of largest magnitude of each row becomes positive.
void fix_signs(StressFields& fields) {
  for (std::ptrdiff_t r = 0; r < fields.form.rows(); ++r) {
    std::ptrdiff_t at = 0;
    fields.form.row(r).cwiseAbs().maxCoeff(&at);
    if (fields.form(r, at) >= 0) continue;
    fields.form.row(r) *= -1;
    fields.linear.row(r) *= -1;
    if (fields.values.size() > 0) fields.values.col(r) *= -1;
  }
}

/// Flat bodies have no cubic part: residual values from the mesh are set to 0.
void set_curvature(const comm::Communicator& comm, StressFields& fields, const std::vector<double>& omega, double error) {
  fields.curvature =
      comm.broadcast([&] { return calc_curvature(fields.linear, multiply(fields.form, fields.tests.products), omega, error); });
  if (fields.curvature >= kCurved) return;
  fields.linear.setZero();
  fields.cubic.setZero();
}

void keep_first(StressFields& fields, std::ptrdiff_t count) {
  fields.form.conservativeResize(count, Eigen::NoChange);
  fields.linear.conservativeResize(count, Eigen::NoChange);
}

/// Fields of the motions q, (rows, columns of q), and their work on the kept modes.
la::Matrix calc_sample_fields(const CoupledBody& body, const la::Matrix& q, la::Matrix* work, std::int64_t& solves) {
  const auto width = static_cast<int>(q.cols());
  const Strains& strains = body.strains;
  la::Matrix fields = body.comm.agree([&] { return la::Matrix(strains.first_row(strains.element_count()), width); });
  Nodal loads = body.comm.agree([&] { return Nodal(count_nodal(body, width), 0.0); });
  ElementPoints points;
  RowMatrix shape, motion, gradients, linear, z;
  const RowMatrix combine = q;
  body.comm.agree([&] {
    for (std::int32_t e = 0; e < strains.element_count(); ++e) {
      strains.calc_points(e, points);
      strains.gather(e, body.shapes.data(), body.pairs.modes, shape);
      motion.noalias() = shape * combine;
      Strains::calc_gradients(points, motion, gradients);
      strains.calc_square_strains(e, points, gradients, z);
      strains.calc_linear(e, points, linear);
      fields.middleRows(strains.first_row(e), strains.row_count(e)) = z;
      motion.noalias() = linear.transpose() * z;
      add_loads(strains, e, motion, loads);
    }
  });
  const la::Matrix on_kept = body.answer.solve(loads, width);
  if (work != nullptr) *work = on_kept;
  solves += width;
  body.comm.agree([&] {
    for (std::int32_t e = 0; e < strains.element_count(); ++e) {
      strains.calc_points(e, points);
      strains.calc_linear(e, points, linear);
      strains.gather(e, loads.data(), width, motion);
      fields.middleRows(strains.first_row(e), strains.row_count(e)).noalias() -= linear * motion;
    }
  });
  return fields;
}

la::Columns to_columns(la::Matrix& m) { return {m.data(), m.rows(), std::max<std::ptrdiff_t>(m.rows(), 1), static_cast<int>(m.cols())}; }

/// Appends to `basis` the part of `fields` orthogonal to it, orthonormalised.
void extend(const comm::Communicator& comm, la::Matrix fields, double least, la::Matrix& basis) {
  for (int pass = 0; pass < 2 && basis.cols() > 0; ++pass) {
    const la::Matrix products = la::multiply_transposed(comm, to_columns(basis), to_columns(fields));
    la::subtract_product(to_columns(basis), products.data(), static_cast<int>(products.rows()), to_columns(fields));
  }
  for (int pass = 0; pass < 2; ++pass) {  // the second pass removes rounding errors of large fields in small ones
    la::Matrix gram = la::multiply_transposed(comm, to_columns(fields), to_columns(fields));
    const la::Vector values = diagonalise(comm, gram, "internal: the fields of sampled motions have no orthonormal basis");
    const std::ptrdiff_t count = (values.array() > (pass == 0 ? least : 0.0)).count(), drop = values.size() - count;
    for (std::ptrdiff_t r = 0; r < count; ++r) gram.col(drop + r) /= std::sqrt(values[drop + r]);
    if (count == 0) return;
    comm.agree([&] { fields = multiply(fields, gram.rightCols(count)); });
  }
  comm.agree([&] {
    basis.conservativeResize(fields.rows(), basis.cols() + fields.cols());
    basis.rightCols(fields.cols()) = fields;
  });
}

/// Scaled linear strains of the modes, (rows of this rank, N).
la::Matrix calc_mode_strains(const CoupledBody& body) {
  const Strains& strains = body.strains;
  la::Matrix values = body.comm.agree([&] { return la::Matrix(strains.first_row(strains.element_count()), body.pairs.modes); });
  ElementPoints points;
  RowMatrix shape, linear;
  body.comm.agree([&] {
    for (std::int32_t e = 0; e < strains.element_count(); ++e) {
      strains.calc_points(e, points);
      strains.gather(e, body.shapes.data(), body.pairs.modes, shape);
      strains.calc_linear(e, points, linear);
      values.middleRows(strains.first_row(e), strains.row_count(e)).noalias() = linear * shape;
    }
  });
  return values;
}

/// <basis, E_ij> for all pairs, summed over ranks: (columns of basis, pairs).
la::Matrix calc_form(const CoupledBody& body, const la::Matrix& basis) {
  const std::ptrdiff_t pairs = body.pairs.count();
  la::Matrix sums = body.comm.agree([&] { return la::Matrix(la::Matrix::Zero(basis.cols(), pairs)); });
  body.comm.agree([&] {
    for_pair_strains(
        body, [](std::int32_t, PairStrains&) {},
        [&](const la::Matrix& chunk, std::int64_t first, std::int64_t rows) {
          la::gemm(la::Transpose::kYes, basis.cols(), static_cast<int>(pairs), rows, 1, basis.data() + first, basis.rows(), chunk.data(),
                   rows, 1, sums.data(), sums.rows());
        });
  });
  body.comm.sum(la::entries(sums));
  return sums;
}

}  // namespace

Samples make_samples(const std::vector<double>& omega, int count, std::uint64_t seed) {
  Samples samples;
  samples.q.resize(to_index(omega.size()), count);
  std::uint64_t state = base::scramble(seed);
  for (double& q : la::entries(samples.q)) {
    const double u = 1 - base::to_unit(base::draw(state)), angle = 2 * std::numbers::pi * base::to_unit(base::draw(state));
    q = std::sqrt(-2 * std::log(u)) * std::cos(angle);
  }
  for (std::size_t i = 0; i < omega.size(); ++i) samples.q.row(to_index(i)) /= omega[i];
  fill_products(samples);
  return samples;
}

Samples make_single_samples(const std::vector<double>& omega) {
  Samples samples;
  samples.q.setZero(to_index(omega.size()), to_index(omega.size()));
  for (std::size_t i = 0; i < omega.size(); ++i) samples.q(to_index(i), to_index(i)) = 1 / omega[i];
  fill_products(samples);
  return samples;
}

la::Vector calc_pair_scale(const std::vector<double>& omega) {
  const Pairs pairs{to_index(omega.size())};
  la::Vector scale(pairs.count());
  for (std::ptrdiff_t i = 0; i < pairs.modes; ++i)
    for (std::ptrdiff_t j = i; j < pairs.modes; ++j) scale[pairs.find(i, j)] = 1 / (omega[i] * omega[j]);
  return scale;
}

Samples join(const Samples& a, const Samples& b) {
  Samples samples;
  samples.q.resize(a.q.rows(), a.q.cols() + b.q.cols());
  samples.q << a.q, b.q;
  fill_products(samples);
  return samples;
}

double calc_error(const la::Vector& energy, const la::Vector& cubic, const la::Vector& full, const la::Vector& full_cubic) {
  constexpr double kLeastEnergy = 0.01;  // of the mean: softer motions are inaudible among the others
  const double least = kLeastEnergy * full.mean(), norm = full_cubic.norm();
  const double worst = ((energy - full).array().abs() / full.array().max(least)).maxCoeff();
  return norm > 0 ? std::max(worst, (cubic - full_cubic).norm() / norm) : worst;
}

double calc_curvature(const la::Matrix& linear, const la::Matrix& eta, const std::vector<double>& omega, double error) {
  // Principal directions of eta, from the eigenvectors of its Gram matrix: U = eta W / S.
  la::Matrix vectors = multiply_transposed(eta, eta);
  la::Vector squares;
  if (la::calc_eigenpairs(vectors, squares) != 0) throw SolveError("internal: the fields of motions have no principal directions");
  std::ptrdiff_t first = squares.size();
  for (double left = squares.sum(), least = error * left; first > 0 && left > least; left -= squares[--first]) {
  }
  la::Matrix scaled = multiply_transposed(la::Matrix(vectors.rightCols(squares.size() - first)), multiply_transposed(eta, linear));
  for (std::ptrdiff_t r = 0; r < scaled.rows(); ++r) scaled.row(r) /= std::sqrt(squares[first + r]);
  for (std::size_t i = 0; i < omega.size(); ++i) scaled.col(to_index(i)) /= omega[i];
  la::Matrix square = scaled.transpose() * scaled;
  la::Vector values;
  if (la::calc_eigenpairs(square, values) != 0) throw SolveError("internal: the linear part of the fields has no singular values");
  return std::sqrt(std::max(values[values.size() - 1], 0.0));
}

std::ptrdiff_t find_rank(const StressFields& fields, double& error) {
  const la::Matrix eta = multiply(fields.form, fields.tests.products), bias = fields.linear * fields.tests.q;
  la::Vector energy = la::Vector::Zero(fields.full.size()), cubic = energy;
  const double wanted = error;
  std::ptrdiff_t rank = 0;
  while ((error = calc_error(energy, cubic, fields.full, fields.cubic)) > wanted && rank < fields.form.rows()) {
    energy += 0.5 * eta.row(rank).transpose().array().square().matrix();
    cubic += eta.row(rank).cwiseProduct(bias.row(rank)).transpose();
    ++rank;
  }
  return rank;
}

Gram calc_gram(const CoupledBody& body) {
  const Strains& strains = body.strains;
  const std::ptrdiff_t pairs = body.pairs.count(), modes = body.pairs.modes;
  Gram gram = body.comm.agree([&] {
    return Gram{la::Matrix::Zero(pairs, pairs), la::Matrix::Zero(modes, pairs), Nodal(count_nodal(body, pairs), 0.0)};
  });
  PairStrains one{body, {}, {}, {}, {}};
  RowMatrix linear, forces;
  for (std::ptrdiff_t first = 0; first < pairs; first += kPairsAtOnce) {
    const std::ptrdiff_t width = std::min<std::ptrdiff_t>(kPairsAtOnce, pairs - first);
    body.proceed(static_cast<double>(first) / static_cast<double>(pairs));
    Nodal loads = body.comm.agree([&] { return Nodal(count_nodal(body, width), 0.0); });
    body.comm.agree([&] {
      for (std::int32_t e = 0; e < strains.element_count(); ++e) {
        one.calc(e, first, width);
        strains.calc_linear(e, one.points, linear);
        forces.noalias() = linear.transpose() * one.values;
        add_loads(strains, e, forces, loads);
      }
    });
    gram.work.middleCols(first, width) = body.answer.solve(loads, static_cast<int>(width));
    const std::size_t rows = loads.size() / static_cast<std::size_t>(width);
    for (std::size_t row = 0; row < rows; ++row)
      std::copy_n(loads.begin() + to_index(row) * width, width, gram.theta.begin() + to_index(row) * pairs + first);
  }
  body.comm.agree([&] {
    for_pair_strains(
        body,
        [&](std::int32_t e, PairStrains& of_element) {
          strains.calc_linear(e, of_element.points, linear);
          strains.gather(e, gram.theta.data(), pairs, forces);
          of_element.values.noalias() -= linear * forces;
        },
        [&](const la::Matrix& chunk, std::int64_t, std::int64_t rows) { add_products(chunk, rows, gram.values); });
  });
  body.comm.sum(la::entries(gram.values));
  mirror(gram.values);
  return gram;
}

StressFields calc_fields_of_pairs(const CoupledBody& body, double error, bool wants_values) {
  const std::ptrdiff_t pairs = body.pairs.count();
  const Gram gram = calc_gram(body);
  const la::Vector scale = calc_pair_scale(body.omega);
  la::Matrix vectors = scale.asDiagonal() * gram.values * scale.asDiagonal();
  const double trace = vectors.trace();
  const la::Vector values = diagonalise(body.comm, vectors, "internal: the Gram matrix has no eigenvectors");
  StressFields fields;
  fields.solves = pairs;
  const std::ptrdiff_t rank = (values.array() > kLeastShare * trace).count();
  // s_r = sum of s_ij x_ij,r in coordinates of equal energy, so the fields are orthonormal
  la::Matrix combine(pairs, rank);
  fields.form.resize(rank, pairs);
  for (std::ptrdiff_t r = 0; r < rank; ++r) {
    const std::ptrdiff_t at = pairs - 1 - r;
    const double root = std::sqrt(values[at]);
    fields.form.row(r) = root * vectors.col(at).cwiseQuotient(scale).transpose();
    combine.col(r) = vectors.col(at).cwiseProduct(scale) / root;
  }
  fields.linear = (gram.work * combine).transpose();
  const Samples& tests = fields.tests = join(make_single_samples(body.omega), make_samples(body.omega, kHeldOut, kTest));
  fields.full = 0.5 * tests.products.cwiseProduct(gram.values * tests.products).colwise().sum().transpose();
  fields.cubic = tests.q.cwiseProduct(gram.work * tests.products).colwise().sum().transpose();
  set_curvature(body.comm, fields, body.omega, error);
  fields.error = error;
  const std::ptrdiff_t kept = agree_on_rank(body.comm, fields);
  if (wants_values) {
    const Strains& strains = body.strains;
    fields.values.resize(strains.first_row(strains.element_count()), kept);
    ElementPoints points;
    RowMatrix shape, gradients, linear, z, theta;
    const RowMatrix x = combine.leftCols(kept);
    body.comm.agree([&] {
      for (std::int32_t e = 0; e < strains.element_count(); ++e) {
        strains.calc_points(e, points);
        strains.gather(e, body.shapes.data(), body.pairs.modes, shape);
        Strains::calc_gradients(points, shape, gradients);
        strains.calc_pair_strains(e, points, gradients, body.pairs, 0, pairs, z);
        strains.calc_linear(e, points, linear);
        strains.gather(e, gram.theta.data(), pairs, theta);
        z.noalias() -= linear * theta;
        fields.values.middleRows(strains.first_row(e), strains.row_count(e)).noalias() = z * x;
      }
    });
  }
  keep_first(fields, kept);
  fix_signs(fields);
  return fields;
}

StressFields calc_fields_of_samples(const CoupledBody& body, double error) {
  const std::ptrdiff_t pairs = body.pairs.count();
  StressFields fields;
  const Samples singles = make_single_samples(body.omega), others = make_samples(body.omega, kHeldOut, kTest);
  fields.tests = join(singles, others);
  la::Matrix work;
  body.proceed(0.0);
  la::Matrix tests = calc_sample_fields(body, fields.tests.q, &work, fields.solves);
  fields.full = 0.5 * la::multiply_transposed(body.comm, to_columns(tests), to_columns(tests)).diagonal();
  fields.cubic = fields.tests.q.cwiseProduct(work).colwise().sum().transpose();
  const double least = kLeastShare * 2 * fields.full.mean();
  la::Matrix basis(tests.rows(), 0);
  extend(body.comm, tests.leftCols(singles.q.cols()), least, basis);
  la::Matrix held_out = tests.rightCols(kHeldOut), mode_strains = calc_mode_strains(body);
  const la::Vector energy = fields.full.tail(kHeldOut);
  const la::Vector cubic = fields.cubic.tail(kHeldOut);
  double start = 0;
  for (std::uint64_t seed = 0; basis.cols() < pairs; ++seed) {
    // Residual of the held-out motions, relative to their energy
    const la::Matrix eta = la::multiply_transposed(body.comm, to_columns(basis), to_columns(held_out));
    fields.linear = la::multiply_transposed(body.comm, to_columns(basis), to_columns(mode_strains));
    double left = ((2 * energy - eta.colwise().squaredNorm().transpose()).array() / (2 * energy).array()).maxCoeff();
    if (body.comm.broadcast([&] { return calc_curvature(fields.linear, eta, body.omega, error); }) >= kCurved) {
      const la::Vector found = (fields.linear * others.q).cwiseProduct(eta).colwise().sum().transpose();
      left = std::max(left, (found - cubic).norm() / cubic.norm());
    }
    left = body.comm.broadcast(left);
    if (start == 0) start = std::max(left, error);
    if (left <= 0.2 * error) break;
    body.proceed(std::clamp(std::log(start / left) / std::log(start / (0.2 * error)), 0.0, 1.0));
    const std::ptrdiff_t before = basis.cols();
    extend(body.comm, calc_sample_fields(body, make_samples(body.omega, kPairsAtOnce, kTest + 1 + seed).q, nullptr, fields.solves), least,
           basis);
    if (basis.cols() == before) break;
  }
  fields.form = calc_form(body, basis);
  fields.linear = la::multiply_transposed(body.comm, to_columns(basis), to_columns(mode_strains));
  set_curvature(body.comm, fields, body.omega, error);
  // Sort the fields by energy
  const la::Vector scale = calc_pair_scale(body.omega);
  const la::Matrix scaled = fields.form * scale.asDiagonal();
  const la::Matrix columns = scaled.transpose();
  la::Matrix vectors = multiply_transposed(columns, columns);
  (void)diagonalise(body.comm, vectors, "internal: the Gram matrix has no eigenvectors");
  const la::Matrix turned = vectors.rowwise().reverse();
  fields.form = multiply_transposed(turned, fields.form);
  fields.linear = (turned.transpose() * fields.linear).eval();
  fields.error = error;
  const std::ptrdiff_t kept = agree_on_rank(body.comm, fields);
  keep_first(fields, kept);
  body.comm.agree([&] { fields.values = multiply(basis, turned.leftCols(kept)); });
  fix_signs(fields);
  return fields;
}

}  // namespace carillon::coupling
