// Method: every rank reads an even run of nodes and of elements by their places in the file, and asks the homes of its elements' nodes for
//   what it needs of them. Mid nodes are numbered by the order of their edges (low corner, then high corner), which the homes of the low
//   corners sort among themselves.
// Source: own.
// Deviations: none.
#include "precompute/slabs/slab.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "precompute/mesh/read.hpp"
#include "precompute/slabs/held.hpp"
#include "precompute/slabs/source.hpp"
#include "runtime/base/error.hpp"

namespace carillon::slabs {
namespace {

constexpr double kFlat = 1e-9;                        // as mesh::check_mesh: six volumes over the cube of the longest edge
constexpr int kLinearType = 10, kQuadraticType = 24;  // VTK's cell types

std::string list_elements(const std::vector<std::int64_t>& elements, std::int64_t total) {
  std::string text;
  for (std::size_t i = 0; i < std::min<std::size_t>(elements.size(), 10); ++i)
    text += fmt::format("{}{}", i == 0 ? "" : ", ", elements[i] + 1);
  if (total > 10) text += fmt::format(" and {} more", total - 10);
  return text + " (tetrahedra counted from 1 in the order of the file)";
}

/// Throws on every rank if any rank found bad elements. `what` completes "3 elements ...", `remedy` follows the list. Collective.
void refuse_elements(MPI_Comm comm, const std::string& name, const std::vector<std::int64_t>& bad, const char* what, const char* remedy) {
  auto total = static_cast<std::int64_t>(bad.size());
  MPI_Allreduce(MPI_IN_PLACE, &total, 1, MPI_INT64_T, MPI_SUM, comm);
  if (total == 0) return;
  std::vector<std::int64_t> first;
  petsc::run_agreed(comm,
                    [&] { first.assign(bad.begin(), bad.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(bad.size(), 10))); });
  const auto all = share(comm, first);
  petsc::run_agreed(comm, [&] {
    throw InputError(
        fmt::format("{}: {} element{} {}: {}; {}", name, total, total == 1 ? "" : "s", what, list_elements(all, total), remedy));
  });
}

/// The nodes of this rank's elements, each once and ascending, and where each node of each element is among them.
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

/// Reads types, offsets and connectivity of this rank's elements.
void read_elements(MPI_Comm comm, const Source& source, const std::string& name, const Layout& layout, Slab& slab) {
  const auto rank = static_cast<std::size_t>(get_rank(comm));
  const std::int64_t begin = slab.elements.first[rank], count = slab.elements.first[rank + 1] - begin;
  std::int64_t first_type = 0;
  petsc::run_agreed(comm, [&] { first_type = source.read<std::int64_t>(layout.types, 0, 1).front(); });
  petsc::run_agreed(comm, [&] {
    if (first_type != kLinearType && first_type != kQuadraticType)
      throw InputError(fmt::format("{}: {}", name, describe_cell(first_type, 0)));
    slab.order = first_type == kLinearType ? 1 : 2;
    const auto width = static_cast<std::int64_t>(slab.width());
    if (layout.connectivity.rows != layout.types.rows * width)
      throw InputError(fmt::format("{}: Connectivity has {} entries for {} tetrahedra of {} nodes; write the mesh again", name,
                                   layout.connectivity.rows, layout.types.rows, width));
    const auto types = source.read<std::int64_t>(layout.types, begin, count);
    const auto offsets = source.read<std::int64_t>(layout.offsets, begin, count + 1);
    for (std::int64_t e = 0; e < count; ++e) {
      if (types[static_cast<std::size_t>(e)] != first_type)
        throw InputError(fmt::format("{}: {}", name, describe_cell(types[static_cast<std::size_t>(e)], begin + e)));
    }
    for (std::int64_t e = 0; e <= count; ++e)
      if (offsets[static_cast<std::size_t>(e)] != (begin + e) * width)
        throw InputError(fmt::format("{}: Offsets of cell {} is {} and should be {}; write the mesh again", name, begin + e + 1,
                                     offsets[static_cast<std::size_t>(e)], (begin + e) * width));
  });
  std::vector<std::int64_t> repeated;
  petsc::run_agreed(comm, [&] {
    const std::size_t width = slab.width();
    slab.tets.resize(static_cast<std::size_t>(count) * width);
    constexpr std::int64_t kAtOnce = 1 << 16;  // elements
    for (std::int64_t done = 0; done < count; done += kAtOnce) {
      const std::int64_t now = std::min(kAtOnce, count - done);
      const auto numbers = source.read<std::int64_t>(layout.connectivity, (begin + done) * static_cast<std::int64_t>(width),
                                                     now * static_cast<std::int64_t>(width));
      for (std::size_t i = 0; i < numbers.size(); ++i) {
        if (numbers[i] < 0 || numbers[i] >= layout.points.rows)
          throw InputError(fmt::format("{}: element {} refers to node {}, but the nodes run from 0 to {}; write the mesh again", name,
                                       begin + done + static_cast<std::int64_t>(i / width) + 1, numbers[i], layout.points.rows - 1));
        slab.tets[static_cast<std::size_t>(done) * width + i] = static_cast<std::int32_t>(numbers[i]);
      }
    }
    for (std::int64_t e = 0; e < count; ++e) {
      const std::int32_t* tet = slab.tets.data() + static_cast<std::size_t>(e) * width;
      bool is_repeated = false;
      for (std::size_t i = 0; i < width; ++i)
        for (std::size_t j = 0; j < i; ++j) is_repeated = is_repeated || tet[i] == tet[j];
      if (is_repeated) repeated.push_back(begin + e);
    }
  });
  refuse_elements(comm, name, repeated, "with a repeated node", "mesh the body again");
}

const Array* find_region_array(const Layout& layout) {
  for (const Array& array : layout.cell_data)
    if (mesh::is_region_name(array.name)) return &array;
  return layout.cell_data.size() == 1 ? &layout.cell_data.front() : nullptr;
}

void read_regions(const Source& source, const Layout& layout, std::int64_t begin, Slab& slab) {
  const auto count = static_cast<std::int64_t>(slab.tets.size() / slab.width());
  slab.regions.assign(static_cast<std::size_t>(count), 0);
  if (const Array* array = find_region_array(layout)) {
    const auto values = source.read<std::int64_t>(*array, begin, count);
    for (std::size_t e = 0; e < values.size(); ++e)
      slab.regions[e] = static_cast<std::int32_t>(std::clamp<std::int64_t>(values[e], INT32_MIN, INT32_MAX));
  }
}

void read_nodes(const Source& source, const std::string& name, const Layout& layout, double scale, std::int64_t begin, std::int64_t count,
                Slab& slab) {
  const auto values = source.read<double>(layout.points, begin, count);
  slab.nodes_m.resize(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < slab.nodes_m.size(); ++i) {
    slab.nodes_m[i] = {scale * values[3 * i], scale * values[3 * i + 1], scale * values[3 * i + 2]};
    for (const double x : slab.nodes_m[i])
      if (!std::isfinite(x))
        throw InputError(fmt::format("{}: node {} has a coordinate that is not finite; correct the mesh where it was made", name,
                                     begin + static_cast<std::int64_t>(i) + 1));
  }
}

/// Turns elements that are inside out, finds the flat ones, and keeps every element's centre.
std::vector<std::int64_t> orient(Slab& slab, const Touched& touched, const std::vector<Vec3>& nodes_m, std::int64_t begin,
                                 mesh::CheckReport& report) {
  const std::size_t width = slab.width(), count = slab.tets.size() / width;
  std::vector<std::int64_t> flat;
  slab.centres_m.resize(count);
  for (std::size_t e = 0; e < count; ++e) {
    const auto at = [&](int i) -> const Vec3& {
      return nodes_m[static_cast<std::size_t>(touched.place[e * width + static_cast<std::size_t>(i)])];
    };
    std::array<Vec3, 6> edge{};
    double longest = 0;
    for (std::size_t m = 0; m < 6; ++m) {
      for (std::size_t k = 0; k < 3; ++k) edge[m][k] = at(mesh::kEdges[m][1])[k] - at(mesh::kEdges[m][0])[k];
      longest = std::max(longest, edge[m][0] * edge[m][0] + edge[m][1] * edge[m][1] + edge[m][2] * edge[m][2]);
    }
    const Vec3 &a = edge[0], &b = edge[2], &c = edge[3];
    const double determinant = a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
    for (std::size_t k = 0; k < 3; ++k) slab.centres_m[e][k] = (at(0)[k] + at(1)[k] + at(2)[k] + at(3)[k]) / 4;
    if (!(std::abs(determinant) > kFlat * longest * std::sqrt(longest))) {
      flat.push_back(begin + static_cast<std::int64_t>(e));
    } else if (determinant < 0) {
      std::int32_t* tet = slab.tets.data() + e * width;
      std::swap(tet[1], tet[2]);
      if (slab.order == 2) {  // edges 01 and 02, 13 and 23 change places
        std::swap(tet[4], tet[6]);
        std::swap(tet[8], tet[9]);
      }
      ++report.reoriented;
    }
  }
  return flat;
}

void drop_mid_nodes(Slab& slab) {
  const std::size_t count = slab.tets.size() / 10;
  for (std::size_t e = 0; e < count; ++e)
    std::copy_n(slab.tets.begin() + static_cast<std::ptrdiff_t>(10 * e), 4, slab.tets.begin() + static_cast<std::ptrdiff_t>(4 * e));
  slab.tets.resize(4 * count);
  slab.tets.shrink_to_fit();
  slab.order = 1;
}

/// Renumbers the nodes in use by their old order and forgets the others. Collective.
void drop_unused(MPI_Comm comm, Slab& slab, mesh::CheckReport& report) {
  const int rank = get_rank(comm);
  Touched touched;
  petsc::run_agreed(comm, [&] { touched = find_touched(slab.tets); });
  const auto find_home = [&](std::int32_t node) { return slab.find_home(node); };
  const auto arrived = route(comm, touched.nodes, find_home);
  std::vector<std::int32_t> number;
  std::int64_t kept = 0;
  petsc::run_agreed(comm, [&] {
    number.assign(slab.nodes_m.size(), -1);
    for (const std::int32_t node : arrived.items) number[slab.find_place(node, rank)] = 0;
    for (const std::int32_t one : number) kept += one == 0;
  });
  const Homes homes = gather_homes(comm, kept);
  report.unreferenced = slab.corners.total() - homes.total();
  if (report.unreferenced == 0) return;
  auto next = static_cast<std::int32_t>(homes.first[static_cast<std::size_t>(rank)]);
  std::size_t to = 0;
  for (std::size_t i = 0; i < number.size(); ++i) {
    if (number[i] < 0) continue;
    number[i] = next++;
    slab.nodes_m[to] = slab.nodes_m[i];
    slab.held[to++] = slab.held[i];
  }
  slab.nodes_m.resize(to);
  slab.held.resize(to);
  const auto numbers =
      ask<std::int32_t>(comm, touched.nodes, find_home, [&](std::int32_t node) { return number[slab.find_place(node, rank)]; });
  for (std::size_t i = 0; i < slab.tets.size(); ++i) slab.tets[i] = numbers[static_cast<std::size_t>(touched.place[i])];
  slab.corners = homes;
}

/// What a mid node's home has to know.
struct Edge {
  std::int32_t low, high;
  double x, y, z;
  std::int32_t held;
  bool operator<(const Edge& other) const { return low != other.low ? low < other.low : high < other.high; }
  bool operator==(const Edge& other) const { return low == other.low && high == other.high; }
};

/// Gives every edge a mid node. Collective.
void add_mid_nodes(MPI_Comm comm, Slab& slab, const std::string& name) {
  const int rank = get_rank(comm);
  struct Corner {
    Vec3 x;
    std::int32_t held;
  };
  Touched touched;
  petsc::run_agreed(comm, [&] { touched = find_touched(slab.tets); });
  const auto corners = ask<Corner>(
      comm, touched.nodes, [&](std::int32_t node) { return slab.find_home(node); },
      [&](std::int32_t node) {
        const std::size_t i = slab.find_place(node, rank);
        return Corner{slab.nodes_m[i], slab.held[i]};
      });
  const std::size_t count = slab.tets.size() / 4;
  std::vector<Edge> edges;
  const auto make_edge = [&](std::size_t e, const std::array<int, 2>& ends) {
    std::int32_t a = touched.place[4 * e + static_cast<std::size_t>(ends[0])], b = touched.place[4 * e + static_cast<std::size_t>(ends[1])];
    if (b < a) std::swap(a, b);  // places ascend as the nodes do
    const Corner &low = corners[static_cast<std::size_t>(a)], &high = corners[static_cast<std::size_t>(b)];
    return Edge{touched.nodes[static_cast<std::size_t>(a)],
                touched.nodes[static_cast<std::size_t>(b)],
                0.5 * (low.x[0] + high.x[0]),
                0.5 * (low.x[1] + high.x[1]),
                0.5 * (low.x[2] + high.x[2]),
                low.held != 0 && high.held != 0 ? std::min(low.held, high.held) : 0};
  };
  petsc::run_agreed(comm, [&] {
    edges.reserve(6 * count);
    for (std::size_t e = 0; e < count; ++e)
      for (const auto& ends : mesh::kEdges) edges.push_back(make_edge(e, ends));
    std::sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    edges.shrink_to_fit();
  });
  std::vector<std::size_t> order;
  const auto arrived = route(
      comm, edges, [&](const Edge& edge) { return slab.find_home(edge.low); }, &order);
  std::vector<Edge> own;
  petsc::run_agreed(comm, [&] {
    own = arrived.items;
    std::sort(own.begin(), own.end());
    own.erase(std::unique(own.begin(), own.end()), own.end());
  });
  slab.mids = gather_homes(comm, static_cast<std::int64_t>(own.size()));
  std::vector<std::int32_t> replies;
  petsc::run_agreed(comm, [&] {
    if (slab.node_count() > INT32_MAX)
      throw InputError(fmt::format("{}: {} nodes with mid nodes; 32-bit numbers end at 2147483647: take \"T4\" or a coarser mesh", name,
                                   slab.node_count()));
    const std::int64_t first = slab.corners.total() + slab.mids.first[static_cast<std::size_t>(rank)];
    for (const Edge& edge : arrived.items)
      replies.push_back(static_cast<std::int32_t>(first + (std::lower_bound(own.begin(), own.end(), edge) - own.begin())));
    for (const Edge& edge : own) {
      slab.nodes_m.push_back({edge.x, edge.y, edge.z});
      slab.held.push_back(edge.held);
    }
  });
  const auto numbers = exchange(comm, replies, arrived.count);
  petsc::run_agreed(comm, [&] {
    std::vector<std::int32_t> number(edges.size());
    for (std::size_t i = 0; i < order.size(); ++i) number[order[i]] = numbers.items[i];
    std::vector<std::int32_t> fine(10 * count);
    for (std::size_t e = 0; e < count; ++e) {
      std::copy_n(slab.tets.begin() + static_cast<std::ptrdiff_t>(4 * e), 4, fine.begin() + static_cast<std::ptrdiff_t>(10 * e));
      for (std::size_t m = 0; m < 6; ++m)
        fine[10 * e + 4 + m] =
            number[static_cast<std::size_t>(std::lower_bound(edges.begin(), edges.end(), make_edge(e, mesh::kEdges[m])) - edges.begin())];
    }
    slab.tets = std::move(fine);
    slab.order = 2;
  });
}

}  // namespace

