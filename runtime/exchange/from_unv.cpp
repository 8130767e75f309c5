// Method: datasets between lines "    -1", each with its number first: nodes (2411), elements (2412), and of every mode the displacements
//   of the nodes (55); others are skipped. Modal damping of the file is used where it has any.
// Source: Universal file datasets, SDRC I-DEAS (University of Cincinnati, SDRL). Quadratic tetrahedra (118) go round the base.
// Limitation: tetrahedra; real normal modes.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "runtime/exchange/results_lines.hpp"
#include "runtime/exchange/solved_model.hpp"

namespace carillon::exchange {
namespace {

constexpr int kUnvTet4 = 111, kUnvTet10 = 118;
constexpr std::array<int, 10> kRoundBase{0, 2, 4, 9, 1, 3, 5, 6, 7, 8};  // positions of our nodes
constexpr int kNormalModes = 2, kComplexModes = 3, kSecondOrderComplexModes = 7, kDisplacements = 8, kReal = 2;

bool is_beam(int type) { return type == 11 || (type >= 21 && type <= 24); }
/// Hexahedra, wedges and pyramids.
bool is_other_solid(int type) { return (type >= 101 && type <= 117 && type != kUnvTet4) || type == 312 || type == 313; }

class UnvReader {
 public:
  UnvReader(std::string_view bytes, const std::string& name) : lines_(bytes, name), name_(name) {}

  SolvedModel read() {
    while (!lines_.is_at_end()) {
      const std::string_view mark = lines_.next("its header");
      if (lines_.cut(mark, 0, 80).empty()) continue;
      if (!is_mark(mark)) lines_.fail("a dataset begins with a line -1; this is no universal file, or it is damaged");
      read_dataset(lines_.number<int>(lines_.next("the number of a dataset"), 0, 80, "the number of a dataset"));
    }
    if (model_.modes.empty())
      throw InputError(fmt::format("{}: the file has no modes (dataset 55, real normal modes, displacements); write them", name_));
    if (model_.tets.empty())
      throw InputError(fmt::format("{}: the file has no tetrahedra (dataset 2412, elements 111 or 118); write the mesh too", name_));
    for (SolvedMode& mode : model_.modes)
      if (mode.mass) *mode.mass *= mass_unit_;
    model_.program = "a universal file";
    return std::move(model_);
  }

 private:
  bool is_mark(std::string_view line) const { return lines_.cut(line, 0, 80) == "-1"; }

  template <class T = int>
  T field(std::string_view line, std::size_t index, const char* what) const {
    return lines_.number<T>(line, 10 * index, 10, what);
  }

  void read_dataset(int number) {
    if (number == 164) return read_units();
    if (number == 2411) return read_nodes();
    if (number == 2412) return read_elements();
    if (number == 55) return read_values();
    while (!is_mark(lines_.next("a dataset"))) {
    }
  }

  /// Metres or millimetres, with any unit of force.
  void read_units() {
    const FileUnits units = lines_.read_units();
    const auto is = [&](double wanted) { return std::abs(units.per_metre - wanted) <= 1e-6 * wanted; };
    if (!is(1.0) && !is(1000.0))
      lines_.fail("the factor of lengths is {:g}; only 1 (metres) and 1000 (millimetres) are read: write the model in one of them",
                  units.per_metre);
    model_.units = is(1.0) ? ModelUnits::kMetre : ModelUnits::kMillimetre;
    mass_unit_ = 1.0 / units.per_newton;  // newton s^2 / length is a kilogram or a tonne
    while (!is_mark(lines_.next("the units"))) {
    }
  }

  void read_nodes() {
    for (std::string_view line = lines_.next("the nodes"); !is_mark(line); line = lines_.next("the nodes")) {
      const auto tag = field<std::int64_t>(line, 0, "the number of a node");
      nodes_.add(tag, lines_.vector(lines_.next("the nodes"), 0, 25, "a coordinate"), model_.nodes);
    }
  }

