// Sixteen bytes as a drop of a body on the ground, a slab or a slope: bounded penetration, no gain of energy.
#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "tests/unit/runtime/physics/rigid/drops.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace carillon::rigid::tests;
  std::array<std::uint8_t, 16> bytes{};
  std::copy_n(data, std::min(size, bytes.size()), bytes.begin());
  const DropOutcome outcome = run_drop(decode_drop(bytes), 0.3);
  const std::string fault = describe_fault(outcome, kHeldToday);
  if (fault.empty()) return 0;
  std::fprintf(stderr, "%s: %s\n", kDropBodies[bytes[0] % kDropBodies.size()], fault.c_str());
  std::abort();
}
