// Packing: every job once, balanced tasks, few idle cores.
#include "jobs/queue/slurm/packing.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

namespace carillon::slurm {
namespace {

/// Bodies of 0.1 to 20 s, many more small ones than large ones.
std::vector<PackJob> make_library(std::size_t count, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  std::vector<PackJob> jobs(count);
  for (PackJob& job : jobs) {
    job.seconds = 0.1 * std::pow(200.0, share(random));
    job.serial_s = 0.1 * job.seconds;
    job.memory_gb = {0.1, 0.15, 0.2};
  }
  return jobs;
}

void expect_each_once(const PackPlan& plan, std::size_t count) {
  std::multiset<std::size_t> seen;
  for (const auto& task : plan.tasks) {
    EXPECT_FALSE(task.empty());
    for (const Placed& placed : task) seen.insert(placed.job);
  }
  ASSERT_EQ(seen.size(), count);
  EXPECT_EQ(std::set<std::size_t>(seen.begin(), seen.end()).size(), count);
}

TEST(packing, many_bodies_form_one_balanced_array) {
  const std::vector<PackJob> jobs = make_library(10000);
  const PackPlan plan = plan_packs(jobs, {16, 64, 256.0}, {1.0, 1800.0, 1000, 16});
  expect_each_once(plan, jobs.size());
  EXPECT_EQ(plan.cores, 64);
  EXPECT_EQ(plan.tasks.size(), 16u);
  EXPECT_LT(plan.idle_share, 0.1);
  EXPECT_GT(plan.idle_share, 0.0);
}

TEST(packing, long_work_needs_more_tasks_up_to_the_limit_of_the_site) {
  const std::vector<PackJob> jobs = make_library(10000);
  const PackPlan plan = plan_packs(jobs, {1, 2, 0.0}, {1.0, 1800.0, 1000, 16});
  expect_each_once(plan, jobs.size());
  EXPECT_GT(plan.tasks.size(), 5u);
  EXPECT_LT(plan.seconds, 1.1 * 1800.0);
  const PackPlan few = plan_packs(jobs, {1, 2, 0.0}, {1.0, 1800.0, 3, 16});
  EXPECT_EQ(few.tasks.size(), 3u);
  expect_each_once(few, jobs.size());
}

TEST(packing, little_work_forms_one_task) {
  const std::vector<PackJob> jobs(40, PackJob{0.3, 0.0, {}, 0});
  const PackPlan plan = plan_packs(jobs, {16, 64, 0.0}, {1.0, 1800.0, 1000, 16});
  ASSERT_EQ(plan.tasks.size(), 1u);
  EXPECT_EQ(plan.cores, 40);
  EXPECT_TRUE(plan_packs({}, {16, 64, 0.0}, {}).tasks.empty());
}

TEST(packing, large_body_gets_several_ranks_and_starts_first) {
  std::vector<PackJob> jobs(400, PackJob{2.0, 0.1, {0.1}, 0});
  jobs.push_back({300.0, 5.0, {1.0, 1.2}, 0});
  jobs.push_back({2.0, 0.1, {0.1}, 3});  // requested
  const PackPlan plan = plan_packs(jobs, {1, 16, 0.0}, {1.0, 1800.0, 1000, 16});
  ASSERT_EQ(plan.tasks.size(), 1u);
  const std::vector<Placed>& task = plan.tasks[0];
  EXPECT_EQ(task[0].job, 400u);
  EXPECT_EQ(task[0].ranks, 16);
  EXPECT_DOUBLE_EQ(task[0].memory_gb, 1.2);
  EXPECT_EQ(task[1].job, 401u);
  EXPECT_EQ(task[1].ranks, 3);
  EXPECT_TRUE(std::all_of(task.begin() + 2, task.end(), [](const Placed& placed) { return placed.ranks == 1; }));
  EXPECT_LT(plan.idle_share, 0.15);
}

TEST(packing, memory_of_a_task_is_the_peak_of_its_jobs_within_a_node) {
  std::vector<PackJob> jobs(20, PackJob{10.0, 0.0, {1.0}, 0});
  EXPECT_DOUBLE_EQ(plan_packs(jobs, {1, 4, 64.0}, {}).memory_gb, 5.0);
  const PackPlan tight = plan_packs(jobs, {1, 4, 2.5}, {});
  EXPECT_DOUBLE_EQ(tight.memory_gb, 2.5);
  EXPECT_NEAR(tight.seconds, 1.0 + 100.0, 1e-9);  // two concurrent jobs
}

TEST(packing, job_overtakes_for_lack_of_memory_but_not_of_cores) {
  const std::vector<Placed> waiting{{0, 1, 3.0, 1.0}, {1, 1, 1.0, 1.0}, {2, 4, 0.1, 1.0}, {3, 1, 0.1, 1.0}};
  EXPECT_EQ(choose_next(waiting, {2, 4.0}), 0u);
  EXPECT_EQ(choose_next(waiting, {2, 2.0}), 1u);
  EXPECT_FALSE(choose_next(waiting, {2, 0.5}));
  EXPECT_EQ(choose_next(waiting, {4, 0.5}), 2u);
  EXPECT_FALSE(choose_next(waiting, {0, 4.0}));
}

TEST(packing, replay_runs_every_job_once_within_the_task) {
  const std::vector<PackJob> jobs = make_library(500);
  const PackPlan plan = plan_packs(jobs, {1, 8, 1.0}, {1.0, 1e9, 1000, 4});
  ASSERT_EQ(plan.tasks.size(), 1u);
  // Predictions are wrong by up to a factor of two.
  std::mt19937 random(7);
  std::uniform_real_distribution<double> error(-1.0, 1.0);
  std::vector<double> true_s;
  for (const PackJob& job : jobs) true_s.push_back(job.seconds * std::pow(2.0, error(random)));
  const std::vector<Span> spans = replay(plan.tasks[0], 8, 1.0, [&](const Placed& placed) { return true_s[placed.job] / placed.ranks; });
  ASSERT_EQ(spans.size(), jobs.size());
  double sum_s = 0.0, in_s = 0.0, end_s = 0.0;
  std::set<std::size_t> seen;
  for (const Span& span : spans) {
    sum_s += span.ranks * (span.end_s - span.start_s);
    end_s = std::max(end_s, span.end_s);
    seen.insert(span.job);
    int at_a_time = 0;
    for (const Span& other : spans)
      if (other.start_s <= span.start_s && span.start_s < other.end_s) at_a_time += other.ranks;
    EXPECT_LE(at_a_time, 8);
  }
  for (const double seconds : true_s) in_s += seconds;
  EXPECT_EQ(seen.size(), jobs.size());
  EXPECT_NEAR(sum_s, in_s, 1e-6 * in_s);
  EXPECT_LT(1.0 - in_s / (8 * end_s), 0.05);
}

}  // namespace
}  // namespace carillon::slurm
