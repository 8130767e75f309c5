// The parts of a search for touches.
#pragma once

#include "runtime/physics/geometry/samples.hpp"
#include "runtime/physics/geometry/touch.hpp"

namespace carillon::geometry {

enum class Feature : std::uint64_t { corner_a = 1, corner_b = 2, edges = 3 };
inline std::uint64_t make_id(Feature feature, int i, int j) {
  return static_cast<std::uint64_t>(feature) << 56 | static_cast<std::uint64_t>(static_cast<std::uint32_t>(i) & 0xfffffffU) << 28 |
         (static_cast<std::uint32_t>(j) & 0xfffffffU);
}

/// Two convex polyhedra: separating axes and clipping. Fills `out`.
void find_polyhedra_touches(const Shape& a, const Frame& frame_a, const Shape& b, const Frame& frame_b, double margin_m, PairMemory& memory,
                            std::vector<Touch>& out);

/// Adds touches of ridges of a with ridges of b.
void cross_ridges(const Shape& a, const Frame& frame_a, const Shape& b, const Frame& frame_b, double reach_m, std::vector<Touch>& out);

/// May a corner or ridge vertex of the skin be the first to touch what has this outward normal (mesh frame)? No neighbour is lower.
bool carries(const Mesh& mesh, int vertex, const Vec3& normal);

inline constexpr int kDeepest = 2;  // second number of the name of a touch that a search lacked

/// Mean curvature of a corner or an edge.
inline double get_sharp_curvature(const Shape& shape, VertexKind kind) {
  return (kind == VertexKind::corner ? 1.0 : 0.5) * shape.get_corner_curvature_per_m();
}
/// The same of any vertex, on a curved part that of the skin.
double calc_vertex_curvature(const Shape& shape, int vertex);

inline constexpr double kFlat = 0.02;   // slope: tolerance of a flat contact patch
inline constexpr double kFlush = 0.01;  // slope: tolerance of parallel surfaces

inline constexpr int kFirst = 12, kAgain = 2;  // iterations between two curved sides, in a search and near a place known

/// Moves the touch to where its two sides face each other, from where they are now, and fills gap, where, normal and stations. False where
/// the touch left its features (the end of a line, a skin that continues to fall beyond `reach_m`).
bool settle(Touch& touch, const Shape& a, const Frame& frame_a, const Shape* b, const Frame& frame_b, double reach_m,
            int iterations = kAgain);

/// The same from a known place. False for a touch off its features, which stays at its places.
bool follow(Touch& touch, const Shape& a, const Frame& frame_a, const Shape* b, const Frame& frame_b, double reach_m);

/// Of a touch at the lowest place of a skin over a plane: would that place move by more than a twentieth of the body's size if the body
/// tilted by 2e-3 rad? It would under a rod or a coin that lies, which stand on several places, and not under a coin that leans by more
/// than a degree.
bool is_level(const Touch& touch, const Shape& a, const Frame& frame_a, const Shape* b, const Frame& frame_b);

/// Pose of a in b.
Frame calc_relative(const Frame& a, const Frame& b);
/// Upper bound of the movement of any point of a between two poses [m].
double calc_way(const Frame& from, const Frame& to, const Shape& a);
/// Notes a new search.
void begin_search(PairMemory& memory, const Frame& pose, const Frame& frame_a, const Frame& frame_b, double margin_m, double size_m);
/// Is all that is nearer than margin_m now among the candidates of the last search? `pose`: of a in b.
bool recall(const PairMemory& memory, const Frame& pose, const Shape& a, double margin_m);
/// Keeps of touches that travel and have met one, the deepest; then few of a patch.
void thin(std::vector<Touch>& touches, double spacing_m, double patch_m);
/// Candidates of the memory within the margin, with names, settled where the bodies have moved since the search. False, without touches: a
/// lost candidate.
bool answer(const Shape& a, const Frame& frame_a, const Shape* b, const Frame& frame_b, double margin_m, PairMemory& memory,
            std::vector<Touch>& out);

/// Of two bodies at a distance of 0 to `size`: how far a search looks beyond the margin, so that the next ones can be spared.
inline double choose_slack(double margin_m, double size_m) { return std::max(margin_m, 1e-3 * size_m); }
inline constexpr double kGuard =
    0.25;  // of the size: a place near the plane that is further than this from the lowest one is a touch of its own
inline constexpr double kWalk = 4.0;    // reaches of a sample: how far the lowest place may be, at a tip that no sample is near
inline constexpr double kPatch = 0.25;  // of the smaller body: what is further apart are different patches

}  // namespace carillon::geometry
