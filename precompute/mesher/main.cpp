// carillon-mesh: a surface or a parametric body to tetrahedra.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/curved.hpp"
#include "precompute/mesh/read.hpp"
#include "precompute/mesh/shapes/shapes.hpp"
#include "precompute/mesh/write.hpp"
#include "precompute/mesher/coarsen.hpp"
#include "precompute/mesher/seams.hpp"
#include "precompute/mesher/surface.hpp"
#include "precompute/mesher/triangle_surface.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/file_limit.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/message.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/result.hpp"
#include "runtime/base/standard_output.hpp"
#include "runtime/base/version.hpp"

namespace {

using namespace carillon;
using Clock = std::chrono::steady_clock;

/// Command line.
struct Order {
  std::string surface, shape, out, json, result;
  std::map<std::string, double> lengths;  // --wall, --height and shape dimensions, by name without dashes
  std::optional<double> scale, edge, close_holes;
  std::optional<long long> nodes;
  std::string up, method, side;
  std::optional<int> order;
  bool straight = false, facets = false, refuses_open = false;
  bool look = false;
  std::optional<std::int64_t> coarsen;
  bool quiet = false;
};

/// Result of either meshing path.
struct Meshed {
  mesh::TetMesh mesh;
  std::vector<std::string> notes, remarks;
  std::vector<std::pair<std::string, double>> seconds;
  std::optional<mesher::SurfaceReport> surface;
};

double calc_seconds(Clock::time_point since) { return std::chrono::duration<double>(Clock::now() - since).count(); }

std::vector<std::string> list_dimensions() {
  std::vector<std::string> names{"wall", "height"};
  for (const shapes::Shape& shape : shapes::get_shapes()) {
    for (const shapes::Dimension& dimension : shape.dimensions) {
      if (std::find(names.begin(), names.end(), dimension.name) == names.end()) names.push_back(dimension.name);
    }
  }
  return names;
}

std::vector<std::string> list_shapes() {
  std::vector<std::string> names;
  for (const shapes::Shape& shape : shapes::get_shapes()) names.push_back(shape.name);
  return names;
}

std::string describe_shapes() {
  std::string text =
      "Shapes, their dimensions (metres; in brackets what is taken when one is not given) and the named node sets of their meshes:\n";
  for (const shapes::Shape& shape : shapes::get_shapes()) {
    text += fmt::format("  {:<11} {}\n", shape.name, shape.summary);
    for (const shapes::Dimension& dimension : shape.dimensions) {
      const std::string fallback = dimension.fallback > 0.0 ? fmt::format("[{:g}]", dimension.fallback) : "[none]";
      text += fmt::format("    --{:<15} {:<9} {}\n", dimension.name, fallback, dimension.meaning);
    }
    text += fmt::format("    node sets: {}\n", fmt::join(shape.node_sets, ", "));
  }
  return text +
         "\nEvery body is centred on the origin, the bowl on the centre of its spheres.\n"
         "Exit codes: 0 done, 2 the input cannot be used, 4 the machine refused (disk, memory).\n"
         "Examples:\n"
         "  carillon-mesh bunny.obj -o bunny.msh --height 0.13 --wall 0.005 --nodes 37000\n"
         "  carillon-mesh cup.obj -o cup.msh --wall 0.003\n"
         "  carillon-mesh --shape tube --length 0.4 --outer-radius 0.0125 --wall 0.001 --order 2 -o chime.msh\n";
}

/// Tube and bowl have one radius, the outer one: --radius is an alias.
void complete_radius(Order& order) {
  if (order.shape != "tube" && order.shape != "bowl") return;
  if (!order.lengths.contains("radius")) return;
  if (order.lengths.contains("outer-radius")) throw InputError("--radius and --outer-radius are the same here; give one of them");
  order.lengths["outer-radius"] = order.lengths["radius"];
  order.lengths.erase("radius");
}

/// Throws InputError for the first option that does not apply to the chosen meshing path.
void check_options(const Order& order) {
  if (order.surface.empty() && order.shape.empty()) {
    throw InputError("nothing to mesh: give a SURFACE file or --shape S (see --help for the shapes)");
  }
  if (!order.surface.empty() && !order.shape.empty()) {
    throw InputError(fmt::format("both a surface ({}) and --shape {} are given; give one of them", order.surface, order.shape));
  }
  if (order.nodes && order.edge) throw InputError("--nodes and --edge exclude each other; give one of them");
  if (order.straight && order.order.value_or(order.method == "extrude" ? 2 : 1) != 2)
    throw InputError("--straight is for tetrahedra of ten nodes; add --order 2");
  if (const std::string ending = base::find_extension(order.out);
      !base::is_standard_output(order.out) && ending != ".msh" && ending != ".vtu") {
    throw InputError(
        fmt::format("{}: the mesh is written in Gmsh's format or as VTU (other formats are read but not written); give the output a name "
                    "that ends in .msh or .vtu, or - for standard output (Gmsh's)",
                    order.out));
  }
  if (!order.shape.empty()) {
    const shapes::Shape& shape = shapes::find_shape(order.shape);
    std::vector<std::string> own;
    for (const shapes::Dimension& dimension : shape.dimensions) own.push_back(dimension.name);
    const std::string takes = fmt::format("--{}", fmt::join(own, ", --"));
    for (const auto& [name, value] : order.lengths) {
      if (std::find(own.begin(), own.end(), name) != own.end()) continue;
      const std::string hint = name == "wall" && shape.name == "box" ? "; --shape hollow-box has a wall" : "";
      throw InputError(fmt::format("--{} does not belong to --shape {}, which takes {}{}", name, shape.name, takes, hint));
    }
    const char* foreign = order.scale             ? "--scale"
                          : !order.up.empty()     ? "--up"
                          : !order.method.empty() ? "--method"
                          : !order.side.empty()   ? "--side"
                          : order.close_holes     ? "--close-holes"
                          : order.facets          ? "--facets"
                          : order.refuses_open    ? "--refuse-open"
                                                  : nullptr;
    if (foreign) {
      throw InputError(fmt::format("{} is for surfaces; --shape {} takes its dimensions in metres: {}", foreign, shape.name, takes));
    }
    return;
  }
  for (const auto& [name, value] : order.lengths) {
    if (name != "wall" && name != "height") {
      throw InputError(fmt::format("--{} is a dimension of a --shape; a surface takes --height or --scale for its size, and --wall", name));
    }
    if (!(value > 0.0) || !std::isfinite(value))
      throw InputError(fmt::format("--{} is {:g}; give a positive length in metres", name, value));
  }
  if (!order.side.empty() && !order.lengths.contains("wall")) throw InputError("--side is for walls; give the thickness with --wall");
  if (order.scale && order.lengths.contains("height")) throw InputError("--height and --scale exclude each other; give one of them");
  if (order.scale && (!(*order.scale > 0.0) || !std::isfinite(*order.scale))) {
    throw InputError(fmt::format("--scale is {:g}; give a positive factor, metres per unit of the file", *order.scale));
  }
}

Meshed make_from_surface(const Order& order, const mesher::Progress& progress) {
  mesher::SurfaceOptions options;
  options.surface = order.surface;
  if (order.lengths.contains("wall")) options.wall_m = order.lengths.at("wall");
  if (order.lengths.contains("height")) options.height_m = order.lengths.at("height");
  if (!order.up.empty()) options.up = order.up == "x" ? mesher::Axis::kX : order.up == "y" ? mesher::Axis::kY : mesher::Axis::kZ;
  options.scale = order.scale;
  options.close_holes = order.close_holes;
  options.edge_m = order.edge;
  options.nodes = order.nodes;
  options.order = order.order.value_or(0);
  options.straight = order.straight;
  options.facets = order.facets;
  options.refuses_open = order.refuses_open;
  if (order.method == "delaunay") options.method = mesher::Method::kDelaunay;
  if (order.method == "stuffing") options.method = mesher::Method::kStuffing;
  if (order.method == "extrude") options.method = mesher::Method::kExtrusion;
  if (order.side == "middle") options.side = mesher::Side::kMiddle;
  if (order.side == "outside") options.side = mesher::Side::kOutside;
  if (order.side == "inside") options.side = mesher::Side::kInside;
  Meshed result;
  mesher::SurfaceReport report;
  result.mesh = mesher::mesh_surface(options, report, progress);
  result.notes = report.notes;
  result.remarks = report.remarks;
  result.seconds = report.seconds;
  result.surface = std::move(report);
  return result;
}

Meshed make_from_shape(const Order& order, const mesher::Progress& progress) {
  progress(fmt::format("making the {}", order.shape));
  const auto start = Clock::now();
  shapes::ShapeOptions options;
  options.shape = order.shape;
  options.dimensions = order.lengths;
  options.order = order.order.value_or(1);
  options.target_nodes = order.nodes;
  options.edge_m = order.edge;
  Meshed result;
  result.mesh = shapes::make_shape(options);
  if (order.straight) mesh::straighten(result.mesh);
  result.seconds.emplace_back("mesh", calc_seconds(start));
  return result;
}

/// Notes on a missed node count.
void note_count(const Order& order, Meshed& result) {
  if (!order.nodes) return;
  const double ratio = static_cast<double>(result.mesh.nodes_m.size()) / static_cast<double>(*order.nodes);
  if (std::abs(ratio - 1.0) <= 0.1) return;
  result.notes.push_back(fmt::format("{} nodes were asked for and {} made: the body has no lattice of that count nearer by; ask for more",
                                     *order.nodes, result.mesh.nodes_m.size()));
}

std::string format_json(const Order& order, const Meshed& result, const mesh::CheckReport& check, double total_s) {
  const auto exact = [](double value) { return base::finite_or_null(value, base::significant, 12); };
  const auto rounded = [](double value, int digits) { return base::finite_or_null(value, base::significant, digits); };
  const auto list = [&](const auto& values) {
    base::Json array = base::Json::array();
    for (const double value : values) array.add(exact(value));
    return array;
  };
  base::Json root = base::Json::object();
  root.set("output", order.out).set("source", order.shape.empty() ? order.surface : order.shape);
  root.set("order", result.mesh.order).set("nodes", result.mesh.nodes_m.size()).set("tets", result.mesh.tet_count());
  if (order.nodes) root.set("nodes_asked", *order.nodes);
  root.set("components", check.components).set("boundary_faces", check.boundary_faces).set("volume_m3", exact(check.volume_m3));
  root.set("box_low_m", list(check.box_low)).set("box_high_m", list(check.box_high));
  root.set("min_dihedral_deg", base::decimals(check.min_dihedral_deg, 4))
      .set("max_dihedral_deg", base::decimals(check.max_dihedral_deg, 4));
  root.set("curved_tets", check.curved);
  root.set("straightened_tets", check.straightened + (result.surface ? result.surface->straightened_tets : 0));
  root.set("mean_ratio_min", base::decimals(check.mean_ratio_min, 5)).set("mean_ratio_mean", base::decimals(check.mean_ratio_mean, 5));
  if (result.surface) {
    const mesher::SurfaceReport& s = *result.surface;
    root.set("method", s.method == mesher::Method::kStuffing    ? "stuffing"
                       : s.method == mesher::Method::kExtrusion ? "extrude"
                                                                : "delaunay");
    root.set("method_reason", s.reason).set("smoothed_m", rounded(s.smoothed_m, 6)).set("input_triangles", s.input_triangles);
    root.set("layers", s.layers).set("edge_per_wall", rounded(s.edge_per_wall, 6));
    root.set("scale", exact(s.scale)).set("input_volume_m3", exact(s.input_volume_m3)).set("facet_pieces", s.facet_pieces);
    root.set("unused_points", s.unused_points).set("seam_edges", s.seam_edges).set("seam_m", rounded(s.seam_m, 6));
    root.set("holes_closed", s.holes_closed).set("largest_hole_m", rounded(s.largest_hole_m, 9));
    root.set("largest_hole_part", rounded(s.largest_hole_part, 6)).set("holes_area_part", rounded(s.holes_area_part, 6));
    root.set("shells", s.shells).set("farthest_outside_m", rounded(s.farthest_outside_m, 9));
    root.set("expected_volume_m3", exact(s.expected_volume_m3)).set("wall_min_m", rounded(s.wall_min_m, 9));
    root.set("wall_mean_m", rounded(s.wall_mean_m, 9)).set("wall_max_m", rounded(s.wall_max_m, 9));
  }
  root.set("node_sets", base::Json::object()).set("seconds", base::Json::object());
  for (const auto& [name, nodes] : result.mesh.node_sets) root["node_sets"].set(name, nodes.size());
  for (const auto& [phase, value] : result.seconds) root["seconds"].set(phase, base::decimals(value, 4));
  root.set("seconds_total", base::decimals(total_s, 4)).set("notes", base::Json::array(result.notes));
  for (const std::string& remark : result.remarks) root["notes"].add(remark);
  return root.text();
}

std::string format_report(const Order& order, const Meshed& result, const mesh::CheckReport& check, double total_s) {
  std::string text;
  if (result.surface) text += mesher::describe(*result.surface);
  if (!text.empty() && text.back() != '\n') text += '\n';
  text += fmt::format("{}: {} nodes, {} tetrahedra of {} nodes\n", base::is_standard_output(order.out) ? "standard output" : order.out,
                      result.mesh.nodes_m.size(), result.mesh.tet_count(), result.mesh.nodes_per_tet());
  text += fmt::format("  size      {:.6g} x {:.6g} x {:.6g} m, volume {:.6g} m3\n", check.box_high[0] - check.box_low[0],
                      check.box_high[1] - check.box_low[1], check.box_high[2] - check.box_low[2], check.volume_m3);
  text += fmt::format("  quality   dihedral angles {:.1f} to {:.1f} degrees, mean ratio {:.3f} on average, {:.3f} at worst\n",
                      check.min_dihedral_deg, check.max_dihedral_deg, check.mean_ratio_mean, check.mean_ratio_min);
  if (result.mesh.order == 2)
    text += fmt::format("  curved    {} tetrahedra; {} made straight-sided since they would have folded over\n", check.curved,
                        check.straightened + (result.surface ? result.surface->straightened_tets : 0));
  std::vector<std::string> sets, seconds;
  for (const auto& [name, nodes] : result.mesh.node_sets) sets.push_back(fmt::format("{} ({})", name, nodes.size()));
  if (!sets.empty()) text += fmt::format("  node sets {}\n", fmt::join(sets, ", "));
  for (const auto& [phase, value] : result.seconds) seconds.push_back(fmt::format("{} {:.2f}", phase, value));
  text += fmt::format("  seconds   {:.2f} in all: {}\n", total_s, fmt::join(seconds, ", "));
  return text;
}

void make_mesh(const Order& order) {
  const auto start = Clock::now();
  const mesher::Progress progress = [&](std::string_view phase) {
    if (order.quiet) return;
    fmt::print(stderr, "[{:6.1f} s] {}\n", calc_seconds(start), base::printable(phase));
    std::fflush(stderr);
  };
  check_options(order);
  const bool is_piped = base::is_standard_output(order.out);
  if (is_piped)
    base::check_standard_output("mesh");
  else
    base::check_writable(order.out, "mesh");
  if (!order.json.empty()) base::check_writable(order.json, "report");
  std::error_code none;
  if (!order.json.empty() && (std::filesystem::path(order.json).lexically_normal() == std::filesystem::path(order.out).lexically_normal() ||
                              std::filesystem::equivalent(order.json, order.out, none))) {
    throw InputError(fmt::format("--json {}: the report would overwrite the mesh; give it another name", order.json));
  }

  Meshed result = order.shape.empty() ? make_from_surface(order, progress) : make_from_shape(order, progress);
  note_count(order, result);
  progress("checking the mesh");
  auto phase = Clock::now();
  const mesh::CheckReport check = mesh::check_mesh(result.mesh, is_piped ? "the mesh" : order.out);
  result.remarks.insert(result.remarks.end(), check.warnings.begin(),
                        check.warnings.end());  // not in machine-readable output: programs check the mesh themselves
  result.seconds.emplace_back("check", calc_seconds(phase));
  progress(fmt::format("writing {}", order.out));
  phase = Clock::now();
  if (is_piped)
    base::write_standard_output(mesh::make_gmsh(result.mesh));
  else if (base::find_extension(order.out) == ".vtu")
    mesh::write_vtu(result.mesh, order.out);
  else
    mesh::write_gmsh(result.mesh, order.out);
  result.seconds.emplace_back("write", calc_seconds(phase));

  const double total_s = calc_seconds(start);
  if (!order.json.empty()) base::write_file(order.json, format_json(order, result, check, total_s));
  std::FILE* const to = is_piped || order.quiet ? stderr : stdout;
  if (!order.quiet) fmt::print(to, "{}", base::printable_lines(format_report(order, result, check, total_s)));
  std::set<std::string> printed;
  for (const auto& [texts, word] : {std::pair(&result.notes, "note"), std::pair(&result.remarks, "remark")}) {
    for (const std::string& text : *texts) {
      if (!printed.insert(text).second) continue;
      fmt::print(to, "{}{}\n", order.quiet ? fmt::format("carillon-mesh: {}: ", word) : "  note      ", base::printable(text));
    }
  }
  if (std::fflush(to) != 0) throw SystemError("the report cannot be written");
}

/// Adds the nearest known option to CLI11's unknown-option message.
[[noreturn]] void throw_unknown(const CLI::App& app, const std::string& complaint) {
  std::vector<std::string> known;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  }
  std::string message = complaint;
  for (const std::string& word : app.remaining()) {
    const std::string name = word.substr(0, word.find('='));
    const std::string nearest = name.starts_with("-") ? base::find_nearest(name, known) : "";
    message = name.starts_with("-") ? fmt::format("unknown option {}", name) : fmt::format("unexpected argument '{}'", word);
    message += nearest.empty() ? "; see --help" : fmt::format("; did you mean {}?", nearest);
    break;
  }
  throw InputError(message);
}

