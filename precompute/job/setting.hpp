// Discretisation and solver tolerance.
#pragma once

#include <cstdint>
#include <optional>

#include "precompute/job/job_spec.hpp"

namespace carillon::job {

struct Setting {
  Element element = Element::T10;
  double tolerance = 1e-8;            // eigensolver: relative residual
  std::optional<std::int64_t> nodes;  // body meshed by the run: target count, mid-side nodes included,
  std::optional<double> edge_m;       // or target edge length; neither: the mesher's default
  int refinements = 0;                // mesh file: uniform refinements, each splits a tetrahedron into eight
  int layers = 1;                     // body of a known shape: minimum of elements through its least thickness
  bool extrudes = false;              // body from a surface: its wall is extruded, as on an earlier mesh
  double expected_hz = 0.0;           // guess of the last mode of "max_modes", from a coarser mesh; 0: none
};

/// Setting of a job without "accuracy_cents".
inline Setting get_setting(const JobSpec& job) {
  Setting setting;
  setting.element = job.element;
  setting.tolerance = job.tolerance;
  if (job.body) {
    if (job.body->nodes) setting.nodes = *job.body->nodes;
    setting.edge_m = job.body->edge_m;
  }
  return setting;
}

}  // namespace carillon::job
