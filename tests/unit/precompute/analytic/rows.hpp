// Reference tables in data/.
#pragma once

#include <fstream>
#include <string>
#include <vector>

#include "tests/support/paths.hpp"

namespace carillon::analytic {

/// A table of data/ without its header line; cells as text.
inline std::vector<std::vector<std::string>> read_rows(const std::string& name) {
  std::ifstream file(carillon::tests::get_source_dir() + "/tests/unit/precompute/analytic/data/" + name);
  std::vector<std::vector<std::string>> rows;
  for (std::string line; std::getline(file, line);) {
    std::vector<std::string> cells(1);
    bool is_quoted = false;
    for (const char c : line) {
      if (c == '"')
        is_quoted = !is_quoted;
      else if (c == ',' && !is_quoted)
        cells.emplace_back();
      else if (c != '\r')
        cells.back() += c;
    }
    rows.push_back(std::move(cells));
  }
  if (!rows.empty()) rows.erase(rows.begin());
  return rows;
}

}  // namespace carillon::analytic
