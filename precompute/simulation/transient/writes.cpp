// Method: see WritePlan.
#include "precompute/simulation/transient/writes.hpp"

#include <algorithm>
#include <span>

namespace carillon::transient {

void WritePlan::gather(Quad* f) const {
  for (std::size_t i = 0; i < summed.size(); ++i) {
    Quad sum = f[summed[i]];
    for (std::int32_t slot = slot_begin[i]; slot < slot_begin[i + 1]; ++slot) {
      sum.x += f[slot].x;
      sum.y += f[slot].y;
      sum.z += f[slot].z;
    }
    f[summed[i]] = sum;
  }
}

WritePlan plan_writes(const ElementNodes& elements, std::int32_t own_nodes, std::int32_t first_slot, std::int32_t no_entry) {
  WritePlan plan;
  std::vector<std::int32_t> slots(own_nodes, 0);  // contributions of each own node
  const auto list = [&](std::size_t e) {
    return std::span<const std::int32_t>(elements.nodes.data() + elements.begin[e],
                                         static_cast<std::size_t>(elements.begin[e + 1] - elements.begin[e]));
  };
  std::vector<char> by_halo(own_nodes, 0);
  for (std::size_t e = 0; e < elements.count(); ++e) {
    const auto nodes = list(e);
    const bool is_outer = std::any_of(nodes.begin(), nodes.end(), [&](std::int32_t node) { return node >= own_nodes; });
    (is_outer ? plan.outer : plan.inner).push_back(static_cast<std::int32_t>(e));
    if (!is_outer) continue;
    for (const std::int32_t node : nodes)
      if (node < own_nodes) by_halo[node] = 1;
  }
  for (const std::int32_t node : elements.nodes)
    if (node < own_nodes) ++slots[node];
  std::vector<std::int32_t> next(own_nodes, 0);
  std::int32_t slot = first_slot;
  for (std::int32_t node = 0; node < own_nodes; ++node) {
    const std::size_t n = node;
    if (by_halo[n] == 0) continue;
    plan.summed.push_back(node);
    plan.slot_begin.push_back(slot);
    next[n] = slot;
    slot += slots[n];
  }
  plan.slot_begin.push_back(slot);
  plan.last_slot = slot;
  for (const std::int32_t node : elements.nodes) {
    const std::size_t n = node;
    plan.writes.push_back(node >= own_nodes ? no_entry : by_halo[n] != 0 ? next[n]++ : node);
  }
  return plan;
}

}  // namespace carillon::transient
