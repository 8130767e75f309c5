#include "precompute/mesh/build_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace carillon::mesh {

namespace {

/// Maps file tags to indices: a table for dense tags, a sorted list for sparse ones.
class TagTable {
 public:
  TagTable(const RawMesh& raw, const Cursor& cursor) {
    const auto& tags = raw.node_tags;
    const auto [low, high] = std::minmax_element(tags.begin(), tags.end());
    low_ = *low;
    // Unsigned arithmetic: the tags of a damaged file may span all of int64.
    const std::uint64_t span = static_cast<std::uint64_t>(*high) - static_cast<std::uint64_t>(*low);
    if (span < 4 * tags.size() + 1024) {
      dense_.assign(span + 1, -1);
      for (std::size_t i = 0; i < tags.size(); ++i) {
        auto& slot = dense_[tags[i] - low_];
        if (slot >= 0) refuse_twin(raw, cursor, i);
        slot = static_cast<std::int32_t>(i);
      }
      return;
    }
    sorted_.reserve(tags.size());
    for (std::size_t i = 0; i < tags.size(); ++i) sorted_.emplace_back(tags[i], static_cast<std::int32_t>(i));
    std::sort(sorted_.begin(), sorted_.end());
    for (std::size_t i = 1; i < sorted_.size(); ++i)
      if (sorted_[i].first == sorted_[i - 1].first) refuse_twin(raw, cursor, static_cast<std::size_t>(sorted_[i].second));
  }

  /// Index of the node; -1 for an unknown tag.
  std::int32_t find(std::int64_t tag) const {
    if (!dense_.empty()) {
      const std::uint64_t offset = static_cast<std::uint64_t>(tag) - static_cast<std::uint64_t>(low_);
      return offset < dense_.size() ? dense_[offset] : -1;
    }
    const auto found = std::lower_bound(sorted_.begin(), sorted_.end(), std::pair{tag, std::numeric_limits<std::int32_t>::min()});
    return found != sorted_.end() && found->first == tag ? found->second : -1;
  }

 private:
  [[noreturn]] static void refuse_twin(const RawMesh& raw, const Cursor& cursor, std::size_t i) {
    cursor.fail(raw.node_places[i], "node {} is defined a second time; give every node a number of its own", raw.node_tags[i]);
  }
  std::int64_t low_ = 0;
  std::vector<std::int32_t> dense_;
  std::vector<std::pair<std::int64_t, std::int32_t>> sorted_;
};

void sort_set(std::vector<std::int32_t>& set, std::size_t node_count) {
  if (set.size() < node_count / 16) {
    std::sort(set.begin(), set.end());
    set.erase(std::unique(set.begin(), set.end()), set.end());
    return;
  }
  std::vector<char> inside(node_count, 0);
  for (const auto i : set) inside[i] = 1;
  set.clear();
  for (std::size_t i = 0; i < node_count; ++i)
    if (inside[i]) set.push_back(static_cast<std::int32_t>(i));
}

}  // namespace

