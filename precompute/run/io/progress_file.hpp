// The file of --progress: one JSON object a line, which others read during the run.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "runtime/base/descriptor.hpp"

namespace carillon::io {

/// What a line says. Unknown members are left out.
struct ProgressLine {
  std::string phase;
  double percent = 0;  // of the whole run
  std::int64_t modes_done = 0;
  std::optional<std::int64_t> modes_wanted;
  std::optional<double> seconds_left;
  double seconds = 0;  // since the run began
};

/// {"phase": "factor", "percent": 31.40, "modes_done": 0, "modes_wanted": 228, "seconds_left": 8.1, "seconds": 3.70} and a line break.
std::string format_progress(const ProgressLine& line);

/// Appends whole lines, each by one write(2), so that a reader never sees a line of two runs mixed. A line equal to the one before, but for
/// its times, is left out. Not thread-safe.
class ProgressFile {
 public:
  /// Throws InputError when the file is no regular file or character device, or cannot be appended to. A name without a folder may be no
  /// symbolic link.
  explicit ProgressFile(const std::filesystem::path& file);

  /// False when the disk refuses for the first time; errno says why. Later lines are dropped.
  bool append(const ProgressLine& line);

 private:
  base::Descriptor file_;
  std::string last_;  // line without its times
  bool is_broken_ = false;
};

}  // namespace carillon::io
