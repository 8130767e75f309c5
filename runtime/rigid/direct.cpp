// Method: augmented Lagrangian. With the residual r = w - J v of the rows that hold and a compliance eps,
//     (M + sum J^T J / eps) d = J^T r / eps,   lambda += (r - J d) / eps,   v = v_free + M^-1 J^T lambda,
//   symmetric, positive and as sparse as the touches between bodies, until r is nothing: a few times, with one factorisation. Rows are let
//   go and taken up by the signs of the answer.
// Source: A. Enzenhoefer, N. Lefebvre, S. Andrews, "Efficient block pivoting for multibody simulations with contact" (2019): pivoting of
//   blocks with a compliant system; factorisation by Eigen.
// Deviations: the cone is round; the impulse of a sliding point lags by one guess.
#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

#include "runtime/rigid/solver.hpp"

namespace carillon::rigid {
namespace {

using Block = Eigen::Matrix<double, 6, 6>;
using Row6 = Eigen::Matrix<double, 6, 1>;

constexpr double kCompliance = 1e-5;  // of the mobility of a row
constexpr double kAtCone = 0.9999;    // of the bound on friction: slides
constexpr int kDense = 12;            // bodies; more are factorised as a sparse matrix

enum class Hold : char { kOpen, kSticks, kSlides };

Row6 make_row(const Vec3& linear, const Vec3& angular) {
  Row6 r;
  r << linear[0], linear[1], linear[2], angular[0], angular[1], angular[2];
  return r;
}

/// A couple, brought back to the bounds that the push of its point sets it.
Vec3 clamp_couple(const Point& p, const Vec3& couple, double push) {
  const double limit = p.rolling_m * push, twist = dot(couple, p.normal);
  const Vec3 roll = couple - twist * p.normal;
  const double size = norm(roll);
  return (size > limit ? limit / size : 1.0) * roll + std::clamp(twist, -p.twisting_m * push, p.twisting_m * push) * p.normal;
}

/// The matrix of a guess: blocks of 6 x 6 for pairs of bodies that touch, lower triangle. Its pattern is the same for all guesses.
class System {
 public:
  System(int bodies, const std::vector<Point>& points) : bodies_(bodies) {
    if (is_dense()) {
      full_.resize(6 * bodies, 6 * bodies);
      return;
    }
    below_.resize(bodies);
    for (int i = 0; i < bodies; ++i) below_[i].push_back(i);
    for (const Point& p : points)
      if (p.a >= 0 && p.b >= 0 && p.a != p.b) below_[std::min(p.a, p.b)].push_back(std::max(p.a, p.b));
    std::vector<int> counts;
    for (std::vector<int>& rows : below_) {
      std::sort(rows.begin(), rows.end());
      rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
      counts.insert(counts.end(), 6, 6 * static_cast<int>(rows.size()));
    }
    sparse_.resize(6 * bodies, 6 * bodies);
    sparse_.reserve(counts);
    for (int column = 0; column < 6 * bodies; ++column)
      for (const int row : below_[column / 6])
        for (int i = 0; i < 6; ++i) sparse_.insert(6 * row + i, column) = 0.0;
    sparse_.makeCompressed();
    sparse_solver_.analyzePattern(sparse_);
  }

  void clear() {
    if (is_dense())
      full_.setZero();
    else
      std::fill_n(sparse_.valuePtr(), sparse_.nonZeros(), 0.0);
  }
  void add_inertia(int body, double mass_kg, const Eigen::Matrix3d& inertia) {
    Block block = Block::Zero();
    block.topLeftCorner<3, 3>().diagonal().setConstant(mass_kg);
    block.bottomRightCorner<3, 3>() = inertia;
    at(body, body) += block;
  }
  /// A row with that stiffness.
  void add(int a, const Row6& ra, int b, const Row6& rb, double stiffness) {
    if (a >= 0) at(a, a).noalias() += stiffness * ra * ra.transpose();
    if (b >= 0) at(b, b).noalias() += stiffness * rb * rb.transpose();
    if (a < 0 || b < 0) return;
    if (a > b)
      at(a, b).noalias() += stiffness * ra * rb.transpose();
    else
      at(b, a).noalias() += stiffness * rb * ra.transpose();
  }

  bool factorise() {
    if (is_dense()) {
      dense_solver_.compute(full_);
      return dense_solver_.info() == Eigen::Success;
    }
    sparse_solver_.factorize(sparse_);
    return sparse_solver_.info() == Eigen::Success;
  }
  Eigen::VectorXd solve(const Eigen::VectorXd& right) const {
    if (is_dense()) return dense_solver_.solve(right);
    return sparse_solver_.solve(right);
  }

 private:
  using Place = Eigen::Map<Block, Eigen::Unaligned, Eigen::OuterStride<>>;

