// Bodies with known modes: interface of all theories.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "precompute/job/analytic_body.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/material/material.hpp"

namespace carillon::analytic {

/// One mode. `index`: mode numbers of the body, such as half-waves along both sides.
struct Mode {
  double lambda_rad2_s2 = 0.0;  // omega^2
  double error_cents = 0.0;     // frequency error relative to the theory: 0 for a formula, an estimate for a numerical method
  std::array<int, 4> index{};
  std::string name = {};  // "(1, 2)"
};

/// All modes of the theory from zero up to a frequency, without rigid motions, ascending.
struct ModeList {
  std::vector<Mode> modes;
  double complete_below_hz = 0.0;  // no mode is missing below it; lower than requested if the count was limited
};

inline void sort_modes(std::vector<Mode>& modes) {
  std::stable_sort(modes.begin(), modes.end(), [](const Mode& a, const Mode& b) { return a.lambda_rad2_s2 < b.lambda_rad2_s2; });
}

inline double square(double x) { return x * x; }

/// Closed surface, oriented outward, in the frame of the job.
struct ClosedSurface {
  std::vector<Vec3> vertices_m;
  std::vector<Triangle> triangles;
};

/// Vibration of one body by its theory. Invariant: calc_shapes() of modes from list_modes() is mass-normalised over the whole body.
class KnownBody {
 public:
  virtual ~KnownBody() = default;

  /// All modes below `high_hz`; if there are more, at least the lowest `max_modes`. Throws SolveError, InputError (without the job's line).
  virtual ModeList list_modes(double high_hz, std::int64_t max_modes) = 0;
  /// phi [kg^-1/2] of each mode at a point of the body, (modes). Points outside use the nearest point of the rim.
  virtual void calc_shapes(const Vec3& point_m, std::span<const Mode> modes, std::span<Vec3> phi) const = 0;

  /// True if large motion couples the mode: bending or transverse motion.
  virtual bool is_coupled(const Mode&) const { return true; }
  /// Coupling energy of modes from list_modes() that is_coupled() accepts: all but `modes`; membrane_ratio holds the lowest stretching
  /// frequency [Hz]. is_stretch: mean stretch only, one or two rows. No rows: uncoupled.
  virtual bank::QuarticEnergy calc_coupling(std::span<const Mode>, const material::Material&, bool /*is_stretch*/) const { return {}; }

  /// Surface with `grid` intervals along the longest side.
  virtual ClosedSurface make_surface(int grid) const = 0;
  /// Grid intervals for these modes; at most kMaxDefaultGrid for flat bodies.
  virtual int choose_grid(std::span<const Mode> modes) const = 0;

  bank::RigidBody rigid;              // mass and inertia of the real body
  int rigid_modes = 0;                // motions of zero frequency: 6 of a free body
  std::string theory;                 // "Euler-Bernoulli beam, ends free and clamped"
  std::string method;                 // computation of the modes and argument for completeness
  std::vector<std::string> warnings;  // limits of the theory for this body
};

inline constexpr int kMaxDefaultGrid = 80;  // for flat bodies: a multiple of ten, so that tenths of a side are vertices

/// Limit of the number of modes, since a formula may give any number.
inline constexpr double kMaxListed = 100000;

/// Throws InputError if the estimated number of modes up to high_hz is too large. Call before listing them.
void check_mode_count(double count, double high_hz);

/// The body of a job. Throws InputError without the job's line.
std::unique_ptr<KnownBody> make_known_body(const job::AnalyticBody& body, const material::Material& material);

}  // namespace carillon::analytic
