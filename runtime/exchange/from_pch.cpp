// Method: of the bulk data GRID and CTETRA; of the punch file every block of $EIGENVECTOR, two lines a grid: T1 to T3, and rotations after
//   -CONT-, in fields of 18 columns. Columns 73 to 80 number the lines and are not read.
// Source: MSC Nastran quick reference guide (DISPLACEMENT, PUNCH; GRID, GRDSET, CTETRA); Altair OptiStruct reference, "Punch File".
// Limitation: tetrahedra; real modes of one subcase; basic coordinate system.
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "runtime/base/bdf_cards.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/fields.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/exchange/results_lines.hpp"
#include "runtime/exchange/solved_model.hpp"

namespace carillon::exchange {
namespace {

constexpr std::size_t kWidth = 18, kPunchEnd = 72, kPointType = 17;

/// Nodes and tetrahedra of a Nastran file.
class BdfMesh {
 public:
  BdfMesh(const base::JoinedText& text, const std::string& name) : text_(text), name_(name), cards_(text.text) {}

  void read(SolvedModel& model) {
    cards_.find_bulk();
    bool has_end = false;
    while (!has_end && cards_.next()) {
      if (cards_.name() == "GRID")
        read_grid(model);
      else if (cards_.name() == "CTETRA")
        read_tet(model);
      else if (cards_.name() == "GRDSET")
        check_systems(1, 5);
      else if (cards_.name() == "CHEXA" || cards_.name() == "CPENTA" || cards_.name() == "CPYRAM")
        fail("the mesh holds {}; only tetrahedra are read: mesh the volume with CTETRA", cards_.name());
      has_end = cards_.name() == "ENDDATA";
    }
    if (!has_end)
      throw PlacedError(base::find_place(text_.text, name_, text_.origins, text_.text.size()),
                        "the file ends without ENDDATA; it was cut short: write or copy it again (if it is complete, add ENDDATA)");
    if (model.tets.empty()) throw InputError(fmt::format("{}: the file has no tetrahedra (CTETRA); give the model that was solved", name_));
    for (std::size_t e = 0; e < model.tets.size(); ++e)
      for (std::size_t& node : model.tets[e]) {
        const auto tag = static_cast<std::int64_t>(node);
        const auto found = nodes_.look_up(tag);
        if (!found)
          throw PlacedError(base::find_place(text_.text, name_, text_.origins, places_[e]),
                            fmt::format("node {} of this element is not defined; write the file again with all nodes", tag));
        node = *found;
      }
  }

  std::optional<std::size_t> look_up(std::int64_t tag) const { return nodes_.look_up(tag); }

  template <class... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> format, Args&&... args) const {
    throw PlacedError(base::find_place(text_.text, name_, text_.origins, cards_.place()), fmt::format(format, std::forward<Args>(args)...));
  }

 private:
  std::int64_t get_int(std::size_t i, const char* what) const {
    if (const auto value = base::find_int(cards_.get(i))) return *value;
    fail("expected {}, found '{}'; the card is damaged: write the file again", what, base::printable(cards_.get(i)));
  }

  /// Coordinate systems of position and displacement.
  void check_systems(std::size_t position, std::size_t displacement) const {
    for (const std::size_t i : {position, displacement})
      if (!cards_.get(i).empty() && get_int(i, "a coordinate system") != 0)
        fail("coordinate system {}; write nodes and displacements in the basic system (CP and CD 0)", cards_.get(i));
  }

  void read_grid(SolvedModel& model) {
    const std::int64_t tag = get_int(0, "the number of a node");
    check_systems(1, 5);
    Vec3 x{};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::string_view field = cards_.get(2 + k);
      const auto value = field.empty() ? std::optional(0.0) : base::find_real(field);
      if (!value || !std::isfinite(*value))
        fail("expected a coordinate, found '{}'; the card is damaged: write the file again", base::printable(field));
      x[k] = *value;
    }
    nodes_.add(tag, x, model.nodes);
  }

