// Method: Contribution blocks are kept on two stacks by the parity of their depth: those of the children are on the other stack than the
// block of the front, so it can be computed while they are read, without moving data. Stacks and the columns of the current front occupy
// the memory of the panels of later fronts. The factorisation is simulated: one stack has its own region at the end; the other, before it,
// grows towards the panels. The assignment with less memory is taken. The order of children assumes one stack, and counts panels as memory.
// Source: Liu 1986, On the storage requirement in the out-of-core multifrontal method for sparse factorization (order of children); Liu
// 1992, The multifrontal method for sparse matrix solution (stacks).
#include "precompute/ldlt/room.hpp"

#include <algorithm>

#include "precompute/ldlt/deal.hpp"
#include "precompute/ldlt/plan.hpp"
#include "precompute/ldlt/storage.hpp"

namespace carillon::ldlt {

Room plan_room(const std::vector<Front>& fronts, std::int64_t shared_columns, int blocks, std::int64_t block) {
  Room room;
  std::int64_t used[2] = {0, 0};
  std::int64_t most_used[2] = {0, 0};
  std::int64_t most_below[2] = {0, 0};  // a stack with the panels and columns below it
  for (const Front& front : fronts) {
    used[front.depth % 2] += count_update_of(front.rows);
    for (int parity = 0; parity < 2; ++parity) {
      most_used[parity] = std::max(most_used[parity], used[parity]);
      most_below[parity] = std::max(most_below[parity], room.panels + count_front_room(front.width, front.size()) + used[parity]);
    }
    room.panels += count_stored(front.width, front.size());
    if (front.parent < 0) used[front.depth % 2] -= count_update_of(front.rows);  // already sent to the shared front
    for (const std::int32_t child : front.children) used[fronts[child].depth % 2] -= count_update_of(fronts[child].rows);
  }
  const int apart = most_used[0] + most_below[1] <= most_used[1] + most_below[0] ? 0 : 1;
  room.panels += shared_columns;
  room.numbers = std::max(most_used[apart] + most_below[1 - apart], room.panels);
  room.stack_begin[apart] = room.numbers;
  room.stack_begin[1 - apart] = room.numbers - most_used[apart];
  while (room.solve_blocks < blocks && room.solve_begin() + (room.solve_blocks + 1) * block <= room.numbers) ++room.solve_blocks;
  return room;
}

void sort_by_room(const std::vector<DealtFront>& dealt, std::vector<Ints>& children, Ints& roots) {
  std::vector<std::int64_t> most(dealt.size(), 0);  // peak of a subtree
  std::vector<std::int64_t> left(dealt.size(), 0);  // remainder: its panels and one contribution block
  const auto sort = [&](Ints& list) {
    std::stable_sort(list.begin(), list.end(), [&](std::int32_t a, std::int32_t b) { return most[a] - left[a] > most[b] - left[b]; });
  };
  std::vector<bool> is_root(dealt.size(), false);  // its contribution block is sent to a shared front at once
  for (const std::int32_t root : roots) is_root[root] = true;
  for (std::size_t d = 0; d < dealt.size(); ++d) {
    sort(children[d]);
    std::int64_t before = 0;  // panels and contribution blocks of the children
    std::int64_t updates = 0;
    for (const std::int32_t child : children[d]) {
      most[d] = std::max(most[d], before + most[child]);
      before += left[child];
      updates += count_update_of(dealt[child].rows);
    }
    const std::int32_t width = dealt[d].width();
    const auto size = static_cast<std::int32_t>(dealt[d].nodes.size() + dealt[d].rows.size());
    const std::int64_t update = count_update_of(dealt[d].rows);
    most[d] = std::max(most[d], before + count_front_room(width, size) + update);
    left[d] = before - updates + count_stored(width, size) + (is_root[d] ? 0 : update);
  }
  sort(roots);
}

}  // namespace carillon::ldlt
