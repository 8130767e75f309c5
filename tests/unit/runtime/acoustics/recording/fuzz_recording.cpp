// Arbitrary bytes: a recorded surface that plays, or an InputError. Every input is tried as it is (header), and with correct length and
// digest (everything after them).
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/acoustics/recording/player.hpp"
#include "runtime/acoustics/recording/recording.hpp"
#include "runtime/base/error.hpp"
#include "tests/unit/runtime/acoustics/recording/seal_again.hpp"

namespace {

using namespace carillon;

void play(std::string_view bytes) {
  try {
    const recording::RecordedSurface recording(bytes, "input");
    recording::Player player(recording, 1);
    std::vector<recording::Microphone> receivers(1);
    receivers[0].place_m = {1.0, 0.0, 0.0};
    std::vector<double> out(700, 0.0);
    player.play(receivers, out.size(), out);
    player.play(receivers, out.size(), out);
  } catch (const InputError&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  play(bytes);
  play(recording::testing::seal_again(bytes));
  return 0;
}
