// carillon validate and carillon study: other programs, started in place of this one.
#include <string>
#include <vector>

#include "jobs/cli/commands.hpp"

namespace carillon::cli {

int run_validate(Shared& shared, const ValidateOptions& options) {
  std::vector<std::string> arguments{"--validate"};
  if (shared.json) arguments.emplace_back("--json");
  // A name that begins with a dash is also a file.
  arguments.push_back(options.word.starts_with('-') ? "./" + options.word : options.word);
  become("carillon-precompute", arguments);
}

int run_study(Shared& shared, const StudyOptions& options) {
  std::vector<std::string> arguments = options.words;
  if (shared.json) arguments.emplace_back("--json");
  become("carillon-study", arguments);
}

}  // namespace carillon::cli
