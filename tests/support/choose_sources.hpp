// The cases of some source files of a GoogleTest program: one program has the tests of many modules.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <set>
#include <string>
#include <string_view>

namespace carillon::tests {

/// Leaves out every case that is in none of the sources of `--sources=tests/unit/runtime/bank/pack_test.cpp,...`, in addition to what
/// --gtest_filter leaves out. Without that argument nothing changes. Call it after InitGoogleTest, which takes its own arguments.
/// @return false, and one line on standard error, where a source has no case.
inline bool choose_sources(int argc, char** argv) {
  constexpr std::string_view kOption = "--sources=";
  std::set<std::string> sources;
  for (int i = 1; i < argc; ++i) {
    if (std::string_view(argv[i]).substr(0, kOption.size()) != kOption) continue;
    std::string_view rest = std::string_view(argv[i]).substr(kOption.size());
    while (!rest.empty()) {
      const std::string_view source = rest.substr(0, rest.find(','));
      sources.emplace(source);
      rest.remove_prefix(std::min(rest.size(), source.size() + 1));
    }
  }
  if (sources.empty()) return true;
  std::set<std::string> unseen = sources;
  std::string left_out;
  const testing::UnitTest& tests = *testing::UnitTest::GetInstance();
  for (int i = 0; i < tests.total_test_suite_count(); ++i) {
    const testing::TestSuite& suite = *tests.GetTestSuite(i);
    for (int j = 0; j < suite.total_test_count(); ++j) {
      const testing::TestInfo& test = *suite.GetTestInfo(j);
      const std::string_view file = test.file();  // may begin with the path to the clone
      const std::size_t root = file.rfind("tests/");
      const std::string source(root == std::string_view::npos ? file : file.substr(root));
      if (sources.count(source) == 0) left_out += std::string(suite.name()) + "." + test.name() + ":";
      unseen.erase(source);
    }
  }
  for (const std::string& source : unseen) std::fprintf(stderr, "--sources: this program has no case of %s\n", source.c_str());
  std::string filter = GTEST_FLAG_GET(filter);
  if (!left_out.empty()) filter += (filter.find('-') == std::string::npos ? "-" : ":") + left_out;
  GTEST_FLAG_SET(filter, filter);
  return unseen.empty();
}

}  // namespace carillon::tests
