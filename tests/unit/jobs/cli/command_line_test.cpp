// Parsing of the command line.
#include "jobs/cli/command_line.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "jobs/cli/options.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"

namespace carillon::cli {
namespace {

/// The message of the InputError for these words; empty: none.
std::string find_refusal(std::vector<std::string> words, Shared& shared) {
  words.insert(words.begin(), "carillon");
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  return tests::catch_message<InputError>([&] { (void)parse_command_line(static_cast<int>(argv.size()), argv.data(), shared); });
}

TEST(CommandLine, global_options_before_and_after_the_command) {
  Shared shared;
  EXPECT_EQ(find_refusal({"--store", "a", "status", "--json"}, shared), "");
  EXPECT_EQ(shared.store_option, "a");
  EXPECT_TRUE(shared.json);
}

TEST(CommandLine, unknown_commands_and_options) {
  Shared shared;
  EXPECT_NE(find_refusal({"statsu"}, shared).find("did you mean \"status\"?"), std::string::npos);
  EXPECT_NE(find_refusal({"status", "--bogus"}, shared), "");
  EXPECT_NE(find_refusal({"submit"}, shared), "");
  EXPECT_FALSE(shared.json);
}

TEST(CommandLine, limits_of_numbers) {
  Shared shared;
  EXPECT_NE(find_refusal({"submit", "a.json", "--ranks", "0"}, shared), "");
  for (const char* bad : {"nan", "0", "1e10", "1x"}) EXPECT_NE(find_refusal({"run", "--memory-gb", bad}, shared), "") << bad;
  EXPECT_EQ(find_refusal({"run", "--memory-gb", "2.5"}, shared), "");
  EXPECT_NE(find_refusal({"submit", "a.json", "--pictures"}, shared), "");  // needs --run
}

TEST(CommandLine, place_of_the_command) {
  const auto find = [](std::vector<std::string> words) {
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    return find_command(static_cast<int>(argv.size()), argv.data());
  };
  EXPECT_EQ(find({"carillon", "--store", "x", "--json", "get"}), 4);
  EXPECT_EQ(find({"carillon", "--profile=x", "get"}), 2);
  EXPECT_EQ(find({"carillon", "--help"}), 2);
}

TEST(Options, seconds) {
  EXPECT_EQ(parse_seconds("90"), 90);
  EXPECT_EQ(parse_seconds("1.5m"), 90);
  EXPECT_EQ(parse_seconds("2h"), 7200);
  EXPECT_EQ(parse_seconds("1d"), 86400);
  for (const char* bad : {"", "x", "-1", "0", "1y", "nan", "1e9d"}) EXPECT_THROW(parse_seconds(bad), InputError) << bad;
}

TEST(Options, rows_keep_values_without_an_option) {
  registry::Job job{store::hash_text("a")};
  job.resources = {2, 1.5, 60};
  EXPECT_FALSE(ResourceOptions().apply(job));
  EXPECT_TRUE((ResourceOptions{.ranks = 4, .time_limit = "2m", .engine = ""}.apply(job)));
  EXPECT_EQ(job.resources.ranks, 4);
  EXPECT_EQ(job.resources.memory_gb, 1.5);
  EXPECT_EQ(job.resources.time_limit_s, 120);
  job.slurm_job = "12";  // stays in Slurm
  EXPECT_TRUE((ResourceOptions{.time_limit = "", .engine = "slurm"}.apply(job)));
  EXPECT_EQ(job.engine, store::JobEngine::local);
}

}  // namespace
}  // namespace carillon::cli
