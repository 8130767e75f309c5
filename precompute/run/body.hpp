// Stages "read" and "partition": the mesh of the body, from a file, a shape or a surface, distributed over the ranks.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "precompute/job/cost/problem_size.hpp"
#include "precompute/run/run.hpp"
#include "precompute/run/stages.hpp"

namespace carillon::run {

/// The job's key for the unit of its mesh, with a suggested value, for messages about the size of the body.
std::string describe_scale_key(const job::JobSpec& job);

/// Number of modes to compute: more than `max_modes`, so that the lowest corrected ones are reliable; nullopt: all of the band.
std::optional<std::int64_t> find_computed_count(const job::JobSpec& job);

/// Rank 0.
cost::ProblemSize find_problem_size(const Run& run, const Setting& setting, const Body& body);

/// Reads or makes the mesh, checks it, and distributes it; rank 0 frees the whole mesh. Collective. Throws on every rank: InputError naming
/// the file or the job's line, SystemError.
Body make_body(Run& run, const Setting& setting);

}  // namespace carillon::run
