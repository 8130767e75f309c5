// Method: the header defines the elements and their properties; all are parsed, and x, y, z of the vertices and the corners of the faces
//   are kept. Every count is compared with the remaining bytes before allocation. Triangle strips are refused; other elements and
//   properties are skipped.
// Source: G. Turk, "The PLY Polygon File Format", Stanford University, 1994.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "precompute/mesh/cursor.hpp"
#include "precompute/mesher/surface_text.hpp"

namespace carillon::mesher {
namespace {

using mesh::quote_excerpt;

struct Type {
  std::array<std::string_view, 2> names;
  int bytes;
  bool is_real, is_signed;
};
constexpr std::array<Type, 8> kTypes{{{{"char", "int8"}, 1, false, true},
                                      {{"uchar", "uint8"}, 1, false, false},
                                      {{"short", "int16"}, 2, false, true},
                                      {{"ushort", "uint16"}, 2, false, false},
                                      {{"int", "int32"}, 4, false, true},
                                      {{"uint", "uint32"}, 4, false, false},
                                      {{"float", "float32"}, 4, true, true},
                                      {{"double", "float64"}, 8, true, true}}};

struct Property {
  std::string_view name;
  const Type* type = nullptr;
  const Type* count_type = nullptr;  // of a list
  int axis = -1;                     // 0, 1, 2: a coordinate of a vertex
  bool is_corners = false;           // the corners of a face
};

struct Element {
  std::string_view name;
  std::int64_t count = 0, line = 0;
  std::vector<Property> properties;
  bool is_vertex() const { return name == "vertex"; }
};

enum class Encoding { kText, kLittle, kBig };

class PlyReader {
 public:
  PlyReader(std::string_view bytes, const std::string& name) : bytes_(bytes), text_(bytes, name, '\0') {}
  PolygonSoup read();

 private:
  void read_header();
  void read_element_line();
  void read_property_line();
  const Type& find_type(std::string_view word) const;
  void check_header() const;
  void read_text(const Element& element);
  void read_binary(const Element& element);
  void add_corner(std::int64_t index) {
    soup_.corners.push_back(static_cast<std::int32_t>(std::clamp<std::int64_t>(index, -1, INT32_MAX)));
  }
  void end_face(std::size_t corners, std::int64_t face, std::size_t place);
  double read_binary_number(const Type& type, const char* what);
  std::int64_t read_binary_whole(const Type& type, const char* what) { return static_cast<std::int64_t>(read_binary_number(type, what)); }
  [[noreturn]] void refuse_byte(std::size_t place, const std::string& message) const {
    throw InputError(fmt::format("{}: byte {}: {}", text_.name(), place, message));
  }

