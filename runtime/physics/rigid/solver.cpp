// Method: projected Gauss-Seidel over points, each a block of three: the impulse that stops the point if it lies in the cone, otherwise the
// normal impulse and a tangential one projected onto the cone. Sweeps alternate in direction and start from the impulses of the previous
// step, so resting contacts converge in one or two sweeps. Between pairs of sweeps the impulses are extrapolated along the conjugate
// direction of the last pairs: towers and unequal masses take tens of sweeps instead of thousands. A final sweep leaves all impulses inside
// their cones. Rolling and twisting couples, bounded by the normal impulse, are part of the same sweeps. An impulse on a body on joints
// moves its whole articulation; directions blocked by joints are excluded from the block.
// Source: J. J. Moreau, "Some numerical methods in multibody dynamics" (1999); M. Jean, "The non-smooth contact dynamics method" (1999); M.
// Silcowitz-Hansen, S. Niebe, K. Erleben, "A nonsmooth nonlinear conjugate gradient method for interactive contact force problems" (2010).
#include "runtime/physics/rigid/solver.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#pragma GCC diagnostic ignored "-Wpsabi"  // see sweeps.hpp

namespace carillon::rigid {
namespace {

using sweeps::Four;
using sweeps::Locked;
using sweeps::Response;
using sweeps::Row;
using sweeps::Turning;

constexpr double kLockedMobilityRatio = 1e-9;  // relative to the largest mobility at a point: smaller ones are directions blocked by joints

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

/// Applies an impulse and a couple at the centre of a body on joints to its whole articulation.
void give(std::vector<Mover>& movers, const Mover& on, const Vec3& impulse, const Vec3& couple) {
  const double by[6] = {impulse[0], impulse[1], impulse[2], couple[0], couple[1], couple[2]};
  const Linkage& linkage = *on.linkage;
  const double* rows = linkage.get_mobility(on.member).data();
  for (const int index : linkage.movers) {
    Mover& m = movers[index];
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

/// Inverse of a symmetric matrix on the range of eigenvalues above `min`, and the projector onto that range.
Mat3 calc_pseudo_inverse(const Mat3& m, Mat3& range, double min) {
  Eigen::Matrix3d k;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) k(static_cast<int>(i), static_cast<int>(j)) = 0.5 * (m[i][j] + m[j][i]);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> found(k);
  Mat3 inverse{};
  range = {};
  for (int n = 0; n < 3; ++n) {
    if (!(found.eigenvalues()[n] > min)) continue;
    const Eigen::Vector3d axis = found.eigenvectors().col(n);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const double both = axis[i] * axis[j];
        range[i][j] += both;
        inverse[i][j] += both / found.eigenvalues()[n];
      }
  }
  return inverse;
}

}  // namespace

void apply(std::vector<Mover>& movers, const Point& p, const Vec3& impulse) {
  if (p.a >= 0) {
    Mover& m = movers[p.a];
    if (m.linkage == nullptr) {
      m.velocity = m.velocity + m.inverse_mass * impulse;
      m.spin = m.spin + m.inverse_inertia * cross(p.arm_a, impulse);
    } else {
      give(movers, m, impulse, cross(p.arm_a, impulse));
    }
  }
  if (p.b >= 0) {
    Mover& m = movers[p.b];
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
    Mover& m = movers[p.a];
    if (m.linkage == nullptr)
      m.spin = m.spin + m.inverse_inertia * couple;
    else
      give(movers, m, {}, couple);
  }
  if (p.b >= 0) {
    Mover& m = movers[p.b];
    if (m.linkage == nullptr)
      m.spin = m.spin - m.inverse_inertia * couple;
    else
      give(movers, m, {}, -1.0 * couple);
  }
}

namespace {

Four to_four(const Vec3& a) { return Four{a[0], a[1], a[2], 0.0}; }
Vec3 to_vec(const Four& a) { return {a[0], a[1], a[2]}; }
double calc_square(const Four& a) { return a[0] * a[0] + (a[1] * a[1] + a[2] * a[2]); }
Vec3 to_world(const Four (&axes)[3], const Four& a) { return to_vec(a[0] * axes[0] + (a[1] * axes[1] + a[2] * axes[2])); }
void set_columns(Four (&columns)[3], const Mat3& m) {
  for (std::size_t c = 0; c < 3; ++c) columns[c] = Four{m[0][c], m[1][c], m[2][c], 0.0};
}

}  // namespace

Vec3 calc_relative_spin(const std::vector<Mover>& movers, const Point& p) {
  Vec3 w{};
  if (p.a >= 0) w = w + movers[p.a].spin;
  if (p.b >= 0) w = w - movers[p.b].spin;
  return w;
}

Vec3 calc_relative_velocity(const std::vector<Mover>& movers, const Point& p) {
  Vec3 u{};
  if (p.a >= 0) {
    const Mover& m = movers[p.a];
    u = m.velocity + cross(m.spin, p.arm_a);
  }
  if (p.b >= 0) {
    const Mover& m = movers[p.b];
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
  if (p.a >= 0) add(movers[p.a], p.arm_a);
  if (p.b >= 0) add(movers[p.b], p.arm_b);
  if (p.a < 0 || p.b < 0) return k;
  const Mover &a = movers[p.a], &b = movers[p.b];
  if (a.linkage != nullptr && a.linkage == b.linkage) {
    add_linked_mobility(k, a, p.arm_a, b, p.arm_b, -1.0);
    add_linked_mobility(k, b, p.arm_b, a, p.arm_a, -1.0);
  }
  return k;
}

void Solver::prepare(const std::vector<Mover>& movers, const std::vector<Point>& points) {
  problem_.bodies.resize(movers.size() + 1);
  for (std::size_t n = 0; n < movers.size(); ++n) problem_.bodies[n] = {to_four(movers[n].velocity), to_four(movers[n].spin)};
  problem_.bodies.back() = {};
  problem_.inertias.assign(movers.size() + 1, {});
  for (std::size_t n = 0; n < movers.size(); ++n) {
    if (movers[n].linkage != nullptr) continue;
    problem_.inertias[n].inverse_mass = movers[n].inverse_mass;
    set_columns(problem_.inertias[n].columns, movers[n].inverse_inertia);
  }
  problem_.rows.resize(points.size());
  problem_.arms.assign(points.size(), {});
  problem_.changes.resize(points.size());
  problem_.turnings.clear();
  problem_.locked.clear();
  problem_.responses.clear();
  const int still = static_cast<int>(movers.size());
  const auto is_linked = [&](int body) { return body >= 0 && movers[body].linkage != nullptr; };
  const auto get_axes = [](const Point& p) {
    const Vec3 across = find_across(p.normal);
    return Mat3{p.normal, across, cross(p.normal, across)};
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Point& p = points[i];
    Row& row = problem_.rows[i];
    const Mat3 axes = get_axes(p);
    for (std::size_t j = 0; j < 3; ++j) row.axis[j] = to_four(axes[j]);
    row.turning = -1;
    row.locked = is_linked(p.a) || is_linked(p.b) ? static_cast<int>(problem_.locked.size()) : -1;
    if (row.locked >= 0) problem_.locked.emplace_back();
    row.friction = p.friction;
    row.wanted = to_four(axes * p.wanted);
    row.impulse = to_four(axes * p.impulse);
    row.a = p.a >= 0 ? p.a : still;
    row.b = p.b >= 0 ? p.b : still;
    if (p.a >= 0) problem_.arms[i].a = to_four(p.arm_a);
    if (p.b >= 0) problem_.arms[i].b = to_four(p.arm_b);
  }
  functions_->prepare(problem_);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Point& p = points[i];
    Row& row = problem_.rows[i];
    if (row.locked >= 0) lock(movers, p, get_axes(p), row);
    if (p.rolling_m > 0.0 || p.twisting_m > 0.0) add_turning(movers, p, get_axes(p), row);
  }
}

/// A point on bodies on joints: an impulse moves the articulation, and not every direction is free.
void Solver::lock(const std::vector<Mover>& movers, const Point& p, const Mat3& axes, Row& row) {
  Locked& locked = problem_.locked[row.locked];
  const Mat3 k = axes * (calc_mobility(movers, p) * transpose(axes));
  const double kn = k[0][0], trace = k[0][0] + k[1][1] + k[2][2];
  Mat3 range{}, unused{};
  set_columns(row.inverse, calc_pseudo_inverse(k, range, kLockedMobilityRatio * trace));
  set_columns(locked.allowed, range);
  row.normal_mass = kn > kLockedMobilityRatio * trace ? 1.0 / kn : 0.0;
  row.mobility = row.normal_mass > 0.0 ? kn : 0.0;
  // Tangential directions left free by joints for given normal motion.
  locked.by_push = Four{0.0, k[1][0], k[2][0], 0.0};
  Mat3 left{};
  for (std::size_t r = 1; r < 3; ++r)
    for (std::size_t c = 1; c < 3; ++c) left[r][c] = k[r][c] - row.normal_mass * k[r][0] * k[c][0];
  set_columns(locked.across, calc_pseudo_inverse(left, unused, kLockedMobilityRatio * trace));
  locked.pushed.begin = static_cast<int>(problem_.responses.size());
  for (const bool is_a : {true, false}) add_responses(movers, is_a ? p.a : p.b, is_a ? p.arm_a : p.arm_b, is_a ? 1.0 : -1.0, true, axes);
  locked.pushed.end = static_cast<int>(problem_.responses.size());
}

/// Response of the bodies on the same joints to impulses along the axes of a point, or to couples about them.
void Solver::add_responses(const std::vector<Mover>& movers, int body, const Vec3& arm, double sign, bool are_impulses, const Mat3& axes) {
  if (body < 0 || movers[body].linkage == nullptr) return;
  const Mover& on = movers[body];
  const double* rows = on.linkage->get_mobility(on.member).data();
  for (const int index : on.linkage->movers) {
    Response& response = problem_.responses.emplace_back();
    response.body = index;
    for (std::size_t j = 0; j < 3; ++j) {
      const Vec3 impulse = are_impulses ? sign * axes[j] : Vec3{}, couple = are_impulses ? cross(arm, impulse) : sign * axes[j];
      for (std::size_t r = 0; r < 6; ++r) {
        double gained = 0.0;
        for (std::size_t c = 0; c < 3; ++c) gained += rows[6 * r + c] * impulse[c] + rows[6 * r + 3 + c] * couple[c];
        Four& to = r < 3 ? response.velocity[j] : response.spin[j];  // gcc's sanitizers lose an assignment through the condition
        to[r % 3] = gained;
      }
    }
    rows += 36;
  }
}

void Solver::add_turning(const std::vector<Mover>& movers, const Point& p, const Mat3& axes, Row& row) {
  row.turning = static_cast<int>(problem_.turnings.size());
  Turning& turning = problem_.turnings.emplace_back();
  turning.rolling_m = p.rolling_m;
  turning.twisting_m = p.twisting_m;
  turning.arm_m = norm(p.a >= 0 ? p.arm_a : p.arm_b);
  turning.couple = to_four(axes * p.couple);
  turning.turned.begin = static_cast<int>(problem_.responses.size());
  const auto add = [&](int body, double sign, Four(&spun)[3]) {
    if (body < 0) return;
    const Mover& m = movers[body];
    for (std::size_t j = 0; j < 3 && m.linkage == nullptr; ++j) spun[j] = to_four(sign * (m.inverse_inertia * axes[j]));
    add_responses(movers, body, {}, sign, false, axes);
  };
  add(p.a, 1.0, turning.spun_a);
  add(p.b, -1.0, turning.spun_b);
  turning.turned.end = static_cast<int>(problem_.responses.size());
  turning.mass = calc_turning_mass(movers, p);
}

/// Writes the solution.
void Solver::take(std::vector<Mover>& movers, std::vector<Point>& points) const {
  for (std::size_t n = 0; n < movers.size(); ++n) {
    movers[n].velocity = to_vec(problem_.bodies[n].velocity);
    movers[n].spin = to_vec(problem_.bodies[n].spin);
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Row& row = problem_.rows[i];
    points[i].impulse = to_world(row.axis, row.impulse);
    points[i].couple = row.turning >= 0 ? to_world(row.axis, problem_.turnings[row.turning].couple) : Vec3{};
  }
}

double calc_turning_mass(const std::vector<Mover>& movers, const Point& p) {
  if (!(p.rolling_m > 0.0) && !(p.twisting_m > 0.0)) return 0.0;
  double mobility = 0.0;
  for (const int body : {p.a, p.b})
    for (std::size_t k = 0; k < 3 && body >= 0; ++k) mobility += movers[body].inverse_inertia[k][k];
  return 1.0 / mobility;
}

double Solver::solve(std::vector<Mover>& movers, std::vector<Point>& points, double tolerance_m_s, int max_sweeps) {
  prepare(movers, points);
  for (Row& row : problem_.rows) {
    // The component of the old impulse along the current normal stays normal.
    Four& impulse = row.impulse;
    impulse[0] = std::max(0.0, impulse[0]);
    const double size = std::hypot(impulse[1], impulse[2]), limit = row.friction * impulse[0];
    if (size > limit) impulse[1] *= limit / size, impulse[2] *= limit / size;
  }
  functions_->begin(problem_);
  const double left = run(tolerance_m_s, max_sweeps);
  take(movers, points);
  return left;
}

double Solver::solve_evenly(std::vector<Mover>& movers, std::vector<Point>& points, int shares, double tolerance_m_s, int max_sweeps) {
  for (Point& p : points) p.impulse = p.couple = {};
  prepare(movers, points);
  const double part = 1.0 / static_cast<double>(std::max<std::size_t>(points.size(), 2));
  for (int n = 0; n < shares; ++n) functions_->share(problem_, part);
  const double left = run(tolerance_m_s, max_sweeps);
  take(movers, points);
  return left;
}

double Solver::run(double tolerance_m_s, int max_sweeps) {
  sweeps_ = 0;
  std::vector<Row>& rows = problem_.rows;
  before_.resize(rows.size());
  way_.assign(rows.size(), {});
  double largest = 0.0, last = 0.0;
  const auto sweep = [&](bool onward) {
    ++sweeps_;
    return std::sqrt(functions_->sweep(problem_, onward));
  };
  while (sweeps_ < max_sweeps) {
    for (std::size_t i = 0; i < rows.size(); ++i) before_[i].by = rows[i].impulse;
    largest = sweep(true);
    if (largest <= tolerance_m_s) break;
    largest = sweep(false);
    if (largest <= tolerance_m_s || sweeps_ >= max_sweeps) break;
    // The change by both sweeps is a negative gradient, conjugate to the previous one.
    double now = 0.0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      before_[i].by = rows[i].impulse - before_[i].by;
      now += calc_square(before_[i].by) * rows[i].mobility;
    }
    const double part = last > 0.0 ? now / last : 0.0;
    last = now;
    if (part >= 1.0) {
      std::fill(way_.begin(), way_.end(), sweeps::Change{});
      last = 0.0;
      continue;
    }
    if (part > 0.0) {
      for (sweeps::Change& way : way_) way.by *= part;
      functions_->add(problem_, way_);
    }
    for (std::size_t i = 0; i < rows.size(); ++i) way_[i].by += before_[i].by;
  }
  return largest;
}

}  // namespace carillon::rigid
