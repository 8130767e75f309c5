// Report of the mesher as text.
#include <fmt/core.h>

#include "precompute/mesher/surface.hpp"

namespace carillon::mesher {

std::string describe(const SurfaceReport& r) {
  std::string out =
      fmt::format("surface    {} triangles, {} points, {} component{}; {:.4g} x {:.4g} x {:.4g} m (scale {:.6g}), volume {:.6g} m3\n",
                  r.input_triangles, r.input_vertices, r.components, r.components == 1 ? "" : "s", r.extent_m[0], r.extent_m[1],
                  r.extent_m[2], r.scale, r.input_volume_m3);
  out += fmt::format("repaired   {} triangles dropped, {} turned, {} hole{} closed{}\n", r.removed_triangles, r.flipped_triangles,
                     r.holes_closed, r.holes_closed == 1 ? "" : "s", r.wrapped ? ", wrapped" : "");
  out += fmt::format("mesh       {} nodes ({} corners), {} tetrahedra, mean edge {:.4g} m, by {} in {} attempt{}\n", r.nodes,
                     r.corner_nodes, r.tets, r.mean_edge_m,
                     r.method == Method::kStuffing    ? "isosurface stuffing"
                     : r.method == Method::kExtrusion ? "extrusion of the skin"
                                                      : "Delaunay refinement",
                     r.attempts, r.attempts == 1 ? "" : "s");
  out += fmt::format("volume     {:.6g} m3, {:+.2f} % against the body\n", r.volume_m3, 100 * (r.volume_m3 / r.expected_volume_m3 - 1));
  out += fmt::format("angles     {:.1f} to {:.1f} degrees between faces\n", r.min_dihedral_deg, r.max_dihedral_deg);
  if (r.sharp_curves > 0) out += fmt::format("sharp      {} edges of {:.4g} m together kept\n", r.sharp_curves, r.sharp_edges_m);
  if (!r.reason.empty()) out += fmt::format("method     chosen because {}\n", r.reason);
  if (r.layers > 0)
    out += fmt::format("wall       {} layer{} of {:.4g} m (at the skin's points {:.4g} to {:.4g} m), edges {:.2f} times as long\n",
                       r.layers, r.layers == 1 ? "" : "s", r.wall_mean_m, r.wall_min_m, r.wall_max_m, r.edge_per_wall);
  else if (r.wall_mean_m > 0)
    out += fmt::format("wall       {:.4g} m (at the inner skin's nodes {:.4g} to {:.4g} m), about {:.1f} elements thick\n", r.wall_mean_m,
                       r.wall_min_m, r.wall_max_m, r.layers_mean);
  out += "seconds   ";
  for (const auto& [name, s] : r.seconds) out += fmt::format(" {} {:.2f};", name, s);
  out.back() = '\n';
  return out;
}

}  // namespace carillon::mesher
