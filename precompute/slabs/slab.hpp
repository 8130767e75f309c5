// One rank's slab of the file: a run of the elements and a run of the nodes. Inner header of the parallel reader.
#pragma once

#include <mpi.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "precompute/mesh/check.hpp"
#include "precompute/slabs/layout.hpp"
#include "precompute/slabs/read_parallel.hpp"
#include "precompute/slabs/route.hpp"

namespace carillon::slabs {

/// A run of nodes and a run of elements, nowhere near each other in general. Nodes are numbered over the whole mesh: the corners of the
/// file first, then mid nodes that were added; each kind has its own homes.
struct Slab {
  int order = 1;
  Homes corners;                   // homes of the nodes of the file that are in use
  Homes mids;                      // of those that were added, numbered from corners.total()
  std::vector<Vec3> nodes_m;       // this rank's corners, then its mids
  std::vector<std::int32_t> held;  // of these: 0 free, else 1 + the first entry of Wish::hold that holds the node
  Homes elements;
  std::vector<std::int32_t> tets;  // (e, 4) or (e, 10) numbers of nodes
  std::vector<std::int32_t> regions;
  std::vector<Vec3> centres_m;  // (e)

  std::size_t width() const { return order == 1 ? 4 : 10; }
  std::int64_t node_count() const { return corners.total() + mids.total(); }
  int find_home(std::int64_t node) const { return node < corners.total() ? corners.find(node) : mids.find(node - corners.total()); }
  /// Where a node is in nodes_m of its home `rank`.
  std::size_t find_place(std::int64_t node, int rank) const {
    const auto r = static_cast<std::size_t>(rank);
    if (node < corners.total()) return static_cast<std::size_t>(node - corners.first[r]);
    return static_cast<std::size_t>(corners.first[r + 1] - corners.first[r] + node - corners.total() - mids.first[r]);
  }
};

/// Reads this rank's slab, checks and turns its elements, drops unused nodes and brings the elements to the wished order; counts what was
/// done in `report`. `name` begins every message. Collective.
Slab read_slab(MPI_Comm comm, const std::filesystem::path& file, const std::string& name, const Layout& layout, const Wish& wish,
               mesh::CheckReport& report);

/// The part of each of this rank's elements, 0 <= part < ranks, by recursive inertial bisection: parts differ by one element at most.
/// Collective.
std::vector<std::int32_t> bisect(MPI_Comm comm, const std::vector<Vec3>& centres_m, std::int64_t first_element);

}  // namespace carillon::slabs
