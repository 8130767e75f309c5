// Fuzzes scenes: read, or refused with an InputError.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "runtime/scene/scene.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const carillon::scene::Scene scene =
        carillon::scene::parse_scene(carillon::base::parse_document({reinterpret_cast<const char*>(data), size}, "scene.json"));
    carillon::scene::calc_ears(scene.listener);
  } catch (const carillon::InputError&) {
  }
  return 0;
}
