// A triangle surface: read from a file, repaired until it encloses a volume, and its sharp edges.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"
#include "runtime/base/triangle.hpp"

namespace carillon::mesher {

struct SurfaceReport;  // of surface.hpp, which the slow CGAL files need not see
struct SurfaceOptions;

using Polyline = std::vector<Vec3>;

using Edge = std::array<std::int32_t, 2>;  // the lower point first
inline Edge make_edge(std::int32_t a, std::int32_t b) { return a < b ? Edge{a, b} : Edge{b, a}; }
struct EdgeHash {
  std::size_t operator()(const Edge& e) const {
    return static_cast<std::size_t>(e[0]) * 0x9E3779B97F4A7C15ull ^ (static_cast<std::size_t>(e[1]) * 0xC2B2AE3D27D4EB4Full >> 7);
  }
};

struct TriangleSurface {
  std::vector<Vec3> points;         // (P)
  std::vector<Triangle> triangles;  // (T), counter-clockwise seen from outside once repaired
};

/// Triangles at each edge.
using FaceCounts = std::unordered_map<Edge, int, EdgeHash>;
FaceCounts count_faces(const TriangleSurface& surface);

/// The corners of the axis-aligned box around some points: lowest, highest.
struct Box {
  Vec3 low{}, high{};
  Vec3 extent() const { return high - low; }
  double diagonal() const { return norm(high - low); }
};
Box calc_box(const std::vector<Vec3>& points);
/// Of the points that a triangle has.
Box calc_used_box(const TriangleSurface& surface);

/// "(0.1, 0.2, 0.3) m", for messages.
std::string format_place(const Vec3& p);

/// The enclosed volume by the divergence theorem (signed: positive if the triangles face outward), and the area.
double calc_volume(const TriangleSurface& surface);
double calc_area(const TriangleSurface& surface);

/// How often the surface winds around p: 1 inside a closed surface that faces outward, 0 outside.
double calc_winding(const TriangleSurface& surface, const Vec3& p);

/// The parts of a surface that hang together by corners, each with its own points. part_of (if given): the part of each triangle.
std::vector<TriangleSurface> split_parts(const TriangleSurface& surface, std::vector<std::int32_t>* part_of = nullptr);

/// True if the parts of a closed surface that does not intersect itself lie in each other so that it encloses a body: those that face
/// outward in the open, those that face inward in one of them, and so on.
bool is_nested(const TriangleSurface& surface);

/// Reads OBJ, STL, PLY, OFF, glTF or GLB, chosen by the ending of the name. Polygons become triangles, points at one place become one.
/// Throws InputError if there is no such file, no such format, no triangle, or a coordinate that is no finite number.
TriangleSurface read_surface(const std::filesystem::path& path);
/// The same of the bytes of such a file; `name` stands in messages, `format` is obj, stl, ply, off, gltf or glb. Safe with any bytes.
TriangleSurface parse_surface(std::string_view bytes, const std::string& name, const std::string& format);

/// Makes a closed, consistently outward oriented surface of any heap of triangles: joins points closer than 1e-9 of its size, drops
/// duplicate and degenerate triangles, orients, fills holes up to the size that options.close_holes allows; where that does not lead to a
/// closed manifold, wraps it (CGAL alpha wrap).
/// `offset_m` is how far the returned surface lies outside the true one: 0 unless it was wrapped; the distance field adds it.
/// `clean` is true if no two triangles of it intersect. Throws InputError if it encloses nothing or has too large a hole.
struct RepairedSurface {
  TriangleSurface surface;
  double offset_m = 0;
  bool clean = false;
};
RepairedSurface repair_surface(TriangleSurface surface, const SurfaceOptions& options, SurfaceReport& report);

/// The sharp edges of a repaired surface, joined to curves. An edge is sharp if its two faces turn by more than
/// `sharp_angle_deg`, also when its sides are averaged over `radius`; curves shorter than `shortest_m` are left out
/// unless they are closed or join the ends of longer ones.
/// A closed curve repeats its first point.
std::vector<Polyline> find_sharp_curves(const TriangleSurface& surface, double sharp_angle_deg, double shortest_m, double radius);

/// True if a good part of all edges turns by more than that and many of those end or meet anywhere: noise, of which no edge is one of the
/// body.
bool is_scan(const TriangleSurface& surface, double sharp_angle_deg);

/// Takes the noise off a closed surface without shrinking it, no point farther than farthest_m. Returns how far the farthest one went.
double smooth_scan(TriangleSurface& surface, double farthest_m);

}  // namespace carillon::mesher
