// The forces of all contacts of one step: springs, anchors and cones against the motion that they themselves make.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <vector>

#include "runtime/physics/impact/spring.hpp"

namespace carillon::impact {

/// A contact's law and its state at the beginning of a step. It has one row of the step's unknowns (the normal), or three where it rubs.
struct ContactLaw {
  Spring spring;
  double friction = 0.0;                                   // mu; 0: one row
  double tangential_n_m = 0.0;                             // k_t of the anchor spring [N/m]
  double compression_m = 0.0;                              // y
  std::array<double, 2> stretch{};                         // u of the anchor spring [m]
  double max_n = std::numeric_limits<double>::infinity();  // that it may push with in this step: its spring lets go of the rest
  int row = 0;                                             // of the normal; the tangents follow
  std::size_t count_rows() const { return friction > 0.0 ? 3 : 1; }
};

/// With friction the force of a step that stretches the spring from u0 to u = u0 + s (anchor at rest) is
///     F_t = -k_t P((u0 + u)/2),   and the spring ends at P(u),
/// P(x) = x shortened to at most mu F_n/k_t. Inside the cone that is the discrete gradient of k_t u^2/2, so nothing is lost; else the
/// anchor moves, and the loss -F_t.s - k_t (|P(u)|^2 - |u0|^2)/2 is never negative.
std::array<double, 2> calc_shortened(const std::array<double, 2>& x, double longest);

/// Solves the contact laws of one step. Normal forces are >= 0 and friction lies inside its cone, whatever the answer. Members are work
/// memory: no call changes the result of the next.
class StepSolver {
 public:
  /// Finds forces f (N, one per row: normal >= 0, then the two tangents) with f = law(moved), moved = free + A f; `moved` [m] is the
  /// separation along the normal and the slip along the tangents in the step. A: (rows, rows), symmetric positive semidefinite [m/N]. f
  /// comes in as a guess. Newton with the laws' derivatives and halved steps; where it fails, single contacts in turn (Gauss-Seidel);
  /// where that fails, the step without friction, which cannot gain energy, and the answer false.
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

  using Slopes = std::vector<std::array<std::array<double, 3>, 3>>;  // per contact, of the forces by what moved
  std::vector<double> law_, residual_, size_, moved_, trial_, step_, solved_, change_;
  std::vector<std::size_t> all_, pressing_, pressed_;  // rows; contacts that press, and their rows
  Slopes slopes_;
  // Of the motions at which the Jacobian was factorised last:
  std::vector<double> compliance_, jacobian_;  // by columns, of the rows that press
  std::vector<std::size_t> compliance_of_, pressing_then_, pressed_then_, pivots_;
  Slopes slopes_then_;
};

}  // namespace carillon::impact
