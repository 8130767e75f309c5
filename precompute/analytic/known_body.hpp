// A body whose modes are known: what each theory gives to the bank.
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

/// One mode. `index` is the body's own numbering, such as half-waves along both sides.
struct Mode {
  double lambda_rad2_s2 = 0.0;  // omega^2
  double error_cents = 0.0;     // of the frequency against the theory: 0 for a formula, an estimate for a numerical method
  std::array<int, 4> index{};
  std::string name = {};  // "(1, 2)"
};

/// All modes of the theory from zero up to a frequency, rigid motions left out, ascending.
struct ModeList {
  std::vector<Mode> modes;
  double complete_below_hz = 0.0;  // no mode is missing below; what the caller asked for, or less where it limited the count
};

inline void sort_modes(std::vector<Mode>& modes) {
  std::stable_sort(modes.begin(), modes.end(), [](const Mode& a, const Mode& b) { return a.lambda_rad2_s2 < b.lambda_rad2_s2; });
}

inline double square(double x) { return x * x; }

/// A closed surface, outward, in the frame of the job.
struct ClosedSurface {
  std::vector<Vec3> vertices_m;
  std::vector<Triangle> triangles;
};

/// Vibration of one body by its theory. Invariant: calc_shapes() of modes that list_modes() gave is mass-normalised over the whole body.
class KnownBody {
 public:
  virtual ~KnownBody() = default;

  /// All modes below `high_hz`; if there are more, at least the lowest `max_modes`. Throws SolveError, InputError (without the place of
  /// the job).
  virtual ModeList list_modes(double high_hz, std::int64_t max_modes) = 0;
  /// phi [kg^-1/2] of each mode at a point of the body, (modes). Points outside count as the nearest one of the rim.
  virtual void calc_shapes(const Vec3& point_m, std::span<const Mode> modes, std::span<Vec3> phi) const = 0;

  /// Whether large motion couples the mode: it bends or swings sideways.
  virtual bool is_coupled(const Mode&) const { return true; }
  /// What couples these modes, which list_modes() gave and is_coupled() takes: all but `modes` and membrane_ratio, in whose place is the
  /// lowest frequency of stretching [Hz]. is_stretch: by the mean stretch alone, one or two rows. Without rows: nothing couples them.
  virtual bank::QuarticEnergy calc_coupling(std::span<const Mode>, const material::Material&, bool /*is_stretch*/) const { return {}; }

  /// The surface with `grid` intervals along the longest side.
  virtual ClosedSurface make_surface(int grid) const = 0;
  /// Intervals that suit modes up to these; flat bodies at most kMaxDefaultGrid.
  virtual int choose_grid(std::span<const Mode> modes) const = 0;

  bank::RigidBody rigid;              // mass and inertia of the real body
  int rigid_modes = 0;                // motions without a frequency: 6 of a free body
  std::string theory;                 // "Euler-Bernoulli beam, ends free and clamped"
  std::string method;                 // how its modes were found, and why none is missing
  std::vector<std::string> warnings;  // where the theory does not describe the body
};

inline constexpr int kMaxDefaultGrid = 80;  // of flat bodies: a multiple of ten, so that tenths of a side are vertices

/// Limit of the number of modes, since a formula may give any number.
inline constexpr double kMaxListed = 100000;

/// Before modes are listed: throws InputError if the estimated number of modes up to high_hz is too large.
void check_mode_count(double count, double high_hz);

/// The body of a job. Throws InputError without the job's place.
std::unique_ptr<KnownBody> make_known_body(const job::AnalyticBody& body, const material::Material& material);

}  // namespace carillon::analytic
