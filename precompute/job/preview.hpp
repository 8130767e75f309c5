// A preview: a body meshed so that its modes take seconds, where no accuracy is given.
#pragma once

#include <cstdint>
#include <functional>

#include "precompute/job/job_spec.hpp"

namespace carillon::job {

inline constexpr std::int64_t kPreviewSolidNodes = 16000, kPreviewWallNodes = 15000, kPreviewShapeNodes = 6000;
inline constexpr std::int64_t kMaxPreviewNodes = 80000;
inline constexpr int kPreviewModes = 200;

/// Gives a job without a mesh size and an accuracy the nodes and the number of modes of a preview. True: it is one. Jobs with a mesh, and
/// bodies whose modes are known, stay as they are.
bool make_preview(JobSpec& job);

/// Runs `work` with a count of nodes, and once more with the count that is possible where the mesher refuses the first. The count that was
/// met. Throws what `work` throws, and InputError where more than kMaxPreviewNodes would be needed; `remedy` ends its message.
std::int64_t run_at_possible_count(std::int64_t nodes, const char* remedy, const std::function<void(std::int64_t nodes)>& work);

}  // namespace carillon::job
