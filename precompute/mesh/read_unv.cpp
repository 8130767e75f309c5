// Method: datasets between lines "-1", in one pass; 164 (units), 2411 (nodes), 2412 (elements), 2435, 2452, 2467, 2477 (groups); others are
//   skipped.
// Source: Universal file datasets, SDRC I-DEAS (University of Cincinnati, SDRL). Quadratic tetrahedra (118) go round the base: corners are
//   entries 1, 3, 5, 10.

#include <algorithm>
#include <cmath>

#include "precompute/mesh/cae_model.hpp"
#include "precompute/mesh/fields.hpp"

namespace carillon::mesh {

namespace {

constexpr int kTet4 = 111, kTet10 = 118;
constexpr std::array<int, 10> kRoundBase{0, 2, 4, 9, 1, 3, 5, 6, 7, 8};  // positions of our nodes
constexpr std::int64_t kNodeEntity = 7, kElementEntity = 8;

/// Plural of a solid that is not a tetrahedron; nullptr for all others.
const char* find_solid(std::int64_t type) {
  if (type == 115 || type == 116 || (type >= 104 && type <= 106)) return "hexahedra";
  if (type == 112 || type == 113 || type == 114 || (type >= 101 && type <= 103)) return "wedges";
  return type == 312 || type == 313 ? "pyramids" : nullptr;
}

bool is_beam(std::int64_t type) { return type == 11 || (type >= 21 && type <= 24); }

class UnvReader {
 public:
  UnvReader(std::string_view bytes, const std::string& name) : cursor_(bytes, name), model_(cursor_) { model_.allow_missing_elements(); }
  TetMesh read();

 private:
  bool next_record();
  std::int64_t get_int(std::size_t i, const char* what);
  double get_real(std::size_t i, const char* what);
  void require_record(const char* what);
  void read_dataset(std::int64_t number);
  void read_units();
  void read_nodes();
  void read_elements();
  void read_groups();