Slab read_slab(MPI_Comm comm, const std::filesystem::path& file, const std::string& name, const Layout& layout, const Wish& wish,
               mesh::CheckReport& report) {
  const int rank = get_rank(comm), ranks = get_size(comm);
  Slab slab;
  slab.corners = make_even_homes(layout.points.rows, ranks);
  slab.mids = make_even_homes(0, ranks);
  slab.elements = make_even_homes(layout.types.rows, ranks);
  const std::int64_t first_element = slab.elements.first[static_cast<std::size_t>(rank)];
  {
    std::optional<Source> source;
    petsc::run_agreed(comm, [&] {
      if (layout.types.rows < ranks)
        throw InputError(fmt::format("{}: the mesh has {} tetrahedra, fewer than the {} ranks; start at most {} ranks", name,
                                     layout.types.rows, ranks, layout.types.rows));
      source.emplace(file, name);
    });
    read_elements(comm, *source, name, layout, slab);
    petsc::run_agreed(comm, [&] {
      const std::int64_t begin = slab.corners.first[static_cast<std::size_t>(rank)],
                         end = slab.corners.first[static_cast<std::size_t>(rank) + 1];
      read_regions(*source, layout, first_element, slab);
      read_nodes(*source, name, layout, wish.scale, begin, end - begin, slab);
    });
    read_held_sets(comm, *source, name, layout, wish, slab.corners.first[static_cast<std::size_t>(rank)], slab);
  }
  report.order = slab.order;
  std::vector<std::int64_t> flat;
  {
    Touched touched;
    petsc::run_agreed(comm, [&] { touched = find_touched(slab.tets); });
    const auto nodes_m = ask<Vec3>(
        comm, touched.nodes, [&](std::int32_t node) { return slab.find_home(node); },
        [&](std::int32_t node) { return slab.nodes_m[slab.find_place(node, rank)]; });
    petsc::run_agreed(comm, [&] { flat = orient(slab, touched, nodes_m, first_element, report); });
  }
  refuse_elements(comm, name, flat, "without volume", "remove them or mesh the body again");
  MPI_Allreduce(MPI_IN_PLACE, &report.reoriented, 1, MPI_INT64_T, MPI_SUM, comm);
  // What mesh::check_mesh counts are the nodes before the order changes.
  const bool drops_mids = wish.order == 1 && slab.order == 2;
  drop_unused(comm, slab, report);
  report.nodes = slab.corners.total();
  report.tets = layout.types.rows;
  if (drops_mids) {
    const std::int64_t unused = report.unreferenced;
    drop_mid_nodes(slab);
    drop_unused(comm, slab, report);
    report.unreferenced = unused;
  }
  if (wish.order == 2 && slab.order == 1) add_mid_nodes(comm, slab, name);
  find_held_boxes(comm, name, wish, slab, report);
  return slab;
}

}  // namespace carillon::slabs
