// Memory of own fronts: no overlap, no unused memory, and no better order of children.
#include "precompute/ldlt/room.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "precompute/ldlt/deal.hpp"
#include "precompute/ldlt/plan.hpp"
#include "precompute/ldlt/storage.hpp"

namespace carillon::ldlt {
namespace {

using Random = std::mt19937;

int draw(Random& random, int low, int high) { return std::uniform_int_distribution(low, high)(random); }

/// A forest in postorder; roots may have rows, which go to a shared front.
std::vector<Front> make_forest(Random& random, int count) {
  std::vector<Front> fronts(count);
  std::vector<std::int32_t> open;  // roots of the subtrees so far
  for (std::int32_t s = 0; s < count; ++s) {
    Front& front = fronts[s];
    front.width = draw(random, 1, 60);
    front.rows.assign(draw(random, 0, 90), 0);
    for (int below = draw(random, 0, 3); below > 0 && !open.empty(); --below) {
      fronts[open.back()].parent = s;
      front.children.insert(front.children.begin(), open.back());
      open.pop_back();
    }
    open.push_back(s);
  }
  for (std::size_t s = fronts.size(); s-- > 0;)
    if (fronts[s].parent >= 0) fronts[s].depth = fronts[fronts[s].parent].depth + 1;
  return fronts;
}

struct Span {
  std::int64_t begin, end;
};

TEST(Room, live_data_does_not_overlap) {
  Random random(5);
  for (int round = 0; round < 200; ++round) {
    const std::vector<Front> fronts = make_forest(random, draw(random, 1, 40));
    const std::int64_t block = draw(random, 1, 20'000);
    const Room room = plan_room(fronts, 0, 2, block);
    std::vector<Span> updates(fronts.size(), {0, 0});  // empty: not live
    std::int64_t panels = 0;
    std::int64_t least_gap = std::numeric_limits<std::int64_t>::max();
    for (std::size_t s = 0; s < fronts.size(); ++s) {
      const Front& front = fronts[s];
      std::int64_t top[2] = {room.stack_begin[0], room.stack_begin[1]};
      for (std::size_t k = 0; k < s; ++k)
        if (updates[k].end > updates[k].begin) top[fronts[k].depth % 2] = std::min(top[fronts[k].depth % 2], updates[k].begin);
      std::int64_t& own_top = top[front.depth % 2];
      updates[s] = {own_top - count_update_of(front.rows), own_top};
      own_top = updates[s].begin;
      std::vector<Span> live{{0, panels + count_front_room(front.width, front.size())}};  // panels, and columns of the current front
      for (const Span& update : updates)
        if (update.end > update.begin) live.push_back(update);
      std::sort(live.begin(), live.end(), [](const Span& a, const Span& b) { return a.begin < b.begin; });
      for (std::size_t k = 1; k < live.size(); ++k) ASSERT_LE(live[k - 1].end, live[k].begin) << "front " << s << " of round " << round;
      ASSERT_LE(live.back().end, room.numbers);
      least_gap = std::min(least_gap, std::min(top[0], top[1]) - live[0].end);
      panels += count_stored(front.width, front.size());
      for (const std::int32_t child : front.children) updates[child] = {0, 0};
      if (front.parent < 0) updates[s] = {0, 0};  // sent to a shared front
    }
    EXPECT_EQ(panels, room.panels);
    for (const Span& update : updates) EXPECT_EQ(update.begin, update.end) << "a contribution block was neither added nor sent";
    EXPECT_EQ(least_gap, 0) << "unused room, in round " << round;
    EXPECT_LE(room.solve_begin() + room.solve_blocks * block, std::max(room.numbers, room.solve_begin()));
  }
}

TEST(Room, reuses_memory_for_right_hand_sides) {
  Front leaf;
  leaf.width = 50;
  leaf.rows.assign(100, 0);
  const std::vector<Front> fronts{leaf};
  const Room none = plan_room(fronts, 0, 2, 1'000'000'000);
  EXPECT_EQ(none.solve_blocks, 0);
  const std::int64_t spare = none.numbers - none.solve_begin();
  EXPECT_GT(spare, 0);
  EXPECT_EQ(plan_room(fronts, 0, 2, spare).solve_blocks, 1);
  EXPECT_EQ(plan_room(fronts, 0, 2, spare / 2).solve_blocks, 2);
  EXPECT_EQ(plan_room(fronts, 0, 2, spare / 5).solve_blocks, 2) << "more than requested";
  EXPECT_EQ(plan_room(fronts, 1'000'000, 2, spare).numbers, plan_room(fronts, 0, 2, spare).panels + 1'000'000) << "shared panels fill it";
  EXPECT_EQ(plan_room({}, 0, 2, 1).numbers, 0);
}

/// Peak of panels, contribution blocks and current front for this order of children.
std::int64_t play(const std::vector<DealtFront>& dealt, const std::vector<Ints>& children, const Ints& roots) {
  std::int64_t now = 0;
  std::int64_t most = 0;
  const auto eliminate = [&](auto&& self, std::int32_t d, bool is_root) -> void {
    const DealtFront& front = dealt[d];
    for (const std::int32_t child : children[d]) self(self, child, false);
    const auto size = static_cast<std::int32_t>(front.nodes.size() + front.rows.size());
    const std::int64_t update = count_update_of(front.rows);
    most = std::max(most, now + count_front_room(front.width(), size) + update);
    now += count_stored(front.width(), size) + (is_root ? 0 : update);
    for (const std::int32_t child : children[d]) now -= count_update_of(dealt[child].rows);
  };
  for (const std::int32_t root : roots) eliminate(eliminate, root, true);
  return most;
}

TEST(Room, no_other_order_of_children_takes_less) {
  Random random(11);
  int improved = 0;
  for (int round = 0; round < 60; ++round) {
    // Two roots of up to three children with two leaves each: tries every order.
    std::vector<DealtFront> dealt;
    std::vector<Ints> children;
    Ints roots;
    const auto add = [&](Ints below) {
      DealtFront& front = dealt.emplace_back();
      front.nodes.assign(draw(random, 1, 80), 0);
      front.rows.assign(draw(random, 0, 120), 0);
      children.push_back(std::move(below));
      return static_cast<std::int32_t>(dealt.size()) - 1;
    };
    for (int r = 0; r < 2; ++r) {
      Ints inner;
      for (int c = draw(random, 1, 3); c > 0; --c) {
        const std::int32_t first = add({});
        inner.push_back(add({first, add({})}));
      }
      roots.push_back(add(inner));
    }
    std::int64_t least = std::numeric_limits<std::int64_t>::max();
    std::vector<Ints> tried = children;
    Ints tried_roots = roots;
    std::vector<Ints*> lists{&tried_roots};
    for (Ints& list : tried)
      if (list.size() > 1) lists.push_back(&list);
    const auto try_all = [&](auto&& self, std::size_t k) -> void {
      if (k == lists.size()) {
        least = std::min(least, play(dealt, tried, tried_roots));
        return;
      }
      std::sort(lists[k]->begin(), lists[k]->end());
      do self(self, k + 1);
      while (std::next_permutation(lists[k]->begin(), lists[k]->end()));
    };
    try_all(try_all, 0);
    const std::int64_t before = play(dealt, children, roots);
    sort_by_room(dealt, children, roots);
    EXPECT_EQ(play(dealt, children, roots), least) << round;
    improved += before > least ? 1 : 0;
  }
  EXPECT_GT(improved, 20) << "all orders are equal";
}

}  // namespace
}  // namespace carillon::ldlt
