// Method:     The triangles of all meshes of the scene, moved by their nodes. Everything that a number of the file points at is checked
//             before it is read; what bends or moves the meshes, and compressed ones, are refused.
// Source:     glTF 2.0 specification, Khronos 2021 (ISO/IEC 12113:2022): chapters 3 (accessors, nodes) and 4 (GLB).
// Deviations: materials, textures, lights and cameras are not looked at.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "precompute/mesher/surface_text.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/file.hpp"

namespace carillon::mesher {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF is little-endian and is read as it is.");

constexpr long long kHuge = 1LL << 40;
constexpr int kMaxDepth = 200;
constexpr std::uint64_t kMaxBufferBytes = 4ULL << 30;                      // of all buffers
constexpr std::size_t kMaxTextBytes = 256U << 20, kMaxValues = 3'000'000;  // of the JSON: what it takes in memory is in proportion
constexpr const char* kDraco = "KHR_draco_mesh_compression";
constexpr std::uint32_t kJsonChunk = 0x4E4F534A, kBinaryChunk = 0x004E4942;

using Matrix = std::array<double, 16>;  // column by column
constexpr Matrix kIdentity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

Matrix multiply(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 4; ++k) c[4 * j + i] += a[4 * k + i] * b[4 * j + k];
  return c;
}

Vec3 move(const Matrix& m, const Vec3& p) {
  Vec3 q{m[12], m[13], m[14]};
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) q[i] += m[4 * k + i] * p[k];
  return q;
}

double calc_determinant(const Matrix& m) { return dot(Vec3{m[0], m[1], m[2]}, cross(Vec3{m[4], m[5], m[6]}, Vec3{m[8], m[9], m[10]})); }

std::uint32_t read_u32(std::string_view bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

/// The bytes of base64; nothing where they are none.
std::optional<std::string> decode_base64(std::string_view text) {
  while (text.ends_with('=')) text.remove_suffix(1);
  std::string bytes;
  std::uint32_t bits = 0;
  int count = 0;
  for (const char c : text) {
    const int value = c >= 'A' && c <= 'Z'   ? c - 'A'
                      : c >= 'a' && c <= 'z' ? c - 'a' + 26
                      : c >= '0' && c <= '9' ? c - '0' + 52
                      : c == '+'             ? 62
                      : c == '/'             ? 63
                                             : -1;
    if (value < 0) return std::nullopt;
    bits = bits << 6 | static_cast<std::uint32_t>(value);
    count += 6;
    if (count >= 8) {
      count -= 8;
      bytes += static_cast<char>(bits >> count & 0xff);
    }
  }
  return bytes;
}

/// A URI without its escapes (RFC 3986, 2.1); nothing where one is none.
std::optional<std::string> decode_percent(std::string_view uri) {
  std::string text;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] != '%') {
      text += uri[i];
      continue;
    }
    unsigned value = 0;
    const char* const begin = uri.data() + i + 1;
    if (uri.size() - i < 3 || std::from_chars(begin, begin + 2, value, 16).ptr != begin + 2 || value == 0) return std::nullopt;
    text += static_cast<char>(value);
    i += 2;
  }
  return text;
}

/// Throws InputError for a text that would take too much memory.
void check_text(std::string_view json, const std::string& name) {
  if (json.size() > kMaxTextBytes)
    throw InputError(fmt::format("{}: its JSON has {} MiB, and {} are the most; export it as a .glb file, whose buffers are binary", name,
                                 json.size() >> 20, kMaxTextBytes >> 20));
  const auto values = std::count_if(json.begin(), json.end(), [](char c) { return c == ',' || c == '{' || c == '['; });
  if (static_cast<std::size_t>(values) > kMaxValues)
    throw InputError(
        fmt::format("{}: its JSON has more than {} values; export the object alone, without the rest of its scene", name, kMaxValues));
}

/// The numbers of an accessor where they lie.
struct Numbers {
  std::string_view bytes;
  std::size_t count = 0, stride = 0;
  int component = 0;  // 5120 ... 5126
  bool is_normalised = false;

  double get(std::size_t i, std::size_t c) const {
    const char* at = bytes.data() + i * stride;
    switch (component) {
      case 5120:
        return scale(read<std::int8_t>(at, c), 127);
      case 5121:
        return scale(read<std::uint8_t>(at, c), 255);
      case 5122:
        return scale(read<std::int16_t>(at, c), 32767);
      case 5123:
        return scale(read<std::uint16_t>(at, c), 65535);
      case 5125:
        return read<std::uint32_t>(at, c);
      default:
        return static_cast<double>(read<float>(at, c));
    }
  }

