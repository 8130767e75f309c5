#include "precompute/io/body.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "precompute/io/meshing.hpp"
#include "precompute/io/refine_mesh.hpp"
#include "precompute/mesh/read.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/slabs/read_parallel.hpp"

namespace carillon::io {
namespace {

// What is known of a body before its mesh is made.
constexpr std::int64_t kFileBytesPerTet = 50, kUsualNodes = 20000;
constexpr double kMeshingSeconds = 5;

/// A fixed node, and the first entry of the job's "fixed" that names it.
struct FixedNode {
  std::int32_t node, entry;
};

/// The nodes of all sets and boxes that the job fixes, each once, ascending.
std::vector<FixedNode> find_fixed_nodes(const mesh::TetMesh& mesh, const job::JobSpec& job) {
  std::vector<FixedNode> list;
  for (std::size_t entry = 0; entry < job.fixed.size(); ++entry) {
    const job::Fixed& fixed = job.fixed[entry];
    try {
      const auto nodes = fixed.node_set ? mesh::find_fixed_nodes(mesh, *fixed.node_set)
                                        : mesh::find_fixed_nodes(mesh, (*fixed.box_m)[0], (*fixed.box_m)[1]);
      for (const std::int32_t node : nodes) list.push_back({node, static_cast<std::int32_t>(entry)});
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: key 'fixed': {}", fixed.place.empty() ? job.file.string() : fixed.place, error.what()));
    }
  }
  std::sort(list.begin(), list.end(),
            [](const FixedNode& a, const FixedNode& b) { return std::pair(a.node, a.entry) < std::pair(b.node, b.entry); });
  list.erase(std::unique(list.begin(), list.end(), [](const FixedNode& a, const FixedNode& b) { return a.node == b.node; }), list.end());
  return list;
}

/// Tells every rank which entry fixes its nodes. `list` is read on rank 0. Collective.
void share_fixed_nodes(MPI_Comm comm, std::vector<FixedNode> list, fem::LocalMesh& local) {
  auto count = static_cast<std::int64_t>(list.size());
  MPI_Bcast(&count, 1, MPI_INT64_T, 0, comm);
  if (count == 0) return;
  petsc::run_agreed(comm, [&] {
    list.resize(static_cast<std::size_t>(count));
    local.fixed_by.assign(local.nodes_m.size(), -1);
  });
  MPI_Bcast(list.data(), static_cast<int>(2 * count), MPI_INT32_T, 0, comm);
  for (std::size_t i = 0; i < local.node_in_mesh.size(); ++i) {
    const std::int32_t node = local.node_in_mesh[i];
    const auto at = std::lower_bound(list.begin(), list.end(), node, [](const FixedNode& a, std::int32_t b) { return a.node < b; });
    if (at != list.end() && at->node == node) local.fixed_by[i] = at->entry;
  }
}

/// What the check of the mesh found; of an odd size, with the key of the job that corrects it. Rank 0.
void warn_of_mesh(Run& run, const Body& body) {
  for (const std::string& line : body.check.warnings)
    run.stations.warn(line.starts_with("the body measures") ? line + "; " + describe_scale_key(run.job) : line);
}

/// Rank 0 only: the mesh of the element's order, checked, and what stays of it on this rank.
mesh::TetMesh read_checked_mesh(Run& run, const Setting& setting, Body& body, Patience* patience) {
  const bool quadratic = setting.element == job::Element::T10;
  const job::JobSpec& job = run.job;
  mesh::TetMesh mesh =
      job.body ? make_body_mesh(*job.body, quadratic ? 2 : 1, {setting.nodes, setting.edge_m}, patience) : mesh::read_mesh(job.mesh);
  if (patience != nullptr && patience->estimate) return {};
  if (job.mesh_scale != 1.0) {
    for (std::vector<Vec3>* lengths : {&mesh.nodes, &mesh.doubt_m}) {
      for (Vec3& length : *lengths) {
        for (double& x : length) x *= job.mesh_scale;
      }
    }
  }
  body.check = mesh::check_mesh(mesh, body.source);
  body.region_names = mesh.region_names;
  warn_of_mesh(run, body);
  if (!mesh.doubt_m.empty())
    run.stations.warn(
        "some facets of the surface are so coarse that they may be planes of the body or samples of a smooth surface; the error bars "
        "contain both: a surface in finer facets settles it, or carillon-mesh --facets if the facets are the body");
  for (int i = 0; i < setting.refinements; ++i) mesh = refine_mesh(mesh);
  if (quadratic && mesh.order == 1) mesh = mesh::to_quadratic(mesh);
  if (!quadratic && mesh.order == 2) mesh = mesh::to_linear(mesh);
  mesh::Surface boundary = mesh::extract_boundary(mesh);
  body.surface.vertices_m.reserve(boundary.nodes.size());
  for (const std::int32_t node : boundary.nodes) body.surface.vertices_m.push_back(mesh.nodes[node]);
  body.surface.triangles = std::move(boundary.triangles);
  body.surface.row = std::move(boundary.nodes);  // nodes here; make_body() turns them into rows
  return mesh;
}

void say_size(const Run& run, std::int64_t nodes, std::int64_t tets, int components, std::int64_t held_nodes) {
  run.stations.say(fmt::format("{} nodes, {} tetrahedra, {} component{}, {} nodes held", nodes, tets, components,
                               components == 1 ? "" : "s", held_nodes));
}

/// CHOLMOD and MUMPS want the elimination order of the whole graph, which costs rank 0 time and memory; the factorisation of this project
/// orders by itself, and MUMPS does so with more fill where it has to stand in for it.
bool wants_elimination_order(const job::JobSpec& job) {
  return job.factorisation == job::Factorisation::mumps || job.factorisation == job::Factorisation::cholmod;
}

/// Every rank reads its part of the file.
Body read_in_parallel(Run& run, const Setting& setting) {
  Body body;
  body.source = run.job.mesh.string();
  run.stations.begin("read", body.source + ", by all ranks");
  slabs::Wish wish;
  wish.scale = run.job.mesh_scale;
  wish.order = setting.element == job::Element::T10 ? 2 : 1;
  for (const job::Fixed& fixed : run.job.fixed)
    wish.hold.push_back({fixed.node_set, fixed.box_m, (fixed.place.empty() ? run.job.file.string() : fixed.place) + ": key 'fixed'"});
  slabs::ParallelMesh mesh = slabs::read_parallel(run.comm, run.job.mesh, wish);
  body.pieces = std::move(mesh.pieces);
  body.check = std::move(mesh.check);
  body.held_nodes = mesh.held_nodes;
  body.surface = {std::move(mesh.boundary.vertices_m), std::move(mesh.boundary.triangles), std::move(mesh.boundary.row)};
  warn_of_mesh(run, body);
  say_size(run, body.pieces.nodes, body.pieces.tets, body.pieces.components, body.held_nodes);
  run.stations.say(fem::describe(body.pieces.report));
  run.stations.end();
  return body;
}

bool is_parallel_format(const Run& run) {
  int is_parallel = 0;
  petsc::run_agreed(run.comm, [&] { is_parallel = run.rank == 0 && !run.job.body && slabs::is_parallel_format(run.job.mesh) ? 1 : 0; });
  MPI_Bcast(&is_parallel, 1, MPI_INT, 0, run.comm);
  return is_parallel == 1;
}

Body make_pieces(Run& run, const Setting& setting, Patience* patience) {
  if (run.progress) run.progress->learn(find_extent(run, setting, {}));
  if (is_parallel_format(run)) return read_in_parallel(run, setting);
  Body body;
  body.source = run.job.body ? describe(*run.job.body, {setting.nodes, setting.edge_m}) : run.job.mesh.string();
  run.stations.begin("read", body.source);
  mesh::TetMesh mesh;
  std::vector<FixedNode> fixed;
  std::vector<std::int32_t> held;
  petsc::run_agreed(run.comm, [&] {
    if (run.rank != 0) return;
    mesh = read_checked_mesh(run, setting, body, patience);
    if (patience != nullptr && patience->estimate) return;
    fixed = find_fixed_nodes(mesh, run.job);
    for (const FixedNode& one : fixed) held.push_back(one.node);
    body.held_nodes = static_cast<std::int64_t>(held.size());
    say_size(run, static_cast<std::int64_t>(mesh.nodes.size()), mesh.tet_count(), body.check.components, body.held_nodes);
  });
  run.stations.end();
  if (patience != nullptr && patience->estimate) {
    body.estimate = patience->estimate;
    return body;
  }

  run.stations.begin("partition", "METIS k-way on the dual graph");
  body.pieces = name_errors(body.source, run,
                            [&] { return fem::distribute(run.comm, mesh, held, {.elimination_order = wants_elimination_order(run.job)}); });
  share_fixed_nodes(run.comm, std::move(fixed), body.pieces.local);
  mesh = {};
  for (std::int32_t& row : body.surface.row) row = body.pieces.row_of_node[row];
  body.pieces.row_of_node = {};
  run.stations.say(fem::describe(body.pieces.report));
  run.stations.end();
  return body;
}

}  // namespace

std::string describe_scale_key(const job::JobSpec& job) {
  if (!job.body)
    return job.mesh_scale == 1.0 ? "\"mesh_scale\": 0.001 in the job takes the mesh file's numbers for millimetres"
                                 : fmt::format("\"mesh_scale\" of the job, metres per unit of the mesh file, is {:g}: {:g} for that",
                                               job.mesh_scale, 0.001 * job.mesh_scale);
  if (!job.body->shape.empty()) return "the dimensions of a shape are metres";
  if (job.body->height_m) return fmt::format("\"height_m\" inside \"body\" is {:g}, in metres", *job.body->height_m);
  const double scale = job.body->scale.value_or(1.0);
  if (scale == 1.0) return "\"scale\": 0.001 inside \"body\" takes the surface's numbers for millimetres, and \"height_m\" gives it a size";
  return fmt::format("\"scale\" inside \"body\", metres per unit of the surface, is {:g}: {:g} for that", scale, 0.001 * scale);
}

Setting get_setting(const job::JobSpec& job) {
  Setting setting;
  setting.element = job.element;
  setting.tolerance = job.tolerance;
  if (job.body) {
    if (job.body->nodes) setting.nodes = *job.body->nodes;
    setting.edge_m = job.body->edge_m;
  }
  return setting;
}

Extent find_extent(const Run& run, const Setting& setting, const Body& body) {
  Extent extent;
  extent.is_quadratic = setting.element == job::Element::T10;
  extent.is_lumped = run.job.mass == job::Mass::lumped;
  extent.modes = run.job.max_modes.value_or(0);
  extent.nodes = body.pieces.nodes;
  extent.tets = body.pieces.tets;
  extent.unknowns = 3 * body.pieces.free_nodes;
  extent.surface_nodes = static_cast<std::int64_t>(body.surface.vertices_m.size());
  if (extent.tets > 0) {
    for (const Station& station : run.stations.get_all())
      if (station.name == "read") extent.read_seconds = station.seconds;
    return extent;
  }
  if (!run.job.body) {
    std::error_code error;
    const auto bytes = static_cast<std::int64_t>(std::filesystem::file_size(run.job.mesh, error));
    extent.tets = error ? 0 : (bytes / kFileBytesPerTet) << (3 * setting.refinements);
  } else {
    if (run.job.body->shape.empty()) extent.read_seconds = kMeshingSeconds;
    extent.nodes = setting.nodes.value_or(kUsualNodes);
    extent.tets = extent.is_quadratic ? extent.nodes * 2 / 3 : extent.nodes * 4;
  }
  return extent;
}

Body make_body(Run& run, const Setting& setting, Patience* patience) {
  Body body = make_pieces(run, setting, patience);
  if (run.progress) run.progress->learn(find_extent(run, setting, body));
  return body;
}

}  // namespace carillon::io
