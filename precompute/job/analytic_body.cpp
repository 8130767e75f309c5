#include "precompute/job/analytic_body.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace carillon::job {
namespace {

namespace fs = std::filesystem;

constexpr double kMinLength = 1e-6, kMaxLength = 1e4;  // [m]
constexpr double kMinMass = 1e-15, kMaxMass = 1e12;    // [kg], [kg/m], [kg/m^2]
constexpr int kMinGrid = 2, kMaxGrid = 1000;
constexpr std::size_t kMaxCorners = 1000;
constexpr std::array<const char*, 5> kKeys{"string", "beam", "membrane", "plate", "modes_csv"};
constexpr std::array<const char*, 4> kEdgeNames{"free", "hinged", "clamped", "sliding"};

double read_length(base::Object& object, const char* key) {
  const double value = object.number(key, base::kPositive);
  if (value < kMinLength || value > kMaxLength)
    object.fail(key, fmt::format("must be from {:g} to {:g} m, and is {:g}", kMinLength, kMaxLength, value));
  return value;
}

double read_mass(base::Object& object, const char* key) {
  const double value = object.number(key, base::kPositive);
  if (value < kMinMass || value > kMaxMass)
    object.fail(key, fmt::format("masses are kilograms, from {:g} to {:g}, and this is {:g}", kMinMass, kMaxMass, value));
  return value;
}

std::optional<double> read_mass_if(base::Object& object, const char* key) {
  return object.has(key) ? std::optional(read_mass(object, key)) : std::nullopt;
}

std::optional<double> read_length_if(base::Object& object, const char* key) {
  return object.has(key) ? std::optional(read_length(object, key)) : std::nullopt;
}

/// Exactly one of two keys that give the same thing.
void read_one_of(base::Object& object, const char* first, std::optional<double>& one, const char* second, std::optional<double>& other) {
  if (object.has(first) == object.has(second))
    object.fail(object.has(second) ? second : "", fmt::format("give one of \"{}\" and \"{}\"", first, second));
  one = object.number_if(first, base::kPositive);
  other = object.number_if(second, base::kPositive);
}

Edge read_edge(base::Object& object, const char* key) {
  const std::string word = object.choice(key, {kEdgeNames.begin(), kEdgeNames.end()});
  return static_cast<Edge>(std::find(kEdgeNames.begin(), kEdgeNames.end(), word) - kEdgeNames.begin());
}

/// One word for all edges, or a list of N.
template <std::size_t N>
std::array<Edge, N> read_edges(base::Object& object, const char* key, const std::string& order, Edge fallback) {
  std::array<Edge, N> edges;
  edges.fill(fallback);
  if (!object.has(key)) return edges;
  if (object.has_string(key)) {
    edges.fill(read_edge(object, key));
    return edges;
  }
  const std::vector<base::Entry> entries = object.entries(key, N);
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const auto found = std::find(kEdgeNames.begin(), kEdgeNames.end(), entries[i].text);
    if (found == kEdgeNames.end() || entries.size() != N)
      object.fail(key, fmt::format("must be one word for all, or {} for {}: free, hinged, clamped or sliding", N, order));
    edges[i] = static_cast<Edge>(found - kEdgeNames.begin());
  }
  return edges;
}

StringBody read_string(base::Object object) {
  StringBody body;
  body.length_m = read_length(object, "length_m");
  read_one_of(object, "tension_n", body.tension_n, "lowest_hz", body.lowest_hz);
  body.mass_kg_m = read_mass_if(object, "mass_kg_m");
  body.diameter_m = read_length_if(object, "diameter_m");
  if (!body.mass_kg_m && !body.diameter_m)
    object.fail("", "give \"mass_kg_m\" (an ideal string), \"diameter_m\" (a stiff one, its mass from the material's density), or both");
  if (body.diameter_m && *body.diameter_m > 0.5 * body.length_m)
    object.fail("diameter_m", "is more than half of the length, so it is no string; check the units");
  object.finish();
  return body;
}