 private:
  template <class T>
  static T read(const char* at, std::size_t c) {
    T value{};
    std::memcpy(&value, at + c * sizeof(T), sizeof(T));
    return value;
  }
  double scale(double value, double largest) const { return is_normalised ? std::max(value / largest, -1.0) : value; }
};

class Gltf {
 public:
  Gltf(std::string_view json, std::optional<std::string_view> binary, const std::string& name)
      : name_(name), document_(parse(json, name)), root_(document_.root()), binary_(binary) {
    views_ = root_.objects("bufferViews");
    accessors_ = root_.objects("accessors");
    meshes_ = root_.objects("meshes");
    nodes_ = root_.objects("nodes");
    is_used_.assign(nodes_.size(), false);
  }

  PolygonSoup read() {
    check();
    open_buffers();
    std::vector<base::Object> scenes = root_.objects("scenes");
    if (scenes.empty()) {
      for (std::size_t m = 0; m < meshes_.size(); ++m) add_mesh(m, kIdentity);
    } else {
      base::Object& scene = scenes[find_index(root_, "scene", scenes.size(), "scene").value_or(0)];
      for (const std::size_t node : list_nodes(scene, "nodes")) add_node(node, kIdentity, 0);
    }
    if (soup_.counts.empty())
      throw InputError(fmt::format("{}: no triangles in its scene ({} meshes, {} nodes); export the mesh of the object with it", name_,
                                   meshes_.size(), nodes_.size()));
    return std::move(soup_);
  }

 private:
  static base::Document parse(std::string_view json, const std::string& name) {
    check_text(json, name);
    return base::parse_document(json, name);
  }

  /// What this file is, and what it needs to be read.
  void check() {
    base::Object asset = root_.object("asset");
    if (!asset.string("version").starts_with("2")) asset.fail("version", "only glTF 2 is read; convert it first");
    for (const base::Entry& entry : root_.entries("extensionsRequired", 1000)) {
      if (entry.text == kDraco || entry.text == "EXT_meshopt_compression" || entry.text == "KHR_meshopt_compression")
        root_.fail("extensionsRequired", fmt::format("its meshes are compressed ({}); export it without compression", entry.text));
    }
    if (!root_.objects("animations").empty())
      root_.fail("animations", "it is animated, and a body keeps its shape; export it still, without animations");
  }

  /// The number of one of `size` things. `what`: one of them.
  static std::optional<std::size_t> find_index(base::Object& object, const char* key, std::size_t size, const char* what) {
    const std::optional<long long> index =
        object.integer_if(key, std::numeric_limits<long long>::min(), std::numeric_limits<long long>::max());
    if (index && (*index < 0 || static_cast<unsigned long long>(*index) >= size))
      object.fail(key, fmt::format("is {}, and no {} has this number (there are {}); export it again", *index, what, size));
    return index ? std::optional(static_cast<std::size_t>(*index)) : std::nullopt;
  }
  static std::size_t require_index(base::Object& object, const char* key, std::size_t size, const char* what) {
    const std::optional<std::size_t> index = find_index(object, key, size, what);
    if (!index) object.fail("", fmt::format("\"{}\" is missing here, the number of a {}; export it again", key, what));
    return *index;
  }

  void open_buffers() {
    std::vector<base::Object> buffers = root_.objects("buffers");
    std::uint64_t total = 0;
    for (base::Object& buffer : buffers) {
      total += static_cast<std::uint64_t>(buffer.integer("byteLength", 1, kHuge));
      if (total > kMaxBufferBytes)
        buffer.fail("byteLength",
                    fmt::format("all buffers up to here have more than {} GiB; export the object alone", kMaxBufferBytes >> 30));
    }
    for (std::size_t b = 0; b < buffers.size(); ++b) {
      base::Object& buffer = buffers[b];
      const auto length = static_cast<std::size_t>(buffer.integer("byteLength", 1, kHuge));
      if (!buffer.has("uri")) {
        if (b != 0 || !binary_) buffer.fail("", fmt::format("buffer {} has no bytes: neither a \"uri\" nor a binary chunk", b));
        if (binary_->size() < length)
          buffer.fail("byteLength", fmt::format("buffer 0 has {} bytes, and the binary chunk {}", length, binary_->size()));
        buffers_.emplace_back(binary_->substr(0, length));
        continue;
      }
      owned_.push_back(std::make_unique<std::string>(read_uri(buffer)));
      if (owned_.back()->size() < length)
        buffer.fail("byteLength", fmt::format("buffer {} has {} bytes, and its source {}", b, length, owned_.back()->size()));
      buffers_.emplace_back(std::string_view(*owned_.back()).substr(0, length));
    }
  }

