// Method: k-way partition of the dual graph by communication volume, and nested dissection of the compressed node graph (compress.cpp) by
// METIS 5: with four separators per level where the core is small relative to the graph; below 5,000 vertices, where METIS computes one
// separator in any case, the best of four orders by operations. For larger graphs, the operations of orders from different seeds scatter by
// 2.2 %, so another order is computed while its expected saving in three factorisations exceeds its cost. The graphs are built by sorting,
// so they are the same on every machine. A part that METIS leaves empty, possible for graphs of few vertices, takes one element from the
// largest part.
// Source: Karypis and Kumar 1998, "A fast and high quality multilevel scheme for partitioning irregular graphs"; "Multilevel k-way
// partitioning scheme for irregular graphs" (options: METIS manual 5.1).
#include "partition/partition.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <utility>

#include "partition/compress.hpp"
#include "partition/metis.hpp"

namespace carillon::partition {
namespace {

constexpr std::int32_t kManySeparators = 5000;  // vertices: METIS computes the requested number of separators per level from this size on

constexpr double kScatter = 0.022;          // standard deviation of the operations of orders from different seeds
constexpr double kFactorisations = 3;       // per job
constexpr double kOperationRate = 50e9;     // [1/s] per core
constexpr double kSeparatorSeconds = 3e-6;  // of METIS per vertex, for each separator tried at a level
constexpr int kMostOrders = 8;

/// True if another order is expected to save more time than it costs, where the best of `orders` has this many operations on nodes (27 on
/// numbers each). The minimum of k + 1 normal variables is 0.56 / k standard deviations below that of k, within an eighth.
bool pays_another_order(double node_operations, int orders, std::int64_t vertices, int tries) {
  const double operations = 27 * node_operations;
  const double saved = kScatter * 0.56 / orders * kFactorisations * operations / kOperationRate;
  return orders < kMostOrders && saved > kSeparatorSeconds * tries * static_cast<double>(vertices);
}

void check_entries(std::size_t entries) {
  if (entries > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
    throw InputError(
        fmt::format("the mesh is too large: its graph has {} entries, 32-bit indices end at 2147483647; use a coarser mesh", entries));
}

/// Connected components of each part (of the whole graph if `part` is all zero).
std::vector<int> count_pieces(const Graph& graph, const std::vector<std::int32_t>& part, int parts) {
  std::vector<int> pieces(parts, 0);
  std::vector<bool> seen(graph.vertex_count(), false);
  std::vector<std::int32_t> front;
  for (std::int32_t start = 0; start < graph.vertex_count(); ++start) {
    if (seen[start]) continue;
    ++pieces[part[start]];
    seen[start] = true;
    front.assign(1, start);
    while (!front.empty()) {
      const std::int32_t v = front.back();
      front.pop_back();
      for (std::int32_t k = graph.offsets[v]; k < graph.offsets[v + 1]; ++k) {
        const std::int32_t w = graph.neighbours[k];
        if (seen[w] || part[w] != part[v]) continue;
        seen[w] = true;
        front.push_back(w);
      }
    }
  }
  return pieces;
}

Quality find_quality(const Graph& dual, const std::vector<std::int32_t>& part, int parts) {
  Quality quality;
  quality.elements.assign(parts, 0);
  for (const std::int32_t p : part) ++quality.elements[p];
  quality.balance = static_cast<double>(*std::max_element(quality.elements.begin(), quality.elements.end())) * parts / part.size();
  for (std::int32_t v = 0; v < dual.vertex_count(); ++v)
    for (std::int32_t k = dual.offsets[v]; k < dual.offsets[v + 1]; ++k)
      if (v < dual.neighbours[k] && part[v] != part[dual.neighbours[k]]) ++quality.edge_cut;
  const std::vector<int> pieces = count_pieces(dual, part, parts);
  quality.contiguous = std::all_of(pieces.begin(), pieces.end(), [](int n) { return n == 1; });
  return quality;
}

void fill_empty_parts(std::vector<std::int32_t>& part, int parts) {
  std::vector<std::int64_t> size(parts, 0);
  for (const std::int32_t p : part) ++size[p];
  for (int empty = 0; empty < parts; ++empty) {
    if (size[empty] > 0) continue;
    const auto largest = static_cast<std::int32_t>(std::max_element(size.begin(), size.end()) - size.begin());
    *std::find(part.rbegin(), part.rend(), largest) = empty;
    --size[largest];
    ++size[empty];
  }
}

/// Order of a core by METIS.
std::vector<std::int32_t> order_core(const Graph& core, double dominated_per_edge) {
  std::vector<std::int32_t> position(core.vertex_count());
  std::iota(position.begin(), position.end(), 0);
  if (core.neighbours.empty()) return position;
  // METIS takes pointers to mutable memory but leaves the graph unchanged in effect; a copy preserves constness.
  Graph copy = core;
  const int tries = find_tries(core, dominated_per_edge);
  idx_t vertices = copy.vertex_count();
  std::vector<std::int32_t> vertex_at(vertices);
  MetisOptions options = make_metis_options();
  const auto order = [&] {
    call_metis("METIS_NodeND", [&] {
      return METIS_NodeND(&vertices, copy.offsets.data(), copy.neighbours.data(), nullptr, options.data(), vertex_at.data(),
                          position.data());
    });
  };
  const bool seeks_all = tries == 1 || vertices >= kManySeparators;
  if (seeks_all) options[METIS_OPTION_NSEPS] = tries;
  std::vector<std::int32_t> best;
  double fewest = std::numeric_limits<double>::infinity();
  for (int orders = 0; orders == 0 || (seeks_all ? pays_another_order(fewest, orders, vertices, tries) : orders < tries);
       ++orders, ++options[METIS_OPTION_SEED]) {
    order();
    const double operations = predict_operations(core, dominated_per_edge, position);
    if (operations >= fewest) continue;
    fewest = operations;
    best = position;
  }
  return best;
}

}  // namespace

Graph make_dual_graph(std::span<const std::int32_t> corners) {
  constexpr std::array<std::array<int, 3>, 4> kFaceCorners{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};
  const auto elements = static_cast<std::int32_t>(corners.size() / 4);
  const std::int32_t nodes = corners.empty() ? 0 : *std::max_element(corners.begin(), corners.end()) + 1;
  struct Face {
    std::int32_t middle, high;  // the other two corners in ascending order; the bucket is the lowest
    std::int32_t element;
  };
  // Faces are bucketed by their lowest corner, so that a face is compared only with the few faces of one node.
  const auto make_face = [&](std::int32_t e, const std::array<int, 3>& local) {
    std::array<std::int32_t, 3> v{corners[4 * e + local[0]], corners[4 * e + local[1]], corners[4 * e + local[2]]};
    if (v[1] < v[0]) std::swap(v[0], v[1]);
    if (v[2] < v[1]) std::swap(v[1], v[2]);
    if (v[1] < v[0]) std::swap(v[0], v[1]);
    return v;
  };
  std::vector<std::int64_t> begin(nodes + 1, 0);
  for (std::int32_t e = 0; e < elements; ++e)
    for (const auto& local : kFaceCorners) ++begin[make_face(e, local)[0] + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<Face> faces(std::size_t{4} * elements);
  {
    std::vector<std::int64_t> next(begin.begin(), begin.end() - 1);
    for (std::int32_t e = 0; e < elements; ++e)
      for (const auto& local : kFaceCorners) {
        const auto v = make_face(e, local);
        faces[next[v[0]]++] = {v[1], v[2], e};
      }
  }
  std::vector<std::array<std::int32_t, 4>> neighbours(elements);
  std::vector<std::int8_t> degree(elements, 0);
  for (std::int32_t low = 0; low < nodes; ++low) {
    const auto first = faces.begin() + begin[low], last = faces.begin() + begin[low + 1];
    std::sort(first, last, [](const Face& x, const Face& y) {
      return x.middle != y.middle ? x.middle < y.middle : x.high != y.high ? x.high < y.high : x.element < y.element;
    });
    const auto same = [](const Face& x, const Face& y) { return x.middle == y.middle && x.high == y.high; };
    for (auto face = first; face != last && face + 1 != last; ++face) {
      if (!same(face[0], face[1])) continue;
      if (face + 2 != last && same(face[0], face[2]))
        throw InputError(fmt::format("tetrahedra {}, {} and {} share one face (nodes {}, {}, {}); at most two can. Correct the mesh",
                                     face[0].element, face[1].element, face[2].element, low, face->middle, face->high));
      neighbours[face[0].element][degree[face[0].element]++] = face[1].element;
      neighbours[face[1].element][degree[face[1].element]++] = face[0].element;
    }
  }
  Graph graph;
  graph.offsets.reserve(elements + 1);
  graph.offsets.push_back(0);
  graph.neighbours.reserve(faces.size());
  for (std::int32_t e = 0; e < elements; ++e) {
    const auto first = neighbours[e].begin();
    std::sort(first, first + degree[e]);
    graph.neighbours.insert(graph.neighbours.end(), first, std::unique(first, first + degree[e]));
    graph.offsets.push_back(static_cast<std::int32_t>(graph.neighbours.size()));
  }
  return graph;
}

ElementLists list_elements(std::span<const std::int32_t> elements, int width, std::int32_t nodes) {
  const std::size_t entries = elements.size() / width * width;
  ElementLists lists;
  lists.begin.assign(nodes + 1, 0);
  for (std::size_t i = 0; i < entries; ++i)
    if (elements[i] >= 0) ++lists.begin[elements[i] + 1];
  std::partial_sum(lists.begin.begin(), lists.begin.end(), lists.begin.begin());
  lists.items.resize(lists.begin.back());
  std::vector<std::int64_t> next(lists.begin.begin(), lists.begin.end() - 1);
  for (std::size_t i = 0; i < entries; ++i)
    if (elements[i] >= 0) lists.items[next[elements[i]]++] = static_cast<std::int32_t>(i / width);
  return lists;
}

Graph make_node_graph(std::span<const std::int32_t> elements, int width, std::int32_t nodes) {
  // For every node the other nodes of its elements, each once.
  const ElementLists lists = list_elements(elements, width, nodes);
  Graph graph;
  graph.offsets.reserve(nodes + 1);
  graph.offsets.push_back(0);
  std::vector<std::int32_t> seen_from(nodes, -1);
  std::vector<std::int32_t> near;
  for (std::int32_t v = 0; v < nodes; ++v) {
    seen_from[v] = v;
    near.resize(lists.of(v).size() * width + 1);
    // Branch-free: writes every node and keeps new ones; a branch would be mispredicted half of the time.
    std::size_t count_near = 0;
    for (const std::int32_t e : lists.of(v))
      for (const std::int32_t w : elements.subspan(static_cast<std::size_t>(e) * width, width)) {
        if (w < 0) continue;
        near[count_near] = w;
        count_near += seen_from[w] != v ? 1 : 0;
        seen_from[w] = v;
      }
    std::sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(count_near));
    graph.neighbours.insert(graph.neighbours.end(), near.begin(), near.begin() + static_cast<std::ptrdiff_t>(count_near));
    check_entries(graph.neighbours.size());
    graph.offsets.push_back(static_cast<std::int32_t>(graph.neighbours.size()));
  }
  return graph;
}

Partition partition_elements(std::span<const std::int32_t> corners, int parts) {
  const auto elements = static_cast<std::int64_t>(corners.size() / 4);
  if (parts < 1) throw InputError(fmt::format("a mesh cannot be cut into {} parts; request at least one", parts));
  if (elements < parts)
    throw InputError(fmt::format("the mesh has {} tetrahedra, fewer than the {} ranks; start at most {} ranks", elements, parts, elements));
  if (elements > std::numeric_limits<std::int32_t>::max() / 4)
    throw InputError(fmt::format("the mesh is too large: {} tetrahedra, 32-bit indices allow 536870911; use a coarser mesh", elements));
  Partition result;
  result.part.assign(elements, 0);
  if (parts == 1) {
    result.quality.elements.assign(1, elements);
    return result;
  }
  Graph dual = make_dual_graph(corners);
  {
    // METIS rejects contiguous parts of a disconnected graph, and prints instead of returning an error: test connectivity first.
    const bool connected = count_pieces(dual, result.part, 1).front() == 1;
    MetisOptions options = make_metis_options();
    options[METIS_OPTION_CONTIG] = connected ? 1 : 0;
    // Few elements at the interfaces rather than few faces: this gives a factorisation smaller separators at the same cost.
    options[METIS_OPTION_OBJTYPE] = METIS_OBJTYPE_VOL;
    idx_t vertices = dual.vertex_count();
    idx_t constraints = 1;
    idx_t part_count = parts;
    idx_t cut = 0;
    call_metis("METIS_PartGraphKway", [&] {
      return METIS_PartGraphKway(&vertices, &constraints, dual.offsets.data(), dual.neighbours.data(), nullptr, nullptr, nullptr,
                                 &part_count, nullptr, nullptr, options.data(), &cut, result.part.data());
    });
    fill_empty_parts(result.part, parts);
  }
  result.quality = find_quality(dual, result.part, parts);
  return result;
}

Partition measure_parts(std::span<const std::int32_t> corners, std::vector<std::int32_t> part, int parts) {
  Partition result;
  result.quality = find_quality(make_dual_graph(corners), part, parts);
  result.part = std::move(part);
  return result;
}

std::vector<std::int32_t> order_nested_dissection(const Graph& graph, std::optional<double> dominated_per_edge) {
  if (dominated_per_edge) return order_core(graph, *dominated_per_edge);
  const CompressedGraph compressed(graph);
  return compressed.expand_order(order_core(compressed.core(), compressed.dominated_per_edge()));
}

Graph take_part(const Graph& graph, const std::vector<std::int32_t>& vertices, std::vector<std::int32_t>& number) {
  Graph part{{0}, {}};
  for (std::size_t i = 0; i < vertices.size(); ++i) number[vertices[i]] = static_cast<std::int32_t>(i);
  for (const std::int32_t v : vertices) {
    for (const std::int32_t to : graph.list_neighbours(v))
      if (number[to] >= 0) part.neighbours.push_back(number[to]);
    part.offsets.push_back(static_cast<std::int32_t>(part.neighbours.size()));
  }
  for (const std::int32_t v : vertices) number[v] = -1;
  return part;
}

Graph renumber(const Graph& graph, const std::vector<std::int32_t>& position) {
  std::vector<std::int32_t> at(position.size());
  for (std::size_t v = 0; v < position.size(); ++v) at[position[v]] = static_cast<std::int32_t>(v);
  Graph result;
  result.offsets.push_back(0);
  result.neighbours.reserve(graph.neighbours.size());
  for (const std::int32_t v : at) {
    const auto first = static_cast<std::ptrdiff_t>(result.neighbours.size());
    for (std::int32_t k = graph.offsets[v]; k < graph.offsets[v + 1]; ++k) result.neighbours.push_back(position[graph.neighbours[k]]);
    std::sort(result.neighbours.begin() + first, result.neighbours.end());
    result.offsets.push_back(static_cast<std::int32_t>(result.neighbours.size()));
  }
  return result;
}

std::string metis_version() { return fmt::format("{}.{}.{}", METIS_VER_MAJOR, METIS_VER_MINOR, METIS_VER_SUBMINOR); }

}  // namespace carillon::partition
