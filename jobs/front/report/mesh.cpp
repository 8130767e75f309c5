// Method:     what the solver recorded of the mesh; of the surface, which every bank has, angles and edges are measured here.
// Source:     precompute/mesh/check.hpp (what is measured of a mesh).
// Deviations: none.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "jobs/front/report/chart.hpp"
#include "jobs/front/report/quantity.hpp"
#include "jobs/front/report/sections.hpp"

namespace carillon::report {
namespace {

constexpr double kSliverDeg = 5.0;  // of the mesh check
constexpr std::size_t kBins = 6;    // of 10 degrees: no triangle has a smallest angle above 60

void add_count(Facts& facts, const base::Json& in, const char* key, const char* what, const char* remark = "") {
  if (const auto count = find_count(in, key)) facts.add(what, html("{}", format_count(*count)), remark);
}

/// Only where there were any.
void add_if_any(Facts& facts, const base::Json& in, const char* key, const char* what, const char* remark) {
  if (find_count(in, key).value_or(0) > 0) add_count(facts, in, key, what, remark);
}

struct SurfaceQuality {
  double shortest_m = std::numeric_limits<double>::infinity(), longest_m = 0.0, mean_m = 0.0;  // edges
  double smallest_deg = 180.0;                                                                 // angle of all
  std::array<std::int64_t, kBins> triangles{};                                                 // by their smallest angle
};

/// Of the triangles with finite corners; an edge counts once for each of its triangles.
SurfaceQuality measure_surface(const bank::Bank& bank) {
  SurfaceQuality quality;
  std::int64_t count = 0;
  for (const auto& triangle : bank.triangles) {
    std::array<double, 3> edge{};
    bool is_inside = true;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t a = triangle[i], b = triangle[(i + 1) % 3];
      is_inside = is_inside && a < bank.vertices_m.size() && b < bank.vertices_m.size();
      if (!is_inside) break;
      const Vec3 &x = bank.vertices_m[a], &y = bank.vertices_m[b];
      edge[i] = std::hypot(y[0] - x[0], y[1] - x[1], y[2] - x[2]);
    }
    const auto [shortest, longest] = std::minmax({edge[0], edge[1], edge[2]});
    if (!is_inside || !std::isfinite(edge[0] + edge[1] + edge[2]) || !(shortest > 0.0)) continue;
    const double middle = edge[0] + edge[1] + edge[2] - shortest - longest;
    // The smallest angle is the one across from the shortest edge.
    const double cosine = (middle / longest + longest / middle - shortest / middle * (shortest / longest)) / 2.0;
    const double angle_deg = std::acos(std::clamp(cosine, -1.0, 1.0)) * 180.0 / std::numbers::pi;
    quality.smallest_deg = std::min(quality.smallest_deg, angle_deg);
    quality.shortest_m = std::min(quality.shortest_m, shortest);
    quality.longest_m = std::max(quality.longest_m, longest);
    quality.mean_m += (edge[0] + edge[1] + edge[2]) / 3.0;
    ++quality.triangles[std::min(static_cast<std::size_t>(angle_deg / 10.0), kBins - 1)];
    ++count;
  }
  quality.mean_m /= static_cast<double>(std::max<std::int64_t>(count, 1));
  return quality;
}

Html make_surface_part(const bank::Bank& bank) {
  const SurfaceQuality quality = measure_surface(bank);
  if (quality.longest_m == 0.0) return {};
  Facts facts;
  facts.add("edges", html("{:.4g} mm on average", 1e3 * quality.mean_m),
            fmt::format("{:.4g} mm to {:.4g} mm", 1e3 * quality.shortest_m, 1e3 * quality.longest_m));
  facts.add("smallest angle", html("{:.2f}\u00b0", quality.smallest_deg), "60\u00b0 is an equilateral triangle");
  std::vector<Bar> bars;
  for (std::size_t i = 0; i < kBins; ++i) {
    const auto share = static_cast<double>(quality.triangles[i]) / static_cast<double>(bank.triangles.size());
    bars.push_back({fmt::format("{}\u00b0 - {}\u00b0", 10 * i, 10 * (i + 1)), static_cast<double>(quality.triangles[i]),
                    fmt::format("{} \u00b7 {}", format_count(quality.triangles[i]), format_percent(share))});
  }
  return html("<h3>Triangles of the surface by their smallest angle</h3>\n{}{}",
              draw_bars("Triangles of the surface by their smallest angle", bars), facts.finish());
}

}  // namespace

Html make_mesh_section(const Subject& subject) {
  const base::Json& mesh = find(subject.record.run, "mesh");
  const bank::Bank& bank = subject.bank;
  Facts quality;
  if (const auto angle = find_amount(mesh, "min_dihedral_deg"))
    quality.add("smallest dihedral angle", html("{:.2f}\u00b0", *angle),
                *angle < kSliverDeg ? "a sliver: under 5\u00b0" : "slivers are under 5\u00b0");
  if (const auto ratio = find_number(mesh, "mean_ratio_min"))
    quality.add("worst mean ratio", html("{:.4f}", *ratio), "1 is a regular tetrahedron");
  Html out = quality.finish();
  if (quality.empty()) out += html("<p class=\"missing\">Left out: {}</p>\n", explain_missing(subject, "quality of the mesh"));
  Facts facts;
  if (const auto source = find_text(mesh, "source")) facts.add("source", html("{}", *source));
  facts.add("nodes", html("{}", format_count(bank.counts.nodes)), "as solved, mid-side nodes among them");
  facts.add("tetrahedra", html("{}", format_count(bank.counts.tets)));
  facts.add("connected parts", html("{}", format_count(bank.counts.components)));
  facts.add("surface", html("{} triangles", format_count(static_cast<std::int64_t>(bank.triangles.size()))),
            fmt::format("{} vertices", format_count(static_cast<std::int64_t>(bank.vertex_count()))));
  add_if_any(facts, mesh, "fixed_nodes", "fixed nodes", "by the job");
  add_count(facts, mesh, "file_nodes", "nodes of the file");
  add_if_any(facts, mesh, "refinements", "refined", "times");
  add_if_any(facts, mesh, "reoriented", "turned round", "elements that were inside out");
  add_if_any(facts, mesh, "unreferenced", "unused", "nodes of the file");
  add_if_any(facts, mesh, "welded", "welded", "nodes that lay on others");
  add_if_any(facts, mesh, "curved", "curved", "elements");
  add_if_any(facts, mesh, "straightened", "straightened", "elements that were bent too far");
  facts.add("mass", html("{} kg", format_plain(bank.rigid.mass_kg)), fmt::format("{} m\u00b3", format_plain(bank.rigid.volume_m3)));
  out += facts.finish();
  out += make_surface_part(bank);
  out += make_note(find_texts(find(mesh, "warnings")));
  return make_section("mesh", "Mesh", out);
}

}  // namespace carillon::report