  Cursor cursor_;
  CaeModel model_;
  std::string_view line_;
  std::size_t place_ = 0, start_ = 0;  // of the record, of the dataset
  std::int64_t dataset_ = 0;
  std::vector<std::string_view> fields_;
  std::vector<std::int64_t> nodes_, sorted_;
};

void split_blanks(std::string_view line, std::vector<std::string_view>& fields) {
  fields.clear();
  for (std::size_t at = 0; at < line.size();) {
    while (at < line.size() && (line[at] == ' ' || line[at] == '\t' || line[at] == '\r')) ++at;
    const std::size_t begin = at;
    while (at < line.size() && line[at] != ' ' && line[at] != '\t' && line[at] != '\r') ++at;
    if (at > begin) fields.push_back(line.substr(begin, at - begin));
  }
}

/// The next line of the dataset; false at its end.
bool UnvReader::next_record() {
  if (cursor_.remaining() == 0)
    cursor_.fail(start_, "dataset {} does not end with a line -1; the file was cut short: write or copy it again", dataset_);
  place_ = cursor_.place();
  line_ = cursor_.line();
  split_blanks(line_, fields_);
  return !(fields_.size() == 1 && fields_[0] == "-1");
}

void UnvReader::require_record(const char* what) {
  if (!next_record()) cursor_.fail(place_, "dataset {} ends where {} should be; write the file again", dataset_, what);
}

std::int64_t UnvReader::get_int(std::size_t i, const char* what) {
  if (i >= fields_.size()) cursor_.fail(place_, "{} is missing in {}; write the file again", what, quote_excerpt(line_));
  return parse_int(cursor_, place_, fields_[i], what);
}

double UnvReader::get_real(std::size_t i, const char* what) {
  if (i >= fields_.size()) cursor_.fail(place_, "{} is missing in {}; write the file again", what, quote_excerpt(line_));
  return parse_real(cursor_, place_, fields_[i], what);
}

void UnvReader::read_units() {
  require_record("the code of the units");
  require_record("the factors of the units");
  const double factor = get_real(0, "the factor of lengths");
  if (!(factor > 1e-6 && factor < 1e9))
    cursor_.fail(place_, "the factor of lengths is {:g}; it has to be units per metre, 1000 for mm", factor);
  model_.set_unit(1.0 / factor, fmt::format("its unit is {:g} m, by dataset 164", 1.0 / factor));
  while (next_record()) continue;
}

void UnvReader::read_nodes() {
  while (next_record()) {
    const std::size_t place = place_;
    const std::int64_t tag = get_int(0, "the number of a node");
    require_record("the coordinates of a node");
    Vec3 x{};
    for (std::size_t k = 0; k < 3; ++k) x[k] = get_real(k, "a coordinate");
    model_.add_node(tag, x, place);
  }
}

void UnvReader::read_elements() {
  while (next_record()) {
    const std::size_t place = place_;
    const std::int64_t tag = get_int(0, "the number of an element"), type = get_int(1, "the type of an element"),
                       property = get_int(2, "the property of an element"), count = get_int(5, "the number of nodes of an element");
    if (const char* solid = find_solid(type); solid != nullptr)
      cursor_.fail(place, "the mesh holds {} (type {}); only tetrahedra (111, 118) are read: mesh the volume with those", solid, type);
    if (count < 0 || static_cast<std::size_t>(count) > cursor_.remaining())
      cursor_.fail(place, "element {} announces {} nodes; the number is damaged: write the file again", tag, count);
    if (is_beam(type)) require_record("the orientation of a beam");
    nodes_.clear();
    while (std::ssize(nodes_) < count) {
      require_record("the nodes of an element");
      for (std::size_t i = 0; i < fields_.size(); ++i) nodes_.push_back(get_int(i, "the number of a node"));
    }
    const std::int64_t wanted = type == kTet4 ? 4 : type == kTet10 ? 10 : count;
    if (std::ssize(nodes_) != count || count != wanted)
      cursor_.fail(place, "element {} of type {} has {} nodes, not {}; write the file again", tag, type, nodes_.size(), wanted);
    if (type == kTet10) {
      sorted_.resize(10);
      for (std::size_t k = 0; k < 10; ++k) sorted_[k] = nodes_[kRoundBase[k]];
      nodes_ = sorted_;
    }
    if (type == kTet4 || type == kTet10)
      model_.add_tet(tag, nodes_, static_cast<std::int32_t>(std::clamp<std::int64_t>(property, 0, INT32_MAX)), place);
    else
      model_.add_other(tag, fmt::format("elements of type {}", type), nodes_, place);
  }
}

void UnvReader::read_groups() {
  while (next_record()) {
    const std::int64_t number = get_int(0, "the number of a group"), count = get_int(7, "the number of members of a group");
    require_record("the name of a group");
    std::string name(trim(line_));
    if (name.empty()) name = fmt::format("group {}", number);
    CaeModel::Set& nodes = model_.open_set(false, name);
    CaeModel::Set& elements = model_.open_set(true, name);
    std::int64_t found = 0;
    while (found < count) {
      require_record("a member of a group");
      for (std::size_t i = 0; i + 1 < fields_.size() && found < count; i += 4, ++found) {
        const std::int64_t kind = get_int(i, "the kind of a member"), tag = get_int(i + 1, "the number of a member");
        if (kind == kNodeEntity) nodes.members.push_back({tag, place_});
        if (kind == kElementEntity) elements.members.push_back({tag, place_});
      }
      if (fields_.empty())
        cursor_.fail(place_, "the group '{}' has {} members, but announces {}; write the file again", name, found, count);
    }
  }
}

void UnvReader::read_dataset(std::int64_t number) {
  switch (number) {
    case 164:
      return read_units();
    case 2411:
      return read_nodes();
    case 2412:
      return read_elements();
    case 2435:
    case 2452:
    case 2467:
    case 2477:
      return read_groups();
    case 15:
    case 781:
    case 780:
      model_.remark(start_, fmt::format("dataset {} is not read, only 2411 and 2412 for nodes and elements", number));
      break;
    default:
      break;
  }
  while (next_record()) continue;
}

TetMesh UnvReader::read() {
  while (cursor_.skip_space()) {
    start_ = cursor_.place();
    const std::string_view mark = trim(cursor_.line());
    if (mark != "-1")
      cursor_.fail(start_, "expected a line -1 before a dataset, found {}; the file was cut short or damaged: write it again",
                   quote_excerpt(mark));
    if (!cursor_.skip_space())
      cursor_.fail(start_, "the file ends where the number of a dataset should be; it was cut short: write it again");
    place_ = cursor_.place();
    line_ = cursor_.line();
    split_blanks(line_, fields_);
    dataset_ = fields_[0].ends_with('b') ? 0 : get_int(0, "the number of a dataset");
    read_dataset(dataset_);
  }
  return model_.build("");
}

}  // namespace

TetMesh parse_unv(std::string_view bytes, const std::string& name) { return UnvReader(bytes, name).read(); }

}  // namespace carillon::mesh
