// Method: one pass over the sections of a .msh file, versions 2.0-2.2 and 4.1, text and binary in either byte order; other sections are
//   skipped. Tags become indices at the end (build_mesh), so sections may come in any order. All sections share one cursor and one set of
//   tags, hence one long file.
// Source: Gmsh reference manual, "MSH file format" and "MSH file format version 2 (Legacy)". Gmsh's quadratic tetrahedron swaps the last
//   two mid nodes relative to VTK.
// Limitation: $Periodic, $GhostElements, parametric coordinates and foreign post-processing data are ignored.

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <unordered_map>

#include "precompute/mesh/build_mesh.hpp"

namespace carillon::mesh {

namespace {

struct GmshType {
  int nodes;
  int dimension;
  const char* name;  // plural
};

const std::unordered_map<int, GmshType>& gmsh_types() {
  static const std::unordered_map<int, GmshType> types{
      {1, {2, 1, "lines"}},       {2, {3, 2, "triangles"}},    {3, {4, 2, "quadrangles"}},  {4, {4, 3, "tetrahedra"}},
      {5, {8, 3, "hexahedra"}},   {6, {6, 3, "prisms"}},       {7, {5, 3, "pyramids"}},     {8, {3, 1, "lines"}},
      {9, {6, 2, "triangles"}},   {10, {9, 2, "quadrangles"}}, {11, {10, 3, "tetrahedra"}}, {12, {27, 3, "hexahedra"}},
      {13, {18, 3, "prisms"}},    {14, {14, 3, "pyramids"}},   {15, {1, 0, "points"}},      {16, {8, 2, "quadrangles"}},
      {17, {20, 3, "hexahedra"}}, {18, {15, 3, "prisms"}},     {19, {13, 3, "pyramids"}},   {20, {9, 2, "triangles"}},
      {21, {10, 2, "triangles"}}, {22, {12, 2, "triangles"}},  {23, {15, 2, "triangles"}},  {26, {4, 1, "lines"}},
      {27, {5, 1, "lines"}},      {28, {6, 1, "lines"}},       {29, {20, 3, "tetrahedra"}}, {30, {35, 3, "tetrahedra"}},
      {31, {56, 3, "tetrahedra"}}};
  return types;
}

using Group = std::pair<int, std::int32_t>;  // dimension, physical tag

class GmshReader {
 public:
  GmshReader(std::string_view bytes, const std::string& name) : cursor_(bytes, name), group_budget_(4 * bytes.size() + 1024) {}
  TetMesh read();

 private:
  void read_format();
  void read_names();
  void read_entities(bool partitioned);
  void read_nodes_2(bool parametric);
  void read_nodes_4();
  void read_elements_2();
  void read_elements_4();
  bool read_doubt();
  void skip_section(std::string_view name, std::size_t place);
  void skip_numbers(std::string_view name);
  const GmshType& find_type(int type, std::size_t place) const;
  void add_element(std::int64_t tag, int number, const GmshType& type, const std::vector<std::int32_t>& physicals, std::size_t place);
  void name_groups();
  void clear_no_region();
  void merge_repeated();
  Vec3 read_point() {
    Vec3 x{};
    for (double& value : x) value = cursor_.real("a coordinate");
    return x;
  }

