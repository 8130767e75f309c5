// All mesh readers and the check after them. The first byte selects the format; TetGen's two files are separated by a NUL byte.
#include <cstddef>
#include <cstdint>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/read.hpp"
#include "runtime/base/error.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace carillon::mesh;
  if (size == 0) return 0;
  const auto format = static_cast<MeshFormat>(data[0] % 7);
  try {
    TetMesh mesh = parse_mesh({reinterpret_cast<const std::byte*>(data) + 1, size - 1}, "fuzz", format);
    check_mesh(mesh);
    extract_boundary(to_linear(to_quadratic(mesh)));
  } catch (const carillon::InputError&) {
  }
  return 0;
}
