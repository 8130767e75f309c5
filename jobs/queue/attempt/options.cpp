#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "jobs/queue/attempt/attempt.hpp"
#include "runtime/base/whole_range.hpp"

namespace carillon::attempt {

namespace fs = std::filesystem;

void add_options(CLI::App& app, Options& options) {
  app.add_option("WORK", options.work, "work/ab/ID of a store")->required();
  app.add_option("--ranks", options.ranks)->check(base::whole_range(1, kMaxRanks), base::describe_whole_range(1, kMaxRanks));
  app.add_option("--memory-gb", options.memory_gb);
  app.add_option("--memory-limit-gb", options.memory_limit_gb);
  app.add_option("--time-limit-s", options.time_limit_s);
  app.add_option("--token", options.token);
  app.add_option("--mpirun-option", options.mpirun_options, "Argument of mpirun; repeatable")->allow_extra_args(false);
  app.add_flag("--predict", options.is_prediction);
  app.add_flag("--pictures", options.has_pictures);
}

std::vector<std::string> make_arguments(const fs::path& program, const Options& options) {
  std::vector<std::string> arguments{program, "attempt", options.work, "--ranks", std::to_string(options.ranks)};
  const auto add = [&](const char* name, const std::string& value) { arguments.insert(arguments.end(), {name, value}); };
  if (options.memory_gb > 0.0) add("--memory-gb", fmt::format("{}", options.memory_gb));
  if (options.memory_limit_gb > 0.0) add("--memory-limit-gb", fmt::format("{}", options.memory_limit_gb));
  if (options.time_limit_s > 0.0) add("--time-limit-s", fmt::format("{}", options.time_limit_s));
  if (options.is_prediction) arguments.emplace_back("--predict");
  for (const std::string& word : options.mpirun_options) arguments.push_back("--mpirun-option=" + word);
  if (options.has_pictures) arguments.emplace_back("--pictures");
  if (!options.token.empty()) add("--token", options.token);
  if (options.launcher == Launcher::alone) add("--launcher", "alone");
  if (options.launcher == Launcher::mpirun) add("--launcher", "mpirun");
  if (options.launcher == Launcher::srun) add("--launcher", "srun");
  return arguments;
}

}  // namespace carillon::attempt
