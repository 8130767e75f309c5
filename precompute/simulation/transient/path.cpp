// Method: quintic Hermite pieces. Source: docs/equations.md E11; Flash and Hogan 1985.
#include "precompute/simulation/transient/path.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "runtime/base/error.hpp"

namespace carillon::transient {

Path::Path(std::vector<PathRow> rows) : rows_(std::move(rows)), slope_m_s_(rows_.size()), bend_m_s2_(rows_.size()) {
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const PathRow& row = rows_[i];
    if (!std::isfinite(row.time_s + row.displacement_m[0] + row.displacement_m[1] + row.displacement_m[2]))
      throw InputError(fmt::format("path of driven nodes: row {} has a value that is not finite", i + 1));
    if (i > 0 && !(row.time_s > rows_[i - 1].time_s))
      throw InputError(
          fmt::format("path of driven nodes: the time {} s of row {} is not after {} s of the row before; sort the rows by time",
                      row.time_s, i + 1, rows_[i - 1].time_s));
  }
  if (!rows_.empty() && (norm(rows_.front().displacement_m) > 0.0 || rows_.front().time_s < 0.0))
    throw InputError(
        "path of driven nodes: the first row is where the nodes are at rest: its time must be 0 s or later, its displacement 0 m");
  for (std::size_t i = 1; i + 1 < rows_.size(); ++i) {
    const double before = rows_[i].time_s - rows_[i - 1].time_s, after = rows_[i + 1].time_s - rows_[i].time_s;
    const Vec3 in = (1.0 / before) * (rows_[i].displacement_m - rows_[i - 1].displacement_m);
    const Vec3 out = (1.0 / after) * (rows_[i + 1].displacement_m - rows_[i].displacement_m);
    slope_m_s_[i] = (1.0 / (before + after)) * (after * in + before * out);
    bend_m_s2_[i] = (2.0 / (before + after)) * (out - in);
  }
}

Vec3 Path::calc(double time_s) const {
  if (rows_.empty() || time_s <= rows_.front().time_s) return {};
  if (time_s >= rows_.back().time_s) return rows_.back().displacement_m;
  const auto next = std::upper_bound(rows_.begin(), rows_.end(), time_s, [](double t, const PathRow& row) { return t < row.time_s; });
  const auto j = static_cast<std::size_t>(next - rows_.begin()), i = j - 1;
  const double span = rows_[j].time_s - rows_[i].time_s, x = (time_s - rows_[i].time_s) / span, y = 1.0 - x;
  // Each polynomial is 1 in one of value, slope and curvature at x = 0; mirrored for x = 1.
  const auto value = [](double a, double b) { return b * b * b * (1.0 + a * (3.0 + 6.0 * a)); };
  const auto slope = [](double a, double b) { return a * b * b * b * (1.0 + 3.0 * a); };
  const auto bend = [](double a, double b) { return 0.5 * a * a * b * b * b; };
  return value(x, y) * rows_[i].displacement_m + value(y, x) * rows_[j].displacement_m + (span * slope(x, y)) * slope_m_s_[i] -
         (span * slope(y, x)) * slope_m_s_[j] + (span * span * bend(x, y)) * bend_m_s2_[i] + (span * span * bend(y, x)) * bend_m_s2_[j];
}

}  // namespace carillon::transient
