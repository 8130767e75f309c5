// The record of a run as JSON: what was chosen, found and used.
#pragma once

#include <json/forwards.h>

#include <string>
#include <vector>

#include "precompute/run/solve_body.hpp"

namespace carillon::run {

/// What goes under "run" in the resolved job and in the provenance of the bank. Rank 0 only.
Json::Value describe_run(const Run& run, const Setting& setting, const Body& body, const SolvedBody& solved, const Measured& measured);

/// Its part about the program alone: name, version, ranks, phases.
Json::Value describe_program(const Run& run);

/// Materials by region: what they are, how they damp, and their volume.
Json::Value describe_materials(const fem::Materials& materials, const std::vector<double>& volume_m3);

/// One line without spaces, numbers to full double precision.
std::string write_json(const Json::Value& value);

}  // namespace carillon::run
