#include "partition/partition.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <csetjmp>
#include <csignal>
#include <numeric>
#include <random>
#include <set>
#include <thread>

#include "partition/metis.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/box_mesh.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/partition/fill.hpp"

namespace carillon::partition {
namespace {

using testing::HasSubstr;

/// Number of face-sharing pairs of a mesh by definition: three common corners. Quadratic in the elements.
std::set<std::pair<int, int>> slow_dual(const std::vector<std::int32_t>& corners) {
  std::set<std::pair<int, int>> pairs;
  const int n = static_cast<int>(corners.size() / 4);
  for (int a = 0; a < n; ++a)
    for (int b = 0; b < n; ++b) {
      int common = 0;
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j) common += corners[4 * a + i] == corners[4 * b + j];
      if (common == 3) pairs.emplace(a, b);
    }
  return pairs;
}

TEST(DualGraph, joins_exactly_the_tetrahedra_that_share_three_corners) {
  const auto box = tests::make_box({3, 2, 2}, {1, 1, 1});
  const Graph dual = make_dual_graph(box.tets);
  std::set<std::pair<int, int>> pairs;
  for (int v = 0; v < dual.vertex_count(); ++v)
    for (int k = dual.offsets[v]; k < dual.offsets[v + 1]; ++k) pairs.emplace(v, dual.neighbours[k]);
  EXPECT_EQ(pairs, slow_dual(box.tets));
}

TEST(DualGraph, refuses_three_tetrahedra_on_one_face_and_names_them) {
  const std::vector<std::int32_t> corners{0, 1, 2, 3, 0, 1, 2, 4, 0, 1, 2, 5};
  tests::expect_error<InputError>({"tetrahedra 0, 1 and 2 share one face (nodes 0, 1, 2)"}, [&] { make_dual_graph(corners); });
}

TEST(NodeGraph, joins_nodes_of_one_element_and_skips_negative_ones) {
  const std::vector<std::int32_t> tets{0, 1, 2, 3, 1, 2, 3, -1};
  const Graph graph = make_node_graph(tets, 4, 5);
  EXPECT_EQ(graph.offsets, (std::vector<std::int32_t>{0, 3, 6, 9, 12, 12}));
  EXPECT_EQ(graph.neighbours, (std::vector<std::int32_t>{1, 2, 3, 0, 2, 3, 0, 1, 3, 0, 1, 2}));
}

TEST(Partition, of_a_long_bar_is_balanced_contiguous_and_cuts_about_one_cross_section_per_seam) {
  const auto bar = tests::make_box({60, 4, 4}, {60, 4, 4});
  for (const int parts : {1, 2, 3, 4}) {
    const Partition cut = partition_elements(bar.tets, parts);
    EXPECT_EQ(std::accumulate(cut.quality.elements.begin(), cut.quality.elements.end(), std::int64_t{0}), bar.tet_count());
    EXPECT_LT(cut.quality.balance, 1.04) << parts;
    EXPECT_TRUE(cut.quality.contiguous) << parts;
    // A flat interface across the bar crosses 4 x 4 cells with two faces each; METIS finds interfaces close to that.
    EXPECT_LE(cut.quality.edge_cut, 3 * 32 * (parts - 1)) << parts;
    EXPECT_GE(cut.quality.edge_cut, 24 * (parts - 1)) << parts;
  }
}

TEST(Partition, reports_the_counted_edge_cut) {
  const auto box = tests::make_box({4, 3, 2}, {1, 1, 1});
  const Partition cut = partition_elements(box.tets, 3);
  std::int64_t crossing = 0;
  for (const auto& [a, b] : slow_dual(box.tets)) crossing += a < b && cut.part[a] != cut.part[b];
  EXPECT_EQ(cut.quality.edge_cut, crossing);
}

TEST(Partition, is_the_same_every_time) {
  const auto box = tests::make_box({6, 5, 4}, {1, 1, 1});
  EXPECT_EQ(partition_elements(box.tets, 4).part, partition_elements(box.tets, 4).part);
}

TEST(Partition, of_two_separate_bodies_works_though_no_contiguous_one_may_exist) {
  auto corners = tests::make_box({4, 4, 4}, {1, 1, 1}).tets;
  const auto nodes = *std::max_element(corners.begin(), corners.end()) + 1;
  const auto first = corners;
  for (const auto corner : first) corners.push_back(corner + nodes);
  for (const int parts : {2, 3}) {
    const Partition cut = partition_elements(corners, parts);
    EXPECT_LT(cut.quality.balance, 1.1);
    EXPECT_EQ(static_cast<int>(cut.quality.elements.size()), parts);
  }
}

TEST(Partition, leaves_no_part_empty_down_to_one_element_each) {
  const auto cube = tests::make_box({1, 1, 1}, {1, 1, 1});
  for (int parts = 1; parts <= 6; ++parts)
    for (const auto size : partition_elements(cube.tets, parts).quality.elements) EXPECT_GT(size, 0) << parts << " parts";
}

TEST(Partition, refuses_more_parts_than_elements_and_says_how_many_ranks_to_start) {
  const auto cube = tests::make_box({1, 1, 1}, {1, 1, 1});
  tests::expect_error<InputError>({"6 tetrahedra, fewer than the 7 ranks; start at most 6"}, [&] { partition_elements(cube.tets, 7); });
  EXPECT_THROW(partition_elements(cube.tets, 0), InputError);
}

TEST(NestedDissection, is_a_permutation_with_far_less_fill_than_a_random_order) {
  const auto box = tests::make_box({9, 9, 9}, {1, 1, 1});
  const Graph graph = make_node_graph(box.tets, 4, static_cast<std::int32_t>(box.nodes_m.size()));
  const auto position = order_nested_dissection(graph);
  auto sorted = position;
  std::sort(sorted.begin(), sorted.end());
  std::vector<std::int32_t> natural(box.nodes_m.size());
  std::iota(natural.begin(), natural.end(), 0);
  ASSERT_EQ(sorted, natural);
  auto random = natural;
  std::shuffle(random.begin(), random.end(), std::mt19937(7));
  EXPECT_LT(2 * count_factor_entries(graph, position), count_factor_entries(graph, random));
  EXPECT_LT(count_factor_entries(graph, position), count_factor_entries(graph, natural));
}

TEST(NestedDissection, leaves_signals_to_the_program) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const auto box = tests::make_box({28, 28, 28}, {1, 1, 1});
  const Graph graph = make_node_graph(box.tets, 4, static_cast<std::int32_t>(box.nodes_m.size()));
  EXPECT_EXIT(
      {
        std::signal(SIGTERM, [](int) { _exit(42); });
        std::thread killer([] {
          std::this_thread::sleep_for(std::chrono::milliseconds(60));
          kill(getpid(), SIGTERM);
        });
        killer.detach();
        for (int repeat = 0; repeat < 100; ++repeat) (void)order_nested_dissection(graph);
      },
      testing::ExitedWithCode(42), "");
}

