// Where two bodies touch, or a body and the ground.
//
//     find_touches(a, frame_a, b, frame_b, margin, memory, touches);      // at the search, 1 kHz
//     refresh(touch, a, frame_a, &b, frame_b);                            // at each small step
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "runtime/physics/geometry/shape.hpp"

namespace carillon::geometry {

/// What one side of a touch is made of. skin: a curved surface; the touch travels. point: a corner. line: an edge; the touch travels along
/// it. plane: a flat facet (or the ground).
enum class Side : std::uint8_t { skin, point, line, plane };

/// One point at which two bodies touch or are nearer than the margin. b may be the ground (half space).
struct Touch {
  std::uint64_t id = 0;           // of the features; the same as long as the same corner, edge pair or smooth patch pair touches
  Vec3 where_m{}, normal{};       // world; unit, from b to a
  double gap_m = 0.0;             // negative: inside
  Vec3 station_a{}, station_b{};  // surface points in the mesh frames (b: world for the ground)
  double curvature_a_per_m = 0.0, curvature_b_per_m = 0.0;  // mean, for Hertz; 0 flat
  double steepest_per_m = 0.0;                              // the largest curvature of curved sides together: of what rolls; 0 flat
  double rim_m = 0.0;                                       // radius of a rim that touches with a corner of its polygon; 0: none
  bool smooth = false;                                      // the point travels over a curved surface while it rolls: refresh() moves it
  // What refresh() continues from:
  Side side_a = Side::point, side_b = Side::plane;
  Vec3 axis_a{}, axis_b{};       // outward normal of a plane, direction of a line; in the frame of its body (world for the ground)
  int face_a = -1, face_b = -1;  // of the fine mesh, where the skin search begins; -1: none
  bool stays = false;            // of several on what is nearly level: stays about where it is and does not go to the lowest place
};

/// All samples of two bodies within reach_m of the other one, with their distances.
struct NearSamples {
  bool known = false;
  Frame pose;                                                  // a in b, at that time
  double reach_m = 0.0, wanted_m = 0.0;                        // wanted by the last search
  std::array<std::vector<std::pair<int, double>>, 2> samples;  // of a, of b
  Frame last;                                                  // pose at the last search for the deepest,
  double gone_m = 0.0;                                         // and movement until then, to and fro
  std::array<std::vector<double>, 2> least_m;                  // bounds of the samples' gaps, and the movement at which they were found
};

/// The caller's, one per pair: what makes the next search cheap and gives touches their names. Of no meaning to the caller.
class PairMemory {
 public:
  bool known = false;
  Frame searched;                   // a in b, at the last search
  Frame a, b;                       // at that search
  double reach_m = 0.0;             // margin of that search and what was added to it
  std::vector<Touch> candidates;    // of it, nearer than reach_m,
  bool are_followed = false;        // and moved since
  std::vector<Touch> last;          // touches given at the last call, to name those of the next
  std::uint64_t serial = 0;         // of names given
  std::array<int, 2> axis{-1, -1};  // that separated or carried last: kind, index
  NearSamples near;
};

/// Replaces `out` by the touches not further apart than the margin: at most 8 for each patch of contact.
void find_touches(const Shape& a, const Frame& frame_a, const Shape& b, const Frame& frame_b, double margin_m, PairMemory& memory,
                  std::vector<Touch>& out);
/// The ground is the half space z <= height_m. `with_all`: of a polyhedron all corners of facets that face the
/// ground, not its lowest ones alone.
void find_ground_touches(const Shape& a, const Frame& frame_a, double height_m, double margin_m, PairMemory& memory,
                         std::vector<Touch>& out, bool with_all = false);

/// Distance that a touch travels on the more curved surface [m].
inline double calc_travel(const Touch& from, const Touch& to) {
  return from.curvature_a_per_m >= from.curvature_b_per_m ? norm(to.station_a - from.station_a) : norm(to.station_b - from.station_b);
}

/// The deepest place of one body in another, a sample, or in the ground, a vertex.
struct Deepest {
  int place = -1;
  double gap_m = 0.0;  // negative: inside
  bool is_of_a = true;
};
Deepest find_lowest(const Shape& a, const Frame& frame, double height_m);
/// Can a vertex reach the plane through the first touch within `time_s` at the present spin, if it is farther than `far_m` from the line
/// between the first and the last touch? `touches`: mesh frame; `normal`: of the plane, world.
bool may_tip(const Shape& a, const Frame& frame, const Vec3& normal, const Vec3& spin, std::span<const Vec3> touches, double far_m,
             double time_s);
/// None (-1) between two polyhedra, whose touches are complete, and where no sample is deeper than `gap_m`.
Deepest find_deepest(const Shape& a, const Frame& frame_a, const Shape& b, const Frame& frame_b, double gap_m, PairMemory& memory);
/// The touch of such a vertex, at these or other frames.
Touch make_ground_touch(const Shape& a, const Frame& frame, double height_m, int vertex);
Touch make_touch(const Shape& a, const Frame& frame_a, const Shape& b, const Frame& frame_b, const Deepest& at);

/// The same touch a small step later: gap, where, normal and stations follow. b == nullptr: the ground. False: off its surfaces, which
/// have to be searched again.
bool refresh(Touch& touch, const Shape& a, const Frame& frame_a, const Shape* b, const Frame& frame_b);

/// True for a touch with a place about as deep in the other body as its gap, and places on edges and facets within them. Followed touches
/// can come to far sides of curved surfaces, or past the ends of edges.
bool is_overlap(const Touch& touch, const Shape& a, const Frame& frame_a, const Shape& b, const Frame& frame_b);

/// How deep two bodies are inside each other [m]; 0 when they are apart. `where` gets the deepest point (world).
double calc_overlap(const Shape& a, const Frame& frame_a, const Shape& b, const Frame& frame_b, Vec3& where);

}  // namespace carillon::geometry
