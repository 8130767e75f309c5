// Contact points between two bodies, or between a body and the ground.
//
//     find_touches(a, frame_a, b, frame_b, margin, memory, touches);      // search, 1 kHz
//     refresh(touch, a, frame_a, &b, frame_b);                            // every small step
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "runtime/physics/geometry/shape.hpp"

namespace carillon::geometry {

/// Feature on one side of a touch. skin: curved surface, the touch moves; point: corner; line: edge, the touch moves along it; plane: flat
/// facet or ground.
enum class Side : std::uint8_t { skin, point, line, plane };

/// Point at which two bodies touch or are nearer than the margin. b may be the ground (half space).
struct Touch {
  std::uint64_t id = 0;           // of the features; constant while the same corner, edge pair or smooth patch pair touches
  Vec3 where_m{}, normal{};       // world; unit, from b to a
  double gap_m = 0.0;             // negative: penetration
  Vec3 station_a{}, station_b{};  // surface points in the mesh frames (b: world for the ground)
  double curvature_a_per_m = 0.0, curvature_b_per_m = 0.0;  // mean, for Hertz contact; 0: flat
  double steepest_per_m = 0.0;                              // largest combined curvature of curved sides, for rolling; 0: flat
  double rim_m = 0.0;                                       // radius of a rim that touches with a corner of its polygon; 0: none
  bool smooth = false;                                      // the point moves over a curved surface while rolling; refresh() moves it
  // State for refresh():
  Side side_a = Side::point, side_b = Side::plane;
  Vec3 axis_a{}, axis_b{};       // outward normal of a plane, direction of a line; in the body frame (world for the ground)
  int face_a = -1, face_b = -1;  // of the mesh, start of the skin search; -1: none
  bool stays = false;            // one of several on a nearly level surface: keeps its place instead of moving to the lowest point
};

/// All samples of two bodies within reach_m of the other one, with their distances.
struct NearSamples {
  bool known = false;
  Frame pose;                                                  // a in b, at that time
  double reach_m = 0.0, wanted_m = 0.0;                        // wanted by the last search
  std::array<std::vector<std::pair<int, double>>, 2> samples;  // of a, of b
  Frame last;                                                  // pose at the last deepest-point search
  double gone_m = 0.0;                                         // accumulated movement until then
  std::array<std::vector<double>, 2> least_m;                  // lower bounds of the samples' gaps plus gone_m at the time of measurement
};

/// Search cache of one pair, owned by the caller: speeds up searches and keeps touch ids. Opaque to the caller.
class PairMemory {
 public:
  bool known = false;
  Frame searched;                   // a in b, at the last search
  Frame a, b;                       // at that search
  double reach_m = 0.0;             // margin plus slack of that search
  std::vector<Touch> candidates;    // touches nearer than reach_m,
  bool are_followed = false;        // true: moved since
  std::vector<Touch> last;          // touches of the last call, to carry over ids
  std::uint64_t serial = 0;         // counter of ids
  std::array<int, 2> axis{-1, -1};  // last separating or contact axis: kind, index
  NearSamples near;
};

/// Replaces `out` by the touches nearer than the margin: at most 8 per contact patch.
void find_touches(const Shape& a, const Frame& frame_a, const Shape& b, const Frame& frame_b, double margin_m, PairMemory& memory,
                  std::vector<Touch>& out);
/// The ground is the half space z <= height_m. `with_all`: all corners of the polyhedron facets that face the ground, not only the lowest.
void find_ground_touches(const Shape& a, const Frame& frame_a, double height_m, double margin_m, PairMemory& memory,
                         std::vector<Touch>& out, bool with_all = false);

/// Distance that a touch moves on the more curved surface [m].
inline double calc_travel(const Touch& from, const Touch& to) {
  return from.curvature_a_per_m >= from.curvature_b_per_m ? norm(to.station_a - from.station_a) : norm(to.station_b - from.station_b);
}

/// Deepest point of one body in another or in the ground.
struct Deepest {
  int place = -1;      // a vertex, or a sample
  double gap_m = 0.0;  // negative: penetration
  bool is_of_a = true, is_vertex = true;
};
Deepest find_lowest(const Shape& a, const Frame& frame, double height_m);
/// True if a vertex can reach the plane through the first touch within `time_s` at the present spin and is farther than `far_m` from the
/// line between the first and the last touch. `touches`: mesh frame; `normal`: of the plane, world.
bool may_tip(const Shape& a, const Frame& frame, const Vec3& normal, const Vec3& spin, std::span<const Vec3> touches, double far_m,
             double time_s);
/// None (-1) between two polyhedra, whose searches find all touches, and if no sample and, over a facet of a polyhedron, no lowest vertex
/// is deeper than `gap_m`, or nearer than it if it is positive.
Deepest find_deepest(const Shape& a, const Frame& frame_a, const Shape& b, const Frame& frame_b, double gap_m, PairMemory& memory);
/// Touch of such a vertex, at these or other frames.
Touch make_ground_touch(const Shape& a, const Frame& frame, double height_m, int vertex);
Touch make_touch(const Shape& a, const Frame& frame_a, const Shape& b, const Frame& frame_b, const Deepest& at);

/// Updates gap, where, normal and stations after a small step. b == nullptr: the ground. False: the touch left its surfaces and must be
/// searched again.
bool refresh(Touch& touch, const Shape& a, const Frame& frame_a, const Shape* b, const Frame& frame_b);

/// True if the touch has a point about as deep in the other body as its gap, and points on edges and facets lie within them. Followed
/// touches can move to far sides of curved surfaces or past the ends of edges.
bool is_overlap(const Touch& touch, const Shape& a, const Frame& frame_a, const Shape& b, const Frame& frame_b);

/// Penetration depth of two bodies [m]; 0 if separated. `where`: deepest point (world).
double calc_overlap(const Shape& a, const Frame& frame_a, const Shape& b, const Frame& frame_b, Vec3& where);

}  // namespace carillon::geometry
