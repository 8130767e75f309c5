// Method: blocks of fixed columns: nodes (2C), elements (3C), of every mode the eigenvalue (1PGK), the generalised mass (1PGM) and the
//   displacement (-4 DISP).
// Source: G. Dhondt, CalculiX GraphiX 2.20 user's manual, "Result Format".
// Limitation: ASCII; tetrahedra; no cyclic symmetry.
#include "runtime/exchange/results_lines.hpp"
#include "runtime/exchange/solved_model.hpp"

namespace carillon::exchange {
namespace {

constexpr int kFrdTet4 = 3, kFrdTet10 = 6;

class FrdReader {
 public:
  FrdReader(std::string_view bytes, const std::string& name) : lines_(bytes, name), name_(name) {}

  SolvedModel read() {
    while (read_block()) {
    }
    if (model_.modes.empty())
      throw InputError(fmt::format("{}: the file has no modes; solve a *FREQUENCY step with *NODE FILE and U", name_));
    if (model_.tets.empty()) throw InputError(fmt::format("{}: the file has no tetrahedra; mesh the volume with C3D4 or C3D10", name_));
    model_.program = program_.empty() ? "CalculiX" : program_ + (version_.empty() ? "" : " " + version_);
    return std::move(model_);
  }

 private:
  void check_format(std::string_view line) const {
    while (line.ends_with(' ')) line.remove_suffix(1);
    if (!line.ends_with('1')) lines_.fail("the block is in binary or short form; write the results in ASCII, as ccx does by itself");
  }

  /// False at the end of the results.
  bool read_block() {
    const std::string_view line = lines_.next("its header");
    const std::string_view key = lines_.cut(line, 0, 6);
    if (key == "2C") {
      check_format(line);
      read_nodes();
    } else if (key == "3C") {
      check_format(line);
      read_elements();
    } else if (line.starts_with("    1UPGM")) {
      program_ = lines_.cut(line, 24, 48);
    } else if (line.starts_with("    1UVERSION")) {
      version_ = lines_.cut(line, 24, 48);
      if (version_.starts_with("Version ")) version_.erase(0, 8);
    } else if (line.starts_with("    1PGM")) {
      mass_ = lines_.number<double>(line, 12, 40, "a generalised mass");
      if (!(mass_ > 0.0) || !std::isfinite(mass_)) lines_.fail("a generalised mass of {:g}; solve the model again", mass_);
    } else if (line.starts_with("    1PGK")) {
      stiffness_ = lines_.number<double>(line, 12, 40, "a generalised stiffness");
      has_mode_ = true;
    } else if (line.starts_with("    1PHID")) {
      if (lines_.number<std::int64_t>(line, 12, 40, "a nodal diameter") > 0)
        lines_.fail("modes of a sector in cyclic symmetry; solve the whole body");
    } else if (line.starts_with("  100C")) {
      check_format(line);
    } else if (line.starts_with(" -4")) {
      read_values(lines_.cut(line, 5, 8));
    }
    return !line.starts_with(" 9999");
  }

  void read_nodes() {
    if (!model_.nodes.empty()) lines_.fail("a second block of nodes; write one result");
    for (;;) {
      const std::string_view line = lines_.next("the nodes");
      if (line.starts_with(" -3")) return;
      const auto tag = lines_.number<std::int64_t>(line, 3, 10, "the number of a node");
      nodes_.add(tag, lines_.vector(line, 13, 12, "a coordinate"), model_.nodes);
    }
  }

  void read_elements() {
    for (;;) {
      std::string_view line = lines_.next("the elements");
      if (line.starts_with(" -3")) return;
      const auto tag = lines_.number<std::int64_t>(line, 3, 10, "the number of an element");
      const int type = lines_.number<int>(line, 13, 5, "the type of an element");
      if (type == 1 || type == 2 || type == 4 || type == 5)
        lines_.fail("element {} is a {}; only tetrahedra are read: mesh the volume with C3D4 or C3D10", tag,
                    type == 1 || type == 4 ? "hexahedron" : "wedge");
      const std::size_t count = type == kFrdTet4 ? 4 : type == kFrdTet10 ? 10 : 0;
      std::vector<std::size_t> tet;
      do {
        line = lines_.next("the elements");
        if (!line.starts_with(" -2")) lines_.fail("the nodes of element {} are missing; write the file again", tag);
        for (std::size_t at = 3; tet.size() < count && !lines_.cut(line, at, 10).empty(); at += 10)
          tet.push_back(nodes_.find(lines_.number<std::int64_t>(line, at, 10, "a node of an element")));
      } while (tet.size() < count);
      if (count > 0) model_.tets.push_back(std::move(tet));
    }
  }

  void read_values(std::string_view kind) {
    const bool is_mode = kind == "DISP" && has_mode_;
    if (is_mode && model_.modes.size() >= kMaxResultModes) lines_.fail("more than {} modes", kMaxResultModes);
    std::vector<Vec3> shape(is_mode ? model_.nodes.size() : 0);
    std::size_t found = 0;
    for (;;) {
      const std::string_view line = lines_.next("the displacements of a mode");
      if (line.starts_with(" -3")) break;
      if (!is_mode || !line.starts_with(" -1")) continue;
      shape[nodes_.find(lines_.number<std::int64_t>(line, 3, 10, "the number of a node"))] = lines_.vector(line, 13, 12, "a displacement");
      ++found;
    }
    if (!is_mode) return;
    if (found < model_.nodes.size())
      lines_.fail("mode {} has displacements of {} of {} nodes; write U of all nodes", model_.modes.size() + 1, found, model_.nodes.size());
    model_.modes.push_back({.eigenvalue_rad2_s2 = stiffness_ / mass_, .mass = mass_, .decay_per_s = {}, .shape = std::move(shape)});
    has_mode_ = false;
    mass_ = 1.0;
  }

  ResultsLines lines_;
  const std::string& name_;
  ResultsNodes<ResultsLines> nodes_{lines_};
  SolvedModel model_;
  std::string program_, version_;
  double stiffness_ = 0.0, mass_ = 1.0;
  bool has_mode_ = false;
};

}  // namespace

SolvedModel parse_frd(std::string_view bytes, const std::string& name) { return FrdReader(bytes, name).read(); }

}  // namespace carillon::exchange
