// Triangle surface: reading, repair to a closed surface, sharp edges.
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

struct SurfaceReport;  // in surface.hpp, not needed by the slow CGAL files
struct SurfaceOptions;

using Polyline = std::vector<Vec3>;

using Edge = std::array<std::int32_t, 2>;  // lower point first
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

/// Axis-aligned bounding box of points: lowest, highest corner.
struct Box {
  Vec3 low{}, high{};
  Vec3 extent() const { return high - low; }
  double diagonal() const { return norm(high - low); }
};
Box calc_box(const std::vector<Vec3>& points);
/// Over points used by triangles.
Box calc_used_box(const TriangleSurface& surface);

/// "(0.1, 0.2, 0.3) m", for messages.
std::string format_place(const Vec3& p);

/// Enclosed volume by the divergence theorem (positive for outward triangles), and area.
double calc_volume(const TriangleSurface& surface);
double calc_area(const TriangleSurface& surface);

/// Winding number around p: 1 inside a closed outward surface, 0 outside.
double calc_winding(const TriangleSurface& surface, const Vec3& p);

/// Parts of a surface connected by corners, each with its own points. part_of (if given): part of each triangle.
std::vector<TriangleSurface> split_parts(const TriangleSurface& surface, std::vector<std::int32_t>* part_of = nullptr);

/// True if the parts of a closed surface without self-intersection are nested to enclose a body: outward parts in the open, inward parts
/// inside one of them, and so on.
bool is_nested(const TriangleSurface& surface);

/// Reads OBJ, STL, PLY, OFF, glTF or GLB, chosen by extension. Triangulates polygons and merges coincident points. Throws InputError for a
/// missing file, an unknown format, no triangles, or a non-finite coordinate.
TriangleSurface read_surface(const std::filesystem::path& path);
/// The same from memory; `name` is used in messages, `format` is obj, stl, ply, off, gltf or glb. Safe for untrusted bytes.
TriangleSurface parse_surface(std::string_view bytes, const std::string& name, const std::string& format);

/// Makes a closed, outward oriented surface of a triangle soup: merges points closer than 1e-9 of its size, drops duplicate and degenerate
/// triangles, orients, fills holes up to options.close_holes; if the result is not a closed manifold, wraps it (CGAL alpha wrap).
/// `offset_m`: distance of the returned surface outside the true one, 0 unless wrapped; added by the distance field. `clean`: no triangles
/// intersect. Throws InputError if nothing is enclosed or a hole is too large.
struct RepairedSurface {
  TriangleSurface surface;
  double offset_m = 0;
  bool clean = false;
};
RepairedSurface repair_surface(TriangleSurface surface, const SurfaceOptions& options, SurfaceReport& report);

/// Sharp edges of a repaired surface, joined to curves. An edge is sharp if its two faces turn by more than `sharp_angle_deg`, also with
/// its sides averaged over `radius`; curves shorter than `shortest_m` are dropped unless closed or between the ends of longer ones. A
/// closed curve repeats its first point.
std::vector<Polyline> find_sharp_curves(const TriangleSurface& surface, double sharp_angle_deg, double shortest_m, double radius);

/// True for a noisy surface: many edges turn by more than the angle, and many of them end or meet irregularly.
bool is_scan(const TriangleSurface& surface, double sharp_angle_deg);

/// Smooths a closed surface without shrinkage, no point farther than farthest_m. Returns the largest displacement.
double smooth_scan(TriangleSurface& surface, double farthest_m);

}  // namespace carillon::mesher