/// METIS would answer the signal by longjmp, also out of malloc, which then stays locked; or in the other thread, where it has no target.
/// Its k-way partition is recursive.
TEST(Metis, is_unaffected_by_signals_to_any_thread) {
  static std::atomic<int> caught;
  caught = 0;
  const auto box = tests::make_box({16, 16, 16}, {1, 1, 1});
  const Graph graph = make_node_graph(box.tets, 4, static_cast<std::int32_t>(box.nodes_m.size()));
  const auto expected_order = order_nested_dissection(graph);
  const auto expected_part = partition_elements(box.tets, 8).part;
  struct sigaction action {};
  struct sigaction before {};
  struct sigaction after {};
  action.sa_handler = [](int) { ++caught; };
  action.sa_flags = SA_RESTART;
  sigaddset(&action.sa_mask, SIGUSR2);
  sigaction(SIGTERM, &action, &before);
  int wrong = 0;
  {
    const auto main_thread = pthread_self();
    const std::jthread sender([&](const std::stop_token& stop) {
      for (int k = 0; !stop.stop_requested(); ++k) {
        if (k % 3 == 0) pthread_kill(main_thread, SIGTERM);
        if (k % 3 == 1) pthread_kill(pthread_self(), SIGTERM);
        if (k % 3 == 2) kill(getpid(), SIGTERM);
        std::this_thread::sleep_for(std::chrono::microseconds(100));
      }
    });
    for (int repeat = 0; repeat < 30; ++repeat) {
      wrong += order_nested_dissection(graph) != expected_order;
      wrong += partition_elements(box.tets, 8).part != expected_part;
    }
  }
  sigaction(SIGTERM, &before, &after);
  EXPECT_EQ(wrong, 0);
  EXPECT_GE(caught, 100);
  EXPECT_EQ(after.sa_handler, action.sa_handler);
  EXPECT_TRUE(sigismember(&after.sa_mask, SIGUSR2)) << "METIS restored it with other flags";
}

/// METIS raises SIGTERM for its own errors, through the functions overridden here, and leaves by longjmp.
TEST(Metis, that_raises_its_own_error_fails_and_leaves_the_handler_alone) {
  static std::jmp_buf place;
  struct sigaction before {};
  struct sigaction after {};
  sigaction(SIGTERM, nullptr, &before);
  const auto fail = [] {
    const auto outer = __sysv_signal(SIGTERM, [](int signal) { std::longjmp(place, signal); });
    const int thrown = setjmp(place);
    if (thrown == 0) return std::raise(SIGTERM);
    __sysv_signal(SIGTERM, outer);
    return static_cast<int>(METIS_ERROR);
  };
  EXPECT_THROW(call_metis("a call", fail), SystemError);
  sigaction(SIGTERM, nullptr, &after);
  EXPECT_EQ(after.sa_handler, before.sa_handler);
}

/// Outside METIS the two functions behave as in the C library.
TEST(Metis, leaves_signals_of_others_alone) {
  static std::atomic<int> caught;
  caught = 0;
  const auto before = __sysv_signal(SIGUSR1, [](int) { ++caught; });
  EXPECT_EQ(before, SIG_DFL);
  EXPECT_EQ(std::raise(SIGUSR1), 0);
  EXPECT_EQ(caught, 1);
  struct sigaction after {};
  sigaction(SIGUSR1, nullptr, &after);
  EXPECT_EQ(after.sa_handler, SIG_DFL) << "for one signal only, as System V did";
  EXPECT_EQ(std::raise(-1), -1);
  EXPECT_EQ(errno, EINVAL);
}

TEST(NestedDissection, of_a_graph_without_edges_is_the_identity) {
  EXPECT_EQ(order_nested_dissection(make_node_graph({}, 4, 3)), (std::vector<std::int32_t>{0, 1, 2}));
  EXPECT_TRUE(order_nested_dissection(Graph{}).empty());
}

}  // namespace
}  // namespace carillon::partition
