// Arbitrary bytes give a bank or an InputError. Each input is tried unchanged, which tests the seal, and sealed again, which tests the
// rest.
#include <cstring>
#include <string>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/bank/seal.hpp"
#include "tests/unit/runtime/bank/seal_again.hpp"

namespace {

using namespace carillon;

void read(std::span<const std::byte> bytes) {
  try {
    const bank::Bank bank = bank::parse_bank(bytes);
    // A valid bank can be used without further checks.
    double sum = 0.0;
    for (std::size_t mode = 0; mode < bank.mode_count(); ++mode) {
      sum += bank.freq_hz(mode);
      for (std::size_t vertex = 0; vertex < bank.vertex_count(); ++vertex) sum += bank.shape_at(vertex, mode)[2];
    }
    for (const auto& triangle : bank.triangles) sum += bank.vertices_m[triangle[0]][0];
    if (!bank.multipoles.is_empty()) sum += bank::calc_corrected(bank).radiation_gain.back();
    volatile double sink = sum;
    (void)sink;
  } catch (const InputError&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  read(std::as_bytes(std::span(data, size)));
  if (size >= bank::kSealBytes) {
    const std::string sealed = bank::seal_again({reinterpret_cast<const char*>(data), size});
    read(std::as_bytes(std::span(sealed)));
  }
  return 0;
}
