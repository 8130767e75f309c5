// glTF and GLB, for changes that last: the input is the JSON up to the first NUL and then the binary chunk, put into a container of the
// right lengths, which a change of any byte would make wrong. fuzz_surface has the container itself.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "precompute/mesher/triangle_surface.hpp"
#include "runtime/base/error.hpp"

namespace {

void put(std::string& bytes, std::size_t value) {
  const auto word = static_cast<std::uint32_t>(value);
  bytes.append(reinterpret_cast<const char*>(&word), sizeof word);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace carillon;
  const std::string_view input(reinterpret_cast<const char*>(data), size);
  const std::string_view json = input.substr(0, input.find('\0'));
  const std::string_view binary = input.substr(std::min(json.size() + 1, size));
  std::string glb = "glTF";
  put(glb, 2);
  put(glb, 28 + json.size() + binary.size());
  put(glb, json.size());
  glb.append("JSON").append(json);
  put(glb, binary.size());
  glb.append("BIN\0", 4).append(binary);
  for (const auto& [bytes, format] : {std::pair{std::string_view(glb), "glb"}, {json, "gltf"}}) {
    try {
      const mesher::TriangleSurface surface = mesher::parse_surface(bytes, "fuzz", format);
      const auto points = static_cast<std::int32_t>(surface.points.size());
      for (const auto& triangle : surface.triangles)
        for (const std::int32_t corner : triangle)
          if (corner < 0 || corner >= points) __builtin_trap();
    } catch (const InputError&) {
    }
  }
  return 0;
}
