// One path from a surface file to tetrahedra, whose every step decides what the next one gets; longer than most files.
// It reads, scales, repairs, then makes meshes until the node count is met, and finishes the last one; the steps themselves live in the
// other files of this folder.
#include "precompute/mesher/surface.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <new>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/curved.hpp"
#include "precompute/mesher/body.hpp"
#include "precompute/mesher/curve_mesh.hpp"
#include "precompute/mesher/curve_sizes.hpp"
#include "precompute/mesher/extrude.hpp"
#include "precompute/mesher/guard.hpp"
#include "precompute/mesher/part_nodes.hpp"
#include "precompute/mesher/place_nodes.hpp"
#include "precompute/mesher/quiet.hpp"
#include "precompute/mesher/repair.hpp"
#include "precompute/mesher/round_surface.hpp"
#include "precompute/mesher/seams.hpp"
#include "precompute/mesher/smooth.hpp"
#include "precompute/mesher/stuffing.hpp"
#include "precompute/mesher/tet_quality.hpp"
#include "precompute/mesher/thin_wall.hpp"
#include "precompute/mesher/triangle_surface.hpp"
#include "precompute/mesher/two_sides.hpp"
#include "precompute/mesher/verify.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/json.hpp"

namespace carillon::mesher {
namespace {

constexpr double kCountTolerance = 0.10;             // promised
constexpr double kCountAim = 0.08;                   // where the search is content; half of it for small meshes, which cost nothing
constexpr double kSmallTarget = 5000;                // corner nodes
constexpr int kMaxFinishes = 4;                      // meshes that are finished, as what that changes in the count is learned
constexpr double kSmallest = 1e-10, kLargest = 1e9;  // bodies, in metres
constexpr double kFlatDeg = 12;                      // elements flatter than this are improved one by one at the end
constexpr double kVisible = 0.02;                    // of a linear element's edge: bulges below this are lost in its own chords
// Of the body's diagonal and of its mean thickness: facets that bulge less are as good as round.
constexpr double kRoundness = 1e-4, kThinRoundness = 2e-4;
constexpr std::size_t kMaxRounded = 100'000;  // triangles
// A target under this part of the count that the body's thickness needs is refused at once.
constexpr double kHopeless = 0.4;
// Processor seconds after which the program gives up (guard_program), of the repair and of what follows. The hollow bunny of 37,000 nodes
// takes 7 s and is given 670 s.
constexpr double kMinCpuOfRepair = 10, kMinCpu = 12, kCpuPerTriangle = 2e-3, kCpuPerNode = 5e-3;
constexpr double kOnCurve = 1e-3;            // of an edge: nodes of sharp curves lie on them but for rounding
constexpr double kSmoothedPerEdge = 0.1;     // boundary faces lie that far off the surface as it is
constexpr double kMaxLostByRounding = 0.04;  // of the volume, should sharp edges have to be rounded to meet a count

/// Shows the user a phase and keeps its time.
class Phases {
 public:
  Phases(SurfaceReport& report, const Progress& progress, std::string file)
      : report_(report), progress_(progress), file_(std::move(file)) {}
  template <class Work>
  auto run(const std::string& name, Work&& work) {
    set_guarded_step(file_, name);
    if (progress_) progress_(name);
    const Clock clock{report_, name};
    return work();
  }
  /// A message that is not a phase.
  void show(const std::string& text) {
    if (progress_) progress_(text);
  }

