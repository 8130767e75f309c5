// Graphs cut into parts: which rank gets which tetrahedra, and in which order a factorisation eliminates nodes. METIS inside; no MPI, no
// PETSc.
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

/// How good a partition is.
struct Quality {
  std::vector<std::int64_t> elements;  // per part
  double balance = 1.0;                // largest part / mean part
  std::int64_t edge_cut = 0;           // pairs of elements that share a face and not a part
  bool contiguous = true;              // every part is connected through faces; a single part counts as one
};

struct Partition {
  std::vector<std::int32_t> part;  // (elements), 0 <= part < parts
  Quality quality;
};

/// The dual graph of tetrahedra: elements are vertices, shared faces are edges. corners: (E, 4) node indices.
/// Throws InputError when more than two tetrahedra share a face.
Graph make_dual_graph(std::span<const std::int32_t> corners);

/// The elements of each node of a mesh.
struct ElementLists {
  std::vector<std::int64_t> begin;  // (nodes + 1) of each node's in items
  std::vector<std::int32_t> items;  // ascending for each node

  std::span<const std::int32_t> of(std::int32_t node) const {
    const std::int32_t* first = items.data() + begin[node];
    return {first, items.data() + begin[node + 1]};
  }
};
/// elements: (E, width) node indices in [0, nodes); negative entries are skipped.
ElementLists list_elements(std::span<const std::int32_t> elements, int width, std::int32_t nodes);

/// The node graph of a mesh: two nodes are neighbours when an element holds both. elements: (E, width) node indices in [0, nodes);
/// negative entries are skipped (nodes that take no part). Throws InputError when the graph exceeds 32-bit indices.
Graph make_node_graph(std::span<const std::int32_t> elements, int width, std::int32_t nodes);

/// Cuts tetrahedra into `parts` parts of nearly equal size with few tetrahedra on the seams between them: METIS k-way on the dual graph,
/// contiguous parts where METIS can make them. No part is empty. The same input gives the same answer. corners: (E, 4).
/// Throws InputError when there are fewer elements than parts, SystemError when METIS runs out of memory.
Partition partition_elements(std::span<const std::int32_t> corners, int parts);

/// The quality of parts that others have made. part: (E) in [0, parts). Throws InputError as make_dual_graph().
Partition measure_parts(std::span<const std::int32_t> corners, std::vector<std::int32_t> part, int parts);

/// Fill-reducing order of a graph by nested dissection, METIS's of the condensed graph (condense.hpp): result[v] is the position of vertex
/// v in the elimination order (zero-based), a permutation. This is MUMPS' PERM_IN less one. dominated_per_edge: of a graph that is
/// the core of a Condensation already, or a part of it; without, it is condensed here. Throws SystemError when METIS runs out of memory.
std::vector<std::int32_t> order_nested_dissection(const Graph& graph, std::optional<double> dominated_per_edge = {});

/// The graph of some vertices alone, which are numbered as they stand in the list, ascending. number: (vertices of the graph) -1, and so
/// afterwards: scratch that serves many parts of one graph.
Graph take_part(const Graph& graph, const std::vector<std::int32_t>& vertices, std::vector<std::int32_t>& number);

/// The same graph with vertex v numbered position[v]; position: (vertices) a permutation.
Graph renumber(const Graph& graph, const std::vector<std::int32_t>& position);

/// "5.1.0": the METIS that this was built with.
std::string metis_version();

}  // namespace carillon::partition
