// Method: references are resolved at the end. The region of a tetrahedron is its section; without one the smallest element set that
//   contains it; else its property number. Units follow from densities, since no solid has a density that is plausible in two systems.
// Limitation: sets of partial supports are named but free, since a fixed node of a bank is fixed in all directions.

#include "precompute/mesh/cae_model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "precompute/mesh/fields.hpp"

namespace carillon::mesh {

namespace {

constexpr unsigned kAllDirections = 7;

/// A consistent system of units; a density in it lies between the bounds, from foams to the heaviest metals.
struct UnitSystem {
  const char* name;
  double metres, density_kg_m3, stiffness_pa;
  double min_density, max_density;
};
constexpr double kPoundForceN = 4.4482216152605, kInchM = 0.0254;
constexpr std::array<UnitSystem, 3> kUnitSystems{{
    {"m, kg, s", 1.0, 1.0, 1.0, 1.0, 3e4},
    {"mm, t, s", 1e-3, 1e12, 1e6, 1e-12, 3e-8},
    {"in, lbf, s", kInchM, kPoundForceN / (kInchM * kInchM * kInchM * kInchM), kPoundForceN / (kInchM * kInchM), 5e-5, 3e-3},
}};

const UnitSystem* find_system(double density) {
  for (const UnitSystem& system : kUnitSystems)
    if (density >= system.min_density && density <= system.max_density) return &system;
  return nullptr;
}

std::string describe_directions(unsigned directions) {
  std::string text;
  for (unsigned k = 0; k < 3; ++k)
    if ((directions >> k & 1) != 0) text += fmt::format("{}{}", text.empty() ? "" : ", ", "xyz"[k]);
  return text;
}

}  // namespace

void CaeModel::add_tet(std::int64_t tag, const std::vector<std::int64_t>& nodes, std::int32_t property, std::size_t place) {
  raw_.add_tet(cursor_, tag, nodes.data(), static_cast<int>(nodes.size()), kVtkOrder, property, place);
}

void CaeModel::add_other(std::int64_t tag, const std::string& kind, const std::vector<std::int64_t>& nodes, std::size_t place) {
  ++raw_.others[kind];
  other_tags_.push_back(tag);
  other_places_.push_back(place);
  other_nodes_.insert(other_nodes_.end(), nodes.begin(), nodes.end());
  other_ends_.push_back(static_cast<std::int64_t>(other_nodes_.size()));
}

const std::string& CaeModel::find_name(std::string_view name) { return spelling_.try_emplace(to_upper(name), name).first->second; }

CaeModel::Set& CaeModel::open_set(bool is_elements, std::string_view name) {
  const auto [entry, is_new] = (is_elements ? element_sets_ : node_sets_).try_emplace(find_name(name));
  if (is_new) entry->second.order = element_sets_.size() + node_sets_.size();
  return entry->second;
}

void CaeModel::hold_node(std::int64_t node, unsigned directions, std::size_t place) {
  held_.push_back({{node, node, 1}, "", directions, place});
}

void CaeModel::hold_range(const Range& nodes, unsigned directions, std::size_t place) { held_.push_back({nodes, "", directions, place}); }

void CaeModel::hold_set(const std::string& set, unsigned directions, std::size_t place) { held_.push_back({{}, set, directions, place}); }

void CaeModel::set_section(const std::string& element_set, const std::string& material, std::size_t place) {
  sections_.push_back({element_set, 0, to_upper(material), place});
}

void CaeModel::set_section(std::int32_t property, const std::string& material, std::size_t place) {
  sections_.push_back({"", property, to_upper(material), place});
}

CaeMaterial& CaeModel::add_material(const std::string& name, std::size_t place) {
  const auto [entry, is_new] = materials_.try_emplace(to_upper(name));
  if (!is_new) cursor_.fail(place, "material '{}' is defined a second time; give every material a name of its own", name);
  entry->second.name = name;
  entry->second.place = place;
  return entry->second;
}

void CaeModel::set_unit(double metres, const std::string& why) {
  unit_m_ = metres;
  unit_ = why;
}

void CaeModel::remark(std::size_t place, const std::string& text) {
  constexpr std::size_t kMaxRemarks = 20;
  if (remarks_.size() < kMaxRemarks) remarks_.push_back(fmt::format("{}: {}", cursor_.find_place(place), text));
}

bool CaeModel::has_unused_nodes() const {
  if (raw_.node_tags.empty()) return false;
  const auto [low, high] = std::minmax_element(raw_.node_tags.begin(), raw_.node_tags.end());
  const std::uint64_t span = static_cast<std::uint64_t>(*high) - static_cast<std::uint64_t>(*low);
  if (span > 16 * raw_.node_tags.size() + 1024) return false;  // sparse numbers: not looked at
  std::vector<char> is_used(span + 1, 0);
  for (const auto* tags : {&raw_.tets, &other_nodes_})
    for (const std::int64_t tag : *tags)
      if (const std::uint64_t offset = static_cast<std::uint64_t>(tag) - static_cast<std::uint64_t>(*low); offset <= span)
        is_used[offset] = 1;
  return std::any_of(raw_.node_tags.begin(), raw_.node_tags.end(), [&, low = *low](std::int64_t tag) { return is_used[tag - low] == 0; });
}

/// Every set counts, also by the sets it is part of, since a short file may name many members.
void CaeModel::spend(std::size_t place, std::size_t count) {
  if (count > budget_) cursor_.fail(place, "the sets have more members than the file has room for; remove sets that repeat others");
  budget_ -= count;
}

void CaeModel::index_elements() {
  const auto add = [&](const std::vector<std::int64_t>& tags, bool is_tet) {
    for (std::size_t i = 0; i < tags.size(); ++i) {
      const auto position = static_cast<std::int64_t>(i);
      elements_.emplace_back(tags[i], is_tet ? position : -1 - position);
    }
  };
  elements_.reserve(raw_.tet_tags.size() + other_tags_.size());
  add(raw_.tet_tags, true);
  add(other_tags_, false);
  if (!std::is_sorted(elements_.begin(), elements_.end())) std::sort(elements_.begin(), elements_.end());
  for (std::size_t i = 1; i < elements_.size(); ++i) {
    if (elements_[i].first != elements_[i - 1].first) continue;
    const auto place = [&](std::int64_t position) { return position >= 0 ? raw_.tet_places[position] : other_places_[-1 - position]; };
    cursor_.fail(std::max(place(elements_[i].second), place(elements_[i - 1].second)),
                 "element {} is defined a second time; give every element a number of its own", elements_[i].first);
  }
}

void CaeModel::add_element(const RawMesh::Reference& element, const std::string& name, Set& set) {
  const auto found = std::lower_bound(elements_.begin(), elements_.end(), std::pair{element.node_tag, INT64_MIN});
  const bool is_missing = found == elements_.end() || found->first != element.node_tag;
  if (is_missing && may_miss_elements_) return;
  if (is_missing)
    cursor_.fail(element.place, "the set '{}' names element {}, which the file does not define; write the file again with all elements",
                 name, element.node_tag);
  if (found->second >= 0)
    set.tets.push_back(found->second);
  else
    set.others.push_back(-1 - found->second);
}

void CaeModel::add_existing(bool is_elements, const Range& range, Set& set) {
  const auto is_in = [&](std::int64_t tag) {
    return (static_cast<std::uint64_t>(tag) - static_cast<std::uint64_t>(range.first)) % static_cast<std::uint64_t>(range.step) == 0;
  };
  if (is_elements) {
    for (auto at = std::lower_bound(elements_.begin(), elements_.end(), std::pair{range.first, INT64_MIN});
         at != elements_.end() && at->first <= range.last; ++at) {
      if (!is_in(at->first)) continue;
      if (at->second >= 0)
        set.tets.push_back(at->second);
      else
        set.others.push_back(-1 - at->second);
    }
    return;
  }
  if (sorted_nodes_.empty()) {
    sorted_nodes_ = raw_.node_tags;
    std::sort(sorted_nodes_.begin(), sorted_nodes_.end());
  }
  for (auto at = std::lower_bound(sorted_nodes_.begin(), sorted_nodes_.end(), range.first); at != sorted_nodes_.end() && *at <= range.last;
       ++at)
    if (is_in(*at)) set.members.push_back({*at, 0});
}

/// The nodes of an element set, each once.
void CaeModel::add_nodes_of(const Set& elements, std::size_t place, Set& set) {
  std::vector<std::int64_t> tags;
  const std::size_t count = raw_.order == 2 ? 10 : 4;
  const auto add = [&](const std::vector<std::int64_t>& from, std::size_t begin, std::size_t end) {
    spend(place, end - begin);
    tags.insert(tags.end(), from.begin() + static_cast<std::ptrdiff_t>(begin), from.begin() + static_cast<std::ptrdiff_t>(end));
  };
  for (const std::int64_t tet : elements.tets) add(raw_.tets, tet * count, (tet + 1) * count);
  for (const std::int64_t other : elements.others) add(other_nodes_, other == 0 ? 0 : other_ends_[other - 1], other_ends_[other]);
  std::sort(tags.begin(), tags.end());
  tags.erase(std::unique(tags.begin(), tags.end()), tags.end());
  for (const std::int64_t tag : tags) set.members.push_back({tag, place});
}

CaeModel::Set& CaeModel::resolve(bool is_elements, const std::string& name, std::size_t place) {
  Sets& sets = is_elements ? element_sets_ : node_sets_;
  const auto found = sets.find(find_name(name));
  if (found == sets.end())
    cursor_.fail(place, "there is no {} set '{}'; define it, or correct its name", is_elements ? "element" : "node", name);
  Set& set = found->second;
  if (set.is_resolved) return set;
  if (set.is_open) cursor_.fail(place, "the set '{}' is part of itself; remove it from its members", name);
  set.is_open = true;
  if (is_elements) {
    for (const RawMesh::Reference& element : set.members) add_element(element, found->first, set);
    set.members.clear();
  }
  for (const auto& [part, at] : set.parts) {
    const Set& other = resolve(is_elements, part, at);
    spend(at, other.members.size() + other.tets.size() + other.others.size());
    set.members.insert(set.members.end(), other.members.begin(), other.members.end());
    set.tets.insert(set.tets.end(), other.tets.begin(), other.tets.end());
    set.others.insert(set.others.end(), other.others.begin(), other.others.end());
  }
  for (const auto& [elements, at] : set.of_elements) add_nodes_of(resolve(true, elements, at), at, set);
  for (const Range& range : set.ranges) {
    const std::size_t before = set.members.size() + set.tets.size() + set.others.size();
    add_existing(is_elements, range, set);
    spend(place, set.members.size() + set.tets.size() + set.others.size() - before);
  }
  set.is_resolved = true;
  return set;
}

void CaeModel::resolve_sets() {
  index_elements();
  for (auto& [name, set] : element_sets_) {
    resolve(true, name, 0);
    auto& tets = raw_.tet_sets[name];
    tets.insert(tets.end(), set.tets.begin(), set.tets.end());
    auto& nodes = raw_.node_sets[name];
    for (const std::int64_t other : set.others)
      for (std::int64_t k = other == 0 ? 0 : other_ends_[other - 1]; k < other_ends_[other]; ++k)
        nodes.push_back({other_nodes_[k], other_places_[other]});
  }
  for (auto& [name, set] : node_sets_) {
    resolve(false, name, 0);
    auto& nodes = raw_.node_sets[name];
    nodes.insert(nodes.end(), set.members.begin(), set.members.end());
  }
}

/// Regions from sections: sets in the order of the file, then property numbers, then small sets for what is left.
void CaeModel::find_regions(TetMesh& mesh) {
  std::vector<std::int32_t> of_section(raw_.regions.size(), 0);
  for (std::size_t s = 0; s < sections_.size(); ++s) {
    const Section& section = sections_[s];
    const auto region = static_cast<std::int32_t>(s + 1);
    if (section.set.empty()) {
      material_of_[section.property] = s;
      continue;
    }
    for (const std::int64_t e : resolve(true, section.set, section.place).tets) {
      if (of_section[e] != 0 && sections_[of_section[e] - 1].material != section.material)
        cursor_.fail(section.place, "element {} has the material '{}' by another section already; give every element one section",
                     raw_.tet_tags[e], sections_[of_section[e] - 1].material);
      of_section[e] = region;
    }
    material_of_[region] = s;
    region_name_[region] = find_name(section.set);
  }
  const bool has_sets = !region_name_.empty();
  if (has_sets) raw_.regions = of_section;
  if (!has_sets && sections_.empty()) choose_small_sets();
  mesh.region_names = region_name_;
}

void CaeModel::choose_small_sets() {
  std::vector<Sets::const_iterator> by_size;  // later ones win
  for (auto set = element_sets_.cbegin(); set != element_sets_.cend(); ++set)
    if (!set->second.tets.empty()) by_size.push_back(set);
  if (by_size.empty()) return;
  std::sort(by_size.begin(), by_size.end(), [](const auto& a, const auto& b) {
    return std::pair(b->second.tets.size(), a->second.order) < std::pair(a->second.tets.size(), b->second.order);
  });
  std::vector<std::int32_t> regions(raw_.regions.size(), 0);
  std::int32_t region = 0;
  for (const auto& set : by_size) {
    region_name_[++region] = set->first;
    for (const std::int64_t e : set->second.tets) regions[e] = region;
  }
  raw_.regions = std::move(regions);
}

void CaeModel::find_supports(TetMesh& mesh, const std::string& supports) {
  if (held_.empty()) return;
  std::unordered_map<std::int64_t, std::pair<unsigned, std::size_t>> nodes;
  const auto hold = [&](std::int64_t node, const Held& held) {
    auto& [directions, place] = nodes[node];
    directions |= held.directions;
    place = held.place;
  };
  for (const Held& held : held_) {
    if (held.set.empty() && held.nodes.first == held.nodes.last) {
      hold(held.nodes.first, held);
      continue;
    }
    Set range;
    if (held.set.empty()) add_existing(false, held.nodes, range);
    const Set& set = held.set.empty() ? range : resolve(false, held.set, held.place);
    spend(held.place, set.members.size());
    for (const RawMesh::Reference& member : set.members) hold(member.node_tag, held);
  }
  std::map<unsigned, std::pair<std::size_t, std::size_t>> partial;  // count and place by directions
  auto& fixed = raw_.node_sets[supports];
  for (const auto& [node, held] : nodes) {
    const auto& [directions, place] = held;
    if (directions == kAllDirections) {
      fixed.push_back({node, place});
    } else {
      auto& [count, at] = partial[directions];
      ++count;
      at = std::max(at, place);
    }
  }
  for (const auto& [directions, found] : partial)
    remark(found.second,
           fmt::format("{} node{} held in {} only {} left free, since a fixed node is fixed in all directions; to fix them name "
                       "their set in \"fixed\"",
                       found.first, found.first == 1 ? "" : "s", describe_directions(directions), found.first == 1 ? "is" : "are"));
  if (fixed.empty())
    raw_.node_sets.erase(supports);
  else
    mesh.supports = supports;
}

/// In SI units; unusable ones say why.
void CaeModel::convert_materials(TetMesh& mesh) {
  std::map<std::string, FileMaterial> converted;
  for (const auto& [key, material] : materials_) {
    FileMaterial& out = converted[key];
    out.name = material.name;
    out.place = cursor_.find_place(material.place);
    out.problem = material.problem;
    const auto object = [&out](const std::string& text) {
      if (out.problem.empty()) out.problem = fmt::format("{}: material '{}': {}", out.place, out.name, text);
    };
    if (!material.density) object("it has no density; add one, or name a material in the job");
    if (!material.young || !material.poisson) object("it has no isotropic elasticity; add it, or name a material in the job");
    if (material.young && !(*material.young > 0.0))
      object(fmt::format("its Young's modulus is {:g}; it has to be above 0", *material.young));
    if (material.poisson && !(*material.poisson > -1.0 && *material.poisson < 0.5))
      object(fmt::format("its Poisson's ratio is {:g}; it has to lie between -1 and 0.5", *material.poisson));
    const UnitSystem* system = material.density ? find_system(*material.density) : nullptr;
    if (material.density && system == nullptr)
      object(
          fmt::format("its density is {:g}, neither in kg/m^3 (steel: 7850) nor in t/mm^3 (7.85e-9) nor in lbf s^2/in^4 (7.34e-4); write "
                      "the file in one of these units",
                      *material.density));
    if (system == nullptr) continue;
    if (unit_m_ != 0.0 && std::abs(system->metres / unit_m_ - 1.0) > 1e-6)
      cursor_.fail(material.place,
                   "the density {:g} of material '{}' belongs to the units {}, but {}; write the file in one system of units",
                   *material.density, material.name, system->name, unit_);
    set_unit(system->metres, fmt::format("its units are {}, by the density {:g} of '{}'", system->name, *material.density, material.name));
    out.density_kg_m3 = *material.density * system->density_kg_m3;
    out.alpha1_s = material.alpha1_s;
    out.alpha2_per_s = material.alpha2_per_s;
    out.loss_factor = material.loss_factor;
    if (!out.problem.empty()) continue;
    out.young_modulus_pa = *material.young * system->stiffness_pa;
    out.poisson_ratio = *material.poisson;
  }
  for (const auto& [region, s] : material_of_) {
    const auto found = converted.find(sections_[s].material);
    FileMaterial& material = mesh.materials[region];
    if (found != converted.end()) {
      material = found->second;
      continue;
    }
    material.name = sections_[s].material;
    material.place = cursor_.find_place(sections_[s].place);
    material.problem =
        fmt::format("{}: the material '{}' of this section is not defined; define it, or correct its name", material.place, material.name);
  }
  mesh.unit_m = unit_m_ != 0.0 ? unit_m_ : 1.0;
  mesh.unit = unit_;
}

TetMesh CaeModel::build(const std::string& supports) {
  TetMesh extra;
  resolve_sets();
  find_regions(extra);
  find_supports(extra, supports);
  convert_materials(extra);
  TetMesh mesh = build_mesh(std::move(raw_), cursor_, cursor_);
  mesh.region_names = std::move(extra.region_names);
  mesh.materials = std::move(extra.materials);
  mesh.unit_m = extra.unit_m;
  mesh.unit = std::move(extra.unit);
  mesh.supports = std::move(extra.supports);
  mesh.remarks = std::move(remarks_);
  return mesh;
}

}  // namespace carillon::mesh
