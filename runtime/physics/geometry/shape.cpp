// Method: the kind of body is determined from the mesh.
#include "runtime/physics/geometry/shape.hpp"

#include <optional>
#include <utility>

#include "runtime/physics/geometry/grid.hpp"
#include "runtime/physics/geometry/lowest.hpp"
#include "runtime/physics/geometry/polyhedron.hpp"
#include "runtime/physics/geometry/samples.hpp"

namespace carillon::geometry {

namespace {

constexpr double kOnFaceRatio = 1e-3;   // fraction of the size: points this near to a face are on it,
constexpr double kFacingCosine = -0.2;  // unless its normal deviates from the given one: cosine

}  // namespace

Shape::Shape(std::span<const Vec3> vertices, std::span<const std::array<std::int32_t, 3>> triangles)
    : mesh_(std::make_unique<const Mesh>(vertices, triangles)), skin_(std::make_unique<const Skin>(*mesh_)) {
  constexpr int kMaxFacets = 26;
  const Vec3 side = mesh_->box.high - mesh_->box.low;
  size_m_ = norm(side);
  thickness_m_ = std::min({side[0], side[1], side[2]});
  middle_m_ = 0.5 * (mesh_->box.low + mesh_->box.high);
  radius_m_ = calc_radius_m(middle_m_);
  if (std::optional<Polyhedron> made = make_polyhedron(*mesh_, *skin_, kMaxFacets)) {
    polyhedron_ = std::make_unique<const Polyhedron>(std::move(*made));
  }
}

Shape::~Shape() = default;

double Shape::get_sag_m() const { return skin_->get_sag_m(); }

double Shape::calc_radius_m(const Vec3& centre) const {
  double max = 0.0;
  for (const Vec3& x : mesh_->vertices) max = std::max(max, norm2(x - centre));
  return std::sqrt(max) + skin_->get_sag_m();
}

double Shape::calc_turning_speed(const Vec3& centre, const Vec3& spin) const {
  Vec3 reach{}, speed{};
  for (int k = 0; k < 3; ++k) reach[k] = skin_->get_sag_m() + std::max(mesh_->box.high[k] - centre[k], centre[k] - mesh_->box.low[k]);
  for (int k = 0; k < 3; ++k) {
    const int l = (k + 1) % 3, m = (k + 2) % 3;
    speed[k] = std::abs(spin[l]) * reach[m] + std::abs(spin[m]) * reach[l];
  }
  return norm(speed);
}

double Shape::calc_reach_m(const Vec3& centre, const Vec3& way) const {
  double reach = std::abs(dot(way, middle_m_ - centre)) + norm(way) * skin_->get_sag_m();
  for (int k = 0; k < 3; ++k) reach += 0.5 * std::abs(way[k]) * (mesh_->box.high[k] - mesh_->box.low[k]);
  return reach;
}

Box Shape::calc_box(const Frame& frame) const {
  const Vec3 middle = to_world(frame, middle_m_), half = 0.5 * (mesh_->box.high - mesh_->box.low);
  Box box{middle, middle};
  for (int i = 0; i < 3; ++i) {
    double reach = skin_->get_sag_m();
    for (int k = 0; k < 3; ++k) reach += std::abs(frame.rotation[i][k]) * half[k];
    box.low[i] -= reach;
    box.high[i] += reach;
  }
  return box;
}

Place Shape::find_place(const Vec3& point, const Vec3& outward, std::int32_t hint) const {
  if (hint >= 0) {
    const Nearest on = mesh_->walk_nearest(point, hint);
    if (on.distance2 < kOnFaceRatio * kOnFaceRatio * size_m_ * size_m_) {
      const Place place = choose_face(on, point, outward);
      if (dot(mesh_->normals[place.triangle], outward) > kFacingCosine) return place;
    }
  }
  const Nearest nearest = mesh_->find_nearest(point, Box::kFar, -1);
  // At edges, corners and under a curved skin several faces are near: choose the one aligned with the given normal.
  const double reach = std::sqrt(nearest.distance2) + 1e-6 * size_m_;
  Nearest best = nearest;
  double max = dot(mesh_->normals[nearest.face], outward);
  mesh_->for_ball(point, reach, [&](int f) {
    const double along = dot(mesh_->normals[f], outward);
    if (along <= max) return;
    const Nearest on = mesh_->find_nearest_on_face(point, f);
    if (on.distance2 > reach * reach) return;
    max = along;
    best = on;
  });
  return {best.face, best.weights, skin_->calc_mean_curvature(best.face, best.weights)};
}

/// Of the faces that meet at a surface point, the one aligned with the given normal.
Place Shape::choose_face(const Nearest& on, const Vec3& point, const Vec3& outward) const {
  constexpr double kEdge = 1e-3;  // fraction of a triangle's height
  int face = on.face, zeros = 0, whole = 0;
  double max = dot(mesh_->normals[face], outward);
  const auto look = [&](int f) {
    const double along = dot(mesh_->normals[f], outward);
    if (along > max) max = along, face = f;
  };
  for (int k = 0; k < 3; ++k) {
    if (on.weights[k] > kEdge) {
      whole = k;
      continue;
    }
    ++zeros;
    look(mesh_->opposite[3 * on.face + (k + 1) % 3] / 3);
  }
  if (zeros == 2) {
    const int start = 3 * on.face + whole;
    for (int e = Mesh::next(mesh_->opposite[start]); e != start; e = Mesh::next(mesh_->opposite[e])) look(e / 3);
  }
  const Vec3 weights = face == on.face ? on.weights : mesh_->find_nearest_on_face(point, face).weights;
  return {face, weights, skin_->calc_mean_curvature(face, weights)};
}

void Shape::prepare(bool meets_bodies) const {
  samples();
  if (meets_bodies && !polyhedron_) grid();
}

const Samples& Shape::samples() const {
  if (!samples_) samples_ = std::make_unique<const Samples>(*mesh_, *skin_);
  return *samples_;
}

LowVertices& Shape::low_vertices() const {
  if (!low_vertices_) low_vertices_ = std::make_unique<LowVertices>();
  return *low_vertices_;
}

const Grid& Shape::grid() const {
  if (!grid_) grid_ = std::make_unique<const Grid>(*mesh_);
  return *grid_;
}

}  // namespace carillon::geometry
