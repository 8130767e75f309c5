#include "precompute/run/meshing.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string_view>
#include <vector>

#include "precompute/mesh/read.hpp"
#include "precompute/mesh/shapes/shapes.hpp"
#include "runtime/base/command.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/result.hpp"
#include "runtime/base/temporary.hpp"

namespace carillon::run {
namespace {

namespace fs = std::filesystem;

// Beyond the time for the mesh: for the surface as it was read, should its repair not end, and for its reading.
constexpr double kLonger = 1.2, kRoughSeconds = 1.5, kReadSeconds = 2.5, kMinReadSeconds = 8;

constexpr std::size_t kKeptBytes = 1 << 16;  // of carillon-mesh's standard error

/// Runs carillon-mesh and keeps the end of its standard error. Once `may_stop` says so it is killed.
base::Finished run_mesher(const std::vector<std::string>& words, const std::function<bool(const std::string& errors)>& may_stop) {
  base::RunOptions options{.max_bytes = kKeptBytes, .keeps_tail = true};
  if (may_stop) options.may_stop = [&](const base::Finished& now) { return may_stop(now.errors); };
  base::Finished finished;
  try {
    finished = base::run({.words = words, .errors = base::kCapture}, options);
  } catch (const base::StartError& error) {
    throw SystemError(fmt::format("{}; it belongs next to this program", error.what()));
  }
  while (!finished.errors.empty() && finished.errors.back() == '\n') finished.errors.pop_back();
  return finished;
}

std::string format_length(double metres) { return fmt::format("{:.17g}", metres); }

// What carillon-mesh --estimate prints, each on a line of its own, before an object.
constexpr std::string_view kRoughWord = "rough {", kEstimateWord = "estimate {";

bool has_line(const std::string& errors, std::string_view word) {
  return errors.starts_with(word) || errors.find("\n" + std::string(word)) != std::string::npos;
}

/// The object of the line that begins with `word`, which is taken away.
std::optional<base::Document> take_object(std::string& errors, std::string_view word) {
  if (!has_line(errors, word)) return std::nullopt;
  const std::size_t begin = errors.starts_with(word) ? 0 : errors.find("\n" + std::string(word)) + 1;
  const std::size_t end = std::min(errors.find('\n', begin), errors.size());
  const std::size_t brace = begin + word.size() - 1;
  const std::string text = errors.substr(brace, end - brace);
  errors.erase(begin, end + 1 - begin);
  return base::parse_document(text, "carillon-mesh --estimate");
}

constexpr std::int64_t kMaxCount = 1'000'000'000'000'000;

std::optional<BodyEstimate> take_estimate(std::string& errors, std::string_view word) {
  std::optional<base::Document> object = take_object(errors, word);
  if (!object) return std::nullopt;
  base::Object root = object->root();
  BodyEstimate estimate;
  estimate.volume_m3 = root.number("volume_m3", base::kPositive);
  estimate.area_m2 = root.number("area_m2", base::kPositive);
  estimate.thickness_m = root.number("thickness_m", base::kPositive);
  estimate.nodes = root.integer("nodes", 1, kMaxCount);
  estimate.is_rough = word == kRoughWord;
  return estimate;
}

/// Moves the mesher's sentences about the mesh from its standard error to `said`, without repetitions.
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

mesh::TetMesh mesh_surface(const job::Body& body, int order, const Fineness& fineness, MesherWords& said, Patience* patience) {
  const base::TemporaryFolder folder("carillon-mesh-");
  const std::string file = (folder.path() / "body.msh").string();
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
  const std::string result_file = file + ".result";
  add("--result", result_file);
  add("--up", body.up);
  add("--method", body.method);
  if (fineness.nodes) add("--nodes", std::to_string(*fineness.nodes));
  if (fineness.edge_m) add("--edge", format_length(*fineness.edge_m));
  std::function<bool(const std::string&)> may_stop;
  double max_s = 0;
  if (patience != nullptr) {
    words.push_back("--estimate");
    max_s = std::max(kLonger * patience->seconds + kReadSeconds, kMinReadSeconds);
    may_stop = [seconds = patience->seconds, max_s, start = std::chrono::steady_clock::now()](const std::string& errors) {
      const double taken = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      if (taken > seconds && has_line(errors, kEstimateWord)) return true;
      return taken > max_s || (taken > kLonger * seconds + kRoughSeconds && has_line(errors, kRoughWord));
    };
  }
  base::Finished ended = run_mesher(words, may_stop);
  const std::optional<base::Result> result = base::read_result(result_file);
  take_words(ended.errors, said);
  if (patience != nullptr) {
    const std::optional<BodyEstimate> rough = take_estimate(ended.errors, kRoughWord), good = take_estimate(ended.errors, kEstimateWord);
    if (ended.was_stopped) {
      if (!good && !rough)
        throw InputError(fmt::format(
            "{}: the surface is not even read after {:.0f} s; give more time (--patience), decimate it, or mesh it beforehand by "
            "carillon-mesh and name the \"mesh\"",
            body.place, max_s));
      patience->estimate = good ? good : rough;
      return {};
    }
  }
  if (ended.exit_code == 0) return mesh::read_mesh(file);
  const std::string failed = fmt::format("{}: the body cannot be meshed", body.place);
  if (ended.signal == 0) {
    base::Result reason =
        result.value_or(base::Result{.kind = ended.exit_code == kExitInput ? base::ResultKind::bad_input : base::ResultKind::system});
    if (reason.message.empty()) reason.message = ended.errors.empty() ? "carillon-mesh gave no reason" : ended.errors;
    reason.message = fmt::format("{}: {}", failed, reason.message);
    reason.place.clear();  // the job's is in front
    base::throw_error(reason);
  }
  const int signal = ended.signal;
  // It says itself where it broke down, if it still can; a signal that it sends itself comes from the surface, one from outside does not.
  const bool is_own =
      signal == SIGSEGV || signal == SIGBUS || signal == SIGABRT || signal == SIGFPE || signal == SIGILL || signal == SIGXCPU;
  const std::string printed = ended.errors.empty() ? "" : fmt::format(" after it wrote '{}'", ended.errors);
  if (is_own)
    throw InputError(
        fmt::format("{}: carillon-mesh crashed on {}, by signal {} ({}){}; ask for another number of nodes, try \"method\": "
                    "\"stuffing\", or repair the surface in a modeller",
                    failed, body.surface.string(), signal, ::strsignal(signal), printed));
  throw SystemError(fmt::format("{}: carillon-mesh was ended from outside, by signal {} ({}){}; did memory run out?", failed, signal,
                                ::strsignal(signal), printed));
}

}  // namespace

mesh::TetMesh make_body_mesh(const job::Body& body, int order, const Fineness& fineness, MesherWords& words, Patience* patience) {
  if (body.shape.empty()) return mesh_surface(body, order, fineness, words, patience);
  shapes::ShapeOptions options{.shape = body.shape, .dimensions = body.dimensions, .order = order};
  options.target_nodes = fineness.nodes;
  options.edge_m = fineness.edge_m;
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
      run_mesher({base::require_program("carillon-mesh").string(), file, "--coarsen", std::to_string(nodes), "-o", coarse, "--quiet"}, {});
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
