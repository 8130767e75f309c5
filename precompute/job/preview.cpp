#include "precompute/job/preview.hpp"

#include <fmt/core.h>

#include "runtime/base/failure.hpp"

namespace carillon::job {

bool make_preview(JobSpec& job) {
  if (!job.body || job.accuracy_cents || job.body->nodes || job.body->edge_m) return false;
  job.body->nodes = !job.body->shape.empty() ? kPreviewShapeNodes : job.body->wall_m ? kPreviewWallNodes : kPreviewSolidNodes;
  if (!job.max_modes) job.max_modes = kPreviewModes;
  return true;
}

std::int64_t run_at_possible_count(std::int64_t nodes, const char* remedy, const std::function<void(std::int64_t)>& work) {
  try {
    work(nodes);
    return nodes;
  } catch (const CountRefusal& error) {
    if (error.get_possible_nodes() > kMaxPreviewNodes)
      throw InputError(fmt::format("{} (a preview has {} nodes at most; {})", error.what(), kMaxPreviewNodes, remedy));
    nodes = error.get_possible_nodes();
  }
  work(nodes);
  return nodes;
}

}  // namespace carillon::job
