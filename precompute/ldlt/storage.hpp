// How fronts lie in memory: pivots in panels, update matrices in strips.
#pragma once

#include <algorithm>
#include <cstdint>

#include "precompute/ldlt/kernels.hpp"
#include "precompute/ldlt/node_links.hpp"

namespace carillon::ldlt {

/// Pivot nodes eliminated at a time, and how `width` pivot nodes are cut into such panels.
inline constexpr std::int32_t kPanelNodes = 24;
inline std::int32_t count_panels(std::int32_t width) { return (width + kPanelNodes - 1) / kPanelNodes; }
/// First pivot node of panel p. Panels are nearly equal; all but the first have a multiple of 4 nodes, so that tiles of 12 rows behind a
/// panel also begin where the update matrix does.
inline std::int32_t find_panel_start(std::int32_t width, std::int32_t p) {
  const std::int64_t quads = (static_cast<std::int64_t>(width) + 3) / 4;
  const std::int32_t panels = count_panels(width);
  return p == 0 ? 0 : width - 4 * static_cast<std::int32_t>(quads * (panels - p) / panels);
}
/// Numbers stored of a front: of each panel a triangle and the rows below.
inline std::int64_t count_stored(std::int32_t width, std::int32_t size) {
  std::int64_t stored = 0;
  for (std::int32_t p = 0; p < count_panels(width); ++p) {
    const std::int64_t end = find_panel_start(width, p + 1);
    const std::int64_t nodes = end - find_panel_start(width, p);
    stored += count_triangle(3 * nodes) + 9 * nodes * (size - end);
  }
  return stored;
}

/// Where the pivot columns of a front in work begin, counted from where its panels will. Except for its triangle, a panel is written only
/// after its columns have been read, and it never overlaps the columns of the next panel.
inline constexpr std::int64_t kColumnsBegin = count_triangle(3 * kPanelNodes);
/// What the columns and panels of a front take together.
inline std::int64_t count_front_room(std::int32_t width, std::int32_t size) { return kColumnsBegin + std::int64_t{9} * width * size; }

/// Room for the W of one of its panels.
inline std::int64_t count_wide(std::int32_t width, std::int32_t size) {
  const std::int64_t panel = std::min(width, kPanelNodes);
  return 3 * panel * (3 * static_cast<std::int64_t>(size) + kWideRows);
}

/// Where strip b of an update matrix of r rows begins.
inline std::int64_t find_strip(std::int64_t r, std::int64_t b) { return kStripColumns * (b * r - kStripColumns * (b * (b - 1) / 2)); }
/// Numbers stored of it.
inline std::int64_t count_update(std::int64_t r) {
  const std::int64_t whole = r / kStripColumns;
  const std::int64_t rest = r - whole * kStripColumns;
  return find_strip(r, whole) + rest * rest;
}
/// The same for the nodes of its rows.
inline std::int64_t count_update_of(const Ints& nodes) { return count_update(3 * static_cast<std::int64_t>(nodes.size())); }
/// Where row 0 of column j would be.
inline std::int64_t find_update_column(std::int64_t r, std::int64_t j) {
  const std::int64_t first = j / kStripColumns * kStripColumns;
  return find_strip(r, j / kStripColumns) + (j - first) * (r - first) - first;
}

}  // namespace carillon::ldlt
