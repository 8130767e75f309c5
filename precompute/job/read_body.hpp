// Reads bodies that are meshed by the program.
#pragma once

#include "precompute/job/job_spec.hpp"

namespace carillon::job {

/// The shapes of carillon-mesh and their dimensions, by its names; a test compares this table with the mesher.
struct ShapeKeys {
  const char* shape;
  std::vector<std::string> dimensions;
};
const std::vector<ShapeKeys>& get_shape_keys();

/// The key of a dimension in a job: "outer-radius" is "outer_radius_m", "opening-angle" is "opening_angle_deg".
std::string find_dimension_key(const std::string& dimension);

/// Reads {"min": [x, y, z], "max": [x, y, z]} and finishes the object. Throws InputError.
std::array<std::array<double, 3>, 2> read_box(base::Object box);

/// The key "resources" of a job. Throws InputError.
Resources read_resources(base::Object& job);

/// Reads and validates a body. Throws InputError.
Body read_body(base::Object body);
/// The same for the short form of a shape: {"bowl": {"outer_radius_m": 0.06, "wall_m": 0.004}}.
Body read_short_shape(base::Object shape);

}  // namespace carillon::job
