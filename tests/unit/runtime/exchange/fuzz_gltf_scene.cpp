// Arbitrary bytes as a glTF scene: banks and a scene file that is read again, or an InputError.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/exchange/gltf_scene.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace carillon;
  try {
    const exchange::GltfScene made = exchange::read_gltf_scene({reinterpret_cast<const char*>(data), size}, "fuzz.gltf", {},
                                                               [](const std::string& /*file*/, const bank::Bank& bank) {
                                                                 if (!bank::find_faults(bank).empty()) __builtin_trap();
                                                               });
    if (!base::Json::parse(made.scene.text())) __builtin_trap();
  } catch (const InputError&) {
  }
  return 0;
}
