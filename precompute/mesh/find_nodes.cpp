#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "precompute/mesh/check.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/error.hpp"

namespace carillon::mesh {

double calc_place_tolerance(const Vec3& low, const Vec3& high) {
  double largest = 0.0;
  for (std::size_t k = 0; k < 3; ++k) largest = std::max({largest, std::abs(low[k]), std::abs(high[k])});
  constexpr double kRoundings = 4 * std::numeric_limits<double>::epsilon();
  return std::max(1e-9 * calc_length(high - low), kRoundings * largest);
}

std::vector<std::int32_t> find_fixed_nodes(const TetMesh& mesh, const std::string& set) {
  const auto found = mesh.node_sets.find(set);
  if (found != mesh.node_sets.end()) {
    if (found->second.empty())
      throw InputError(fmt::format("the node set '{}' of the mesh has no node; save its elements with the mesh, or name another set", set));
    return found->second;
  }
  if (mesh.node_sets.empty())
    throw InputError(
        fmt::format("the mesh has no node set '{}': it has none at all; mesh it with named groups, or give a box instead", set));
  constexpr std::size_t kMaxListed = 20;
  std::vector<std::string> names;
  std::string list;
  for (const auto& [name, nodes] : mesh.node_sets) {
    names.push_back(name);
    if (names.size() <= kMaxListed) list += fmt::format("{}'{}'", list.empty() ? "" : ", ", name);
  }
  if (names.size() > kMaxListed) list += fmt::format(" and {} more", names.size() - kMaxListed);
  const std::string nearest = base::find_nearest(set, names);
  throw InputError(fmt::format("the mesh has no node set '{}'{}; it has {}", set,
                               nearest.empty() ? "" : fmt::format(" (did you mean '{}'?)", nearest), list));
}

std::vector<std::int32_t> find_fixed_nodes(const TetMesh& mesh, const Vec3& low, const Vec3& high) {
  for (std::size_t k = 0; k < 3; ++k)
    if (!(low[k] <= high[k]))
      throw InputError(fmt::format("the box runs from {} to {} along {}; give the smaller corner first", low[k], high[k], "xyz"[k]));
  Vec3 mesh_low = mesh.nodes_m.empty() ? Vec3{} : mesh.nodes_m.front();
  Vec3 mesh_high = mesh_low;
  for (const Vec3& x : mesh.nodes_m)
    for (std::size_t k = 0; k < 3; ++k) {
      mesh_low[k] = std::min(mesh_low[k], x[k]);
      mesh_high[k] = std::max(mesh_high[k], x[k]);
    }
  const double slack = calc_place_tolerance(mesh_low, mesh_high);
  std::vector<std::int32_t> inside;
  for (std::size_t i = 0; i < mesh.nodes_m.size(); ++i) {
    bool in = true;
    for (std::size_t k = 0; k < 3; ++k) in = in && mesh.nodes_m[i][k] >= low[k] - slack && mesh.nodes_m[i][k] <= high[k] + slack;
    if (in) inside.push_back(static_cast<std::int32_t>(i));
  }
  if (inside.empty())
    throw InputError(fmt::format("no node lies in the box ({}, {}, {}) to ({}, {}, {}) m; the mesh spans ({}, {}, {}) to ({}, {}, {}) m",
                                 low[0], low[1], low[2], high[0], high[1], high[2], mesh_low[0], mesh_low[1], mesh_low[2], mesh_high[0],
                                 mesh_high[1], mesh_high[2]));
  return inside;
}

}  // namespace carillon::mesh