void RawMesh::add_node(const Cursor& cursor, std::int64_t tag, const Vec3& x, std::size_t place) {
  for (const double value : x)
    if (!std::isfinite(value))
      cursor.fail(place, "node {} has the coordinates ({}, {}, {}), which are not all finite; correct the mesh where it was made", tag,
                  x[0], x[1], x[2]);
  if (nodes.size() >= static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
    cursor.fail(place, "more than 2147483647 nodes; use a coarser mesh");
  node_tags.push_back(tag);
  node_places.push_back(place);
  nodes.push_back(x);
}

void RawMesh::add_tet(const Cursor& cursor, std::int64_t tag, const std::int64_t* tags, int node_count, const int* file_position,
                      std::int32_t region, std::size_t place) {
  const int own_order = node_count == 4 ? 1 : 2;
  if (order != 0 && order != own_order)
    cursor.fail(place, "element {} is a {} tetrahedron among {} ones; write all of them in one order", tag,
                own_order == 1 ? "linear" : "quadratic", order == 1 ? "linear" : "quadratic");
  order = own_order;
  for (int i = 0; i < node_count; ++i) tets.push_back(tags[file_position[i]]);
  tet_tags.push_back(tag);
  tet_places.push_back(place);
  regions.push_back(region);
}

std::vector<std::int64_t> merge_repeated_tets(RawMesh& raw) {
  const std::size_t count = raw.tet_tags.size();
  const std::size_t width = raw.order == 2 ? 10 : 4;
  const auto nodes_of = [&](std::size_t e) { return raw.tets.begin() + static_cast<std::ptrdiff_t>(e * width); };
  const auto end_of = [&](std::size_t e) { return nodes_of(e) + static_cast<std::ptrdiff_t>(width); };
  std::vector<std::size_t> sorted(count);
  for (std::size_t e = 0; e < count; ++e) sorted[e] = e;
  std::sort(sorted.begin(), sorted.end(), [&](std::size_t a, std::size_t b) {
    const auto order = std::lexicographical_compare_three_way(nodes_of(a), end_of(a), nodes_of(b), end_of(b));
    return order < 0 || (order == 0 && a < b);
  });
  std::vector<std::size_t> first(count);  // the earliest element with the same nodes
  for (std::size_t i = 0; i < count; ++i) {
    const bool same = i > 0 && std::equal(nodes_of(sorted[i]), end_of(sorted[i]), nodes_of(sorted[i - 1]));
    first[sorted[i]] = same ? first[sorted[i - 1]] : sorted[i];
  }
  std::vector<std::int64_t> position(count);
  std::size_t kept = 0;
  for (std::size_t e = 0; e < count; ++e) {
    // A copy within the same region is a mesh error, which check_mesh reports.
    const auto original = first[e] == e ? kept : static_cast<std::size_t>(position[first[e]]);
    if (first[e] != e && raw.regions[e] != raw.regions[original]) {
      position[e] = static_cast<std::int64_t>(original);
      continue;
    }
    position[e] = static_cast<std::int64_t>(kept);
    std::copy(nodes_of(e), end_of(e), nodes_of(kept));
    raw.tet_tags[kept] = raw.tet_tags[e];
    raw.tet_places[kept] = raw.tet_places[e];
    raw.regions[kept] = raw.regions[e];
    ++kept;
  }
  raw.tets.resize(kept * width);
  raw.tet_tags.resize(kept);
  raw.tet_places.resize(kept);
  raw.regions.resize(kept);
  return position;
}

TetMesh build_mesh(RawMesh&& raw, const Cursor& nodes, const Cursor& elements) {
  if (raw.nodes.empty()) throw InputError(fmt::format("{}: the file has no nodes; write the mesh again", nodes.name()));
  if (raw.tet_tags.empty()) {
    std::string others;
    for (const auto& [kind, count] : raw.others) others += fmt::format("{}{} {}", others.empty() ? "" : ", ", count, kind);
    throw InputError(fmt::format("{}: the file has no tetrahedra{}; mesh the volume first (a closed surface with carillon-mesh)",
                                 elements.name(), others.empty() ? "" : " (only " + others + ")"));
  }
  if (raw.tet_tags.size() > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
    throw InputError(fmt::format("{}: more than 2147483647 tetrahedra; use a coarser mesh", elements.name()));
  const TagTable table(raw, nodes);
  TetMesh mesh;
  mesh.order = raw.order;
  const std::size_t width = mesh.nodes_per_tet();
  mesh.tets.resize(raw.tets.size());
  for (std::size_t k = 0; k < raw.tets.size(); ++k) {
    mesh.tets[k] = table.find(raw.tets[k]);
    if (mesh.tets[k] < 0)
      elements.fail(raw.tet_places[k / width],
                    "element {} refers to node {}, which the file does not define; write the mesh again with all nodes saved",
                    raw.tet_tags[k / width], raw.tets[k]);
  }
  mesh.nodes_m = std::move(raw.nodes);
  mesh.regions = std::move(raw.regions);
  for (const auto& [name, references] : raw.node_sets) {
    auto& set = mesh.node_sets[name];
    for (const auto& reference : references) {
      set.push_back(table.find(reference.node_tag));
      if (set.back() < 0)
        elements.fail(
            reference.place,
            "an element of the group '{}' refers to node {}, which the file does not define; write the mesh again with all nodes saved",
            name, reference.node_tag);
    }
  }
  for (const auto& [name, positions] : raw.tet_sets) {
    auto& set = mesh.node_sets[name];
    for (const auto e : positions) set.insert(set.end(), mesh.tet(e).begin(), mesh.tet(e).end());
  }
  for (auto& [name, set] : mesh.node_sets) sort_set(set, mesh.nodes_m.size());
  return mesh;
}

void add_value_sets(const std::string& prefix, const std::vector<std::int64_t>& values, std::size_t first_node, TetMesh& mesh) {
  constexpr std::size_t kMaxSets = 1000;
  std::map<std::int64_t, std::vector<std::int32_t>> sets;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (values[i] == 0) continue;
    sets[values[i]].push_back(static_cast<std::int32_t>(first_node + i));
    if (sets.size() > kMaxSets) return;
  }
  for (auto& [value, nodes] : sets) {
    auto& set = mesh.node_sets[fmt::format("{}:{}", prefix, value)];
    set.insert(set.end(), nodes.begin(), nodes.end());
  }
}

}  // namespace carillon::mesh
