#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "precompute/eigen/predict_cost.hpp"
#include "precompute/fem/error_bars/correct.hpp"
#include "precompute/mesh/distributed/distribute.hpp"
#include "precompute/mesh/parallel/read_parallel.hpp"
#include "precompute/mesh/read.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/run/cut_mesh.hpp"
#include "precompute/run/meshing.hpp"
#include "precompute/run/stages.hpp"
#include "runtime/bank/select.hpp"
#include "runtime/base/sort_order.hpp"

namespace carillon::run {
namespace {

constexpr const char* kByMetis = "elements are distributed by METIS, k-way on the dual graph";
constexpr const char* kByOrder = "elements are distributed by the separator tree of the nodes";

/// A fixed node and the first entry of the job's "fixed" that contains it.
struct FixedNode {
  std::int32_t node, entry;
};

/// Unique nodes of all fixed sets and boxes, ascending.
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

/// Sets local.fixed_by on every rank. `list` is read on rank 0. Collective.
void broadcast_fixed_nodes(const comm::Communicator& comm, std::vector<FixedNode> list, mesh::LocalMesh& local) {
  list = comm.broadcast(std::move(list));
  if (list.empty()) return;
  comm.agree([&] { local.fixed_by.assign(local.nodes_m.size(), -1); });
  for (std::size_t i = 0; i < local.node_in_mesh.size(); ++i) {
    const std::int32_t node = local.node_in_mesh[i];
    const auto at = std::lower_bound(list.begin(), list.end(), node, [](const FixedNode& a, std::int32_t b) { return a.node < b; });
    if (at != list.end() && at->node == node) local.fixed_by[i] = at->entry;
  }
}

/// Warnings of the mesh check; for an implausible size, with the job's key that corrects it. Rank 0.
void warn_of_mesh(Run& run, const Body& body) {
  const std::vector<std::string>& warnings = body.check.warnings;
  for (std::size_t i = 0; i < warnings.size(); ++i)
    run.log.warn(i == 0 && body.check.has_odd_size ? warnings[i] + "; " + describe_scale_key(run.job) : warnings[i]);
}

/// Once per run, even if the surface is meshed repeatedly.
void warn_of_facets(Run& run) {
  run.log.warn_once(fmt::format(
      "some facets of the surface are so coarse that they may be planes of the body or samples of a smooth surface; the difference is "
      "stated next to the error bars (facets in doubt); a finer surface resolves it, or {} if they are planes",
      run.job.body ? "\"facets\": true inside \"body\"" : "carillon-mesh --facets"));
}

/// Rank 0 only: the checked mesh of the element's order; sets the parts of `body` kept on rank 0.
mesh::TetMesh read_checked_mesh(Run& run, const Setting& setting, Body& body) {
  const bool quadratic = setting.element == job::Element::T10;
  const job::JobSpec& job = run.job;
  MesherWords words;
  mesh::TetMesh mesh =
      job.body ? make_body_mesh(*job.body, quadratic ? 2 : 1, {setting.nodes, setting.edge_m, setting.layers, setting.extrudes}, words)
               : mesh::read_mesh(job.mesh);
  body.mesher_warnings = std::move(words.warnings);
  for (const std::string& warning : body.mesher_warnings) run.log.warn_once(warning);
  for (const std::string& remark : words.remarks) run.log.print(remark);
  const std::string unit = std::move(mesh.unit);
  const double scale = mesh::scale_lengths(mesh, job.mesh_scale);
  if (!unit.empty() && scale != job.mesh_scale)
    run.log.print(fmt::format("the mesh file is read with {:g} m per unit, since {}; \"mesh_scale\" of the job changes it", scale, unit));
  for (const std::string& remark : mesh.remarks) run.log.warn_once(remark);
  body.check = mesh::check_mesh(mesh, body.source);
  body.region_names = mesh.region_names;
  body.is_extruded = job.body && job.body->shape.empty() && mesh.node_sets.contains("outer") && mesh.node_sets.contains("inner");
  body.file_materials = std::move(mesh.materials);
  warn_of_mesh(run, body);
  if (job.body && job.body->shape.empty() && body.check.components > 1)
    run.log.warn_once(fmt::format("the surface has {} disconnected parts, which vibrate independently", body.check.components));
  if (!mesh.doubt_m.empty()) warn_of_facets(run);
  for (int i = 0; i < setting.refinements; ++i) mesh = refine_mesh(mesh);
  if (quadratic && mesh.order == 1) mesh = mesh::to_quadratic(mesh);
  if (!quadratic && mesh.order == 2) mesh = mesh::to_linear(mesh);
  mesh::Surface boundary = mesh::extract_boundary(mesh);
  body.surface.vertices_m.reserve(boundary.nodes.size());
  for (const std::int32_t node : boundary.nodes) body.surface.vertices_m.push_back(mesh.nodes_m[node]);
  body.surface.triangles = std::move(boundary.triangles);
  body.surface.row = std::move(boundary.nodes);  // nodes; make_body() converts them to rows
  return mesh;
}

void log_size(const Run& run, std::int64_t nodes, std::int64_t tets, int components, std::int64_t fixed_nodes) {
  run.log.print(fmt::format("{} nodes, {} tetrahedra, {} component{}, {} fixed nodes", nodes, tets, components, components == 1 ? "" : "s",
                            fixed_nodes));
}

/// MUMPS needs the elimination order of the whole graph, which costs rank 0 time and memory; our factorisation orders by itself, and MUMPS
/// as its fallback does so with more fill.
bool wants_elimination_order(const job::JobSpec& job) { return job.factorisation == job::Factorisation::mumps; }

/// For our factorisation the mesh is best cut at its separators.
bool wants_cut_by_order(const job::JobSpec& job) { return !wants_elimination_order(job) && job.method != job::Method::dense; }

/// Each rank reads its part of the file.
Body read_in_parallel(Run& run, const Setting& setting) {
  Body body;
  body.source = run.job.mesh.string();
  run.log.begin("read", body.source + ", by all ranks");
  parallel_mesh::ReadOptions options;
  options.scale = run.job.mesh_scale;
  options.order = setting.element == job::Element::T10 ? 2 : 1;
  for (const job::Fixed& fixed : run.job.fixed)
    options.fixed.push_back({fixed.node_set, fixed.box_m, (fixed.place.empty() ? run.job.file.string() : fixed.place) + ": key 'fixed'"});
  RecutByOrder recut(run.comm);
  if (wants_cut_by_order(run.job)) options.recut = recut.make_recut();
  parallel_mesh::ParallelMesh mesh = parallel_mesh::read_parallel(run.comm, run.job.mesh, options);
  body.pieces = std::move(mesh.mesh);
  body.order = recut.get_order();
  body.check = std::move(mesh.check);
  body.fixed_nodes = mesh.fixed_nodes;
  body.surface = {std::move(mesh.boundary.vertices_m), std::move(mesh.boundary.triangles), std::move(mesh.boundary.row)};
  warn_of_mesh(run, body);
  if (recut.get_order() != nullptr) run.log.print(kByOrder);
  log_size(run, body.pieces.nodes, body.pieces.tets, body.pieces.components, body.fixed_nodes);
  run.log.print(mesh::describe(body.pieces.report));
  run.log.end();
  return body;
}

bool is_parallel_format(const Run& run) {
  return run.comm.broadcast([&] { return !run.job.body && parallel_mesh::is_parallel_format(run.job.mesh); });
}

}  // namespace

Body make_body(Run& run, const Setting& setting) {
  if (is_parallel_format(run)) return read_in_parallel(run, setting);
  Body body;
  body.source =
      run.job.body ? describe(*run.job.body, {setting.nodes, setting.edge_m, setting.layers, setting.extrudes}) : run.job.mesh.string();
  run.log.begin("read", body.source);
  mesh::TetMesh mesh;
  std::vector<FixedNode> fixed;
  std::vector<std::int32_t> fixed_nodes;
  comm::Communicator(run.comm).agree([&] {
    if (!run.comm.is_root()) return;
    mesh = read_checked_mesh(run, setting, body);
    fixed = find_fixed_nodes(mesh, run.job);
    for (const FixedNode& one : fixed) fixed_nodes.push_back(one.node);
    body.fixed_nodes = static_cast<std::int64_t>(fixed_nodes.size());
    log_size(run, static_cast<std::int64_t>(mesh.nodes_m.size()), mesh.tet_count(), body.check.components, body.fixed_nodes);
  });
  run.log.end();
  run.log.begin("partition", "the mesh over the ranks");
  name_errors(body.source, run, [&] {
    if (wants_cut_by_order(run.job)) {
      CutMesh cut = cut_by_order(run.comm, mesh, fixed_nodes);
      body.pieces = std::move(cut.pieces);
      body.order = std::move(cut.order);
    } else {
      body.pieces = mesh::distribute(run.comm, mesh, fixed_nodes, {.elimination_order = wants_elimination_order(run.job)});
    }
  });
  if (run.comm.size() > 1) run.log.print(body.order != nullptr ? kByOrder : kByMetis);
  broadcast_fixed_nodes(run.comm, std::move(fixed), body.pieces.local);
  body.pieces.local.is_surface_known = run.job.body.has_value();
  mesh = {};
  for (std::int32_t& row : body.surface.row) row = body.pieces.row_of_node[row];
  body.pieces.row_of_node = {};
  run.log.print(mesh::describe(body.pieces.report));
  run.log.end();
  return body;
}

std::string describe_scale_key(const job::JobSpec& job) {
  if (!job.body)
    return job.mesh_scale == 1.0
               ? "\"mesh_scale\": 0.001 in the job reads the mesh file in millimetres"
               : fmt::format("\"mesh_scale\" of the job, metres per unit of the mesh file, is {:g}: for millimetres give {:g}",
                             job.mesh_scale, 0.001 * job.mesh_scale);
  if (!job.body->shape.empty()) return "the dimensions of a shape are metres";
  if (job.body->height_m) return fmt::format("\"height_m\" inside \"body\" is {:g}, in metres", *job.body->height_m);
  const double scale = job.body->scale.value_or(1.0);
  if (scale == 1.0) return "\"scale\": 0.001 inside \"body\" reads the surface in millimetres, and \"height_m\" sets its size";
  return fmt::format("\"scale\" inside \"body\", metres per unit of the surface, is {:g}: for millimetres give {:g}", scale, 0.001 * scale);
}

std::optional<std::int64_t> find_computed_count(const job::JobSpec& job) {
  if (!job.max_modes) return std::nullopt;
  return static_cast<std::int64_t>(error_bars::find_computed_count(static_cast<std::size_t>(*job.max_modes)));
}

std::int64_t count_below_band(const job::JobSpec& job, const error_bars::Corrections& corrections) {
  return std::ranges::count_if(
      corrections.lambda, [&](double lambda) { return !bank::is_above_begin(std::sqrt(lambda) / (2 * std::numbers::pi), job.band_hz[0]); });
}

std::vector<std::size_t> find_bank_modes(const job::JobSpec& job, const error_bars::Corrections& corrections) {
  std::vector<std::size_t> modes = base::find_sort_order(corrections.lambda);
  std::erase_if(modes, [&](std::size_t m) {
    const double hz = std::sqrt(corrections.lambda[m]) / (2 * std::numbers::pi);
    return !bank::is_above_begin(hz, job.band_hz[0]) || !bank::is_below_end(hz, job.band_hz[1]);
  });
  if (job.max_modes) modes.resize(std::min(modes.size(), static_cast<std::size_t>(*job.max_modes)));
  std::ranges::sort(modes);
  return modes;
}

namespace {

/// Upper bound: "auto" may skip the air.
std::int64_t find_air_nodes(const job::JobSpec& job, std::int64_t surface_nodes) {
  if (job.air.method == job::AirMethod::none) return 0;
  const std::int64_t nodes = std::min<std::int64_t>(job.air.skin_nodes, surface_nodes > 0 ? surface_nodes : job.air.skin_nodes);
  return job.air.half_space ? 2 * nodes : nodes;
}

/// Sets what the job requests: modes, air, coupled modes.
void set_demand(const job::JobSpec& job, const Setting& setting, cost::ProblemSize& size) {
  size.modes = find_computed_count(job);
  size.counts_low_end = !eigen::can_assume_low_end(make_options(job, setting, find_range(job, setting)));
  size.air_nodes = find_air_nodes(job, size.surface_nodes);
  if (job.nonlinear) size.coupled_modes = job.nonlinear->modes;
}

}  // namespace

cost::ProblemSize find_problem_size(const Run& run, const Setting& setting, const Body& body) {
  cost::ProblemSize size;
  size.is_quadratic = setting.element == job::Element::T10;
  size.nodes = body.pieces.nodes;
  size.tets = body.pieces.tets;
  size.unknowns = 3 * body.pieces.free_nodes;
  size.surface_nodes = static_cast<std::int64_t>(body.surface.vertices_m.size());
  set_demand(run.job, setting, size);
  for (const RunPhase& phase : run.log.get_phases())
    if (phase.name == "read") size.read_seconds = phase.seconds;
  return size;
}

}  // namespace carillon::run
