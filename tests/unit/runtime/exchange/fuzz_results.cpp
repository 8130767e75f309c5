// Arbitrary bytes as modes of other solvers: a bank, or an InputError. The first byte chooses the format.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/exchange/solved_model.hpp"
#include "runtime/material/table.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace carillon;
  try {
    const std::string_view bytes(reinterpret_cast<const char*>(data), size);
    const auto model =
        size > 0 && data[0] == '-' ? exchange::parse_unv(bytes.substr(1), "fuzz.unv") : exchange::parse_frd(bytes, "fuzz.frd");
    (void)exchange::make_bank(model, "fuzz", {.material = &material::MaterialTable::get().require("", "steel").material}, nullptr);
  } catch (const InputError&) {
  }
  return 0;
}
