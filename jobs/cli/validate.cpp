// carillon validate: replaces this process by another program.
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
  // File names may begin with a dash.
  arguments.push_back(options.word.starts_with('-') ? "./" + options.word : options.word);
  std::error_code error;
  const bool is_file = std::filesystem::is_regular_file(options.word, error);
  const bool is_simulation = is_file && job::is_simulation(base::read_file(options.word, "job file", store::kMaxJobBytes));
  become(is_simulation ? "carillon-simulate" : "carillon-precompute", arguments);
}

}  // namespace carillon::cli
