// Graph partitioning: distribution of tetrahedra over ranks, and elimination orders. METIS inside; no MPI, no PETSc.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::partition {

/// An undirected graph in compressed rows: the neighbours of vertex v are neighbours[offsets[v]] ... neighbours[offsets[v + 1] - 1],
/// ascending, without v itself.
struct Graph {
  std::vector<std::int32_t> offsets;     // (vertices + 1)
  std::vector<std::int32_t> neighbours;  // (2 edges)

  std::int32_t vertex_count() const { return offsets.empty() ? 0 : static_cast<std::int32_t>(offsets.size()) - 1; }
  std::span<const std::int32_t> list_neighbours(std::int32_t vertex) const {
    const std::int32_t* first = neighbours.data() + offsets[vertex];
    return {first, neighbours.data() + offsets[vertex + 1]};
  }
};

/// Quality of a partition.
struct Quality {
  std::vector<std::int64_t> elements;  // per part
  double balance = 1.0;                // largest part / mean part
  std::int64_t edge_cut = 0;           // pairs of elements that share a face across two parts
  bool contiguous = true;              // every part is connected through faces; a single part counts as contiguous
};

struct Partition {
  std::vector<std::int32_t> part;  // (elements), 0 <= part < parts
  Quality quality;
};

/// Dual graph of tetrahedra: elements are vertices, shared faces are edges. corners: (E, 4) node indices. Throws InputError if more than
/// two tetrahedra share a face.
Graph make_dual_graph(std::span<const std::int32_t> corners);

/// Elements of each node of a mesh.
struct ElementLists {
  std::vector<std::int64_t> begin;  // (nodes + 1) offsets into items
  std::vector<std::int32_t> items;  // ascending for each node

  std::span<const std::int32_t> of(std::int32_t node) const {
    const std::int32_t* first = items.data() + begin[node];
    return {first, items.data() + begin[node + 1]};
  }
};
/// elements: (E, width) node indices in [0, nodes); negative entries are skipped.
ElementLists list_elements(std::span<const std::int32_t> elements, int width, std::int32_t nodes);

/// Node graph of a mesh: nodes of a common element are neighbours. elements: (E, width) node indices in [0, nodes); negative entries are
/// skipped. Throws InputError if the graph exceeds 32-bit indices.
Graph make_node_graph(std::span<const std::int32_t> elements, int width, std::int32_t nodes);

/// Cuts tetrahedra into `parts` parts of nearly equal size with few tetrahedra at the interfaces: METIS k-way on the dual graph, contiguous
/// parts where possible. No part is empty. Deterministic. corners: (E, 4). Throws InputError if there are fewer elements than parts,
/// SystemError if METIS runs out of memory.
Partition partition_elements(std::span<const std::int32_t> corners, int parts);

/// Quality of a given partition. part: (E) in [0, parts). Throws InputError as make_dual_graph().
Partition measure_parts(std::span<const std::int32_t> corners, std::vector<std::int32_t> part, int parts);

/// Fill-reducing nested-dissection order of a graph, by METIS on the compressed graph (compress.hpp): result[v] is the zero-based position
/// of vertex v in the elimination order, a permutation (PERM_IN of MUMPS less one). dominated_per_edge: for a graph that is already the
/// core of a CompressedGraph, or part of one; if empty, the graph is compressed here. Throws SystemError if METIS runs out of memory.
std::vector<std::int32_t> order_nested_dissection(const Graph& graph, std::optional<double> dominated_per_edge = {});

/// Induced subgraph of some vertices, numbered by their place in the list, which ascends. number: (vertices of the graph) -1 before and
/// after: scratch shared by many parts of one graph.
Graph take_part(const Graph& graph, const std::vector<std::int32_t>& vertices, std::vector<std::int32_t>& number);

/// The same graph with vertex v numbered position[v]; position: (vertices) a permutation.
Graph renumber(const Graph& graph, const std::vector<std::int32_t>& position);

/// "5.1.0": METIS version at build time.
std::string metis_version();

}  // namespace carillon::partition
