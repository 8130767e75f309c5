// Pictures of modes, by carillon-draw.
#pragma once

#include <filesystem>
#include <string>

namespace carillon::report {

struct Drawing {
  std::string fault;  // why there is no picture, one sentence without a full stop; empty: drawn
};

/// Runs `program` (empty: carillon-draw next to this program, else in PATH) with a time limit; it ends with this process. The picture is a
/// complete PNG or missing.
Drawing draw_modes(const std::filesystem::path& program, const std::filesystem::path& bank, int modes, const std::filesystem::path& picture,
                   double limit_s);

}  // namespace carillon::report
