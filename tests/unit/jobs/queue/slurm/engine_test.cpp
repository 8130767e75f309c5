// Rows of the engine "slurm" without a real Slurm.
#include "jobs/queue/slurm/engine.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <set>

#include "tests/unit/jobs/store/registry/jobs.hpp"

namespace carillon::tests {
namespace {

using registry::Job;
using registry::JobState;
using registry::Registry;

class Engine : public testing::Test {
 protected:
  Engine() : store_(store::Store::open(folder_ / "store")), registry_(Registry::open(store_, be_silent)) {
    registry::Submission submission = make_submission(1);
    submission.request.engine = store::JobEngine::slurm;
    make_work(store_, submission);
    registry_.submit({submission});
  }

  /// The row after a claim by `worker` and follow().
  JobState follow(const process::Identity& worker) {
    const auto all = [](const std::vector<Job>&, const std::vector<Job>& ready) { return ready; };
    EXPECT_EQ(registry_.claim(store::JobEngine::slurm, worker, all).size(), 1u);
    slurm::Engine(store_, {}, "carillon", be_silent).follow(registry_);
    return registry_.find(make_id(1))->state;
  }

  const Folder folder_;
  const store::Store store_;
  Registry registry_;
};

TEST_F(Engine, own_claim_without_submission_is_requeued) { EXPECT_EQ(follow(process::find_self()), JobState::queued); }

TEST_F(Engine, claim_of_another_machine_with_the_same_pid_is_kept) {
  process::Identity other = process::find_self();
  other.host = "another-host";
  other.boot = "another-boot:1";
  EXPECT_EQ(follow(other), JobState::running);
}

TEST_F(Engine, cancelled_waiting_job_keeps_its_reason) {
  registry_.update(make_id(1), [](Job& job) { return job.state = JobState::waiting, job.attempts = 2, job.reason = "node n7 died", true; });
  EXPECT_TRUE(slurm::Engine(store_, {}, "carillon", be_silent).cancel(registry_, make_id(1)));
  EXPECT_EQ(registry_.find(make_id(1))->reason, "cancelled while it waited: node n7 died");
}

/// Packed jobs with Slurm commands as scripts: sbatch prints 77, squeue prints the text of show(), scancel records its arguments.
class PackedEngine : public testing::Test {
 protected:
  PackedEngine() : store_(store::Store::open(folder_ / "store")), registry_(Registry::open(store_, be_silent)) {
    write_program("sinfo", "echo 'n1|main*|1|2|8000|idle'");
    write_program("scontrol", "case \"$*\" in *config*) echo 'MaxArraySize = 1001';; *) cat " + quote("end") +
                                  " 2>/dev/null || { echo 'Job 77_0 not found'; exit 1; };; esac");
    write_program("sbatch", "printf '%s\\n' \"$@\" > " + quote("asked") + "; cat > /dev/null; echo 77");
    write_program("squeue", "cat " + quote("seen") + " 2>/dev/null; exit 0");
    write_program("scancel", "printf '%s\\n' \"$@\" >> " + quote("cancelled"));
    write_program("sacct", "exit 1");
    path_ = std::getenv("PATH");
    ::setenv("PATH", ((folder_ / "bin").string() + ":" + path_).c_str(), 1);
    std::vector<registry::Submission> submissions;
    for (int number = 1; number <= kJobs; ++number) {
      submissions.push_back(make_submission(number));
      submissions.back().request.engine = store::JobEngine::slurm;
      make_work(store_, submissions.back());
    }
    registry_.submit(submissions);
    const auto find_needs = [](const Job&) { return slurm::Needs{{1, 0.5, 0.0}, {2.0, 0.1, {0.5}, 0}, true}; };
    EXPECT_EQ(engine_.hand_over(registry_, find_needs).size(), static_cast<std::size_t>(kJobs));
  }
  ~PackedEngine() override { ::setenv("PATH", path_.c_str(), 1); }