  /// A file next to this one, or bytes in the text itself.
  std::string read_uri(base::Object& buffer) {
    const std::string uri = buffer.string("uri");
    if (uri.starts_with("data:")) {
      const std::size_t comma = uri.find(";base64,");
      const auto bytes = comma == std::string::npos ? std::nullopt : decode_base64(std::string_view(uri).substr(comma + 8));
      if (!bytes) buffer.fail("uri", "its data are not base64; export it again");
      return *bytes;
    }
    const std::optional<std::string> decoded = decode_percent(uri);
    const std::filesystem::path file = decoded.value_or("");
    if (!decoded || decoded->empty() || file.is_absolute() || decoded->find("..") != std::string::npos ||
        decoded->find("://") != std::string::npos)
      buffer.fail("uri", "is no file next to this one; put it there, or export one .glb file");
    return base::read_file(std::filesystem::path(name_).parent_path() / file, "buffer of a glTF file", kMaxBufferBytes);
  }

  /// The indices of a list that is one of nodes.
  std::vector<std::size_t> list_nodes(base::Object& object, const char* key) {
    std::vector<std::size_t> list;
    if (!object.has(key)) return list;
    for (const double number : object.number_list(key, 10'000'000)) {
      if (!(number >= 0 && number < static_cast<double>(nodes_.size()) && number == std::floor(number)))
        object.fail(key, fmt::format("{:g} is no node; there are {}", number, nodes_.size()));
      list.push_back(static_cast<std::size_t>(number));
    }
    return list;
  }

