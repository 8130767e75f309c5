// How a body is cut into elements, and how exactly its modes are found.
#pragma once

#include <cstdint>
#include <optional>

#include "precompute/job/job_spec.hpp"

namespace carillon::job {

struct Setting {
  Element element = Element::T10;
  double tolerance = 1e-8;            // of the eigensolver: relative residual
  std::optional<std::int64_t> nodes;  // of a body that is meshed by the run: target count, mid-side nodes included,
  std::optional<double> edge_m;       // or target edge length; neither: the mesher's default
  int refinements = 0;                // of a mesh file: uniform refinements, each cuts a tetrahedron into eight
};

/// The setting of a job without "accuracy_cents".
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
