// Scenes for a page: banks side by side, and a loudness probe.
#pragma once

#include <filesystem>
#include <vector>

#include "jobs/front/explore/banks.hpp"
#include "runtime/base/json.hpp"

namespace carillon::explore {

/// Bodies in a row along x on the ground, and a listener in front of them. `names` and `facts`: one entry per body.
base::Json make_row(const std::vector<std::filesystem::path>& files, const std::vector<const BankFacts*>& facts, Up up);

/// The scene with all bodies fixed and, instead of its events, one blow on each at its loudest point. `files`: banks of its bodies.
base::Json make_probe(base::Json scene, const std::vector<std::filesystem::path>& files, const std::vector<const BankFacts*>& facts);

}  // namespace carillon::explore