  static Matrix read_transform(base::Object& node) {
    if (node.has("matrix")) return node.numbers<16>("matrix");
    const auto t = node.numbers_or<3>("translation", {0, 0, 0}), s = node.numbers_or<3>("scale", {1, 1, 1});
    auto q = node.numbers_or<4>("rotation", {0, 0, 0, 1});
    const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(length > 0)) node.fail("rotation", "is no rotation; it has to be a unit quaternion");
    for (double& x : q) x /= length;
    const auto [x, y, z, w] = q;
    return {s[0] * (1 - 2 * (y * y + z * z)),
            s[0] * 2 * (x * y + z * w),
            s[0] * 2 * (x * z - y * w),
            0,
            s[1] * 2 * (x * y - z * w),
            s[1] * (1 - 2 * (x * x + z * z)),
            s[1] * 2 * (y * z + x * w),
            0,
            s[2] * 2 * (x * z + y * w),
            s[2] * 2 * (y * z - x * w),
            s[2] * (1 - 2 * (x * x + y * y)),
            0,
            t[0],
            t[1],
            t[2],
            1};
  }

  void add_node(std::size_t n, const Matrix& parent, int depth) {
    base::Object& node = nodes_[n];
    if (is_used_[n]) node.fail("", fmt::format("node {} hangs in two places, or inside itself; export it again", n));
    if (depth > kMaxDepth) node.fail("", fmt::format("nodes lie {} deep in each other; join them in a modeller", kMaxDepth));
    is_used_[n] = true;
    if (node.has("skin")) node.fail("skin", "its mesh is bent by bones (a skin), and a body keeps its shape; apply the pose in a modeller");
    const Matrix own = multiply(parent, read_transform(node));
    if (std::optional<base::Object> extensions = node.object_if("extensions"); extensions && extensions->has("EXT_mesh_gpu_instancing"))
      node.fail("extensions", "its mesh is drawn in many places (EXT_mesh_gpu_instancing); make copies of it in a modeller");
    if (const auto mesh = find_index(node, "mesh", meshes_.size(), "mesh")) add_mesh(*mesh, own);
    for (const std::size_t child : list_nodes(node, "children")) add_node(child, own, depth + 1);
  }

  void add_mesh(std::size_t m, const Matrix& matrix) {
    for (base::Object& primitive : meshes_[m].objects("primitives")) {
      constexpr long long kTriangles = 4, kStrip = 5, kFan = 6;
      const long long mode = primitive.integer_if("mode", 0, 6).value_or(kTriangles);
      if (mode < kTriangles) continue;  // points and lines
      if (primitive.has("targets")) primitive.fail("targets", "it has morph targets, and a body keeps its shape; apply one in a modeller");
      if (std::optional<base::Object> extensions = primitive.object_if("extensions"); extensions && extensions->has(kDraco))
        primitive.fail("extensions", fmt::format("its meshes are compressed ({}); export it without compression", kDraco));
      base::Object attributes = primitive.object("attributes");
      if (!attributes.has("POSITION")) continue;
      const Numbers points = read_accessor(attributes, "POSITION", "VEC3");
      const auto first = static_cast<std::int64_t>(soup_.points.size());
      if (points.count > static_cast<std::size_t>(3 * kMaxTriangles - first)) refuse_size();
      for (std::size_t i = 0; i < points.count; ++i) {
        const Vec3 p = move(matrix, {points.get(i, 0), points.get(i, 1), points.get(i, 2)});
        for (const double x : p)
          if (!(std::abs(x) < kLargestCoordinate)) primitive.fail("", fmt::format("point {} of mesh {} lies nowhere: {}", i, m, x));
        soup_.points.push_back(p);
      }
      add_triangles(primitive, m, static_cast<std::int32_t>(first), points.count,
                    mode == kStrip ? 1
                    : mode == kFan ? 2
                                   : 0,
                    calc_determinant(matrix) < 0);
    }
  }

  [[noreturn]] void refuse_size() const { throw InputError(fmt::format("{}: {}", name_, kTooManyTriangles)); }

  /// kind: 0 triangles, 1 strip, 2 fan.
  void add_triangles(base::Object& primitive, std::size_t m, std::int32_t first, std::size_t points, int kind, bool is_mirrored) {
    std::optional<Numbers> indices;
    if (primitive.has("indices")) indices = read_accessor(primitive, "indices", "SCALAR");
    const std::size_t corners = indices ? indices->count : points;
    if (kind == 0 && corners % 3 != 0)
      primitive.fail("", fmt::format("mesh {} has {} corners, which are no whole number of triangles; export it again", m, corners));
    if (corners / (kind == 0 ? 3 : 1) + soup_.counts.size() > static_cast<std::size_t>(kMaxTriangles)) refuse_size();
    const auto get = [&](std::size_t i) {
      const auto index = static_cast<std::size_t>(indices ? indices->get(i, 0) : static_cast<double>(i));
      if (index >= points) primitive.fail("indices", fmt::format("mesh {} has {} points, and its index {} is {}", m, points, i, index));
      return first + static_cast<std::int32_t>(index);
    };
    const std::size_t count = kind == 0 ? corners / 3 : corners < 3 ? 0 : corners - 2;
    for (std::size_t t = 0; t < count; ++t) {
      std::array<std::int32_t, 3> triangle = kind == 0    ? std::array{get(3 * t), get(3 * t + 1), get(3 * t + 2)}
                                             : kind == 2  ? std::array{get(0), get(t + 1), get(t + 2)}
                                             : t % 2 == 0 ? std::array{get(t), get(t + 1), get(t + 2)}
                                                          : std::array{get(t + 1), get(t), get(t + 2)};
      if (is_mirrored) std::swap(triangle[1], triangle[2]);
      soup_.add_triangle(triangle[0], triangle[1], triangle[2]);
    }
  }

  Numbers read_accessor(base::Object& owner, const char* key, const char* type) {
    const std::size_t a = require_index(owner, key, accessors_.size(), "accessor");
    base::Object& accessor = accessors_[a];
    if (accessor.has("sparse")) accessor.fail("sparse", "sparse accessors are not read; export it again without them");
    if (accessor.string("type") != type) accessor.fail("type", fmt::format("accessor {} is used as {} and has to be {}", a, key, type));
    Numbers numbers;
    numbers.component = static_cast<int>(accessor.integer("componentType", 5120, 5126));
    numbers.is_normalised = accessor.boolean_or("normalized", false);
    constexpr std::size_t kSizes[] = {1, 1, 2, 2, 0, 4, 4};
    const std::size_t component = kSizes[numbers.component - 5120];
    const bool is_index = std::string_view(type) == "SCALAR";
    if (component == 0 || (is_index && numbers.component != 5121 && numbers.component != 5123 && numbers.component != 5125))
      accessor.fail("componentType", fmt::format("{} is no type of {}", numbers.component, is_index ? "an index" : "a position"));
    numbers.count = static_cast<std::size_t>(accessor.integer("count", 1, kHuge));
    const std::size_t size = component * (is_index ? 1 : 3);
    if (!accessor.has("bufferView"))
      accessor.fail("", fmt::format("accessor {} has no \"bufferView\", and so no numbers; export it again", a));
    const std::size_t v = require_index(accessor, "bufferView", views_.size(), "bufferView");
    base::Object& view = views_[v];
    const std::string_view buffer = buffers_[require_index(view, "buffer", buffers_.size(), "buffer")];
    const auto view_at = static_cast<std::size_t>(view.integer_if("byteOffset", 0, kHuge).value_or(0));
    const auto view_size = static_cast<std::size_t>(view.integer("byteLength", 1, kHuge));
    if (view_at > buffer.size() || view_size > buffer.size() - view_at)
      view.fail("byteLength", fmt::format("bufferView {} ends at byte {} of a buffer of {}", v, view_at + view_size, buffer.size()));
    numbers.stride = static_cast<std::size_t>(view.integer_if("byteStride", 4, 252).value_or(static_cast<long long>(size)));
    if (numbers.stride < size)
      view.fail("byteStride", fmt::format("bufferView {} has a stride of {} for {} bytes", v, numbers.stride, size));
    const auto at = static_cast<std::size_t>(accessor.integer_if("byteOffset", 0, kHuge).value_or(0));
    if (at > view_size || size > view_size - at || (numbers.count - 1) > (view_size - at - size) / numbers.stride)
      accessor.fail("count", fmt::format("accessor {} has {} entries of {} bytes, more than its bufferView of {} holds", a, numbers.count,
                                         size, view_size));
    numbers.bytes = buffer.substr(view_at + at);
    return numbers;
  }

  const std::string& name_;
  base::Document document_;
  base::Object root_;
  std::optional<std::string_view> binary_;
  std::vector<base::Object> views_, accessors_, meshes_, nodes_;
  std::vector<bool> is_used_;
  std::vector<std::string_view> buffers_;
  std::vector<std::unique_ptr<std::string>> owned_;
  PolygonSoup soup_;
};

}  // namespace

