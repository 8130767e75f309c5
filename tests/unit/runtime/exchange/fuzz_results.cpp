// Arbitrary bytes as modes of other solvers, or as measured frequency responses: a bank or modes, or an InputError. The first byte chooses
// the format; a punch file is followed by a zero byte and its bulk data.
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/base/includes.hpp"
#include "runtime/exchange/frf.hpp"
#include "runtime/exchange/measured.hpp"
#include "runtime/exchange/solved_model.hpp"
#include "runtime/material/table.hpp"

namespace {

carillon::exchange::SolvedModel parse(std::string_view bytes) {
  using namespace carillon;
  if (bytes.starts_with('-')) return exchange::parse_unv(bytes.substr(1), "fuzz.unv");
  if (!bytes.starts_with('$')) return exchange::parse_frd(bytes, "fuzz.frd");
  const std::size_t zero = bytes.find('\0');
  const std::string mesh(zero == std::string_view::npos ? std::string_view() : bytes.substr(zero + 1));
  return exchange::parse_pch(bytes.substr(0, zero), "fuzz.pch", {mesh, {}}, "fuzz.bdf");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace carillon;
  try {
    const std::string_view bytes(reinterpret_cast<const char*>(data), size);
    if (bytes.starts_with('u')) {
      (void)exchange::find_modes(exchange::parse_frfs(bytes.substr(1), "fuzz.uff"), "fuzz.uff");
      return 0;
    }
    (void)exchange::make_bank(parse(bytes), "fuzz", {.material = &material::MaterialTable::get().require("", "steel").material}, nullptr);
  } catch (const InputError&) {
  }
  return 0;
}