BeamBody read_beam(base::Object object) {
  BeamBody body;
  body.length_m = read_length(object, "length_m");
  body.width_m = read_length_if(object, "width_m");
  body.thickness_m = read_length_if(object, "thickness_m");
  body.diameter_m = read_length_if(object, "diameter_m");
  if (body.diameter_m ? body.width_m || body.thickness_m : !(body.width_m && body.thickness_m))
    object.fail(body.diameter_m ? "diameter_m" : "",
                "give the section as \"width_m\" and \"thickness_m\" (a rectangle), or \"diameter_m\" (a circle)");
  const double depth = body.diameter_m ? *body.diameter_m : std::max(*body.width_m, *body.thickness_m);
  if (depth > 0.5 * body.length_m)
    object.fail("", "the section is more than half of the length, too thick for beam theory; use \"shape\": \"box\"");
  body.ends = read_edges<2>(object, "ends", "x = 0 and x = length", Edge::free);
  body.is_timoshenko = object.choice_or("theory", {"euler-bernoulli", "timoshenko"}, "euler-bernoulli") == "timoshenko";
  if (object.has("motions")) {
    body.has_bending = body.has_torsion = body.has_axial = false;
    for (const base::Entry& entry : object.entries("motions", 3)) {
      bool* const flag = entry.text == "bending"   ? &body.has_bending
                         : entry.text == "torsion" ? &body.has_torsion
                         : entry.text == "axial"   ? &body.has_axial
                                                   : nullptr;
      if (flag == nullptr) object.fail("motions", "must be a list of bending, torsion and axial");
      *flag = true;
    }
    if (!body.has_bending && !body.has_torsion && !body.has_axial) object.fail("motions", "is empty; give bending, torsion or axial");
  }
  object.finish();
  return body;
}

double cross(const std::array<double, 2>& o, const std::array<double, 2>& a, const std::array<double, 2>& b) {
  return (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
}

/// Sides that meet without being neighbours, or neighbours that fold back.
bool has_crossing(const std::vector<std::array<double, 2>>& p) {
  const std::size_t n = p.size();
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = i + 1; j < n; ++j) {
      const auto &a = p[i], &b = p[(i + 1) % n], &c = p[j], &d = p[(j + 1) % n];
      if (j == i + 1 || (i == 0 && j == n - 1)) {
        const auto &tip = j == i + 1 ? b : a, &one = j == i + 1 ? a : b, &other = j == i + 1 ? d : c;
        const double along = (one[0] - tip[0]) * (other[0] - tip[0]) + (one[1] - tip[1]) * (other[1] - tip[1]);
        if (cross(tip, one, other) == 0.0 && along > 0.0) return true;
        continue;
      }
      const auto span = [](double s, double t) { return (s > 0) - (s < 0) != (t > 0) - (t < 0) || s == 0.0 || t == 0.0; };
      if (span(cross(a, b, c), cross(a, b, d)) && span(cross(c, d, a), cross(c, d, b))) {
        const bool is_line = cross(a, b, c) == 0.0 && cross(a, b, d) == 0.0;
        if (!is_line || (std::max(std::min(a[0], b[0]), std::min(c[0], d[0])) <= std::min(std::max(a[0], b[0]), std::max(c[0], d[0])) &&
                         std::max(std::min(a[1], b[1]), std::min(c[1], d[1])) <= std::min(std::max(a[1], b[1]), std::max(c[1], d[1]))))
          return true;
      }
    }
  return false;
}

void read_corners(base::Object& object, MembraneBody& body) {
  for (const auto& row : object.number_rows("corners_m", 2, kMaxCorners)) body.corners_m.push_back({row[0], row[1]});
  auto& p = body.corners_m;
  if (p.size() < 3) object.fail("corners_m", fmt::format("a polygon needs three corners or more, and this has {}", p.size()));
  std::array<double, 2> low = p[0], high = p[0];
  for (const auto& corner : p)
    for (int c = 0; c < 2; ++c) low[c] = std::min(low[c], corner[c]), high[c] = std::max(high[c], corner[c]);
  const double size = std::hypot(high[0] - low[0], high[1] - low[1]);
  if (!(size >= kMinLength && size <= kMaxLength) || std::abs(low[0]) > kMaxLength || std::abs(low[1]) > kMaxLength)
    object.fail("corners_m", fmt::format("the polygon must measure {:g} to {:g} m, and measures {:g}", kMinLength, kMaxLength, size));
  double twice = 0.0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const auto &a = p[i], &b = p[(i + 1) % p.size()];
    if (std::hypot(b[0] - a[0], b[1] - a[1]) < 1e-6 * size)
      object.fail("corners_m", fmt::format("corners {} and {} are one point; remove one", i + 1, (i + 1) % p.size() + 1));
    twice += cross(p[0], a, b);
  }
  if (has_crossing(p)) object.fail("corners_m", "its sides cross or touch each other; give the corners in their order along the rim");
  if (std::abs(twice) < 1e-6 * size * size) object.fail("corners_m", "the polygon has no area");
  if (twice < 0.0) std::reverse(p.begin(), p.end());
}

