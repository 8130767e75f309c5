// Method: Elimination tree by path compression; column counts by walking the row subtrees; supernodes of equal structure along the
// postorder. Children are then merged into parents where a time model (fixed cost per front, row, entry, flop and entry of the contribution
// block) predicts that the stored zeros cost less than a separate front. Modelled time replaces the bound on zeros of Ashcraft and Grimes,
// as solves and factorisation have different weights.
// Source: Liu 1990, The role of elimination trees in sparse factorization (tree, row subtrees); Liu, Ng, Peyton 1993, On finding
// supernodes; Ashcraft and Grimes 1989, The influence of relaxed supernode partitions on the multifrontal method.
#include "precompute/ldlt/symbolic.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>

namespace carillon::ldlt {
namespace {

using Ints = std::vector<std::int32_t>;
using partition::Graph;

// Measured by tests/bench/ldlt on one core of Zen 5 with AVX-512: a factorisation and 30 solves of 16 columns.
constexpr double kFrontNs = 14'000;   // calls, lists and loops too short for vector units
constexpr double kRowNs = 120;        // read and write of a row of a right-hand side
constexpr double kEntryNs = 24;       // use of an entry of L in the solves
constexpr double kFlopNs = 1.0 / 60;  // per flop of the factorisation
constexpr double kUpdateNs = 1.0;     // clearing an entry of the contribution block and adding it to the parent

/// Parent of each eliminated vertex v < count; -1 at roots.
Ints find_elimination_tree(const Graph& graph, std::int32_t count) {
  Ints parent(count, -1);
  Ints ancestor(count, -1);
  for (std::int32_t i = 0; i < count; ++i)
    for (std::int32_t k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k)
      for (std::int32_t v = graph.neighbours[k]; v < i && v != -1;) {
        const std::int32_t next = ancestor[v];
        if (next == i) break;
        ancestor[v] = i;
        if (next == -1) parent[v] = i;
        v = next;
      }
  return parent;
}

/// Nodes in each column of L including the diagonal: row i fills the columns on the tree paths from its neighbours to i.
Ints count_columns(const Graph& graph, const Ints& parent) {
  const auto count = static_cast<std::int32_t>(parent.size());
  Ints columns(count, 1);
  Ints mark(count, -1);
  for (std::int32_t i = 0; i < graph.vertex_count(); ++i) {
    if (i < count) mark[i] = i;
    for (std::int32_t k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k)
      for (std::int32_t v = graph.neighbours[k]; v < std::min(i, count) && v != -1 && mark[v] != i; v = parent[v]) {
        ++columns[v];
        mark[v] = i;
      }
  }
  return columns;
}

/// Children lists as offsets and items; roots are the children of `count`.
void list_children(const Ints& parent, Ints& offsets, Ints& items) {
  const std::size_t count = parent.size();
  const auto slot = [&](std::int32_t p) { return p < 0 ? count : static_cast<std::size_t>(p); };
  offsets.assign(count + 2, 0);
  for (const std::int32_t p : parent) ++offsets[slot(p) + 1];
  std::partial_sum(offsets.begin(), offsets.end(), offsets.begin());
  items.resize(count);
  Ints next(offsets.begin(), offsets.end() - 1);
  for (std::size_t v = 0; v < count; ++v) items[next[slot(parent[v])]++] = static_cast<std::int32_t>(v);
}

/// order[i]: i-th vertex in a postorder, in which every subtree is contiguous and ends with its root.
Ints find_postorder(const Ints& parent) {
  Ints offsets;
  Ints items;
  list_children(parent, offsets, items);
  Ints order(parent.size());
  Ints stack(items.begin() + offsets[parent.size()], items.end());
  // Filled in reverse: parents before children.
  for (std::size_t place = parent.size(); place-- > 0;) {
    const std::int32_t v = stack.back();
    stack.pop_back();
    order[place] = v;
    stack.insert(stack.end(), items.begin() + offsets[v], items.begin() + offsets[v + 1]);
  }
  return order;
}

/// A supernode during amalgamation.
struct Group {
  std::int32_t parent = -1;
  std::int64_t width = 0, size = 0;
  Ints vertices;  // in elimination order
  Ints children;
  bool is_merged = false;
};

/// Supernodes of equal structure: v follows u if it is the parent of u and column u consists of u and the structure of v.
std::vector<Group> group_equal_columns(const Ints& parent, const Ints& columns, std::int32_t elements) {
  const auto count = static_cast<std::int32_t>(parent.size());
  Ints pivot_parent(count - elements);
  for (std::int32_t v = elements; v < count; ++v) pivot_parent[v - elements] = parent[v] < 0 ? -1 : parent[v] - elements;
  std::vector<Group> groups;
  Ints group_of(count, -1);
  std::int32_t last = -1;
  for (const std::int32_t pivot : find_postorder(pivot_parent)) {
    const std::int32_t v = pivot + elements;
    if (last < 0 || parent[last] != v || columns[last] != columns[v] + 1) {
      groups.emplace_back();
      groups.back().size = columns[v];
    }
    groups.back().vertices.push_back(v);
    ++groups.back().width;
    group_of[v] = static_cast<std::int32_t>(groups.size()) - 1;
    last = v;
  }
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const std::int32_t up = parent[groups[g].vertices.back()];
    groups[g].parent = up < 0 ? -1 : group_of[up];
    if (up >= 0) groups[group_of[up]].children.push_back(static_cast<std::int32_t>(g));
  }
  return groups;
}

/// Merges children into parents while the modelled time decreases, best child first. A merged front has the rows of the parent.
void amalgamate(std::vector<Group>& groups) {
  for (Group& parent : groups) {
    while (true) {
      double best_gain = 0;
      std::size_t best = parent.children.size();
      const double parent_cost = calc_cost_ns(parent.width, parent.size);
      for (std::size_t k = 0; k < parent.children.size(); ++k) {
        const Group& child = groups[parent.children[k]];
        const double gain =
            parent_cost + calc_cost_ns(child.width, child.size) - calc_cost_ns(parent.width + child.width, parent.size + child.width);
        if (gain > best_gain) {
          best_gain = gain;
          best = k;
        }
      }
      if (best == parent.children.size()) break;
      Group& child = groups[parent.children[best]];
      parent.children.erase(parent.children.begin() + static_cast<std::ptrdiff_t>(best));
      parent.children.insert(parent.children.end(), child.children.begin(), child.children.end());
      parent.width += child.width;
      parent.size += child.width;
      child.vertices.insert(child.vertices.end(), parent.vertices.begin(), parent.vertices.end());
      parent.vertices = std::move(child.vertices);
      child = Group{};
      child.is_merged = true;
    }
  }
}

/// Parents of the remaining groups, in their new numbering.
Ints number_groups(std::vector<Group>& groups, Ints& kept) {
  for (std::size_t g = 0; g < groups.size(); ++g)
    for (const std::int32_t child : groups[g].children) groups[child].parent = static_cast<std::int32_t>(g);
  Ints number(groups.size(), -1);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    if (groups[g].is_merged) continue;
    number[g] = static_cast<std::int32_t>(kept.size());
    kept.push_back(static_cast<std::int32_t>(g));
  }
  Ints parent;
  for (const std::int32_t g : kept) parent.push_back(groups[g].parent < 0 ? -1 : number[groups[g].parent]);
  return parent;
}

