// Method: indices, welding, orientation (sign of det(x1 - x0, x2 - x0, x3 - x0)), volume, duplicate elements, then faces: two elements on
//   opposite sides of a face traverse its corners in opposite senses; unmatched faces form the boundary, whose edges must pair up.
// Limitation: elements that interpenetrate without sharing a face are not detected (needs an intersection search).

#include "precompute/mesh/check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "precompute/mesh/check_parts.hpp"
#include "precompute/mesh/faces.hpp"
#include "precompute/mesh/parts.hpp"
#include "runtime/base/error.hpp"

namespace carillon::mesh {

namespace {

constexpr double kMinVolumeRatio = 1e-9;  // 6 V / (longest edge)^3; passes coordinates stored as 32-bit floats

[[noreturn]] void refuse(const std::string& name, const std::string& message) { throw InputError(name + ": " + message); }

void check_indices(const TetMesh& mesh, const std::string& name) {
  if (mesh.order != 1 && mesh.order != 2) refuse(name, fmt::format("elements of order {}; only 1 and 2 are known", mesh.order));
  if (mesh.tets.empty()) refuse(name, "the mesh has no tetrahedra; mesh the volume first");
  if (mesh.tets.size() % static_cast<std::size_t>(mesh.nodes_per_tet()) != 0)
    refuse(name, "the last element lacks nodes; write the mesh again");
  const auto count = static_cast<std::int64_t>(mesh.nodes_m.size());
  std::vector<std::int64_t> repeated;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
    const auto tet = mesh.tet(e);
    bool twice = false;
    for (std::size_t i = 0; i < tet.size(); ++i) {
      if (tet[i] < 0 || tet[i] >= count)
        refuse(name, fmt::format("element {} refers to node {}, but the nodes run from 1 to {}; write the mesh again", e + 1,
                                 std::int64_t{tet[i]} + 1, count));
      for (std::size_t j = 0; j < i; ++j) twice = twice || tet[i] == tet[j];
    }
    if (twice) repeated.push_back(e);
  }
  if (!repeated.empty())
    refuse(name, fmt::format("{} element{} with a repeated node: {}; mesh the body again", repeated.size(), repeated.size() == 1 ? "" : "s",
                             list_elements(repeated)));
  for (std::int64_t i = 0; i < count; ++i)
    for (const double x : mesh.nodes_m[i])
      if (!std::isfinite(x))
        refuse(name, fmt::format("node {} has a coordinate that is not finite; correct the mesh where it was made", i + 1));
  for (const auto& [set, nodes] : mesh.node_sets)
    for (const auto node : nodes)
      if (node < 0 || node >= count)
        refuse(name, fmt::format("the node set '{}' holds node {}, but the nodes run from 1 to {}", set, std::int64_t{node} + 1, count));
}

double calc_determinant(const TetMesh& mesh, std::int64_t e, double& longest_squared) {
  const auto tet = mesh.tet(e);
  const auto at = [&](int i) -> const Vec3& { return mesh.nodes_m[tet[i]]; };
  std::array<Vec3, 6> edge{};
  longest_squared = 0.0;
  for (std::size_t m = 0; m < 6; ++m) {
    for (std::size_t k = 0; k < 3; ++k) edge[m][k] = at(kEdges[m][1])[k] - at(kEdges[m][0])[k];
    longest_squared = std::max(longest_squared, edge[m][0] * edge[m][0] + edge[m][1] * edge[m][1] + edge[m][2] * edge[m][2]);
  }
  const Vec3 &a = edge[0], &b = edge[2], &c = edge[3];
  return calc_det(a, b, c);
}

/// `determinant` and squared longest edge as from calc_determinant.
bool is_flat(double determinant, double longest_squared) {
  return !(std::abs(determinant) > kMinVolumeRatio * longest_squared * std::sqrt(longest_squared));
}

void orient(TetMesh& mesh, const std::string& name, CheckReport& report) {
  std::vector<std::int64_t> flat;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
    double longest_squared = 0.0;
    const double determinant = calc_determinant(mesh, e, longest_squared);
    if (is_flat(determinant, longest_squared)) {
      flat.push_back(e);
    } else if (determinant < 0.0) {
      auto* tet = mesh.tets.data() + e * mesh.nodes_per_tet();
      std::swap(tet[1], tet[2]);
      if (mesh.order == 2) {  // swap edges 01 and 02, 13 and 23
        std::swap(tet[4], tet[6]);
        std::swap(tet[8], tet[9]);
      }
      ++report.reoriented;
    }
  }
  if (!flat.empty())
    refuse(name, fmt::format("{} element{} without volume: {}; remove {} or mesh the body again (in Gmsh: Mesh.Optimize)", flat.size(),
                             flat.size() == 1 ? "" : "s", list_elements(flat), flat.size() == 1 ? "it" : "them"));
}

