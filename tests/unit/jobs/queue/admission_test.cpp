// Admission: limits of cores and memory, no starvation.
#include "jobs/queue/admission.hpp"

#include <gtest/gtest.h>

#include <random>

#include "jobs/queue/needs.hpp"

namespace {

using namespace carillon::queue;

Candidate small(double memory_gb = 0.2) { return {{0, memory_gb, 1.0, {}}, 0.0}; }
Candidate asking(int ranks, double memory_gb, double blocked_s = 0.0) { return {{ranks, memory_gb, 0.0, {}}, blocked_s}; }
Candidate large(double memory_gb, double seconds = 1000.0) { return {{0, 0.0, seconds, {memory_gb}}, 0.0}; }

int count(const std::vector<Admission>& admissions, Admission::Decision decision) {
  return static_cast<int>(
      std::count_if(admissions.begin(), admissions.end(), [&](const Admission& admission) { return admission.decision == decision; }));
}

const Host kHost{8, 32.0, 32.0};

TEST(Admission, small_jobs_run_concurrently_on_one_rank_each) {
  const std::vector<Admission> admissions = choose(kHost, {}, std::vector<Candidate>(20, small()));
  EXPECT_EQ(count(admissions, Admission::Decision::start), 8);
  for (const Admission& admission : admissions) EXPECT_EQ(admission.ranks, 1);
}

TEST(Admission, large_jobs_divide_the_cores) {
  const std::vector<Admission> alone = choose(kHost, {}, {large(4.0)});
  EXPECT_EQ(alone[0].decision, Admission::Decision::start);
  EXPECT_EQ(alone[0].ranks, 8);
  const std::vector<Admission> both = choose(kHost, {}, {large(4.0), large(4.0)});
  EXPECT_EQ(count(both, Admission::Decision::start), 2);
  EXPECT_EQ(both[0].ranks, 4);
  EXPECT_EQ(both[1].ranks, 4);
}

TEST(Admission, jobs_limited_by_memory_get_all_cores) {
  // Two jobs of 20 GB do not fit into 32 GB: the first gets all cores.
  const std::vector<Admission> admissions = choose(kHost, {}, {large(20.0), large(20.0)});
  EXPECT_EQ(admissions[0].decision, Admission::Decision::start);
  EXPECT_EQ(admissions[0].ranks, 8);
  EXPECT_EQ(admissions[1].decision, Admission::Decision::wait);
}

TEST(Admission, short_job_gets_one_rank) {
  EXPECT_EQ(choose(kHost, {}, {large(1.0, 40.0)})[0].ranks, 4);
  EXPECT_EQ(choose(kHost, {}, {large(1.0, kSmallSeconds - 1.0)})[0].ranks, 1);
}

TEST(Admission, requested_ranks_are_limited_by_cores) {
  EXPECT_EQ(choose(kHost, {}, {asking(3, 1.0)})[0].ranks, 3);
  EXPECT_EQ(choose(kHost, {}, {asking(64, 1.0)})[0].ranks, 8);
}

TEST(Admission, job_larger_than_the_machine_never_runs) {
  const std::vector<Admission> admissions = choose(kHost, {}, {asking(1, 31.0), asking(1, 30.0)});
  EXPECT_EQ(admissions[0].decision, Admission::Decision::never);
  EXPECT_EQ(admissions[0].memory_gb, 31.0);
  EXPECT_EQ(admissions[1].decision, Admission::Decision::start);
}

TEST(Admission, admitted_memory_is_reserved) {
  const std::vector<Admitted> running{{1, 20.0, 0.5}};
  // 31.5 GB are free, but 19.5 GB are admitted to other jobs.
  const Host host{8, 32.0, 31.5};
  EXPECT_EQ(choose(host, running, {asking(1, 12.0)})[0].decision, Admission::Decision::wait);
  EXPECT_EQ(choose(host, running, {asking(1, 10.0)})[0].decision, Admission::Decision::start);
}

TEST(Admission, memory_of_other_programs_is_not_admitted) {
  const Host host{8, 32.0, 6.0};
  EXPECT_EQ(choose(host, {}, {asking(1, 5.0)})[0].decision, Admission::Decision::wait);
  EXPECT_EQ(choose(host, {}, {asking(1, 4.0)})[0].decision, Admission::Decision::start);
}

TEST(Admission, blocked_job_is_overtaken_until_its_patience_ends) {
  const std::vector<Admitted> running{{1, 1.0, 1.0}};
  const std::vector<Candidate> fresh{asking(8, 1.0, 1.0), small()};
  EXPECT_EQ(choose(kHost, running, fresh)[1].decision, Admission::Decision::start);
  const std::vector<Candidate> old{asking(8, 1.0, kPatienceSeconds + 1.0), small()};
  const std::vector<Admission> admissions = choose(kHost, running, old);
  EXPECT_EQ(admissions[0].decision, Admission::Decision::wait);
  EXPECT_EQ(admissions[1].decision, Admission::Decision::wait);
}

TEST(Admission, no_reservation_for_a_job_blocked_by_other_programs) {
  // Another program holds 26 of 32 GB: waiting for own jobs does not help.
  const Host host{8, 32.0, 6.0};
  const std::vector<Admission> admissions = choose(host, {{1, 1.0, 1.0}}, {asking(1, 20.0, 1e6), small()});
  EXPECT_EQ(admissions[0].decision, Admission::Decision::wait);
  EXPECT_EQ(admissions[1].decision, Admission::Decision::start);
}

TEST(Admission, random_queues_never_oversubscribe) {
  std::mt19937 random(5);
  const auto pick = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  for (int round = 0; round < 2000; ++round) {
    const Host host{1 + round % 16, pick(4.0, 64.0), pick(1.0, 64.0)};
    std::vector<Admitted> running;
    int cores = host.cores;
    for (int i = 0; i < round % 3 && cores > 1; ++i, --cores) running.push_back({1, pick(0.1, 2.0), pick(0.0, 2.0)});
    std::vector<Candidate> candidates;
    for (int i = 0; i < 20; ++i) {
      Candidate candidate{
          {static_cast<int>(pick(0, 5)), i % 2 == 0 ? pick(0.1, 30.0) : 0.0, pick(0.0, 300.0), {pick(0.1, 30.0), pick(0.1, 30.0)}},
          pick(0.0, 100.0)};
      candidates.push_back(candidate);
    }
    double promised = 0.0;
    int ranks = 0;
    for (const Admitted& job : running) promised += job.memory_gb, ranks += job.ranks;
    for (const Admission& admission : choose(host, running, candidates)) {
      if (admission.decision != Admission::Decision::start) continue;
      promised += admission.memory_gb;
      ranks += admission.ranks;
      EXPECT_GE(admission.ranks, 1);
    }
    EXPECT_LE(ranks, host.cores) << "round " << round;
    if (!running.empty() && ranks == static_cast<int>(running.size())) continue;  // none started
    EXPECT_LE(promised, kMemoryShare * host.total_gb + 1e-9) << "round " << round;
  }
}

TEST(Admission, small_jobs_do_not_starve_a_large_one) {
  // Small jobs keep arriving; the large job needs both slots.
  const Host host{2, 32.0, 32.0};
  std::vector<int> left{3, 5};  // remaining seconds of running small jobs
  double blocked_s = 0.0;
  for (int second = 0; second < 1000; ++second) {
    std::erase_if(left, [](int& seconds) { return --seconds <= 0; });
    const std::vector<Admitted> running(left.size(), Admitted{1, 0.2, 0.2});
    const std::vector<Admission> admissions = choose(host, running, {asking(2, 1.0, blocked_s), small(), small()});
    if (admissions[0].decision == Admission::Decision::start) {
      SUCCEED();
      return;
    }
    blocked_s += 1.0;
    for (std::size_t i = 1; i < admissions.size(); ++i) {
      if (admissions[i].decision == Admission::Decision::start) left.push_back(3 + static_cast<int>(i));
    }
  }
  FAIL() << "the large job never ran";
}

TEST(Admission, memory_between_two_predictions_is_the_larger) {
  const Need need{0, 0.0, 100.0, {4.0, 5.0, 7.0}};
  EXPECT_EQ(calc_memory(need, 1), 4.0);
  EXPECT_EQ(calc_memory(need, 2), 5.0);
  EXPECT_EQ(calc_memory(need, 3), 7.0);
  EXPECT_EQ(calc_memory(need, 16), 7.0);
}

TEST(Admission, estimate_grows_with_mesh_and_ranks) {
  const Need small_mesh = guess_need(carillon::cost::estimate_meshed_size(1000, true)),
             large_mesh = guess_need(carillon::cost::estimate_meshed_size(100000, true));
  EXPECT_LT(calc_memory(small_mesh, 1), 0.3);
  EXPECT_GT(calc_memory(large_mesh, 1), 1.0);
  EXPECT_GT(calc_memory(small_mesh, 8), calc_memory(small_mesh, 1));
}

}  // namespace