/// True for unsupported mesh formats as well; the reader refuses them.
bool is_mesh_name(const std::filesystem::path& file) {
  constexpr std::array<std::string_view, 17> kEndings{".msh", ".vtu", ".mesh", ".node", ".ele", ".meshb", ".vtk",  ".pvtu", ".vtkhdf",
                                                      ".inp", ".bdf", ".nas",  ".unv",  ".med", ".xdmf",  ".cgns", ".exo"};
  const std::string ending = base::find_extension(file);
  return std::find(kEndings.begin(), kEndings.end(), ending) != kEndings.end();
}

/// --coarsen
void write_coarse(const Order& order) {
  if (order.surface.empty()) throw InputError("--coarsen is for surfaces; give a file");
  if (order.out.empty()) throw InputError("-o is missing: give the file for the surface, whose name ends in .off");
  const mesher::TriangleSurface coarse =
      mesher::coarsen(mesher::read_input(order.surface).surface, static_cast<std::size_t>(std::max<std::int64_t>(*order.coarsen, 0)));
  std::string text = fmt::format("OFF\n{} {} 0\n", coarse.points.size(), coarse.triangles.size());
  for (const Vec3& p : coarse.points) text += fmt::format("{:.17g} {:.17g} {:.17g}\n", p[0], p[1], p[2]);
  for (const Triangle& t : coarse.triangles) text += fmt::format("3 {} {} {}\n", t[0], t[1], t[2]);
  base::write_file(order.out, text);
}

