// Building blocks of the touch search.
#pragma once

#include "runtime/physics/geometry/samples.hpp"
#include "runtime/physics/geometry/touch.hpp"

namespace carillon::geometry {

enum class Feature : std::uint64_t { corner_a = 1, corner_b = 2, edges = 3 };
inline std::uint64_t make_id(Feature feature, int i, int j) {
  return static_cast<std::uint64_t>(feature) << 56 | static_cast<std::uint64_t>(static_cast<std::uint32_t>(i) & 0xfffffffU) << 28 |
         (static_cast<std::uint32_t>(j) & 0xfffffffU);
}

/// Touches of two convex polyhedra: separating axes and clipping. Fills `out`.
void find_polyhedra_touches(const Shape& a, const Frame& frame_a, const Shape& b, const Frame& frame_b, double margin_m, PairMemory& memory,
                            std::vector<Touch>& out);

/// Adds touches between ridges of a and ridges of b.
void cross_ridges(const Shape& a, const Frame& frame_a, const Shape& b, const Frame& frame_b, double reach_m, std::vector<Touch>& out);

/// True if a corner or ridge vertex of the skin may touch a surface with this outward normal (mesh frame) first: no neighbour is lower.
bool carries(const Mesh& mesh, int vertex, const Vec3& normal);

// Second number of the id of a touch that a search missed: at a sample (over the ground at a vertex), at a vertex of a pair.
inline constexpr int kMissedTouchId = 2, kMissedVertexId = 4;

/// Mean curvature of a corner or an edge.
inline double get_sharp_curvature(const Shape& shape, VertexKind kind) {
  return (kind == VertexKind::corner ? 1.0 : 0.5) * shape.get_corner_curvature_per_m();
}
/// Mean curvature of any vertex; on a curved part that of the skin.
double calc_vertex_curvature(const Shape& shape, int vertex);

inline constexpr double kFlatPatchSlope = 0.02;  // slope: tolerance of a flat contact patch
inline constexpr double kParallelSlope = 0.01;   // slope: tolerance of parallel surfaces

inline constexpr int kSearchIterations = 12, kFollowIterations = 2;  // iterations between two curved sides: in a search; from a known point

/// Moves the touch from its current points to where its sides face each other, and sets gap, where, normal and stations. False if the touch
/// left its features (end of a line, or a skin that still descends at `reach_m`).
bool settle(Touch& touch, const Shape& a, const Frame& frame_a, const Shape* b, const Frame& frame_b, double reach_m,
            int iterations = kFollowIterations);

/// Like settle(), from a known point. False for a touch off its features, which keeps its points.
bool follow(Touch& touch, const Shape& a, const Frame& frame_a, const Shape* b, const Frame& frame_b, double reach_m);

/// For a touch at the lowest point of a skin over a plane: true if a tilt of the body by 2e-3 rad would move that point by more than a
/// twentieth of the body's size. True for a lying rod or coin, which stand on several points; false for a coin that leans by more than a
/// degree.
bool is_level(const Touch& touch, const Shape& a, const Frame& frame_a, const Shape* b, const Frame& frame_b);

/// Pose of a in b.
Frame calc_relative(const Frame& a, const Frame& b);
/// Upper bound of the displacement of any point of a between two poses [m].
double calc_way(const Frame& from, const Frame& to, const Shape& a);
/// Records a new search.
void begin_search(PairMemory& memory, const Frame& pose, const Frame& frame_a, const Frame& frame_b, double margin_m, double size_m);
/// True if the candidates of the last search include everything nearer than margin_m now. `pose`: of a in b.
bool recall(const PairMemory& memory, const Frame& pose, const Shape& a, double margin_m);
/// Keeps the deepest of moving touches that have merged; then reduces each patch.
void thin(std::vector<Touch>& touches, double spacing_m, double patch_m);
/// Returns the candidates of the memory within the margin, with ids, settled if the bodies have moved since the search. False, without
/// touches: a candidate was lost.
bool answer(const Shape& a, const Frame& frame_a, const Shape* b, const Frame& frame_b, double margin_m, PairMemory& memory,
            std::vector<Touch>& out);

/// Distance that a search covers beyond the margin, to spare later searches; bodies at a distance of 0 to `size`.
inline double choose_slack(double margin_m, double size_m) { return std::max(margin_m, 1e-3 * size_m); }
inline constexpr double kGuard = 0.25;               // of the size: distance of a separate touch near the plane from the lowest point
inline constexpr double kWalk = 4.0;                 // sample reaches: maximum distance of the lowest point from its sample
inline constexpr double kPatchDistanceRatio = 0.25;  // fraction of the smaller body: minimum distance of separate patches

}  // namespace carillon::geometry