/// Rows of each supernode: rows behind its pivots in the structure of its pivots, children and elements.
void fill_rows(const Graph& graph, const Ints& parent, std::int32_t elements, const std::vector<Ints>& vertices, Forest& forest) {
  const auto pivots = static_cast<std::int32_t>(forest.position.size());
  const auto place = [&](std::int32_t v) { return v < elements + pivots ? forest.position[v - elements] : v - elements; };
  Ints supernode_of(pivots);
  for (std::size_t s = 0; s < vertices.size(); ++s)
    for (const std::int32_t v : vertices[s]) supernode_of[place(v)] = static_cast<std::int32_t>(s);
  std::vector<Ints> hubs_of(vertices.size());
  forest.element_parents.assign(elements, -1);
  for (std::int32_t h = 0; h < elements; ++h) {
    if (parent[h] < 0) continue;
    forest.element_parents[h] = supernode_of[place(parent[h])];
    hubs_of[forest.element_parents[h]].push_back(h);
  }
  std::vector<Ints> children(vertices.size());
  Ints mark(graph.vertex_count() - elements, -1);
  for (std::size_t s = 0; s < vertices.size(); ++s) {
    Supernode& node = forest.supernodes[s];
    const std::int32_t behind = node.first + node.width;
    const auto add = [&](std::int32_t row) {
      if (row < behind || mark[row] == static_cast<std::int32_t>(s)) return;
      mark[row] = static_cast<std::int32_t>(s);
      node.rows.push_back(row);
    };
    const auto add_neighbours = [&](std::int32_t v) {
      for (std::int32_t k = graph.offsets[v]; k < graph.offsets[v + 1]; ++k)
        if (graph.neighbours[k] >= elements) add(place(graph.neighbours[k]));
    };
    for (const std::int32_t v : vertices[s]) add_neighbours(v);
    for (const std::int32_t h : hubs_of[s]) add_neighbours(h);
    for (const std::int32_t child : children[s])
      for (const std::int32_t row : forest.supernodes[child].rows) add(row);
    std::sort(node.rows.begin(), node.rows.end());
    node.parent = node.rows.empty() || node.rows.front() >= pivots ? -1 : supernode_of[node.rows.front()];
    if (node.parent >= 0) children[node.parent].push_back(static_cast<std::int32_t>(s));
  }
}

}  // namespace

std::int64_t count_entries(std::int64_t width, std::int64_t size) {
  const std::int64_t w = 3 * width;
  return w * (w + 1) / 2 + w * 3 * (size - width);
}

double count_flops(std::int64_t width, std::int64_t size) {
  const double w = 3.0 * static_cast<double>(width);
  const double r = 3.0 * static_cast<double>(size - width);
  return w * w * w / 3 + w * w * r + w * r * r;  // diagonal block, rows below, lower triangle of the update
}

double calc_cost_ns(std::int64_t width, std::int64_t size) {
  const double r = 3.0 * static_cast<double>(size - width);
  return kFrontNs + kRowNs * r + kEntryNs * static_cast<double>(count_entries(width, size)) + kFlopNs * count_flops(width, size) +
         kUpdateNs * r * r / 2;
}

Forest find_supernodes(const Graph& graph, std::int32_t elements, std::int32_t pivots) {
  const Ints parent = find_elimination_tree(graph, elements + pivots);
  std::vector<Group> groups = group_equal_columns(parent, count_columns(graph, parent), elements);
  amalgamate(groups);
  Ints kept;
  const Ints group_parent = number_groups(groups, kept);
  Forest forest;
  forest.position.resize(pivots);
  std::vector<Ints> vertices;
  std::int32_t next = 0;
  for (const std::int32_t k : find_postorder(group_parent)) {
    Group& group = groups[kept[k]];
    Supernode& node = forest.supernodes.emplace_back();
    node.first = next;
    node.width = static_cast<std::int32_t>(group.width);
    for (const std::int32_t v : group.vertices) forest.position[v - elements] = next++;
    vertices.push_back(std::move(group.vertices));
  }
  fill_rows(graph, parent, elements, vertices, forest);
  return forest;
}

}  // namespace carillon::ldlt
