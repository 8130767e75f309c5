// Method: the appended data are cut out, the rest is parsed as XML by pugixml; vtu_data.cpp decodes the arrays. Pieces are concatenated.
//   Parallel files (.pvtu) are refused.
// Source: VTK file formats, "XML File Formats" (The VTK User's Guide). Cell types 10 and 24, and second-order 71 (Lagrange), which has the
//   node order of 24.

#include <algorithm>
#include <array>
#include <cctype>
#include <memory>
#include <pugixml.hpp>
#include <set>

#include "precompute/mesh/build_mesh.hpp"
#include "precompute/mesh/read.hpp"
#include "precompute/mesh/vtu_data.hpp"

namespace carillon::mesh {

namespace {

constexpr std::size_t kMaxSetArrays = 64;

const char* solid_name(std::int64_t type) {
  switch (type) {
    case 11:
      return "voxels";
    case 12:
    case 25:
    case 29:
    case 33:
    case 72:
    case 79:
      return "hexahedra";
    case 13:
    case 26:
    case 31:
    case 32:
    case 73:
    case 80:
      return "prisms (wedges)";
    case 14:
    case 27:
    case 37:
    case 74:
    case 81:
      return "pyramids";
    case 42:
      return "polyhedra";
    case 71:
    case 78:
      return "tetrahedra of higher order";
    default:
      return nullptr;
  }
}

/// Points, lines and surface cells, allowed in a volume mesh.
bool is_surface_cell(std::int64_t type) {
  return (type >= 0 && type <= 9) || (type >= 21 && type <= 23) || type == 28 || type == 30 || (type >= 34 && type <= 36) ||
         (type >= 68 && type <= 70) || (type >= 75 && type <= 77);
}

bool is_integer(const std::string& type) { return type.starts_with("Int") || type.starts_with("UInt"); }

class VtuReader {
 public:
  VtuReader(std::string_view bytes, const std::string& name) : file_(bytes, name) {}
  TetMesh read();

 private:
  struct Piece {
    pugi::xml_node node;
    std::size_t points;
    std::size_t cells;
    std::size_t place;
  };
  void cut_appended();
  void parse_xml();
  VtuEncoding read_encoding(const pugi::xml_node& root) const;
  std::size_t place_of(const pugi::xml_node& node) const;
  std::size_t read_size(const pugi::xml_node& node, const char* key, std::int64_t max = INT32_MAX) const;
  pugi::xml_node find_array(const Piece& piece, const char* parent, const char* name) const;
  template <class T>
  std::vector<T> read_array(const pugi::xml_node& array, std::size_t count);
  void read_piece(const Piece& piece);
  std::vector<std::int64_t> read_regions(const Piece& piece);
  void read_point_sets(const Piece& piece, std::size_t first_node);
  void read_doubt(const pugi::xml_node& array, std::size_t points, std::size_t first_node);