  Cursor cursor_;
  std::size_t group_budget_;
  std::size_t start_ = 0;  // of the skipped section
  bool binary_ = false;
  bool swap_ = false;
  int version_ = 0;  // 2 or 4; 0 before $MeshFormat
  RawMesh raw_;
  std::map<Group, std::string> names_;
  std::map<Group, std::vector<std::int32_t>> entity_physicals_;
  std::map<Group, std::vector<RawMesh::Reference>> node_groups_;
  std::map<Group, std::vector<std::int64_t>> tet_groups_;
  std::unordered_map<std::int64_t, Vec3> doubt_m_;  // by node
  std::array<std::int64_t, 64> tags_{};             // nodes of the current element
};

void GmshReader::read_format() {
  const std::size_t place = cursor_.place();
  const double version = cursor_.text_real("the version of the format");
  const auto type = cursor_.text_int("the file type (0 text, 1 binary)", 0, 1);
  const auto size = cursor_.text_int("the size of a real number", 1, 64);
  if (version >= 2.0 && version < 2.3) {
    version_ = 2;
  } else if (version > 4.05 && version < 4.2) {
    version_ = 4;
  } else {
    cursor_.fail(place, "Gmsh format {} is not read, only 2.2 and 4.1; convert it: gmsh FILE -save -format msh41 -o NEW.msh", version);
  }
  if (size != 8) cursor_.fail(place, "numbers of {} bytes are not read, only of 8; write the mesh with a 64-bit Gmsh", size);
  cursor_.line();
  binary_ = type == 1;
  if (!binary_) return;
  const std::size_t mark = cursor_.place();
  cursor_.set_binary(false);
  const auto one = cursor_.raw<std::uint32_t>("the byte-order mark");
  if (one != 1 && one != 0x01000000U)
    cursor_.fail(mark, "the byte-order mark of the binary file is {} and not 1; the file was damaged (copied as text?): copy it again",
                 one);
  swap_ = one != 1;
  cursor_.set_binary(swap_);
}

void GmshReader::read_names() {
  const std::size_t place = cursor_.place();
  const auto count =
      cursor_.checked_count(cursor_.text_int("the number of physical names", INT64_MIN, INT64_MAX), 7, "physical names", place);
  for (std::size_t i = 0; i < count; ++i) {
    const auto dimension = static_cast<int>(cursor_.text_int("the dimension of a physical group", 0, 3));
    const auto tag = static_cast<std::int32_t>(cursor_.text_int("the tag of a physical group", INT32_MIN, INT32_MAX));
    const std::size_t at = cursor_.place();
    const std::string_view text = cursor_.line();
    const auto open = text.find('"');
    const auto close = text.rfind('"');
    if (open == std::string_view::npos || close <= open)
      cursor_.fail(at, "the name of physical group {} is not in double quotes; write it again", tag);
    names_[{dimension, tag}] = std::string(text.substr(open + 1, close - open - 1));
  }
}

void GmshReader::read_entities(bool partitioned) {
  if (partitioned) {
    cursor_.int64("the number of partitions");
    const std::size_t place = cursor_.place();
    const auto ghosts = cursor_.checked_count(cursor_.int64("the number of ghost entities"), binary_ ? 8 : 4, "ghost entities", place);
    for (std::size_t i = 0; i < 2 * ghosts; ++i) cursor_.int32("a ghost entity");
  }
  std::array<std::size_t, 4> counts{};
  for (auto& count : counts) {
    const std::size_t place = cursor_.place();
    count = cursor_.checked_count(cursor_.int64("the number of entities"), binary_ ? 28 : 8, "entities", place);
  }
  const auto read_list = [&](const char* what, auto&& use) {
    const std::size_t place = cursor_.place();
    const auto count = cursor_.checked_count(cursor_.int64(what), binary_ ? 4 : 2, what, place);
    for (std::size_t i = 0; i < count; ++i) use(cursor_.int32(what));
  };
  for (int dimension = 0; dimension < 4; ++dimension) {
    for (std::size_t i = 0; i < counts[dimension]; ++i) {
      const auto tag = cursor_.int32("the tag of an entity");
      if (partitioned) {
        cursor_.int32("the dimension of the parent entity");
        cursor_.int32("the tag of the parent entity");
        read_list("the partitions of an entity", [](std::int32_t) {});
      }
      for (int k = 0; k < (dimension == 0 ? 3 : 6); ++k) cursor_.real("the box of an entity");
      auto& physicals = entity_physicals_[{dimension, tag}];
      physicals.clear();
      read_list("physical tags", [&](std::int32_t physical) { physicals.push_back(physical); });
      if (dimension > 0) read_list("bounding entities", [](std::int32_t) {});
    }
  }
}

void GmshReader::read_nodes_2(bool parametric) {
  const std::size_t at = cursor_.place();
  const auto count = cursor_.checked_count(cursor_.text_int("the number of nodes", INT64_MIN, INT64_MAX), binary_ ? 28 : 8, "nodes", at);
  cursor_.line();
  raw_.nodes.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    if (!binary_) cursor_.skip_space();
    const std::size_t place = cursor_.place();
    const auto tag = cursor_.int32("the number of a node");
    raw_.add_node(cursor_, tag, read_point(), place);
    if (!parametric) continue;
    const auto dimension = cursor_.int32("the dimension of the entity of a node");
    cursor_.int32("the entity of a node");
    for (int k = 0; k < dimension && dimension < 3; ++k) cursor_.real("a parametric coordinate");
  }
}

void GmshReader::read_nodes_4() {
  const std::size_t at = cursor_.place();
  const auto blocks = cursor_.checked_count(cursor_.int64("the number of node blocks"), binary_ ? 20 : 8, "node blocks", at);
  const auto count = cursor_.checked_count(cursor_.int64("the number of nodes"), binary_ ? 32 : 8, "nodes", at);
  cursor_.int64("the smallest node number");
  cursor_.int64("the greatest node number");
  raw_.nodes.reserve(count);
  std::vector<std::pair<std::int64_t, std::size_t>> tags;
  std::size_t total = 0;
  for (std::size_t b = 0; b < blocks; ++b) {
    const auto dimension = cursor_.int32("the dimension of a node block");
    cursor_.int32("the entity of a node block");
    const auto parametric = cursor_.int32("the parametric flag of a node block");
    const std::size_t place = cursor_.place();
    const auto size = cursor_.checked_count(cursor_.int64("the number of nodes of a block"), binary_ ? 32 : 8, "nodes in a block", place);
    if (dimension < 0 || dimension > 3) cursor_.fail(place, "a node block has dimension {}; write the mesh again", dimension);
    tags.clear();
    for (std::size_t i = 0; i < size; ++i) {
      if (!binary_) cursor_.skip_space();
      const std::size_t here = cursor_.place();
      tags.emplace_back(cursor_.int64("the number of a node"), here);
    }
    for (const auto& [tag, tag_place] : tags) {
      raw_.add_node(cursor_, tag, read_point(), tag_place);
      for (int k = 0; parametric != 0 && k < dimension; ++k) cursor_.real("a parametric coordinate");
    }
    total += size;
  }
  if (total != count)
    cursor_.fail(at, "$Nodes announces {} nodes, but its blocks hold {}; the file was damaged: write the mesh again", count, total);
}

const GmshType& GmshReader::find_type(int type, std::size_t place) const {
  const auto found = gmsh_types().find(type);
  if (found == gmsh_types().end())
    cursor_.fail(
        place, "element type {} is not known; only tetrahedra of 4 or 10 nodes make the body: mesh it again with Mesh.ElementOrder 1 or 2",
        type);
  const GmshType& entry = found->second;
  if (entry.dimension == 3 && type != 4 && type != 11)
    cursor_.fail(place,
                 "the mesh holds {} of {} nodes (element type {}); only tetrahedra of 4 or 10 nodes are read: mesh the volume with those",
                 entry.name, entry.nodes, type);
  return entry;
}

void GmshReader::add_element(std::int64_t tag, int number, const GmshType& type, const std::vector<std::int32_t>& physicals,
                             std::size_t place) {
  // An entity may claim thousands of groups; bound their total by the file size.
  const std::size_t entries = physicals.size() * static_cast<std::size_t>(type.nodes);
  if (entries > group_budget_)
    cursor_.fail(place, "the elements belong to more physical groups than a file of {} bytes explains; use fewer groups",
                 cursor_.bytes().size());
  group_budget_ -= entries;
  if (type.dimension == 3) {
    const auto position = static_cast<std::int64_t>(raw_.tet_tags.size());
    raw_.add_tet(cursor_, tag, tags_.data(), type.nodes, number == 4 ? kVtkOrder : kGmshOrder, physicals.empty() ? 0 : physicals[0], place);
    for (const auto physical : physicals) tet_groups_[{3, physical}].push_back(position);
    return;
  }
  ++raw_.others[type.name];
  for (const auto physical : physicals) {
    auto& group = node_groups_[{type.dimension, physical}];
    for (int i = 0; i < type.nodes; ++i) group.push_back({tags_[i], place});
  }
}

void GmshReader::read_elements_2() {
  const std::size_t at = cursor_.place();
  const auto count = cursor_.checked_count(cursor_.text_int("the number of elements", INT64_MIN, INT64_MAX), 8, "elements", at);
  cursor_.line();
  std::vector<std::int32_t> physicals;
  std::size_t done = 0;
  while (done < count) {
    std::int32_t number = 0;
    std::int32_t tag_count = 0;
    std::size_t size = 1;
    if (!binary_) cursor_.skip_space();
    std::size_t place = cursor_.place();
    std::int32_t tag = 0;
    if (binary_) {
      number = cursor_.int32("the type of a block of elements");
      size = cursor_.checked_count(cursor_.int32("the number of elements of a block"), 8, "elements in a block", place);
      tag_count = cursor_.int32("the number of tags");
      if (size == 0 || size > count - done)
        cursor_.fail(place, "a block of {} elements where {} are left of those announced; write the mesh again", size, count - done);
    } else {
      tag = cursor_.int32("the number of an element");
      number = cursor_.int32("the type of an element");
      tag_count = cursor_.int32("the number of tags");
    }
    const GmshType& type = find_type(number, place);
    cursor_.checked_count(tag_count, binary_ ? 4 : 2, "tags of an element", place);
    for (std::size_t i = 0; i < size; ++i) {
      if (binary_) {
        place = cursor_.place();
        tag = cursor_.int32("the number of an element");
      }
      physicals.clear();
      for (std::int32_t k = 0; k < tag_count; ++k) {
        const auto value = cursor_.int32("a tag");
        // A negative tag marks an element of the opposite orientation.
        if (k == 0 && value != 0) physicals.push_back(type.dimension < 3 && value != INT32_MIN ? std::abs(value) : value);
      }
      for (int k = 0; k < type.nodes; ++k) tags_[k] = cursor_.int32("a node of an element");
      add_element(tag, number, type, physicals, place);
    }
    done += size;
  }
}

void GmshReader::read_elements_4() {
  const std::size_t at = cursor_.place();
  const auto blocks = cursor_.checked_count(cursor_.int64("the number of element blocks"), binary_ ? 20 : 8, "element blocks", at);
  const auto count = cursor_.checked_count(cursor_.int64("the number of elements"), binary_ ? 16 : 4, "elements", at);
  cursor_.int64("the smallest element number");
  cursor_.int64("the greatest element number");
  const std::vector<std::int32_t> none;
  std::size_t total = 0;
  for (std::size_t b = 0; b < blocks; ++b) {
    if (!binary_) cursor_.skip_space();
    const std::size_t block = cursor_.place();
    const auto dimension = cursor_.int32("the dimension of an element block");
    const auto entity = cursor_.int32("the entity of an element block");
    const auto number = cursor_.int32("the type of an element block");
    const auto size =
        cursor_.checked_count(cursor_.int64("the number of elements of a block"), binary_ ? 16 : 4, "elements in a block", block);
    const GmshType& type = find_type(number, block);
    if (dimension != type.dimension)
      cursor_.fail(block, "a block of {} is said to have dimension {}; the file was damaged: write the mesh again", type.name, dimension);
    const auto found = entity_physicals_.find({dimension, entity});
    const auto& physicals = found == entity_physicals_.end() ? none : found->second;
    for (std::size_t i = 0; i < size; ++i) {
      if (!binary_) cursor_.skip_space();
      const std::size_t place = cursor_.place();
      const auto tag = cursor_.int64("the number of an element");
      for (int k = 0; k < type.nodes; ++k) tags_[k] = cursor_.int64("a node of an element");
      add_element(tag, number, type, physicals, place);
    }
    total += size;
  }
  if (total != count)
    cursor_.fail(at, "$Elements announces {} elements, but its blocks hold {}; the file was damaged: write the mesh again", count, total);
}

/// Skips the numbers of a known binary section, up to its $End.
void GmshReader::skip_numbers(std::string_view name) {
  const auto step = [&](std::size_t bytes) {
    if (bytes > cursor_.remaining()) cursor_.fail(cursor_.place(), "${} is longer than the file", name);
    cursor_.seek(cursor_.place() + bytes);
  };
  const auto step_many = [&](std::int64_t count, std::size_t bytes) {
    step(cursor_.checked_count(count, bytes, "entries", cursor_.place()) * bytes);
  };
  // The binary data begin after the end of this line.
  const auto read_line_int = [&](const char* what) {
    const auto value = cursor_.text_int(what, INT64_MIN, INT64_MAX);
    cursor_.line();
    return value;
  };
  if (name == "Periodic") {
    const auto links = cursor_.checked_count(cursor_.int64("the number of links"), 28, "links", cursor_.place());
    for (std::size_t n = 0; n < links; ++n) {
      for (int k = 0; k < 3; ++k) cursor_.int32("an entity");
      step_many(cursor_.int64("the number of affine values"), 8);
      step_many(cursor_.int64("the number of node pairs"), 16);
    }
  } else if (name == "GhostElements") {
    const auto ghosts = cursor_.checked_count(cursor_.int64("the number of ghost elements"), 20, "ghost elements", cursor_.place());
    for (std::size_t n = 0; n < ghosts; ++n) {
      step(8 + 4);
      step_many(cursor_.int64("the number of ghost partitions"), 4);
    }
  } else if (name == "Parametrizations") {
    const auto curves = cursor_.checked_count(cursor_.int64("the number of curves"), 12, "curves", cursor_.place());
    const auto faces = cursor_.checked_count(cursor_.int64("the number of surfaces"), 20, "surfaces", cursor_.place());
    for (std::size_t n = 0; n < curves; ++n) {
      step(4);
      step_many(cursor_.int64("the number of points"), 4 * 8);
    }
    for (std::size_t n = 0; n < faces; ++n) {
      step(4);
      const auto points = cursor_.int64("the number of points");
      const auto triangles = cursor_.int64("the number of triangles");
      step_many(points, 11 * 8);
      step_many(triangles, 3 * 4);
    }
  } else {  // three lists as text, then values
    const auto strings = cursor_.checked_count(read_line_int("the number of string tags"), 1, "string tags", cursor_.place());
    for (std::size_t n = 0; n < strings; ++n) cursor_.line();
    const auto reals = cursor_.checked_count(read_line_int("the number of real tags"), 2, "real tags", cursor_.place());
    for (std::size_t n = 0; n < reals; ++n) cursor_.text_real("a real tag");
    const auto integers =
        cursor_.checked_count(cursor_.text_int("the number of integer tags", INT64_MIN, INT64_MAX), 2, "integer tags", cursor_.place());
    std::array<std::int64_t, 3> tags{0, 0, 0};  // time step, components, entries
    for (std::size_t n = 0; n < integers; ++n) {
      const auto tag = cursor_.text_int("an integer tag", INT32_MIN, INT32_MAX);
      if (n < 3) tags[n] = tag;
    }
    cursor_.line();
    const std::size_t components = cursor_.checked_count(tags[1], 1, "components", cursor_.place());
    if (name == "ElementNodeData") {
      const auto elements = cursor_.checked_count(tags[2], 8, "elements", cursor_.place());
      for (std::size_t n = 0; n < elements; ++n) {
        step(4);
        step_many(cursor_.int32("the number of nodes"), 8 * components + (components == 0));
      }
    } else {
      step_many(tags[2], 4 + 8 * components);
    }
  }
}

/// Reads $NodeData written by carillon-mesh; returns false for other data.
bool GmshReader::read_doubt() {
  const std::string head = fmt::format("1\n\"{}\"\n1\n0\n3\n0\n3\n", kDoubtName);
  if (cursor_.bytes().substr(cursor_.place(), head.size()) != head) return false;
  cursor_.seek(cursor_.place() + head.size());
  const std::size_t at = cursor_.place();
  const auto count =
      cursor_.checked_count(cursor_.text_int("the number of nodes in doubt", INT64_MIN, INT64_MAX), binary_ ? 28 : 8, "nodes in doubt", at);
  cursor_.line();
  for (std::size_t i = 0; i < count; ++i) {
    if (!binary_) cursor_.skip_space();
    const std::size_t place = cursor_.place();
    const auto tag = cursor_.int32("the number of a node");
    const Vec3 way = read_point();
    doubt_m_[tag] = way;
    for (const double x : way)
      if (!std::isfinite(x)) cursor_.fail(place, "an offset between two surfaces is not finite; write the mesh again");
  }
  return true;
}

void GmshReader::skip_section(std::string_view name, std::size_t place) {
  const std::string end = fmt::format("$End{}", name);
  const std::string_view bytes = cursor_.bytes();
  start_ = cursor_.place();
  // True if the section ends here: its $End tag on a line, followed by another section or the end of the file.
  const auto is_end = [&](std::size_t at) {
    if (bytes.substr(at, end.size()) != end) return false;
    const auto line = std::min(bytes.find('\n', at), bytes.size());
    if (bytes.substr(at + end.size(), line - at - end.size()).find_first_not_of(" \t\r") != std::string_view::npos) return false;
    const auto next = bytes.find_first_not_of(" \t\r\n", line);
    return next == std::string_view::npos || bytes[next] == '$';
  };
  static const std::set<std::string_view> kLists{"NodeData", "ElementData", "ElementNodeData"};
  static const std::set<std::string_view> kBinary{"Periodic", "GhostElements", "Parametrizations"};
  // Binary values may contain the tag itself, so known sections are parsed. Version 2 stores the others as text.
  if (binary_ && (kLists.contains(name) || (version_ == 4 && kBinary.contains(name)))) {
    try {
      skip_numbers(name);
      cursor_.skip_space();
      if (is_end(cursor_.place())) return;
    } catch (const InputError&) {  // not as in the manual: search for the end
    }
  }
  // In text the tag begins a line; after binary values there is no line end before it.
  for (std::size_t at = start_ == 0 ? 0 : start_ - 1; (at = bytes.find(end, at)) != std::string_view::npos; ++at) {
    if (!is_end(at) || (!binary_ && at > 0 && bytes[at - 1] != '\n' && bytes[at - 1] != '\r')) continue;
    cursor_.seek(at);
    return;
  }
  cursor_.fail(place, "section ${} has no ${}; the file was cut short: write or copy it again", name, end.substr(1));
}

/// Drops the group of region 0, which is neither region nor set.
void GmshReader::clear_no_region() {
  const auto found =
      std::find_if(names_.begin(), names_.end(), [](const auto& entry) { return entry.first.first == 3 && entry.second == kNoRegionName; });
  if (found == names_.end()) return;
  std::replace(raw_.regions.begin(), raw_.regions.end(), found->first.second, std::int32_t{0});
  tet_groups_.erase(found->first);
  names_.erase(found);
}

void GmshReader::name_groups() {
  const auto name_of = [&](const Group& group) {
    const auto found = names_.find(group);
    return found == names_.end() ? fmt::format("physical:{}", group.second) : found->second;
  };
  for (const auto& [group, name] : names_) raw_.node_sets[name];
  for (auto& [group, references] : node_groups_) {
    auto& set = raw_.node_sets[name_of(group)];
    set.insert(set.end(), references.begin(), references.end());
  }
  for (auto& [group, positions] : tet_groups_) {
    auto& set = raw_.tet_sets[name_of(group)];
    set.insert(set.end(), positions.begin(), positions.end());
  }
}

/// Version 2.2 repeats an element for each of its physical groups: the copies become one element of the first group.
void GmshReader::merge_repeated() {
  if (version_ != 2 || tet_groups_.size() < 2) return;
  const std::vector<std::int64_t> position_of = merge_repeated_tets(raw_);
  for (auto& [group, positions] : tet_groups_)
    for (auto& position : positions) position = position_of[position];
}

TetMesh GmshReader::read() {
  std::set<std::string, std::less<>> seen;
  while (cursor_.skip_space()) {
    const std::size_t place = cursor_.place();
    const std::string_view head = cursor_.line();
    if (head.front() != '$' || head.size() < 2)
      cursor_.fail(place,
                   "expected a section such as $Nodes, found {}; the count of the section before it may be wrong: write the mesh again",
                   quote_excerpt(head));
    const std::string name(head.substr(1));
    if (name == "NOD" || name == "ELM")
      cursor_.fail(place, "Gmsh format 1 is not read, only 2.2 and 4.1; convert it: gmsh FILE -save -format msh41 -o NEW.msh");
    const bool parametric = name == "ParametricNodes";  // version 2 alternative to $Nodes
    const bool ours =
        name == "Nodes" || parametric || name == "Elements" || name == "Entities" || name == "MeshFormat" || name == "PartitionedEntities";
    if (ours && !seen.insert(parametric ? "Nodes" : name).second)
      cursor_.fail(place, "a second section ${}; keep one mesh in a file", name);
    if (ours && name != "MeshFormat" && version_ == 0) cursor_.fail(place, "${} comes before $MeshFormat; write the mesh again", name);
    if (name == "MeshFormat") {
      read_format();
    } else if (name == "PhysicalNames") {
      read_names();
    } else if ((name == "Entities" || name == "PartitionedEntities") && version_ == 4) {
      read_entities(name != "Entities");
    } else if (name == "Nodes" || (parametric && version_ == 2)) {
      version_ == 2 ? read_nodes_2(parametric) : read_nodes_4();
    } else if (name == "Elements") {
      version_ == 2 ? read_elements_2() : read_elements_4();
    } else if (name != "NodeData" || version_ == 0 || !read_doubt()) {
      skip_section(name, place);
    }
    cursor_.skip_space();
    const std::size_t end = cursor_.place();
    const std::string_view tail = cursor_.line();
    if (tail != "$End" + name)
      cursor_.fail(end, "expected $End{}, found {}; the file was cut short or a count is wrong: write the mesh again", name,
                   tail.empty() ? "the end of the file" : quote_excerpt(tail));
  }
  for (const char* needed : {"MeshFormat", "Nodes", "Elements"})
    if (!seen.contains(needed))
      cursor_.fail(cursor_.place(), "the file ends without a section ${}; it was cut short: write or copy it again", needed);
  merge_repeated();
  clear_no_region();
  name_groups();
  std::vector<Vec3> doubt_m(doubt_m_.empty() ? 0 : raw_.nodes.size());
  for (std::size_t i = 0; i < doubt_m.size(); ++i)
    if (const auto found = doubt_m_.find(raw_.node_tags[i]); found != doubt_m_.end()) doubt_m[i] = found->second;
  TetMesh mesh = build_mesh(std::move(raw_), cursor_, cursor_);
  mesh.doubt_m = std::move(doubt_m);
  for (const auto& [group, name] : names_)
    if (group.first == 3) mesh.region_names[group.second] = name;
  return mesh;
}

}  // namespace

TetMesh parse_gmsh(std::string_view bytes, const std::string& name) { return GmshReader(bytes, name).read(); }

}  // namespace carillon::mesh
