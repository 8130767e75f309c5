#include "tests/support/paths.hpp"

namespace carillon::tests {

const std::string& get_source_dir() {
  static const std::string folder = CARILLON_SOURCE_DIR;
  return folder;
}

const std::string& get_bin_dir() {
  static const std::string folder = CARILLON_BIN_DIR;
  return folder;
}

}  // namespace carillon::tests
