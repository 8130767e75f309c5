// Recorded output of Slurm 22.05, and programs that do not answer.
#include "jobs/queue/slurm/client.hpp"

#include <gtest/gtest.h>

#include <string>

#include "jobs/queue/slurm/command.hpp"

namespace carillon::slurm {
namespace {

TEST(slurm_site, squeue_is_read) {
  const auto jobs = parse_list("12_3|RUNNING|None\n12_4|PENDING|Resources\n13|NODE_FAIL|None\n14|COMPLETING|TimeLimit\n\nrubbish\n");
  ASSERT_EQ(jobs.size(), 4u);
  EXPECT_EQ(jobs.at("12_3").phase, SlurmPhase::runs);
  EXPECT_EQ(jobs.at("12_4").phase, SlurmPhase::waits);
  EXPECT_EQ(jobs.at("12_4").reason, "Resources");
  EXPECT_EQ(jobs.at("13").phase, SlurmPhase::ended);
  EXPECT_EQ(jobs.at("14").phase, SlurmPhase::runs);
}

TEST(slurm_site, scontrol_is_read_whatever_the_paths_say) {
  const auto seen = parse_show(
      "JobId=7 ArrayJobId=5 ArrayTaskId=2 JobName=carillon-0123 UserId=root(0) GroupId=root(0) MCS_label=N/A Priority=4294901757 Nice=0 "
      "Account=(null) "
      "QOS=(null) JobState=FAILED Reason=JobLaunchFailure Dependency=(null) Requeue=1 Restarts=2 BatchFlag=1 Reboot=0 ExitCode=0:9 "
      "RunTime=00:00:04 "
      "WorkDir=/a JobState=COMPLETED Restarts=9 ExitCode=1:0 StdOut=/b\n");
  ASSERT_TRUE(seen);
  EXPECT_EQ(seen->state, "FAILED");
  EXPECT_EQ(seen->reason, "JobLaunchFailure");
  EXPECT_EQ(seen->phase, SlurmPhase::ended);
  EXPECT_EQ(seen->restarts, 2);
  EXPECT_EQ(seen->exit_code, 0);
  EXPECT_EQ(seen->signal, 9);
  EXPECT_FALSE(parse_show("slurm_load_jobs error: Invalid job id specified\n"));
}

TEST(slurm_site, a_state_that_is_not_known_has_ended) {
  EXPECT_EQ(find_phase("PREEMPTED"), SlurmPhase::ended);
  EXPECT_EQ(find_phase("OUT_OF_MEMORY"), SlurmPhase::ended);
  EXPECT_EQ(find_phase("REQUEUE_HOLD"), SlurmPhase::waits);
  EXPECT_EQ(find_array("12_3"), "12");
  EXPECT_EQ(find_array("12"), "12");
}

TEST(slurm_site, the_nodes_that_have_most_cores_together_are_planned_for) {
  const std::string nodes =
      "n1|main*|2|32|256000|idle\nn2|main*|2|32|256000|mixed\nn3|main*|2|32|256000|down*\nn4|main*|1|8|64000|allocated\n"
      "n1|long|2|32|256000|idle\nn5|gpu|1|96|512000|idle\nrubbish\n";
  const auto machine = parse_nodes(nodes, "");
  ASSERT_TRUE(machine);
  EXPECT_EQ(machine->nodes, 2);
  EXPECT_EQ(machine->cores, 64);
  EXPECT_NEAR(machine->memory_gb, 0.95 * 268.4, 0.1);
  EXPECT_EQ(parse_nodes(nodes, "gpu")->cores, 96);
  EXPECT_EQ(parse_nodes(nodes, "long")->nodes, 1);
  EXPECT_EQ(parse_nodes(nodes, "main")->nodes, 2);
  EXPECT_FALSE(parse_nodes(nodes, "other"));
  EXPECT_FALSE(parse_nodes("", ""));
}

TEST(slurm_site, a_packed_job_is_known_by_its_task_and_its_place) {
  EXPECT_EQ(find_array("12_3.7"), "12");
  EXPECT_EQ(find_task("12_3.7"), "12_3");
  EXPECT_EQ(find_task("12_3"), "12_3");
  EXPECT_TRUE(is_packed("12_3.7"));
  EXPECT_FALSE(is_packed("12_3"));
}

TEST(slurm_command, input_output_and_exit_code_pass) {
  const std::string input(300000, 'x');
  const Finished finished = run_command({"/bin/sh", "-c", "cat; echo error >&2; exit 7"}, input);
  EXPECT_EQ(finished.exit_code, 7);
  EXPECT_EQ(finished.output, input);
  EXPECT_EQ(finished.errors, "error\n");
  EXPECT_FALSE(finished.was_slow);
}

TEST(slurm_command, a_program_that_takes_no_input_or_is_not_there_does_no_harm) {
  EXPECT_EQ(run_command({"/bin/true"}, std::string(300000, 'x')).exit_code, 0);
  EXPECT_EQ(run_command({"/nowhere/at all"}).exit_code, 127);
  EXPECT_EQ(run_command({"/bin/sh", "-c", "kill -9 $$"}).exit_code, 137);
}

TEST(slurm_command, a_program_that_does_not_end_is_ended) {
  const Finished finished = run_command({"/bin/sh", "-c", "echo begun; exec sleep 1000"}, {}, 0.5);
  EXPECT_TRUE(finished.was_slow);
  EXPECT_EQ(finished.output, "begun\n");
}

TEST(slurm_command, a_program_that_closes_its_outputs_and_stays_is_ended) {
  const Finished finished = run_command({"/bin/sh", "-c", "echo begun; exec sleep 1000 >&- 2>&-"}, {}, 0.5);
  EXPECT_TRUE(finished.was_slow);
  EXPECT_EQ(finished.output, "begun\n");
  EXPECT_EQ(finished.exit_code, 137);
}

TEST(slurm_command, a_program_that_prints_without_end_is_ended) {
  const Finished finished = run_command({"/usr/bin/yes"}, {}, 60.0, 1 << 20);
  EXPECT_TRUE(finished.was_long);
  EXPECT_FALSE(finished.was_slow);
  EXPECT_EQ(finished.exit_code, 137);
  EXPECT_LT(finished.output.size(), 2u << 20);
}

}  // namespace
}  // namespace carillon::slurm
