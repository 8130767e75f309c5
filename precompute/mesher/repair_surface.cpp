// Method: coincident points are joined; each patch is oriented across its edges; the signed boundary of the triangles is a set of loops
//   (the boundary of a chain is a cycle), and each small enough loop is filled. If the surface is still open, it is wrapped.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <unordered_map>

#include "precompute/mesh/parts.hpp"
#include "precompute/mesher/repair.hpp"
#include "precompute/mesher/seams.hpp"
#include "precompute/mesher/surface.hpp"
#include "precompute/mesher/thin_wall.hpp"
#include "precompute/mesher/triangle_surface.hpp"
#include "runtime/base/error.hpp"

namespace carillon::mesher {
namespace {

// Hole size: diameter of a circle with the area of the filling triangles, relative to the body diagonal; zero-width cracks are no holes.
// Raw scans like the Stanford bunny have open bases of up to 0.11; the mouth of a cup is 0.3 and more.
constexpr double kLargestHole = 0.15;
constexpr double kSmallestOpening = 0.02;      // over the diagonal, as kLargestHole
constexpr double kOpeningTurn = 60;            // degrees, between the fill and the surrounding surface
constexpr double kLargestHolesTogether = 0.3;  // over the area of the closed surface
constexpr std::size_t kMaxComponentsNested = 2000;

/// Faces at each undirected edge; +f+1 where the face traverses it upward (low to high index), -f-1 downward.
using EdgeFaces = std::unordered_map<Edge, std::vector<std::int32_t>, EdgeHash>;
EdgeFaces find_edge_faces(const std::vector<Triangle>& triangles) {
  EdgeFaces faces;
  faces.reserve(triangles.size() * 3 / 2);
  for (std::size_t f = 0; f < triangles.size(); ++f)
    for (int c = 0; c < 3; ++c) {
      const std::int32_t a = triangles[f][c], b = triangles[f][(c + 1) % 3], id = static_cast<std::int32_t>(f) + 1;
      faces[make_edge(a, b)].push_back(a < b ? id : -id);
    }
  return faces;
}

/// Groups of faces joined by edges with exactly two faces; with `any_edge` by all edges.
std::vector<std::int32_t> find_patches(const EdgeFaces& edges, std::size_t face_count, bool any_edge, std::int32_t& count) {
  mesh::Parts parts(face_count);
  for (const auto& [edge, faces] : edges) {
    if (!any_edge && faces.size() != 2) continue;
    for (std::size_t i = 1; i < faces.size(); ++i) parts.join(std::abs(faces[0]) - 1, std::abs(faces[i]) - 1);
  }
  std::vector<std::int32_t> patch(face_count);
  count = 0;
  for (std::size_t f = 0; f < face_count; ++f) {
    const std::int32_t r = parts.find(static_cast<std::int32_t>(f));
    patch[f] = r == static_cast<std::int32_t>(f) ? count++ : patch[r];
  }
  return patch;
}

/// Drops triangles with a repeated corner, and duplicates of the same three corners; with `cancel` pairs of opposite orientation first (two
/// sides of a fold). Returns the number dropped.
std::int64_t drop_useless(std::vector<Triangle>& triangles, bool cancel) {
  const auto calc_key = [](Triangle t, int& turn) {
    turn = 1;  // parity of the permutation that sorts the corners: orientation
    for (const auto& [i, j] : {std::pair{0, 1}, std::pair{1, 2}, std::pair{0, 1}})
      if (t[i] > t[j]) std::swap(t[i], t[j]), turn = -turn;
    return t;
  };
  int turn = 0;
  std::map<Triangle, int> net;
  for (const Triangle& t : triangles) {
    int& sum = net[calc_key(t, turn)];
    sum += turn;
  }
  std::map<Triangle, int> seen;
  const auto useless = [&](const Triangle& t) {
    const Triangle key = calc_key(t, turn);
    if (key[0] == key[1] || key[1] == key[2]) return true;
    if (cancel && net[key] * turn <= 0) return true;
    return !seen.try_emplace(key, 1).second;
  };
  return static_cast<std::int64_t>(std::erase_if(triangles, useless));
}

/// Makes neighbours consistent across every edge with two faces, with the fewest flips per patch. Returns the number of flips.
std::int64_t orient_patches(std::vector<Triangle>& triangles) {
  const EdgeFaces edges = find_edge_faces(triangles);
  std::vector<std::int8_t> flip(triangles.size(), -1);
  std::vector<std::int32_t> patch;
  std::int64_t flipped = 0;
  for (std::size_t seed = 0; seed < triangles.size(); ++seed) {
    if (flip[seed] >= 0) continue;
    patch.assign(1, static_cast<std::int32_t>(seed));
    flip[seed] = 0;
    std::size_t turned = 0;
    for (std::size_t next = 0; next < patch.size(); ++next) {
      const std::int32_t f = patch[next];
      turned += flip[f] == 1;
      for (int c = 0; c < 3; ++c) {
        const auto& faces = edges.at(make_edge(triangles[f][c], triangles[f][(c + 1) % 3]));
        if (faces.size() != 2) continue;
        const std::int32_t other = std::abs(std::abs(faces[0]) - 1 == f ? faces[1] : faces[0]) - 1;
        if (flip[other] >= 0) continue;
        const bool agree = (faces[0] > 0) != (faces[1] > 0);
        flip[other] = static_cast<std::int8_t>(agree ? flip[f] : 1 - flip[f]);
        patch.push_back(other);
      }
    }
    const int turn = 2 * turned > patch.size() ? 0 : 1;  // keep the majority
    for (const std::int32_t f : patch)
      if (flip[f] == turn) std::swap(triangles[f][1], triangles[f][2]), ++flipped;
  }
  return flipped;
}

/// Signed boundary of the triangles as loops, oriented so that a fill closes them. Empty if closed. `whole` is false if an edge remains
/// more than once, which simple fills cannot repair.
std::vector<std::vector<std::int32_t>> find_loops(const std::vector<Triangle>& triangles, bool& whole) {
  whole = true;
  std::map<std::int32_t, std::vector<std::int32_t>> next;  // ordered: deterministic loops
  for (const auto& [edge, faces] : find_edge_faces(triangles)) {
    int net = 0;
    for (const std::int32_t f : faces) net += f > 0 ? 1 : -1;
    if (std::abs(net) > 1) whole = false;
    for (int n = 0; n < std::abs(net); ++n) {
      if (net > 0)
        next[edge[1]].push_back(edge[0]);
      else
        next[edge[0]].push_back(edge[1]);
    }
  }
  for (auto& [from, to] : next) std::sort(to.begin(), to.end());
  std::vector<std::vector<std::int32_t>> loops;
  for (auto& [start, ends] : next)
    while (!ends.empty()) {
      // Walk until a vertex repeats; the part in between is a loop.
      std::vector<std::int32_t> walk{start};
      std::unordered_map<std::int32_t, std::size_t> place{{start, 0}};
      while (!next[walk.back()].empty()) {
        auto& out = next[walk.back()];
        const std::int32_t to = out.back();
        out.pop_back();
        const auto found = place.find(to);
        if (found == place.end()) {
          place[to] = walk.size();
          walk.push_back(to);
          continue;
        }
        loops.emplace_back(walk.begin() + static_cast<std::ptrdiff_t>(found->second), walk.end());
        for (std::size_t i = found->second + 1; i < walk.size(); ++i) place.erase(walk[i]);
        walk.resize(found->second + 1);
      }
    }
  return loops;
}

/// Holes of a surface: number, total area and largest.
struct Holes {
  std::int64_t count = 0;
  double area_m2 = 0, surface_m2 = 0;                             // of all holes, and of the surface without them
  double largest_m2 = 0, largest_across_m = 0, largest_part = 0;  // part: over the diagonal, as kLargestHole
};

/// Largest distance of two points; for many points, twice the largest distance from the centroid.
double calc_across(const Polyline& polygon) {
  constexpr std::size_t kMaxCompared = 1000;
  double farthest = 0;
  if (polygon.size() <= kMaxCompared) {
    for (const Vec3& p : polygon)
      for (const Vec3& q : polygon) farthest = std::max(farthest, norm(p - q));
    return farthest;
  }
  Vec3 middle{};
  for (const Vec3& p : polygon) middle = middle + (1.0 / static_cast<double>(polygon.size())) * p;
  for (const Vec3& p : polygon) farthest = std::max(farthest, 2 * norm(p - middle));
  return farthest;
}

/// Triangles that fill a polygon.
std::vector<Triangle> fill_loop(const Polyline& polygon) {
  std::vector<Triangle> fill = fill_polygon(polygon);
  if (fill.empty())  // zero-width crack: any triangulation
    for (std::int32_t c = 1; c + 1 < static_cast<std::int32_t>(polygon.size()); ++c) fill.push_back({0, c, c + 1});
  return fill;
}

/// True if a loop is the opening of a vessel or tube rather than a hole: its fill is large enough, and turns away from the surrounding
/// surface on average along the border.
bool has_opening(const TriangleSurface& surface, const std::vector<std::vector<std::int32_t>>& loops) {
  const double diagonal = calc_box(surface.points).diagonal();
  const auto calc_area_vector = [](const std::vector<Vec3>& points, const Triangle& t) {
    return cross(points[t[1]] - points[t[0]], points[t[2]] - points[t[0]]);
  };
  const EdgeFaces edges = find_edge_faces(surface.triangles);
  return std::any_of(loops.begin(), loops.end(), [&](const std::vector<std::int32_t>& loop) {
    Polyline polygon;
    for (const std::int32_t v : loop) polygon.push_back(surface.points[v]);
    if (loop.size() < 3) return false;
    const std::vector<Triangle> fill = fill_loop(polygon);
    if (2 * std::sqrt(calc_area({polygon, fill}) / std::numbers::pi) < kSmallestOpening * diagonal) return false;
    double turn = 0, length = 0;
    const auto count = static_cast<std::int32_t>(loop.size());
    for (const Triangle& t : fill)
      for (int c = 0; c < 3; ++c) {
        const std::int32_t i = t[c], j = t[(c + 1) % 3];
        if ((i + 1) % count != j && (j + 1) % count != i) continue;  // inside
        const auto found = edges.find(make_edge(loop[i], loop[j]));
        if (found == edges.end() || found->second.size() != 1) continue;
        const Vec3 own = calc_area_vector(polygon, t);
        const Vec3 other = calc_area_vector(surface.points, surface.triangles[std::abs(found->second[0]) - 1]);
        const double edge = norm(polygon[j] - polygon[i]);
        turn += edge * std::atan2(norm(cross(own, other)), dot(own, other)) * 180 / std::numbers::pi;
        length += edge;
      }
    return turn > kOpeningTurn * length;
  });
}

/// Fills every loop. False without change if one exceeds `close_holes` (over the diagonal; default kLargestHole and kLargestHolesTogether).
bool fill_loops(TriangleSurface& surface, const std::vector<std::vector<std::int32_t>>& loops, const std::optional<double>& close_holes,
                Holes& holes) {
  const double diagonal = calc_box(surface.points).diagonal();
  holes = {.surface_m2 = calc_area(surface)};
  std::vector<Triangle> fresh;
  for (const auto& loop : loops) {
    Polyline polygon;
    for (const std::int32_t v : loop) polygon.push_back(surface.points[v]);
    if (loop.size() == 2) continue;  // an edge and its reverse
    const std::vector<Triangle> fill = fill_loop(polygon);
    const double area = calc_area({polygon, fill});
    ++holes.count;
    holes.area_m2 += area;
    if (area >= holes.largest_m2) {
      holes.largest_m2 = area;
      holes.largest_across_m = calc_across(polygon);
      holes.largest_part = 2 * std::sqrt(area / std::numbers::pi) / diagonal;
    }
    for (const Triangle& t : fill) fresh.push_back({loop[t[0]], loop[t[1]], loop[t[2]]});
  }
  if (holes.largest_part > close_holes.value_or(kLargestHole)) return false;
  if (!close_holes && holes.area_m2 > kLargestHolesTogether * (holes.surface_m2 + holes.area_m2)) return false;
  surface.triangles.insert(surface.triangles.end(), fresh.begin(), fresh.end());
  return true;
}

/// Orients every outermost component outward, together with its nested components.
void orient_outward(TriangleSurface& surface, SurfaceReport& report) {
  std::int32_t count = 0;
  const auto patch = find_patches(find_edge_faces(surface.triangles), surface.triangles.size(), true, count);
  std::vector<TriangleSurface> parts(count);
  for (std::size_t f = 0; f < surface.triangles.size(); ++f) parts[patch[f]].triangles.push_back(surface.triangles[f]);
  for (auto& part : parts) {
    // Keep only the part's own points to bound the cost.
    std::unordered_map<std::int32_t, std::int32_t> number;
    for (Triangle& t : part.triangles)
      for (std::int32_t& v : t) {
        const auto [found, fresh] = number.try_emplace(v, static_cast<std::int32_t>(part.points.size()));
        if (fresh) part.points.push_back(surface.points[v]);
        v = found->second;
      }
  }
  report.components = count;
  std::vector<double> volume;
  for (const auto& part : parts) volume.push_back(calc_volume(part));
  std::vector<bool> flip(parts.size(), false);
  for (std::size_t p = 0; p < parts.size(); ++p) {
    // Orientation follows the largest enclosing part; otherwise its own.
    std::size_t outermost = p;
    if (parts.size() <= kMaxComponentsNested)
      for (std::size_t q = 0; q < parts.size(); ++q)
        if (std::abs(volume[q]) > std::abs(volume[outermost]) && std::abs(calc_winding(parts[q], parts[p].points.front())) > 0.5)
          outermost = q;
    flip[p] = volume[outermost] < 0;
  }
  for (std::size_t f = 0; f < surface.triangles.size(); ++f)
    if (flip[patch[f]]) std::swap(surface.triangles[f][1], surface.triangles[f][2]), ++report.flipped_triangles;
}

/// Closes the surface by joining, orienting and filling. False on failure; `holes`: those found.
bool close_surface(TriangleSurface& surface, double tolerance, bool cancel, const std::optional<double>& close_holes, SurfaceReport& report,
                   Holes& holes) {
  weld(surface, tolerance);
  report.removed_triangles = drop_useless(surface.triangles, cancel);
  if (surface.triangles.empty()) return false;
  report.input_vertices = static_cast<std::int64_t>(surface.points.size());
  bool whole = false;
  auto loops = find_loops(surface.triangles, whole);
  if (!loops.empty()) {
    report.flipped_triangles = orient_patches(surface.triangles);
    loops = find_loops(surface.triangles, whole);
  }
  if (!whole || !fill_loops(surface, loops, close_holes, holes)) return false;
  report.holes_closed = holes.count;
  report.largest_hole_m = holes.largest_across_m;
  report.largest_hole_part = holes.largest_part;
  report.holes_area_part = holes.area_m2 / (holes.surface_m2 + holes.area_m2);
  return find_loops(surface.triangles, whole).empty();
}

/// "60.0 mm across (0.35 of the body's diagonal, 9.1 % of its surface)".
std::string describe_hole(double across_m, double part, double area_part) {
  return fmt::format("{:.3g} mm across ({:.2g} of the body's diagonal, {:.2g} % of its surface)", 1000 * across_m, part, 100 * area_part);
}

[[noreturn]] void refuse_holes(const SurfaceOptions& options, const Holes& holes) {
  const double area_part = holes.largest_m2 / (holes.surface_m2 + holes.area_m2);
  const std::string which = holes.count == 1 ? "a hole is" : fmt::format("{} holes are open, and the largest is", holes.count);
  const std::string limit = options.close_holes || holes.largest_part > kLargestHole
                                ? fmt::format("holes up to {:.3g} of the diagonal are closed", options.close_holes.value_or(kLargestHole))
                                : fmt::format("holes are closed up to {:.0f} % of the surface together, and these are {:.0f} %",
                                              100 * kLargestHolesTogether, 100 * holes.area_m2 / (holes.surface_m2 + holes.area_m2));
  throw InputError(fmt::format(
      "{}: {} {}; a closed surface is needed, and {}: close it in a modeller, give the sheet a thickness with --wall (of a job's body: "
      "\"wall_m\"), or close it with --close-holes {:.2g} (\"close_holes\")",
      options.surface.string(), which, describe_hole(holes.largest_across_m, holes.largest_part, area_part), limit,
      std::min(1.0, std::ceil(100 * holes.largest_part + 1) / 100)));
}

}  // namespace

std::optional<Sheet> find_sheet(const TriangleSurface& surface, const SurfaceOptions& options) {
  Sheet sheet{.surface = surface};
  weld(sheet.surface, kSamePoint * calc_box(surface.points).diagonal());
  SurfaceReport& report = sheet.report;
  report.removed_triangles = drop_useless(sheet.surface.triangles, false);
  if (sheet.surface.triangles.empty()) return std::nullopt;
  report.input_vertices = static_cast<std::int64_t>(sheet.surface.points.size());
  bool whole = false;
  if (find_loops(sheet.surface.triangles, whole).empty()) return std::nullopt;
  report.flipped_triangles = orient_patches(sheet.surface.triangles);
  const auto loops = find_loops(sheet.surface.triangles, whole);
  if (loops.empty()) return std::nullopt;
  Holes holes;
  TriangleSurface closed = sheet.surface;
  const bool is_closed = fill_loops(closed, loops, options.close_holes, holes);
  if (is_closed && (options.close_holes || !has_opening(sheet.surface, loops))) return std::nullopt;
  if (is_closed) closed = sheet.surface;
  sheet.holes = holes.count;
  // Outward for a vessel; a nearly flat sheet keeps its orientation.
  SurfaceOptions all = options;
  all.close_holes = 1;
  if (fill_loops(closed, loops, all.close_holes, holes)) {
    constexpr double kHollow = 0.01;
    const double volume = calc_volume(closed);
    if (volume < -kHollow * std::pow(calc_area(sheet.surface), 1.5)) {
      for (Triangle& t : sheet.surface.triangles) std::swap(t[1], t[2]);
      report.flipped_triangles = static_cast<std::int64_t>(sheet.surface.triangles.size()) - report.flipped_triangles;
    }
  }
  const auto describe_place = [&](const Edge& e) {
    const Vec3 p = 0.5 * (sheet.surface.points[e[0]] + sheet.surface.points[e[1]]);
    return fmt::format("at ({:.4g}, {:.4g}, {:.4g}) in the file's units", p[0], p[1], p[2]);
  };
  std::optional<Edge> branch, turn;  // the first of each
  std::size_t branches = 0;
  for (const auto& [edge, faces] : find_edge_faces(sheet.surface.triangles)) {
    if (faces.size() > 2 && (!branch || edge < *branch)) branch = edge, branches = faces.size();
    // After orientation of all patches: an edge of a loop along which the sides swap.
    if (faces.size() == 2 && (faces[0] > 0) == (faces[1] > 0) && (!turn || edge < *turn)) turn = edge;
  }
  if (branch)
    sheet.fault = fmt::format("cannot branch: {} of its triangles meet in one edge {} (a T-junction)", branches, describe_place(*branch));
  else if (turn)
    sheet.fault = fmt::format(
        "has no two sides: the surface is one-sided, like a Moebius strip, and its triangles cannot be oriented consistently {}",
        describe_place(*turn));
  std::int32_t parts = 0;
  find_patches(find_edge_faces(sheet.surface.triangles), sheet.surface.triangles.size(), true, parts);
  report.components = parts;
  return sheet;
}

std::int64_t count_bodies(TriangleSurface surface) {
  weld(surface, kSamePoint * calc_box(surface.points).diagonal());
  const std::vector<TriangleSurface> parts = split_parts(surface);
  if (parts.size() < 2 || parts.size() > kMaxComponentsNested) return static_cast<std::int64_t>(parts.size());
  std::vector<Box> boxes;
  for (const TriangleSurface& part : parts) boxes.push_back(calc_box(part.points));
  const auto is_inside = [&](std::size_t p, std::size_t q) {
    const Vec3& at = parts[p].points.front();
    for (int c = 0; c < 3; ++c)
      if (at[c] < boxes[q].low[c] || at[c] > boxes[q].high[c]) return false;
    return std::abs(calc_winding(parts[q], at)) > 0.5;
  };
  const auto do_cross = [&](std::size_t p, std::size_t q) {
    for (int c = 0; c < 3; ++c)
      if (boxes[p].low[c] > boxes[q].high[c] || boxes[q].low[c] > boxes[p].high[c]) return false;
    TriangleSurface both = parts[p];
    const auto points = static_cast<std::int32_t>(both.points.size()), triangles = static_cast<std::int32_t>(both.triangles.size());
    both.points.insert(both.points.end(), parts[q].points.begin(), parts[q].points.end());
    for (const Triangle& t : parts[q].triangles) both.triangles.push_back({t[0] + points, t[1] + points, t[2] + points});
    const auto crossing = find_crossing(both);
    return crossing && ((*crossing)[0] < triangles) != ((*crossing)[1] < triangles);
  };
  mesh::Parts joined(parts.size());
  std::vector<int> depth(parts.size(), 0);  // number of enclosing parts; odd: wall of a cavity
  for (std::size_t p = 0; p < parts.size(); ++p)
    for (std::size_t q = 0; q < parts.size(); ++q) {
      if (q != p && is_inside(p, q)) ++depth[p];
      if (q < p && do_cross(p, q)) joined.join(static_cast<std::int32_t>(p), static_cast<std::int32_t>(q));
    }
  std::int64_t count = 0;
  for (std::size_t p = 0; p < parts.size(); ++p)
    count += joined.find(static_cast<std::int32_t>(p)) == static_cast<std::int32_t>(p) && depth[p] % 2 == 0;
  return std::max<std::int64_t>(count, 1);
}

RepairedSurface repair_surface(TriangleSurface surface, const SurfaceOptions& options, SurfaceReport& report) {
  const double diagonal = calc_box(surface.points).diagonal();
  const auto refuse_open = [&](const std::string& what) {
    throw InputError(
        fmt::format("{}: {}; a closed surface is needed: close its openings in a modeller, or give the sheet a thickness with --wall (of "
                    "a job's body: \"wall_m\")",
                    options.surface.string(), what));
  };
  // Upper limit of a body's missing skin; a sheet lacks half of it.
  constexpr double kSheet = 0.4;
  std::optional<Holes> too_large;
  const double same = kSamePoint * diagonal, near = 1e-6 * diagonal;
  for (const auto& [tolerance, cancel] : {std::pair{same, false}, std::pair{same, true}, std::pair{near, false}, std::pair{near, true}}) {
    TriangleSurface candidate = surface;
    SurfaceReport attempt = report;
    Holes holes;
    if (!close_surface(candidate, tolerance, cancel, options.close_holes, attempt, holes)) {
      if (holes.count > 0 && holes.area_m2 < kSheet * (holes.surface_m2 + holes.area_m2)) too_large = holes;
      continue;
    }
    orient_outward(candidate, attempt);
    if (!(calc_volume(candidate) > 1e-9 * diagonal * calc_area(candidate))) continue;
    report = attempt;
    if (report.holes_closed > 0)
      report.notes.push_back(fmt::format("{} hole{} closed, {}{}.", report.holes_closed, report.holes_closed == 1 ? " was" : "s were",
                                         report.holes_closed == 1 ? "" : "the largest ",
                                         describe_hole(report.largest_hole_m, report.largest_hole_part, report.holes_area_part)));
    return {candidate, 0, is_clean(candidate)};
  }
  // Not closable: wrap it. A wrap that enters an opening is a thin sheet around the triangles with hardly any volume within its offset;
  // only a coarser one can help.
  weld(surface, same);
  report.removed_triangles = drop_useless(surface.triangles, false);
  report.input_vertices = static_cast<std::int64_t>(surface.points.size());
  if (surface.triangles.empty()) refuse_open("all its triangles are degenerate");
  const double area = calc_area(surface);
  const double offset = diagonal / 1000;
  // A wrap enters gaps wider than twice its alpha; where a coarse one enters, finer ones do. It then follows both sides of the triangles,
  // visible in its area even at a larger offset, which takes a third of the time. The finest closed one is made with the small offset.
  constexpr double kProbeOffset = 0.2;                         // of alpha
  constexpr double kBothSides = 1.6, kBothSidesOfProbe = 1.7;  // times the area; an offset adds area around edges
  const auto is_body = [&](const TriangleSurface& wrapped) {
    return calc_volume(wrapped) - offset * calc_area(wrapped) > 3 * offset * area && calc_area(wrapped) <= kBothSides * area;
  };
  constexpr double kCoarsest = 14, kFinest = 50;
  std::vector<double> parts{kCoarsest, 25, kFinest};
  std::erase_if(parts, [&](double part) { return 2 / part > options.close_holes.value_or(kLargestHole); });
  // Cost of a wrap grows with its own triangles; the limit grows with those of the file: a soup of few triangles and large area has no
  // detail that needs a fine wrap. Bodies have an area of one or two squared diagonals: above some 900 triangles they may have the finest
  // wrap, below 200 the coarsest, which bridges gaps of a seventh of the diagonal.
  const auto count = static_cast<double>(surface.triangles.size());
  const double max_area = std::min(0.2 + 2.5e-3 * count, 1.5 + 1e-3 * count) * diagonal * diagonal;  // for the finest
  std::erase_if(parts, [&](double part) { return part > kCoarsest && part * part * area > kFinest * kFinest * max_area; });
  const auto slips = [&](double part) {
    return calc_area(wrap(surface, diagonal / part, kProbeOffset * diagonal / part)) > kBothSidesOfProbe * area;
  };
  parts.erase(std::find_if(parts.begin(), parts.end(), slips), parts.end());
  std::reverse(parts.begin(), parts.end());
  for (const double part : parts) {
    const double alpha = diagonal / part;
    TriangleSurface wrapped = wrap(surface, alpha, offset);
    if (!is_body(wrapped)) continue;
    report.wrapped = true;
    report.notes.push_back(fmt::format(
        "The surface could not be closed as it is; it was wrapped: gaps narrower than {:.3g} m are bridged and edges are rounded.",
        2 * alpha));
    SurfaceReport unused;
    orient_outward(wrapped, unused);
    report.components = unused.components;
    return {wrapped, offset, false};
  }
  if (too_large) refuse_holes(options, *too_large);
  refuse_open("it is an open sheet, not the skin of a body");
  return {};
}

}  // namespace carillon::mesher