PolygonSoup parse_gltf(std::string_view bytes, const std::string& name) { return Gltf(bytes, std::nullopt, name).read(); }

PolygonSoup parse_glb(std::string_view bytes, const std::string& name) {
  constexpr std::size_t kHeader = 12, kChunk = 8;
  const auto refuse = [&](const std::string& message) { throw InputError(fmt::format("{}: {}", name, message)); };
  if (!bytes.starts_with("glTF")) refuse("no GLB file: it does not begin with \"glTF\"");
  if (bytes.size() < kHeader + kChunk) refuse("the file ends inside its header");
  if (read_u32(bytes, 4) != 2) refuse(fmt::format("a GLB file of version {}; version 2 is read, convert it first", read_u32(bytes, 4)));
  if (read_u32(bytes, 8) != bytes.size())
    refuse(
        fmt::format("it says that it has {} bytes, and has {}: it was cut off, or something was added", read_u32(bytes, 8), bytes.size()));
  std::optional<std::string_view> json, binary;
  for (std::size_t at = kHeader; at < bytes.size();) {
    if (bytes.size() - at < kChunk) refuse("it ends inside the header of a chunk");
    const std::size_t length = read_u32(bytes, at);
    const std::uint32_t type = read_u32(bytes, at + 4);
    if (length > bytes.size() - at - kChunk)
      refuse(fmt::format("a chunk of {} bytes begins at byte {} and does not fit the file", length, at));
    const std::string_view chunk = bytes.substr(at + kChunk, length);
    if (type == kJsonChunk && !json) json = chunk;
    if (type == kBinaryChunk && !binary) binary = chunk;
    at += kChunk + length;
  }
  if (!json) refuse("it has no JSON chunk");
  while (json->ends_with(' ') || json->ends_with('\0')) json->remove_suffix(1);
  return Gltf(*json, binary, name).read();
}

}  // namespace carillon::mesher