/// Sets, regions, unit, materials and supports of a mesh file.
void describe_model(const mesh::TetMesh& mesh, base::Json& root) {
  root.set("node_sets", base::Json::object()).set("regions", base::Json::object());
  for (const auto& [name, nodes] : mesh.node_sets) root["node_sets"].set(base::printable(name), nodes.size());
  for (const auto& [tag, name] : mesh.region_names) root["regions"].set(std::to_string(tag), base::printable(name));
  if (!mesh.unit.empty()) root.set("unit_m", base::finite_or_null(mesh.unit_m, base::significant, 12)).set("unit", mesh.unit);
  if (!mesh.supports.empty()) root.set("supports", mesh.supports);
  if (!mesh.remarks.empty()) root.set("remarks", base::Json::array(mesh.remarks));
  if (mesh.materials.empty()) return;
  const auto number = [](double value) { return base::finite_or_null(value, base::significant, 12); };
  root.set("materials", base::Json::object());
  for (const auto& [tag, material] : mesh.materials) {
    base::Json entry = base::Json::object();
    entry.set("name", base::printable(material.name)).set("young_modulus_pa", number(material.young_modulus_pa));
    entry.set("poisson_ratio", number(material.poisson_ratio)).set("density_kg_m3", number(material.density_kg_m3));
    if (!material.problem.empty()) entry.set("problem", base::printable(material.problem));
    root["materials"].set(std::to_string(tag), entry);
  }
}

