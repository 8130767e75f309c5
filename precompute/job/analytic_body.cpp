#include "precompute/job/analytic_body.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace carillon::job {
namespace {

namespace fs = std::filesystem;

using base::kAboveZero;
using base::Limits;
using base::required;

constexpr double kMinLength = 1e-6, kMaxLength = 1e4;  // [m]
constexpr Limits kKnownLength{kMinLength, kMaxLength};
constexpr Limits kKnownMass{1e-15, 1e12};  // [kg], [kg/m], [kg/m^2]
constexpr std::size_t kMaxCorners = 1000;
constexpr std::array<const char*, 5> kKeys{"string", "beam", "membrane", "plate", "modes_csv"};
const std::vector<std::string> kEdgeNames{"free", "hinged", "clamped", "sliding"};  // in the order of Edge

const base::Keys<StringBody> kString{
    {"length_m", &StringBody::length_m, kKnownLength, "length", required},
    {"tension_n", &StringBody::tension_n, kAboveZero, "or `lowest_hz`: tension"},
    {"lowest_hz", &StringBody::lowest_hz, kAboveZero, "or `tension_n`: lowest frequency without stiffness"},
    {"mass_kg_m", &StringBody::mass_kg_m, kKnownMass, "mass per length; default from `diameter_m` and the material"},
    {"diameter_m", &StringBody::diameter_m, kKnownLength, "makes the string stiff; required without `mass_kg_m`"}};
const base::Keys<BeamBody> kBeam{
    {"length_m", &BeamBody::length_m, kKnownLength, "length", required},
    {"width_m", &BeamBody::width_m, kKnownLength, "of a rectangular section"},
    {"thickness_m", &BeamBody::thickness_m, kKnownLength, "of a rectangular section"},
    {"diameter_m", &BeamBody::diameter_m, kKnownLength, "of a circular section"},
    {"ends", "`\"free\"`",
     "`free`, `hinged`, `clamped` or `sliding`: one word, or two for x = 0 and x = length; all but `free` stop torsion and axial motion"},
    {"theory", &BeamBody::is_timoshenko, {"euler-bernoulli", "timoshenko"}, "`timoshenko` has shear and rotary inertia"},
    {"motions", "all", "list of `bending`, `torsion`, `axial`"}};
const base::Keys<MembraneBody> kMembrane{
    {"shape", &MembraneBody::shape, {"rectangle", "circle", "L", "polygon"}, "outline", required},
    {"tension_n_m", &MembraneBody::tension_n_m, kAboveZero, "or `lowest_hz`: force per length of the rim"},
    {"lowest_hz", &MembraneBody::lowest_hz, kAboveZero, "or `tension_n_m`: lowest frequency"},
    {"density_kg_m2", &MembraneBody::density_kg_m2, kKnownMass, "mass per area; default from `thickness_m` and the material"},
    {"thickness_m", &MembraneBody::thickness_m, kKnownLength, "required without `density_kg_m2`"}};
const base::Keys<MembraneBody> kRectangularMembrane{
    {"length_m", &MembraneBody::length_m, kKnownLength, "of a rectangle, along x", required},
    {"width_m", &MembraneBody::width_m, kKnownLength, "of a rectangle, along y", required}};
const base::Keys<MembraneBody> kCircularMembrane{{"radius_m", &MembraneBody::radius_m, kKnownLength, "of a circle", required}};
const base::Keys<MembraneBody> kLMembrane{
    {"side_m", &MembraneBody::side_m, kKnownLength, "of each of the three squares of an L", required}};
const base::Keys<MembraneBody> kPolygonalMembrane{{"corners_m", "required", "of a polygon: 3 to 1000 rows `[x, y]` along the rim"}};
const base::Keys<PlateBody> kPlate{
    {"shape", &PlateBody::shape, {"rectangle", "circle"}, "outline", required},
    {"thickness_m", &PlateBody::thickness_m, kKnownLength, "at most a quarter of the plate", required},
    {"edges", "`\"free\"`", "as `ends`: one word, or four for x = 0, x = length, y = 0, y = width of a rectangle"}};
const base::Keys<PlateBody> kRectangularPlate{{"length_m", &PlateBody::length_m, kKnownLength, "of a rectangle, along x", required},
                                              {"width_m", &PlateBody::width_m, kKnownLength, "of a rectangle, along y", required}};
const base::Keys<PlateBody> kCircularPlate{{"radius_m", &PlateBody::radius_m, kKnownLength, "of a circle", required}};
const base::Keys<MeasuredBody> kMeasured{{"modes_csv", "required", "[file of the modes](#measured-modes)"},
                                         {"mass_kg", &MeasuredBody::mass_kg, kKnownMass, "mass", required},
                                         {"size_m", &MeasuredBody::size_m, kKnownLength, "sides of the box about the points", required}};
const base::Keys<AnalyticBody> kAnyBody{
    {"grid", &AnalyticBody::grid, Limits{2, 1000}, "intervals of the bank's surface along the longest side"}};

const base::Keys<MembraneBody>& find_sides(const MembraneBody& body) {
  return body.shape == "rectangle" ? kRectangularMembrane
         : body.shape == "circle"  ? kCircularMembrane
         : body.shape == "L"       ? kLMembrane
                                   : kPolygonalMembrane;
}
const base::Keys<PlateBody>& find_sides(const PlateBody& body) { return body.shape == "rectangle" ? kRectangularPlate : kCircularPlate; }

/// Throws unless exactly one of two alternative keys is given.
void check_one_of(base::Object& object, const char* first, const char* second) {
  if (object.has(first) == object.has(second))
    object.fail(object.has(second) ? second : "", fmt::format("give one of \"{}\" and \"{}\"", first, second));
}

/// One word for all edges, or a list of N.
template <std::size_t N>
void read_edges(base::Object& object, const char* key, const char* order, std::array<Edge, N>& edges) {
  if (!object.has(key)) return;
  if (order == nullptr || object.has_string(key)) {
    edges.fill(static_cast<Edge>(base::read_word(object, key, kEdgeNames)));
    return;
  }
  const std::vector<base::Entry> entries = object.entries(key, N);
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const auto found = std::find(kEdgeNames.begin(), kEdgeNames.end(), entries[i].text);
    if (found == kEdgeNames.end() || entries.size() != N)
      object.fail(key, fmt::format("must be one word for all, or {} for {}: free, hinged, clamped or sliding", N, order));
    edges[i] = static_cast<Edge>(found - kEdgeNames.begin());
  }
}

