// Bodies that were cut on the page, computed again.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>

#include "runtime/base/error.hpp"

namespace carillon::explore {

inline constexpr std::string_view kRecutPath = "/recut";  // of POST requests
inline constexpr std::size_t kMaxRecutBytes = 256 << 10;  // of their JSON: {"bank": "banks/bar.hdf", "cuts": [[x, y, z, radius, depth]]}

/// Answer to a request; `text` is JSON: {"result": FILE of the folder, which says {"is_running": true} until the result is there} or
/// {"error": ...}.
struct RecutAnswer {
  int status = 202;
  std::string text;
};

/// Runs `carillon tune BANK --cuts` for one request at a time. Files: recut-N/, recut-N.json (its result).
class Recut {
 public:
  /// `originals`: by file name in the folder's banks/, the banks that they were made from, if known.
  Recut(std::filesystem::path folder, std::map<std::string, std::filesystem::path> originals)
      : folder_(std::move(folder)), originals_(std::move(originals)) {}

  RecutAnswer begin(const std::string& request);
  /// True while one is computed; publishes the result of one that has ended.
  bool advance();

 private:
  std::filesystem::path find_bank(const std::string& name) const;

  std::filesystem::path folder_;
  std::map<std::string, std::filesystem::path> originals_;
  pid_t child_ = 0;
  std::filesystem::path result_;
};

}  // namespace carillon::explore
