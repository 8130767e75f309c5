// Method: projected Gauss-Seidel over points, each a block of three: the impulse that stops the point if it lies in the cone, otherwise
//   the normal one and a tangential one brought back to the cone. Sweeps go to and fro and begin at the impulses of the step before, so
//   that what rests is found in a sweep or two. Between pairs of sweeps the impulses go on along the conjugate direction of the last pairs:
//   towers and unequal masses take tens of sweeps, not thousands. The last thing done is a sweep, which leaves all inside their cones.
// Source: J. J. Moreau, "Some numerical methods in multibody dynamics" (1999); M. Jean, "The non-smooth contact dynamics method" (1999);
//   M. Silcowitz-Hansen, S. Niebe, K. Erleben, "A nonsmooth nonlinear conjugate gradient method for interactive contact force problems"
//   (2010).
// Deviations: couples against rolling and twisting, bounded by the normal impulse, in the same sweeps. An impulse on a body on joints moves
//   all that hangs together; ways that joints do not allow are left out of a block.
#include "runtime/rigid/solver.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace carillon::rigid {
namespace {

using impact::operator+;
using impact::operator-;
using impact::operator*;
using impact::calc_inverse;
using impact::cross;
using impact::dot;
using impact::norm;

constexpr double kLocked = 1e-9;  // of the largest mobility at a point: what is less is a way that joints do not allow

void add_mobility(Mat3& k, const Mover& m, const Vec3& arm) {
  // 1/m I - [r] I^-1 [r]
  const Mat3 x{Vec3{0, -arm[2], arm[1]}, Vec3{arm[2], 0, -arm[0]}, Vec3{-arm[1], arm[0], 0}};
  Mat3 y{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int c = 0; c < 3; ++c) y[i][j] += m.inverse_inertia[i][c] * x[c][j];
  for (int i = 0; i < 3; ++i) {
    k[i][i] += m.inverse_mass;
    for (int j = 0; j < 3; ++j)
      for (int c = 0; c < 3; ++c) k[i][j] -= x[i][c] * y[c][j];
  }
}

/// An impulse and a couple at the centre of a body on joints move all that hangs together.
void give(std::vector<Mover>& movers, const Mover& on, const Vec3& impulse, const Vec3& couple) {
  const double by[6] = {impulse[0], impulse[1], impulse[2], couple[0], couple[1], couple[2]};
  const Linkage& linkage = *on.linkage;
  const double* rows = linkage.get_mobility(on.member).data();
  for (const int index : linkage.movers) {
    Mover& m = movers[static_cast<std::size_t>(index)];
    for (std::size_t k = 0; k < 6; ++k, rows += 6) {
      double gained = 0.0;
      for (std::size_t c = 0; c < 6; ++c) gained += rows[c] * by[c];
      (k < 3 ? m.velocity[k] : m.spin[k - 3]) += gained;
    }
  }
}

/// Adds `sign` times the velocity of `of` at an arm per impulse on `by` at another, both on the same joints.
void add_linked_mobility(Mat3& k, const Mover& of, const Vec3& arm_of, const Mover& by, const Vec3& arm_by, double sign) {
  const double* block = of.linkage->get_block(of.member, by.member);
  for (std::size_t j = 0; j < 3; ++j) {
    Vec3 impulse{};
    impulse[j] = 1.0;
    const Vec3 couple = cross(arm_by, impulse);
    double gained[6];
    for (std::size_t r = 0; r < 6; ++r)
      gained[r] = block[6 * r + j] + block[6 * r + 3] * couple[0] + block[6 * r + 4] * couple[1] + block[6 * r + 5] * couple[2];
    const Vec3 u = Vec3{gained[0], gained[1], gained[2]} + cross(Vec3{gained[3], gained[4], gained[5]}, arm_of);
    for (std::size_t i = 0; i < 3; ++i) k[i][j] += sign * u[i];
  }
}

/// The inverse of a symmetric matrix where it is more than `least`, and the projector on where that is.
Mat3 calc_pseudo_inverse(const Mat3& m, Mat3& range, double least) {
  Eigen::Matrix3d k;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) k(static_cast<int>(i), static_cast<int>(j)) = 0.5 * (m[i][j] + m[j][i]);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> found(k);
  Mat3 inverse{};
  range = {};
  for (int n = 0; n < 3; ++n) {
    if (!(found.eigenvalues()[n] > least)) continue;
    const Eigen::Vector3d axis = found.eigenvectors().col(n);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const double both = axis[i] * axis[j];
        range[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] += both;
        inverse[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] += both / found.eigenvalues()[n];
      }
  }
  return inverse;
}

}  // namespace

