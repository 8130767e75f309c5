// Method: triangles of all meshes of the scene, transformed by their nodes; skins, morph targets and animations are refused; materials,
//   textures, lights and cameras ignored.
// Source: glTF 2.0 specification, Khronos 2021 (ISO/IEC 12113:2022): chapters 3.5 and 3.7 (nodes, meshes).
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "precompute/mesher/surface_text.hpp"
#include "runtime/base/document.hpp"
#include "runtime/exchange/gltf/file.hpp"
#include "runtime/exchange/gltf/nodes.hpp"

namespace carillon::mesher {
namespace {

constexpr int kMaxDepth = 200;

using gltf::kIdentity;
using gltf::Matrix;

class Gltf {
 public:
  explicit Gltf(gltf::File file) : file_(std::move(file)), root_(file_.root()) {
    meshes_ = root_.objects("meshes");
    nodes_ = root_.objects("nodes");
    is_used_.assign(nodes_.size(), false);
  }

  PolygonSoup read() {
    if (!root_.objects("animations").empty())
      root_.fail("animations", "it is animated, but a body must be rigid; export it without animations");
    std::vector<base::Object> scenes = root_.objects("scenes");
    if (scenes.empty()) {
      for (std::size_t m = 0; m < meshes_.size(); ++m) add_mesh(m, kIdentity);
    } else {
      base::Object& scene = scenes[gltf::find_index(root_, "scene", scenes.size(), "scene").value_or(0)];
      for (const std::size_t node : list_nodes(scene, "nodes")) add_node(node, kIdentity, 0);
    }
    if (soup_.counts.empty())
      throw InputError(fmt::format("{}: no triangles in its scene ({} meshes, {} nodes); export the mesh of the object with it",
                                   file_.name(), meshes_.size(), nodes_.size()));
    return std::move(soup_);
  }

 private:
  /// Indices of a list of nodes.
  std::vector<std::size_t> list_nodes(base::Object& object, const char* key) {
    std::vector<std::size_t> list;
    if (!object.has(key)) return list;
    for (const double number : object.number_list(key, 10'000'000)) {
      if (!(number >= 0 && number < static_cast<double>(nodes_.size()) && number == std::floor(number)))
        object.fail(key, fmt::format("{:g} is not a node; there are {}", number, nodes_.size()));
      list.push_back(static_cast<std::size_t>(number));
    }
    return list;
  }

  void add_node(std::size_t n, const Matrix& parent, int depth) {
    base::Object& node = nodes_[n];
    if (is_used_[n]) node.fail("", fmt::format("node {} has two parents, or is inside itself; export it again", n));
    if (depth > kMaxDepth) node.fail("", fmt::format("nodes are nested {} deep; join them in a modeller", kMaxDepth));
    is_used_[n] = true;
    if (node.has("skin")) node.fail("skin", "its mesh is bent by bones (a skin), but a body must be rigid; apply the pose in a modeller");
    const Matrix own = gltf::multiply(parent, gltf::read_transform(node));
    if (std::optional<base::Object> extensions = node.object_if("extensions"); extensions && extensions->has("EXT_mesh_gpu_instancing"))
      node.fail("extensions", "its mesh is drawn in many places (EXT_mesh_gpu_instancing); make real copies in a modeller");
    if (const auto mesh = gltf::find_index(node, "mesh", meshes_.size(), "mesh")) add_mesh(*mesh, own);
    for (const std::size_t child : list_nodes(node, "children")) add_node(child, own, depth + 1);
  }

