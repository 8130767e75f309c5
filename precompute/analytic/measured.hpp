// Modes from a table of measurements (vdDP96, section 3: parameters may be measured).
#pragma once

#include <filesystem>

#include "precompute/analytic/known_body.hpp"

namespace carillon::analytic {

/// Comma-separated table of modes: a line of column names, then one line per mode; lines that begin with # are skipped. Columns:
///   frequency_hz, and decay_per_s or t60_s
///   gain                motion along the normal for unit modal mass [kg^-1/2], the same everywhere, or
///   "x y z"             gain at that point [m], any number of such columns
struct ModesTable {
  std::vector<double> freq_hz, decay_per_s;
  std::vector<Vec3> points_m;              // empty: one gain everywhere
  std::vector<std::vector<double>> gains;  // (modes)(points, or 1)
};

/// Reads and validates a table. Throws InputError "file:line: ...".
ModesTable read_modes_table(const std::filesystem::path& file);

/// Box around the points, or around the origin, with the modes of the table; each vertex has the gain of the nearest point.
class MeasuredObject : public KnownBody {
 public:
  MeasuredObject(const job::MeasuredBody& body);
  ModeList list_modes(double high_hz, std::int64_t max_modes) override;
  void calc_shapes(const Vec3& point_m, std::span<const Mode> modes, std::span<Vec3> phi) const override;
  ClosedSurface make_surface(int grid) const override;
  int choose_grid(std::span<const Mode>) const override { return 8; }

  const ModesTable& get_table() const { return table_; }

 private:
  ModesTable table_;
  Vec3 centre_m_{}, half_m_{};
};

}  // namespace carillon::analytic
