#include "precompute/simulation/coarsen.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <system_error>

#include "precompute/run/meshing.hpp"
#include "runtime/base/error.hpp"

namespace carillon::simulation {
namespace {

constexpr double kNodesPerSecond = 20000.0;  // meshing, partition and some hundred steps
constexpr double kBytesPerNode = 100.0;      // of mesh files, lower bound
constexpr long long kCoarseNodes = 1000;     // trial mesh that relates edge length to nodes
constexpr double kSurfaceShare = 5.0;        // meshing time of a surface over that of a shape

/// Requested nodes; 0: the mesher's default.
double estimate_nodes(const job::Body& body, int order) {
  if (body.nodes) return static_cast<double>(*body.nodes);
  if (!body.edge_m || body.shape.empty()) return 0.0;
  run::MesherWords unused;
  const mesh::TetMesh coarse = run::make_body_mesh(body, order, {.nodes = kCoarseNodes, .edge_m = {}}, unused);
  const std::size_t width = coarse.nodes_per_tet();
  double edges_m = 0.0;
  for (std::size_t t = 0; t < static_cast<std::size_t>(coarse.tet_count()); ++t)
    edges_m += norm(coarse.nodes_m[coarse.tets[width * t + 1]] - coarse.nodes_m[coarse.tets[width * t]]);
  edges_m /= static_cast<double>(coarse.tet_count());
  return static_cast<double>(coarse.nodes_m.size()) * std::pow(edges_m / *body.edge_m, 3);
}

}  // namespace

double coarsen(job::SimulationSpec& spec, double seconds) {
  const double most = std::max(static_cast<double>(kCoarseNodes), kNodesPerSecond * seconds / static_cast<double>(spec.bodies.size()));
  double finer = 1.0;
  for (job::SimulatedBody& body : spec.bodies) {
    if (!body.mesh.empty()) {
      std::error_code error;  // reported by the reader of the mesh
      const auto bytes = std::filesystem::file_size(body.mesh, error);
      if (!error && static_cast<double>(bytes) / kBytesPerNode > most)
        throw InputError(
            fmt::format("{}: the mesh {} has {:.0f} MB, and is not read in {:g} s; {} or more reads it", body.place, body.mesh.string(),
                        static_cast<double>(bytes) / 1e6, seconds,
                        fmt::format("--patience {:.0f}", 10 * std::ceil(static_cast<double>(bytes) / kBytesPerNode *
                                                                        static_cast<double>(spec.bodies.size()) / kNodesPerSecond / 10))));
    }
    if (!body.body) continue;
    const double own = body.body->shape.empty() ? std::max(static_cast<double>(kCoarseNodes), most / kSurfaceShare) : most;
    const double nodes = estimate_nodes(*body.body, body.element == job::Element::T10 ? 2 : 1);
    if (nodes <= own) continue;
    finer = std::max(finer, nodes / own);
    body.body->nodes = static_cast<long long>(own);
    body.body->edge_m.reset();
  }
  return finer;
}

}  // namespace carillon::simulation
