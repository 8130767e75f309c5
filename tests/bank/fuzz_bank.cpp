// Bank bytes of any kind give a bank or an InputError. Every input is tried as it is, which tries the seal, and sealed again, which tries
// everything behind the seal.
#include <cstring>
#include <string>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/seal.hpp"

namespace {

using namespace carillon;

void read(std::span<const std::byte> bytes) {
  try {
    const bank::Bank bank = bank::parse_bank(bytes);
    // What the reader calls sane can be used without looking.
    double sum = 0.0;
    for (std::size_t mode = 0; mode < bank.mode_count(); ++mode) {
      sum += bank.freq_hz(mode);
      for (std::size_t vertex = 0; vertex < bank.vertex_count(); ++vertex) sum += bank.shape_at(vertex, mode)[2];
    }
    for (const auto& triangle : bank.triangles) sum += bank.vertices_m[static_cast<std::size_t>(triangle[0])][0];
    volatile double sink = sum;
    (void)sink;
  } catch (const InputError&) {
  }
}

/// The length in line 2 and the SHA-256 made right.
std::string seal_again(std::string bytes) {
  const std::size_t line = bytes.find('\n') + 1;
  const std::size_t end = bytes.find('\n', line);
  if (line == 0 || end == std::string::npos || end >= bank::kTextBytes) return bytes;
  std::string length = "length " + std::to_string(bytes.size());
  if (line + length.size() > bank::kTextBytes) return bytes;
  // The text keeps its place: a length of other digits is cut from, or put into, the padding at its end.
  std::string text = bytes.substr(0, line) + length + bytes.substr(end, bank::kTextBytes - end);
  text.resize(bank::kTextBytes, '\n');
  bytes.replace(0, bank::kTextBytes, text);
  bank::Digest digest;
  const auto all = std::as_bytes(std::span(bytes));
  digest.update(all.first(bank::kTextBytes));
  digest.update(all.subspan(bank::kSealBytes));
  bytes.replace(bank::kTextBytes, bank::kDigestBytes, digest.finish());
  return bytes;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  read(std::as_bytes(std::span(data, size)));
  if (size >= bank::kSealBytes) {
    const std::string sealed = seal_again({reinterpret_cast<const char*>(data), size});
    read(std::as_bytes(std::span(sealed)));
  }
  return 0;
}