  bool is_dense() const { return bodies_ <= kDense; }
  /// The block (row, column), row >= column.
  Place at(int row, int column) {
    if (is_dense()) return Place(&full_(6 * row, 6 * column), Eigen::OuterStride<>(full_.outerStride()));
    const std::vector<int>& rows = below_[column];
    const auto slot = std::lower_bound(rows.begin(), rows.end(), row) - rows.begin();
    return Place(sparse_.valuePtr() + sparse_.outerIndexPtr()[6 * column] + 6 * slot,
                 Eigen::OuterStride<>(6 * static_cast<Eigen::Index>(rows.size())));
  }

  int bodies_;
  std::vector<std::vector<int>> below_;  // rows of the blocks of each column
  Eigen::MatrixXd full_;
  Eigen::SparseMatrix<double> sparse_;
  Eigen::LDLT<Eigen::MatrixXd> dense_solver_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> sparse_solver_;
};

}  // namespace

bool Solver::solve_directly(std::vector<Mover>& movers, std::vector<Point>& points, int max_guesses, bool are_swept) {
  if (std::any_of(movers.begin(), movers.end(), [](const Mover& m) { return m.linkage != nullptr; })) return false;
  prepare(movers, points);
  const std::vector<sweeps::Row>& rows = problem_.rows;
  const int bodies = static_cast<int>(movers.size());
  const std::vector<Mover> free = movers;
  std::vector<Vec3> sliding(points.size()), impulses(points.size()), couples(points.size());
  std::vector<char> rolls(points.size(), 0);  // its couple is at its bound
  std::vector<Hold> holds;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Point& p = points[i];
    const double push = dot(p.impulse, p.normal);
    const Vec3 across = p.impulse - push * p.normal;
    const bool slides = are_swept && push > 0.0 && norm(across) >= kAtCone * p.friction * push;
    if (slides) sliding[i] = across;
    holds.push_back(slides ? Hold::kSlides : push > 0.0 || p.impulse == Vec3{} ? Hold::kSticks : Hold::kOpen);
    if (get_turning_mass(rows[i]) > 0.0 && push > 0.0 &&
        norm(clamp_couple(p, p.couple, kAtCone * push) - p.couple) > 1e-6 * norm(p.couple)) {
      rolls[i] = 1;  // as in the step before
      couples[i] = p.couple;
    }
  }
  bool confirmed = false;
  std::vector<std::array<Vec3, 3>> axes;
  for (const Point& p : points) {
    const Vec3 across = find_across(p.normal);
    axes.push_back({p.normal, across, cross(p.normal, across)});
  }
  double scale = 0.0;
  for (const Point& p : points) scale = std::max(scale, norm(p.wanted - calc_relative_velocity(free, p)));
  Eigen::VectorXd right(6 * bodies);
  System system(bodies, points);
  for (int guess = 0; guess < max_guesses && !confirmed; ++guess) {
    system.clear();
    for (int i = 0; i < bodies; ++i) {
      const Mover& m = free[i];
      Eigen::Matrix3d inverse;
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) inverse(r, c) = m.inverse_inertia[r][c];
      system.add_inertia(i, 1.0 / m.inverse_mass, inverse.inverse());
    }
    movers = free;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Point& p = points[i];
      impulses[i] = {};
      if (holds[i] == Hold::kOpen) {
        couples[i] = {};
        continue;
      }
      const double stiffness = rows[i].normal_mass / kCompliance;
      for (std::size_t k = 0; k < (holds[i] == Hold::kSticks ? 3u : 1u); ++k)
        system.add(p.a, make_row(axes[i][k], cross(p.arm_a, axes[i][k])), p.b, -make_row(axes[i][k], cross(p.arm_b, axes[i][k])),
                   stiffness);
      if (holds[i] == Hold::kSlides) {
        impulses[i] = sliding[i];
        apply(movers, p, sliding[i]);
      }
      if (!(get_turning_mass(rows[i]) > 0.0)) continue;
      if (rolls[i]) {
        turn(movers, p, couples[i]);
      } else {
        couples[i] = {};
        for (std::size_t k = 0; k < 3; ++k)
          system.add(p.a, make_row({}, axes[i][k]), p.b, -make_row({}, axes[i][k]), get_turning_mass(rows[i]) / kCompliance);
      }
    }
    if (!system.factorise()) return false;
    for (int again = 0; again < 12; ++again) {
      right.setZero();
      const auto add = [&](int body, const Row6& row) {
        if (body >= 0) right.segment<6>(6 * body) += row;
      };
      std::vector<Vec3> left(points.size()), left_spin(points.size());
      double largest = 0.0;
      for (std::size_t i = 0; i < points.size(); ++i) {
        const Point& p = points[i];
        if (holds[i] == Hold::kOpen) continue;
        left[i] = p.wanted - calc_relative_velocity(movers, p);
        if (holds[i] == Hold::kSlides) left[i] = dot(left[i], p.normal) * p.normal;
        largest = std::max(largest, norm(left[i]));
        const Vec3 pull = (rows[i].normal_mass / kCompliance) * left[i];
        add(p.a, make_row(pull, cross(p.arm_a, pull)));
        add(p.b, -make_row(pull, cross(p.arm_b, pull)));
        if (!(get_turning_mass(rows[i]) > 0.0) || rolls[i]) continue;
        left_spin[i] = -1.0 * calc_relative_spin(movers, p);
        const Vec3 couple = (get_turning_mass(rows[i]) / kCompliance) * left_spin[i];
        add(p.a, make_row({}, couple));
        add(p.b, -make_row({}, couple));
      }
      if (largest <= 1e-10 * scale) break;
      const Eigen::VectorXd d = system.solve(right);
      const auto get = [&](int body, int from) {
        const double* x = d.data() + 6 * body + from;
        return Vec3{x[0], x[1], x[2]};
      };
      for (std::size_t i = 0; i < points.size(); ++i) {
        const Point& p = points[i];
        if (holds[i] == Hold::kOpen) continue;
        Vec3 moved{}, turned{};
        if (p.a >= 0) moved = get(p.a, 0) + cross(get(p.a, 3), p.arm_a), turned = get(p.a, 3);
        if (p.b >= 0) moved = moved - get(p.b, 0) - cross(get(p.b, 3), p.arm_b), turned = turned - get(p.b, 3);
        if (holds[i] == Hold::kSlides) moved = dot(moved, p.normal) * p.normal;
        const Vec3 more = (rows[i].normal_mass / kCompliance) * (left[i] - moved);
        impulses[i] = impulses[i] + more;
        apply(movers, p, more);
        if (!(get_turning_mass(rows[i]) > 0.0) || rolls[i]) continue;
        const Vec3 couple = (get_turning_mass(rows[i]) / kCompliance) * (left_spin[i] - turned);
        couples[i] = couples[i] + couple;
        turn(movers, p, couple);
      }
    }
    // What the answer says of the guess.
    confirmed = true;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Point& p = points[i];
      const double push = dot(impulses[i], p.normal);
      Hold now = holds[i];
      if (holds[i] == Hold::kOpen) {
        if (dot(p.wanted - calc_relative_velocity(movers, p), p.normal) > 1e-9 * scale) now = Hold::kSticks;
      } else if (!(push > 0.0)) {
        now = Hold::kOpen;
        impulses[i] = {};
      } else if (holds[i] == Hold::kSticks) {
        const Vec3 across = impulses[i] - push * p.normal;
        const double size = norm(across);
        if (size > p.friction * push) {
          now = Hold::kSlides;
          sliding[i] = (p.friction * push / size) * across;
          impulses[i] = push * p.normal + sliding[i];
        }
      } else {
        // Slides on against its velocity; where that would not brake any more, it sticks.
        const Vec3 short_of = p.wanted - calc_relative_velocity(movers, p);
        const Vec3 across = short_of - dot(short_of, p.normal) * p.normal;
        const double size = norm(across);
        if (dot(across, sliding[i]) < 0.0 && guess < max_guesses / 2) {
          now = Hold::kSticks;
        } else {
          const Vec3 next = size > 0.0 ? (p.friction * push / size) * across : sliding[i];
          const Vec3 mean = 0.5 * (next + sliding[i]);
          const double length = norm(mean);
          const Vec3 turned = length > 0.0 ? (p.friction * push / length) * mean : Vec3{};
          if (norm(turned - sliding[i]) > 1e-3 * p.friction * push) confirmed = false;
          sliding[i] = turned;
          impulses[i] = push * p.normal + turned;
        }
      }
      if (get_turning_mass(rows[i]) > 0.0) {
        // A couple that sticks and would have to be above its bound rolls from now on. One that rolls is at its bound against the spin as
        // it is now, and sticks again where less would stop that.
        const double pressing = std::max(push, 0.0);
        const Vec3 free_couple = rolls[i] ? couples[i] - get_turning_mass(rows[i]) * calc_relative_spin(movers, p) : couples[i];
        const Vec3 bounded = clamp_couple(p, free_couple, pressing);
        const bool is_bound = norm(bounded - free_couple) > 1e-9 * norm(bounded);
        if (!rolls[i] && is_bound) {
          rolls[i] = 1;
          couples[i] = bounded;
          confirmed = false;
        } else if (rolls[i] && !is_bound && guess < max_guesses / 2) {
          rolls[i] = 0;
          confirmed = false;
        } else if (rolls[i]) {
          if (norm(bounded - couples[i]) > 1e-3 * (p.rolling_m + p.twisting_m) * pressing) confirmed = false;
          couples[i] = bounded;
        }
      }
      if (now != holds[i]) confirmed = false;
      holds[i] = now;
    }
  }
  // The velocities that these impulses give, and no others.
  movers = free;
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].impulse = impulses[i];
    points[i].couple = couples[i];
    apply(movers, points[i], impulses[i]);
    if (get_turning_mass(rows[i]) > 0.0) turn(movers, points[i], couples[i]);
  }
  return confirmed;
}

}  // namespace carillon::rigid
