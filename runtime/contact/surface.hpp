// The outer surface of a body as a mesh, with the neighbourhoods that tell which features can touch.
#pragma once

#include <SimTKcommon.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "runtime/contact/mesh.hpp"

namespace carillon::contact {

using Vertices = std::vector<std::array<double, 3>>;
using Triangles = std::vector<std::array<std::int32_t, 3>>;

/// An edge that two other faces could rest on: convex, with its two faces.
struct RidgeEdge {
  std::array<int, 2> vertices{};
  std::array<SimTK::Vec3, 2> into_face{};  // unit, in the plane of each face, at right angles to the edge, pointing into the face
};

/// The closed outer surface of a bank, in the frame of its mesh. Inner walls (components of negative volume) are left out: nothing gets
/// there.
class Surface {
 public:
  /// Throws InputError when the surface is empty, open, has more than two triangles at an edge, is degenerate or inside out; the message
  /// names `body` and the place. Vertices in which several fans of triangles meet are split, so vertex numbers are not those of the bank.
  Surface(const Vertices& vertices_m, const Triangles& triangles, const std::string& body);

  const Mesh& mesh() const { return mesh_; }
  const SimTK::Vec3& vertex(int v) const { return mesh_.vertex(v); }
  const std::vector<int>& neighbours(int v) const { return neighbours_[v]; }
  /// Is v a corner of the shape, not merely of its mesh? One amid a flat face or on a straight edge is never the first to touch.
  bool is_corner(int v) const { return is_corner_[v] != 0; }
  /// Ridges of a face, as indices into ridges().
  const std::vector<int>& face_ridges(int face) const { return face_ridges_[face]; }
  const RidgeEdge& ridge(int r) const { return ridges_[r]; }
  /// A ball about a face.
  const SimTK::Vec3& face_middle_m(int face) const { return face_middles_m_[face]; }
  double face_radius_m(int face) const { return face_radii_m_[face]; }

  /// The bank's triangle of a face of mesh(); its corners are in the same order.
  std::int32_t bank_triangle(int face) const { return bank_triangle_[face]; }

  double size_m() const { return size_m_; }            // diagonal of the bounding box
  double thickness_m() const { return thickness_m_; }  // shortest side of the bounding box
  const SimTK::Vec3& middle_m() const { return middle_m_; }
  double radius_m() const { return size_m_ / 2; }  // of a ball about the middle that holds everything

  /// Curvature [1/m] of the surface about a point whose outward normal is `normal`: the paraboloid that fits the vertices nearby best.
  double calc_curvature(const SimTK::Vec3& point, const SimTK::Vec3& normal) const;

 private:
  std::vector<std::int32_t> bank_triangle_;  // before mesh_, whose making fills it
  Mesh mesh_;
  void find_corners();

  std::vector<std::vector<int>> neighbours_;
  std::vector<char> is_corner_;
  std::vector<std::vector<int>> face_ridges_;
  std::vector<RidgeEdge> ridges_;
  std::vector<SimTK::Vec3> face_middles_m_;
  std::vector<double> face_radii_m_;
  SimTK::Vec3 middle_m_{0};
  double size_m_ = 0.0;
  double thickness_m_ = 0.0;
  double edge_m_ = 0.0;  // median length of an edge
};

}  // namespace carillon::contact
