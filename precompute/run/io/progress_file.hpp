// The file of --progress: JSON lines, read by others during the run.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "runtime/base/descriptor.hpp"

namespace carillon::io {

/// One line. Unknown members are omitted.
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

/// Appends whole lines, each by one write(2), so that lines of two runs never mix. A line that differs from the last one only in its times
/// is skipped. Not thread-safe.
class ProgressFile {
 public:
  /// Throws InputError if the file is not a regular file or character device, or cannot be opened. A name without a folder must not be a
  /// symbolic link.
  explicit ProgressFile(const std::filesystem::path& file);

  /// False at the first failed write; errno has the reason. Later lines are dropped.
  bool append(const ProgressLine& line);

 private:
  base::Descriptor file_;
  std::string last_;  // line without its times
  bool is_broken_ = false;
};

}  // namespace carillon::io
