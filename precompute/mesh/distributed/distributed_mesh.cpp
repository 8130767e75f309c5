#include "precompute/mesh/distributed/distributed_mesh.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstring>

#include "runtime/base/error.hpp"

namespace carillon::mesh {
namespace {

/// Scalar members of a LocalMesh.
struct Header {
  std::int32_t order, free_nodes, owned_nodes, first_row;
};

/// Visits all arrays in the order of serialisation.
template <typename Mesh, typename Visit>
void for_each_array(Mesh& local, const Visit& visit) {
  visit(local.tets);
  visit(local.tet_in_mesh);
  visit(local.region);
  visit(local.nodes_m);
  visit(local.doubt_m);
  visit(local.node_in_mesh);
  visit(local.row);
  visit(local.component);
  visit(local.fixed_by);
}

template <typename T>
std::size_t count_bytes(const std::vector<T>& array) {
  return array.size() * sizeof(T);
}

}  // namespace

std::vector<std::byte> serialise(const LocalMesh& local) {
  const Header header{local.order, local.free_nodes, local.owned_nodes, local.first_row};
  std::size_t size = sizeof header;
  for_each_array(local, [&](const auto& array) { size += sizeof(std::int64_t) + count_bytes(array); });
  std::vector<std::byte> bytes(size);
  std::byte* at = bytes.data();
  const auto put = [&](const void* from, std::size_t count) {
    if (count > 0) std::memcpy(at, from, count);
    at += count;
  };
  put(&header, sizeof header);
  for_each_array(local, [&](const auto& array) {
    const auto length = static_cast<std::int64_t>(array.size());
    put(&length, sizeof length);
    put(array.data(), count_bytes(array));
  });
  return bytes;
}

LocalMesh deserialise(const std::vector<std::byte>& bytes) {
  const std::byte* at = bytes.data();
  const auto take = [&](void* to, std::size_t count) {
    if (count > 0) std::memcpy(to, at, count);
    at += count;
  };
  Header header{};
  take(&header, sizeof header);
  LocalMesh local;
  local.order = header.order;
  local.free_nodes = header.free_nodes;
  local.owned_nodes = header.owned_nodes;
  local.first_row = header.first_row;
  for_each_array(local, [&](auto& array) {
    std::int64_t length = 0;
    take(&length, sizeof length);
    array.resize(length);
    take(array.data(), count_bytes(array));
  });
  return local;
}

void report_ranks(const comm::Communicator& comm, DistributedMesh& mesh) {
  const LocalMesh& local = mesh.local;
  PartitionReport& report = mesh.report;
  report.ranks = comm.all_gather([&] {
    return std::vector<PartitionReport::Rank>{
        {local.tet_count(), local.owned_nodes, static_cast<std::int64_t>(local.nodes_m.size()) - local.owned_nodes}};
  });
  std::int64_t max_tets = 0, max_nodes = 0;
  for (const auto& rank : report.ranks) {
    max_tets = std::max(max_tets, rank.elements);
    max_nodes = std::max(max_nodes, rank.owned_nodes);
  }
  const double ranks = comm.size();
  report.element_balance = static_cast<double>(max_tets) * ranks / static_cast<double>(mesh.tets);
  report.node_balance = static_cast<double>(max_nodes) * ranks / static_cast<double>(mesh.nodes);
}

std::vector<Vec3> find_supporting_points(const std::vector<Vec3>& points_m) {
  if (points_m.size() <= 3) return points_m;
  const auto square = [](const Vec3& x) { return dot(x, x); };
  const Vec3 first = points_m.front();
  const auto find_farthest = [&](auto&& measure) {
    return *std::max_element(points_m.begin(), points_m.end(), [&](const Vec3& x, const Vec3& y) { return measure(x) < measure(y); });
  };
  const Vec3 second = find_farthest([&](const Vec3& x) { return square(x - first); });
  const Vec3 line = second - first;
  const Vec3 third = find_farthest([&](const Vec3& x) { return square(cross(line, x - first)); });
  return {first, second, third};
}

std::vector<std::vector<Vec3>> find_supporting_points(const std::vector<FixedPoint>& points, std::int32_t components) {
  std::vector<std::vector<Vec3>> points_m(components);
  for (const FixedPoint& point : points) points_m[point.component].push_back(point.x_m);
  for (auto& list : points_m) list = find_supporting_points(list);
  return points_m;
}

std::vector<FixedPoint> list_points(const std::vector<std::vector<Vec3>>& points_m) {
  std::vector<FixedPoint> points;
  for (std::size_t c = 0; c < points_m.size(); ++c)
    for (const Vec3& x_m : points_m[c]) points.push_back({x_m, static_cast<std::int32_t>(c)});
  return points;
}

void check_free_nodes(std::int64_t free_nodes, const std::string& begin) {
  if (free_nodes == 0) throw InputError(begin + "'fixed' names every node of the mesh; fix fewer nodes (a smaller box or node set)");
  if (free_nodes > INT32_MAX / 3)
    throw InputError(
        fmt::format("{}the mesh has {} free nodes, 32-bit matrix rows end at 715827882; use a coarser mesh", begin, free_nodes));
}

std::string describe(const PartitionReport& report) {
  std::string text = fmt::format("{} rank{}, {} faces cut, balance {:.3f} (elements) {:.3f} (nodes){}\n", report.ranks.size(),
                                 report.ranks.size() == 1 ? "" : "s", report.edge_cut, report.element_balance, report.node_balance,
                                 report.contiguous ? "" : ", not contiguous");
  for (std::size_t r = 0; r < report.ranks.size(); ++r)
    text += fmt::format("  rank {}: {} tetrahedra, {} nodes of its own, {} halo nodes\n", r, report.ranks[r].elements,
                        report.ranks[r].owned_nodes, report.ranks[r].halo_nodes);
  return text;
}

}  // namespace carillon::mesh