/// Elements with equal corners share all faces, so comparing the face opposite the greatest corner finds them.
void refuse_duplicates(const TetMesh& mesh, const std::vector<Face>& faces, const std::string& name) {
  const auto apex = [&](const Face& face) { return mesh.tet(face.tet)[face.local]; };
  std::vector<std::int64_t> copies;
  std::int64_t first_original = -1;
  for (std::size_t i = 0; i < faces.size();) {
    std::size_t end = i + 1;
    while (end < faces.size() && same_corners(faces[i], faces[end])) ++end;
    for (std::size_t j = i + 1; j < end; ++j)
      for (std::size_t k = i; k < j && k < i + 8; ++k)
        if (apex(faces[j]) == apex(faces[k]) && apex(faces[j]) > faces[j].c) {
          if (copies.empty()) first_original = faces[k].tet;
          copies.push_back(faces[j].tet);
          break;
        }
    i = end;
  }
  if (copies.empty()) return;
  const auto first = copies.front();
  std::sort(copies.begin(), copies.end());
  refuse(name, fmt::format("{} element{} given twice: {} (element {} has the corners of {}); write each element once", copies.size(),
                           copies.size() == 1 ? " is" : "s are", list_elements(copies), first + 1, first_original + 1));
}

/// Checks every face; returns the unmatched ones.
std::vector<Face> check_faces(const TetMesh& mesh, const std::vector<Face>& faces, const std::string& name) {
  std::vector<Face> boundary;
  for (std::size_t i = 0; i < faces.size();) {
    std::size_t end = i + 1;
    while (end < faces.size() && same_corners(faces[i], faces[end])) ++end;
    if (end - i == 1) {
      boundary.push_back(faces[i]);
    } else if (end - i > 2) {
      std::vector<std::int64_t> elements;
      for (std::size_t j = i; j < end; ++j) elements.push_back(faces[j].tet);
      refuse(name, fmt::format("the face of nodes {}, {} and {} belongs to {} elements: {}; a face joins two at most: mesh the body again",
                               faces[i].a + 1, faces[i].b + 1, faces[i].c + 1, end - i, list_elements(elements)));
    } else if (faces[i].odd == faces[i + 1].odd) {
      const auto apex = [&](const Face& face) { return mesh.tet(face.tet)[face.local] + 1; };
      refuse(
          name,
          fmt::format(
              "elements {} and {} lie on the same side of their common face (nodes {}, {}, {}; apexes {} and {}): one of them is inverted "
              "(tetrahedra counted from 1 in the order of the file); mesh the body again",
              faces[i].tet + 1, faces[i + 1].tet + 1, faces[i].a + 1, faces[i].b + 1, faces[i].c + 1, apex(faces[i]), apex(faces[i + 1])));
    }
    i = end;
  }
  return boundary;
}

struct BoundaryEdge {
  std::int32_t low, high;
  std::int32_t face;                // index into the boundary
  std::array<std::int8_t, 2> slot;  // corner indices of low and high in the face
};

/// Checks that every boundary edge joins two boundary faces; counts nodes with more than one fan of faces.
void check_boundary(const std::vector<Face>& boundary, std::size_t node_count, const std::string& name, CheckReport& report) {
  std::vector<BoundaryEdge> edges;
  edges.reserve(3 * boundary.size());
  for (std::size_t f = 0; f < boundary.size(); ++f) {
    const Face& face = boundary[f];
    const auto index = static_cast<std::int32_t>(f);
    edges.push_back({face.a, face.b, index, {0, 1}});
    edges.push_back({face.b, face.c, index, {1, 2}});
    edges.push_back({face.a, face.c, index, {0, 2}});
  }
  std::sort(edges.begin(), edges.end(), [](const BoundaryEdge& x, const BoundaryEdge& y) {
    return x.low != y.low ? x.low < y.low : (x.high != y.high ? x.high < y.high : x.face < y.face);
  });
  Parts fans(3 * boundary.size());  // corner k of face f is 3 f + k
  std::vector<std::size_t> broken;
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t end = i + 1;
    while (end < edges.size() && edges[end].low == edges[i].low && edges[end].high == edges[i].high) ++end;
    if (end - i != 2) {
      broken.push_back(i);
    } else {
      for (std::size_t k = 0; k < 2; ++k) fans.join(3 * edges[i].face + edges[i].slot[k], 3 * edges[i + 1].face + edges[i + 1].slot[k]);
    }
    i = end;
  }
  if (!broken.empty()) {
    const BoundaryEdge& edge = edges[broken.front()];
    std::vector<std::int64_t> elements;
    for (std::size_t i = broken.front(); i < edges.size() && edges[i].low == edge.low && edges[i].high == edge.high; ++i)
      elements.push_back(boundary[edges[i].face].tet);
    refuse(
        name,
        fmt::format(
            "the boundary is not a closed surface: {} edge{}; the first, between nodes {} and {}, carries {} boundary faces instead of 2, "
            "of elements {}; thicken the body there or part it, and mesh it again",
            broken.size(), broken.size() == 1 ? " is at fault" : "s are at fault", edge.low + 1, edge.high + 1, elements.size(),
            list_elements(elements)));
  }
  std::vector<std::int32_t> fan_of(node_count, -1);
  std::vector<char> pinched(node_count, 0);
  for (std::size_t f = 0; f < boundary.size(); ++f) {
    const std::array<std::int32_t, 3> nodes{boundary[f].a, boundary[f].b, boundary[f].c};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t node = nodes[k];
      const auto fan = fans.find(static_cast<std::int32_t>(3 * f + k));
      if (fan_of[node] < 0) fan_of[node] = fan;
      if (fan_of[node] != fan) pinched[node] = 1;
    }
  }
  report.boundary_faces = static_cast<std::int64_t>(boundary.size());
  report.pinched_nodes = std::count(pinched.begin(), pinched.end(), 1);
}

