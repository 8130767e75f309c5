// From slabs to pieces: elements to their ranks, owners and rows of nodes, components. Inner header of the parallel reader.
#pragma once

#include "precompute/slabs/slab.hpp"

namespace carillon::slabs {

/// A face of this rank's elements as its home sees it: the home of the face's lowest corner.
struct FaceRecord {
  std::int32_t a, b, c;   // numbers of the corners, ascending
  std::int32_t apex;      // the element's fourth corner
  std::int32_t tet;       // number of the element
  std::int32_t in_piece;  // the element's place in LocalMesh
  std::int8_t local;      // 0..3, see mesh::kFaces
  bool is_odd;            // seen from outside the element, a b c run clockwise
  bool is_matched;        // its twin is on the same rank
};

/// Moves every element to its part and numbers the nodes; the slab is empty afterwards. Fills all of Distribution but the report's cut,
/// and `on_seam`: which local nodes other ranks touch too. Collective.
fem::Distribution settle(MPI_Comm comm, const std::string& name, Slab& slab, const std::vector<std::int32_t>& part, const Wish& wish,
                         std::int64_t& held_nodes, std::vector<char>& on_seam);

/// Brings the faces of all elements together: refuses elements given twice, faces of more than two elements and elements on one side of
/// their common face; counts the cut; returns the boundary on rank 0. `homes` are those of the nodes' numbers. Collective.
Boundary find_boundary(MPI_Comm comm, const std::string& name, const Homes& homes, const std::vector<char>& on_seam,
                       fem::Distribution& pieces, mesh::CheckReport& report);

}  // namespace carillon::slabs
