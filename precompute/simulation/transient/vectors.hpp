// Quads as vectors. Not for the inner loops, which are compiled once per instruction set.
#pragma once

#include "precompute/simulation/transient/quad.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::transient {

inline Vec3 to_vector(const Quad& q) { return {q.x, q.y, q.z}; }
inline Quad to_quad(const Vec3& v) { return {v[0], v[1], v[2], 0.0}; }

}  // namespace carillon::transient
