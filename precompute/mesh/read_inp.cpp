// Method: keyword lines and their data lines, in one pass; names without regard to case, blanks in keywords ignored.
// Source: CalculiX CrunchiX 2.20 user's manual, "Input deck format"; Abaqus keywords reference for *PART, *INSTANCE, ENCASTRE.
// Limitation: one part, no *TRANSFORM, *ORIENTATION, *NGEN; constraints between nodes (*TIE, *EQUATION ...) are named and left out.

#include <algorithm>
#include <set>

#include "precompute/mesh/cae_model.hpp"
#include "precompute/mesh/fields.hpp"

namespace carillon::mesh {

namespace {

struct Keyword {
  std::string name;                               // upper case, without blanks
  std::map<std::string, std::string> parameters;  // names in upper case
  std::size_t place = 0;

  bool has(const char* key) const { return parameters.contains(key); }
  std::string get(const char* key) const {
    const auto found = parameters.find(key);
    return found == parameters.end() ? "" : found->second;
  }
};

/// Nodes of an element type; 0: as many as its lines hold.
struct InpType {
  int nodes;
  const char* solid = nullptr;  // plural of a solid that is not a tetrahedron
};

InpType find_type(const std::string& type) {
  const auto is = [&](std::string_view start) { return type.starts_with(start); };
  if (is("C3D10")) return {10};
  if (is("C3D4")) return {4};
  if (is("C3D8")) return {8, "hexahedra"};
  if (is("C3D20") || is("C3D27")) return {20, "hexahedra"};
  if (is("C3D6")) return {6, "wedges"};
  if (is("C3D15")) return {15, "wedges"};
  if (is("C3D5") || is("C3D13")) return {5, "pyramids"};
  return {0};
}

class InpReader {
 public:
  InpReader(std::string_view bytes, const std::string& name, std::span<const base::TextOrigin> origins)
      : cursor_(bytes, name), model_(cursor_) {
    cursor_.set_origins(origins);
  }
  TetMesh read();

 private:
  bool next_data(std::string_view& line, std::size_t& place);
  Keyword read_keyword();
  void read_section(const Keyword& keyword);
  void read_nodes(const Keyword& keyword);
  void read_elements(const Keyword& keyword);
  void read_set(const Keyword& keyword, bool is_elements);
  void read_boundary(const Keyword& keyword);
  void read_material_row(const Keyword& keyword);
  void skip_data();
  void refuse(const Keyword& keyword);
  void check_end();

