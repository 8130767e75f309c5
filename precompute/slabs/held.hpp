// Which of a rank's nodes are held: by sets of the file, and by boxes.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <string>

#include "precompute/mesh/check.hpp"
#include "precompute/slabs/slab.hpp"
#include "precompute/slabs/source.hpp"

namespace carillon::slabs {

/// Marks the nodes of all wished sets. begin: number of this rank's first node. Collective. Throws InputError on every rank for a set that
/// is not there or holds no node.
void read_held_sets(MPI_Comm comm, const Source& source, const std::string& name, const Layout& layout, const Wish& wish,
                    std::int64_t begin, Slab& slab);

/// Puts the box of the mesh into the report and marks the nodes of the wished boxes. Collective. Throws InputError on every rank for a box
/// without a node.
void find_held_boxes(MPI_Comm comm, const std::string& name, const Wish& wish, Slab& slab, mesh::CheckReport& report);

}  // namespace carillon::slabs
