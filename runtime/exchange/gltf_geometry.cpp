#include "runtime/exchange/gltf_geometry.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "runtime/base/vector.hpp"

namespace carillon::exchange {
namespace {

constexpr std::size_t kMaxMeshCorners = 30'000'000;

Surface read_mesh(gltf::File& file, base::Object& node) {
  std::vector<base::Object> meshes = file.root().objects("meshes");
  const std::optional<std::size_t> mesh = gltf::find_index(node, "mesh", meshes.size(), "mesh");
  if (!mesh) node.fail("", "a collider takes the mesh of this node, and it has none; name another node or a shape");
  Surface surface;
  for (base::Object& primitive : meshes[*mesh].objects("primitives")) {
    if (primitive.integer_if("mode", 0, 6).value_or(4) != 4) primitive.fail("mode", "must be 4, triangles; export it as triangles");
    base::Object attributes = primitive.object("attributes");
    const gltf::Numbers points = file.read(attributes, "POSITION", "VEC3", gltf::kVertexTypes);
    const std::size_t before = surface.vertices_m.size();
    std::optional<gltf::Numbers> corners;
    if (primitive.has("indices")) corners = file.read(primitive, "indices", "SCALAR", gltf::kIndexTypes);
    const std::size_t count = corners ? corners->count() : points.count();
    if (before + points.count() > kMaxMeshCorners || 3 * surface.triangles.size() + count > kMaxMeshCorners)
      primitive.fail("", "its mesh is too large for a collider; give a simpler one");
    for (std::size_t i = 0; i < points.count(); ++i) {
      const Vec3 p{points.get(i, 0), points.get(i, 1), points.get(i, 2)};
      if (!is_finite(p)) attributes.fail("POSITION", fmt::format("point {} is not finite", i));
      surface.vertices_m.push_back(p);
    }
    if (count % 3 != 0) primitive.fail("indices", fmt::format("{} corners are no whole number of triangles", count));
    for (std::size_t i = 0; i < count; ++i) {
      const double v = corners ? corners->get(i, 0) : static_cast<double>(i);
      if (!(v < static_cast<double>(points.count())))
        primitive.fail("indices", fmt::format("index {} is {}, but there are only {} points", i, v, points.count()));
      if (i % 3 == 0) surface.triangles.emplace_back();
      surface.triangles.back()[i % 3] = static_cast<std::int32_t>(before + static_cast<std::size_t>(v));
    }
  }
  weld(surface);
  return surface;
}

}  // namespace

double read_positive(base::Object& owner, const char* key, double fallback, double low, double high) {
  if (!owner.has(key)) return fallback;
  const double value = owner.number(key);
  if (!(value >= low && value <= high)) owner.fail(key, fmt::format("is {:g}; give {:g} to {:g}", value, low, high));
  return value;
}

Surface read_geometry(gltf::File& file, gltf::Graph& graph, std::vector<base::Object>& shapes, base::Object& geometry) {
  if (geometry.has("shape") == geometry.has("node")) geometry.fail("", "must have one of \"shape\" and \"node\"; give one of them");
  if (const auto node = gltf::find_index(geometry, "node", graph.nodes.size(), "node")) return read_mesh(file, graph.nodes[*node]);
  base::Object& shape = shapes[*gltf::find_index(geometry, "shape", shapes.size(), "shape")];
  const std::string type = shape.choice("type", {"box", "sphere", "cylinder", "capsule"});
  base::Object own = shape.object(type);
  if (type == "box") {
    const Vec3 size = own.numbers<3>("size");
    for (const double x : size)
      if (!(x > 0.0 && x <= kFarthestGltfM))
        own.fail("size", fmt::format("has a side of {:g} m; give more than 0, at most {:g}", x, kFarthestGltfM));
    return make_box(size);
  }
  if (type == "sphere") return make_sphere(read_positive(own, "radius", 0.5, 1e-9, kFarthestGltfM));
  const double height = read_positive(own, "height", 0.5, 1e-9, kFarthestGltfM);
  const double bottom = read_positive(own, "radiusBottom", 0.25, 0.0, kFarthestGltfM),
               top = read_positive(own, "radiusTop", 0.25, 0.0, kFarthestGltfM);
  if (!(std::max(bottom, top) > 0.0)) own.fail("radiusTop", "both radii are 0; give one that is not");
  return type == "cylinder" ? make_cylinder(height, bottom, top) : make_capsule(height, bottom, top);
}

}  // namespace carillon::exchange
