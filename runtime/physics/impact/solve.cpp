// Method: Newton on  r(m) = m - free - A law(m)  in the motions m of the step; law() is monotone and piecewise smooth. One contact without
// friction: bracketed Newton, which always converges.
// Source: the mean-value discrete gradient, Gonzalez 1996; the friction rule (solve.hpp) is a return mapping (Simo, Hughes 1998, ch. 1) at
// mid-step for the force and at the end of the step for the state.
// Passivity of the friction rule: with R = mu F_n/k_t, U = |u0|, T = |u0 + s| and m = |u0 + s/2| <= (T + U)/2 the loss over k_t/2 is
// min(1, R/m) (T^2 - U^2) - (min(T, R)^2 - U^2). m <= R: T <= R gives 0, T > R gives T^2 - R^2. m > R, T <= R: then U > R >= T, and it is
// (1 - R/m) (U^2 - T^2). m > R, T > R: for T < U it is at least (U^2 - R^2) - (U^2 - T^2); for T >= U >= R at least U^2 - R^2; for U < R
// at least 2 R (T - U) - (R - U)(R + U). All are non-negative.
#include "runtime/physics/impact/solve.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "runtime/physics/impact/dense.hpp"

namespace carillon::impact {
namespace {

constexpr int kSweeps = 200;
constexpr double kReuseErrorRatio = 1e-3;  // error reduction of a step below which the next one reuses the factorisation

/// Normal force of a step that ends with the compression y1.
StepForce calc_normal_force(const ContactLaw& law, double y1, double h_s) {
  const StepForce one = calc_step_force(law.spring, law.compression_m, y1, h_s);
  return one.force > law.max_n ? StepForce{law.max_n, 0.0} : one;
}

}  // namespace

std::array<double, 2> calc_shortened(const std::array<double, 2>& x, double longest) {
  const double length = std::hypot(x[0], x[1]);
  if (length <= longest) return x;
  return {x[0] * (longest / length), x[1] * (longest / length)};
}

void StepSolver::solve_one(const ContactLaw& law, double compliance, double free, double h_s, double& f) const {
  // In terms of the compression m: r(m) = m - m_free + A F(y0 + m) grows with slope >= 1; r <= 0 at m_free - A F(m_free), r >= 0 at m_free.
  const double m_free = -free, y0 = law.compression_m;
  double high = m_free, low = m_free - compliance * calc_normal_force(law, y0 + m_free, h_s).force;
  double m = std::clamp(m_free - compliance * f, low, high);
  for (int i = 0; i < 100; ++i) {
    const StepForce one = calc_normal_force(law, y0 + m, h_s);
    f = one.force;
    const double r = m - m_free + compliance * f;
    (r > 0.0 ? high : low) = m;
    double next = m - r / (1.0 + compliance * one.slope);
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    const double change = std::abs(next - m);
    m = next;
    if (change <= 2e-16 * (std::abs(m) + std::abs(m_free))) break;
  }
  f = calc_normal_force(law, y0 + m, h_s).force;
}

/// Fills law_ and slopes_ with the forces at `moved`, and pressing_ and pressed_ with the loaded contacts and their rows; returns the
/// largest force.
double StepSolver::calc_law(const std::vector<ContactLaw>& laws, const std::vector<double>& moved, double h_s, bool with_slopes) {
  double largest = 0.0;
  pressing_.clear();
  pressed_.clear();
  for (std::size_t c = 0; c < laws.size(); ++c) {
    const ContactLaw& t = laws[c];
    const auto row = t.row;
    const StepForce normal = calc_normal_force(t, t.compression_m - moved[row], h_s);
    auto& slope = slopes_[c];
    if (with_slopes) slope = {};
    law_[row] = normal.force;
    if (with_slopes) slope[0][0] = -normal.slope;
    largest = std::max(largest, normal.force);
    if (t.friction > 0.0) law_[row + 1] = law_[row + 2] = 0.0;
    if (normal.force <= 0.0 && normal.slope <= 0.0) continue;
    pressing_.push_back(c);
    for (std::size_t i = 0; i < t.count_rows(); ++i) pressed_.push_back(row + i);
    if (t.friction <= 0.0) continue;
    const double k = t.tangential_n_m, limit = t.friction * normal.force;
    const std::array<double, 2> middle{t.stretch[0] + 0.5 * moved[row + 1], t.stretch[1] + 0.5 * moved[row + 2]};
    const double length = std::hypot(middle[0], middle[1]);
    const bool sticks = k * length <= limit;
    const double scale = sticks ? k : limit / length;
    for (std::size_t i = 0; i < 2; ++i) {
      law_[row + 1 + i] = -scale * middle[i];
      if (!with_slopes) continue;
      if (!sticks) slope[1 + i][0] = t.friction * normal.slope * middle[i] / length;
      for (std::size_t j = 0; j < 2; ++j)
        slope[1 + i][1 + j] = -0.5 * scale * ((i == j ? 1.0 : 0.0) - (sticks ? 0.0 : middle[i] * middle[j] / (length * length)));
    }
  }
  return largest;
}

/// Fills residual_ with m - free - A law(m); returns its largest entry, relative to the motion along normals or tangents.
double StepSolver::calc_residual(const std::vector<ContactLaw>& laws, const std::vector<double>& A, const std::vector<double>& free,
                                 const std::vector<double>& moved, double h_s, bool with_slopes) {
  calc_law(laws, moved, h_s, with_slopes);
  const std::size_t n = free.size();
  change_.resize(pressed_.size());
  for (std::size_t j = 0; j < pressed_.size(); ++j) change_[j] = -law_[pressed_[j]];
  for (std::size_t i = 0; i < n; ++i) residual_[i] = moved[i] - free[i];
  dense::get_functions().add_columns(A.data(), n, pressed_.data(), change_.data(), pressed_.size(), residual_.data(), n);
  double largest = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const double r = std::abs(residual_[i]) / size_[i];
    if (!std::isfinite(r)) return std::numeric_limits<double>::infinity();  // from a non-finite step
    largest = std::max(largest, r);
  }
  return largest;
}

