// The figure of a hard case: held to its bound, and written down for the table of docs/reports/stability.md.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <limits>
#include <sstream>
#include <string>

namespace carillon::hard {

/// The number in the variable of the environment that mpirun sets, or `otherwise`.
inline int get_count(const char* variable, int otherwise) {
  const char* text = std::getenv(variable);
  return text ? std::atoi(text) : otherwise;
}

/// Where the environment has CARILLON_FIGURES=FOLDER, appends one JSON line to FOLDER/<id>.jsonl, on the first rank alone. `value` and
/// `bound` are JSON.
inline void record(const std::string& id, const std::string& part, const std::string& value, const std::string& bound) {
  const char* folder = std::getenv("CARILLON_FIGURES");
  if (!folder || get_count("OMPI_COMM_WORLD_RANK", 0) != 0) return;
  std::filesystem::create_directories(folder);
  std::ostringstream line;  // one write, so that lines of tests that run side by side stay whole
  line << R"({"case": ")" << id << R"(", "part": ")" << part << R"(", "value": )" << value << R"(, "bound": )" << bound << R"(, "ranks": )"
       << get_count("OMPI_COMM_WORLD_SIZE", 1) << "}\n";
  std::ofstream(std::filesystem::path(folder) / (id + ".jsonl"), std::ios::app) << line.str() << std::flush;
}

/// `value` as JSON, to 9 digits; non-finite values become null.
inline std::string to_json(double value) {
  if (!std::isfinite(value)) return "null";
  std::ostringstream text;
  text.precision(9);
  text << value;
  return text.str();
}

/// Holds value to at most bound (NaN and infinity fail) and records it under the case `id`. `part` names a variation within the case.
inline void hold(const std::string& id, double value, double bound, const std::string& part = "") {
  record(id, part, to_json(value), to_json(bound));
  EXPECT_TRUE(std::isfinite(value)) << id << " " << part;
  EXPECT_LE(value, bound) << id << " " << part;
}

/// For refusals and warnings: `message` must contain all of `words` (file, place, remedy). Counts as the figure "refused".
inline void hold_refusal(const std::string& id, const std::string& message, std::initializer_list<std::string> words,
                         const std::string& part = "") {
  record(id, part, "\"refused\"", "\"refused\"");
  for (const auto& word : words)
    EXPECT_NE(message.find(word), std::string::npos) << id << " " << part << ": no \"" << word << "\" in: " << message;
}

}  // namespace carillon::hard
