// Method: views follow one another in one buffer, each aligned to the size of its numbers.
// Source: glTF 2.0 specification, Khronos 2021 (ISO/IEC 12113:2022): chapters 3.6 and 4.
#include "runtime/exchange/gltf/writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <vector>

#include "runtime/base/error.hpp"
#include "runtime/exchange/gltf/chunks.hpp"
#include "runtime/exchange/gltf/file.hpp"

namespace carillon::gltf {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF is little-endian and is written unchanged.");

constexpr int kVertexTarget = 34962, kIndexTarget = 34963;  // targets of mesh views
constexpr std::size_t kMaxShortVertices = 65535;            // index 65535 would restart a primitive

template <class T>
void put(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

void pad(std::string& bytes, std::size_t multiple, char with) {
  while (bytes.size() % multiple != 0) bytes += with;
}

}  // namespace

Writer::Writer(const std::string& generator) : json_(base::Json::object()), views_(base::Json::array()), accessors_(base::Json::array()) {
  base::Json asset = base::Json::object();
  asset.set("version", "2.0").set("generator", generator);
  json_.set("asset", asset);
}

template <class T>
int Writer::add_view(std::span<const T> values, std::size_t alignment, int target, std::size_t later_bytes) {
  pad(buffer_, alignment, '\0');
  base::Json view = base::Json::object();
  view.set("buffer", 0).set("byteOffset", buffer_.size()).set("byteLength", values.size_bytes() + later_bytes);
  if (target != 0) view.set("target", target);
  views_.add(view);
  buffer_.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
  return view_count_++;
}

int Writer::add_accessor(int view, int component, const char* type, std::size_t count) {
  base::Json accessor = base::Json::object();
  accessor.set("bufferView", view).set("componentType", component).set("count", count).set("type", type);
  accessors_.add(accessor);
  return accessor_count_++;
}

int Writer::add_vertices(std::span<const float> rows, bool has_bounds) {
  const int view = add_view(rows, sizeof(float), kVertexTarget);
  base::Json accessor = base::Json::object();
  accessor.set("bufferView", view)
      .set("componentType", static_cast<int>(Component::kFloat))
      .set("count", rows.size() / 3)
      .set("type", "VEC3");
  if (has_bounds) {
    std::array<double, 3> low{}, high{};
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const auto x = static_cast<double>(rows[i]);
      low[i % 3] = i < 3 ? x : std::min(low[i % 3], x);
      high[i % 3] = i < 3 ? x : std::max(high[i % 3], x);
    }
    accessor.set("min", base::Json::array(low)).set("max", base::Json::array(high));
  }
  accessors_.add(accessor);
  return accessor_count_++;
}

int Writer::add_indices(std::span<const std::int32_t> corners, std::size_t vertices) {
  if (vertices <= kMaxShortVertices) {
    const std::vector<std::uint16_t> narrow(corners.begin(), corners.end());
    const int view = add_view(std::span<const std::uint16_t>(narrow), sizeof(std::uint32_t), kIndexTarget);
    return add_accessor(view, static_cast<int>(Component::kUnsignedShort), "SCALAR", corners.size());
  }
  const int view = add_view(corners, sizeof(std::uint32_t), kIndexTarget);
  return add_accessor(view, static_cast<int>(Component::kUnsignedInt), "SCALAR", corners.size());
}

int Writer::add_scalars(std::span<const float> values) {
  return add_accessor(add_view(values, sizeof(float), 0), static_cast<int>(Component::kFloat), "SCALAR", values.size());
}

int Writer::add_pairs(std::span<const float> values) {
  return add_accessor(add_view(values, sizeof(float), 0), static_cast<int>(Component::kFloat), "VEC2", values.size() / 2);
}

int Writer::add_rows(std::size_t blocks, std::size_t rows, const std::function<void(std::size_t, std::span<float>)>& fill) {
  const int view = add_view(std::span<const float>(), sizeof(float), 0, 3 * sizeof(float) * blocks * rows);
  buffer_.reserve(buffer_.size() + 3 * sizeof(float) * blocks * rows);
  std::vector<float> numbers(3 * rows);
  for (std::size_t block = 0; block < blocks; ++block) {
    fill(block, numbers);
    buffer_.append(reinterpret_cast<const char*>(numbers.data()), sizeof(float) * numbers.size());
  }
  return add_accessor(view, static_cast<int>(Component::kFloat), "VEC3", blocks * rows);
}

int Writer::add_bytes(std::span<const std::byte> bytes) { return add_view(bytes, sizeof(double), 0); }

void Writer::write_glb(const std::function<void(std::string_view)>& sink) const {
  base::Json root = json_, buffers = base::Json::array(), buffer = base::Json::object();
  buffer.set("byteLength", buffer_.size());
  buffers.add(buffer);
  root.set("buffers", buffers).set("bufferViews", views_).set("accessors", accessors_);
  std::string text = root.line();
  pad(text, 4, ' ');
  const std::size_t padding = (4 - buffer_.size() % 4) % 4;
  const std::uint64_t length = kHeaderBytes + 2 * kChunkBytes + text.size() + buffer_.size() + padding;
  if (length > std::numeric_limits<std::uint32_t>::max())
    throw InputError(
        fmt::format("the file would have {:.3g} GB, and GLB allows 4.29 GB; keep fewer modes", 1e-9 * static_cast<double>(length)));
  std::string head(kMagic);
  put(head, kGlbVersion);
  put(head, static_cast<std::uint32_t>(length));
  put(head, static_cast<std::uint32_t>(text.size()));
  put(head, kJsonChunk);
  head += text;
  put(head, static_cast<std::uint32_t>(buffer_.size() + padding));
  put(head, kBinaryChunk);
  sink(head);
  sink(buffer_);
  sink(std::string(padding, '\0'));
}

}  // namespace carillon::gltf
