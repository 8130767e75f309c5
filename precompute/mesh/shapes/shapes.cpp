// Table of shapes, and its checks.
#include "precompute/mesh/shapes/shapes.hpp"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "precompute/mesh/shapes/plan.hpp"
#include "runtime/base/document.hpp"

namespace carillon::shapes {
namespace {

constexpr double kMinLength = 1e-6;                        // [m]
constexpr double kMaxLength = 1e4;                         // [m]
constexpr double kMinConeRatio = 1e-3;                     // of the radii of a truncated cone
constexpr double kMaxRingThickness = 0.9;                  // over the diameter of the centre line
constexpr double kMinOpening = 20.0, kMaxOpening = 340.0;  // [degrees]

std::vector<std::string> list_names(const Shape& shape) {
  std::vector<std::string> names;
  for (const Dimension& dimension : shape.dimensions) names.push_back(dimension.name);
  return names;
}

// "; did you mean 'x'?" or the list of known names.
std::string suggest(std::string_view word, const std::vector<std::string>& known) {
  const std::string nearest = base::find_nearest(word, known);
  if (!nearest.empty()) return fmt::format("did you mean '{}'? (known: {})", nearest, fmt::join(known, ", "));
  return fmt::format("known: {}", fmt::join(known, ", "));
}

// Dimensions of an order, checked and completed with defaults.
class Dimensions {
 public:
  Dimensions(const Shape& shape, const std::map<std::string, double>& given) : shape_(shape) {
    const std::vector<std::string> names = list_names(shape);
    for (const auto& [name, value] : given) {
      if (std::find(names.begin(), names.end(), name) == names.end()) {
        throw InputError(fmt::format("{}: it has no dimension '{}'; {}", shape.name, name, suggest(name, names)));
      }
    }
    for (const Dimension& dimension : shape.dimensions) {
      const auto entry = given.find(dimension.name);
      values_[dimension.name] = entry == given.end() ? dimension.fallback : entry->second;
      if (entry != given.end()) check(dimension.name, entry->second);
    }
  }

  double operator[](const std::string& name) const { return values_.at(name); }

  [[noreturn]] void fail(const std::string& name, const std::string& why) const {
    throw InputError(fmt::format("{}: {} is {:g}; {}", shape_.name, name, values_.at(name), why));
  }

 private:
  void check(const std::string& name, double value) const {
    if (name == "opening-angle") {
      if (!(value >= kMinOpening && value <= kMaxOpening)) {
        fail(name, fmt::format("give {} to {} degrees (180 is a hemisphere)", kMinOpening, kMaxOpening));
      }
      return;
    }
    if (!(value > 0.0) || !std::isfinite(value)) fail(name, "give a positive length in metres");
    if (value < kMinLength || value > kMaxLength) {
      fail(name, fmt::format("lengths are metres, from {:g} to {:g}", kMinLength, kMaxLength));
    }
  }

