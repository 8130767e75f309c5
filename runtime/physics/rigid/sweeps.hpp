// Velocity problem of a step in the layout of the sweeps: points in their own axes (normal and two tangents), bodies without geometry, in
// groups of four numbers.
#pragma once

#include <cstddef>
#include <vector>

#include "runtime/base/instructions.hpp"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpsabi"  // no vector is passed between instruction sets

namespace carillon::rigid::sweeps {

typedef double Four __attribute__((vector_size(32), aligned(32)));  // a 3-vector and a zero

/// Velocity of the centre and spin, world axes [m/s, rad/s].
struct Body {
  Four velocity{}, spin{};
};

/// Response of a body on joints per impulse, or per couple, on another, by axis of the point.
struct Response {
  int body = 0;
  Four velocity[3]{}, spin[3]{};
};

/// Entries of `all` that belong to a point.
struct Range {
  int begin = 0, end = 0;
};

/// Directions blocked by joints; axes of the point.
struct Locked {
  Four allowed[3]{};  // by columns: projector onto the free directions
  Four across[3]{};   // by columns: impulse per tangential velocity at given normal motion
  Four by_push{};     // tangential velocity per normal impulse
  Range pushed;       // responses of bodies on joints to impulses
};

/// Rolling and twisting couples of a point.
struct Turning {
  double mass = 0.0;  // couple per spin [kg m^2]
  double rolling_m = 0.0, twisting_m = 0.0;
  double arm_m = 0.0;             // converts spin to velocity where changes are compared
  Four spun_a[3]{}, spun_b[3]{};  // spin change per couple about each axis, on a
  Four couple{};
  Range turned;  // responses of bodies on joints to couples
};

/// One point. Static bodies are represented by a body that impulses do not change.
struct Row {
  int a = 0, b = 0;
  int turning = -1, locked = -1;      // indices in `turnings` and `locked`; -1: none
  double mass_a = 0.0, mass_b = 0.0;  // velocity change of the centres per impulse on a [1/kg]; negative for b
  double friction = 0.0;
  double normal_mass = 0.0, tangent_mass = 0.0;  // impulse per velocity [kg], for sticking and sliding points
  double mobility = 0.0;                         // velocity along the normal per impulse [1/kg]
  Four axis[3]{};                                // point axes in the world
  Four along[3]{};                               // velocity of the point per component of the velocity of a's centre; negative for b
  Four turning_a[3]{}, turning_b[3]{};           // velocity of the point per component of the spins
  Four spun_a[3]{}, spun_b[3]{};                 // spin change per impulse along each axis, on a
  Four inverse[3]{};                             // impulse per velocity, by columns
  Four wanted{}, impulse{};                      // see Point
};

/// Response of a body to impulses and couples, world axes. Zero for static bodies and bodies on joints.
struct Inertia {
  double inverse_mass = 0.0;  // 1/kg
  Four columns[3]{};          // of the inverse of the inertia [1/(kg m^2)]
};

/// From the centres of both bodies to a point, world axes [m]; 0 for static bodies.
struct Arms {
  Four a{}, b{};
};

/// Change of the impulse of one point.
struct Change {
  Four by{};
};

struct Problem {
  std::vector<Body> bodies;       // the last one is static
  std::vector<Inertia> inertias;  // of the bodies
  std::vector<Row> rows;
  std::vector<Arms> arms;  // of the rows
  std::vector<Turning> turnings;
  std::vector<Locked> locked;
  std::vector<Response> responses;
  std::vector<Change> changes;  // one per row; work memory of share()
};

/// Implementation for one instruction set. All give the same results.
struct Functions {
  /// Completes the rows from bodies, axes, friction, wanted and impulse; responses of bodies on joints are not included.
  void (*prepare)(Problem&);
  /// All points, forward or backward. Returns the square of the largest velocity change [m^2/s^2].
  double (*sweep)(Problem&, bool onward);
  /// Adds impulses to all points.
  void (*add)(Problem&, const std::vector<Change>& changes);
  /// Applies the initial impulses and couples of the points to the bodies.
  void (*begin)(Problem&);
  /// All points use the current velocities and apply a fraction of their correction.
  void (*share)(Problem&, double part);
};

/// Implementation for the best supported instruction set up to `best`.
const Functions& get_functions(base::Instructions best = base::Instructions::kBest);

}  // namespace carillon::rigid::sweeps

#pragma GCC diagnostic pop