/// Factorises 1 - A law' for the loaded rows; the other columns are those of the identity. False if singular.
bool StepSolver::factorise(const std::vector<ContactLaw>& laws, const std::vector<double>& A) {
  const std::size_t rows = residual_.size(), n = pressed_.size();
  if (compliance_of_ != pressed_) {
    compliance_of_ = pressed_;
    compliance_.resize(n * n);
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t i = 0; i < n; ++i) compliance_[j * n + i] = A[pressed_[j] * rows + pressed_[i]];
  }
  pressing_then_ = pressing_;
  pressed_then_ = pressed_;
  slopes_then_ = slopes_;
  jacobian_.assign(n * n, 0.0);
  pivots_.resize(n);
  const dense::Functions& functions = dense::get_functions();
  std::size_t at = 0;
  for (const std::size_t c : pressing_) {
    const std::size_t own = laws[c].count_rows();
    for (std::size_t j = 0; j < own; ++j) {
      double* column = jacobian_.data() + (at + j) * n;
      column[at + j] = 1.0;
      const std::array<std::size_t, 3> which{at, at + 1, at + 2};
      const std::array<double, 3> by{-slopes_[c][0][j], -slopes_[c][1][j], -slopes_[c][2][j]};
      functions.add_columns(compliance_.data(), n, which.data(), by.data(), own, column, n);
    }
    at += own;
  }
  return functions.factorise(jacobian_.data(), n, n, pivots_.data());
}

/// Newton step (1 - A law') step_ = residual_ with the factorised law': solved for the loaded rows; the others follow from them.
void StepSolver::find_step(const std::vector<ContactLaw>& laws, const std::vector<double>& A) {
  const std::size_t rows = residual_.size(), n = pressed_then_.size();
  const dense::Functions& functions = dense::get_functions();
  solved_.resize(n);
  for (std::size_t j = 0; j < n; ++j) solved_[j] = residual_[pressed_then_[j]];
  functions.substitute(jacobian_.data(), n, n, pivots_.data(), solved_.data());
  // Motion of all rows due to the change of the forces.
  change_.assign(n, 0.0);
  std::size_t at = 0;
  for (const std::size_t c : pressing_then_) {
    const std::size_t own = laws[c].count_rows();
    for (std::size_t k = 0; k < own; ++k)
      for (std::size_t j = 0; j < own; ++j) change_[at + k] += slopes_then_[c][k][j] * solved_[at + j];
    at += own;
  }
  step_ = residual_;
  functions.add_columns(A.data(), rows, pressed_then_.data(), change_.data(), n, step_.data(), rows);
  for (std::size_t j = 0; j < n; ++j) step_[pressed_then_[j]] = solved_[j];
}

/// Friction of one contact for given other forces: u = c + A F/2, F = -k P(u) with P limited to limit/k. When slipping, u and F are
/// parallel, F = -2 b u with (1 + b A) u = c and 2 b |u| = limit; b |u(b)| grows with b, so b is bracketed. A: (2, 2).
std::array<double, 2> StepSolver::solve_friction(const std::array<double, 3>& A, const std::array<double, 2>& c, double k, double limit) {
  // In the principal axes of A = (A00, A01, A11).
  const double angle = 0.5 * std::atan2(2.0 * A[1], A[0] - A[2]), cosine = std::cos(angle), sine = std::sin(angle);
  const double mean = 0.5 * (A[0] + A[2]), off = std::hypot(0.5 * (A[0] - A[2]), A[1]);
  const std::array<double, 2> a{mean + off, std::max(mean - off, 0.0)}, along{cosine * c[0] + sine * c[1], cosine * c[1] - sine * c[0]};
  const auto calc_length = [&](double b) { return std::hypot(along[0] / (1.0 + b * a[0]), along[1] / (1.0 + b * a[1])); };
  double low = 0.0, b = 0.5 * k;
  if (2.0 * b * calc_length(b) > limit) {
    double high = b;
    for (int i = 0; i < 200 && high - low > 1e-16 * high; ++i) {
      b = low > 1e-6 * high ? 0.5 * (low + high) : std::max(std::sqrt(low * high), 1e-3 * high);
      (2.0 * b * calc_length(b) > limit ? high : low) = b;
    }
  }
  const std::array<double, 2> f{-2.0 * b * along[0] / (1.0 + b * a[0]), -2.0 * b * along[1] / (1.0 + b * a[1])};
  return calc_shortened({cosine * f[0] - sine * f[1], sine * f[0] + cosine * f[1]}, limit);
}

