// carillon validate and carillon study: other programs, started in place of this one.
#include <filesystem>
#include <string>
#include <vector>

#include "jobs/cli/commands.hpp"
#include "jobs/store/order.hpp"
#include "precompute/job/simulation.hpp"
#include "runtime/base/file.hpp"

namespace carillon::cli {

int run_validate(Shared& shared, const ValidateOptions& options) {
  std::vector<std::string> arguments{"--validate"};
  if (shared.json) arguments.emplace_back("--json");
  // A name that begins with a dash is also a file.
  arguments.push_back(options.word.starts_with('-') ? "./" + options.word : options.word);
  std::error_code error;
  const bool is_file = std::filesystem::is_regular_file(options.word, error);
  const bool is_simulation = is_file && job::is_simulation(base::read_file(options.word, "job file", store::kMaxJobBytes));
  become(is_simulation ? "carillon-simulate" : "carillon-precompute", arguments);
}

int run_study(Shared& shared, const StudyOptions& options) {
  std::vector<std::string> arguments = options.words;
  if (shared.json) arguments.emplace_back("--json");
  become("carillon-study", arguments);
}

}  // namespace carillon::cli
