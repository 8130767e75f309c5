#include "precompute/mesher/volume_mesh.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <new>
#include <vector>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/curve_sizes.hpp"
#include "precompute/mesher/tet_quality.hpp"
#include "precompute/mesher/triangle_surface.hpp"
#include "precompute/mesher/verify.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/failure.hpp"

namespace carillon::mesher {
namespace {

// Method: on a surface the boundary faces around a node form one fan. At a node with several fans, the best position of a second node is
//   searched over each fan, and one element per face fills the gap: the inverse of the edge collapse that would create the pinch.

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

/// Makes the boundary a surface around every node: where a dent of a thin wall touches one node of its other skin, elements around a new
/// node on its own skin fill the dent; if none of good shape fit, the node's elements are removed. `project` gives the nearest skin point,
/// `is_on_skin` its success: new nodes lie on the skin only. For linear meshes after make_manifold; `components` as there. Returns the
/// number of repaired nodes.
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

constexpr double kSearchAim = 0.08;             // count error that ends the search; halved for small, cheap meshes
constexpr double kSmallTarget = 5000;           // corner nodes
constexpr int kMaxFinishes = 4;                 // finished meshes: finishing changes the count
constexpr double kMaxImprovedDihedralDeg = 12;  // flatter elements are improved individually at the end
// A target below this part of the count required by the thickness is refused at once.
constexpr double kMinTargetRatio = 0.4;
constexpr double kMaxCurveDistanceRatio = 1e-3;  // over the edge: rounding of nodes on sharp curves
constexpr double kMaxLostByRounding = 0.04;      // relative volume loss by rounded sharp edges

/// Repairs a new mesh: pinched edges and nodes, fragments, flat elements.
void finish_mesh(mesh::TetMesh& mesh, const Body& body, SurfaceReport& report) {
  const auto project_here = [&](const Vec3& p) { return project(body, p); };
  peel_flat_elements(mesh);
  report.removed_tets = make_manifold(mesh, report.components);
  const double close = body.field ? 0.25 * body.field->voxel_m : 1e-6 * calc_box(body.repaired.surface.points).diagonal();
  const auto is_on_skin = [&](const Vec3& p) { return calc_off_skin(body, p) <= close; };
  report.parted_nodes = part_pinched_nodes(mesh, report.components, project_here, is_on_skin);
  const auto project_to_skin = [&](const Vec3& p) -> std::optional<Vec3> {
    const Vec3 there = project_here(p);
    return is_on_skin(there) ? std::optional(there) : std::nullopt;
  };
  const auto is_on_curve = [&](const Vec3& p) { return calc_distance(body.curves, p) < kMaxCurveDistanceRatio * report.mean_edge_m; };
  report.mean_edge_m = measure(mesh).mean_edge_m;
  better_flat_elements(mesh, kMaxImprovedDihedralDeg, project_to_skin, is_on_curve);
}

/// The finished mesh misrepresents the body (verify.hpp); what() completes a sentence.
struct WrongMesh : std::runtime_error {
  WrongMesh(const std::string& what, double edge) : std::runtime_error(what), edge_m(edge) {}
  double edge_m;
};

/// Refines until the count is met and finishes the mesh; repeats with a corrected target if finishing changes the count too much.
mesh::TetMesh meet_count(const Body& body, const SurfaceOptions& options, double& edge_m, SurfaceReport& report, Phases& phases,
                         const std::function<mesh::TetMesh(double)>& refine, const std::function<void(mesh::TetMesh&)>& finish) {
  const auto refuse_empty = [&](const mesh::TetMesh& mesh) {
    if (mesh.tets.empty())
      throw InputError(fmt::format("{}: edges of {:.3g} m are too long for the body; ask for shorter ones or more nodes",
                                   options.surface.string(), edge_m));
  };
  const double longest = calc_box(body.repaired.surface.points).diagonal();
  // Try slightly shorter edges if the finished mesh misrepresents the body: other elements then lie across its thin walls.
  constexpr double kEdgeReduction = 0.97;
  Comparison comparison;
  const auto is_the_body = [&](const mesh::TetMesh& mesh) {
    comparison = phases.run("comparing with the body", [&] {
      return compare(mesh, body, {.edge_m = edge_m, .volume_m3 = report.expected_volume_m3, .shells = count_shells(body, edge_m)});
    });
    report.shells = comparison.shells;
    report.farthest_outside_m = comparison.farthest_outside_m;
    return comparison.fault.empty();
  };
  if (!options.nodes) {
    for (int n = 0; n < kMaxFinishes; ++n, edge_m *= kEdgeReduction) {
      ++report.attempts;
      mesh::TetMesh mesh = phases.run("refining", [&] { return refine(edge_m); });
      refuse_empty(mesh);
      finish(mesh);
      refuse_empty(mesh);
      if (is_the_body(mesh)) return mesh;
      if (comparison.is_hopeless) break;
    }
    throw WrongMesh(comparison.fault, edge_m);
  }
  const auto asked = static_cast<double>(*options.nodes);
  double target = asked, nearest = 0;
  for (int n = 0; n < kMaxFinishes; ++n) {
    const double corners = options.order == 2 ? target / body.model.factor : target;
    mesh::TetMesh mesh = phases.run("refining", [&] {
      return search_edge({.target = target,
                          .order = options.order,
                          .longest_m = longest,
                          .tolerance = kCountTolerance,
                          .contented = corners < kSmallTarget ? kSearchAim / 2 : kSearchAim,
                          .is_uncertain = n == 0 && !calc_curve_sizes(body.curves, edge_m).empty()},
                         body.model, edge_m, report.attempts, refine);
    });
    finish(mesh);
    const double count = std::max(static_cast<double>(count_nodes(mesh, options.order)), 1.0);
    const bool met = std::abs(count / asked - 1) <= kCountTolerance;
    if (met && is_the_body(mesh)) return mesh;
    if (comparison.is_hopeless) break;
    if (met) {
      target = std::min(1.03 * target, asked * (1 + 0.7 * kCountTolerance));
      edge_m *= kEdgeReduction;
      continue;
    }
    nearest = count;
    target *= std::clamp(asked / count, 0.7, 1.5);
  }
  if (!comparison.fault.empty()) throw WrongMesh(comparison.fault, edge_m);
  throw CountError("the count cannot be met", nearest, nearest);
}

/// Proposes an edge length if a mesh with this one misrepresents the body.
[[noreturn]] void throw_wrong(const SurfaceOptions& options, const Body& body, const WrongMesh& failure) {
  const double shorter = failure.edge_m / 1.4;
  const double nodes = std::max(body.model.calc_nodes(shorter), 1.5 * static_cast<double>(options.nodes.value_or(0)));
  throw CountRefusal(fmt::format("{}: with edges of {:.3g} m the mesh {}; ask for about {:.2g} nodes, or for edges of {:.2g} m",
                                 options.surface.string(), failure.edge_m, failure.what(), nodes, shorter),
                     std::llround(nodes));
}

[[noreturn]] void throw_count(const SurfaceOptions& options, const CountError& failure) {
  const auto asked = static_cast<double>(options.nodes.value_or(0));
  if (failure.fewest > 0.9 * kMaxNodes)
    throw InputError(fmt::format("{}: the {} is so thin that about {:.2g} nodes are needed, more than {:.0g}; give a thicker {}",
                                 options.surface.string(), options.wall_m ? "wall" : "body", failure.fewest, kMaxNodes,
                                 options.wall_m ? "wall" : "body"));
  if (failure.fewest > asked)
    throw CountRefusal(
        fmt::format("{}: {} nodes cannot be met within 10 %: the thickness of the body{} needs at least about {:.0f}; ask for that many",
                    options.surface.string(), *options.nodes, options.wall_m ? "'s wall" : "", 1.05 * failure.fewest),
        std::llround(1.05 * failure.fewest));
  throw CountRefusal(fmt::format("{}: {} nodes cannot be met within 10 %: the nearest mesh has {:.0f}; ask for that many",
                                 options.surface.string(), *options.nodes, failure.nearest),
                     std::llround(failure.nearest));
}

/// Delaunay refinement fails on this surface; stuffing may work.
struct DelaunayError : InputError {
  using InputError::InputError;
};

/// Linear mesh by Delaunay refinement.
mesh::TetMesh make_delaunay_mesh(Body& body, const SurfaceOptions& options, double& edge_m, SurfaceReport& report, Phases& phases) {
  const double first_edge = edge_m;
  std::optional<CountError> with_sharp;
  const auto make = [&](bool keep_sharp) {
    edge_m = first_edge;
    auto delaunay = phases.run("finding sharp edges", [&] { return make_delaunay(body, options, edge_m, keep_sharp, report); });
    const auto refine = [&](double edge) { return delaunay->refine(calc_sizes(body, options, edge)); };
    const auto finish = [&](mesh::TetMesh& mesh) {
      mesh = phases.run("removing slivers", [&] { return delaunay->optimise(options.sliver_deg); });
      phases.run("repairing the mesh", [&] { finish_mesh(mesh, body, report); });
    };
    return meet_count(body, options, edge_m, report, phases, refine, finish);
  };
  const auto refuse = [&](const std::exception& failure) {
    if (with_sharp) throw_count(options, *with_sharp);
    throw DelaunayError(fmt::format("{}: the mesher failed: {}; part or join what touches, or try another edge length or node count",
                                    options.surface.string(), failure.what()));
  };
  try {
    return make(true);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const CountError& failure) {
    if (report.sharp_curves == 0) throw_count(options, failure);
    with_sharp = failure;
  } catch (const WrongMesh&) {
    throw;
  } catch (const std::exception& failure) {
    if (report.sharp_curves == 0) {
      if (dynamic_cast<const InputError*>(&failure)) throw;
      refuse(failure);
    }
  }
  // Sharp edges closer together than the element length defeat the mesher; with rounded edges the body can still be meshed.
  report.notes.push_back(
      "The sharp edges lie too close to each other for this element size and were rounded; ask for more nodes to keep them.");
  try {
    mesh::TetMesh mesh = make(false);
    if (with_sharp && std::abs(measure(mesh).volume_m3 / report.expected_volume_m3 - 1) > kMaxLostByRounding)
      throw_count(options, *with_sharp);
    return mesh;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const CountError& failure) {
    throw_count(options, with_sharp.value_or(failure));
  } catch (const InputError&) {
    throw;
  } catch (const WrongMesh&) {
    if (with_sharp) throw_count(options, *with_sharp);
    throw;
  } catch (const std::exception& failure) {
    refuse(failure);
  }
  return {};
}

/// Linear mesh by isosurface stuffing.
mesh::TetMesh make_stuffed_mesh(const Body& body, const SurfaceOptions& options, double& edge_m, SurfaceReport& report, Phases& phases) {
  const auto refine = [&](double e) { return stuff(*body.field, body.wall_m, e); };
  try {
    mesh::TetMesh mesh =
        meet_count(body, options, edge_m, report, phases, refine, [&](mesh::TetMesh& made) { finish_mesh(made, body, report); });
    if (const std::string cut = find_cut(mesh, body, edge_m); !cut.empty())
      report.notes.push_back(
          fmt::format("Stuffing needs three cells through the thinnest place, and the body's length within 0.2 %, but the mesh {}: thin "
                      "places may be cut short, and the error bars of the frequencies do not include this; use Delaunay refinement, or "
                      "more nodes.",
                      cut));
    return mesh;
  } catch (const CountError& failure) {
    throw_count(options, failure);
  }
}

void measure_mesh(const mesh::TetMesh& linear, const Body& body, SurfaceReport& report) {
  const TetMeasures measures = measure(linear);
  report.corner_nodes = static_cast<std::int64_t>(linear.nodes_m.size());
  report.tets = linear.tet_count();
  report.volume_m3 = measures.volume_m3;
  report.min_dihedral_deg = measures.min_dihedral_deg;
  report.max_dihedral_deg = measures.max_dihedral_deg;
  report.mean_edge_m = measures.mean_edge_m;
  report.layers_mean = measures.mean_edge_m > 0 ? body.thickness_m / measures.mean_edge_m : 0;
  if (body.wall_m <= 0) return;
  // Inner skin: boundary nodes deeper than half the wall.
  std::vector<std::int32_t> skin;
  for (const Triangle& t : find_boundary(linear)) skin.insert(skin.end(), t.begin(), t.end());
  std::sort(skin.begin(), skin.end());
  skin.erase(std::unique(skin.begin(), skin.end()), skin.end());
  double sum = 0, low = 1e300, high = 0;
  std::int64_t count = 0;
  for (const std::int32_t v : skin) {
    const Vec3& p = linear.nodes_m[v];
    if (body.field->calc_distance(p) > -0.5 * body.wall_m) continue;
    const double depth = norm(body.nearest->find(p) - p) - body.repaired.offset_m;
    sum += depth;
    low = std::min(low, depth);
    high = std::max(high, depth);
    ++count;
  }
  if (count == 0) return;
  report.wall_min_m = low;
  report.wall_max_m = high;
  report.wall_mean_m = sum / static_cast<double>(count);
}

}  // namespace

void check_count(const SurfaceOptions& options, double min_nodes) {
  const bool is_hopeless = options.nodes
                               ? options.method != Method::kStuffing && static_cast<double>(*options.nodes) < kMinTargetRatio * min_nodes
                               : min_nodes > 1.5 * kMaxNodes;
  if (is_hopeless) throw_count(options, CountError("", min_nodes, min_nodes));
}

mesh::TetMesh make_volume_mesh(Body& body, const SurfaceOptions& options, double edge_m, SurfaceReport& report, Phases& phases) {
  report.method = options.method == Method::kStuffing ? Method::kStuffing : Method::kDelaunay;
  if (report.reason.empty())
    report.reason = options.method != Method::kAutomatic ? "it was asked for" : "it keeps thin tips and sharp edges";
  body.nearest.emplace(body.repaired.surface);
  if (body.wall_m > 0 || !body.repaired.clean || report.method == Method::kStuffing)
    body.field = phases.run("computing distances", [&] { return make_field(body, options, edge_m); });
  // Refinement of parts thinner than the elements takes long and finally loses them. A count may need longer edges than these.
  constexpr double kLonger = 1.5;
  if (const std::string lost = find_lost(body, options.nodes ? kLonger * edge_m : edge_m); !lost.empty())
    throw_wrong(options, body, WrongMesh(lost, edge_m));
  report.expected_volume_m3 = body.field ? calc_volume(*body.field, body.wall_m) : report.input_volume_m3;
  if (body.wall_m > 0) {
    body.model.volume_m3 = report.expected_volume_m3;
    body.model.area_m2 = 2 * report.expected_volume_m3 / body.wall_m;
    if (options.nodes) edge_m = body.model.find_edge(static_cast<double>(*options.nodes));
  }

  mesh::TetMesh linear;
  try {
    linear = report.method == Method::kStuffing ? make_stuffed_mesh(body, options, edge_m, report, phases)
                                                : make_delaunay_mesh(body, options, edge_m, report, phases);
  } catch (const WrongMesh& failure) {
    throw_wrong(options, body, failure);
  } catch (const DelaunayError&) {
    if (options.method != Method::kAutomatic || !body.field) throw;
    report.notes.push_back(
        "Delaunay refinement did not end on this surface, parts of which touch; isosurface stuffing was used in its place.");
    report.method = Method::kStuffing;
    report.reason = "Delaunay refinement did not end";
    SurfaceOptions deep = options;
    deep.method = Method::kStuffing;
    body.field = phases.run("computing distances", [&] { return make_field(body, deep, edge_m); });
    report.sharp_curves = 0;
    report.sharp_edges_m = 0;
    body.curves.clear();
    edge_m = body.model.find_edge(options.nodes ? static_cast<double>(*options.nodes) : body.model.calc_nodes(edge_m));
    try {
      linear = make_stuffed_mesh(body, options, edge_m, report, phases);
    } catch (const WrongMesh& failure) {
      throw_wrong(options, body, failure);
    }
  }
  if (report.removed_tets > 0)
    report.notes.push_back(fmt::format("{} elements were removed where the body only touched itself or was cut off.", report.removed_tets));
  if (report.parted_nodes > 0)
    report.remarks.push_back(fmt::format("The mesh was repaired at {} nodes where both skins of a thin part met.", report.parted_nodes));
  measure_mesh(linear, body, report);
  report.edge_m = edge_m;
  return linear;
}

}  // namespace carillon::mesher
