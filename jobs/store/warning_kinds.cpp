#include "jobs/store/warning_kinds.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <sstream>

namespace carillon::store {
namespace {

/// The words of a text without numbers, file names and quotations.
std::string find_key(const std::string& text) {
  std::istringstream words(text);
  std::string key;
  for (std::string word; words >> word;) key += word.find_first_of("0123456789/\"#") == std::string::npos ? word + " " : "# ";
  return key;
}

}  // namespace

bool WarningKinds::add(const std::string& job, const std::string& text) {
  const std::string key = find_key(text);
  const auto known = std::find_if(kinds_.begin(), kinds_.end(), [&](const Kind& kind) { return kind.key == key; });
  if (known == kinds_.end()) {
    kinds_.push_back({key, text, job, 1, job});
    return true;
  }
  known->jobs += known->last_job == job ? 0 : 1;
  known->last_job = job;
  return false;
}

std::vector<std::string> WarningKinds::list() const {
  std::vector<Kind> kinds = kinds_;
  std::stable_sort(kinds.begin(), kinds.end(), [](const Kind& a, const Kind& b) { return a.jobs > b.jobs; });
  std::vector<std::string> lines;
  for (const Kind& kind : kinds)
    lines.push_back(kind.jobs == 1 ? fmt::format("in {}: {}", kind.job, kind.text)
                                   : fmt::format("in {} jobs, as in {}: {}", kind.jobs, kind.job, kind.text));
  return lines;
}

}  // namespace carillon::store