 private:
  struct Clock {
    SurfaceReport& report;
    std::string name;
    std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
    ~Clock() {
      const double s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      const auto found = std::find_if(report.seconds.begin(), report.seconds.end(), [&](const auto& entry) { return entry.first == name; });
      if (found == report.seconds.end())
        report.seconds.emplace_back(name, s);
      else
        found->second += s;
    }
  };
  SurfaceReport& report_;
  const Progress& progress_;
  std::string file_;
};

void check_options(const SurfaceOptions& o) {
  const auto positive = [&](const std::optional<double>& value, const char* name) {
    if (value && !(*value > 0 && std::isfinite(*value)))
      throw InputError(fmt::format("{} is {}; it must be a positive number of metres", name, *value));
  };
  positive(o.wall_m, "wall");
  positive(o.height_m, "height");
  positive(o.edge_m, "edge");
  if (o.scale && !(*o.scale > 0 && std::isfinite(*o.scale)))
    throw InputError(fmt::format("scale is {}; it must be a positive number", *o.scale));
  if (o.close_holes && !(*o.close_holes >= 0 && *o.close_holes <= 1))
    throw InputError(fmt::format("close_holes is {}; it must be a part of the body's diagonal, from 0 to 1", *o.close_holes));
  if (o.height_m && o.scale) throw InputError("height and scale exclude each other; give one of them");
  if (o.edge_m && o.nodes) throw InputError("edge and nodes exclude each other; give one of them");
  if (o.order < 0 || o.order > 2) throw InputError(fmt::format("order is {}; it must be 1 or 2, or 0 for the method's own", o.order));
  if (o.nodes && !(*o.nodes >= (o.order <= 1 ? 8 : 27) && static_cast<double>(*o.nodes) <= kMaxNodes))
    throw InputError(fmt::format("nodes is {}; it must be from {} to {:.0f}", *o.nodes, o.order <= 1 ? 8 : 27, kMaxNodes));
  if (!(o.sharp_angle_deg > 0 && o.sharp_angle_deg <= 180))
    throw InputError(fmt::format("the sharp angle is {} degrees; it must be in (0, 180]", o.sharp_angle_deg));
  if (!(o.sliver_deg >= 0 && o.sliver_deg <= 30))
    throw InputError(fmt::format("the angle of slivers is {} degrees; it must be in [0, 30]", o.sliver_deg));
}

/// Scales the surface to metres. A sheet may be flat, but not across the axis of its height.
void scale_surface(TriangleSurface& surface, const SurfaceOptions& options, SurfaceReport& report, bool is_sheet) {
  const Box box = calc_used_box(surface);
  const Vec3 extent = box.extent();
  const int up = static_cast<int>(options.up);
  for (int c = 0; c < 3; ++c)
    if (!(extent[c] > 1e-9 * box.diagonal()) && !(is_sheet && (c != up || !options.height_m)))
      throw InputError(fmt::format(
          "{}: the surface is flat: its extent along {} is {}; a closed surface that encloses a volume is needed, or --wall for the "
          "thickness of a sheet (of a job's body: \"wall_m\")",
          options.surface.string(), "xyz"[c], extent[c]));
  double farthest = 0;
  for (int c = 0; c < 3; ++c) farthest = std::max({farthest, std::abs(box.low[c]), std::abs(box.high[c])});
  if (std::max({extent[0], extent[1], extent[2]}) < 1e-10 * farthest)
    throw InputError(
        fmt::format("{}: the surface lies {:.3g} of its own lengths from the origin, so that its coordinates have lost their digits; "
                    "move it to the origin and export it again",
                    options.surface.string(), farthest / std::max({extent[0], extent[1], extent[2]})));
  report.scale = options.height_m ? *options.height_m / extent[up] : options.scale.value_or(1);
  const double size = report.scale * std::max({extent[0], extent[1], extent[2]});
  if (!(size >= kSmallest && size <= kLargest))
    throw InputError(fmt::format("{}: the body would be {:.3g} m long; it must be from {:.0e} to {:.0e} m; give its height or a scale",
                                 options.surface.string(), size, kSmallest, kLargest));
  for (Vec3& p : surface.points) p = report.scale * p;
  report.extent_m = report.scale * extent;
  const double largest = std::max({report.extent_m[0], report.extent_m[1], report.extent_m[2]});
  if (largest > 20 || largest < 1e-3)
    report.remarks.push_back(fmt::format(
        "The body is {:.3g} m long. If the file is not in metres, give its height or a scale (0.001 for millimetres).", largest));
}

/// What was done to the surface as it was read.
void note_input(SurfaceReport& report) {
  if (report.seam_edges > 0)
    report.notes.push_back(fmt::format(
        "The seams of its faces were closed: {} borders, whose sides lay up to {:.2g} m apart, were joined (as are all within "
        "{:.2g} m, {:g} of the body's diagonal).",
        report.seam_edges, report.seam_m, kSeam * norm(Vec3{report.extent_m[0], report.extent_m[1], report.extent_m[2]}), kSeam));
  if (report.unused_points > 0)
    report.notes.push_back(fmt::format("{} point{} of the file belong{} to no triangle and {} dropped.", report.unused_points,
                                       report.unused_points == 1 ? "" : "s", report.unused_points == 1 ? "s" : "",
                                       report.unused_points == 1 ? "was" : "were"));
}

/// Scales the surface once more where joining, wrapping or rounding has changed its extent, so that the body itself has the height asked
/// for. Returns the factor.
double fit_height(RepairedSurface& repaired, const SurfaceOptions& options, SurfaceReport& report) {
  Vec3 extent = calc_used_box(repaired.surface).extent();
  for (double& e : extent) e -= 2 * repaired.offset_m;
  double factor = 1;
  if (options.height_m) {
    factor = *options.height_m / extent[static_cast<int>(options.up)];
    // The offset of a wrap and what rounding adds are small; anything else would be no longer the same body.
    if (!(factor > 0.5 && factor < 2)) factor = 1;
    for (Vec3& p : repaired.surface.points) p = factor * p;
    repaired.offset_m *= factor;
    report.scale *= factor;
  }
  report.extent_m = factor * extent;
  return factor;
}

/// Makes the body of a fresh mesh sound: no pinched edges or nodes, no crumbs, no element flatter than need be.
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
  const auto is_on_curve = [&](const Vec3& p) { return calc_distance(body.curves, p) < kOnCurve * report.mean_edge_m; };
  report.mean_edge_m = measure(mesh).mean_edge_m;
  better_flat_elements(mesh, kFlatDeg, project_to_skin, is_on_curve);
}

/// The finished mesh is not the body (verify.hpp); what() is the end of a sentence.
struct WrongMesh : std::runtime_error {
  WrongMesh(const std::string& what, double edge) : std::runtime_error(what), edge_m(edge) {}
  double edge_m;
};

/// Refines until the count is met, and finishes the mesh; again with a corrected target should finishing have changed the count too much.
mesh::TetMesh meet_count(const Body& body, const SurfaceOptions& options, double& edge_m, SurfaceReport& report, Phases& phases,
                         const std::function<mesh::TetMesh(double)>& refine, const std::function<void(mesh::TetMesh&)>& finish) {
  const auto refuse_empty = [&](const mesh::TetMesh& mesh) {
    if (mesh.tets.empty())
      throw InputError(fmt::format("{}: edges of {:.3g} m are too long for the body; ask for shorter ones or more nodes",
                                   options.surface.string(), edge_m));
  };
  const double longest = calc_box(body.repaired.surface.points).diagonal();
  // A finished mesh that is not the body is made again with slightly shorter edges: which elements lie across a thin wall changes then.
  constexpr double kShorter = 0.97;
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
    for (int n = 0; n < kMaxFinishes; ++n, edge_m *= kShorter) {
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
                          .contented = corners < kSmallTarget ? kCountAim / 2 : kCountAim,
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
      edge_m *= kShorter;
      continue;
    }
    nearest = count;
    target *= std::clamp(asked / count, 0.7, 1.5);
  }
  if (!comparison.fault.empty()) throw WrongMesh(comparison.fault, edge_m);
  throw CountError("the count cannot be met", nearest, nearest);
}