  Cursor file_;
  std::string xml_;         // without appended data
  std::size_t cut_at_ = 0;  // position of the appended data
  std::size_t cut_size_ = 0;
  std::string_view appended_;
  pugi::xml_document document_;
  std::unique_ptr<VtuData> data_;
  RawMesh raw_;
  std::map<std::string, std::vector<std::int64_t>> point_values_;  // concatenated over pieces
  std::set<std::string, std::less<>> numbered_;                    // arrays of these that are not UInt8
  std::vector<Vec3> doubt_m_;
};

void VtuReader::cut_appended() {
  const std::string_view bytes = file_.bytes();
  const auto open = bytes.find("<AppendedData");
  if (open == std::string_view::npos) {
    xml_ = bytes;
    return;
  }
  const auto tag_end = bytes.find('>', open);
  const auto mark = tag_end == std::string_view::npos ? tag_end : bytes.find_first_not_of(" \t\r\n", tag_end + 1);
  if (mark == std::string_view::npos || bytes[mark] != '_')
    file_.fail(open, "<AppendedData> has no '_' before its data; the file was cut short or damaged: write it again");
  const auto close = bytes.rfind("</AppendedData");
  if (close == std::string_view::npos || close < mark)
    file_.fail(open, "<AppendedData> does not end; the file was cut short: write or copy it again");
  appended_ = bytes.substr(mark + 1, close - mark - 1);
  cut_at_ = mark;
  cut_size_ = close - mark;
  xml_ = std::string(bytes.substr(0, mark)) + std::string(bytes.substr(close));
}

std::size_t VtuReader::place_of(const pugi::xml_node& node) const {
  const auto offset = node.offset_debug();
  const std::size_t place = offset < 0 ? 0 : static_cast<std::size_t>(offset);
  return place < cut_at_ || cut_size_ == 0 ? place : place + cut_size_;
}

void VtuReader::parse_xml() {
  const auto result = document_.load_buffer(xml_.data(), xml_.size(), pugi::parse_default, pugi::encoding_utf8);
  if (!result) {
    std::size_t place = std::max<std::ptrdiff_t>(result.offset, 0);
    if (cut_size_ > 0 && place >= cut_at_) place += cut_size_;
    file_.fail(place, "the XML is damaged ({}); write or copy the file again", result.description());
  }
}

VtuEncoding VtuReader::read_encoding(const pugi::xml_node& root) const {
  VtuEncoding encoding;
  const std::string order = root.attribute("byte_order").as_string("LittleEndian");
  if (order != "LittleEndian" && order != "BigEndian")
    file_.fail(place_of(root), "byte_order is {}; it has to be LittleEndian or BigEndian", quote_excerpt(order));
  encoding.swap_bytes = (order == "LittleEndian") != (std::endian::native == std::endian::little);
  const std::string header = root.attribute("header_type").as_string("UInt32");
  if (header != "UInt32" && header != "UInt64")
    file_.fail(place_of(root), "header_type is {}; it has to be UInt32 or UInt64", quote_excerpt(header));
  encoding.header_bytes = header == "UInt32" ? 4 : 8;
  const std::string compressor = root.attribute("compressor").as_string();
  if (!compressor.empty() && compressor != "vtkZLibDataCompressor")
    file_.fail(place_of(root), "the data are compressed with {}, which is not read; save with zlib or no compression",
               quote_excerpt(compressor));
  encoding.zlib = !compressor.empty();
  const std::string appended = root.child("AppendedData").attribute("encoding").as_string("base64");
  encoding.appended_raw = appended == "raw";
  return encoding;
}

std::size_t VtuReader::read_size(const pugi::xml_node& node, const char* key, std::int64_t max) const {
  const std::string text = node.attribute(key).as_string();
  Cursor number(text, file_.name());
  try {
    return number.text_int(key, 0, max);
  } catch (const InputError&) {
    file_.fail(place_of(node), "{} is {}; it has to be a whole number from 0 to {}: write the mesh again", key, quote_excerpt(text), max);
  }
}

pugi::xml_node VtuReader::find_array(const Piece& piece, const char* parent, const char* name) const {
  const pugi::xml_node owner = piece.node.child(parent);
  for (const pugi::xml_node& array : owner.children("DataArray"))
    if (name == nullptr || std::string_view(array.attribute("Name").as_string()) == name) return array;
  file_.fail(place_of(owner ? owner : piece.node), "<{}> has no DataArray {}; the file was cut short or damaged: write the mesh again",
             parent, name == nullptr ? "" : name);
}

template <class T>
std::vector<T> VtuReader::read_array(const pugi::xml_node& array, std::size_t count) {
  const std::string format = array.attribute("format").as_string("ascii");
  const std::uint64_t offset = format == "appended" ? read_size(array, "offset", INT64_MAX) : 0;
  return data_->read<T>(array.attribute("Name").as_string("Points"), array.attribute("type").as_string(), format, array.child_value(),
                        offset, count, place_of(array));
}

std::vector<std::int64_t> VtuReader::read_regions(const Piece& piece) {
  std::vector<pugi::xml_node> arrays;
  pugi::xml_node chosen;
  for (const pugi::xml_node& array : piece.node.child("CellData").children("DataArray")) {
    if (!is_integer(array.attribute("type").as_string()) || array.attribute("NumberOfComponents").as_int(1) != 1) continue;
    arrays.push_back(array);
    if (!chosen && is_region_name(array.attribute("Name").as_string())) chosen = array;
  }
  if (!chosen && arrays.size() == 1) chosen = arrays[0];
  return chosen ? read_array<std::int64_t>(chosen, piece.cells) : std::vector<std::int64_t>(piece.cells, 0);
}

void VtuReader::read_point_sets(const Piece& piece, std::size_t first_node) {
  std::size_t arrays = 0;
  for (const pugi::xml_node& array : piece.node.child("PointData").children("DataArray")) {
    const std::string name = array.attribute("Name").as_string();
    if (name == kDoubtName && array.attribute("NumberOfComponents").as_int(1) == 3) read_doubt(array, piece.points, first_node);
    if (name.empty() || !is_integer(array.attribute("type").as_string()) || array.attribute("NumberOfComponents").as_int(1) != 1) continue;
    // These arrays are a convenience; hundreds of them are not node sets.
    if (++arrays > kMaxSetArrays || (point_values_.size() >= kMaxSetArrays && !point_values_.contains(name))) break;
    const auto values = read_array<std::int64_t>(array, piece.points);
    if (array.attribute("type").as_string() != std::string_view("UInt8")) numbered_.insert(name);
    auto& all = point_values_[name];
    all.resize(first_node, 0);
    all.insert(all.end(), values.begin(), values.end());
  }
}

void VtuReader::read_doubt(const pugi::xml_node& array, std::size_t points, std::size_t first_node) {
  const auto values = read_array<double>(array, 3 * points);
  doubt_m_.resize(first_node);
  for (std::size_t i = 0; i < points; ++i) {
    doubt_m_.push_back({values[3 * i], values[3 * i + 1], values[3 * i + 2]});
    for (const double x : doubt_m_.back())
      if (!std::isfinite(x)) file_.fail(place_of(array), "an offset between two surfaces is not finite; write the mesh again");
  }
}

void VtuReader::read_piece(const Piece& piece) {
  const std::size_t first_node = raw_.nodes.size();
  if (piece.points == 0 && piece.cells == 0) return;
  const auto points = find_array(piece, "Points", nullptr);
  if (points.attribute("NumberOfComponents").as_int(3) != 3)
    file_.fail(place_of(points), "Points have {} components; they need 3: write the mesh again",
               points.attribute("NumberOfComponents").as_int());
  const auto x = read_array<double>(points, 3 * piece.points);
  for (std::size_t i = 0; i < piece.points; ++i)
    raw_.add_node(file_, static_cast<std::int64_t>(first_node + i), {x[3 * i], x[3 * i + 1], x[3 * i + 2]}, place_of(points));
  read_point_sets(piece, first_node);
  if (piece.cells == 0) return;
  const auto types = read_array<std::int64_t>(find_array(piece, "Cells", "types"), piece.cells);
  const auto offsets_array = find_array(piece, "Cells", "offsets");
  const auto offsets = read_array<std::int64_t>(offsets_array, piece.cells);
  const auto connectivity_array = find_array(piece, "Cells", "connectivity");
  if (offsets.back() < 0) file_.fail(place_of(offsets_array), "the last offset is {}; write the mesh again", offsets.back());
  const auto connectivity = read_array<std::int64_t>(connectivity_array, static_cast<std::size_t>(offsets.back()));
  const auto regions = read_regions(piece);
  const std::size_t place = place_of(connectivity_array);
  std::int64_t begin = 0;
  for (std::size_t c = 0; c < piece.cells; ++c) {
    const std::int64_t end = offsets[c];
    if (end < begin || end > offsets.back())
      file_.fail(place_of(offsets_array), "offset {} of cell {} does not lie between its neighbours; write the mesh again", end, c + 1);
    const auto size = end - begin;
    const auto type = types[c];
    const bool tet = type == 10 || type == 24 || (type == 71 && (size == 4 || size == 10));
    if (tet) {
      if ((type == 10 && size != 4) || (type == 24 && size != 10))
        file_.fail(place_of(offsets_array), "cell {} is a tetrahedron of {} nodes; it has to have {}: write the mesh again", c + 1, size,
                   type == 10 ? 4 : 10);
      std::array<std::int64_t, 10> tags{};
      for (std::int64_t k = 0; k < size; ++k) {
        const auto node = connectivity[begin + k];
        if (node < 0 || node >= static_cast<std::int64_t>(piece.points))
          file_.fail(place, "cell {} refers to point {}, but the points run from 0 to {}; write the mesh again", c + 1, node,
                     static_cast<std::int64_t>(piece.points) - 1);
        tags[k] = static_cast<std::int64_t>(first_node) + node;
      }
      const auto region = std::clamp<std::int64_t>(regions[c], INT32_MIN, INT32_MAX);
      raw_.add_tet(file_, static_cast<std::int64_t>(raw_.tet_tags.size()) + 1, tags.data(), static_cast<int>(size), kVtkOrder,
                   static_cast<std::int32_t>(region), place);
    } else if (const char* solid = solid_name(type); solid != nullptr) {
      file_.fail(place, "cell {} is of type {}: the mesh holds {}; only tetrahedra (types 10 and 24) are read: mesh the volume with those",
                 c + 1, type, solid);
    } else if (!is_surface_cell(type)) {
      file_.fail(place, "cell {} is of type {}, which VTK does not know; the file was damaged: write the mesh again", c + 1, type);
    } else {
      ++raw_.others[fmt::format("cells of VTK type {}", type)];
    }
    begin = end;
  }
}

TetMesh VtuReader::read() {
  cut_appended();
  parse_xml();
  const pugi::xml_node root = document_.child("VTKFile");
  if (!root) file_.fail(0, "the root element is not <VTKFile>; this is not a VTU file");
  const std::string type = root.attribute("type").as_string();
  if (type != "UnstructuredGrid")
    file_.fail(place_of(root), "the file holds {}, not an UnstructuredGrid; save the tetrahedra as one .vtu file", quote_excerpt(type));
  data_ = std::make_unique<VtuData>(file_, read_encoding(root), appended_);
  const pugi::xml_node grid = root.child("UnstructuredGrid");
  if (!grid) file_.fail(place_of(root), "<UnstructuredGrid> is missing; the file was cut short or damaged: write it again");
  for (const pugi::xml_node& node : grid.children("Piece"))
    read_piece({node, read_size(node, "NumberOfPoints"), read_size(node, "NumberOfCells"), place_of(node)});
  TetMesh mesh = build_mesh(std::move(raw_), file_, file_);
  if (!doubt_m_.empty()) doubt_m_.resize(mesh.nodes_m.size());
  mesh.doubt_m = std::move(doubt_m_);
  for (auto& [name, values] : point_values_) {
    auto& set = mesh.node_sets[name];
    for (std::size_t i = 0; i < values.size(); ++i)
      if (values[i] != 0) set.push_back(static_cast<std::int32_t>(i));
    const bool is_flag = std::all_of(values.begin(), values.end(), [](std::int64_t value) { return value == 0 || value == 1; });
    if (!is_flag || numbered_.contains(name)) add_value_sets(name, values, 0, mesh);
  }
  return mesh;
}

}  // namespace

bool is_region_name(std::string name) {
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
  constexpr std::array kWords{"region", "material", "physical", "ref", "entity", "domain", "zone", "block", "marker"};
  return std::any_of(kWords.begin(), kWords.end(), [&](const char* word) { return name.find(word) != std::string::npos; });
}

TetMesh parse_vtu(std::string_view bytes, const std::string& name) { return VtuReader(bytes, name).read(); }

}  // namespace carillon::mesh