void apply(std::vector<Mover>& movers, const Point& p, const Vec3& impulse) {
  if (p.a >= 0) {
    Mover& m = movers[static_cast<std::size_t>(p.a)];
    if (m.linkage == nullptr) {
      m.velocity = m.velocity + m.inverse_mass * impulse;
      m.spin = m.spin + m.inverse_inertia * cross(p.arm_a, impulse);
    } else {
      give(movers, m, impulse, cross(p.arm_a, impulse));
    }
  }
  if (p.b >= 0) {
    Mover& m = movers[static_cast<std::size_t>(p.b)];
    if (m.linkage == nullptr) {
      m.velocity = m.velocity - m.inverse_mass * impulse;
      m.spin = m.spin - m.inverse_inertia * cross(p.arm_b, impulse);
    } else {
      give(movers, m, -1.0 * impulse, cross(p.arm_b, -1.0 * impulse));
    }
  }
}

void turn(std::vector<Mover>& movers, const Point& p, const Vec3& couple) {
  if (p.a >= 0) {
    Mover& m = movers[static_cast<std::size_t>(p.a)];
    if (m.linkage == nullptr)
      m.spin = m.spin + m.inverse_inertia * couple;
    else
      give(movers, m, {}, couple);
  }
  if (p.b >= 0) {
    Mover& m = movers[static_cast<std::size_t>(p.b)];
    if (m.linkage == nullptr)
      m.spin = m.spin - m.inverse_inertia * couple;
    else
      give(movers, m, {}, -1.0 * couple);
  }
}

Vec3 calc_relative_spin(const std::vector<Mover>& movers, const Point& p) {
  Vec3 w{};
  if (p.a >= 0) w = w + movers[static_cast<std::size_t>(p.a)].spin;
  if (p.b >= 0) w = w - movers[static_cast<std::size_t>(p.b)].spin;
  return w;
}

Vec3 calc_relative_velocity(const std::vector<Mover>& movers, const Point& p) {
  Vec3 u{};
  if (p.a >= 0) {
    const Mover& m = movers[static_cast<std::size_t>(p.a)];
    u = m.velocity + cross(m.spin, p.arm_a);
  }
  if (p.b >= 0) {
    const Mover& m = movers[static_cast<std::size_t>(p.b)];
    u = u - m.velocity - cross(m.spin, p.arm_b);
  }
  return u;
}

Mat3 calc_mobility(const std::vector<Mover>& movers, const Point& p) {
  Mat3 k{};
  const auto add = [&](const Mover& m, const Vec3& arm) {
    if (m.linkage == nullptr)
      add_mobility(k, m, arm);
    else
      add_linked_mobility(k, m, arm, m, arm, 1.0);
  };
  if (p.a >= 0) add(movers[static_cast<std::size_t>(p.a)], p.arm_a);
  if (p.b >= 0) add(movers[static_cast<std::size_t>(p.b)], p.arm_b);
  if (p.a < 0 || p.b < 0) return k;
  const Mover &a = movers[static_cast<std::size_t>(p.a)], &b = movers[static_cast<std::size_t>(p.b)];
  if (a.linkage != nullptr && a.linkage == b.linkage) {
    add_linked_mobility(k, a, p.arm_a, b, p.arm_b, -1.0);
    add_linked_mobility(k, b, p.arm_b, a, p.arm_a, -1.0);
  }
  return k;
}