/// Proposes a size where a mesh with edges of that length does not represent the body.
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

/// The surface defeats Delaunay refinement, but perhaps not stuffing.
struct DelaunayError : InputError {
  using InputError::InputError;
};

/// The linear mesh by Delaunay refinement.
mesh::TetMesh make_delaunay_mesh(Body& body, const SurfaceOptions& options, double& edge_m, SurfaceReport& report, Phases& phases) {
  const double first_edge = edge_m;
  std::optional<CountError> with_sharp;
  const auto make = [&](bool keep_sharp) {
    edge_m = first_edge;
    auto delaunay = phases.run("finding sharp edges", [&] { return make_delaunay(body, options, edge_m, keep_sharp, report); });
    const auto refine = [&](double edge) { return delaunay->refine(calc_sizes(body, options, edge)); };
    const auto finish = [&](mesh::TetMesh& mesh) {
      mesh = phases.run("removing slivers", [&] { return delaunay->optimise(options.sliver_deg); });
      phases.run("repairing the mesh", [&] { return finish_mesh(mesh, body, report), 0; });
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
  // Sharp edges that lie closer together than the elements are long defeat the mesher; rounded, the body can still be meshed.
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
  // The inner skin: boundary nodes deeper than half the wall.
  std::vector<std::int32_t> skin;
  for (const Triangle& t : find_boundary(linear)) skin.insert(skin.end(), t.begin(), t.end());
  std::sort(skin.begin(), skin.end());
  skin.erase(std::unique(skin.begin(), skin.end()), skin.end());
  double sum = 0, low = 1e300, high = 0;
  std::int64_t count = 0;
  for (const std::int32_t v : skin) {
    const Vec3& p = linear.nodes_m[static_cast<std::size_t>(v)];
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

/// Puts the mid nodes of the boundary on the skins.
void curve(mesh::TetMesh& mesh, const Body& body, SurfaceReport& report) {
  const CurvedEdges edges = curve_mesh(
      mesh, body.curves, [&](const Vec3& middle, const Vec3& normal, double reach_m) { return find_skin(body, middle, normal, reach_m); });
  report.curved_edges = edges.curved;
  report.straight_edges = edges.left;
  report.straightened_tets = edges.straightened;
}

/// Puts the nodes of the skins on the smooth surface and sums the volume again.
void place_nodes(mesh::TetMesh& mesh, const Body& body, const SurfaceOptions& options, SurfaceReport& report) {
  report.straightened_tets += place_on_smooth_surface(mesh, body, options.straight);
  remark_doubt(mesh, report);
  report.volume_m3 = calc_mesh_volume(mesh);
}

void add_notes(const SurfaceOptions& options, const Body& body, SurfaceReport& report) {
  const double error = report.volume_m3 / report.expected_volume_m3 - 1;
  if (std::abs(error) > 0.03)
    report.notes.push_back(
        fmt::format("The mesh has {:+.1f} % of volume against the body: its elements are coarse for its shape; more nodes bring it closer.",
                    100 * error));
  if (report.min_dihedral_deg < 8)
    report.remarks.push_back(fmt::format("The flattest element has a dihedral angle of {:.1f} degrees.", report.min_dihedral_deg));
  if (options.height_m) {
    const int up = static_cast<int>(options.up);
    if (std::abs(report.mesh_extent_m[up] / *options.height_m - 1) > 0.02)
      report.notes.push_back(fmt::format("The mesh is {:.4g} m high where {:.4g} m were asked for: its elements are coarse for its shape.",
                                         report.mesh_extent_m[up], *options.height_m));
  }
  if (body.wall_m > 0 && options.order == 1 && report.layers_mean < 1.5)
    report.notes.push_back(
        fmt::format("The wall is about {:.1f} linear elements thick and will be too stiff in bending; take more nodes or order 2.",
                    report.layers_mean));
}

/// Takes the smooth surface through the corners in place of the facets, unless it runs through itself where they do not.
void round(Body& body, const SurfaceOptions& options, SurfaceReport& report) {
  RepairedSurface& repaired = body.repaired;
  if (4 * repaired.surface.triangles.size() > kMaxRounded) return;
  RoundSurface round(repaired.surface, options.sharp_angle_deg);
  const double diagonal = calc_box(repaired.surface.points).diagonal();
  const double thickness = 2 * std::abs(calc_volume(repaired.surface)) / calc_area(repaired.surface);
  if (!round.is_doubtful() && round.get_largest_bulge() < std::min(kRoundness * diagonal, kThinRoundness * thickness)) return;
  // So fine that the nodes hardly have to move from the cut to the smooth surface; for linear elements, which show no difference, coarser.
  const double nodes = static_cast<double>(options.nodes.value_or(10000));
  const double shortest = options.edge_m.value_or(std::sqrt(calc_area(repaired.surface) / nodes));
  const double tolerance = options.order == 1 ? std::max(kRoundness * diagonal, kVisible * shortest) : kRoundness * diagonal;
  int pieces = std::max(1, static_cast<int>(std::ceil(std::sqrt(round.get_usual_bulge() / tolerance))));
  while (pieces > 1 && repaired.surface.triangles.size() * pieces * pieces > kMaxRounded) --pieces;
  TriangleSurface rounded = round.cut(pieces);
  report.facet_pieces = pieces;
  if (repaired.clean && pieces > 1 && !is_clean(rounded)) {
    report.facet_pieces = 1;
    report.remarks.push_back("The smooth surface through the facets' corners would run through itself; the facets were taken as they are.");
    round.keep_facets();
    body.round = std::move(round);
    return;
  }
  repaired.surface = std::move(rounded);
  body.round = std::move(round);
}

/// What counts the nodes of a body whose surface has this volume and area.
void set_model(Body& body, const SurfaceOptions& options, double volume_m3, double area_m2) {
  body.wall_m = options.wall_m.value_or(0);
  // The wall takes at most the whole volume; its two skins are about its volume over its thickness each.
  const double wall_volume = std::min(body.wall_m * area_m2, volume_m3);
  body.model = body.wall_m > 0 ? CountModel{.volume_m3 = wall_volume, .area_m2 = 2 * wall_volume / body.wall_m, .is_wall = true}
                               : CountModel{.volume_m3 = volume_m3, .area_m2 = area_m2};
  body.thickness_m = body.wall_m > 0 ? body.wall_m : 2 * volume_m3 / area_m2;
  // A second-order mesh of a solid has about seven and a half times as many nodes as corners, of a thin wall fewer.
  if (options.order == 2) body.model.factor = body.wall_m > 0 ? 6.4 : 7.5;
}

/// The edges to begin with.
double find_first_edge(const Body& body, const SurfaceOptions& options) {
  if (options.edge_m) return *options.edge_m;
  return body.model.find_edge(options.nodes ? static_cast<double>(*options.nodes) : (options.order == 2 ? 30000 : 10000));
}

/// Smooths the noise of a scan, by less than the elements resolve.
void smooth(Body& body, const SurfaceOptions& options, SurfaceReport& report) {
  body.is_scan = !report.wrapped && is_scan(body.repaired.surface, options.sharp_angle_deg);
  if (!body.is_scan) return;
  if (options.facets) {
    report.notes.push_back("The surface is as rough as a scan: none of its edges was kept sharp.");
    return;
  }
  set_model(body, options, std::abs(calc_volume(body.repaired.surface)), calc_area(body.repaired.surface));
  report.smoothed_m = smooth_scan(body.repaired.surface, kSmoothedPerEdge * find_first_edge(body, options));
  body.repaired.clean = body.repaired.clean && is_clean(body.repaired.surface);
  report.notes.push_back(
      fmt::format("The surface is as rough as a scan: its noise was smoothed, by up to {:.3g} m, and none of its edges was kept sharp; "
                  "--facets takes it as it is.",
                  report.smoothed_m));
}

/// The smooth surface of the height asked for. The patches keep the facets that they were made of, so those are scaled, and rounded again.
void round_to_height(Body& body, const SurfaceOptions& options, SurfaceReport& report) {
  const bool is_rounded = !options.facets && !report.wrapped && !body.is_scan;
  RepairedSurface facets;
  if (is_rounded && options.height_m) facets = body.repaired;
  if (is_rounded) round(body, options, report);
  const double factor = fit_height(body.repaired, options, report);
  if (!body.round || factor == 1) return;
  for (Vec3& p : facets.surface.points) p = factor * p;
  facets.offset_m *= factor;
  body.repaired = std::move(facets);
  body.round.reset();
  round(body, options, report);
}

/// The fewest nodes that the thickness allows.
double calc_min_nodes(const Body& body) { return body.model.calc_nodes(kEdgePerThickness * body.thickness_m); }

std::string format_estimate(const char* word, const Body& body, double edge_m) {
  const double nodes = std::min(std::max(body.model.calc_nodes(edge_m), calc_min_nodes(body)), 1e15);
  base::Json estimate = base::Json::object();
  estimate.set("volume_m3", base::significant(body.model.volume_m3, 12)).set("area_m2", base::significant(body.model.area_m2, 12));
  estimate.set("thickness_m", base::significant(body.thickness_m, 12)).set("nodes", std::llround(nodes));
  return fmt::format("{} {}", word, estimate.line());
}

/// Shows an estimate from the surface as it was read: its repair may take long.
void show_rough_estimate(const TriangleSurface& raw, const SurfaceOptions& options, bool is_sheet, Phases& phases) {
  const double volume = std::abs(calc_volume(raw)), area = calc_area(raw);
  if (is_sheet) {
    phases.show(fmt::format("rough {}", format_thin_estimate(area, *options.wall_m, options)));
    return;
  }
  if (!(volume > 0 && area > 0)) return;
  Body body;
  set_model(body, options, volume, area);
  // So thin that it will probably be extruded.
  constexpr double kThin = 0.03;
  if (options.method == Method::kAutomatic && options.order != 1 && body.thickness_m < kThin * calc_box(raw.points).diagonal()) {
    phases.show(fmt::format("rough {}", format_thin_estimate(options.wall_m ? area : area / 2, body.thickness_m, options)));
    return;
  }
  phases.show(format_estimate("rough", body, find_first_edge(body, options)));
}

/// Meshes a wall by extrusion. False, with the reason as the end of a sentence, where it cannot be.
bool extrude_wall(const ThinBody& body, const SurfaceOptions& options, SurfaceReport& report, Phases& phases, mesh::TetMesh& out,
                  std::string& fault) {
  const SurfaceReport before = report;
  try {
    out = mesh_thin_wall(
        body, options, report,
        [&](const std::string& name, const std::function<void()>& work) { phases.run(name, [&] { return work(), 0; }); },
        [&](const std::string& text) { phases.show(text); });
    return true;
  } catch (const WallError& failure) {
    fault = failure.what();
    auto seconds = std::move(report.seconds);
    report = before;
    report.seconds = std::move(seconds);
    return false;
  }
}

/// An open sheet with a wall.
mesh::TetMesh make_sheet(Sheet sheet, const SurfaceOptions& options, SurfaceReport& report, Phases& phases) {
  const auto refuse = [&](const std::string& fault) {
    throw InputError(fmt::format("{}: it is an open sheet, and its wall {}; correct it in a modeller, or give a thinner wall",
                                 options.surface.string(), fault));
  };
  if (!sheet.fault.empty()) refuse(sheet.fault);
  if (options.method == Method::kDelaunay || options.method == Method::kStuffing)
    throw InputError(fmt::format("{}: it is an open sheet, which needs --method extrude or auto", options.surface.string()));
  Body body;
  body.repaired = {std::move(sheet.surface), 0, false};
  phases.run("rounding", [&] { return round_to_height(body, options, report), 0; });
  report.input_area_m2 = calc_area(body.repaired.surface);
  report.input_volume_m3 = *options.wall_m * report.input_area_m2;
  const Side side = options.side == Side::kAutomatic ? Side::kMiddle : options.side;
  report.reason =
      fmt::format("the surface is open ({} border{}): it is the {} of a wall of {:.3g} mm", sheet.holes, sheet.holes == 1 ? "" : "s",
                  side == Side::kMiddle    ? "middle"
                  : side == Side::kOutside ? "outside"
                                           : "inside",
                  1000 * *options.wall_m);
  mesh::TetMesh out;
  std::string fault;
  if (!extrude_wall({.skin = body, .wall_m = *options.wall_m, .side = side}, options, report, phases, out, fault)) refuse(fault);
  return out;
}

/// The wall of a closed body by extrusion, where that is asked for or its elements are longer than it is thick; nothing where it is left to
/// the others, and the report says why.
std::optional<mesh::TetMesh> make_thin(const Body& body, const SurfaceOptions& options, SurfaceReport& report, Phases& phases) {
  const bool must = options.method == Method::kExtrusion || (options.side != Side::kAutomatic && options.side != Side::kOutside);
  if (!must && (options.method != Method::kAutomatic || options.order == 1)) return std::nullopt;
  const auto give_up = [&](const std::string& fault) {
    if (must) throw InputError(fmt::format("{}: the wall cannot be extruded from this surface: it {}", options.surface.string(), fault));
    report.reason.clear();
    report.remarks.push_back(
        fmt::format("The wall is thin, but it {}: the volume was meshed instead of the skin, which takes more nodes.", fault));
    return std::nullopt;
  };
  mesh::TetMesh out;
  std::string fault;
  if (options.wall_m) {
    ThinBody thin{.skin = body, .wall_m = *options.wall_m, .side = options.side == Side::kAutomatic ? Side::kOutside : options.side};
    const double edge = find_thin_edge(thin, options);
    if (!must && edge <= *options.wall_m) {
      report.reason =
          fmt::format("elements of {:.3g} mm are not longer than the wall is thick ({:.3g} mm)", 1000 * edge, 1000 * *options.wall_m);
      return std::nullopt;
    }
    if (report.wrapped) return give_up("has a surface that could not be closed and was wrapped");
    report.reason =
        must ? "it was asked for"
             : fmt::format("the wall ({:.3g} mm) is thinner than the elements are long ({:.3g} mm)", 1000 * *options.wall_m, 1000 * edge);
    if (extrude_wall(thin, options, report, phases, out, fault)) return out;
    return give_up(fault);
  }
  std::optional<TwoSides> sides;
  if (!report.wrapped && report.components <= 2)
    phases.run("looking for a wall",
               [&] { return sides = find_two_sides(body.round ? body.round->get_facets() : body.repaired.surface), 0; });
  if (!sides) {
    if (must)
      throw InputError(
          fmt::format("{}: it is a closed surface and not a thin wall; give --wall for the thickness of a wall", options.surface.string()));
    return std::nullopt;
  }
  Body outer, inner;
  outer.repaired = {std::move(sides->outer), 0, false};
  inner.repaired = {std::move(sides->inner), 0, false};
  if (!options.facets) {
    round(outer, options, report);
    round(inner, options, report);
  }
  ThinBody thin{.skin = outer, .low = &inner, .wall_m = sides->thickness_m, .expected_volume_m3 = report.input_volume_m3};
  const double edge = find_thin_edge(thin, options);
  if (!must && edge <= thin.wall_m) return std::nullopt;
  report.reason = fmt::format("the body is itself a wall, of {:.3g} mm, and thinner than the elements are long ({:.3g} mm)",
                              1000 * thin.wall_m, 1000 * edge);
  if (extrude_wall(thin, options, report, phases, out, fault)) return out;
  return give_up(fault);
}

[[noreturn]] void refuse_open(const SurfaceOptions& options, const Sheet& sheet) {
  throw InputError(fmt::format(
      "{}: it is an open surface ({} border{}), which has no thickness: give one with --wall (of a job's body: \"wall_m\"), or, "
      "of a solid body, say up to which part of its diagonal holes are closed, with --close-holes (\"close_holes\")",
      options.surface.string(), sheet.holes, sheet.holes == 1 ? "" : "s"));
}

mesh::TetMesh make_mesh(const SurfaceOptions& given, SurfaceReport& report, Phases& phases) {
  SurfaceOptions options = given;
  Body body;
  SurfaceInput input = phases.run("reading", [&] { return read_input(options.surface); });
  TriangleSurface& raw = input.surface;
  report.input_triangles = input.triangles;
  const auto calc_limit = [&](double start, double nodes) {
    return start + kCpuPerTriangle * static_cast<double>(report.input_triangles) + kCpuPerNode * nodes;
  };
  const double asked = static_cast<double>(options.nodes.value_or(0));
  std::optional<CpuLimit> cpu_limit(std::in_place, calc_limit(kMinCpuOfRepair, asked));
  std::optional<Sheet> sheet;
  if (options.wall_m || options.refuses_open) phases.run("repairing", [&] { return sheet = find_sheet(raw, options), 0; });
  if (sheet && !options.wall_m) refuse_open(options, *sheet);
  scale_surface(raw, options, report, sheet.has_value());
  report.unused_points = input.unused_points;
  report.seam_edges = input.seams.edges;
  report.seam_m = report.scale * input.seams.widest;
  show_rough_estimate(raw, options, sheet.has_value(), phases);
  if (sheet) {
    for (Vec3& p : sheet->surface.points) p = report.scale * p;
    const auto take = [&] {
      report.removed_triangles = sheet->report.removed_triangles;
      report.flipped_triangles = sheet->report.flipped_triangles;
      report.input_vertices = sheet->report.input_vertices;
      report.components = sheet->report.components;
      return make_sheet(std::move(*sheet), options, report, phases);
    };
    if (options.method == Method::kExtrusion || (sheet->fault.empty() && sheet->report.components == 1)) return take();
    try {  // many parts may be the triangle soup of a closed body
      body.repaired = phases.run("repairing", [&] { return repair_surface(raw, options, report); });
    } catch (const InputError&) {
      return take();
    }
  } else {
    body.repaired = phases.run("repairing", [&] { return repair_surface(std::move(raw), options, report); });
  }
  phases.run("smoothing", [&] { return smooth(body, options, report), 0; });
  phases.run("rounding", [&] { return round_to_height(body, options, report), 0; });
  const TriangleSurface& surface = body.repaired.surface;
  report.input_area_m2 = calc_area(surface);
  report.input_volume_m3 = body.round ? body.round->calc_volume() : calc_volume(surface) - body.repaired.offset_m * report.input_area_m2;
  if (std::optional<mesh::TetMesh> thin = make_thin(body, options, report, phases)) return std::move(*thin);
  if (options.order == 0) options.order = 1;
  set_model(body, options, report.input_volume_m3, report.input_area_m2);
  double edge = find_first_edge(body, options);
  check_edge(options, edge, calc_box(surface.points).diagonal(), body.model.calc_nodes(edge), 1.5 * kMaxNodes);
  const double min_nodes = calc_min_nodes(body);
  cpu_limit.emplace(calc_limit(kMinCpu, options.nodes ? asked : std::max(body.model.calc_nodes(edge), min_nodes)));
  if (!options.nodes && min_nodes > 1.5 * kMaxNodes) throw_count(options, CountError("", min_nodes, min_nodes));
  if (options.nodes && options.method != Method::kStuffing && static_cast<double>(*options.nodes) < kHopeless * min_nodes)
    throw_count(options, CountError("", min_nodes, min_nodes));
  if (!options.edge_m && !options.nodes)
    report.remarks.push_back("Neither nodes nor edge was given: about 10,000 corner nodes (order 2: 30,000 nodes in all) were aimed at.");

  for (const std::string& note : report.notes) phases.show("note " + note);  // the estimate may be all that is waited for
  phases.show(format_estimate("estimate", body, edge));

  report.method = options.method == Method::kStuffing ? Method::kStuffing : Method::kDelaunay;
  if (report.reason.empty())
    report.reason = options.method != Method::kAutomatic ? "it was asked for" : "it keeps thin tips and sharp edges";
  body.nearest.emplace(surface);
  if (body.wall_m > 0 || !body.repaired.clean || report.method == Method::kStuffing)
    body.field = phases.run("computing distances", [&] { return make_field(body, options, edge); });
  // Refinement of what is too thin for its elements takes long, and would fall short of it in the end. To meet a count, edges may become
  // longer than these.
  constexpr double kLonger = 1.5;
  if (const std::string lost = find_lost(body, options.nodes ? kLonger * edge : edge); !lost.empty())
    throw_wrong(options, body, WrongMesh(lost, edge));
  report.expected_volume_m3 = body.field ? calc_volume(*body.field, body.wall_m) : report.input_volume_m3;
  if (body.wall_m > 0) {
    body.model.volume_m3 = report.expected_volume_m3;
    body.model.area_m2 = 2 * report.expected_volume_m3 / body.wall_m;
    if (options.nodes) edge = body.model.find_edge(static_cast<double>(*options.nodes));
  }

  const auto stuff_body = [&] {
    const auto refine = [&](double e) { return stuff(*body.field, body.wall_m, e); };
    try {
      mesh::TetMesh mesh =
          meet_count(body, options, edge, report, phases, refine, [&](mesh::TetMesh& made) { finish_mesh(made, body, report); });
      if (const std::string cut = find_cut(mesh, body, edge); !cut.empty())
        report.notes.push_back(
            fmt::format("Stuffing needs three cells through the thinnest place, and the body's length within 0.2 %, but the mesh {}: thin "
                        "places may be cut short, and the error bars of the frequencies do not include this; use Delaunay refinement, or "
                        "more nodes.",
                        cut));
      return mesh;
    } catch (const CountError& failure) {
      throw_count(options, failure);
    }
  };
  mesh::TetMesh linear;
  try {
    linear = report.method == Method::kStuffing ? stuff_body() : make_delaunay_mesh(body, options, edge, report, phases);
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
    body.field = phases.run("computing distances", [&] { return make_field(body, deep, edge); });
    report.sharp_curves = 0;
    report.sharp_edges_m = 0;
    body.curves.clear();
    edge = body.model.find_edge(options.nodes ? static_cast<double>(*options.nodes) : body.model.calc_nodes(edge));
    try {
      linear = stuff_body();
    } catch (const WrongMesh& failure) {
      throw_wrong(options, body, failure);
    }
  }
  if (report.removed_tets > 0)
    report.notes.push_back(fmt::format("{} elements were removed where the body only touched itself or was cut off.", report.removed_tets));
  if (report.parted_nodes > 0)
    report.remarks.push_back(fmt::format("The mesh was repaired at {} nodes where both skins of a thin part met.", report.parted_nodes));
  measure_mesh(linear, body, report);
  report.edge_m = edge;
  mesh::TetMesh out = options.order == 2 ? mesh::to_quadratic(linear) : std::move(linear);
  if (options.order == 2 && !options.straight) phases.run("curving", [&] { return curve(out, body, report), 0; });
  if (body.round || options.order == 2) phases.run("placing nodes", [&] { return place_nodes(out, body, options, report), 0; });
  report.nodes = static_cast<std::int64_t>(out.nodes_m.size());
  report.mesh_extent_m = calc_box(out.nodes_m).extent();
  add_notes(options, body, report);
  return out;
}

}  // namespace

mesh::TetMesh mesh_surface(const SurfaceOptions& options, SurfaceReport& report, const Progress& progress) {
  report = SurfaceReport{};
  check_options(options);
  Phases phases(report, progress, options.surface.string());
  const Quiet quiet;
  try {
    mesh::TetMesh mesh = make_mesh(options, report, phases);
    if (report.removed_triangles > 0)
      report.notes.push_back(fmt::format("{} of the {} triangles of the surface were dropped: they have no area, or are there twice.",
                                         report.removed_triangles, report.input_triangles));
    note_input(report);
    return mesh;
  } catch (const std::bad_alloc&) {
    throw SystemError(fmt::format("{}: memory ran out while meshing; ask for longer edges or fewer nodes", options.surface.string()));
  }
}

SurfaceLook look_at_surface(const std::filesystem::path& surface) {
  SurfaceInput input = read_input(surface);
  TriangleSurface& raw = input.surface;
  weld(raw, kSamePoint * calc_box(raw.points).diagonal());
  SurfaceLook look{.triangles = input.triangles, .unused_points = input.unused_points, .seam_edges = input.seams.edges};
  look.extent = calc_used_box(raw).extent();
  look.parts = count_bodies(raw);
  SurfaceOptions options;
  options.surface = surface;
  if (const std::optional<Sheet> sheet = find_sheet(raw, options)) {
    look.openings = sheet->holes;
    look.parts = sheet->report.components;
  } else if (const std::optional<TwoSides> sides = find_two_sides(raw)) {
    look.thickness = sides->thickness_m;
  }
  return look;
}

}  // namespace carillon::mesher
