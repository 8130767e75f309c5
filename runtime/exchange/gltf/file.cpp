// Method: base::Document parses the JSON; indices, offsets and lengths are checked before use.
// Source: glTF 2.0 specification, Khronos 2021 (ISO/IEC 12113:2022): chapters 3.6 (buffers, views, accessors) and 4 (GLB).
// Deviations: sparse accessors and compressed buffers are rejected.
#include "runtime/exchange/gltf/file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <filesystem>
#include <limits>

#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/foreign.hpp"
#include "runtime/base/percent.hpp"
#include "runtime/exchange/gltf/chunks.hpp"

namespace carillon::gltf {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF is little-endian and is read unchanged.");

constexpr long long kHuge = 1LL << 40;
constexpr std::uint64_t kMaxBufferBytes = 4ULL << 30;                      // all buffers
constexpr std::size_t kMaxTextBytes = 256U << 20, kMaxValues = 3'000'000;  // JSON limits, which bound its memory

std::uint32_t read_u32(std::string_view bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

/// Decoded base64; nullopt if invalid.
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

/// Throws InputError for a text that would take too much memory.
base::Document parse_json(std::string_view json, const std::string& name) {
  if (json.size() > kMaxTextBytes)
    throw InputError(fmt::format("{}: its JSON has {} MiB, more than {}; export it as a .glb file, whose buffers are binary", name,
                                 json.size() >> 20, kMaxTextBytes >> 20));
  const auto values = std::count_if(json.begin(), json.end(), [](char c) { return c == ',' || c == '{' || c == '['; });
  if (static_cast<std::size_t>(values) > kMaxValues)
    throw InputError(
        fmt::format("{}: its JSON has more than {} values; export the object alone, without the rest of its scene", name, kMaxValues));
  return base::parse_document(json, name);
}

/// As find_index(), for a required index.
std::size_t require_index(base::Object& object, const char* key, std::size_t size, const char* what) {
  const std::optional<std::size_t> index = find_index(object, key, size, what);
  if (!index) object.fail("", fmt::format("\"{}\" is missing, the index of a {}; export it again", key, what));
  return *index;
}

std::size_t count_components(std::string_view type) { return type == "SCALAR" ? 1 : type == "VEC2" ? 2 : 3; }

std::size_t find_component_bytes(long long component) {
  constexpr std::size_t kSizes[] = {1, 1, 2, 2, 0, 4, 4};
  return kSizes[component - 5120];
}

}  // namespace

std::optional<std::size_t> find_index(base::Object& object, const char* key, std::size_t size, const char* what) {
  const std::optional<long long> index =
      object.integer_if(key, std::numeric_limits<long long>::min(), std::numeric_limits<long long>::max());
  if (index && (*index < 0 || static_cast<unsigned long long>(*index) >= size))
    object.fail(key, fmt::format("is {}, but no {} has this index (there are {}); export it again", *index, what, size));
  return index ? std::optional(static_cast<std::size_t>(*index)) : std::nullopt;
}

File::File(std::string_view json, std::optional<std::string_view> binary, const std::string& name)
    : name_(name), document_(parse_json(json, name)), root_(document_.root()) {
  document_.show_paths();
  check();
  views_ = root_.objects("bufferViews");
  accessors_ = root_.objects("accessors");
  open_buffers(binary);
}

void File::check() {
  base::Object asset = root_.object("asset");
  if (!asset.string("version").starts_with("2")) asset.fail("version", "only glTF 2 is read; convert it first");
  for (const base::Entry& entry : root_.entries("extensionsRequired", 1000)) {
    if (entry.text == kDraco || entry.text == "EXT_meshopt_compression" || entry.text == "KHR_meshopt_compression")
      root_.fail("extensionsRequired", fmt::format("its meshes are compressed ({}); export it without compression", entry.text));
  }
}

void File::open_buffers(std::optional<std::string_view> binary) {
  std::vector<base::Object> buffers = root_.objects("buffers");
  std::uint64_t total = 0;
  for (base::Object& buffer : buffers) {
    total += static_cast<std::uint64_t>(buffer.integer("byteLength", 1, kHuge));
    if (total > kMaxBufferBytes)
      buffer.fail("byteLength", fmt::format("the buffers have more than {} GiB in all; export the object alone", kMaxBufferBytes >> 30));
  }
  for (std::size_t b = 0; b < buffers.size(); ++b) {
    base::Object& buffer = buffers[b];
    const std::size_t length = buffer.integer("byteLength", 1, kHuge);
    if (!buffer.has("uri")) {
      if (b != 0 || !binary) buffer.fail("", fmt::format("buffer {} has no bytes: neither a \"uri\" nor a binary chunk", b));
      if (binary->size() < length)
        buffer.fail("byteLength", fmt::format("buffer 0 has {} bytes, but the binary chunk {}", length, binary->size()));
      buffers_.emplace_back(binary->substr(0, length));
      continue;
    }
    owned_.push_back(std::make_unique<std::string>(read_uri(buffer)));
    if (owned_.back()->size() < length)
      buffer.fail("byteLength", fmt::format("buffer {} has {} bytes, but its source {}", b, length, owned_.back()->size()));
    buffers_.emplace_back(std::string_view(*owned_.back()).substr(0, length));
  }
}

/// A file in the same folder, or inline data.
std::string File::read_uri(base::Object& buffer) const {
  const std::string uri = buffer.string("uri");
  if (uri.starts_with("data:")) {
    const std::size_t comma = uri.find(";base64,");
    const auto bytes = comma == std::string::npos ? std::nullopt : decode_base64(std::string_view(uri).substr(comma + 8));
    if (!bytes) buffer.fail("uri", "its data is not base64; export it again");
    return *bytes;
  }
  const std::optional<std::string> decoded = base::decode_percent(uri);
  const std::filesystem::path file = decoded.value_or("");
  if (!decoded || decoded->empty() || file.is_absolute() || std::find(file.begin(), file.end(), "..") != file.end() ||
      decoded->find("://") != std::string::npos)
    buffer.fail("uri", "is not a file in the same folder; put it there, or export a single .glb file");
  const std::filesystem::path place = std::filesystem::path(name_).parent_path() / file;
  std::error_code error;
  if (!std::filesystem::exists(place, error))
    buffer.fail("uri", fmt::format("{}: there is no such file; put it there, or export a single .glb file", place.string()));
  const std::filesystem::path folder = std::filesystem::canonical(std::filesystem::absolute(name_).parent_path(), error);
  const std::filesystem::path real = std::filesystem::canonical(place, error);
  if (error || std::mismatch(folder.begin(), folder.end(), real.begin(), real.end()).first != folder.end())
    buffer.fail("uri", "is a link out of the folder; put the file itself there");
  return base::read_file(place, "buffer of a glTF file", kMaxBufferBytes);
}

std::string_view File::find_view(std::size_t number, base::Object& view) {
  const std::string_view buffer = buffers_[require_index(view, "buffer", buffers_.size(), "buffer")];
  const std::size_t at = view.integer_if("byteOffset", 0, kHuge).value_or(0);
  const std::size_t size = view.integer("byteLength", 1, kHuge);
  if (at > buffer.size() || size > buffer.size() - at)
    view.fail("byteLength", fmt::format("bufferView {} ends at byte {} of a buffer of {}", number, at + size, buffer.size()));
  return buffer.substr(at, size);
}

std::string_view File::read_view(base::Object& owner, const char* key) {
  const std::size_t number = require_index(owner, key, views_.size(), "bufferView");
  return find_view(number, views_[number]);
}

Numbers File::read(base::Object& owner, const char* key, const char* type, std::initializer_list<Component> components) {
  const std::size_t a = require_index(owner, key, accessors_.size(), "accessor");
  base::Object& accessor = accessors_[a];
  if (accessor.has("sparse")) accessor.fail("sparse", "sparse accessors are not read; export it again without them");
  if (accessor.string("type") != type) accessor.fail("type", fmt::format("accessor {} is used as {} and has to be {}", a, key, type));
  Numbers numbers;
  const long long component = accessor.integer("componentType", 5120, 5126);
  numbers.component_ = static_cast<Component>(component);
  if (std::find(components.begin(), components.end(), numbers.component_) == components.end())
    accessor.fail("componentType", fmt::format("{} is not a type of {} (\"{}\")", component,
                                               components.size() == kIndexTypes.size() ? "an index" : "a position", key));
  numbers.is_normalised_ = accessor.boolean_or("normalized", false);
  numbers.count_ = accessor.integer("count", 1, kHuge);
  const std::size_t size = find_component_bytes(component) * count_components(type);
  if (!accessor.has("bufferView")) accessor.fail("", fmt::format("accessor {} has no \"bufferView\"; export it again", a));
  const std::size_t v = require_index(accessor, "bufferView", views_.size(), "bufferView");
  base::Object& view = views_[v];
  const std::string_view bytes = find_view(v, view);
  numbers.stride_ = view.integer_if("byteStride", 4, 252).value_or(static_cast<long long>(size));
  if (numbers.stride_ < size)
    view.fail("byteStride", fmt::format("bufferView {} has a stride of {} for {} bytes", v, numbers.stride_, size));
  const std::size_t at = accessor.integer_if("byteOffset", 0, kHuge).value_or(0);
  if (at > bytes.size() || size > bytes.size() - at || (numbers.count_ - 1) > (bytes.size() - at - size) / numbers.stride_)
    accessor.fail("count", fmt::format("accessor {} has {} entries of {} bytes, more than its bufferView of {} holds", a, numbers.count_,
                                       size, bytes.size()));
  numbers.bytes_ = bytes.substr(at);
  return numbers;
}

File parse_text(std::string_view text, const std::string& name) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);  // UTF-8 byte-order mark
  return File(text, std::nullopt, name);
}

