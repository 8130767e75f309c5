// Method: bulk data cards; of the case control only SPC.
// Source: MSC Nastran quick reference guide: GRID, CTETRA, PSOLID, MAT1, SPC, SPC1, SPCADD, PARAM WTMASS.
// Limitation: nodes in the basic coordinate system only; constraints between nodes (RBE2, MPC ...) are named and left out.

#include <algorithm>
#include <set>

#include "precompute/mesh/cae_model.hpp"
#include "precompute/mesh/fields.hpp"
#include "runtime/base/bdf_cards.hpp"

namespace carillon::mesh {

namespace {

class BdfReader {
 public:
  BdfReader(std::string_view bytes, const std::string& name, std::span<const base::TextOrigin> origins)
      : cursor_(bytes, name), cards_(bytes), model_(cursor_) {
    cursor_.set_origins(origins);
  }
  TetMesh read();

 private:
  struct Held {
    std::int64_t first, last;
    unsigned directions;
    std::size_t place;
  };

  void read_control(std::string_view upper, std::size_t place);
  std::string_view get(std::size_t i) const { return cards_.get(i); }
  std::int64_t get_int(std::size_t i, const char* what) { return parse_int(cursor_, cards_.place(), get(i), what); }
  std::optional<double> find_real(std::size_t i, const char* what) {
    return get(i).empty() ? std::nullopt : std::optional(parse_real(cursor_, cards_.place(), get(i), what));
  }
  unsigned find_directions(std::string_view field);
  void read_grid();
  void read_tet();
  void read_material();
  void read_spc();
  void read_spc1();
  void read_other();
  void hold();