MembraneBody read_membrane(base::Object object) {
  MembraneBody body;
  body.shape = object.choice("shape", {"rectangle", "circle", "L", "polygon"});
  if (body.shape == "rectangle") {
    body.length_m = read_length(object, "length_m");
    body.width_m = read_length(object, "width_m");
  } else if (body.shape == "circle") {
    body.radius_m = read_length(object, "radius_m");
  } else if (body.shape == "L") {
    body.side_m = read_length(object, "side_m");
  } else {
    read_corners(object, body);
  }
  read_one_of(object, "tension_n_m", body.tension_n_m, "lowest_hz", body.lowest_hz);
  body.density_kg_m2 = read_mass_if(object, "density_kg_m2");
  body.thickness_m = read_length_if(object, "thickness_m");
  if (!body.density_kg_m2 && !body.thickness_m)
    object.fail("", "give \"density_kg_m2\", or \"thickness_m\" and a material, for its density");
  object.finish();
  return body;
}

PlateBody read_plate(base::Object object) {
  PlateBody body;
  body.shape = object.choice("shape", {"rectangle", "circle"});
  double size = 0.0;
  if (body.shape == "rectangle") {
    body.length_m = read_length(object, "length_m");
    body.width_m = read_length(object, "width_m");
    size = std::min(body.length_m, body.width_m);
    body.edges = read_edges<4>(object, "edges", "x = 0, x = length, y = 0 and y = width", Edge::free);
  } else {
    body.radius_m = read_length(object, "radius_m");
    size = 2.0 * body.radius_m;
    if (object.has("edges")) body.edges.fill(read_edge(object, "edges"));
  }
  body.thickness_m = read_length(object, "thickness_m");
  if (body.thickness_m > 0.25 * size)
    object.fail("thickness_m", "is more than a quarter of the plate, too thick for plate theory; use \"shape\": \"plate\"");
  object.finish();
  return body;
}

MeasuredBody read_measured(base::Object& object) {
  MeasuredBody body;
  if (object.has_object("modes_csv"))
    object.fail(
        "modes_csv",
        "names the file, with the other keys next to it: {\"modes_csv\": \"modes.csv\", \"mass_kg\": 0.4, \"size_m\": [0.1, 0.1, 0.1]}");
  body.csv = object.path("modes_csv");
  body.mass_kg = read_mass(object, "mass_kg");
  body.size_m = object.numbers<3>("size_m");
  for (const double length : body.size_m)
    if (!(length >= kMinLength && length <= kMaxLength))
      object.fail("size_m", fmt::format("must be from {:g} to {:g} m each, and one is {:g}", kMinLength, kMaxLength, length));
  return body;
}

base::Json write_edges(const auto& edges) {
  base::Json list = base::Json::array();
  for (const Edge edge : edges) list.add(to_text(edge));
  return list;
}

base::Json write_kind(const StringBody& body) {
  base::Json json = base::Json::object();
  json.set("length_m", body.length_m);
  if (body.tension_n) json.set("tension_n", *body.tension_n);
  if (body.lowest_hz) json.set("lowest_hz", *body.lowest_hz);
  if (body.mass_kg_m) json.set("mass_kg_m", *body.mass_kg_m);
  if (body.diameter_m) json.set("diameter_m", *body.diameter_m);
  return json;
}