  Cursor cursor_;
  CaeModel model_;
  std::vector<std::string_view> fields_;
  std::vector<std::int64_t> nodes_;
  CaeMaterial* material_ = nullptr;
  std::string last_;  // keyword
  std::size_t step_ = 0;
  bool is_in_step_ = false, has_part_ = false, has_instance_ = false, has_last_comment_ = false;
};

/// The next data line; false before a keyword and at the end.
bool InpReader::next_data(std::string_view& line, std::size_t& place) {
  while (cursor_.remaining() > 0) {
    place = cursor_.place();
    line = trim(cursor_.line());
    has_last_comment_ = line.starts_with("**");
    if (line.empty() || has_last_comment_) continue;
    if (line[0] != '*') return true;
    cursor_.seek(place);
    return false;
  }
  return false;
}

void InpReader::skip_data() {
  std::string_view line;
  std::size_t place = 0;
  while (next_data(line, place)) continue;
}

Keyword InpReader::read_keyword() {
  Keyword keyword;
  keyword.place = cursor_.place();
  std::string text(trim(cursor_.line()));
  while (text.ends_with(',') && cursor_.remaining() > 0) text += trim(cursor_.line());  // goes on
  split(text, fields_);
  for (const char c : to_upper(fields_[0].substr(1)))
    if (c != ' ' && c != '\t') keyword.name += c;
  for (std::size_t i = 1; i < fields_.size(); ++i) {
    const std::size_t equals = fields_[i].find('=');
    std::string_view value = equals == std::string_view::npos ? std::string_view() : trim(fields_[i].substr(equals + 1));
    keyword.parameters[to_upper(trim(fields_[i].substr(0, equals)))] = unquote(value);
  }
  if (keyword.name.empty()) cursor_.fail(keyword.place, "a keyword line without a keyword; correct it, or begin a comment with **");
  return keyword;
}

void InpReader::read_nodes(const Keyword& keyword) {
  if (keyword.has("INPUT"))
    cursor_.fail(keyword.place, "*NODE with INPUT is not read; write *NODE, then *INCLUDE, INPUT={}", keyword.get("INPUT"));
  if (keyword.get("SYSTEM") != "" && to_upper(keyword.get("SYSTEM")) != "R")
    cursor_.fail(keyword.place, "*NODE with SYSTEM={} is not read; write the nodes in Cartesian coordinates", keyword.get("SYSTEM"));
  CaeModel::Set* const set = keyword.get("NSET").empty() ? nullptr : &model_.open_set(false, keyword.get("NSET"));
  std::string_view line;
  std::size_t place = 0;
  while (next_data(line, place)) {
    split(line, fields_);
    if (fields_.size() < 2)
      cursor_.fail(place, "a node has a number and three coordinates, found {}; write the file again", quote_excerpt(line));
    const std::int64_t tag = parse_int(cursor_, place, fields_[0], "the number of a node");
    Vec3 x{};
    for (std::size_t k = 0; k < 3 && k + 1 < fields_.size(); ++k)
      if (!fields_[k + 1].empty()) x[k] = parse_real(cursor_, place, fields_[k + 1], "a coordinate");
    model_.add_node(tag, x, place);
    if (set != nullptr) set->members.push_back({tag, place});
  }
}

void InpReader::read_elements(const Keyword& keyword) {
  const std::string type = to_upper(keyword.get("TYPE"));
  if (type.empty()) cursor_.fail(keyword.place, "*ELEMENT without TYPE; give one, such as *ELEMENT, TYPE=C3D10");
  const InpType known = find_type(type);
  CaeModel::Set* const set = keyword.get("ELSET").empty() ? nullptr : &model_.open_set(true, keyword.get("ELSET"));
  std::string_view line;
  std::size_t place = 0;
  std::size_t count = 0;
  while (next_data(line, place)) {
    if (known.solid != nullptr)
      cursor_.fail(place, "the mesh holds {} ({}); only tetrahedra (C3D4, C3D10) are read: mesh the volume with those", known.solid, type);
    const std::size_t first = place;
    split(line, fields_);
    const std::int64_t tag = parse_int(cursor_, place, fields_[0], "the number of an element");
    nodes_.clear();
    for (std::size_t i = 1;;) {
      for (; i < fields_.size(); ++i) nodes_.push_back(parse_int(cursor_, place, fields_[i], "the number of a node"));
      const bool goes_on = line.ends_with(',') && (known.nodes == 0 || std::ssize(nodes_) < known.nodes);
      if (!goes_on || !next_data(line, place)) break;
      split(line, fields_);
      i = 0;
    }
    if (known.nodes == 0) {
      model_.add_other(tag, type + " elements", nodes_, first);
    } else {
      if (std::ssize(nodes_) != known.nodes)
        cursor_.fail(first, "element {} has {} nodes, but a {} has {}; the line was cut short or its TYPE is wrong: write the file again",
                     tag, nodes_.size(), type, known.nodes);
      model_.add_tet(tag, nodes_, 0, first);
    }
    if (set != nullptr) set->members.push_back({tag, first});
    ++count;
  }
  const bool is_marker = type.starts_with("CPS") || type.starts_with("T3D") || type.starts_with("CPE");  // surfaces and edges of meshers
  if (known.nodes == 0 && !is_marker && count > 0)
    model_.remark(keyword.place, fmt::format("{} elements of type {} are left out: only tetrahedra vibrate", count, type));
}

void InpReader::read_set(const Keyword& keyword, bool is_elements) {
  const std::string name = keyword.get(is_elements ? "ELSET" : "NSET");
  if (name.empty())
    cursor_.fail(keyword.place, "*{} without a name; give one: *{}, {}=NAME", keyword.name, keyword.name, is_elements ? "ELSET" : "NSET");
  const bool is_generated = keyword.has("GENERATE");
  CaeModel::Set& set = model_.open_set(is_elements, name);
  std::string_view line;
  std::size_t place = 0;
  if (!is_elements && keyword.has("ELSET")) {
    if (next_data(line, place)) cursor_.fail(place, "*NSET with ELSET takes the nodes of that set and has no data; remove this line");
    set.of_elements.emplace_back(keyword.get("ELSET"), keyword.place);
    return;
  }
  while (next_data(line, place)) {
    split(line, fields_);
    if (is_generated) {
      if (fields_.size() < 2) cursor_.fail(place, "GENERATE needs first, last and a step, found {}; correct the line", quote_excerpt(line));
      const std::int64_t first = parse_int(cursor_, place, fields_[0], "the first member"),
                         last = parse_int(cursor_, place, fields_[1], "the last member");
      const std::int64_t step = fields_.size() > 2 ? parse_int(cursor_, place, fields_[2], "the step") : 1;
      if (step < 1 || last < first)
        cursor_.fail(place, "GENERATE from {} to {} in steps of {} has no member; give first, last and a step above 0", first, last, step);
      set.ranges.push_back({first, last, step});
      continue;
    }
    for (std::string_view field : fields_) {
      field = unquote(field);
      if (field.empty()) continue;
      if (is_int(field))
        set.members.push_back({parse_int(cursor_, place, field, is_elements ? "an element" : "a node"), place});
      else
        set.parts.emplace_back(field, place);
    }
  }
}

void InpReader::read_boundary(const Keyword& keyword) {
  if (to_upper(keyword.get("OP")) == "NEW") model_.clear_supports();
  static const std::map<std::string, unsigned, std::less<>> kWords{{"ENCASTRE", 7U}, {"PINNED", 7U}, {"XSYMM", 1U},  {"YSYMM", 2U},
                                                                   {"ZSYMM", 4U},    {"XASYMM", 6U}, {"YASYMM", 5U}, {"ZASYMM", 3U}};
  std::string_view line;
  std::size_t place = 0;
  while (next_data(line, place)) {
    split(line, fields_);
    if (fields_.size() < 2)
      cursor_.fail(place, "*BOUNDARY needs a node or set and its directions, found {}; correct the line", quote_excerpt(line));
    unsigned directions = 0;
    if (const auto word = kWords.find(to_upper(fields_[1])); word != kWords.end()) {
      directions = word->second;
    } else {
      const std::int64_t first = parse_int(cursor_, place, fields_[1], "the first direction");
      const std::int64_t last =
          fields_.size() > 2 && !fields_[2].empty() ? parse_int(cursor_, place, fields_[2], "the last direction") : first;
      for (std::int64_t k = 1; k <= 3; ++k)
        if (k >= first && k <= last) directions |= 1U << (k - 1);
    }
    if (directions == 0) continue;  // rotations, temperatures
    if (is_int(fields_[0]))
      model_.hold_node(parse_int(cursor_, place, fields_[0], "a node"), directions, place);
    else
      model_.hold_set(std::string(unquote(fields_[0])), directions, place);
  }
}

/// *ELASTIC, *DENSITY, *DAMPING
void InpReader::read_material_row(const Keyword& keyword) {
  if (keyword.name == "DAMPING") {
    if (material_ == nullptr) return;
    const auto number = [&](const char* key) {
      return keyword.get(key).empty() ? 0.0 : parse_real(cursor_, keyword.place, keyword.get(key), "a damping coefficient");
    };
    material_->alpha2_per_s = number("ALPHA");
    material_->alpha1_s = number("BETA");
    material_->loss_factor = number("STRUCTURAL");
    return skip_data();
  }
  if (material_ == nullptr) cursor_.fail(keyword.place, "*{} comes before *MATERIAL; give *MATERIAL, NAME= first", keyword.name);
  const auto object = [&](const std::string& text) {
    if (material_->problem.empty())
      material_->problem = fmt::format("{}: material '{}': {}", cursor_.find_place(keyword.place), material_->name, text);
  };
  const std::string type = to_upper(keyword.get("TYPE"));
  if (keyword.name == "ELASTIC" && !type.empty() && !type.starts_with("ISO")) {
    object(fmt::format("elasticity of type {} is not read, only isotropic; give \"orthotropic\" in the job", type));
    return skip_data();
  }
  std::string_view line;
  std::size_t place = 0, rows = 0;
  while (next_data(line, place)) {
    if (++rows > 1) {
      object(fmt::format("*{} depends on temperature; keep the row of one temperature", keyword.name));
      continue;
    }
    split(line, fields_);
    if (keyword.name == "DENSITY") {
      material_->density = parse_real(cursor_, place, fields_.empty() ? line : fields_[0], "a density");
      continue;
    }
    if (fields_.size() < 2)
      cursor_.fail(place, "*ELASTIC needs Young's modulus and Poisson's ratio, found {}; correct the line", quote_excerpt(line));
    material_->young = parse_real(cursor_, place, fields_[0], "Young's modulus");
    material_->poisson = parse_real(cursor_, place, fields_[1], "Poisson's ratio");
  }
}

/// Keywords that would change the mesh or its axes.
void InpReader::refuse(const Keyword& keyword) {
  static const std::map<std::string, const char*, std::less<>> kRefused{{"TRANSFORM", "write the supports in the axes of the mesh"},
                                                                        {"ORIENTATION", "give the axes in the job: \"orthotropic\""},
                                                                        {"SYSTEM", "write the nodes in global coordinates"},
                                                                        {"NGEN", "write all nodes"},
                                                                        {"NFILL", "write all nodes"},
                                                                        {"NCOPY", "write all nodes"},
                                                                        {"ELGEN", "write all elements"},
                                                                        {"ELCOPY", "write all elements"},
                                                                        {"SUBMODEL", "write the whole model"}};
  if (const auto found = kRefused.find(keyword.name); found != kRefused.end())
    cursor_.fail(keyword.place, "*{} is not read; {}", keyword.name, found->second);
  static const std::set<std::string, std::less<>> kConstraints{"EQUATION",
                                                               "MPC",
                                                               "TIE",
                                                               "RIGIDBODY",
                                                               "COUPLING",
                                                               "CONTACTPAIR",
                                                               "SPRING",
                                                               "DASHPOT",
                                                               "MASS",
                                                               "CONNECTORSECTION",
                                                               "EMBEDDEDELEMENT",
                                                               "PRE-TENSIONSECTION",
                                                               "CYCLICSYMMETRYMODEL"};
  if (kConstraints.contains(keyword.name))
    model_.remark(keyword.place, fmt::format("*{} is left out: the body vibrates without it", keyword.name));
}

void InpReader::read_section(const Keyword& keyword) {
  const std::string& name = keyword.name;
  if (name == "NODE") return read_nodes(keyword);
  if (name == "ELEMENT") return read_elements(keyword);
  if (name == "NSET" || name == "ELSET") return read_set(keyword, name == "ELSET");
  if (name == "BOUNDARY") return read_boundary(keyword);
  if (name == "ELASTIC" || name == "DENSITY" || name == "DAMPING") return read_material_row(keyword);
  if (name == "MATERIAL") {
    if (keyword.get("NAME").empty()) cursor_.fail(keyword.place, "*MATERIAL without a name; give *MATERIAL, NAME=name");
    material_ = &model_.add_material(keyword.get("NAME"), keyword.place);
  } else if (name == "SOLIDSECTION") {
    if (keyword.has("ORIENTATION"))
      cursor_.fail(keyword.place, "*SOLID SECTION with ORIENTATION is not read; give the axes in the job: \"orthotropic\"");
    if (keyword.get("ELSET").empty() || keyword.get("MATERIAL").empty())
      cursor_.fail(keyword.place, "*SOLID SECTION needs ELSET and MATERIAL; add them");
    model_.set_section(keyword.get("ELSET"), keyword.get("MATERIAL"), keyword.place);
  } else if (name == "STEP") {
    is_in_step_ = true;
    step_ = keyword.place;
  } else if (name == "ENDSTEP") {
    is_in_step_ = false;
  } else if (name == "PART" || name == "INSTANCE") {
    bool& has_one = name == "PART" ? has_part_ : has_instance_;
    if (has_one) cursor_.fail(keyword.place, "a second *{}; write each part as a file of its own", name);
    has_one = true;
  } else if (name == "INCLUDE") {
    cursor_.fail(keyword.place, "*INCLUDE cannot be followed here; join the files");
  } else {
    refuse(keyword);
  }
  skip_data();
}

/// The format has no end: signs of a file that was cut.
void InpReader::check_end() {
  const std::string_view bytes = cursor_.bytes();
  if (!bytes.ends_with('\n'))
    cursor_.fail(bytes.size(), "the file ends within a line; it was cut short: write or copy it again (if it is complete, end the line)");
  if (is_in_step_) cursor_.fail(step_, "this *STEP has no *END STEP; the file was cut short: write or copy it again");
  if ((last_ == "ELEMENT" || last_ == "NODE") && !has_last_comment_ && model_.tet_count() > 0 && model_.has_unused_nodes())
    cursor_.fail(bytes.size(),
                 "the file ends with its elements, and some nodes belong to none; it was cut short: write or copy it again (if it is "
                 "complete, add a line with **)");
}

TetMesh InpReader::read() {
  std::string_view line;
  std::size_t place = 0;
  if (next_data(line, place))
    cursor_.fail(place, "expected a keyword such as *NODE, found {}; the beginning of the file is missing: write it again",
                 quote_excerpt(line));
  while (cursor_.remaining() > 0) {
    const Keyword keyword = read_keyword();
    last_ = keyword.name;
    has_last_comment_ = false;
    read_section(keyword);
  }
  check_end();
  return model_.build("*BOUNDARY");
}

}  // namespace

TetMesh parse_inp(std::string_view bytes, const std::string& name, std::span<const base::TextOrigin> origins) {
  return InpReader(bytes, name, origins).read();
}

}  // namespace carillon::mesh
