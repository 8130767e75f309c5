// Previews: meshes for a solve in seconds, for bodies without a given accuracy.
#pragma once

#include <cstdint>
#include <functional>

#include "precompute/job/job_spec.hpp"

namespace carillon::job {

inline constexpr std::int64_t kPreviewSolidNodes = 16000, kPreviewWallNodes = 15000, kPreviewShapeNodes = 6000;
inline constexpr std::int64_t kMaxPreviewNodes = 80000;
inline constexpr int kPreviewModes = 200;

/// Sets nodes and number of modes of a preview if the job has neither mesh size nor accuracy; returns true then. Jobs with a mesh file or
/// known modes are unchanged.
bool make_preview(JobSpec& job);

/// Runs `work` with a node count, and again with the possible count if the mesher refuses the first; returns the count used. Throws the
/// exceptions of `work`, and InputError if more than kMaxPreviewNodes are needed; `remedy` ends its message.
std::int64_t run_at_possible_count(std::int64_t nodes, const char* remedy, const std::function<void(std::int64_t nodes)>& work);

}  // namespace carillon::job