base::Json write_kind(const BeamBody& body) {
  base::Json json = base::Json::object(), motions = base::Json::array();
  json.set("length_m", body.length_m);
  if (body.diameter_m)
    json.set("diameter_m", *body.diameter_m);
  else
    json.set("width_m", *body.width_m).set("thickness_m", *body.thickness_m);
  json.set("ends", write_edges(body.ends)).set("theory", body.is_timoshenko ? "timoshenko" : "euler-bernoulli");
  if (body.has_bending) motions.add("bending");
  if (body.has_torsion) motions.add("torsion");
  if (body.has_axial) motions.add("axial");
  return json.set("motions", motions);
}

base::Json write_kind(const MembraneBody& body) {
  base::Json json = base::Json::object();
  json.set("shape", body.shape);
  if (body.shape == "rectangle") json.set("length_m", body.length_m).set("width_m", body.width_m);
  if (body.shape == "circle") json.set("radius_m", body.radius_m);
  if (body.shape == "L") json.set("side_m", body.side_m);
  for (const auto& corner : body.corners_m) json["corners_m"].add(base::Json::array(corner));
  if (body.tension_n_m) json.set("tension_n_m", *body.tension_n_m);
  if (body.lowest_hz) json.set("lowest_hz", *body.lowest_hz);
  if (body.density_kg_m2) json.set("density_kg_m2", *body.density_kg_m2);
  if (body.thickness_m) json.set("thickness_m", *body.thickness_m);
  return json;
}

base::Json write_kind(const PlateBody& body) {
  base::Json json = base::Json::object();
  json.set("shape", body.shape);
  if (body.shape == "rectangle")
    json.set("length_m", body.length_m).set("width_m", body.width_m).set("edges", write_edges(body.edges));
  else
    json.set("radius_m", body.radius_m).set("edges", to_text(body.edges[0]));
  return json.set("thickness_m", body.thickness_m);
}

}  // namespace

const char* to_text(Edge edge) { return kEdgeNames[static_cast<std::size_t>(edge)]; }

const char* get_key(const AnalyticBody& body) { return kKeys[body.kind.index()]; }

const char* get_default_material(const AnalyticBody& body) {
  constexpr std::array<const char*, 5> kMaterials{"steel", "", "polyester film", "", "steel"};
  return kMaterials[body.kind.index()];
}

bool is_analytic(base::Object& body) {
  return std::any_of(kKeys.begin(), kKeys.end(), [&](const char* key) { return body.has(key); });
}

AnalyticBody read_analytic(base::Object object) {
  AnalyticBody body;
  body.place = object.find_place("");
  std::vector<const char*> found;
  for (const char* key : kKeys)
    if (object.has(key)) found.push_back(key);
  for (const char* other : {"shape", "surface"})
    if (object.has(other)) found.push_back(other);
  if (found.size() > 1) object.fail(found[1], fmt::format("\"{}\" is the body already; give one of the two", found[0]));
  const std::string key = found.at(0);
  if (key == "string") body.kind = read_string(object.object(key));
  if (key == "beam") body.kind = read_beam(object.object(key));
  if (key == "membrane") body.kind = read_membrane(object.object(key));
  if (key == "plate") body.kind = read_plate(object.object(key));
  if (key == "modes_csv") body.kind = read_measured(object);
  if (const auto grid = object.integer_if("grid", kMinGrid, kMaxGrid)) body.grid = static_cast<int>(*grid);
  object.finish();
  return body;
}

base::Json write_analytic(const AnalyticBody& body, const fs::path& folder) {
  base::Json json = base::Json::object();
  if (const auto* measured = std::get_if<MeasuredBody>(&body.kind)) {
    const fs::path relative = measured->csv.lexically_relative(folder);
    json.set("modes_csv", (relative.empty() ? measured->csv : relative).string()).set("mass_kg", measured->mass_kg);
    json.set("size_m", base::Json::array(measured->size_m));
  } else {
    std::visit(
        [&](const auto& kind) {
          if constexpr (!std::is_same_v<std::decay_t<decltype(kind)>, MeasuredBody>) json.set(get_key(body), write_kind(kind));
        },
        body.kind);
  }
  if (body.grid) json.set("grid", *body.grid);
  return json;
}

}  // namespace carillon::job
