// Memory layout of fronts: pivots in panels, contribution blocks in strips.
#pragma once

#include <algorithm>
#include <cstdint>

#include "precompute/ldlt/kernels.hpp"
#include "precompute/ldlt/node_links.hpp"

namespace carillon::ldlt {

/// Maximum pivot nodes of a panel, and the division of `width` pivot nodes into panels.
inline constexpr std::int32_t kPanelNodes = 24;
inline std::int32_t count_panels(std::int32_t width) { return (width + kPanelNodes - 1) / kPanelNodes; }
/// First pivot node of panel p. Panels are nearly equal; all but the first have a multiple of 4 nodes, so that tiles of 12 rows behind a
/// panel also start at the start of the contribution block.
inline std::int32_t find_panel_start(std::int32_t width, std::int32_t p) {
  const std::int64_t quads = (static_cast<std::int64_t>(width) + 3) / 4;
  const std::int32_t panels = count_panels(width);
  return p == 0 ? 0 : width - 4 * static_cast<std::int32_t>(quads * (panels - p) / panels);
}
/// Stored numbers of a front: for each panel a triangle and the rows below.
inline std::int64_t count_stored(std::int32_t width, std::int32_t size) {
  std::int64_t stored = 0;
  for (std::int32_t p = 0; p < count_panels(width); ++p) {
    const std::int64_t end = find_panel_start(width, p + 1);
    const std::int64_t nodes = end - find_panel_start(width, p);
    stored += count_triangle(3 * nodes) + 9 * nodes * (size - end);
  }
  return stored;
}

/// Offset of the pivot columns of the current front from the start of its panels. Except for its triangle, a panel is written after its
/// columns have been read, and never overlaps the columns of the next panel.
inline constexpr std::int64_t kColumnsBegin = count_triangle(3 * kPanelNodes);
/// Memory of the columns and panels of a front together.
inline std::int64_t count_front_room(std::int32_t width, std::int32_t size) { return kColumnsBegin + std::int64_t{9} * width * size; }

/// Memory for W of its largest panel.
inline std::int64_t count_wide(std::int32_t width, std::int32_t size) {
  const std::int64_t panel = std::min(width, kPanelNodes);
  return 3 * panel * (3 * static_cast<std::int64_t>(size) + kWideRows);
}

/// Begin of strip b of a contribution block of r rows.
inline std::int64_t find_strip(std::int64_t r, std::int64_t b) { return kStripColumns * (b * r - kStripColumns * (b * (b - 1) / 2)); }
/// Stored numbers of a contribution block of r rows.
inline std::int64_t count_update(std::int64_t r) {
  const std::int64_t whole = r / kStripColumns;
  const std::int64_t rest = r - whole * kStripColumns;
  return find_strip(r, whole) + rest * rest;
}
/// The same from the nodes of its rows.
inline std::int64_t count_update_of(const Ints& nodes) { return count_update(3 * static_cast<std::int64_t>(nodes.size())); }
/// Offset of row 0 of column j.
inline std::int64_t find_update_column(std::int64_t r, std::int64_t j) {
  const std::int64_t first = j / kStripColumns * kStripColumns;
  return find_strip(r, j / kStripColumns) + (j - first) * (r - first) - first;
}

}  // namespace carillon::ldlt
