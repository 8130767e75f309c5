// Method: blocks of fixed columns: nodes (2C), elements (3C), of every mode the eigenvalue (1PGK), the generalised mass (1PGM) and the
//   displacement (-4 DISP). Shapes are divided by the root of the mass. Rigid modes are those below 1e-8 of the highest eigenvalue.
// Source: G. Dhondt, CalculiX GraphiX 2.20 user's manual, "Result Format".
// Limitation: ASCII; tetrahedra; no cyclic symmetry. The faces of ten-node tetrahedra become four flat triangles.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numbers>
#include <unordered_map>

#include "runtime/bank/of_material.hpp"
#include "runtime/bank/radiation_gain.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/sort_order.hpp"
#include "runtime/exchange/frd.hpp"
#include "runtime/exchange/solid.hpp"

namespace carillon::exchange {
namespace {

constexpr double kRigidShare = 1e-8;    // of the highest eigenvalue
constexpr double kLargestUnits = 10.0;  // of a body whose units are not given
constexpr std::size_t kMaxFrdNodes = 50'000'000, kMaxFrdModes = 40'000;
constexpr std::array<std::array<int, 3>, 4> kFaces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};  // outward
constexpr int kTet4 = 3, kTet10 = 6;

/// Position of the mid node of an edge among the nodes of a ten-node tetrahedron.
int find_middle(int a, int b) {
  constexpr int kMiddle[4][4] = {{0, 4, 6, 7}, {4, 0, 5, 8}, {6, 5, 0, 9}, {7, 8, 9, 0}};
  return kMiddle[a][b];
}

struct Mode {
  double lambda = 0.0, mass = 1.0;
  std::vector<Vec3> shape;  // (nodes)
};

class FrdReader {
 public:
  FrdReader(std::string_view bytes, const std::string& name, const FrdReading& reading) : bytes_(bytes), name_(name), reading_(reading) {}

  bank::Bank read(std::vector<std::string>* notes) {
    parse();
    bank::Bank bank = make();
    if (notes != nullptr) *notes = notes_;
    return bank;
  }

 private:
  template <class... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> format, Args&&... args) const {
    throw PlacedError(fmt::format("{}:{}", name_, line_number_), fmt::format(format, std::forward<Args>(args)...));
  }

  /// The next line; InputError at the end.
  std::string_view next(const char* block) {
    if (at_ >= bytes_.size()) fail("the file ends within {}; it was cut short: write or copy it again", block);
    const std::size_t end = std::min(bytes_.find('\n', at_), bytes_.size());
    std::string_view line = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    ++line_number_;
    if (line.ends_with('\r')) line.remove_suffix(1);
    return line;
  }

  static std::string_view cut(std::string_view line, std::size_t begin, std::size_t width) {
    std::string_view field = begin < line.size() ? line.substr(begin, width) : std::string_view();
    while (!field.empty() && field.front() == ' ') field.remove_prefix(1);
    while (!field.empty() && field.back() == ' ') field.remove_suffix(1);
    return field;
  }

  template <class T>
  T number(std::string_view line, std::size_t begin, std::size_t width, const char* what) const {
    std::string_view field = cut(line, begin, width);
    const std::string_view whole = field;
    if (field.size() > 1 && field[0] == '+') field.remove_prefix(1);
    T value{};
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    if (error != std::errc{} || end != field.data() + field.size())
      fail("expected {}, found '{}'; the file is damaged: write it again", what, base::printable(std::string(whole)));
    return value;
  }

  Vec3 vector(std::string_view line, const char* what) const {
    Vec3 x{};
    for (std::size_t k = 0; k < 3; ++k) {
      x[k] = number<double>(line, 13 + 12 * k, 12, what);
      if (!std::isfinite(x[k])) fail("{} is not finite; correct the model and solve it again", what);
    }
    return x;
  }

  std::size_t find_node(std::int64_t tag) const {
    const auto found = node_of_.find(tag);
    if (found == node_of_.end()) fail("node {} is not among the nodes of the file; write it again", tag);
    return found->second;
  }

  void check_format(std::string_view line) const {
    while (line.ends_with(' ')) line.remove_suffix(1);
    if (!line.ends_with('1')) fail("the block is in binary or short form; write the results in ASCII, as ccx does by itself");
  }

