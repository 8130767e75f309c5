// The modes of all bodies of an impact: their motion under the forces of rows. A row is a direction of relative motion at a contact.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/physics/impact/modes.hpp"

namespace carillon::impact {

/// Energies [J] of modes: inside the band, dissipated by their damping, and gone above the band.
struct ModalEnergy {
  double modal = 0.0, dissipated = 0.0, above_band = 0.0;
};

/// Groups of modes that move together: a body's own, or those above its band at one contact. One pass over the modes of a step takes the
/// forces in and finds the free motion in the next.
class ModalGroups {
 public:
  /// The modes of a body, which must outlive this, in a state of their size. Returns their energy.
  double add_body(int body, const Modes& modes, std::vector<double> q, std::vector<double> v);
  /// Shape values (n, 3) of a body at the rows from `row` on, one for each axis, with a sign; `above_band`: and those of the modes above
  /// the band at the first axis.
  void place(int body, std::span<const double> shape, double sign, int row, std::span<const Vec3> axes, bool above_band);
  /// Subtracts the modal speed of a row from its approach, and adds the inverse of the modal mass.
  void add_approach(int row, double& approach, double& inverse_mass) const;
  /// Displacement of a row by the modes inside the band and above it.
  double calc_displacement(int row) const;
  /// At most this step, and a quarter of the period of the highest band.
  double limit_step(double longest_s) const;

  /// Propagators and free motion of the step get_step(k); adds the compliances of the rows to `a` (n, n).
  void set_up(int k, std::size_t n, std::vector<double>& a);
  /// Adds the free motion of the rows in this step.
  void add_free_motion(std::vector<double>& free) const;
  /// One step under the forces of all rows.
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
    double energy = 0.0, work = 0.0;  // at the beginning; by the forces
    std::vector<double> compliance;   // (rows, rows): phi g phi
    std::vector<double> f, lanes;     // of the step
  };
  std::vector<Group> groups_;
};

}  // namespace carillon::impact