void Solver::prepare(const std::vector<Mover>& movers, const std::vector<Point>& points) {
  rows_.assign(points.size(), {});
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Point& p = points[i];
    Row& row = rows_[i];
    const Mat3 k = calc_mobility(movers, p);
    const auto is_linked = [&](int body) { return body >= 0 && movers[static_cast<std::size_t>(body)].linkage != nullptr; };
    row.locked = is_linked(p.a) || is_linked(p.b);
    row.inverse = row.locked ? calc_pseudo_inverse(k, row.range, kLocked * (k[0][0] + k[1][1] + k[2][2])) : calc_inverse(k);
    const double kn = dot(p.normal, k * p.normal), trace = k[0][0] + k[1][1] + k[2][2];
    row.normal_mass = 1.0 / kn;
    row.tangent_mass = 1.0 / (trace - kn);  // the sum of both eigenvalues across the normal
    if (row.locked) {
      row.normal_mass = kn > kLocked * trace ? 1.0 / kn : 0.0;
      // Across, as far as joints leave it free once the motion along the normal is given.
      row.by_push = k * p.normal - kn * p.normal;
      Mat3 left = k, unused{};
      for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 3; ++c) {
          const double n = p.normal[r], m = p.normal[c];
          left[r][c] -= n * (row.by_push[c] + kn * m) + row.by_push[r] * m + row.normal_mass * row.by_push[r] * row.by_push[c];
        }
      row.across = calc_pseudo_inverse(left, unused, kLocked * trace);
    }
    if (p.rolling_m > 0.0 || p.twisting_m > 0.0) {
      double most = 0.0;
      for (const int body : {p.a, p.b})
        if (body >= 0) {
          const Mover& m = movers[static_cast<std::size_t>(body)];
          const Mat3& j = m.inverse_inertia;
          most += j[0][0] + j[1][1] + j[2][2];  // on joints a body turns more slowly
        }
      row.turning_mass = 1.0 / most;
    }
  }
}

/// The impulse that the point ought to have, seeing the velocities as they are, a part of the way to it.
Vec3 Solver::calc_impulse(const std::vector<Mover>& movers, const Point& p, const Row& row, double part) const {
  const Vec3 short_of = p.wanted - calc_relative_velocity(movers, p);
  // What joints do not allow no impulse brings about.
  bool may_stick = part == 1.0;
  if (row.locked && may_stick) {
    const Vec3 beyond = short_of - row.range * short_of;
    may_stick = dot(beyond, beyond) <= 1e-12 * dot(short_of, short_of);
  }
  if (may_stick) {
    const Vec3 stuck = p.impulse + row.inverse * short_of;
    const double push = dot(stuck, p.normal);
    const Vec3 across = stuck - push * p.normal;
    if (push > 0.0 && dot(across, across) <= p.friction * p.friction * push * push) return stuck;
  }
  const double old = dot(p.impulse, p.normal), missing = dot(short_of, p.normal);
  const double push = std::max(0.0, old + part * row.normal_mass * missing);
  Vec3 across = p.impulse - old * p.normal;
  if (row.locked)
    across = across + part * (row.across * (short_of - missing * p.normal - (push - old) * row.by_push));
  else
    across = across + (part * row.tangent_mass) * (short_of - missing * p.normal);
  const double size = norm(across), limit = p.friction * push;
  if (size > limit) across = (size > 0.0 ? limit / size : 0.0) * across;
  return push * p.normal + across;
}

void Solver::share(std::vector<Mover>& movers, std::vector<Point>& points, int sweeps) {
  prepare(movers, points);
  std::vector<Vec3> next(points.size());
  const double part = 1.0 / static_cast<double>(std::max<std::size_t>(points.size(), 2));
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    for (std::size_t i = 0; i < points.size(); ++i) next[i] = calc_impulse(movers, points[i], rows_[i], part);
    for (std::size_t i = 0; i < points.size(); ++i) {
      apply(movers, points[i], next[i] - points[i].impulse);
      points[i].impulse = next[i];
    }
  }
}