  void read_tet(SolvedModel& model) {
    const std::int64_t tag = get_int(0, "the number of an element");
    std::vector<std::size_t> tet;
    for (std::size_t i = 2; i < cards_.count() && !cards_.get(i).empty(); ++i)
      tet.push_back(static_cast<std::size_t>(get_int(i, "the number of a node")));  // an index after read()
    if (tet.size() != 4 && tet.size() != 10) fail("CTETRA {} has {} nodes; it needs 4 or 10: write the file again", tag, tet.size());
    model.tets.push_back(std::move(tet));
    places_.push_back(cards_.place());
  }

  const base::JoinedText& text_;
  const std::string& name_;
  base::BdfCards cards_;
  ResultsNodes<BdfMesh> nodes_{*this};
  std::vector<std::size_t> places_;  // of the elements
};

class PchReader {
 public:
  PchReader(std::string_view bytes, const std::string& name, const base::JoinedText& mesh, const std::string& mesh_name)
      : lines_(bytes, name), name_(name), has_end_(bytes.ends_with('\n')), mesh_(mesh, mesh_name), mesh_name_(mesh_name) {}

  SolvedModel read() {
    mesh_.read(model_);
    is_needed_.resize(model_.nodes.size(), 0);
    for (const auto& tet : model_.tets)
      for (const std::size_t node : tet) is_needed_[node] = 1;
    while (!lines_.is_at_end()) {
      const std::string_view line = lines_.next("a block");
      if (line.starts_with('$'))
        read_header(line);
      else if (is_eigenvector_ && !lines_.cut(line, 0, kPunchEnd).empty())
        read_node(line);
      else
        is_in_header_ = false;
    }
    finish_mode();
    if (!has_end_ || is_in_header_) lines_.fail("the file ends within a line or a header; it was cut short: write or copy it again");
    if (model_.modes.empty())
      throw InputError(fmt::format("{}: the file has no real eigenvectors; solve SOL 103 with DISPLACEMENT(SORT1,REAL,PUNCH)=ALL", name_));
    model_.program = "a Nastran punch file";
    return std::move(model_);
  }

 private:
  /// "SUBCASE ID = 1" gives "1" for "SUBCASE ID"; nullopt for another key.
  static std::optional<std::string_view> find_value(std::string_view header, std::string_view key) {
    const std::size_t equals = header.find('=');
    if (equals == std::string_view::npos || base::trim(header.substr(0, equals)) != key) return std::nullopt;
    return base::trim(header.substr(equals + 1));
  }

  void read_header(std::string_view line) {
    if (!is_in_header_) finish_mode();
    is_in_header_ = true;
    const std::string header = base::to_upper(lines_.cut(line, 1, kPunchEnd - 1));
    if (find_value(header, "TITLE")) {
      is_eigenvector_ = false;
    } else if (const auto subcase = find_value(header, "SUBCASE ID")) {
      subcase_ = *subcase;
    } else if (const auto value = find_value(header, "EIGENVALUE")) {
      if (is_eigenvector_) begin_mode(value->substr(0, value->find_first_of(" \t")));
    } else if (header.find('=') == std::string::npos) {
      if (header.ends_with("OUTPUT")) {
        if (is_eigenvector_ && header != "REAL OUTPUT") lines_.fail("complex eigenvectors ({}); solve for real normal modes", header);
      } else {
        is_eigenvector_ = header.starts_with("EIGENVECTOR") && header.find("SOLUTION SET") == std::string::npos;
      }
    } else if (is_eigenvector_ && header.starts_with("COMPLEX")) {
      lines_.fail("complex eigenvalues; solve for real normal modes (SOL 103)");
    } else if (is_eigenvector_ && header.starts_with("POINT ID")) {
      lines_.fail("eigenvectors by point (SORT2); punch them by mode: DISPLACEMENT(SORT1,REAL,PUNCH)=ALL");
    }
  }