  void add_mesh(std::size_t m, const Matrix& matrix) {
    for (base::Object& primitive : meshes_[m].objects("primitives")) {
      constexpr long long kTriangles = 4, kStrip = 5, kFan = 6;
      const long long mode = primitive.integer_if("mode", 0, 6).value_or(kTriangles);
      if (mode < kTriangles) continue;  // points and lines
      if (primitive.has("targets")) primitive.fail("targets", "it has morph targets, but a body must be rigid; apply one in a modeller");
      if (std::optional<base::Object> extensions = primitive.object_if("extensions"); extensions && extensions->has(gltf::kDraco))
        primitive.fail("extensions", fmt::format("its meshes are compressed ({}); export it without compression", gltf::kDraco));
      base::Object attributes = primitive.object("attributes");
      if (!attributes.has("POSITION")) continue;
      const gltf::Numbers points = file_.read(attributes, "POSITION", "VEC3", gltf::kVertexTypes);
      const auto first = static_cast<std::int64_t>(soup_.points.size());
      if (points.count() > static_cast<std::size_t>(3 * kMaxTriangles - first)) refuse_size();
      for (std::size_t i = 0; i < points.count(); ++i) {
        const Vec3 p = gltf::move(matrix, {points.get(i, 0), points.get(i, 1), points.get(i, 2)});
        for (const double x : p)
          if (!(std::abs(x) < kLargestCoordinate))
            primitive.fail("", fmt::format("point {} of mesh {} is not finite or too large: {}", i, m, x));
        soup_.points.push_back(p);
      }
      add_triangles(primitive, m, static_cast<std::int32_t>(first), points.count(),
                    mode == kStrip ? 1
                    : mode == kFan ? 2
                                   : 0,
                    gltf::calc_determinant(matrix) < 0);
    }
  }

  [[noreturn]] void refuse_size() const { throw InputError(fmt::format("{}: {}", file_.name(), kTooManyTriangles)); }

  /// kind: 0 triangles, 1 strip, 2 fan.
  void add_triangles(base::Object& primitive, std::size_t m, std::int32_t first, std::size_t points, int kind, bool is_mirrored) {
    std::optional<gltf::Numbers> indices;
    if (primitive.has("indices")) indices = file_.read(primitive, "indices", "SCALAR", gltf::kIndexTypes);
    const std::size_t corners = indices ? indices->count() : points;
    if (kind == 0 && corners % 3 != 0)
      primitive.fail("", fmt::format("mesh {} has {} corners, which is not a multiple of three; export it again", m, corners));
    if (corners / (kind == 0 ? 3 : 1) + std::ssize(soup_.counts) > kMaxTriangles) refuse_size();
    const auto get = [&](std::size_t i) {
      const std::size_t index = indices ? indices->get(i, 0) : static_cast<double>(i);
      if (index >= points) primitive.fail("indices", fmt::format("mesh {} has {} points, but its index {} is {}", m, points, i, index));
      return first + static_cast<std::int32_t>(index);
    };
    const std::size_t count = kind == 0 ? corners / 3 : corners < 3 ? 0 : corners - 2;
    for (std::size_t t = 0; t < count; ++t) {
      std::array<std::int32_t, 3> triangle = kind == 0    ? std::array{get(3 * t), get(3 * t + 1), get(3 * t + 2)}
                                             : kind == 2  ? std::array{get(0), get(t + 1), get(t + 2)}
                                             : t % 2 == 0 ? std::array{get(t), get(t + 1), get(t + 2)}
                                                          : std::array{get(t + 1), get(t), get(t + 2)};
      if (is_mirrored) std::swap(triangle[1], triangle[2]);
      soup_.add_triangle(triangle[0], triangle[1], triangle[2]);
    }
  }

  gltf::File file_;
  base::Object root_;
  std::vector<base::Object> meshes_, nodes_;
  std::vector<bool> is_used_;
  PolygonSoup soup_;
};

}  // namespace

PolygonSoup parse_gltf(std::string_view bytes, const std::string& name) { return Gltf(gltf::parse_text(bytes, name)).read(); }

PolygonSoup parse_glb(std::string_view bytes, const std::string& name) { return Gltf(gltf::parse_glb(bytes, name)).read(); }

}  // namespace carillon::mesher
