// Fuzzes jobs of carillon-simulate: bodies within their ranges, or an InputError.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "precompute/job/simulation.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace carillon::job;
  const std::string_view text{reinterpret_cast<const char*>(bytes), size};
  try {
    const SimulationSpec spec = parse_simulation(text, "/a/job.json");
    if (!is_simulation(text) || spec.bodies.empty() || !(spec.duration_s > 0.0) || !std::isfinite(spec.duration_s)) std::abort();
    for (const SimulatedBody& body : spec.bodies)
      if (!(body.material.young_modulus_pa > 0.0) || !(body.material.alpha1_s >= 0.0) || !(body.material.alpha2_per_s >= 0.0)) std::abort();
    for (const Blow& blow : spec.blows)
      if (blow.body >= spec.bodies.size()) std::abort();
  } catch (const carillon::InputError&) {
  }
  return 0;
}
