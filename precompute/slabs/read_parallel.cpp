// Method: find the arrays (layout), read slabs (slab), cut (bisect), settle elements and nodes (settle), bring faces together (boundary).
// Source: the steps name theirs.
// Deviations: none.
#include "precompute/slabs/read_parallel.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <system_error>

#include "precompute/mesh/check_parts.hpp"
#include "precompute/slabs/settle.hpp"
#include "runtime/base/error.hpp"

namespace carillon::slabs {
namespace {

/// Rank 0 asks for the layout, all get it. Collective.
Layout share_layout(MPI_Comm comm, const std::filesystem::path& file) {
  Layout layout;
  petsc::run_agreed(comm, [&] {
    if (get_rank(comm) == 0) layout = find_layout(file);
  });
  // Flat records, the names beside them.
  struct Flat {
    std::int64_t offset, rows, columns;
    std::int32_t list, bytes, is_floating, is_signed, is_big_endian, name_bytes;
  };
  std::vector<Flat> flat;
  std::vector<char> names;
  const auto add = [&](const Array& array, int list) {
    flat.push_back({array.offset, array.rows, array.columns, list, array.bytes, array.is_floating, array.is_signed, array.is_big_endian,
                    static_cast<std::int32_t>(array.name.size())});
    names.insert(names.end(), array.name.begin(), array.name.end());
  };
  petsc::run_agreed(comm, [&] {
    if (get_rank(comm) != 0) return;
    add(layout.points, 0);
    add(layout.connectivity, 1);
    add(layout.offsets, 2);
    add(layout.types, 3);
    for (const Array& array : layout.point_data) add(array, 4);
    for (const Array& array : layout.cell_data) add(array, 5);
  });
  flat = share(comm, flat);
  names = share(comm, names);
  petsc::run_agreed(comm, [&] {
    layout = {};
    std::size_t at = 0;
    for (const Flat& one : flat) {
      Array array;
      array.name.assign(names.data() + at, static_cast<std::size_t>(one.name_bytes));
      at += static_cast<std::size_t>(one.name_bytes);
      array.offset = one.offset;
      array.rows = one.rows;
      array.columns = one.columns;
      array.bytes = one.bytes;
      array.is_floating = one.is_floating != 0;
      array.is_signed = one.is_signed != 0;
      array.is_big_endian = one.is_big_endian != 0;
      if (one.list == 0) layout.points = array;
      if (one.list == 1) layout.connectivity = array;
      if (one.list == 2) layout.offsets = array;
      if (one.list == 3) layout.types = array;
      if (one.list == 4) layout.point_data.push_back(array);
      if (one.list == 5) layout.cell_data.push_back(array);
    }
  });
  return layout;
}

/// The quality of all elements from that of each rank's. Collective.
void find_quality(MPI_Comm comm, const fem::LocalMesh& local, mesh::CheckReport& report) {
  mesh::CheckReport own;
  petsc::run_agreed(comm, [&] {
    mesh::TetMesh piece;
    piece.order = local.order;
    piece.nodes = local.nodes_m;
    piece.tets = local.tets;
    mesh::calc_quality(piece, own);
  });
  std::array<double, 4> least{own.min_dihedral_deg, own.mean_ratio_min, own.mean_ratio_1_percent, own.shortest_edge_m};
  std::array<double, 3> sum{own.volume_m3, own.mean_ratio_mean * local.tet_count(), static_cast<double>(own.slivers)};
  MPI_Allreduce(MPI_IN_PLACE, least.data(), 4, MPI_DOUBLE, MPI_MIN, comm);
  MPI_Allreduce(MPI_IN_PLACE, sum.data(), 3, MPI_DOUBLE, MPI_SUM, comm);
  MPI_Allreduce(&own.max_dihedral_deg, &report.max_dihedral_deg, 1, MPI_DOUBLE, MPI_MAX, comm);
  report.min_dihedral_deg = least[0];
  report.mean_ratio_min = least[1];
  report.mean_ratio_1_percent = least[2];
  report.shortest_edge_m = least[3];
  report.volume_m3 = sum[0];
  report.mean_ratio_mean = sum[1] / static_cast<double>(report.tets);
  report.slivers = static_cast<std::int64_t>(sum[2]);
}

void collect_warnings(mesh::CheckReport& report) {
  mesh::warn_of_elements(report);
  if (report.touching_nodes > 0)
    report.warnings.push_back(
        fmt::format("{} nodes of the boundary lie in the place of another: cracks are not closed in meshes that are read in parallel, so "
                    "the body may be in more parts than it seems ({} here)",
                    report.touching_nodes, report.components));
}

}  // namespace

bool is_parallel_format(const std::filesystem::path& file) {
  constexpr char kSignature[] = "\x89HDF\r\n\x1a\n";
  std::array<char, 8> begin{};
  std::error_code error;  // A pipe without a writer would keep us waiting.
  if (!std::filesystem::is_regular_file(file, error)) return false;
  std::ifstream(file, std::ios::binary).read(begin.data(), begin.size());
  return std::equal(begin.begin(), begin.end(), kSignature);
}

ParallelMesh read_parallel(MPI_Comm comm, const std::filesystem::path& file, const Wish& wish) {
  const std::string name = file.string();
  ParallelMesh result;
  const Layout layout = share_layout(comm, file);
  Slab slab = read_slab(comm, file, name, layout, wish, result.check);
  const auto part = bisect(comm, slab.centres_m, slab.elements.first[static_cast<std::size_t>(get_rank(comm))]);
  std::vector<char> on_seam;
  result.pieces = settle(comm, name, slab, part, wish, result.held_nodes, on_seam);
  result.check.components = result.pieces.components;
  result.boundary = find_boundary(comm, name, slab.corners, on_seam, result.pieces, result.check);
  find_quality(comm, result.pieces.local, result.check);
  petsc::run_agreed(comm, [&] { collect_warnings(result.check); });
  return result;
}

}  // namespace carillon::slabs