  void parse() {
    bool has_end = false;
    while (!has_end) {
      const std::string_view line = next("its header");
      const std::string_view key = cut(line, 0, 6);
      if (key == "2C") {
        check_format(line);
        read_nodes();
      } else if (key == "3C") {
        check_format(line);
        read_elements();
      } else if (line.starts_with("    1UPGM")) {
        program_ = cut(line, 24, 48);
      } else if (line.starts_with("    1UVERSION")) {
        version_ = cut(line, 24, 48);
        if (version_.starts_with("Version ")) version_.erase(0, 8);
      } else if (line.starts_with("    1PGM")) {
        mass_ = number<double>(line, 12, 40, "a generalised mass");
        if (!(mass_ > 0.0) || !std::isfinite(mass_)) fail("a generalised mass of {:g}; solve the model again", mass_);
      } else if (line.starts_with("    1PGK")) {
        lambda_ = number<double>(line, 12, 40, "a generalised stiffness");
        has_mode_ = true;
      } else if (line.starts_with("    1PHID")) {
        if (number<std::int64_t>(line, 12, 40, "a nodal diameter") > 0) fail("modes of a sector in cyclic symmetry; solve the whole body");
      } else if (line.starts_with("  100C")) {
        check_format(line);
      } else if (line.starts_with(" -4")) {
        read_values(cut(line, 5, 8));
      } else if (line.starts_with(" 9999")) {
        has_end = true;
      }
    }
    if (modes_.empty()) throw InputError(fmt::format("{}: the file has no modes; solve a *FREQUENCY step with *NODE FILE and U", name_));
    if (tets_.empty()) throw InputError(fmt::format("{}: the file has no tetrahedra; mesh the volume with C3D4 or C3D10", name_));
  }

  void read_nodes() {
    if (!nodes_.empty()) fail("a second block of nodes; write one result");
    for (;;) {
      const std::string_view line = next("the nodes");
      if (line.starts_with(" -3")) return;
      const auto tag = number<std::int64_t>(line, 3, 10, "the number of a node");
      if (nodes_.size() >= kMaxFrdNodes) fail("more than {} nodes", kMaxFrdNodes);
      if (!node_of_.try_emplace(tag, nodes_.size()).second) fail("node {} is defined a second time; write the file again", tag);
      nodes_.push_back(vector(line, "a coordinate"));
    }
  }

  void read_elements() {
    for (;;) {
      std::string_view line = next("the elements");
      if (line.starts_with(" -3")) return;
      const auto tag = number<std::int64_t>(line, 3, 10, "the number of an element");
      const int type = number<int>(line, 13, 5, "the type of an element");
      if (type == 1 || type == 2 || type == 4 || type == 5)
        fail("element {} is a {}; only tetrahedra are read: mesh the volume with C3D4 or C3D10", tag,
             type == 1 || type == 4 ? "hexahedron" : "wedge");
      const std::size_t count = type == kTet4 ? 4 : type == kTet10 ? 10 : 0;
      std::vector<std::size_t> tet;
      do {
        line = next("the elements");
        if (!line.starts_with(" -2")) fail("the nodes of element {} are missing; write the file again", tag);
        for (std::size_t at = 3; tet.size() < count && !cut(line, at, 10).empty(); at += 10)
          tet.push_back(find_node(number<std::int64_t>(line, at, 10, "a node of an element")));
      } while (tet.size() < count);
      if (count == 0) continue;
      if (!tets_.empty() && tets_.front().size() != count) fail("element {} has another order than those before it; use one", tag);
      tets_.push_back(std::move(tet));
    }
  }

  void read_values(std::string_view kind) {
    const bool is_mode = kind == "DISP" && has_mode_;
    if (is_mode && modes_.size() >= kMaxFrdModes) fail("more than {} modes", kMaxFrdModes);
    std::vector<Vec3> shape(is_mode ? nodes_.size() : 0);
    std::size_t found = 0;
    for (;;) {
      const std::string_view line = next("the displacements of a mode");
      if (line.starts_with(" -3")) break;
      if (!is_mode || !line.starts_with(" -1")) continue;
      shape[find_node(number<std::int64_t>(line, 3, 10, "the number of a node"))] = vector(line, "a displacement");
      ++found;
    }
    if (!is_mode) return;
    if (found < nodes_.size())
      fail("mode {} has displacements of {} of {} nodes; write U of all nodes", modes_.size() + 1, found, nodes_.size());
    modes_.push_back({lambda_, mass_, std::move(shape)});
    has_mode_ = false;
    mass_ = 1.0;
  }