  void read_elements() {
    for (std::string_view line = lines_.next("the elements"); !is_mark(line); line = lines_.next("the elements")) {
      const auto tag = field<std::int64_t>(line, 0, "the number of an element");
      const int type = field(line, 1, "the type of an element");
      const auto count = field<std::size_t>(line, 5, "the number of nodes of an element");
      if (is_other_solid(type)) lines_.fail("element {} is of type {}; only tetrahedra are read, 111 and 118", tag, type);
      if (is_beam(type)) (void)lines_.next("the elements");
      const std::size_t expected = type == kUnvTet4 ? 4 : type == kUnvTet10 ? 10 : 0;
      if (expected > 0 && count != expected) lines_.fail("element {} of type {} has {} nodes instead of {}", tag, type, count, expected);
      std::vector<std::size_t> nodes;
      std::string_view record;
      for (std::size_t i = 0; i < count; ++i) {
        if (i % 8 == 0) record = lines_.next("the elements");
        if (expected > 0) nodes.push_back(nodes_.find(field<std::int64_t>(record, i % 8, "a node of an element")));
      }
      if (type == kUnvTet4) {
        model_.tets.push_back(std::move(nodes));
      } else if (type == kUnvTet10) {
        std::vector<std::size_t>& tet = model_.tets.emplace_back();
        for (const int at : kRoundBase) tet.push_back(nodes[at]);
      }
    }
  }

  void read_values() {
    for (int k = 0; k < 5; ++k) (void)lines_.next("the names of a dataset 55");
    const std::string_view kind = lines_.next("a dataset 55");
    const int analysis = field(kind, 1, "an analysis type"), quantity = field(kind, 3, "a data type"),
              form = field(kind, 4, "a number type");
    const auto values = field<std::size_t>(kind, 5, "the number of values of a node");
    if ((analysis == kComplexModes || analysis == kSecondOrderComplexModes) && quantity == kDisplacements)
      lines_.fail("complex modes are not read; write real normal modes");
    const bool is_mode = analysis == kNormalModes && quantity == kDisplacements;
    if (is_mode && form != kReal) lines_.fail("normal modes with complex values are not read; write real ones");
    if (is_mode && values != 3 && values != 6) lines_.fail("{} values of a node; write 3 displacements, or 6 with rotations", values);
    (void)lines_.next("a dataset 55");  // counts, load case, number of the mode
    const std::string_view numbers = lines_.next("a dataset 55");
    if (!is_mode) {
      while (!is_mark(lines_.next("a dataset 55"))) {
      }
      return;
    }
    if (model_.nodes.empty()) lines_.fail("modes before the nodes (dataset 2411); write the mesh first");
    if (model_.modes.size() >= kMaxResultModes) lines_.fail("more than {} modes", kMaxResultModes);
    read_mode(numbers);
  }

  void read_mode(std::string_view numbers) {
    SolvedMode mode;
    const double omega = 2.0 * std::numbers::pi * lines_.number<double>(numbers, 0, 13, "a frequency");
    const double mass = lines_.number<double>(numbers, 13, 13, "a modal mass");
    mode.mass = mass;
    const double viscous = lines_.number<double>(numbers, 26, 13, "a damping ratio"),
                 hysteretic = lines_.number<double>(numbers, 39, 13, "a hysteretic damping ratio");
    if (!std::isfinite(omega)) lines_.fail("a frequency that is not finite; solve the model again");
    if (!(mass > 0.0) || !std::isfinite(mass)) lines_.fail("a modal mass of {:g}; write the modes with their masses", mass);
    if (!(viscous >= 0.0 && viscous < 1.0 && hysteretic >= 0.0 && hysteretic < 1.0))
      lines_.fail("damping ratios of {:g} and {:g}; they lie within 0 and 1", viscous, hysteretic);
    mode.eigenvalue_rad2_s2 = omega * omega;
    if (viscous + hysteretic > 0.0) mode.decay_per_s = (viscous + 0.5 * hysteretic) * omega;
    mode.shape.resize(model_.nodes.size());
    std::vector<char> has(model_.nodes.size(), 0);
    for (std::string_view line = lines_.next("a mode"); !is_mark(line); line = lines_.next("a mode")) {
      const std::size_t node = nodes_.find(field<std::int64_t>(line, 0, "the number of a node"));
      mode.shape[node] = lines_.vector(lines_.next("a mode"), 0, 13, "a displacement");
      has[node] = 1;
    }
    if (const auto found = std::count(has.begin(), has.end(), 1); found < std::ssize(has))
      lines_.fail("mode {} has displacements of {} of {} nodes; write those of all nodes", model_.modes.size() + 1, found, has.size());
    model_.modes.push_back(std::move(mode));
  }

  ResultsLines lines_;
  const std::string& name_;
  ResultsNodes<ResultsLines> nodes_{lines_};
  SolvedModel model_;
  double mass_unit_ = 1.0;  // kilograms or tonnes of a mode's mass
};

}  // namespace

SolvedModel parse_unv(std::string_view bytes, const std::string& name) { return UnvReader(bytes, name).read(); }

}  // namespace carillon::exchange