  void begin_mode(std::string_view value) {
    if (model_.modes.size() >= kMaxResultModes) lines_.fail("more than {} modes", kMaxResultModes);
    if (!model_.modes.empty() && subcase_ != first_subcase_)
      lines_.fail("modes of subcase {} after those of subcase {}; punch one subcase", base::printable(subcase_),
                  base::printable(first_subcase_));
    first_subcase_ = subcase_;
    const auto eigenvalue = base::find_real(value);
    if (!eigenvalue || !std::isfinite(*eigenvalue))
      lines_.fail("expected an eigenvalue, found '{}'; the file is damaged: write it again", base::printable(value));
    mode_ = {.eigenvalue_rad2_s2 = *eigenvalue, .mass = std::nullopt, .decay_per_s = {}, .shape = std::vector<Vec3>(model_.nodes.size())};
    has_.assign(model_.nodes.size(), 0);
    next_ = 0;
    is_open_ = true;
  }

  void read_node(std::string_view line) {
    is_in_header_ = false;
    if (!is_open_) lines_.fail("displacements before a line $EIGENVALUE; the file is damaged: write it again");
    const bool is_grid = line.size() > kPointType && line[kPointType] == 'G';
    if (is_grid) {
      const auto tag = lines_.number<std::int64_t>(line, 0, kPointType, "the number of a node");
      if (const auto node = find_node(tag)) {
        if (has_[*node] != 0) lines_.fail("node {} a second time in a mode; the file is damaged: write it again", tag);
        mode_.shape[*node] = lines_.vector(line, kWidth, kWidth, "a displacement");
        has_[*node] = 1;
      } else {
        lines_.fail("node {} is not in {}; give the model of these modes", tag, base::printable(mesh_name_));
      }
    } else if (line.size() <= kPointType || line[kPointType] < 'A' || line[kPointType] > 'Z') {
      lines_.fail("expected a node, found '{}'; the file is damaged: write it again", base::printable(lines_.cut(line, 0, kPunchEnd)));
    }
    if (!lines_.next("the displacements of a mode").starts_with("-CONT-"))
      lines_.fail("expected a line -CONT- with rotations; the file is damaged: write it again");
  }

  /// Nodes come in the order of the mesh as a rule.
  std::optional<std::size_t> find_node(std::int64_t tag) {
    if (order_.size() < model_.nodes.size() && model_.modes.empty()) {
      const auto found = mesh_.look_up(tag);
      if (found) order_.emplace_back(tag, *found);
      return found;
    }
    if (next_ < order_.size() && order_[next_].first == tag) return order_[next_++].second;
    return mesh_.look_up(tag);
  }

  void finish_mode() {
    if (!is_open_) return;
    is_open_ = false;
    std::size_t needed = 0, found = 0;
    for (std::size_t i = 0; i < has_.size(); ++i)
      if (is_needed_[i] != 0) {
        ++needed;
        found += has_[i] != 0 ? 1 : 0;
      }
    if (found < needed)
      lines_.fail("mode {} has displacements of {} of {} nodes; punch those of all nodes", model_.modes.size() + 1, found, needed);
    model_.modes.push_back(std::move(mode_));
  }

  ResultsLines lines_;
  const std::string& name_;
  bool has_end_;
  BdfMesh mesh_;
  const std::string& mesh_name_;
  SolvedModel model_;
  std::vector<char> is_needed_;  // (nodes) of a tetrahedron
  std::string subcase_, first_subcase_;
  bool is_in_header_ = true, is_eigenvector_ = false, is_open_ = false;
  SolvedMode mode_;
  std::vector<char> has_;                                    // (nodes) with a displacement in this mode
  std::vector<std::pair<std::int64_t, std::size_t>> order_;  // nodes of the first mode, as they come
  std::size_t next_ = 0;
};

}  // namespace

SolvedModel parse_pch(std::string_view bytes, const std::string& name, const base::JoinedText& mesh, const std::string& mesh_name) {
  return PchReader(bytes, name, mesh, mesh_name).read();
}

}  // namespace carillon::exchange
