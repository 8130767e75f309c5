// A preview: a body meshed so that its modes are there within seconds, for those who do not say how accurate they are to be.
#pragma once

#include <cstdint>
#include <functional>

#include "precompute/job/job_spec.hpp"

namespace carillon::job {

inline constexpr std::int64_t kPreviewSolidNodes = 16000, kPreviewWallNodes = 15000, kPreviewShapeNodes = 6000;
inline constexpr std::int64_t kMaxPreviewNodes = 80000;
inline constexpr int kPreviewModes = 200;

/// Gives a job that says neither how fine its body is meshed nor how accurate its modes are to be the nodes and the number of modes of a
/// preview. True: it is one. Jobs with a mesh, and bodies whose modes are known, stay as they are.
bool make_preview(JobSpec& job);

/// Runs `work` with a count of nodes, and once more with the count that is possible where the mesher refuses the first. The count that was
/// met. Throws what `work` throws, and InputError where more than kMaxPreviewNodes would be needed; `remedy` ends its message.
std::int64_t run_at_possible_count(std::int64_t nodes, const char* remedy, const std::function<void(std::int64_t nodes)>& work);

}  // namespace carillon::job
