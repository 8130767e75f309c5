#include "precompute/run/meshing.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

#include "precompute/mesh/read.hpp"
#include "precompute/mesh/shapes/shapes.hpp"
#include "runtime/base/command.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/result.hpp"
#include "runtime/base/temporary.hpp"

namespace carillon::run {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kKeptBytes = 1 << 16;  // of standard error

/// Runs carillon-mesh and keeps the end of its standard error.
base::Finished run_mesher(const std::vector<std::string>& words) {
  base::Finished finished;
  try {
    finished = base::run({.words = words, .errors = base::kCapture}, {.max_bytes = kKeptBytes, .keeps_tail = true});
  } catch (const base::StartError& error) {
    throw SystemError(fmt::format("{}; it belongs next to this program", error.what()));
  }
  while (!finished.errors.empty() && finished.errors.back() == '\n') finished.errors.pop_back();
  return finished;
}

std::string format_length(double metres) { return fmt::format("{:.17g}", metres); }

/// Moves the mesher's notes and remarks from its standard error to `said`, without repetitions.
void take_words(std::string& errors, MesherWords& said) {
  std::istringstream lines(errors);
  std::string rest;
  for (std::string line; std::getline(lines, line);) {
    bool is_taken = false;
    for (const auto& [begin, texts] :
         {std::pair("carillon-mesh: note: ", &said.warnings), std::pair("carillon-mesh: remark: ", &said.remarks)}) {
      if (!line.starts_with(begin)) continue;
      const std::string text = line.substr(std::strlen(begin));
      if (std::find(texts->begin(), texts->end(), text) == texts->end()) texts->push_back(text);
      is_taken = true;
    }
    if (!is_taken) rest += rest.empty() ? line : "\n" + line;
  }
  errors = std::move(rest);
}

std::vector<std::string> make_mesher_words(const job::Body& body, int order, const Fineness& fineness, const std::string& file) {
  std::vector<std::string> words{
      base::require_program("carillon-mesh").string(), body.surface.string(), "-o", file, "--order", std::to_string(order), "--quiet"};
  const auto add = [&](const char* option, const std::string& value) {
    words.push_back(option);
    words.push_back(value);
  };
  if (body.wall_m) add("--wall", format_length(*body.wall_m));
  if (!body.side.empty()) add("--side", body.side);
  if (body.height_m) add("--height", format_length(*body.height_m));
  if (body.scale) add("--scale", format_length(*body.scale));
  if (body.close_holes) add("--close-holes", format_length(*body.close_holes));
  if (!body.close_holes && !body.wall_m) words.emplace_back("--refuse-open");
  if (body.facets) words.emplace_back("--facets");
  add("--result", file + ".result");
  add("--up", body.up);
  add("--method", fineness.extrudes ? "extrude" : body.method);
  if (fineness.nodes) add("--nodes", std::to_string(*fineness.nodes));
  if (fineness.edge_m) add("--edge", format_length(*fineness.edge_m));
  return words;
}

/// Throws for a failed carillon-mesh.
[[noreturn]] void fail(const job::Body& body, const base::Finished& ended, const std::optional<base::Result>& result) {
  const std::string failed = fmt::format("{}: the body cannot be meshed", body.place);
  if (ended.signal == 0) {
    base::Result reason =
        result.value_or(base::Result{.kind = ended.exit_code == kExitInput ? base::ResultKind::bad_input : base::ResultKind::system});
    if (reason.message.empty()) reason.message = ended.errors.empty() ? "carillon-mesh gave no reason" : ended.errors;
    reason.message = fmt::format("{}: {}", failed, reason.message);
    reason.place.clear();  // the job's place is already in front
    base::throw_error(reason);
  }
  const int signal = ended.signal;
  // Signals raised by the process itself are caused by the surface, others come from outside.
  const bool is_own =
      signal == SIGSEGV || signal == SIGBUS || signal == SIGABRT || signal == SIGFPE || signal == SIGILL || signal == SIGXCPU;
  const std::string printed = ended.errors.empty() ? "" : fmt::format(" after it wrote '{}'", ended.errors);
  if (is_own)
    throw InputError(
        fmt::format("{}: carillon-mesh crashed on {}, by signal {} ({}){}; ask for another number of nodes, try \"method\": "
                    "\"stuffing\", or repair the surface in a modeller",
                    failed, body.surface.string(), signal, ::strsignal(signal), printed));
  throw SystemError(fmt::format("{}: carillon-mesh was ended from outside, by signal {} ({}){}; out of memory?", failed, signal,
                                ::strsignal(signal), printed));
}

mesh::TetMesh mesh_surface(const job::Body& body, int order, const Fineness& fineness, MesherWords& said) {
  const base::TemporaryFolder folder("carillon-mesh-");
  const std::string file = (folder.path() / "body.msh").string();
  base::Finished ended = run_mesher(make_mesher_words(body, order, fineness, file));
  const std::optional<base::Result> result = base::read_result(file + ".result");
  take_words(ended.errors, said);
  if (ended.exit_code != 0) fail(body, ended, result);
  return mesh::read_mesh(file);
}

}  // namespace