  std::string_view bytes_;
  SurfaceText text_;
  std::vector<std::string_view> words_;
  std::vector<Element> elements_;
  Encoding encoding_ = Encoding::kText;
  std::int64_t vertices_ = 0;
  std::size_t at_ = 0;  // in the binary part
  PolygonSoup soup_;
};

const Type& PlyReader::find_type(std::string_view word) const {
  for (const Type& type : kTypes)
    if (word == type.names[0] || word == type.names[1]) return type;
  text_.refuse("{} is no type of a property (char, uchar, short, ushort, int, uint, float or double are); export the surface again",
               quote_excerpt(word));
}

void PlyReader::read_element_line() {
  const auto count = words_.size() == 3 ? read_whole(words_[2]) : std::nullopt;
  if (!count) text_.refuse("an element needs a name and a count; export the surface again");
  // Each takes at least one byte.
  if (*count < 0 || *count > static_cast<std::int64_t>(bytes_.size()))
    text_.refuse("the header promises {} {}, but the file has only {} bytes; it is cut off or damaged, export it again", *count,
                 quote_excerpt(words_[1]), bytes_.size());
  if (*count > kMaxPoints) text_.refuse("{} of {} are too many; reduce the surface first", *count, quote_excerpt(words_[1]));
  for (const Element& element : elements_)
    if (element.name == words_[1]) text_.refuse("a second element {}; export the surface again", quote_excerpt(words_[1]));
  elements_.push_back({words_[1], *count, text_.number(), {}});
}

void PlyReader::read_property_line() {
  if (elements_.empty()) text_.refuse("a property before the first element; export the surface again");
  Element& element = elements_.back();
  const bool is_list = words_.size() > 1 && words_[1] == "list";
  if (words_.size() != (is_list ? 5u : 3u))
    text_.refuse("a property needs a type and a name, a list two types and a name; export the surface again");
  Property property{.name = words_.back(), .type = &find_type(words_[is_list ? 3 : 1])};
  if (is_list) {
    property.count_type = &find_type(words_[2]);
    if (property.count_type->is_real) text_.refuse("the length of a list cannot be of type {}; export the surface again", words_[2]);
    property.is_corners = element.name == "face" && (property.name == "vertex_indices" || property.name == "vertex_index");
    if (property.is_corners && property.type->is_real)
      text_.refuse("the corners of a face cannot be of type {}; export the surface again", words_[3]);
  } else if (element.is_vertex() && property.name.size() == 1 && property.name[0] >= 'x' && property.name[0] <= 'z') {
    property.axis = property.name[0] - 'x';
  }
  for (const Property& other : element.properties)
    if ((property.axis >= 0 && other.axis == property.axis) || (property.is_corners && other.is_corners))
      text_.refuse("a second property {}; export the surface again", quote_excerpt(property.name));
  element.properties.push_back(property);
}

void PlyReader::read_header() {
  constexpr int kMaxLines = 10000;
  if (!text_.next(words_) || words_.size() != 1 || words_[0] != "ply") text_.refuse("line 1 is not 'ply'; this is no PLY file");
  bool has_format = false;
  for (int line = 0;; ++line) {
    if (line > kMaxLines || !text_.next(words_)) text_.refuse("the header has no end_header; the file is cut off, export it again");
    if (words_.empty() || words_[0] == "comment" || words_[0] == "obj_info") continue;
    if (words_[0] == "end_header") break;
    if (words_[0] == "format") {
      const std::string_view kind = words_.size() > 1 ? words_[1] : "";
      if (kind != "ascii" && kind != "binary_little_endian" && kind != "binary_big_endian")
        text_.refuse("unknown format {}; a PLY file is ascii, binary_little_endian or binary_big_endian", quote_excerpt(kind));
      encoding_ = kind == "ascii" ? Encoding::kText : kind == "binary_big_endian" ? Encoding::kBig : Encoding::kLittle;
      has_format = true;
    } else if (words_[0] == "element") {
      read_element_line();
    } else if (words_[0] == "property") {
      read_property_line();
    } else {
      text_.refuse("found {} where a line of the header (element, property ... end_header) should be; export the surface again",
                   quote_excerpt(words_[0]));
    }
  }
  if (!has_format) text_.refuse("the header has no format; export the surface again");
  check_header();
}

void PlyReader::check_header() const {
  bool has_vertices = false, has_faces = false;
  for (const Element& element : elements_) {
    const auto refuse = [&](const std::string& message) { text_.refuse_line(element.line, message + "; export the surface again"); };
    if (element.properties.empty() && element.count > 0) refuse(fmt::format("the element {} has no property", quote_excerpt(element.name)));
    if (element.name == "tristrips") refuse("triangle strips are not read: write faces instead");
    int axes = 0;
    bool corners = false;
    for (const Property& property : element.properties) axes += property.axis >= 0, corners = corners || property.is_corners;
    if (element.is_vertex() && axes != 3) refuse("the element vertex needs the properties x, y and z");
    if (element.name == "face" && !corners && element.count > 0) refuse("the element face needs a list vertex_indices");
    has_vertices = has_vertices || element.is_vertex();
    has_faces = has_faces || element.name == "face";
  }
  if (!has_vertices || !has_faces)
    text_.refuse("no triangles in it: the header names no element {}; a closed triangle surface is needed",
                 has_vertices ? "face" : "vertex");
}

void PlyReader::end_face(std::size_t corners, std::int64_t face, std::size_t place) {
  for (std::size_t c = soup_.corners.size() - corners; c < soup_.corners.size(); ++c)
    if (soup_.corners[c] < 0 || soup_.corners[c] >= vertices_) {
      const std::string message =
          fmt::format("face {} names a vertex that does not exist (0 to {} do); export the surface again", face + 1, vertices_ - 1);
      if (encoding_ == Encoding::kText) text_.refuse("{}", message);
      refuse_byte(place, message);
    }
  if (corners < 3)
    soup_.corners.resize(soup_.corners.size() - corners);
  else
    soup_.counts.push_back(static_cast<std::int32_t>(corners));
}

void PlyReader::read_text(const Element& element) {
  for (std::int64_t n = 0; n < element.count; ++n) {
    if (!text_.next_filled(words_))
      text_.refuse("the file ends after {} of {} of its element {}; it is cut off, export it again", n, element.count,
                   quote_excerpt(element.name));
    std::size_t at = 0;
    const auto take = [&]() -> std::string_view {
      if (at == words_.size()) text_.refuse("the line has fewer values than the header says; export the surface again");
      return words_[at++];
    };
    if (element.is_vertex()) soup_.points.emplace_back();
    for (const Property& property : element.properties) {
      if (property.count_type == nullptr) {
        const std::string_view word = take();
        if (property.axis >= 0) soup_.points.back()[property.axis] = text_.read_coordinate(word);
        continue;
      }
      const std::string_view word = take();
      const auto length = read_whole(word);
      if (!length || *length < 0 || *length > static_cast<std::int64_t>(words_.size() - at))
        text_.refuse("the {} promises {} corners and has {}; export the surface again", property.is_corners ? "face" : "list",
                     quote_excerpt(word), words_.size() - at);
      for (std::int64_t c = 0; c < *length; ++c) {
        const std::string_view corner = take();
        if (!property.is_corners) continue;
        const auto index = read_whole(corner);
        if (!index || *index < 0 || *index >= vertices_)
          text_.refuse("the face names the vertex {}, which does not exist (0 to {} do); export the surface again", quote_excerpt(corner),
                       vertices_ - 1);
        add_corner(*index);
      }
      if (property.is_corners) end_face(static_cast<std::size_t>(*length), n, 0);
    }
    if (at != words_.size()) text_.refuse("the line has {} values and the header says {}; export the surface again", words_.size(), at);
  }
}

double PlyReader::read_binary_number(const Type& type, const char* what) {
  const std::size_t size = type.bytes;
  if (bytes_.size() - at_ < size) refuse_byte(at_, fmt::format("the file ends where {} should be; it is cut off, export it again", what));
  std::uint64_t bits = 0;
  for (std::size_t b = 0; b < size; ++b) {
    const std::size_t place = encoding_ == Encoding::kBig ? b : size - 1 - b;
    bits = (bits << 8) | static_cast<unsigned char>(bytes_[at_ + place]);
  }
  at_ += size;
  if (type.is_real) return size == 4 ? std::bit_cast<float>(static_cast<std::uint32_t>(bits)) : std::bit_cast<double>(bits);
  if (type.is_signed && size < 8 && (bits >> (8 * size - 1)) != 0)
    return static_cast<double>(bits) - std::ldexp(1.0, static_cast<int>(8 * size));
  return static_cast<double>(bits);
}

void PlyReader::read_binary(const Element& element) {
  std::size_t row_bytes = 0;
  for (const Property& property : element.properties)
    row_bytes += static_cast<std::size_t>(property.count_type ? property.count_type->bytes : property.type->bytes);
  if (element.count > 0 && static_cast<std::uint64_t>(element.count) > (bytes_.size() - at_) / row_bytes)
    refuse_byte(
        at_, fmt::format("the header promises {} {}, but only {} bytes are left for them; the file is cut off or damaged, export it again",
                         element.count, quote_excerpt(element.name), bytes_.size() - at_));
  if (element.is_vertex()) soup_.points.reserve(element.count);
  for (std::int64_t n = 0; n < element.count; ++n) {
    if (element.is_vertex()) soup_.points.emplace_back();
    for (const Property& property : element.properties) {
      const std::size_t place = at_;
      if (property.count_type == nullptr) {
        const double value = read_binary_number(*property.type, "a property");
        if (property.axis < 0) continue;
        if (!(std::abs(value) <= kLargestCoordinate))
          refuse_byte(place,
                      fmt::format("the coordinate {} of vertex {} must be a finite number below 1e30; export the surface again", value, n));
        soup_.points.back()[property.axis] = value;
        continue;
      }
      const std::int64_t length = read_binary_whole(*property.count_type, "the length of a list");
      const std::size_t size = property.type->bytes;
      if (length < 0 || static_cast<std::uint64_t>(length) > (bytes_.size() - at_) / size)
        refuse_byte(place, fmt::format("a list of {} values where {} bytes are left; the file is cut off or damaged, export it again",
                                       length, bytes_.size() - at_));
      if (!property.is_corners) {
        at_ += size * static_cast<std::size_t>(length);
        continue;
      }
      for (std::int64_t c = 0; c < length; ++c) add_corner(read_binary_whole(*property.type, "a corner of a face"));
      end_face(static_cast<std::size_t>(length), n, place);
    }
  }
}

PolygonSoup PlyReader::read() {
  read_header();
  for (const Element& element : elements_)
    if (element.is_vertex()) vertices_ = element.count;
  at_ = text_.at();
  for (const Element& element : elements_) encoding_ == Encoding::kText ? read_text(element) : read_binary(element);
  return std::move(soup_);
}

}  // namespace

PolygonSoup parse_ply(std::string_view bytes, const std::string& name) { return PlyReader(bytes, name).read(); }

}  // namespace carillon::mesher