/// Contact by contact, each with the others' forces given; true if the forces converge. Without friction: descent on a convex energy.
bool StepSolver::sweep(const std::vector<ContactLaw>& laws, const std::vector<double>& A, const std::vector<double>& free, double h_s,
                       bool rubs, std::vector<double>& f) const {
  const std::size_t n = free.size();
  for (int s = 0; s < kSweeps; ++s) {
    double change = 0.0, largest = 0.0;
    for (const ContactLaw& t : laws) {
      const auto row = t.row;
      const auto calc_motion = [&](std::size_t i, std::size_t first, std::size_t last) {  // by all forces except first .. last
        double m = free[i];
        for (std::size_t j = 0; j < n; ++j)
          if (j < first || j > last) m += A[i * n + j] * f[j];
        return m;
      };
      const auto put = [&](std::size_t i, double force) {
        change = std::max(change, std::abs(force - f[i]));
        largest = std::max(largest, std::abs(force));
        f[i] = force;
      };
      double normal = f[row];
      solve_one(t, A[row * n + row], calc_motion(row, row, row), h_s, normal);
      put(row, normal);
      if (t.friction <= 0.0 || !rubs) continue;
      const std::size_t i = row + 1, j = row + 2;
      const auto tangential = solve_friction({A[i * n + i], A[i * n + j], A[j * n + j]},
                                             {t.stretch[0] + 0.5 * calc_motion(i, i, j), t.stretch[1] + 0.5 * calc_motion(j, i, j)},
                                             t.tangential_n_m, t.friction * normal);
      put(i, tangential[0]);
      put(j, tangential[1]);
    }
    if (change <= 1e-13 * largest) return true;
  }
  return false;
}

bool StepSolver::solve(const std::vector<ContactLaw>& laws, const std::vector<double>& A, const std::vector<double>& free, double h_s,
                       std::vector<double>& f) {
  const std::size_t n = free.size();
  if (n == 1) {
    solve_one(laws.front(), A[0], free[0], h_s, f[0]);
    return true;
  }
  law_.resize(n);
  residual_.resize(n);
  slopes_.resize(laws.size());
  all_.resize(n);
  std::iota(all_.begin(), all_.end(), std::size_t{0});
  moved_ = free;
  dense::get_functions().add_columns(A.data(), n, all_.data(), f.data(), n, moved_.data(), n);
  double size_normal = 1e-300, size_tangential = 1e-300;
  for (const ContactLaw& t : laws) {
    const auto row = t.row;
    size_normal = std::max({size_normal, std::abs(free[row]), 1e-3 * std::abs(t.compression_m)});
    if (t.friction > 0.0)
      size_tangential = std::max({size_tangential, std::abs(free[row + 1]), std::abs(free[row + 2]), std::abs(free[row])});
  }
  size_.assign(n, size_tangential);
  for (const ContactLaw& t : laws) size_[t.row] = size_normal;
  compliance_of_.clear();  // A may have changed
  double error = calc_residual(laws, A, free, moved_, h_s, true);
  bool is_fast = false, is_current = true;  // is_current: forces and residual belong to moved_
  for (int iteration = 0; iteration < 40 && error > 1e-13; ++iteration) {
    const bool is_new = !is_fast || pressed_ != pressed_then_;
    if (is_new && !factorise(laws, A)) break;
    find_step(laws, A);
    double part = 1.0, next = error;
    for (int halving = 0; halving < 12; ++halving, part *= 0.5) {
      trial_ = moved_;
      for (std::size_t i = 0; i < n; ++i) trial_[i] -= part * step_[i];
      next = calc_residual(laws, A, free, trial_, h_s, true);
      if (next < error || !is_new) break;
    }
    is_fast = next < kReuseErrorRatio * error;
    is_current = next < error;
    if (is_current) {
      moved_.swap(trial_);
      error = next;
    } else if (is_new) {
      break;  // limit of rounding, or a kink
    } else {
      error = calc_residual(laws, A, free, moved_, h_s, true);  // once more with a new factorisation
      is_current = true;
    }
  }
  if (!is_current) error = calc_residual(laws, A, free, moved_, h_s, false);
  f = law_;
  if (error <= 1e-11) return true;
  if (sweep(laws, A, free, h_s, true, f)) return true;
  // Without friction no energy can be gained: the energy of the anchor springs is lost.
  for (const ContactLaw& t : laws)
    if (t.friction > 0.0) f[t.row + 1] = f[t.row + 2] = 0.0;
  sweep(laws, A, free, h_s, false, f);
  return false;
}

}  // namespace carillon::impact
