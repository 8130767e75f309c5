// Job scripts (run by a shell) and options of sbatch.
#include "jobs/queue/slurm/script.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "jobs/queue/slurm/command.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/folder.hpp"

namespace carillon::slurm {
namespace {

namespace fs = std::filesystem;

constexpr const char* kNasty = "a  b'c\"d$HOME`id`\\;*&|@PROGRAM@é";

Batch make_batch(const fs::path& root, std::vector<std::string> folders) {
  Batch batch;
  batch.name = "0123456789abcdef0123456789abcdef";
  batch.title = "carillon-0123456789ab";
  batch.comment = "some jobs";
  batch.root = root;
  batch.folders = std::move(folders);
  batch.program = root / "carillon";
  return batch;
}

bool has(const std::vector<std::string>& words, const std::string& word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

TEST(slurm_script, a_shell_reads_a_quoted_word_as_the_same_bytes) {
  for (const std::string& word : std::vector<std::string>{kNasty, "", "'", "''", "-n", "$(touch x)", "\t", "~"}) {
    const Finished finished = run_command({"/bin/sh", "-c", "printf %s " + quote_word(word)});
    EXPECT_EQ(finished.exit_code, 0);
    EXPECT_EQ(finished.output, word);
  }
}

TEST(slurm_script, line_ends_are_refused) {
  for (const std::string& word : std::vector<std::string>{"a\nb", "a\rb", std::string("a\0b", 3)})
    EXPECT_THROW(quote_word(word), InputError);
  EXPECT_THROW(make_script(make_batch("/a\nb", {"ab/abc"}), {}), InputError);
}

// The script is run with a program that prints its arguments, in a folder with special characters in its name.
TEST(slurm_script, each_task_takes_its_own_folder) {
  const tests::Folder folder;
  const fs::path root = folder.path() / kNasty;
  fs::create_directories(root);
  std::ofstream(root / "carillon") << "#!/bin/sh\nprintf '%s\\n' \"$@\"\n";
  fs::permissions(root / "carillon", fs::perms::owner_all);
  Batch batch = make_batch(root, {"ab/ab1", "cd/cd2", "ef/ef3"});
  batch.ranks = 3;
  batch.memory_gb = 1.5;
  queue::SlurmSettings settings;
  settings.prologue = {"echo 'before all'", "GREETING=hello; export GREETING"};
  const std::string script = make_script(batch, settings);
  for (int task = 0; task < 3; ++task) {
    const Finished finished = run_command({"/usr/bin/env", "SLURM_ARRAY_TASK_ID=" + std::to_string(task), "/bin/sh"}, script);
    EXPECT_EQ(finished.errors, "");
    EXPECT_EQ(finished.output, "before all\nattempt\n" + (root / "work" / batch.folders[task]).string() +
                                   "\n--engine\nslurm\n--ranks\n3\n--memory-gb\n1.5\n--launcher\nmpirun\n");
  }
  const Finished single = run_command({"/usr/bin/env", "-u", "SLURM_ARRAY_TASK_ID", "/bin/sh"}, script);
  EXPECT_NE(single.output.find("ab/ab1"), std::string::npos);
}

TEST(slurm_script, options_say_what_the_job_needs) {
  Batch batch = make_batch("/a store", {"ab/ab1"});
  batch.ranks = 4;
  batch.memory_gb = 1.0;
  batch.time_limit_s = 90.0;
  queue::SlurmSettings settings;
  settings.partition = "long; rm -rf /";
  settings.options = {"--constraint=zen3", "--nodes=1"};
  const std::vector<std::string> words = make_sbatch(batch, settings);
  for (const char* word : {"--ntasks=4", "--mem-per-cpu=239M", "--time=2", "--signal=B:USR1@45", "--requeue", "--open-mode=append",
                           "--partition=long; rm -rf /", "--constraint=zen3", "--chdir=/a store",
                           "--output=/a store/slurm/0123456789abcdef0123456789abcdef/0.out", "--job-name=carillon-0123456789ab"})
    EXPECT_TRUE(has(words, word)) << word;
  EXPECT_TRUE(std::none_of(words.begin(), words.end(), [](const std::string& word) { return word.starts_with("--array"); }));
}

TEST(slurm_script, a_packed_array_has_tasks_of_one_node_that_run_their_own_lists) {
  const tests::Folder folder;
  const fs::path root = folder.path() / kNasty;
  fs::create_directories(root);
  std::ofstream(root / "carillon") << "#!/bin/sh\nprintf '%s\\n' \"$@\"\n";
  fs::permissions(root / "carillon", fs::perms::owner_all);
  Batch batch = make_batch(root, {});
  batch.tasks = 3;
  batch.ranks = 64;
  batch.memory_gb = 128.0;
  queue::SlurmSettings settings;
  settings.has_pictures = true;
  const Finished finished = run_command({"/usr/bin/env", "SLURM_ARRAY_TASK_ID=2", "/bin/sh"}, make_script(batch, settings));
  EXPECT_EQ(finished.errors, "");
  EXPECT_EQ(finished.output, "task\n" + root.string() + "\n" + batch.name + "\n2\n--pictures\n");
  batch.root = "/store";
  const std::vector<std::string> words = make_sbatch(batch, settings);
  for (const char* word : {"--array=0-2", "--nodes=1", "--ntasks=64", "--mem-per-cpu=1908M"}) EXPECT_TRUE(has(words, word)) << word;
  batch.tasks = 1;
  EXPECT_TRUE(has(make_sbatch(batch, settings), "--array=0-0"));
}

TEST(slurm_script, more_jobs_are_an_array) {
  queue::SlurmSettings settings;
  settings.max_running = 5;
  const std::vector<std::string> words = make_sbatch(make_batch("/st%re", {"ab/ab1", "cd/cd2", "ef/ef3"}), settings);
  EXPECT_TRUE(has(words, "--array=0-2%5"));
  EXPECT_TRUE(has(words, "--output=/st%%re/slurm/0123456789abcdef0123456789abcdef/%a.out"));
  EXPECT_TRUE(std::none_of(words.begin(), words.end(),
                           [](const std::string& word) { return word.starts_with("--mem") || word.starts_with("--time"); }));
  EXPECT_THROW(make_sbatch(make_batch("/a\\b", {"ab/ab1"}), {}), InputError);
}

}  // namespace
}  // namespace carillon::slurm
