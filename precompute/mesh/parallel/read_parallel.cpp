// Method: locate arrays (layout), read blocks (read_block), partition (mesh::bisect), move elements and number nodes (mesh::redistribute),
//   again if the caller has a better partition, match faces (boundary).
#include "precompute/mesh/parallel/read_parallel.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <string>
#include <system_error>
#include <tuple>
#include <vector>

#include "precompute/comm/exchange.hpp"
#include "precompute/comm/index_partition.hpp"
#include "precompute/mesh/check.hpp"
#include "precompute/mesh/check_parts.hpp"
#include "precompute/mesh/distributed/bisect.hpp"
#include "precompute/mesh/distributed/redistribute.hpp"
#include "precompute/mesh/faces.hpp"
#include "precompute/mesh/parallel/layout.hpp"
#include "precompute/mesh/parallel/read_block.hpp"
#include "precompute/mesh/parts.hpp"
#include "runtime/base/error.hpp"

namespace carillon::parallel_mesh {
namespace {

using mesh::LocalMesh;

// Method: faces are matched within a rank; unmatched faces, and faces with all corners on a seam, go to the owner of their lowest corner,
//   which sees all elements of the face. Faces unmatched there are boundary and go to rank 0.

/// A face of this rank's elements as sent to the owner of its lowest corner.
struct FaceRecord {
  std::int32_t a, b, c;   // corner numbers, ascending
  std::int32_t apex;      // fourth corner of the element
  std::int32_t tet;       // element number
  std::int32_t in_local;  // index of the element in LocalMesh
  std::int8_t local;      // 0..3, see mesh::kFaces
  bool is_odd;            // a b c run clockwise seen from outside the element
  bool is_matched;        // twin is on the same rank
};

bool have_same_corners(const FaceRecord& x, const FaceRecord& y) { return x.a == y.a && x.b == y.b && x.c == y.c; }

std::vector<FaceRecord> list_faces(const LocalMesh& local) {
  const std::size_t width = local.nodes_per_tet();
  std::vector<FaceRecord> faces;
  faces.reserve(4 * local.tet_count());
  for (std::int32_t e = 0; e < local.tet_count(); ++e)
    for (int side = 0; side < 4; ++side) {
      const auto at = [&](int corner) {
        return local.node_in_mesh[local.tets[static_cast<std::size_t>(e) * width + static_cast<std::size_t>(corner)]];
      };
      std::array<std::int32_t, 3> v{};
      for (std::size_t k = 0; k < 3; ++k) v[k] = at(mesh::kFaces[side][k]);
      bool is_odd = false;
      const auto order = [&](std::size_t i, std::size_t j) {
        if (v[j] > v[i]) return;
        std::swap(v[i], v[j]);
        is_odd = !is_odd;
      };
      order(0, 1);
      order(1, 2);
      order(0, 1);
      faces.push_back({v[0], v[1], v[2], at(side), local.tet_in_mesh[e], e, static_cast<std::int8_t>(side), is_odd, false});
    }
  return faces;
}

/// Visits runs of equal corners: visit(first, past the last).
template <typename Visit>
void for_each_face(std::vector<FaceRecord>& faces, Visit&& visit) {
  std::sort(faces.begin(), faces.end(),
            [](const FaceRecord& x, const FaceRecord& y) { return std::tie(x.a, x.b, x.c, x.tet) < std::tie(y.a, y.b, y.c, y.tet); });
  for (std::size_t i = 0; i < faces.size();) {
    std::size_t end = i + 1;
    while (end < faces.size() && have_same_corners(faces[i], faces[end])) ++end;
    visit(i, end);
    i = end;
  }
}

void check_face(const std::string& name, const std::vector<FaceRecord>& faces, std::size_t first, std::size_t end) {
  for (std::size_t j = first; j < end; ++j)
    for (std::size_t k = first; k < j && k < first + 8; ++k)
      if (faces[j].apex == faces[k].apex)
        throw InputError(fmt::format(
            "{}: element {} is given twice (it has the corners of element {}; tetrahedra counted from 1 in the order of the file); "
            "write each element once",
            name, std::max(faces[j].tet, faces[k].tet) + 1, std::min(faces[j].tet, faces[k].tet) + 1));
  if (end - first > 2)
    throw InputError(fmt::format(
        "{}: the face of nodes {}, {} and {} belongs to {} elements ({}, {}, {} ...); a face joins two at most: mesh the body again", name,
        faces[first].a + 1, faces[first].b + 1, faces[first].c + 1, end - first, faces[first].tet + 1, faces[first + 1].tet + 1,
        faces[first + 2].tet + 1));
  if (end - first == 2 && faces[first].is_odd == faces[first + 1].is_odd)
    throw InputError(fmt::format(
        "{}: elements {} and {} lie on the same side of their common face (nodes {}, {}, {}): one of them is inverted (tetrahedra "
        "counted from 1 in the order of the file); mesh the body again",
        name, faces[first].tet + 1, faces[first + 1].tet + 1, faces[first].a + 1, faces[first].b + 1, faces[first].c + 1));
}

/// Keeps the faces that other ranks may share; true if this rank's elements are connected through faces.
bool match_at_rank(const std::string& name, const LocalMesh& local, const std::vector<char>& on_seam, std::vector<FaceRecord>& faces) {
  mesh::Parts parts(static_cast<std::size_t>(local.tet_count()));
  const auto is_on_seam = [&](const FaceRecord& face) {
    const std::int32_t* tet = local.tets.data() + static_cast<std::size_t>(face.in_local) * static_cast<std::size_t>(local.nodes_per_tet());
    return std::ranges::all_of(mesh::kFaces[face.local], [&](int corner) { return on_seam[tet[corner]] != 0; });
  };
  std::size_t kept = 0;
  std::int64_t joined = 0;
  for_each_face(faces, [&](std::size_t first, std::size_t end) {
    check_face(name, faces, first, end);
    if (end - first == 2) {
      const std::int32_t a = parts.find(faces[first].in_local), b = parts.find(faces[first + 1].in_local);
      joined += a != b;
      parts.join(a, b);
      if (!is_on_seam(faces[first])) return;
      faces[first].is_matched = faces[first + 1].is_matched = true;  // another rank may have a third
    }
    for (std::size_t i = first; i < end; ++i) faces[kept++] = faces[i];
  });
  faces.resize(kept);
  return joined == local.tet_count() - 1;
}

/// A boundary triangle and a vertex as sent to rank 0.
struct TriangleRecord {
  std::int32_t tet;
  std::int32_t side;  // 4 * local face + part of a quadratic face
  std::array<std::int32_t, 3> nodes;
  std::array<std::int32_t, 3> corners;  // of the face; those of the triangle for linear elements
};

struct VertexRecord {
  std::int32_t node, row;
  Vec3 x;
};

void add_triangles(const LocalMesh& local, const FaceRecord& face, std::vector<TriangleRecord>& triangles) {
  const auto [i, j, k] = mesh::kFaces[face.local];
  const auto add = [&](int part, int a, int b, int c) {
    const std::size_t first = static_cast<std::size_t>(face.in_local) * static_cast<std::size_t>(local.nodes_per_tet());
    const auto at = [&](int corner) {
      return local.tets[first + static_cast<std::size_t>(corner)];
    };  // local until rank 0 has to read them
    triangles.push_back({face.tet, 4 * face.local + part, {at(a), at(b), at(c)}, {face.a, face.b, face.c}});
  };
  if (local.order == 1) return add(0, i, j, k);
  const int ij = 4 + mesh::find_edge(i, j), jk = 4 + mesh::find_edge(j, k), ki = 4 + mesh::find_edge(k, i);
  add(0, i, ij, ki);
  add(1, ij, j, jk);
  add(2, ki, jk, k);
  add(3, ij, jk, ki);
}

/// Checks that every edge of the surface joins two triangles.
void check_closed(const std::string& name, const std::vector<TriangleRecord>& triangles) {
  struct Edge {
    std::int32_t low, high, tet;
  };
  std::vector<Edge> edges;
  edges.reserve(3 * triangles.size());
  for (const TriangleRecord& triangle : triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax(triangle.nodes[k], triangle.nodes[(k + 1) % 3]);
      edges.push_back({low, high, triangle.tet});
    }
  std::sort(edges.begin(), edges.end(),
            [](const Edge& x, const Edge& y) { return std::tie(x.low, x.high, x.tet) < std::tie(y.low, y.high, y.tet); });
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t end = i + 1;
    while (end < edges.size() && edges[end].low == edges[i].low && edges[end].high == edges[i].high) ++end;
    if (end - i != 2)
      throw InputError(
          fmt::format("{}: the boundary is not a closed surface: the edge between nodes {} and {} carries {} boundary faces instead of 2, "
                      "one of them of "
                      "element {}; thicken the body there or part it, and mesh it again",
                      name, edges[i].low + 1, edges[i].high + 1, end - i, edges[i].tet + 1));
    i = end;
  }
}

std::int64_t count_twins(std::vector<Vec3> points) {
  std::sort(points.begin(), points.end());
  std::int64_t twins = 0;
  for (std::size_t i = 1; i < points.size(); ++i) twins += points[i] == points[i - 1];
  return twins;
}

Boundary make_boundary(std::vector<TriangleRecord>& triangles, std::vector<VertexRecord>& vertices) {
  Boundary boundary;
  std::sort(vertices.begin(), vertices.end(), [](const VertexRecord& x, const VertexRecord& y) { return x.node < y.node; });
  vertices.erase(
      std::unique(vertices.begin(), vertices.end(), [](const VertexRecord& x, const VertexRecord& y) { return x.node == y.node; }),
      vertices.end());
  for (const VertexRecord& vertex : vertices) {
    boundary.vertices_m.push_back(vertex.x);
    boundary.row.push_back(vertex.row);
  }
  std::sort(triangles.begin(), triangles.end(),
            [](const TriangleRecord& x, const TriangleRecord& y) { return std::tie(x.tet, x.side) < std::tie(y.tet, y.side); });
  const auto find_vertex = [&](std::int32_t node) {
    return static_cast<std::int32_t>(
        std::lower_bound(vertices.begin(), vertices.end(), node,
                         [](const VertexRecord& vertex, std::int32_t wanted) { return vertex.node < wanted; }) -
        vertices.begin());
  };
  for (const TriangleRecord& triangle : triangles)
    boundary.triangles.push_back({find_vertex(triangle.nodes[0]), find_vertex(triangle.nodes[1]), find_vertex(triangle.nodes[2])});
  return boundary;
}

/// True for each face (in order of arrival) without a twin on another rank; adds the pairs of faces across ranks to `cut`.
std::vector<char> match_faces(const std::string& name, std::vector<FaceRecord> faces, std::int64_t& cut) {
  std::vector<char> is_alone(faces.size(), 0);
  for (std::size_t i = 0; i < faces.size(); ++i) faces[i].in_local = static_cast<std::int32_t>(i);  // remember the order of arrival
  for_each_face(faces, [&](std::size_t first, std::size_t end) {
    check_face(name, faces, first, end);
    if (end - first == 1) is_alone[faces[first].in_local] = 1;
    cut += end - first == 2 && !faces[first].is_matched;
  });
  return is_alone;
}

/// Triangles of the unmatched faces, with their node numbers.
std::vector<TriangleRecord> list_triangles(const LocalMesh& local, const std::vector<FaceRecord>& faces, const std::vector<char>& is_alone,
                                           std::vector<VertexRecord>& vertices) {
  std::vector<TriangleRecord> triangles;
  for (std::size_t i = 0; i < faces.size(); ++i)
    if (is_alone[i] != 0) add_triangles(local, faces[i], triangles);
  std::vector<char> is_vertex(local.nodes_m.size(), 0);
  for (TriangleRecord& triangle : triangles)
    for (std::int32_t& node : triangle.nodes) {
      is_vertex[node] = 1;
      node = local.node_in_mesh[node];
    }
  for (std::size_t i = 0; i < is_vertex.size(); ++i)
    if (is_vertex[i] != 0) vertices.push_back({local.node_in_mesh[i], local.row[i], local.nodes_m[i]});
  return triangles;
}

/// Matches the faces of all elements: refuses duplicate elements, faces of more than two elements and elements on one side of a common
/// face; counts the cut; returns the boundary on rank 0. corners: rank that matches the faces of each lowest corner; on_seam (n): local
/// nodes shared with other ranks. Collective. Throws InputError on every rank.
Boundary find_boundary(const comm::Communicator& comm, const std::string& name, const comm::IndexPartition& corners,
                       const std::vector<char>& on_seam, mesh::DistributedMesh& mesh, mesh::CheckReport& report) {
  const LocalMesh& local = mesh.local;
  bool is_connected = true;
  auto faces = comm.agree([&] {
    auto all = list_faces(local);
    is_connected = match_at_rank(name, local, on_seam, all);
    return all;
  });
  mesh.report.contiguous = comm.all(is_connected);
  std::int64_t cut = 0;
  const auto is_alone = comm::query_owners<char>(
      comm, faces, [&](const FaceRecord& face) { return corners.find_owner(face.a); },
      [&](const comm::ByRank<FaceRecord>& asked) { return match_faces(name, asked.items, cut); });
  mesh.report.edge_cut = comm.sum(cut);

  std::vector<VertexRecord> vertices;
  auto triangles = comm::gather(comm, [&] {
    auto own = list_triangles(local, faces, is_alone, vertices);
    faces = {};
    return own;
  });
  vertices = comm::gather(comm, vertices);
  struct Counts {
    std::int64_t faces, touching_nodes;
  };
  Boundary boundary;
  const Counts counts = comm.broadcast([&] {
    check_closed(name, triangles);
    boundary = make_boundary(triangles, vertices);
    return Counts{static_cast<std::int64_t>(triangles.size()) / (local.order == 1 ? 1 : 4), count_twins(boundary.vertices_m)};
  });
  report.boundary_faces = counts.faces;
  report.touching_nodes = counts.touching_nodes;
  return boundary;
}

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
