// Reader of glTF 2 files: JSON, buffers and accessors. Lengths and offsets are checked before bytes are read; the caller interprets the
// rest of the JSON.
//
//   gltf::File file = gltf::parse_glb(bytes, "body.glb");
//   base::Object attributes = ...;                                   // from file.root()
//   const gltf::Numbers points = file.read(attributes, "POSITION", "VEC3", gltf::kVertexTypes);
//
// All errors are InputError that begins with the file name. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/document.hpp"

namespace carillon::gltf {

inline constexpr const char* kDraco = "KHR_draco_mesh_compression";

/// Optional index `key` of `object` into `size` elements called `what`. Throws InputError if out of range.
std::optional<std::size_t> find_index(base::Object& object, const char* key, std::size_t size, const char* what);

/// Component types, values as in the file.
enum class Component : std::uint16_t {
  kByte = 5120,
  kUnsignedByte = 5121,
  kShort = 5122,
  kUnsignedShort = 5123,
  kUnsignedInt = 5125,
  kFloat = 5126
};
inline constexpr std::initializer_list<Component> kIndexTypes{Component::kUnsignedByte, Component::kUnsignedShort, Component::kUnsignedInt};
inline constexpr std::initializer_list<Component> kVertexTypes{Component::kByte,          Component::kUnsignedByte, Component::kShort,
                                                               Component::kUnsignedShort, Component::kUnsignedInt,  Component::kFloat};

/// View of an accessor: `count` entries of one (SCALAR), two (VEC2) or three (VEC3) numbers. Valid as long as the file.
class Numbers {
 public:
  std::size_t count() const { return count_; }
  /// Component `c` of entry `i`, both in range; normalised types give -1 to 1.
  double get(std::size_t i, std::size_t c) const {
    const char* at = bytes_.data() + i * stride_;
    switch (component_) {
      case Component::kByte:
        return scale(read<std::int8_t>(at, c), 127);
      case Component::kUnsignedByte:
        return scale(read<std::uint8_t>(at, c), 255);
      case Component::kShort:
        return scale(read<std::int16_t>(at, c), 32767);
      case Component::kUnsignedShort:
        return scale(read<std::uint16_t>(at, c), 65535);
      case Component::kUnsignedInt:
        return read<std::uint32_t>(at, c);
      default:
        return static_cast<double>(read<float>(at, c));
    }
  }

 private:
  friend class File;
  template <class T>
  static T read(const char* at, std::size_t c) {
    T value{};
    std::memcpy(&value, at + c * sizeof(T), sizeof(T));
    return value;
  }
  double scale(double value, double largest) const {
    const double share = value / largest;
    return is_normalised_ ? (share < -1.0 ? -1.0 : share) : value;
  }

  std::string_view bytes_;
  std::size_t count_ = 0, stride_ = 0;
  Component component_ = Component::kFloat;
  bool is_normalised_ = false;
};

/// Returned buffers, views and accessors lie within the file's bytes.
class File {
 public:
  base::Object root() const { return root_; }
  const std::string& name() const { return name_; }

  /// Accessor `key` of `owner`, of that type and one of these component types. Throws InputError if missing, sparse or beyond its bytes.
  Numbers read(base::Object& owner, const char* key, const char* type, std::initializer_list<Component> components);
  /// Bytes of the buffer view `key` of `owner`.
  std::string_view read_view(base::Object& owner, const char* key);

 private:
  friend File parse_glb(std::string_view bytes, const std::string& name);
  friend File parse_text(std::string_view text, const std::string& name);
  File(std::string_view json, std::optional<std::string_view> binary, const std::string& name);
  void check();
  void open_buffers(std::optional<std::string_view> binary);
  std::string read_uri(base::Object& buffer) const;
  std::string_view find_view(std::size_t number, base::Object& view);

  std::string name_;
  base::Document document_;
  base::Object root_;
  std::vector<base::Object> views_, accessors_;
  std::vector<std::string_view> buffers_;
  std::vector<std::unique_ptr<std::string>> owned_;
};

/// Opens a GLB file; `bytes` must outlive the result. `name`: its path, also for files it refers to. Throws InputError for other bytes,
/// glTF 1, compressed meshes and missing buffer data.
File parse_glb(std::string_view bytes, const std::string& name);
/// The same for a .gltf file.
File parse_text(std::string_view text, const std::string& name);
/// Either, by the first bytes.
File parse(std::string_view bytes, const std::string& name);

}  // namespace carillon::gltf
