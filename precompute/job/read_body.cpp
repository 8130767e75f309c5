#include "precompute/job/read_body.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>

#include "precompute/job/keys.hpp"
#include "runtime/base/ranges.hpp"

namespace carillon::job {
namespace {

constexpr double kMinOpening = 20.0, kMaxOpening = 340.0;  // [degrees], as in carillon-mesh
constexpr long long kMaxNodes = 20'000'000;

std::vector<std::string> list_shapes() {
  std::vector<std::string> names;
  for (const ShapeKeys& keys : get_shape_keys()) names.emplace_back(keys.shape);
  return names;
}

void read_dimensions(base::Object& body, Body& result) {
  for (const ShapeKeys& keys : get_shape_keys()) {
    if (keys.shape != result.shape) continue;
    for (const std::string& dimension : keys.dimensions) {
      const std::string key = find_dimension_key(dimension);
      if (!body.has(key)) continue;
      if (dimension != "opening-angle") {
        result.dimensions[dimension] = base::read_within(body, key, kMinBodyM, kMaxBodyM);
        continue;
      }
      const double angle = body.number(key);
      if (!(angle >= kMinOpening && angle <= kMaxOpening))
        body.fail(key, fmt::format("must be {:g} to {:g} degrees (180 is a hemisphere), and is {:g}", kMinOpening, kMaxOpening, angle));
      result.dimensions[dimension] = angle;
    }
  }
}

/// Number of nodes or edge length.
void read_mesh_size(base::Object& body, Body& result) {
  result.nodes = body.integer_if("nodes", 4, std::numeric_limits<long long>::max());
  if (result.nodes.value_or(0) > kMaxNodes)
    body.fail("nodes",
              fmt::format("the mesher makes at most {} nodes, not {}; give larger bodies as a \"mesh\" file", kMaxNodes, *result.nodes));
  kMeshSizeKeys.read(body, result);
  if (result.nodes && result.edge_m) body.fail("edge_m", "\"nodes\" is given already; give one of the two");
}

void read_surface(base::Object& body, Body& result) {
  result.surface = body.path("surface");
  kSurfaceKeys.read(body, result);
  if (!result.side.empty() && !result.wall_m) body.fail("side", "is for walls; give the thickness with \"wall_m\"");
  if (result.height_m && result.scale) body.fail("scale", "\"height_m\" gives the size already; give one of them");
}

}  // namespace

std::array<std::array<double, 3>, 2> read_box(base::Object box) {
  const std::array<std::array<double, 3>, 2> sides{box.numbers<3>("min"), box.numbers<3>("max")};
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (sides[0][axis] > sides[1][axis]) box.fail("max", "every coordinate of \"max\" must be at least that of \"min\"");
  box.finish();
  return sides;
}

Resources read_resources(base::Object& job) {
  Resources read;
  auto resources = job.object_if("resources");
  if (!resources) return read;
  kResourceKeys.read(*resources, read);
  resources->finish();
  return read;
}

const std::vector<ShapeKeys>& get_shape_keys() {
  static const std::vector<ShapeKeys> keys{{"bar", {"length", "width", "thickness"}},
                                           {"tube", {"length", "outer-radius", "wall"}},
                                           {"plate", {"length", "width", "thickness"}},
                                           {"sphere", {"radius", "wall"}},
                                           {"bowl", {"outer-radius", "wall", "opening-angle"}},
                                           {"box", {"length", "width", "height"}},
                                           {"hollow-box", {"length", "width", "height", "wall"}},
                                           {"cylinder", {"length", "radius"}},
                                           {"disc", {"radius", "thickness"}},
                                           {"ring", {"radius", "thickness"}},
                                           {"cone", {"radius", "top-radius", "height"}}};
  return keys;
}

std::string find_dimension_key(const std::string& dimension) {
  std::string key = dimension;
  std::replace(key.begin(), key.end(), '-', '_');
  return key + (dimension == "opening-angle" ? "_deg" : "_m");
}

Body read_body(base::Object body) {
  Body result;
  result.place = body.find_place("");
  if (body.has("shape") == body.has("surface"))
    body.fail(body.has("shape") ? "surface" : "",
              "a body is a \"shape\" (bar, tube, plate ... with its dimensions) or a \"surface\" (a file); give one of the two");
  if (body.has("shape")) {
    result.shape = body.choice("shape", list_shapes());
    read_dimensions(body, result);
  } else {
    read_surface(body, result);
  }
  read_mesh_size(body, result);
  body.finish();
  return result;
}

Body read_short_shape(base::Object shape) {
  const std::vector<std::string> keys = shape.keys(), names = list_shapes();
  if (keys.size() != 1)
    shape.fail("", fmt::format("must have one shape with its dimensions, {{\"bowl\": {{...}}}}, and has {}", keys.size()));
  if (std::find(names.begin(), names.end(), keys[0]) == names.end()) {
    const std::string near = base::find_nearest(keys[0], names);
    shape.fail(keys[0], fmt::format("is not a shape{}; shapes: {}", near.empty() ? "" : fmt::format(", did you mean \"{}\"?", near),
                                    fmt::join(names, ", ")));
  }
  Body result;
  base::Object body = shape.object(keys[0]);
  result.place = body.find_place("");
  result.shape = keys[0];
  read_dimensions(body, result);
  read_mesh_size(body, result);
  body.finish();
  return result;
}

}  // namespace carillon::job