  /// Outer faces, those of one tetrahedron, as triangles of node indices.
  std::vector<Triangle> find_surface() const {
    struct Face {
      std::array<std::size_t, 3> corners;
      std::size_t tet;
      int side;
    };
    std::vector<Face> faces;
    for (std::size_t e = 0; e < tets_.size(); ++e)
      for (int f = 0; f < 4; ++f) {
        std::array<std::size_t, 3> corners{};
        for (int c = 0; c < 3; ++c) corners[c] = tets_[e][kFaces[f][c]];
        std::sort(corners.begin(), corners.end());
        faces.push_back({corners, e, f});
      }
    std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) { return a.corners < b.corners; });
    std::vector<Triangle> surface;
    for (std::size_t i = 0; i < faces.size();) {
      std::size_t next = i + 1;
      while (next < faces.size() && faces[next].corners == faces[i].corners) ++next;
      if (next == i + 1) add_face(tets_[faces[i].tet], faces[i].side, surface);
      i = next;
    }
    return surface;
  }

  void add_face(const std::vector<std::size_t>& tet, int side, std::vector<Triangle>& surface) const {
    const auto edge = [&](int c) { return nodes_[tet[c]] - nodes_[tet[0]]; };
    const bool is_turned = dot(cross(edge(1), edge(2)), edge(3)) < 0.0;
    std::array<int, 3> corner = kFaces[side];
    if (is_turned) std::swap(corner[1], corner[2]);
    const auto add = [&](int a, int b, int c) {
      surface.push_back({static_cast<std::int32_t>(tet[a]), static_cast<std::int32_t>(tet[b]), static_cast<std::int32_t>(tet[c])});
    };
    if (tet.size() == 4) return add(corner[0], corner[1], corner[2]);
    const int m01 = find_middle(corner[0], corner[1]), m12 = find_middle(corner[1], corner[2]), m20 = find_middle(corner[2], corner[0]);
    add(corner[0], m01, m20);
    add(m01, corner[1], m12);
    add(m20, m12, corner[2]);
    add(m01, m12, m20);
  }

  /// Drops rigid modes and sorts the others.
  std::vector<std::size_t> choose_modes() {
    std::vector<double> lambda;
    for (const Mode& mode : modes_) lambda.push_back(mode.lambda / mode.mass);
    const double highest = *std::max_element(lambda.begin(), lambda.end());
    std::vector<std::size_t> chosen;
    for (const std::size_t m : base::find_sort_order(lambda))
      if (lambda[m] > kRigidShare * highest) chosen.push_back(m);
    rigid_ = static_cast<std::int64_t>(modes_.size() - chosen.size());
    if (chosen.empty()) throw InputError(fmt::format("{}: all {} modes are rigid; ask *FREQUENCY for more", name_, modes_.size()));
    if (rigid_ > 0) notes_.push_back(fmt::format("{} rigid modes were left out", rigid_));
    return chosen;
  }

  void check_size(const bank::Bank& bank) const {
    double largest = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [low, high] =
          std::minmax_element(bank.vertices_m.begin(), bank.vertices_m.end(), [k](const Vec3& a, const Vec3& b) { return a[k] < b[k]; });
      largest = std::max(largest, (*high)[k] - (*low)[k]);
    }
    if (!reading_.are_units_given && largest > kLargestUnits)
      throw InputError(fmt::format(
          "{}: the body is {:g} units across; give --unit mm-t-s for millimetres, tonnes and seconds, or --unit m-kg-s", name_, largest));
  }

  bank::Bank make() {
    const bool is_mm = reading_.units == FrdUnits::kMillimetre;
    const double metres = is_mm ? 1e-3 : 1.0, per_root_kg = is_mm ? 1.0 / std::sqrt(1000.0) : 1.0;
    bank::Bank bank;
    std::vector<std::int32_t> vertex_of(nodes_.size(), -1);
    std::vector<std::size_t> used;
    bank.triangles = find_surface();
    for (Triangle& triangle : bank.triangles)
      for (std::int32_t& node : triangle) {
        std::int32_t& vertex = vertex_of[node];
        if (vertex < 0) {
          vertex = static_cast<std::int32_t>(used.size());
          used.push_back(static_cast<std::size_t>(node));
          bank.vertices_m.push_back(metres * nodes_[node]);
        }
        node = vertex;
      }
    check_size(bank);
    const material::Material& material = *reading_.material;
    bank.material = {material.young_modulus_pa, material.poisson_ratio, material.density_kg_m3, 0.0, 0.0};
    if (material.law == material::DampingLaw::rayleigh) {
      bank.material.alpha1_s = material.alpha1_s;
      bank.material.alpha2_per_s = material.alpha2_per_s;
    }
    bank.damping = bank::make_damping(material);
    const std::vector<std::size_t> chosen = choose_modes();
    const std::size_t modes = chosen.size();
    std::vector<double> shapes(3 * modes * used.size());
    for (std::size_t m = 0; m < modes; ++m) {
      const Mode& mode = modes_[chosen[m]];
      bank.eigenvalue_rad2_s2.push_back(mode.lambda / mode.mass);
      bank.decay_per_s.push_back(bank::calc_decay(bank.damping, bank.material, bank.eigenvalue_rad2_s2.back()));
      for (std::size_t v = 0; v < used.size(); ++v)
        for (std::size_t c = 0; c < 3; ++c) shapes[(v * modes + m) * 3 + c] = per_root_kg / std::sqrt(mode.mass) * mode.shape[used[v]][c];
    }
    bank.residual.assign(modes, 0.0);
    set_mass(bank);
    bank::quantise_shapes(bank, shapes);
    bank::set_radiation_gains(bank, shapes);
    bank.counts = {.nodes = static_cast<std::int64_t>(nodes_.size()),
                   .tets = static_cast<std::int64_t>(tets_.size()),
                   .components = 1,
                   .rigid_modes = rigid_ >= 6 ? 6 : 0};
    bank.band_hz = {std::min(20.0, 0.99 * bank.freq_hz(0)), std::max(20000.0, 1.01 * bank.freq_hz(modes - 1))};
    bank.complete = false;
    bank.element = "imported";
    bank.mass = "consistent";
    bank.provenance =
        base::Json::object()
            .set("imported", base::printable(program_.empty() ? "CalculiX" : program_ + (version_.empty() ? "" : " " + version_)))
            .set("file", base::printable(name_))
            .set("notes", base::Json::array(notes_))
            .line();
    if (const std::vector<std::string> faults = bank::find_faults(bank); !faults.empty())
      throw InputError(fmt::format("{}: its modes are not a valid bank: {}; check the units (--unit) and the model", name_, faults[0]));
    return bank;
  }

  void set_mass(bank::Bank& bank) const {
    const Solid solid = calc_solid(bank.vertices_m, bank.triangles);
    if (!(solid.volume_m3 > 0.0)) throw InputError(fmt::format("{}: the tetrahedra enclose no volume; check the mesh", name_));
    bank.rigid.volume_m3 = solid.volume_m3;
    bank.rigid.mass_kg = bank.material.density_kg_m3 * solid.volume_m3;
    bank.rigid.centre_m = solid.centre_m;
    for (std::size_t i = 0; i < 9; ++i) bank.rigid.inertia_kg_m2[i] = bank.material.density_kg_m3 * solid.inertia_m5[i];
  }

  std::string_view bytes_;
  const std::string& name_;
  const FrdReading& reading_;
  std::size_t at_ = 0, line_number_ = 0;
  std::string program_, version_;
  std::vector<Vec3> nodes_;
  std::unordered_map<std::int64_t, std::size_t> node_of_;
  std::vector<std::vector<std::size_t>> tets_;
  std::vector<Mode> modes_;
  double lambda_ = 0.0, mass_ = 1.0;
  bool has_mode_ = false;
  std::int64_t rigid_ = 0;
  std::vector<std::string> notes_;
};

}  // namespace

bank::Bank parse_frd(std::string_view bytes, const std::string& name, const FrdReading& reading, std::vector<std::string>* notes) {
  return FrdReader(bytes, name, reading).read(notes);
}

}  // namespace carillon::exchange
