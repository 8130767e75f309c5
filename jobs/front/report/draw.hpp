// Pictures of modes, by carillon-draw.
#pragma once

#include <filesystem>
#include <string>

namespace carillon::report {

struct Drawing {
  std::string fault;  // why there is no picture, a sentence without a full stop; empty: there is one
};

/// Starts `program` (empty: carillon-draw next to this program, else in PATH; never a shell) and waits for it, at most `limit_s`, then it
/// is ended; it ends with us as well. The picture is a whole PNG or is not there.
Drawing draw_modes(const std::filesystem::path& program, const std::filesystem::path& bank, int modes, const std::filesystem::path& picture,
                   double limit_s);

}  // namespace carillon::report
