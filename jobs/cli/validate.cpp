// carillon validate and carillon study: other programs, started in place of this one.
#include "jobs/cli/shared.hpp"

namespace carillon::cli {

void add_validate(CLI::App& app, Shared& shared, Run& run) {
  auto word = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand("validate",
                                         "Checks a job and its mesh without solving, and predicts its modes, its memory by ranks and its "
                                         "time. Exit code 2: it cannot be used.");
  command->add_option("JOB", *word, "Job file")->required();
  command->callback([&shared, &run, word] {
    run = [&shared, word]() -> int {
      std::vector<std::string> arguments{"--validate"};
      if (shared.json) arguments.emplace_back("--json");
      // A name that begins with a dash is also a file.
      arguments.push_back(word->starts_with('-') ? "./" + *word : *word);
      become("carillon-precompute", arguments);
    };
  });
}

void add_study(CLI::App& app, Shared& shared, Run& run) {
  CLI::App* command = app.add_subcommand(
      "study", "Studies: scaling JOB.json, accuracy -o REPORT, advise BODY --cents 5; carillon study --help lists them and their options");
  command->prefix_command();
  command->set_help_flag();
  command->callback([&shared, &run, command] {
    run = [&shared, command]() -> int {
      std::vector<std::string> arguments = command->remaining();
      if (shared.json) arguments.emplace_back("--json");
      become("carillon-study", arguments);
    };
  });
}

}  // namespace carillon::cli
