// Method: on a surface the boundary faces around a node form one fan. At a node with several fans, the best position of a second node is
//   searched over each fan, and one element per face fills the gap: the inverse of the edge collapse that would create the pinch.
#include "precompute/mesher/part_nodes.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "precompute/mesher/tet_quality.hpp"

namespace carillon::mesher {
namespace {

// Least dihedral angle of an added element; smoothing improves it further.
constexpr double kMinAddedDihedralDeg = 4;
constexpr int kMaxPasses = 8;

using Fan = std::vector<std::array<std::int32_t, 2>>;  // other two nodes of each face, counter-clockwise seen from outside

/// Fans of boundary faces around each node with more than one.
std::map<std::int32_t, std::vector<Fan>> find_pinched(const mesh::TetMesh& mesh) {
  std::vector<std::vector<std::array<std::int32_t, 2>>> around(mesh.nodes_m.size());
  for (const Triangle& t : find_boundary(mesh))
    for (int c = 0; c < 3; ++c) around[t[c]].push_back({t[(c + 1) % 3], t[(c + 2) % 3]});
  std::map<std::int32_t, std::vector<Fan>> pinched;
  for (std::size_t v = 0; v < around.size(); ++v) {
    auto left = around[v];
    std::vector<Fan> fans;
    while (!left.empty()) {
      // Each face is followed by the face that begins at its end.
      Fan fan{left.back()};
      left.pop_back();
      for (;;) {
        const auto next = std::find_if(left.begin(), left.end(), [&](const auto& face) { return face[0] == fan.back()[1]; });
        if (next == left.end()) break;
        fan.push_back(*next);
        left.erase(next);
      }
      fans.push_back(fan);
    }
    if (fans.size() > 1) pinched.emplace(static_cast<std::int32_t>(v), fans);
  }
  return pinched;
}

bool is_inside(const mesh::TetMesh& mesh, std::int32_t e, const Vec3& x) {
  const auto tet = mesh.tet(e);
  for (const auto& face : mesh::kFaces) {
    const Vec3 &a = mesh.nodes_m[tet[face[0]]], &b = mesh.nodes_m[tet[face[1]]], &c = mesh.nodes_m[tet[face[2]]];
    if (dot(cross(b - a, c - a), x - a) >= 0) return false;  // face normals point outward
  }
  return true;
}

struct Place {
  double flatness = -1;
  Vec3 at{};
};

/// Position over the fan with the best elements.
Place find_place(const mesh::TetMesh& mesh, std::int32_t v, const Fan& fan, const std::function<Vec3(const Vec3&)>& project,
                 const std::function<bool(const Vec3&)>& is_on_skin) {
  const Vec3 middle = mesh.nodes_m[v];
  Vec3 normal{}, centre{};
  double length = 0;
  for (const auto& [a, b] : fan) {
    normal = normal + cross(mesh.nodes_m[a] - middle, mesh.nodes_m[b] - middle);
    centre = centre + (1.0 / static_cast<double>(fan.size())) * mesh.nodes_m[a];
    length += norm(mesh.nodes_m[a] - middle) / static_cast<double>(fan.size());
  }
  std::vector<Vec3> places{centre};
  if (norm(normal) > 0)
    for (const double part : {1.0, 0.7, 0.5, 0.35, 0.25, 0.15, 0.08}) places.push_back(middle + (part * length / norm(normal)) * normal);
  Place best;
  for (const Vec3& place : places) {
    const Vec3 x = project(place);
    if (!is_on_skin(x)) continue;
    double worst = 180;
    for (const auto& [a, b] : fan) worst = std::min(worst, calc_flatness({middle, mesh.nodes_m[a], mesh.nodes_m[b], x}));
    if (worst > best.flatness) best = {worst, x};
  }
  return best;
}

}  // namespace

std::int64_t part_pinched_nodes(mesh::TetMesh& mesh, std::int64_t components, const std::function<Vec3(const Vec3&)>& project,
                                const std::function<bool(const Vec3&)>& is_on_skin) {
  std::int64_t repaired = 0;
  for (int pass = 0; pass < kMaxPasses; ++pass) {
    const auto pinched = find_pinched(mesh);
    if (pinched.empty()) break;
    std::vector<std::vector<std::int32_t>> around(mesh.nodes_m.size());
    for (std::int32_t e = 0; e < mesh.tet_count(); ++e)
      for (const std::int32_t v : mesh.tet(e)) around[v].push_back(e);
    std::vector<char> touched(mesh.nodes_m.size(), 0);
    std::vector<char> remove(mesh.tet_count(), 0);
    for (const auto& [v, fans] : pinched) {
      // Fans of neighbours change too: they wait for the next pass.
      bool wait = touched[v];
      for (const Fan& fan : fans)
        for (const auto& face : fan) wait = wait || touched[face[0]];
      if (wait) continue;
      ++repaired;
      Place best;
      const Fan* over = nullptr;
      for (const Fan& fan : fans) {
        const Place place = find_place(mesh, v, fan, project, is_on_skin);
        if (!(place.flatness > best.flatness)) continue;
        bool free = true;
        for (const auto& face : fan)
          for (const std::int32_t e : around[face[0]]) free = free && !is_inside(mesh, e, place.at);
        if (free) best = place, over = &fan;
      }
      touched[v] = 1;
      for (const Fan& fan : fans)
        for (const auto& face : fan) touched[face[0]] = 1;
      if (over == nullptr || best.flatness < kMinAddedDihedralDeg || pass + 2 >= kMaxPasses) {
        for (const std::int32_t e : around[v]) remove[e] = 1;
        continue;
      }
      const auto fresh = static_cast<std::int32_t>(mesh.nodes_m.size());
      mesh.nodes_m.push_back(best.at);
      for (const auto& [a, b] : *over) {
        mesh.tets.insert(mesh.tets.end(), {v, a, b, fresh});
        mesh.regions.push_back(0);
        remove.push_back(0);
      }
    }
    if (std::find(remove.begin(), remove.end(), 1) != remove.end()) drop_elements(mesh, remove);
    make_manifold(mesh, components);
  }
  return repaired;
}

}  // namespace carillon::mesher