File parse(std::string_view bytes, const std::string& name) {
  base::refuse_utf16(bytes, name);
  const auto begin = bytes.find_first_not_of("\xEF\xBB\xBF \t\r\n");
  return begin != std::string_view::npos && bytes[begin] == '{' ? parse_text(bytes, name) : parse_glb(bytes, name);
}

File parse_glb(std::string_view bytes, const std::string& name) {
  const auto refuse = [&](const std::string& message) { throw InputError(fmt::format("{}: {}", name, message)); };
  if (!bytes.starts_with(kMagic)) refuse("not a GLB file: it does not begin with \"glTF\"");
  if (bytes.size() < kHeaderBytes + kChunkBytes) refuse("the file ends inside its header");
  if (read_u32(bytes, 4) != kGlbVersion)
    refuse(fmt::format("a GLB file of version {}; version 2 is read, convert it first", read_u32(bytes, 4)));
  if (read_u32(bytes, 8) != bytes.size())
    refuse(fmt::format("it states {} bytes, but has {}: truncated or extended", read_u32(bytes, 8), bytes.size()));
  std::optional<std::string_view> json, binary;
  for (std::size_t at = kHeaderBytes; at < bytes.size();) {
    if (bytes.size() - at < kChunkBytes) refuse("it ends inside the header of a chunk");
    const std::size_t length = read_u32(bytes, at);
    const std::uint32_t type = read_u32(bytes, at + 4);
    if (length > bytes.size() - at - kChunkBytes)
      refuse(fmt::format("a chunk of {} bytes begins at byte {} and does not fit the file", length, at));
    const std::string_view chunk = bytes.substr(at + kChunkBytes, length);
    if (type == kJsonChunk && !json) json = chunk;
    if (type == kBinaryChunk && !binary) binary = chunk;
    at += kChunkBytes + length;
  }
  if (!json) refuse("it has no JSON chunk");
  while (json->ends_with(' ') || json->ends_with('\0')) json->remove_suffix(1);
  return File(*json, binary, name);
}

}  // namespace carillon::gltf