StringBody read_string(base::Object object) {
  StringBody body;
  check_one_of(object, "tension_n", "lowest_hz");
  kString.read(object, body);
  if (!body.mass_kg_m && !body.diameter_m)
    object.fail("", "give \"mass_kg_m\" (an ideal string), \"diameter_m\" (a stiff one, its mass from the material's density), or both");
  if (body.diameter_m && *body.diameter_m > 0.5 * body.length_m)
    object.fail("diameter_m", "is more than half of the length, too thick for a string; check the units");
  object.finish();
  return body;
}

void read_motions(base::Object& object, BeamBody& body) {
  if (!object.has("motions")) return;
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

BeamBody read_beam(base::Object object) {
  BeamBody body;
  kBeam.read(object, body);
  if (body.diameter_m ? body.width_m || body.thickness_m : !(body.width_m && body.thickness_m))
    object.fail(body.diameter_m ? "diameter_m" : "",
                "give the section as \"width_m\" and \"thickness_m\" (a rectangle), or \"diameter_m\" (a circle)");
  const double depth = body.diameter_m ? *body.diameter_m : std::max(*body.width_m, *body.thickness_m);
  if (depth > 0.5 * body.length_m)
    object.fail("", "the section is more than half of the length, too thick for beam theory; use \"shape\": \"box\"");
  read_edges(object, "ends", "x = 0 and x = length", body.ends);
  read_motions(object, body);
  object.finish();
  return body;
}

double cross(const std::array<double, 2>& o, const std::array<double, 2>& a, const std::array<double, 2>& b) {
  return (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
}

/// True if sides intersect, or adjacent sides fold back on each other.
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
  check_one_of(object, "tension_n_m", "lowest_hz");
  kMembrane.read(object, body);
  find_sides(body).read(object, body);
  if (body.shape == "polygon") read_corners(object, body);
  if (!body.density_kg_m2 && !body.thickness_m)
    object.fail("", "give \"density_kg_m2\", or \"thickness_m\" and a material, for its density");
  object.finish();
  return body;
}

PlateBody read_plate(base::Object object) {
  PlateBody body;
  kPlate.read(object, body);
  find_sides(body).read(object, body);
  const bool is_rectangle = body.shape == "rectangle";
  read_edges(object, "edges", is_rectangle ? "x = 0, x = length, y = 0 and y = width" : nullptr, body.edges);
  if (body.thickness_m > 0.25 * (is_rectangle ? std::min(body.length_m, body.width_m) : 2.0 * body.radius_m))
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
  kMeasured.read(object, body);
  return body;
}

base::Json write_edges(const auto& edges) {
  base::Json list = base::Json::array();
  for (const Edge edge : edges) list.add(to_text(edge));
  return list;
}

base::Json write_kind(const StringBody& body) { return kString.write(body); }

base::Json write_kind(const BeamBody& body) {
  base::Json motions = base::Json::array();
  if (body.has_bending) motions.add("bending");
  if (body.has_torsion) motions.add("torsion");
  if (body.has_axial) motions.add("axial");
  return kBeam.write(body).set("ends", write_edges(body.ends)).set("motions", motions);
}

base::Json write_kind(const MembraneBody& body) {
  base::Json json = kMembrane.write(body, find_sides(body).write(body));
  for (const auto& corner : body.corners_m) json["corners_m"].add(base::Json::array(corner));
  return json;
}

base::Json write_kind(const PlateBody& body) {
  const bool is_rectangle = body.shape == "rectangle";
  return kPlate.write(body, find_sides(body).write(body))
      .set("edges", is_rectangle ? write_edges(body.edges) : base::Json(to_text(body.edges[0])));
}

}  // namespace