  Cursor cursor_;
  base::BdfCards cards_;
  CaeModel model_;
  std::vector<std::int64_t> nodes_;
  std::map<std::int64_t, std::vector<Held>> held_;          // by number of the set
  std::map<std::int64_t, std::vector<std::int64_t>> sums_;  // SPCADD
  std::vector<CaeMaterial*> materials_;
  std::set<std::string> left_out_;
  std::optional<std::int64_t> chosen_;  // SPC of the case control
  double mass_factor_ = 1.0;
};

/// The chosen SPC set of the case control.
void BdfReader::read_control(std::string_view upper, std::size_t place) {
  if (!upper.starts_with("SPC") || upper.find('=') == std::string::npos || upper.find(',') != std::string::npos) return;
  const std::string_view value = trim(upper.substr(upper.find('=') + 1));
  if (is_int(value)) chosen_ = parse_int(cursor_, place, value, "the number of an SPC set");
}

unsigned BdfReader::find_directions(std::string_view field) {
  unsigned directions = 0;
  for (const char c : field) {
    if (c < '0' || c > '6')
      cursor_.fail(cards_.place(), "expected directions such as 123, found {}; correct the card", quote_excerpt(field));
    if (c >= '1' && c <= '3') directions |= 1U << (c - '1');
  }
  return directions;
}

void BdfReader::read_grid() {
  const std::int64_t tag = get_int(0, "the number of a node");
  if (!get(1).empty() && get(1) != "0" && get_int(1, "a coordinate system") != 0)
    cursor_.fail(cards_.place(), "node {} is in coordinate system {}; write the nodes in the basic system (CP 0)", tag, get(1));
  Vec3 x{};
  for (std::size_t k = 0; k < 3; ++k) x[k] = find_real(2 + k, "a coordinate").value_or(0.0);
  model_.add_node(tag, x, cards_.place());
  if (const unsigned directions = find_directions(get(6)); directions != 0) model_.hold_node(tag, directions, cards_.place());
}

void BdfReader::read_tet() {
  const std::int64_t tag = get_int(0, "the number of an element");
  const std::int64_t property = get(1).empty() ? tag : get_int(1, "a property");
  nodes_.clear();
  for (std::size_t i = 2; i < cards_.count() && !get(i).empty(); ++i) nodes_.push_back(get_int(i, "the number of a node"));
  if (nodes_.size() != 4 && nodes_.size() != 10)
    cursor_.fail(cards_.place(), "CTETRA {} has {} nodes; it needs 4 or 10: write the file again", tag, nodes_.size());
  model_.add_tet(tag, nodes_, static_cast<std::int32_t>(std::clamp<std::int64_t>(property, 0, INT32_MAX)), cards_.place());
}

void BdfReader::read_material() {
  CaeMaterial& material = model_.add_material(fmt::format("MAT1 {}", get_int(0, "the number of a material")), cards_.place());
  const auto young = find_real(1, "Young's modulus"), shear = find_real(2, "the shear modulus");
  material.young = young;
  material.poisson = find_real(3, "Poisson's ratio");
  if (!young && shear && material.poisson) material.young = 2.0 * *shear * (1.0 + *material.poisson);
  if (!material.poisson && young && shear && *shear != 0.0) material.poisson = *young / (2.0 * *shear) - 1.0;
  material.density = find_real(4, "a density");
  material.loss_factor = find_real(7, "a damping coefficient").value_or(0.0);
  materials_.push_back(&material);
}

void BdfReader::read_spc() {
  std::vector<Held>& held = held_[get_int(0, "the number of a set")];
  for (std::size_t i = 1; i + 1 < cards_.count() && i < 7 && !get(i).empty(); i += 3) {
    const std::int64_t node = get_int(i, "the number of a node");
    held.push_back({node, node, find_directions(get(i + 1)), cards_.place()});
  }
}

void BdfReader::read_spc1() {
  std::vector<Held>& held = held_[get_int(0, "the number of a set")];
  const unsigned directions = find_directions(get(1));
  if (to_upper(get(3)) == "THRU") {
    const std::int64_t first = get_int(2, "the first node"), last = get_int(4, "the last node");
    if (last < first) cursor_.fail(cards_.place(), "SPC1 from {} THRU {} has no node; give the smaller number first", first, last);
    held.push_back({first, last, directions, cards_.place()});
    return;
  }
  for (std::size_t i = 2; i < cards_.count(); ++i) {
    if (get(i).empty()) continue;
    const std::int64_t node = get_int(i, "the number of a node");
    held.push_back({node, node, directions, cards_.place()});
  }
}

void BdfReader::read_other() {
  static const std::map<std::string, const char*, std::less<>> kSolids{
      {"CHEXA", "hexahedra"}, {"CPENTA", "wedges"}, {"CPYRAM", "pyramids"}};
  if (const auto found = kSolids.find(cards_.name()); found != kSolids.end())
    cursor_.fail(cards_.place(), "the mesh holds {} ({}); only tetrahedra (CTETRA) are read: mesh the volume with those", found->second,
                 cards_.name());
  if (cards_.name() == "GRDSET" && !get(1).empty() && get(1) != "0")
    cursor_.fail(cards_.place(), "GRDSET names coordinate system {}; write the nodes in the basic system", get(1));
  if (cards_.name() == "INCLUDE") cursor_.fail(cards_.place(), "INCLUDE cannot be followed here; join the files");
  static const std::set<std::string, std::less<>> kConstraints{"RBE1",   "RBE2",   "RBE3",  "RBAR", "MPC",   "CONM2", "CONM1",
                                                               "CELAS1", "CELAS2", "CBUSH", "CBAR", "CBEAM", "CROD",  "CMASS2"};
  const bool is_shell = cards_.name().starts_with("CQUAD") || cards_.name().starts_with("CTRIA");
  if ((is_shell || kConstraints.contains(cards_.name())) && left_out_.insert(cards_.name()).second)
    model_.remark(cards_.place(), fmt::format("{} is left out: only tetrahedra vibrate", cards_.name()));
  static const std::set<std::string, std::less<>> kSolidMaterials{"MAT3", "MAT9", "MAT11"};
  if (kSolidMaterials.contains(cards_.name())) {
    CaeMaterial& material = model_.add_material(fmt::format("MAT1 {}", get_int(0, "the number of a material")), cards_.place());
    material.problem =
        fmt::format("{}: {} is not read, only MAT1; give \"orthotropic\" in the job", cursor_.find_place(cards_.place()), cards_.name());
  }
}

/// Every SPC set becomes a node set; the chosen one, or the only one, holds the body.
void BdfReader::hold() {
  for (const auto& [number, list] : held_) {
    CaeModel::Set& set = model_.open_set(false, fmt::format("SPC {}", number));
    for (const Held& held : list) {
      if (held.first == held.last)
        set.members.push_back({held.first, held.place});
      else
        set.ranges.push_back({held.first, held.last, 1});
    }
  }
  std::vector<std::int64_t> numbers;
  if (chosen_) {
    numbers = sums_.contains(*chosen_) ? sums_[*chosen_] : std::vector{*chosen_};
  } else if (held_.size() == 1) {
    numbers = {held_.begin()->first};
  } else if (held_.size() > 1) {
    model_.remark(held_.begin()->second.front().place,
                  "several SPC sets and no SPC in the case control: none holds the body; name one in \"fixed\"");
  }
  for (const std::int64_t number : numbers)
    for (const Held& held : held_[number]) {
      if (held.directions == 0) continue;
      if (held.first == held.last)
        model_.hold_node(held.first, held.directions, held.place);
      else
        model_.hold_range({held.first, held.last, 1}, held.directions, held.place);
    }
}

TetMesh BdfReader::read() {
  cards_.find_bulk([this](std::string_view line, std::size_t place) { read_control(line, place); });
  bool has_end = false;
  while (!has_end && cards_.next()) {
    if (cards_.name() == "GRID") {
      read_grid();
    } else if (cards_.name() == "CTETRA") {
      read_tet();
    } else if (cards_.name() == "PSOLID") {
      const std::int64_t property = get_int(0, "the number of a property");
      model_.set_section(static_cast<std::int32_t>(std::clamp<std::int64_t>(property, 0, INT32_MAX)),
                         fmt::format("MAT1 {}", get_int(1, "the number of a material")), cards_.place());
    } else if (cards_.name() == "MAT1") {
      read_material();
    } else if (cards_.name() == "SPC") {
      read_spc();
    } else if (cards_.name() == "SPC1") {
      read_spc1();
    } else if (cards_.name() == "SPCADD") {
      for (std::size_t i = 1; i < cards_.count(); ++i)
        if (!get(i).empty()) sums_[get_int(0, "the number of a set")].push_back(get_int(i, "the number of a set"));
    } else if (cards_.name() == "PARAM" && to_upper(get(0)) == "WTMASS") {
      mass_factor_ = find_real(1, "the factor of masses").value_or(1.0);
    } else if (cards_.name() == "ENDDATA") {
      has_end = true;
    } else {
      read_other();
    }
  }
  if (!has_end)
    cursor_.fail(cursor_.bytes().size(),
                 "the file ends without ENDDATA; it was cut short: write or copy it again (if it is complete, add ENDDATA)");
  for (CaeMaterial* material : materials_)
    if (material->density) *material->density *= mass_factor_;
  hold();
  return model_.build("SPC");
}

}  // namespace

TetMesh parse_bdf(std::string_view bytes, const std::string& name, std::span<const base::TextOrigin> origins) {
  return BdfReader(bytes, name, origins).read();
}

}  // namespace carillon::mesh
