// The surface readers, and the repair of what they read. The first byte selects the format.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "precompute/mesher/quiet.hpp"
#include "precompute/mesher/surface.hpp"
#include "precompute/mesher/triangle_surface.hpp"
#include "runtime/base/error.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace carillon;
  if (size == 0) return 0;
  constexpr const char* kFormats[] = {"obj", "off", "ply", "stl", "glb", "gltf"};
  const mesher::Quiet quiet;
  try {
    auto surface = mesher::parse_surface({reinterpret_cast<const char*>(data) + 1, size - 1}, "fuzz", kFormats[data[0] % 6]);
    // The cost of repair grows with the triangles; the readers are done by now.
    if (surface.triangles.size() > 300) return 0;
    mesher::SurfaceReport report;
    mesher::repair_surface(std::move(surface), {.surface = "fuzz"}, report);
  } catch (const InputError&) {
  }
  return 0;
}
