// Method: locate arrays (layout), read blocks (read_block), partition (mesh::bisect), move elements and number nodes (mesh::redistribute),
//   again if the caller has a better partition, match faces (boundary).
#include "precompute/mesh/parallel/read_parallel.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <system_error>

#include "precompute/comm/exchange.hpp"
#include "precompute/mesh/check_parts.hpp"
#include "precompute/mesh/distributed/bisect.hpp"
#include "precompute/mesh/distributed/redistribute.hpp"
#include "precompute/mesh/parallel/boundary.hpp"
#include "precompute/mesh/parallel/layout.hpp"
#include "precompute/mesh/parallel/read_block.hpp"
#include "runtime/base/error.hpp"

namespace carillon::parallel_mesh {
namespace {

template <typename Layout, typename Visit>
void for_each_array(Layout& layout, const Visit& visit) {
  for (auto* array : {&layout.points, &layout.connectivity, &layout.offsets, &layout.types}) visit(*array);
  for (auto* list : {&layout.point_data, &layout.cell_data})
    for (auto& array : *list) visit(array);
}

/// Rank 0 reads the layout and broadcasts it. Collective.
Layout broadcast_layout(const comm::Communicator& comm, const std::filesystem::path& file) {
  Layout layout;
  const auto names = comm.broadcast([&] {
    layout = find_layout(file);
    std::vector<std::string> list;
    for_each_array(layout, [&](const Array& array) { list.push_back(array.name); });
    return list;
  });
  const auto places = comm.broadcast([&] {
    std::vector<ArrayPlace> list;
    for_each_array(layout, [&](const Array& array) { list.push_back(array); });
    return list;
  });
  const auto point_arrays = comm.broadcast(static_cast<std::int64_t>(layout.point_data.size()));
  comm.agree([&] {
    layout.point_data.resize(point_arrays);
    layout.cell_data.resize(names.size() - 4 - layout.point_data.size());
    std::size_t i = 0;
    for_each_array(layout, [&](Array& array) {
      array = {places[i], names[i]};
      ++i;
    });
  });
  return layout;
}

/// Global quality from the quality on each rank. Collective.
void calc_quality(const comm::Communicator& comm, const mesh::LocalMesh& local, mesh::CheckReport& report) {
  const auto own = comm.agree([&] {
    mesh::CheckReport quality;
    mesh::TetMesh part;
    part.order = local.order;
    part.nodes_m = local.nodes_m;
    part.tets = local.tets;
    mesh::calc_quality(part, quality);
    return quality;
  });
  std::array<double, 4> lowest{own.min_dihedral_deg, own.mean_ratio_min, own.mean_ratio_1_percent, own.shortest_edge_m};
  std::array<double, 3> sum{own.volume_m3, own.mean_ratio_mean * local.tet_count(), static_cast<double>(own.slivers)};
  comm.min(lowest);
  comm.sum(sum);
  report.max_dihedral_deg = comm.max(own.max_dihedral_deg);
  report.min_dihedral_deg = lowest[0];
  report.mean_ratio_min = lowest[1];
  report.mean_ratio_1_percent = lowest[2];
  report.shortest_edge_m = lowest[3];
  report.volume_m3 = sum[0];
  report.mean_ratio_mean = sum[1] / static_cast<double>(report.tets);
  report.slivers = static_cast<std::int64_t>(sum[2]);
}

/// Target rank of each element of the block, from those known to the current owners. Collective.
std::vector<std::int32_t> send_back(const comm::Communicator& comm, const comm::IndexPartition& elements, const mesh::LocalMesh& local,
                                    const std::vector<std::int32_t>& rank) {
  return comm::report_to_owners<std::int32_t>(
      comm,
      [&] {
        std::vector<comm::Reported<std::int32_t>> list;
        for (std::size_t e = 0; e < rank.size(); ++e) list.push_back({local.tet_in_mesh[e], rank[e]});
        return list;
      },
      elements);
}

/// Rows of free nodes in the current partition. Collective.
std::vector<std::int32_t> find_rows(const comm::Communicator& comm, const mesh::MeshBlock& block, const std::vector<std::int32_t>& nodes,
                                    const mesh::LocalMesh& now) {
  const auto find_owner = [&](std::int32_t node) { return block.find_owner(node); };
  const auto row_at = comm::report_to_owners<std::int32_t>(
      comm,
      [&] {
        std::vector<comm::Reported<std::int32_t>> rows;
        for (std::size_t i = 0; i < static_cast<std::size_t>(now.free_nodes); ++i) rows.push_back({now.node_in_mesh[i], now.row[i]});
        return rows;
      },
      find_owner, block.own_node_count(), [&](std::int32_t node) { return block.to_local(node); }, -1);
  return comm::query_owners<std::int32_t>(comm, nodes, find_owner, [&](std::int32_t node) { return row_at[block.to_local(node)]; });
}

/// Partitions the mesh by `part`, and again if the options request it. Collective.
mesh::DistributedMesh cut(const comm::Communicator& comm, const std::string& name, mesh::MeshBlock& block,
                          const std::vector<std::int32_t>& part, const ReadOptions& options, std::vector<char>& on_seam) {
  const bool has_fixed = !options.fixed.empty();
  if (!options.recut || !options.recut->is_wanted(block.node_count()))
    return mesh::redistribute(comm, name, block, part, has_fixed, on_seam);
  block.centres_m = {};
  mesh::MeshBlock copy = comm.agree([&] { return block; });
  mesh::DistributedMesh mesh = mesh::redistribute(comm, name, copy, part, has_fixed, on_seam);
  const std::vector<std::int32_t> second = send_back(comm, block.elements, mesh.local, options.recut->find_ranks(mesh.local));
  const std::vector<std::int32_t> nodes(mesh.local.node_in_mesh.begin(), mesh.local.node_in_mesh.begin() + mesh.local.free_nodes);
  mesh = {};
  on_seam.clear();
  mesh = mesh::redistribute(comm, name, block, second, has_fixed, on_seam);
  options.recut->renumber(find_rows(comm, block, nodes, mesh.local));
  return mesh;
}

void collect_warnings(mesh::CheckReport& report) {
  mesh::warn_of_elements(report);
  if (report.touching_nodes > 0)
    report.warnings.push_back(
        fmt::format("{} nodes of the boundary coincide with another: the parallel reader does not close cracks, so "
                    "the body may be in more parts than it seems ({} here)",
                    report.touching_nodes, report.components));
}

}  // namespace

bool is_parallel_format(const std::filesystem::path& file) {
  constexpr char kSignature[] = "\x89HDF\r\n\x1a\n";
  std::array<char, 8> begin{};
  std::error_code error;  // A pipe without a writer would block.
  if (!std::filesystem::is_regular_file(file, error)) return false;
  std::ifstream(file, std::ios::binary).read(begin.data(), begin.size());
  return std::equal(begin.begin(), begin.end(), kSignature);
}

ParallelMesh read_parallel(const comm::Communicator& comm, const std::filesystem::path& file, const ReadOptions& options) {
  const std::string name = file.string();
  ParallelMesh result;
  const Layout layout = broadcast_layout(comm, file);
  mesh::MeshBlock block = read_block(comm, file, name, layout, options, result.check);
  result.fixed_nodes = comm.sum(std::int64_t{std::ranges::count_if(block.fixed, [](std::int32_t fixed) { return fixed != 0; })});
  const auto part = mesh::bisect(comm, block.centres_m, block.elements.own_begin());
  std::vector<char> on_seam;
  result.mesh = cut(comm, name, block, part, options, on_seam);
  result.check.components = result.mesh.components;
  result.boundary = find_boundary(comm, name, block.corners, on_seam, result.mesh, result.check);
  calc_quality(comm, result.mesh.local, result.check);
  comm.agree([&] { collect_warnings(result.check); });
  return result;
}

}  // namespace carillon::parallel_mesh
