// Modal states of bodies under the forces of their hits. Internal to this folder.
#pragma once

#include <span>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/physics/impact/modes.hpp"

namespace carillon::drive {

/// A force on the modes of a body, in pieces of equal length.
struct ModalForce {
  double start_s = 0.0, step_s = 0.0;
  std::vector<double> shape;       // (n, 3) at its place
  std::vector<Vec3> impulses_n_s;  // per piece, axes of the shape

  double calc_end_s() const { return start_s + static_cast<double>(impulses_n_s.size()) * step_s; }
  void scale(double factor) {
    for (Vec3& impulse : impulses_n_s) impulse = factor * impulse;
  }
};

/// Displacements and speeds of modes (n each); empty: at rest.
struct ModalState {
  std::vector<double> q, q_dot;
};

/// Modal state of a body. Invariant: it has all forces as a whole, also those that are later than its time; backwards modes move without
/// damping.
class Ringing {
 public:
  /// The state, moved to a time.
  const ModalState& move_to(const impact::Modes& modes, double time_s);
  /// The state at a time without the forces, or parts of them, that are later.
  ModalState find_without_later(const impact::Modes& modes, double time_s);
  /// Adds forces to the state.
  void add(const impact::Modes& modes, std::vector<ModalForce> forces);
  /// Adds forces whose effect on the state, at its time, is known.
  void add(std::vector<ModalForce> forces, const ModalState& change);
  /// True if some of the forces that are not dropped end later.
  bool has_later(double time_s) const;
  const std::vector<ModalForce>& get_forces() const { return forces_; }
  /// Drops forces that end before a time; they stay in the state.
  void drop_forces(double before_s);
  const ModalState& get_state() const { return state_; }
  double get_time_s() const { return time_s_; }

 private:
  ModalState state_;
  double time_s_ = 0.0;
  std::vector<ModalForce> forces_;
};

/// A body with further forces.
struct StruckBody {
  const impact::Modes* modes = nullptr;  // null: none
  Ringing* ringing = nullptr;            // without the further ones
  std::vector<ModalForce> further;       // axes of the mesh
};

/// Largest x <= `factor` with x * shared_j + x^2 * own_j <= most_j; own_j and most_j >= 0.
double limit_factor(double factor, double shared_j, double own_j, double most_j);
/// Largest factor <= `factor` of the further forces that limits the modal energy they add [J]: `during_j` at every instant, `after_j` at
/// their end.
double limit_further(std::span<const StruckBody> bodies, double factor, double during_j, double after_j);

}  // namespace carillon::drive
