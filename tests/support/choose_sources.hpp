// Selection of the cases of some source files of a GoogleTest program with the tests of many modules.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <set>
#include <string>
#include <string_view>

namespace carillon::tests {

/// Comma-separated words after `option` ("--sources=").
inline std::set<std::string> read_words(int argc, char** argv, std::string_view option) {
  std::set<std::string> words;
  for (int i = 1; i < argc; ++i) {
    std::string_view rest = argv[i];
    if (rest.substr(0, option.size()) != option) continue;
    rest.remove_prefix(option.size());
    while (!rest.empty()) {
      const std::string_view word = rest.substr(0, rest.find(','));
      words.emplace(word);
      rest.remove_prefix(std::min(rest.size(), word.size() + 1));
    }
  }
  return words;
}

/// Narrows --gtest_filter by `--sources=tests/unit/runtime/bank/pack_test.cpp,...`, `--only=Suite.Case,...` and
/// `--without=Suite.Case,...`. Call it after InitGoogleTest.
/// @return false, with a line on standard error, if a source has no case or a case does not exist.
inline bool choose_sources(int argc, char** argv) {
  const std::set<std::string> sources = read_words(argc, argv, "--sources="), only = read_words(argc, argv, "--only="),
                              without = read_words(argc, argv, "--without=");
  std::set<std::string> unseen = sources;
  unseen.insert(only.begin(), only.end());
  unseen.insert(without.begin(), without.end());
  std::string left_out;
  const testing::UnitTest& tests = *testing::UnitTest::GetInstance();
  for (int i = 0; i < tests.total_test_suite_count(); ++i) {
    const testing::TestSuite& suite = *tests.GetTestSuite(i);
    for (int j = 0; j < suite.total_test_count(); ++j) {
      const std::string_view file = suite.GetTestInfo(j)->file();  // may begin with the path of the clone
      const std::size_t root = file.rfind("tests/");
      const std::string source(root == std::string_view::npos ? file : file.substr(root));
      const std::string name = std::string(suite.name()) + "." + suite.GetTestInfo(j)->name();
      const bool is_chosen =
          (sources.empty() || sources.count(source) > 0) && (only.empty() || only.count(name) > 0) && without.count(name) == 0;
      if (!is_chosen) left_out += name + ":";
      unseen.erase(source);
      unseen.erase(name);
    }
  }
  for (const std::string& word : unseen) std::fprintf(stderr, "this program has no case of %s\n", word.c_str());
  std::string filter = GTEST_FLAG_GET(filter);
  if (!left_out.empty()) filter += (filter.find('-') == std::string::npos ? "-" : ":") + left_out;
  GTEST_FLAG_SET(filter, filter);
  return unseen.empty();
}

}  // namespace carillon::tests
