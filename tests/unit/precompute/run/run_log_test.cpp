#include "precompute/run/run_log.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <ctime>
#include <thread>

#include "runtime/base/host.hpp"
#include "tests/support/ranks.hpp"

namespace carillon::run {
namespace {

using tests::get_rank;

TEST(RunLog, take_the_seconds_of_the_slowest_rank_and_the_memory_of_all) {
  RunLog phases(MPI_COMM_WORLD, true);
  phases.begin("sleep", "the last rank is slow");
  int ranks = 1;
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  if (get_rank() == ranks - 1) {
    const double start = MPI_Wtime();
    const std::clock_t own = std::clock();
    while (MPI_Wtime() < start + 0.05 || std::clock() - own < CLOCKS_PER_SEC / 50) {
    }
  }
  const RunPhase& phase = phases.end();
  EXPECT_GE(phase.seconds, 0.05);
  EXPECT_GE(phase.cpu_seconds, 0.0199);  // the loop is timed by the same clock, independent of the load
  EXPECT_GT(phase.peak_bytes, 1 << 20);
  EXPECT_GE(phase.peak_sum_bytes, phase.peak_bytes);
  EXPECT_LE(phase.peak_sum_bytes, ranks * phase.peak_bytes);
}

TEST(RunLog, counts_no_waiting_for_other_ranks) {
  const comm::Communicator ranks(MPI_COMM_WORLD);
  RunLog log(ranks, true);
  log.begin("read", "");
  if (!ranks.is_root()) std::this_thread::sleep_for(std::chrono::milliseconds(600));  // rank 0 waits in the reduction meanwhile
  const RunPhase& phase = log.end();
  EXPECT_LT(phase.cpu_seconds, 0.3);
  EXPECT_GE(phase.seconds, ranks.size() > 1 ? 0.6 : 0.0);
}

TEST(RunLog, keeps_a_warning_once) {
  RunLog log(MPI_COMM_WORLD, true);
  log.warn("the walls are thin");
  const comm::Communicator ranks(MPI_COMM_WORLD);
  EXPECT_EQ(ranks.sum(static_cast<std::int64_t>(log.get_warnings().size())), 1);
  if (ranks.is_root()) {
    EXPECT_EQ(log.get_warnings().front(), "the walls are thin");
  }
}

TEST(PeakMemory, is_gathered_from_every_rank_and_counts_what_was_touched) {
  const std::int64_t before = base::find_memory().peak;
  {
    std::vector<char> touched(std::size_t{64} << 20, 1);
    EXPECT_EQ(touched.back(), 1);
  }
  EXPECT_GE(base::find_memory().peak, before);
  EXPECT_GE(base::find_memory().peak, std::int64_t{64} << 20);
  const auto all = gather_peak_bytes(MPI_COMM_WORLD);
  int ranks = 1;
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  ASSERT_EQ(all.size(), get_rank() == 0 ? static_cast<std::size_t>(ranks) : 0u);
  for (const std::int64_t bytes : all) EXPECT_GE(bytes, std::int64_t{64} << 20);
}

TEST(Record, names_every_library_with_a_version) {
  for (const auto& [name, version] : find_versions())
    EXPECT_NE(version.find_first_of("0123456789"), std::string::npos) << name << ": " << version;
  EXPECT_EQ(find_versions().size(), 6u);
  const std::string id = git_id();
  EXPECT_TRUE(id == "unknown" || id.find_first_not_of("0123456789abcdef") == std::string::npos || id.ends_with("-dirty")) << id;
}

}  // namespace
}  // namespace carillon::run