/// Drops unreferenced (including welded) nodes; renumbers elements and sets.
void drop_unused(TetMesh& mesh, const std::vector<std::int32_t>& stand, CheckReport& report) {
  std::vector<std::int32_t> number(mesh.nodes_m.size(), -1);
  for (const auto node : mesh.tets) number[node] = 0;
  std::int32_t kept = 0;
  for (std::size_t i = 0; i < number.size(); ++i)
    if (number[i] == 0) {
      mesh.nodes_m[kept] = mesh.nodes_m[i];
      if (!mesh.doubt_m.empty()) mesh.doubt_m[kept] = mesh.doubt_m[i];
      number[i] = kept++;
    }
  report.unreferenced = static_cast<std::int64_t>(mesh.nodes_m.size()) - kept - report.welded;
  if (kept == std::ssize(mesh.nodes_m)) return;
  mesh.nodes_m.resize(kept);
  if (!mesh.doubt_m.empty()) mesh.doubt_m.resize(kept);
  for (auto& node : mesh.tets) node = number[node];
  for (auto& [name, set] : mesh.node_sets) {
    for (auto& node : set) node = number[stand[node]];
    std::sort(set.begin(), set.end());
    set.erase(std::unique(set.begin(), set.end()), set.end());
    if (!set.empty() && set.front() < 0) set.erase(set.begin());
  }
}

void find_components(const TetMesh& mesh, CheckReport& report) {
  Parts parts(mesh.nodes_m.size());
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (const auto node : mesh.tet(e)) parts.join(mesh.tet(e)[0], node);
  report.component_of_node.assign(mesh.nodes_m.size(), -1);
  for (std::size_t i = 0; i < mesh.nodes_m.size(); ++i) {
    auto& first = report.component_of_node[parts.find(static_cast<std::int32_t>(i))];
    if (first < 0) first = report.components++;
    report.component_of_node[i] = first;
  }
}

void collect_warnings(CheckReport& report) {
  warn_of_elements(report);
  const auto add = [&](const std::string& text) { report.warnings.push_back(text); };
  if (report.welded > 0) add(fmt::format("{} repeated nodes were joined with their twins, closing cracks in the mesh", report.welded));
  if (report.touching_nodes > 0)
    add(fmt::format("{} nodes coincide with another without a common face and were not merged: touching bodies are not connected",
                    report.touching_nodes));
  if (report.pinched_nodes > 0)
    add(fmt::format("{} nodes join two parts of the body at a point only: the motion there is not determined by elasticity",
                    report.pinched_nodes));
  if (report.straightened > 0)
    add(fmt::format("{} quadratic elements were folded over by their curved edges and made straight-sided", report.straightened));
}

}  // namespace

