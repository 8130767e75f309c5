// The velocity problem of a step in the form that sweeps need: points in their own axes (along the normal and twice across), bodies without
// their geometry, all of it in groups of four numbers.
#pragma once

#include <cstddef>
#include <vector>

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpsabi"  // no vector crosses from one set of instructions to another

namespace carillon::rigid::sweeps {

typedef double Four __attribute__((vector_size(32), aligned(32)));  // a vector of three and a zero

/// A matrix, by its columns, times a vector, and the scalar product; compiled once for every set of instructions.
[[gnu::always_inline]] static inline Four combine(const Four (&columns)[3], const Four& by) {
  return by[0] * columns[0] + (by[1] * columns[1] + by[2] * columns[2]);
}
[[gnu::always_inline]] static inline double dot(const Four& a, const Four& b) { return a[0] * b[0] + (a[1] * b[1] + a[2] * b[2]); }

/// Velocity of the centre and spin, world axes [m/s, rad/s].
struct Body {
  Four velocity{}, spin{};
};

/// What a body on joints gains per impulse, or per couple, on another: by the axes of the point.
struct Response {
  int body = 0;
  Four velocity[3]{}, spin[3]{};
};

/// The part of `all` that belongs to a point.
struct Range {
  int begin = 0, end = 0;
};

/// Where joints take away ways to move; axes of the point.
struct Locked {
  Four allowed[3]{};  // by columns: projects on the ways that are left
  Four across[3]{};   // by columns: impulse per velocity across the normal, the motion along it given
  Four by_push{};     // velocity across the normal per impulse along it
  Range pushed;       // what impulses do to bodies on joints
};

/// Couples of a point against rolling and drilling.
struct Turning {
  double mass = 0.0;  // couple per spin [kg m^2]
  double rolling_m = 0.0, twisting_m = 0.0;
  double arm_m = 0.0;             // makes a spin a velocity, where changes are compared
  Four spun_a[3]{}, spun_b[3]{};  // spin gained per couple about each axis, on a
  Four couple{};
  Range turned;  // what couples do to bodies on joints
};

/// One point. What does not move is a body that no impulse changes.
struct Row {
  int a = 0, b = 0;
  int turning = -1, locked = -1;      // its place among those; -1: none
  double mass_a = 0.0, mass_b = 0.0;  // velocity of the centres gained per impulse on a [1/kg]; that of b is negative
  double friction = 0.0;
  double normal_mass = 0.0, tangent_mass = 0.0;  // impulse per velocity [kg], of what sticks or slides by itself
  double mobility = 0.0;                         // velocity along the normal per impulse [1/kg]
  Four axis[3]{};                                // the point's axes in the world
  Four along[3]{};                               // velocity of the point per component of that of a's centre; of b's the negative
  Four turning_a[3]{}, turning_b[3]{};           // the same per component of the spins
  Four spun_a[3]{}, spun_b[3]{};                 // spin gained per impulse along each axis, on a
  Four inverse[3]{};                             // impulse per velocity, by columns
  Four wanted{}, impulse{};                      // see Point
};

/// What impulses and couples do to a body, world axes. Zeros for what does not move, or is on joints.
struct Inertia {
  double inverse_mass = 0.0;  // 1/kg
  Four columns[3]{};          // of the inverse of the inertia [1/(kg m^2)]
};

/// From the centres of both bodies to a point, world axes [m]; 0 for what does not move.
struct Arms {
  Four a{}, b{};
};

/// Of the impulse of one point.
struct Change {
  Four by{};
};

struct Problem {
  std::vector<Body> bodies;       // the last one does not move
  std::vector<Inertia> inertias;  // of the bodies
  std::vector<Row> rows;
  std::vector<Arms> arms;  // of the rows
  std::vector<Turning> turnings;
  std::vector<Locked> locked;
  std::vector<Response> responses;
  std::vector<Change> changes;  // one for every row; share() works in it
};

/// One set of instructions. All give the same numbers.
struct Functions {
  /// Fills in the rows, of which bodies, axes, friction, wanted and impulse are there; of those that are locked, what bodies on joints gain
  /// is not in them.
  void (*prepare)(Problem&);
  /// All points, in their order or against it. Returns the square of the largest change of a velocity [m^2/s^2].
  double (*sweep)(Problem&, bool onward);
  /// Adds impulses to all points.
  void (*add)(Problem&, const std::vector<Change>& changes);
  /// Gives the bodies the impulses and couples that the points begin with.
  void (*begin)(Problem&);
  /// All points at once see the velocities as they are and go a part of their way.
  void (*share)(Problem&, double part);
};

extern const Functions kPlain, kAvx2;

/// The best one that this processor has.
const Functions& get_functions();

}  // namespace carillon::rigid::sweeps

#pragma GCC diagnostic pop
