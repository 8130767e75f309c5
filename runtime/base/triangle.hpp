// Triangles of surfaces.
#pragma once

#include <array>
#include <cstdint>

namespace carillon {

/// The numbers of its corners among the vertices of a surface.
using Triangle = std::array<std::int32_t, 3>;

}  // namespace carillon