double Solver::solve(std::vector<Mover>& movers, std::vector<Point>& points, double tolerance_m_s, int most_sweeps) {
  prepare(movers, points);
  for (std::size_t i = 0; i < points.size(); ++i) {
    Point& p = points[i];
    // The part of the old impulse along the normal of now stays normal.
    const double old = std::max(0.0, dot(p.impulse, p.normal));
    Vec3 across = p.impulse - dot(p.impulse, p.normal) * p.normal;
    const double size = norm(across);
    if (size > p.friction * old) across = (size > 0.0 ? p.friction * old / size : 0.0) * across;
    p.impulse = old * p.normal + across;
    apply(movers, p, p.impulse);
    if (rows_[i].turning_mass > 0.0) turn(movers, p, p.couple);
  }
  return solve_on(movers, points, tolerance_m_s, most_sweeps);
}

double Solver::sweep(std::vector<Mover>& movers, std::vector<Point>& points, bool forth) {
  const int count = static_cast<int>(points.size());
  double largest = 0.0;
  ++sweeps_;
  for (int n = 0; n < count; ++n) {
    const auto i = static_cast<std::size_t>(forth ? n : count - 1 - n);
    Point& p = points[i];
    const Row& row = rows_[i];
    const Vec3 wanted = calc_impulse(movers, p, row, 1.0), change = wanted - p.impulse;
    if (change[0] != 0.0 || change[1] != 0.0 || change[2] != 0.0) {
      if (row.normal_mass > 0.0) largest = std::max(largest, norm(change) / row.normal_mass);
      apply(movers, p, change);
      p.impulse = wanted;
    }
    if (!(row.turning_mass > 0.0)) continue;
    const double push = dot(p.impulse, p.normal);
    const Vec3 free = p.couple - row.turning_mass * calc_relative_spin(movers, p);
    const double twist = dot(free, p.normal);
    Vec3 roll = free - twist * p.normal;
    const double size = norm(roll), limit = p.rolling_m * push;
    if (size > limit) roll = (size > 0.0 ? limit / size : 0.0) * roll;
    const Vec3 couple = roll + std::clamp(twist, -p.twisting_m * push, p.twisting_m * push) * p.normal, step = couple - p.couple;
    turn(movers, p, step);
    p.couple = couple;
    largest = std::max(largest, norm(step) / row.turning_mass * norm(p.a >= 0 ? p.arm_a : p.arm_b));
  }
  return largest;
}

double Solver::solve_on(std::vector<Mover>& movers, std::vector<Point>& points, double tolerance_m_s, int most_sweeps) {
  sweeps_ = 0;
  before_.resize(points.size());
  way_.assign(points.size(), Vec3{});
  double largest = 0.0, last = 0.0;
  while (sweeps_ < most_sweeps) {
    for (std::size_t i = 0; i < points.size(); ++i) before_[i] = points[i].impulse;
    largest = sweep(movers, points, true);
    if (largest <= tolerance_m_s) break;
    largest = sweep(movers, points, false);
    if (largest <= tolerance_m_s || sweeps_ >= most_sweeps) break;
    // What both sweeps changed is minus a gradient, conjugate to the one before.
    double now = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      before_[i] = points[i].impulse - before_[i];
      now += dot(before_[i], before_[i]) / rows_[i].normal_mass;
    }
    const double part = last > 0.0 ? now / last : 0.0;
    last = now;
    if (part >= 1.0) {
      std::fill(way_.begin(), way_.end(), Vec3{});
      last = 0.0;
      continue;
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3 on = part * way_[i];
      way_[i] = on + before_[i];
      if (part == 0.0) continue;
      apply(movers, points[i], on);
      points[i].impulse = points[i].impulse + on;
    }
  }
  return largest;
}

}  // namespace carillon::rigid
