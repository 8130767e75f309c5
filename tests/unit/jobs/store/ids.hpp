// Helpers for tests of ids.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <filesystem>
#include <functional>
#include <set>
#include <span>
#include <string>
#include <utility>

#include "tests/support/folder.hpp"

namespace carillon::store::testing {

inline constexpr const char* kSolver = "carillon-precompute 0.1.0 (abc)";
inline constexpr const char* kMaterial =
    R"("material": {"young_modulus_pa": 7e10, "poisson_ratio": 0.33, "density_kg_m3": 2700, "damping": {"rayleigh": {"alpha1_s": 1e-7, "alpha2_per_s": 0.5}}})";

using FindId = std::function<std::string(const std::filesystem::path&)>;
using Case = std::pair<const char*, std::string>;  // description and job; in expect_same() with "FILE|" before the job

inline void expect_same(const tests::Folder& folder, const FindId& find_id, const std::string& id, std::span<const Case> cases) {
  for (const auto& [what, text] : cases) {
    const std::size_t bar = text.find('|');
    EXPECT_EQ(find_id(folder.write(text.substr(0, bar), text.substr(bar + 1))), id) << what;
  }
}

/// Expects distinct ids, and returns them.
inline std::set<std::string> expect_different(const tests::Folder& folder, const FindId& find_id, std::span<const Case> cases) {
  std::set<std::string> ids;
  for (const auto& [what, text] : cases) EXPECT_TRUE(ids.insert(find_id(folder.write("a.json", text))).second) << what;
  return ids;
}

}  // namespace carillon::store::testing
