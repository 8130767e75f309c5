// Arbitrary bytes as modes of CalculiX: a bank, or an InputError.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/exchange/frd.hpp"
#include "runtime/material/table.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace carillon;
  try {
    (void)exchange::parse_frd({reinterpret_cast<const char*>(data), size}, "fuzz.frd",
                              {.material = &material::MaterialTable::get().require("", "steel").material});
  } catch (const InputError&) {
  }
  return 0;
}