void warn_of_elements(CheckReport& report) {
  const auto add = [&](const std::string& text) { report.warnings.push_back(text); };
  const double diagonal =
      std::hypot(report.box_high[0] - report.box_low[0], report.box_high[1] - report.box_low[1], report.box_high[2] - report.box_low[2]);
  report.has_odd_size = diagonal > 50.0 || diagonal < 1e-3;
  if (diagonal > 50.0) add(fmt::format("the body measures {:.4g} m across: were millimetres given as metres?", diagonal));
  if (diagonal < 1e-3) add(fmt::format("the body measures only {:.3g} m across: coordinates are taken as metres", diagonal));
  if (report.slivers > 0)
    add(
        fmt::format("{} slivers (a dihedral angle under 5 or over 175 degrees; the worst {:.2g} and {:.6g}): frequencies near them are too "
                    "high, and the solver may lose digits",
                    report.slivers, report.min_dihedral_deg, report.max_dihedral_deg));
  if (report.unreferenced > 0)
    add(fmt::format("{} belong{} to no element and {} dropped",
                    report.unreferenced == 1 ? "1 node" : fmt::format("{} nodes", report.unreferenced), report.unreferenced == 1 ? "s" : "",
                    report.unreferenced == 1 ? "was" : "were"));
  if (report.reoriented > 0 && report.reoriented < report.tets)
    add(fmt::format("{} of {} elements were numbered inside out and have been turned: if others overlap them, mesh the body again",
                    report.reoriented, report.tets));
  double farthest = 0.0;
  for (std::size_t k = 0; k < 3; ++k) farthest = std::max({farthest, std::abs(report.box_low[k]), std::abs(report.box_high[k])});
  constexpr double kMaxRoundingRatio = 1e-6;  // relative to the shortest edge: effect of coordinate rounding on the stiffness
  const double rounding = farthest * std::numeric_limits<double>::epsilon();
  if (rounding > kMaxRoundingRatio * report.shortest_edge_m)
    add(fmt::format(
        "the body lies {:.3g} m from the origin, where coordinates are rounded to {:.1g} m, {:.1g} of the shortest edge: move it to "
        "the origin where it is made",
        farthest, rounding, rounding / report.shortest_edge_m));
}

std::string list_elements(const std::vector<std::int64_t>& elements) {
  constexpr std::size_t kShown = 10;
  std::string text;
  for (std::size_t i = 0; i < std::min(elements.size(), kShown); ++i) text += fmt::format("{}{}", i == 0 ? "" : ", ", elements[i] + 1);
  if (elements.size() > kShown) text += fmt::format(" and {} more", elements.size() - kShown);
  return text + " (tetrahedra counted from 1 in the order of the file)";
}

std::int64_t count_flat(const TetMesh& mesh) {
  std::int64_t count = 0;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
    double longest_squared = 0.0;
    const double determinant = calc_determinant(mesh, e, longest_squared);
    count += is_flat(determinant, longest_squared);
  }
  return count;
}

CheckReport check_mesh(TetMesh& mesh, const std::string& name) {
  CheckReport report;
  check_indices(mesh, name);
  mesh.regions.resize(mesh.tet_count(), 0);
  const auto stand = weld_cracks(mesh, name, report);
  orient(mesh, name, report);
  {
    const auto faces = sort_faces(mesh);
    refuse_duplicates(mesh, faces, name);
    check_boundary(check_faces(mesh, faces, name), mesh.nodes_m.size(), name, report);
  }
  drop_unused(mesh, stand, report);
  find_components(mesh, report);
  straighten_folded(mesh, report);
  calc_quality(mesh, report);
  report.nodes = static_cast<std::int64_t>(mesh.nodes_m.size());
  report.tets = mesh.tet_count();
  report.order = mesh.order;
  collect_warnings(report);
  return report;
}

std::string describe(const CheckReport& report) {
  std::string text = fmt::format("{} nodes, {} {} tetrahedra, {} part{}, {} boundary faces, {:.6g} m3\n", report.nodes, report.tets,
                                 report.order == 1 ? "linear" : "quadratic", report.components, report.components == 1 ? "" : "s",
                                 report.boundary_faces, report.volume_m3);
  text += fmt::format("box ({:.6g}, {:.6g}, {:.6g}) to ({:.6g}, {:.6g}, {:.6g}) m\n", report.box_low[0], report.box_low[1],
                      report.box_low[2], report.box_high[0], report.box_high[1], report.box_high[2]);
  text +=
      fmt::format("dihedral angles {:.2f} to {:.2f} degrees; mean ratio {:.3f} at worst, {:.3f} at 1 %, {:.3f} on average; {} slivers\n",
                  report.min_dihedral_deg, report.max_dihedral_deg, report.mean_ratio_min, report.mean_ratio_1_percent,
                  report.mean_ratio_mean, report.slivers);
  text += fmt::format("repaired: {} elements turned, {} unused nodes dropped, {} nodes welded, {} elements straightened", report.reoriented,
                      report.unreferenced, report.welded, report.straightened);
  if (report.order == 2) text += fmt::format("; {} curved elements", report.curved);
  return text + "\n";
}

}  // namespace carillon::mesh