  const Shape& shape_;
  std::map<std::string, double> values_;
};

void check_wall(const Dimensions& dimensions, double room, const std::string& of_what, const std::string& solid) {
  // A cavity thinner than a ten-thousandth of the body has no useful mesh.
  if (dimensions["wall"] > (1.0 - 1e-4) * room) {
    dimensions.fail("wall", fmt::format("it has to be less than {} ({:g} m); give a thinner wall{}", of_what, room, solid));
  }
}

std::vector<Body> plan_shape(const Shape& shape, const Dimensions& d, int order) {
  if (shape.name == "bar" || shape.name == "plate") return {plan_box({d["length"], d["width"], d["thickness"]}, order)};
  if (shape.name == "box") return {plan_box({d["length"], d["width"], d["height"]}, order)};
  if (shape.name == "hollow-box") {
    check_wall(d, 0.5 * std::min({d["length"], d["width"], d["height"]}), "half of the shortest edge", ", or shape box for a solid one");
    return {plan_hollow_box({d["length"], d["width"], d["height"]}, d["wall"], order)};
  }
  if (shape.name == "tube") {
    check_wall(d, d["outer-radius"], "the outer radius", ", or shape cylinder for a solid one");
    return {plan_tube(d["length"], d["outer-radius"], d["wall"], order)};
  }
  if (shape.name == "bowl") {
    check_wall(d, d["outer-radius"], "the outer radius", "");
    return {plan_shell(d["outer-radius"], d["wall"], d["opening-angle"] * std::numbers::pi / 360.0, order)};
  }
  if (shape.name == "cylinder") return plan_cylinder(d["length"], d["radius"], order);
  if (shape.name == "disc") return plan_disc(d["radius"], d["thickness"], order);
  if (shape.name == "ring") {
    if (d["thickness"] > kMaxRingThickness * 2.0 * d["radius"])
      d.fail("thickness", fmt::format("it has to be less than {:g} times the diameter of the centre line ({:g} m), or the hole closes",
                                      kMaxRingThickness, 2.0 * d["radius"]));
    return plan_ring(d["radius"], d["thickness"], order);
  }
  if (shape.name == "cone") {
    const double top = d["top-radius"];
    if (top > 0.0 && (top < kMinConeRatio * d["radius"] || d["radius"] < kMinConeRatio * top))
      d.fail("top-radius",
             fmt::format("the two radii have to be within a factor of {:g}; give no top-radius for a point", 1.0 / kMinConeRatio));
    return plan_cone(d["radius"], top, d["height"], order);
  }
  if (d["wall"] == 0.0) return plan_ball(d["radius"], order);
  check_wall(d, d["radius"], "the radius", ", or none for a solid sphere");
  return {plan_shell(d["radius"], d["wall"], std::numbers::pi, order)};
}

void add_union(mesh::TetMesh& mesh, const std::string& name, const std::vector<std::string>& parts) {
  std::set<std::int32_t> all;
  for (const std::string& part : parts) all.insert(mesh.node_sets.at(part).begin(), mesh.node_sets.at(part).end());
  mesh.node_sets[name].assign(all.begin(), all.end());
}

}  // namespace

const std::vector<Shape>& get_shapes() {
  const std::vector<std::string> faces{"x-min", "x-max", "y-min", "y-max", "z-min", "z-max"};
  static const std::vector<Shape> shapes{
      {"bar", "a bar along x", {{"length", 0.3, "along x"}, {"width", 0.02, "along y"}, {"thickness", 0.01, "along z"}}, faces},
      {"tube",
       "a circular tube along x, open at both ends",
       {{"length", 0.3, "along x"}, {"outer-radius", 0.0125, "radius of the outer surface"}, {"wall", 0.001, "thickness of the wall"}},
       {"end-min", "end-max", "inner", "outer"}},
      {"plate",
       "a flat plate in the x-y plane",
       {{"length", 0.3, "along x"}, {"width", 0.2, "along y"}, {"thickness", 0.005, "along z"}},
       {"x-min", "x-max", "y-min", "y-max", "z-min", "z-max", "edges"}},
      {"sphere",
       "a ball, solid or with a wall",
       {{"radius", 0.05, "radius of the outer surface"}, {"wall", 0.0, "thickness of the wall of a hollow sphere; solid without it"}},
       {"surface (solid)", "inner, outer (hollow)"}},
      {"bowl",
       "a part of a spherical shell, its pole below and its rim above",
       {{"outer-radius", 0.08, "radius of the outer surface"},
        {"wall", 0.004, "thickness of the wall"},
        {"opening-angle", 180.0, "angle that the shell spans, seen from its centre [degrees]; 180 is a hemisphere"}},
       {"inner", "outer", "rim"}},
      {"box", "a solid box", {{"length", 0.1, "along x"}, {"width", 0.08, "along y"}, {"height", 0.06, "along z"}}, faces},
      {"hollow-box",
       "a closed box of six walls",
       {{"length", 0.2, "along x, outside"},
        {"width", 0.15, "along y, outside"},
        {"height", 0.1, "along z, outside"},
        {"wall", 0.005, "thickness of the walls"}},
       faces},
      {"cylinder", "a solid round rod along x", {{"length", 0.3, "along x"}, {"radius", 0.01, "radius"}}, {"end-min", "end-max", "side"}},
      {"disc",
       "a flat round plate in the x-y plane: a coin, a lid",
       {{"radius", 0.05, "radius"}, {"thickness", 0.003, "along z"}},
       {"z-min", "z-max", "edge"}},
      {"ring",
       "a round wire bent to a circle in the x-y plane",
       {{"radius", 0.03, "radius of the circle in the middle of the wire"}, {"thickness", 0.006, "diameter of the wire"}},
       {"surface"}},
      {"cone",
       "a solid cone along z, pointed or cut off",
       {{"radius", 0.03, "radius of the base"},
        {"top-radius", 0.0, "radius of the top of a cone that is cut off; pointed without it"},
        {"height", 0.08, "along z"}},
       {"base", "top", "side"}}};
  return shapes;
}

const Shape& find_shape(std::string_view name) {
  std::vector<std::string> names;
  for (const Shape& shape : get_shapes()) {
    if (shape.name == name) return shape;
    names.push_back(shape.name);
  }
  throw InputError(fmt::format("there is no shape '{}'; {}", name, suggest(name, names)));
}

mesh::TetMesh make_shape(const ShapeOptions& options) {
  const Shape& shape = find_shape(options.shape);
  if (options.order != 1 && options.order != 2) throw InputError(fmt::format("{}: order {}; give 1 or 2", shape.name, options.order));
  if (options.target_nodes && options.edge_m) {
    throw InputError(fmt::format("{}: both a node count and an edge length are given; give one of them", shape.name));
  }
  if (options.target_nodes && *options.target_nodes < 1) {
    throw InputError(fmt::format("{}: {} nodes; give a positive count", shape.name, *options.target_nodes));
  }
  if (options.edge_m && (!(*options.edge_m > 0.0) || !std::isfinite(*options.edge_m))) {
    throw InputError(fmt::format("{}: edge {} m; give a positive length", shape.name, *options.edge_m));
  }
  const Dimensions dimensions(shape, options.dimensions);
  std::vector<Body> bodies = plan_shape(shape, dimensions, options.order);
  for (Body& body : bodies) {
    std::size_t least = 0;
    for (std::size_t axis = 1; axis < body.lengths.size(); ++axis)
      if (body.lengths[axis] > 0.0 && body.lengths[axis] < body.lengths[least]) least = axis;
    body.wanted[least] = std::max(body.wanted[least], options.layers);
  }
  std::optional<long long> target = options.target_nodes;
  if (!target && !options.edge_m) target = 10000;
  try {
    mesh::TetMesh mesh = make_best(bodies, options.order, target, options.edge_m);
    if (shape.name == "plate") add_union(mesh, "edges", {"x-min", "x-max", "y-min", "y-max"});
    return mesh;
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: {}", shape.name, error.what()));
  }
}

}  // namespace carillon::shapes
