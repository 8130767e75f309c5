// Method: every rank reads an equal range of nodes and elements and requests node data from the owners. Mid nodes are numbered in the order
//   of their edges (low corner, then high corner), which the owners of the low corners sort.
#include "precompute/mesh/parallel/read_block.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>

#include "precompute/comm/exchange.hpp"
#include "precompute/mesh/parallel/source.hpp"
#include "precompute/mesh/read.hpp"
#include "runtime/base/error.hpp"

namespace carillon::parallel_mesh {
namespace {

using mesh::MeshBlock;

constexpr double kMinVolumeRatio = 1e-9;              // as mesh::check_mesh: 6 V / (longest edge)^3
constexpr int kLinearType = 10, kQuadraticType = 24;  // VTK cell types

std::string list_elements(const std::vector<std::int64_t>& elements, std::int64_t total) {
  std::string text;
  for (std::size_t i = 0; i < std::min<std::size_t>(elements.size(), 10); ++i)
    text += fmt::format("{}{}", i == 0 ? "" : ", ", elements[i] + 1);
  if (total > 10) text += fmt::format(" and {} more", total - 10);
  return text + " (tetrahedra counted from 1 in the order of the file)";
}

/// Throws on every rank if any rank found bad elements. `what` completes "3 elements ..."; `remedy` follows the list. Collective.
void refuse_elements(const comm::Communicator& comm, const std::string& name, const std::vector<std::int64_t>& bad, const char* what,
                     const char* remedy) {
  const auto total = comm.sum(static_cast<std::int64_t>(bad.size()));
  if (total == 0) return;
  const auto listed =
      comm.all_gather([&] { return std::vector(bad.begin(), bad.begin() + std::min<std::ptrdiff_t>(std::ssize(bad), 10)); });
  throw InputError(
      fmt::format("{}: {} element{} {}: {}; {}", name, total, total == 1 ? "" : "s", what, list_elements(listed, total), remedy));
}

/// Distinct nodes of this rank's elements, ascending, and the index of each element node among them.
struct Touched {
  std::vector<std::int32_t> nodes;
  std::vector<std::int32_t> place;  // (e, width)
};

Touched find_touched(const std::vector<std::int32_t>& tets) {
  Touched touched;
  touched.nodes = tets;
  std::sort(touched.nodes.begin(), touched.nodes.end());
  touched.nodes.erase(std::unique(touched.nodes.begin(), touched.nodes.end()), touched.nodes.end());
  touched.nodes.shrink_to_fit();
  touched.place.reserve(tets.size());
  for (const std::int32_t node : tets)
    touched.place.push_back(
        static_cast<std::int32_t>(std::lower_bound(touched.nodes.begin(), touched.nodes.end(), node) - touched.nodes.begin()));
  return touched;
}

std::string describe_cell(std::int64_t type, std::int64_t cell) {
  return fmt::format(
      "cell {} is of VTK type {}; only tetrahedra are read (type 10, or 24 with ten nodes, all of one kind): leave the others away",
      cell + 1, type);
}

/// Element order by the type of the first cell, if the arrays match it.
int find_order(const Source& source, const std::string& name, const Layout& layout, std::int64_t& type) {
  type = source.read<std::int64_t>(layout.types, 0, 1).front();
  if (type != kLinearType && type != kQuadraticType) throw InputError(fmt::format("{}: {}", name, describe_cell(type, 0)));
  const int order = type == kLinearType ? 1 : 2, width = order == 1 ? 4 : 10;
  if (layout.connectivity.rows != layout.types.rows * width)
    throw InputError(fmt::format("{}: Connectivity has {} entries for {} tetrahedra of {} nodes; write the mesh again", name,
                                 layout.connectivity.rows, layout.types.rows, width));
  return order;
}

void check_cells(const Source& source, const std::string& name, const Layout& layout, std::int64_t type, const MeshBlock& block) {
  const std::int64_t begin = block.elements.own_begin(), count = block.elements.own_count();
  const auto width = static_cast<std::int64_t>(block.width());
  const auto types = source.read<std::int64_t>(layout.types, begin, count);
  const auto offsets = source.read<std::int64_t>(layout.offsets, begin, count + 1);
  for (std::int64_t e = 0; e < count; ++e)
    if (types[e] != type) throw InputError(fmt::format("{}: {}", name, describe_cell(types[e], begin + e)));
  for (std::int64_t e = 0; e <= count; ++e)
    if (offsets[e] != (begin + e) * width)
      throw InputError(fmt::format("{}: Offsets of cell {} is {} and should be {}; write the mesh again", name, begin + e + 1, offsets[e],
                                   (begin + e) * width));
}

void read_connectivity(const Source& source, const std::string& name, const Layout& layout, MeshBlock& block) {
  constexpr std::int64_t kElementsPerRead = 1 << 16;  // elements
  const std::int64_t begin = block.elements.own_begin(), count = block.elements.own_count();
  const std::size_t width = block.width();
  block.tets.resize(static_cast<std::size_t>(count) * width);
  for (std::int64_t done = 0; done < count; done += kElementsPerRead) {
    const std::int64_t now = std::min(kElementsPerRead, count - done);
    const auto numbers = source.read<std::int64_t>(layout.connectivity, (begin + done) * static_cast<std::int64_t>(width),
                                                   now * static_cast<std::int64_t>(width));
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      if (numbers[i] < 0 || numbers[i] >= layout.points.rows)
        throw InputError(fmt::format("{}: element {} refers to node {}, but the nodes run from 0 to {}; write the mesh again", name,
                                     begin + done + static_cast<std::int64_t>(i / width) + 1, numbers[i], layout.points.rows - 1));
      block.tets[static_cast<std::size_t>(done) * width + i] = static_cast<std::int32_t>(numbers[i]);
    }
  }
}

/// Numbers of elements with a repeated node.
std::vector<std::int64_t> find_repeated(const MeshBlock& block) {
  std::vector<std::int64_t> repeated;
  const std::size_t width = block.width();
  for (std::int64_t e = 0; e < block.elements.own_count(); ++e) {
    const std::int32_t* tet = block.tets.data() + static_cast<std::size_t>(e) * width;
    bool is_repeated = false;
    for (std::size_t i = 0; i < width; ++i)
      for (std::size_t j = 0; j < i; ++j) is_repeated = is_repeated || tet[i] == tet[j];
    if (is_repeated) repeated.push_back(block.elements.own_begin() + e);
  }
  return repeated;
}

const Array* find_region_array(const Layout& layout) {
  for (const Array& array : layout.cell_data)
    if (mesh::is_region_name(array.name)) return &array;
  return layout.cell_data.size() == 1 ? &layout.cell_data.front() : nullptr;
}

void read_regions(const Source& source, const Layout& layout, MeshBlock& block) {
  const std::int64_t count = block.elements.own_count();
  block.regions.assign(count, 0);
  const Array* array = find_region_array(layout);
  if (array == nullptr) return;
  const auto values = source.read<std::int64_t>(*array, block.elements.own_begin(), count);
  for (std::size_t e = 0; e < values.size(); ++e)
    block.regions[e] = static_cast<std::int32_t>(std::clamp<std::int64_t>(values[e], INT32_MIN, INT32_MAX));
}

void read_nodes(const Source& source, const std::string& name, const Layout& layout, double scale, MeshBlock& block) {
  const auto values = source.read<double>(layout.points, block.corners.own_begin(), block.corners.own_count());
  block.nodes_m.resize(values.size() / 3);
  for (std::size_t i = 0; i < block.nodes_m.size(); ++i) {
    block.nodes_m[i] = {scale * values[3 * i], scale * values[3 * i + 1], scale * values[3 * i + 2]};
    for (const double x : block.nodes_m[i])
      if (!std::isfinite(x))
        throw InputError(fmt::format("{}: node {} has a coordinate that is not finite; correct the mesh where it was made", name,
                                     block.corners.own_begin() + static_cast<std::int64_t>(i) + 1));
  }
}

/// Reorients inverted elements, finds flat ones and stores every element's centre.
std::vector<std::int64_t> orient(MeshBlock& block, const Touched& touched, const std::vector<Vec3>& nodes_m, mesh::CheckReport& report) {
  const std::size_t width = block.width(), count = block.tets.size() / width;
  std::vector<std::int64_t> flat;
  block.centres_m.resize(count);
  for (std::size_t e = 0; e < count; ++e) {
    const auto at = [&](int i) -> const Vec3& { return nodes_m[touched.place[e * width + static_cast<std::size_t>(i)]]; };
    std::array<Vec3, 6> edge{};
    double longest = 0;
    for (std::size_t m = 0; m < 6; ++m) {
      for (std::size_t k = 0; k < 3; ++k) edge[m][k] = at(mesh::kEdges[m][1])[k] - at(mesh::kEdges[m][0])[k];
      longest = std::max(longest, edge[m][0] * edge[m][0] + edge[m][1] * edge[m][1] + edge[m][2] * edge[m][2]);
    }
    const Vec3 &a = edge[0], &b = edge[2], &c = edge[3];
    const double determinant = calc_det(a, b, c);
    for (std::size_t k = 0; k < 3; ++k) block.centres_m[e][k] = (at(0)[k] + at(1)[k] + at(2)[k] + at(3)[k]) / 4;
    if (!(std::abs(determinant) > kMinVolumeRatio * longest * std::sqrt(longest))) {
      flat.push_back(block.elements.own_begin() + static_cast<std::int64_t>(e));
    } else if (determinant < 0) {
      std::int32_t* tet = block.tets.data() + e * width;
      std::swap(tet[1], tet[2]);
      if (block.order == 2) {  // swap edges 01 and 02, 13 and 23
        std::swap(tet[4], tet[6]);
        std::swap(tet[8], tet[9]);
      }
      ++report.reoriented;
    }
  }
  return flat;
}

void drop_mid_nodes(MeshBlock& block) {
  const std::size_t count = block.tets.size() / 10;
  for (std::size_t e = 0; e < count; ++e)
    std::copy_n(block.tets.begin() + static_cast<std::ptrdiff_t>(10 * e), 4, block.tets.begin() + static_cast<std::ptrdiff_t>(4 * e));
  block.tets.resize(4 * count);
  block.tets.shrink_to_fit();
  block.order = 1;
}

/// Positions of nodes of other blocks. Collective.
std::vector<Vec3> query_nodes(const comm::Communicator& comm, const MeshBlock& block, const std::vector<std::int32_t>& nodes) {
  return comm::query_owners<Vec3>(
      comm, nodes, [&](std::int32_t node) { return block.find_owner(node); },
      [&](std::int32_t node) { return block.nodes_m[block.to_local(node)]; });
}

/// Renumbers used nodes in their old order and drops the others. Collective.
void drop_unused(const comm::Communicator& comm, MeshBlock& block, mesh::CheckReport& report) {
  const Touched touched = comm.agree([&] { return find_touched(block.tets); });
  std::vector<std::int32_t> number;  // new index of each node of this block; -1: unused
  std::int32_t kept = 0;
  const auto find_numbers = [&](const comm::ByRank<std::int32_t>& nodes) {
    number.assign(block.nodes_m.size(), -1);
    for (const std::int32_t node : nodes.items) number[block.to_local(node)] = 0;
    for (std::int32_t& one : number)
      if (one == 0) one = kept++;
    std::vector<std::int32_t> numbers;
    for (const std::int32_t node : nodes.items) numbers.push_back(number[block.to_local(node)]);
    return numbers;
  };
  const auto find_owner = [&](std::int32_t node) { return block.find_owner(node); };
  const auto place = comm::query_owners<std::int32_t>(comm, touched.nodes, find_owner, find_numbers);
  const comm::IndexPartition used(comm, kept);
  report.unreferenced = block.corners.total() - used.total();
  if (report.unreferenced == 0) return;
  for (std::size_t i = 0; i < number.size(); ++i) {
    if (number[i] < 0) continue;
    block.nodes_m[number[i]] = block.nodes_m[i];
    block.fixed[number[i]] = block.fixed[i];
  }
  block.nodes_m.resize(kept);
  block.fixed.resize(kept);
  for (std::size_t i = 0; i < block.tets.size(); ++i) {
    const std::size_t t = touched.place[i];
    block.tets[i] = static_cast<std::int32_t>(used.begin(find_owner(touched.nodes[t]))) + place[t];
  }
  block.corners = used;
}

/// An edge as sent to the rank that numbers its mid node.
struct Edge {
  std::int32_t low, high;
  Vec3 middle_m;
  std::int32_t fixed;
  bool operator<(const Edge& other) const { return std::pair(low, high) < std::pair(other.low, other.high); }
  bool operator==(const Edge& other) const { return low == other.low && high == other.high; }
};

void sort_unique(std::vector<Edge>& edges) {
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  edges.shrink_to_fit();
}

struct Corner {
  Vec3 x_m;
  std::int32_t fixed;
};

/// Edge m of element e of linear elements.
Edge make_edge(const Touched& touched, const std::vector<Corner>& corners, std::size_t e, std::size_t m) {
  const auto [a, b] = std::minmax(touched.place[4 * e + static_cast<std::size_t>(mesh::kEdges[m][0])],
                                  touched.place[4 * e + static_cast<std::size_t>(mesh::kEdges[m][1])]);  // indices ascend with node numbers
  const Corner &low = corners[a], &high = corners[b];
  return {touched.nodes[a], touched.nodes[b], 0.5 * (low.x_m + high.x_m),
          low.fixed != 0 && high.fixed != 0 ? std::min(low.fixed, high.fixed) : 0};
}

/// Gives every edge a mid node, owned by the owner of its low corner. Collective.
void add_mid_nodes(const comm::Communicator& comm, MeshBlock& block, const std::string& name) {
  const auto find_owner = [&](std::int32_t node) { return block.find_owner(node); };
  const Touched touched = comm.agree([&] { return find_touched(block.tets); });
  const auto corners = comm::query_owners<Corner>(comm, touched.nodes, find_owner, [&](std::int32_t node) {
    return Corner{block.nodes_m[block.to_local(node)], block.fixed[block.to_local(node)]};
  });
  const std::size_t count = block.tets.size() / 4;
  const auto edges = comm.agree([&] {
    std::vector<Edge> all;
    all.reserve(6 * count);
    for (std::size_t e = 0; e < count; ++e)
      for (std::size_t m = 0; m < 6; ++m) all.push_back(make_edge(touched, corners, e, m));
    sort_unique(all);
    return all;
  });
  std::vector<Edge> own;
  const auto find_places = [&](const comm::ByRank<Edge>& asked) {
    own = asked.items;
    sort_unique(own);
    std::vector<std::int32_t> places;
    for (const Edge& edge : asked.items)
      places.push_back(static_cast<std::int32_t>(std::lower_bound(own.begin(), own.end(), edge) - own.begin()));
    return places;
  };
  const auto places = comm::query_owners<std::int32_t>(
      comm, edges, [&](const Edge& edge) { return find_owner(edge.low); }, find_places);
  block.mids = comm::IndexPartition(comm, static_cast<std::int64_t>(own.size()));
  if (block.node_count() > INT32_MAX)
    throw InputError(fmt::format("{}: {} nodes with mid nodes; 32-bit numbers end at 2147483647: take \"T4\" or a coarser mesh", name,
                                 block.node_count()));
  comm.agree([&] {
    for (const Edge& edge : own) {
      block.nodes_m.push_back(edge.middle_m);
      block.fixed.push_back(edge.fixed);
    }
    std::vector<std::int32_t> fine(10 * count);
    for (std::size_t e = 0; e < count; ++e) {
      std::copy_n(block.tets.begin() + static_cast<std::ptrdiff_t>(4 * e), 4, fine.begin() + static_cast<std::ptrdiff_t>(10 * e));
      for (std::size_t m = 0; m < 6; ++m) {
        const auto edge = std::lower_bound(edges.begin(), edges.end(), make_edge(touched, corners, e, m));
        const std::int64_t first = block.corners.total() + block.mids.begin(find_owner(edge->low));
        fine[10 * e + 4 + m] = static_cast<std::int32_t>(first) + places[edge - edges.begin()];
      }
    }
    block.tets = std::move(fine);
    block.order = 2;
  });
}

/// Reads this rank's block of the file. Collective.
MeshBlock read_arrays(const comm::Communicator& comm, const std::filesystem::path& file, const std::string& name, const Layout& layout,
                      const ReadOptions& options) {
  MeshBlock block;
  block.corners = comm::IndexPartition::make_even(comm, layout.points.rows);
  block.mids = comm::IndexPartition::make_even(comm, 0);
  block.elements = comm::IndexPartition::make_even(comm, layout.types.rows);
  if (layout.types.rows < comm.size())
    throw InputError(fmt::format("{}: the mesh has {} tetrahedra, fewer than the {} ranks; start at most {} ranks", name, layout.types.rows,
                                 comm.size(), layout.types.rows));
  const auto source = comm.agree([&] { return std::make_unique<Source>(file, name); });
  const auto repeated = comm.agree([&] {
    std::int64_t type = 0;
    block.order = find_order(*source, name, layout, type);
    check_cells(*source, name, layout, type, block);
    read_connectivity(*source, name, layout, block);
    return find_repeated(block);
  });
  refuse_elements(comm, name, repeated, "with a repeated node", "mesh the body again");
  comm.agree([&] {
    read_regions(*source, layout, block);
    read_nodes(*source, name, layout, options.scale, block);
  });
  read_fixed_sets(comm, *source, name, layout, options, block);
  return block;
}

}  // namespace

MeshBlock read_block(const comm::Communicator& comm, const std::filesystem::path& file, const std::string& name, const Layout& layout,
                     const ReadOptions& options, mesh::CheckReport& report) {
  MeshBlock block = read_arrays(comm, file, name, layout, options);
  report.order = block.order;
  {
    const Touched touched = comm.agree([&] { return find_touched(block.tets); });
    const auto nodes_m = query_nodes(comm, block, touched.nodes);
    const auto flat = comm.agree([&] { return orient(block, touched, nodes_m, report); });
    refuse_elements(comm, name, flat, "without volume", "remove them or mesh the body again");
  }
  report.reoriented = comm.sum(report.reoriented);
  drop_unused(comm, block, report);
  // As mesh::check_mesh; must precede the change of order.
  report.nodes = block.corners.total();
  report.tets = layout.types.rows;
  if (options.order == 1 && block.order == 2) {
    const std::int64_t unused = report.unreferenced;
    drop_mid_nodes(block);
    drop_unused(comm, block, report);
    report.unreferenced = unused;
  }
  if (options.order == 2 && block.order == 1) add_mid_nodes(comm, block, name);
  find_fixed_boxes(comm, name, options, block, report);
  return block;
}

}  // namespace carillon::parallel_mesh
