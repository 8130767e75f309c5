// Bodies with known modes: by formulas, semi-analytic methods, or measurement. In a job: "body": {"membrane": {...}}.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "runtime/base/document.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/keys.hpp"

namespace carillon::job {

/// Constraint of an end of a beam or an edge of a plate: none; deflection; deflection and slope; slope.
enum class Edge { free, hinged, clamped, sliding };

/// Along x from the origin, hinged at both ends, moving along y and z. One of tension_n and lowest_hz; diameter_m, mass_kg_m or both.
struct StringBody {
  double length_m = 0.0;
  std::optional<double> tension_n = {};
  std::optional<double> lowest_hz = {};  // of the string without stiffness
  std::optional<double> mass_kg_m = {};
  std::optional<double> diameter_m = {};  // given: the string is stiff, with the material's Young's modulus
};

/// Along x from the origin; width along y, thickness along z, or a diameter.
struct BeamBody {
  double length_m = 0.0;
  std::optional<double> width_m = {}, thickness_m = {}, diameter_m = {};
  std::array<Edge, 2> ends{Edge::free, Edge::free};  // at x = 0 and at x = length
  bool is_timoshenko = false;                        // else Euler-Bernoulli
  bool has_bending = true, has_torsion = true, has_axial = true;
};

/// In the plane z = 0, fixed along its rim. A rectangle has a corner at the origin, length along x, width along y; a circle its centre
/// there; an L is three squares of `side_m`, its inner corner at (side, side).
struct MembraneBody {
  std::string shape = {};                             // "rectangle", "circle", "L" or "polygon"
  double length_m = 0.0, width_m = 0.0;               // rectangle
  double radius_m = 0.0;                              // circle
  double side_m = 0.0;                                // L
  std::vector<std::array<double, 2>> corners_m = {};  // polygon, in order, either way round
  std::optional<double> tension_n_m = {};             // force per length of rim
  std::optional<double> lowest_hz = {};               // alternative to tension_n_m
  std::optional<double> density_kg_m2 = {};           // default: thickness times the material's density
  std::optional<double> thickness_m = {};             // default: density_kg_m2 over the material's density
};

/// Kirchhoff plate in the plane z = 0, placed like a membrane.
struct PlateBody {
  std::string shape = {};  // "rectangle" or "circle"
  double length_m = 0.0, width_m = 0.0, radius_m = 0.0, thickness_m = 0.0;
  std::array<Edge, 4> edges{Edge::free, Edge::free, Edge::free, Edge::free};  // at x = 0, x = length, y = 0, y = width; circle: the first
};

/// Modes of a table, on a box about the measured points.
struct MeasuredBody {
  std::filesystem::path csv = {};  // absolute
  double mass_kg = 0.0;
  std::array<double, 3> size_m{};
};

struct AnalyticBody {
  std::variant<StringBody, BeamBody, MembraneBody, PlateBody, MeasuredBody> kind = {};
  std::optional<int> grid = {};  // intervals of the bank's surface along the longest side; empty: chosen by the program
  std::string place = {};        // "file:line" of the job, for messages
};

/// True if the object under "body" describes such a body.
bool is_analytic(base::Object& body);

/// Reads and validates one. Throws InputError.
AnalyticBody read_analytic(base::Object body);

/// The members of "body" that read_analytic() reads back; paths relative to `folder` if possible.
base::Json write_analytic(const AnalyticBody& body, const std::filesystem::path& folder);

/// Reference of the keys, one table per kind of body.
std::vector<base::KeyTable> describe_analytic_keys();

/// "string", "beam", "membrane", "plate" or "modes_csv".
const char* get_key(const AnalyticBody& body);
/// Default material; empty: required in the job.
const char* get_default_material(const AnalyticBody& body);

const char* to_text(Edge edge);

}  // namespace carillon::job