/// --look
void print_look(const Order& order) {
  if (order.surface.empty()) throw InputError("--look is for surfaces and meshes; give a file");
  if (is_mesh_name(order.surface)) {
    mesh::TetMesh mesh = mesh::read_mesh(order.surface);
    const mesh::CheckReport check = mesh::check_mesh(mesh, order.surface);
    base::Json root = base::Json::object();
    root.set("mesh", order.surface).set("nodes", check.nodes).set("tets", check.tets).set("parts", check.components);
    root.set("unused_nodes", check.unreferenced).set("extent", base::Json::array(check.box_high - check.box_low));
    describe_model(mesh, root);
    fmt::print("{}\n", root.line());
    return;
  }
  const mesher::SurfaceLook look = mesher::look_at_surface(order.surface);
  base::Json root = base::Json::object();
  root.set("surface", order.surface).set("triangles", look.triangles).set("parts", look.parts).set("openings", look.openings);
  root.set("unused_points", look.unused_points).set("seam_edges", look.seam_edges);
  root.set("extent", base::Json::array(look.extent));
  root.set("thickness", look.thickness > 0.0 ? base::Json(look.thickness) : base::Json());
  fmt::print("{}\n", root.line());
}

void make(int argc, char** argv, Order& order) {
  CLI::App app("Meshes a surface, or a parametric body, with tetrahedra.");
  app.name("carillon-mesh");
  app.footer(describe_shapes());
  app.add_option("SURFACE", order.surface, "Closed surface, or with --wall an open one: OBJ, STL, PLY, OFF, glTF or GLB");
  app.add_option("--shape", order.shape, fmt::format("A parametric body in place of a surface: {}", fmt::join(list_shapes(), ", ")));
  app.add_option("-o,--output", order.out, "The mesh to write, Gmsh 4.1 (.msh) or VTU (.vtu); - is standard output, as Gmsh 4.1");
  app.add_flag("--look", order.look,
               "Prints the contents of a surface or mesh file as JSON, without meshing: triangles, extents in its own units, openings, "
               "parts, and the thickness of a surface that is both sides of a wall; of a mesh nodes, tetrahedra and extents");
  app.add_option("--coarsen", order.coarsen,
                 "Writes the closed surface with about so many corners to an OFF file, the volume kept, without meshing");
  app.add_option("--scale", order.scale, "Surface: metres per unit of the file");
  app.add_option("--up", order.up, "Surface: the axis along which --height is measured [y]")->check(CLI::IsMember({"x", "y", "z"}));
  app.add_option("--method", order.method,
                 "Surface: delaunay (keeps sharp edges and tips), stuffing (fast, rounds edges, cuts thin tips) or extrude (thin walls: "
                 "one layer of elements) [auto]")
      ->check(CLI::IsMember({"auto", "delaunay", "stuffing", "extrude"}));
  app.add_option("--side", order.side,
                 "With --wall: where the surface is in the wall, middle, outside or inside [open surface: middle; closed: outside]")
      ->check(CLI::IsMember({"middle", "outside", "inside"}));
  app.add_option("--nodes", order.nodes, "About how many nodes, mid-side nodes among them (within 10 %)");
  app.add_option("--edge", order.edge, "Length of the edges in metres, in place of --nodes");
  app.add_option("--order", order.order, "1: tetrahedra of four nodes, 2: of ten [2 where a wall is extruded, else 1]")
      ->check(CLI::IsMember({1, 2}));
  app.add_flag("--straight", order.straight, "Order 2: mid-side nodes in the middle of their edges, not on the true surface");
  app.add_flag("--refuse-open", order.refuses_open, "Surface: refuse an open one without --wall, rather than close or wrap it");
  app.add_flag("--facets", order.facets, "Surface: its facets are the body; without this a smooth surface through their corners is");
  app.add_option(
         "--close-holes", order.close_holes,
         "Surface: closes holes up to this part of the body's diagonal (a hole counts as the diameter of a circle of its area) [0.15]")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--json", order.json, "Writes the report as JSON to this file too");
  app.add_option("--result", order.result, "Write how the program ended to this file, a JSON object (docs/howto/jobs.md)");
  app.add_flag("-q,--quiet", order.quiet, "Print nothing but notes on the mesh and errors, on standard error");
  app.set_version_flag("--version", base::describe("carillon-mesh"));
  std::map<std::string, std::string> help{
      {"wall",
       "Surface: thickness in metres of an open sheet, or of the shell inside a closed surface, solid without it. Also of tube, sphere, "
       "bowl "
       "and hollow-box"},
      {"height", "Surface: scales it to this extent in metres along --up. Also a dimension of box, hollow-box and cone"},
      {"radius", "Radius of sphere, cylinder, disc, ring and cone in metres, see below; for tube and bowl the same as --outer-radius"},
      {"opening-angle", "Of a bowl, in degrees; see below"}};
  for (const std::string& name : list_dimensions()) {
    const std::string text = help.contains(name) ? help[name] : "Dimension of shapes in metres; see below";
    app.add_option_function<double>(
        "--" + name, [&order, name](double value) { order.lengths[name] = value; }, text);
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ExtrasError& error) {
    throw_unknown(app, error.what());
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) std::exit(app.exit(error));  // --help or --version
    throw InputError(fmt::format("{}; see carillon-mesh --help", error.what()));
  }
  complete_radius(order);
  if (order.look) return print_look(order);
  if (order.coarsen) return write_coarse(order);
  if (order.out.empty()) throw InputError("-o is missing: give the file for the mesh, whose name ends in .msh or .vtu");
  make_mesh(order);
}

/// Prints an error, writes the result file and returns the exit code.
int end(const Order& order, const base::Result& result) {
  std::fflush(stdout);
  if (result.kind != base::ResultKind::done) fmt::print(stderr, "carillon-mesh: {}\n", base::show_message(result.message));
  if (!order.result.empty()) base::write_result(order.result, result);
  return base::get_exit_code(result.kind);
}

}  // namespace

int main(int argc, char** argv) {
  base::report_file_limit();
  mesher::guard_program("carillon-mesh");
  Order order;
  try {
    make(argc, argv, order);
    return end(order, {});
  } catch (...) {
    return end(order, base::describe_error(std::current_exception(), "out of memory; ask for fewer nodes"));
  }
}
