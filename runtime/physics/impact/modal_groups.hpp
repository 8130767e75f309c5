// Modes of all bodies of an impact: their motion under row forces. A row is a direction of relative motion at a contact.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/physics/impact/modes.hpp"

namespace carillon::impact {

/// Energies [J] of modes: inside the band, dissipated by damping, and transferred above the band.
struct ModalEnergy {
  double modal = 0.0, dissipated = 0.0, above_band = 0.0;
};

/// Groups of modes: those of a body, or those above its band at one contact. One pass per step applies the forces and computes the free
/// motion of the next step.
class ModalGroups {
 public:
  /// Adds the modes of a body, which must outlive this, with a state of matching size. Returns their energy.
  double add_body(int body, const Modes& modes, std::vector<double> q, std::vector<double> v);
  /// Sets signed shape values (n, 3) of a body at the rows from `row` on, one row per axis; `above_band`: also those of the modes above the
  /// band at the first axis.
  void place(int body, std::span<const double> shape, double sign, int row, std::span<const Vec3> axes, bool above_band);
  /// Subtracts the modal speed of a row from its approach, and adds the inverse modal mass.
  void add_approach(int row, double& approach, double& inverse_mass) const;
  /// Displacement of a row due to the modes inside and above the band.
  double calc_displacement(int row) const;
  /// The smaller of `longest_s` and a quarter of the period of the highest band edge.
  double limit_step(double longest_s) const;

  /// Propagators and free motion for the step length get_step(k); adds the compliances of the rows to `a` (n, n).
  void set_up(int k, std::size_t n, std::vector<double>& a);
  /// Adds the free motion of the rows in this step.
  void add_free_motion(std::vector<double>& free) const;
  /// Advances by one step under the forces of all rows.
  void move(const std::vector<double>& force);

  void read_state(int body, std::vector<double>& q, std::vector<double>& v) const;
  ModalEnergy calc_energy() const;

 private:
  struct Group {
    int body = 0;
    const Modes* modes = nullptr;
    bool tail = false;  // above the band
    std::shared_ptr<const Propagator> p;
    std::vector<int> rows;
    std::vector<double> phi;          // (rows, padded modes)
    std::vector<double> q, v, x;      // state and its free motion
    std::vector<double> w, w_free;    // (rows): phi q, phi x
    double energy = 0.0, work = 0.0;  // at the start; by the forces
    std::vector<double> compliance;   // (rows, rows): phi g phi
    std::vector<double> f, lanes;     // of the step
  };
  std::vector<Group> groups_;
};

}  // namespace carillon::impact
