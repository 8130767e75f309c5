// Forces of all contacts of one step: springs, anchors and friction cones, coupled with the resulting motion.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <vector>

#include "runtime/physics/impact/spring.hpp"

namespace carillon::impact {

/// Law of a contact and its state at the start of a step. It has one row of unknowns (the normal), or three with friction.
struct ContactLaw {
  Spring spring;
  double friction = 0.0;                                   // mu; 0: one row
  double tangential_n_m = 0.0;                             // k_t of the anchor spring [N/m]
  double compression_m = 0.0;                              // y
  std::array<double, 2> stretch{};                         // u of the anchor spring [m]
  double max_n = std::numeric_limits<double>::infinity();  // limit of the force in this step; the spring loses the rest
  int row = 0;                                             // of the normal; the tangents follow
  std::size_t count_rows() const { return friction > 0.0 ? 3 : 1; }
};

/// With friction the force of a step that stretches the spring from u0 to u = u0 + s (anchor at rest) is
///     F_t = -k_t P((u0 + u)/2),   and the spring ends at P(u),
/// P(x) = x shortened to at most mu F_n/k_t. Inside the cone this is the discrete gradient of k_t u^2/2, without loss; otherwise the anchor
/// moves, and the loss -F_t.s - k_t (|P(u)|^2 - |u0|^2)/2 is never negative.
std::array<double, 2> calc_shortened(const std::array<double, 2>& x, double longest);

/// Solves the contact laws of one step. Normal forces are >= 0 and friction lies inside its cone in every solution. Members are work
/// memory: no call affects the result of the next.
class StepSolver {
 public:
  /// Finds forces f (N, one per row: normal >= 0, then the two tangents) with f = law(moved), moved = free + A f; `moved` [m] is the
  /// separation along the normal and the slip along the tangents in the step. A: (rows, rows), symmetric positive semidefinite [m/N]. f:
  /// in, a guess. Damped Newton with the derivatives of the laws; if it fails, contact by contact (Gauss-Seidel); if that fails, the step
  /// without friction, which cannot gain energy, and false.
  bool solve(const std::vector<ContactLaw>& laws, const std::vector<double>& A, const std::vector<double>& free, double h_s,
             std::vector<double>& f);

 private:
  void solve_one(const ContactLaw& law, double compliance, double free, double h_s, double& f) const;
  double calc_law(const std::vector<ContactLaw>& laws, const std::vector<double>& moved, double h_s, bool with_slopes);
  double calc_residual(const std::vector<ContactLaw>& laws, const std::vector<double>& A, const std::vector<double>& free,
                       const std::vector<double>& moved, double h_s, bool with_slopes);
  static std::array<double, 2> solve_friction(const std::array<double, 3>& A, const std::array<double, 2>& c, double k, double limit);
  bool sweep(const std::vector<ContactLaw>& laws, const std::vector<double>& A, const std::vector<double>& free, double h_s, bool rubs,
             std::vector<double>& f) const;
  bool factorise(const std::vector<ContactLaw>& laws, const std::vector<double>& A);
  void find_step(const std::vector<ContactLaw>& laws, const std::vector<double>& A);

  using Slopes = std::vector<std::array<std::array<double, 3>, 3>>;  // per contact: derivatives of the forces by the motions
  std::vector<double> law_, residual_, size_, moved_, trial_, step_, solved_, change_;
  std::vector<std::size_t> all_, pressing_, pressed_;  // rows; loaded contacts, and their rows
  Slopes slopes_;
  // Of the last factorised Jacobian:
  std::vector<double> compliance_, jacobian_;  // by columns, of the loaded rows
  std::vector<std::size_t> compliance_of_, pressing_then_, pressed_then_, pivots_;
  Slopes slopes_then_;
};

}  // namespace carillon::impact