const char* to_text(Edge edge) { return kEdgeNames[static_cast<std::size_t>(edge)].c_str(); }

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
  kAnyBody.read(object, body);
  object.finish();
  return body;
}

base::Json write_analytic(const AnalyticBody& body, const fs::path& folder) {
  base::Json json = base::Json::object();
  if (const auto* measured = std::get_if<MeasuredBody>(&body.kind)) {
    const fs::path relative = measured->csv.lexically_relative(folder);
    json = kMeasured.write(*measured).set("modes_csv", (relative.empty() ? measured->csv : relative).string());
  } else {
    std::visit(
        [&](const auto& kind) {
          if constexpr (!std::is_same_v<std::decay_t<decltype(kind)>, MeasuredBody>) json.set(get_key(body), write_kind(kind));
        },
        body.kind);
  }
  return kAnyBody.write(body, std::move(json));
}

std::vector<base::KeyTable> describe_analytic_keys() {
  std::vector<base::KeyTable> tables;
  for (const char* title : kKeys) tables.push_back({title, {}});
  kString.describe(tables[0]);
  kBeam.describe(tables[1]);
  kMembrane.describe(tables[2]);
  for (const auto* sides : {&kRectangularMembrane, &kCircularMembrane, &kLMembrane, &kPolygonalMembrane}) sides->describe(tables[2]);
  kPlate.describe(tables[3]);
  for (const auto* sides : {&kRectangularPlate, &kCircularPlate}) sides->describe(tables[3]);
  kMeasured.describe(tables[4]);
  for (base::KeyTable& table : tables) kAnyBody.describe(table);
  return tables;
}

}  // namespace carillon::job
