// The record of a run as JSON: choices, results and resources.
#pragma once

#include <json/forwards.h>

#include <string>
#include <vector>

#include "precompute/run/run.hpp"
#include "precompute/run/stages.hpp"

namespace carillon::run {

/// "run" of the resolved job and of the bank's provenance. Rank 0 only.
Json::Value describe_run(const Run& run, const Solution& found, const Measured& measured);

/// Its part about the program: name, version, ranks, phases.
Json::Value describe_program(const Run& run);

/// Materials by region: constants, damping, volume.
Json::Value describe_materials(const fem::Materials& materials, const std::vector<double>& volume_m3);

/// One line without spaces, numbers to full double precision.
std::string write_json(const Json::Value& value);

}  // namespace carillon::run