mesh::TetMesh make_body_mesh(const job::Body& body, int order, const Fineness& fineness, MesherWords& words) {
  if (body.shape.empty()) return mesh_surface(body, order, fineness, words);
  shapes::ShapeOptions options{.shape = body.shape, .dimensions = body.dimensions, .order = order};
  options.target_nodes = fineness.nodes;
  options.edge_m = fineness.edge_m;
  options.layers = fineness.layers;
  try {
    return shapes::make_shape(options);
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: key 'body': {}", body.place, error.what()));
  }
}

std::pair<std::vector<Vec3>, std::vector<Triangle>> coarsen_surface(const std::vector<Vec3>& nodes_m,
                                                                    const std::vector<Triangle>& triangles, std::size_t nodes) {
  const base::TemporaryFolder folder("carillon-mesh-");
  const std::string file = (folder.path() / "fine.off").string(), coarse = (folder.path() / "coarse.off").string();
  std::string text = fmt::format("OFF\n{} {} 0\n", nodes_m.size(), triangles.size());
  for (const Vec3& p : nodes_m) text += fmt::format("{:.17g} {:.17g} {:.17g}\n", p[0], p[1], p[2]);
  for (const Triangle& t : triangles) text += fmt::format("3 {} {} {}\n", t[0], t[1], t[2]);
  base::write_file(file, text);
  const base::Finished ended =
      run_mesher({base::require_program("carillon-mesh").string(), file, "--coarsen", std::to_string(nodes), "-o", coarse, "--quiet"});
  std::ifstream stream(coarse);
  std::pair<std::vector<Vec3>, std::vector<Triangle>> made;
  std::string word;
  std::size_t points = 0, facets = 0, none = 0;
  if (ended.exit_code == 0 && stream >> word >> points >> facets >> none) {
    made.first.resize(points);
    made.second.resize(facets);
    for (Vec3& p : made.first) stream >> p[0] >> p[1] >> p[2];
    for (Triangle& t : made.second) stream >> none >> t[0] >> t[1] >> t[2];
  }
  const bool is_read = !made.second.empty() && !stream.fail();
  if (!is_read)
    throw InputError(fmt::format("the surface of {} nodes cannot be coarsened to {}: {}; give \"radiation\" a larger \"skin_nodes\"",
                                 nodes_m.size(), nodes, ended.errors.empty() ? "carillon-mesh gave no reason" : ended.errors));
  return made;
}

std::string describe(const job::Body& body, const Fineness& fineness) {
  const std::string name = body.shape.empty() ? body.surface.string() : body.shape;
  if (fineness.nodes) return fmt::format("{}, {} nodes wanted", name, *fineness.nodes);
  if (fineness.edge_m) return fmt::format("{}, edges of {:.4g} m", name, *fineness.edge_m);
  return name;
}

}  // namespace carillon::run
