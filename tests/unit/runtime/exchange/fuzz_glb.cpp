// Arbitrary bytes as a GLB file with modes: a bank, or an InputError; with and without carillon-bank's extras.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/exchange/glb.hpp"
#include "runtime/material/table.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace carillon;
  for (const bool is_plain : {false, true}) {
    try {
      (void)exchange::parse_glb({reinterpret_cast<const char*>(data), size}, "fuzz.glb",
                                {.model = {},
                                 .ignores_extras = is_plain,
                                 .material = is_plain ? &material::MaterialTable::get().require("", "steel").material : nullptr});
    } catch (const InputError&) {
    }
  }
  return 0;
}
