// Arbitrary bytes as a SOFA file: a head with finite output, or an InputError that begins with the file's name. libmysofa runs in a child
// process, whose crash is such an error; the sanitizers write the input as sofa-crash-*, and the target continues.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "runtime/acoustics/head/ear_filter.hpp"
#include "runtime/acoustics/head/sofa.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/folder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace carillon;
  static const tests::Folder folder;
  const std::filesystem::path file = folder.write("head.sofa", {reinterpret_cast<const char*>(data), size});
  try {
    head::EarFilter filter(head::read_sofa(file, 48000.0));
    std::vector<double> sound(1000, 1.0), left(sound.size()), right(sound.size());
    filter.process({0.3, -0.4, 0.5}, sound, left, right);
    filter.process({-0.3, 0.4, 0.5}, sound, left, right);
    for (std::size_t n = 0; n < sound.size(); ++n)
      if (!std::isfinite(left[n]) || !std::isfinite(right[n])) std::abort();
  } catch (const InputError& error) {
    if (std::string(error.what()).rfind(file.string(), 0) != 0) std::abort();
  }
  return 0;
}