  std::string quote(const std::string& name) const { return "'" + (folder_ / name).string() + "'"; }
  void write_program(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories(folder_ / "bin");
    std::ofstream(folder_ / "bin" / name) << "#!/bin/sh\n" + text + "\n";
    std::filesystem::permissions(folder_ / "bin" / name, std::filesystem::perms::owner_all);
  }
  void show(const std::string& state) const { std::ofstream(folder_ / "seen") << "77_0|" + state + "|None\n"; }
  void show_end(const std::string& state) const {
    std::filesystem::remove(folder_ / "seen");
    std::ofstream(folder_ / "end") << "JobId=77 JobState=" + state + " Reason=None Restarts=0 ExitCode=0:9\n";
  }
  std::string read(const std::string& name) const {
    std::ifstream stream(folder_ / name);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  /// Files of an attempt; without cause: running.
  void leave(int number, std::optional<outcome::Cause> cause) const {
    const std::filesystem::path work = store_.work_folder(make_id(number));
    outcome::Attempt attempt;
    attempt.token = std::string(32, 'a');
    attempt.process = process::find_self();
    attempt.started = outcome::find_utc();
    outcome::write_attempt(work, attempt);
    const auto submitted = slurm::read_submitted_job(work);
    if (submitted) slurm::write_begun(store_.root(), submitted->batch, submitted->task);
    if (!cause) return;
    outcome::Outcome outcome = outcome::make_killed(attempt.token);
    outcome.cause = *cause;
    outcome.reason = "its own word";
    outcome.host = process::find_host();
    outcome.started = outcome.ended = outcome::find_utc();
    outcome::write_outcome(work, outcome);
  }
  Job find(int number) const { return *registry_.find(make_id(number)); }

  static constexpr int kJobs = 6;
  const Folder folder_;
  const store::Store store_;
  Registry registry_;
  std::string path_, said_;
  slurm::Engine engine_{store_, {}, "carillon", [this](const std::string& line) { said_ += line; }};
};

TEST_F(PackedEngine, short_jobs_form_one_array_with_a_message) {
  EXPECT_NE(read("asked").find("--array=0-0"), std::string::npos);
  EXPECT_NE(read("asked").find("--ntasks=2"), std::string::npos);
  EXPECT_NE(said_.find("6 jobs"), std::string::npos) << said_;
  EXPECT_NE(said_.find("1 task of 2 cores"), std::string::npos) << said_;
  std::set<std::string> names;
  for (int number = 1; number <= kJobs; ++number) names.insert(find(number).slurm_job);
  EXPECT_EQ(names, (std::set<std::string>{"77_0.0", "77_0.1", "77_0.2", "77_0.3", "77_0.4", "77_0.5"}));
  const auto list = slurm::read_task(store_.root(), slurm::read_submitted_job(store_.work_folder(make_id(1)))->batch, 0);
  ASSERT_TRUE(list);
  EXPECT_EQ(list->jobs.size(), static_cast<std::size_t>(kJobs));
}

TEST_F(PackedEngine, each_job_has_its_own_state_while_its_task_runs) {
  leave(1, std::nullopt);
  leave(2, outcome::Cause::no_solution);
  leave(3, outcome::Cause::killed);
  show("RUNNING");
  engine_.follow(registry_);
  EXPECT_EQ(find(1).state, JobState::running);
  EXPECT_EQ(find(2).state, JobState::failed);
  EXPECT_EQ(find(2).reason, "its own word");
  EXPECT_EQ(find(3).state, JobState::waiting);
  EXPECT_TRUE(find(3).slurm_job.empty());
  EXPECT_EQ(find(4).state, JobState::queued);
  EXPECT_NE(find(4).reason.find("in a task with other jobs"), std::string::npos) << find(4).reason;
}

TEST_F(PackedEngine, cancel_of_one_job_in_a_shared_task) {
  leave(1, std::nullopt);
  show("RUNNING");
  EXPECT_TRUE(engine_.cancel(registry_, make_id(4)));
  EXPECT_EQ(find(4).state, JobState::cancelled);
  EXPECT_FALSE(slurm::read_submitted_job(store_.work_folder(make_id(4))));
  // A running job is stopped by its task and ends with its attempt.
  registry_.update(make_id(1), [](Job& job) { return job.cancel_wanted = true; });
  engine_.follow(registry_);
  EXPECT_EQ(find(1).state, JobState::running);
  EXPECT_TRUE(slurm::read_submitted_job(store_.work_folder(make_id(1)))->is_unwanted);
  leave(1, outcome::Cause::stopped);
  engine_.follow(registry_);
  EXPECT_EQ(find(1).state, JobState::cancelled);
  EXPECT_EQ(read("cancelled"), "");
  for (const int number : {2, 3, 5, 6}) {
    EXPECT_EQ(find(number).state, JobState::queued);
    registry_.update(make_id(number), [](Job& job) { return job.cancel_wanted = true; });
  }
  engine_.follow(registry_);
  EXPECT_EQ(read("cancelled"), "--quiet\n77_0\n");
}

TEST_F(PackedEngine, jobs_of_a_killed_task_are_submitted_again) {
  leave(1, std::nullopt);
  leave(2, outcome::Cause::no_solution);
  show_end("NODE_FAIL");
  engine_.follow(registry_);
  EXPECT_EQ(find(1).state, JobState::waiting);
  EXPECT_EQ(find(1).failures, 1);
  EXPECT_EQ(find(2).state, JobState::failed);
  for (int number = 3; number <= kJobs; ++number) {
    EXPECT_EQ(find(number).state, JobState::queued);
    EXPECT_EQ(find(number).failures, 0);
    EXPECT_EQ(find(number).attempts, 0);
    EXPECT_TRUE(find(number).slurm_job.empty());
  }
}

TEST_F(PackedEngine, task_without_a_started_job_counts_as_failure_of_all) {
  show_end("FAILED");
  engine_.follow(registry_);
  for (int number = 1; number <= kJobs; ++number) EXPECT_EQ(find(number).failures, 1);
}

TEST_F(PackedEngine, scancel_of_a_task_cancels_its_open_jobs) {
  leave(1, std::nullopt);
  leave(2, outcome::Cause::bad_input);
  show_end("CANCELLED");
  engine_.follow(registry_);
  EXPECT_EQ(find(1).state, JobState::cancelled);
  EXPECT_EQ(find(2).state, JobState::failed);
  EXPECT_EQ(find(3).state, JobState::cancelled);
}

TEST_F(PackedEngine, scancel_of_a_pending_array_cancels_all) {
  std::ofstream(folder_ / "seen") << "77|CANCELLED|None\n";
  engine_.follow(registry_);
  for (int number = 1; number <= kJobs; ++number) EXPECT_EQ(find(number).state, JobState::cancelled);
}

TEST_F(PackedEngine, rebuilt_registry_finds_the_task_of_each_job) {
  const std::string before = find(5).slurm_job;
  registry_.update(make_id(5), [](Job& job) { return job.slurm_job.clear(), true; });
  show("PENDING");
  engine_.follow(registry_);
  EXPECT_EQ(find(5).slurm_job, before);
}

}  // namespace
}  // namespace carillon::tests
