// Coupled modes do not allocate in motion. A separate program, see tests/support/heap_counter.hpp.
#include <gtest/gtest.h>

#include "runtime/synth/nonlinear/cascade.hpp"
#include "tests/support/heap_counter.hpp"
#include "tests/unit/runtime/synth/nonlinear/bodies.hpp"

namespace carillon::nonlinear {
namespace {

using tests::g_allocations;

double decay(double) { return 6.0; }

TEST(CoupledModesWithoutHeap, TheCounterSeesAllocations) {
  const long before = g_allocations;
  auto* memory = new std::vector<double>(1000);
  EXPECT_GE(g_allocations - before, 2);
  delete memory;
}

TEST(CoupledModesWithoutHeap, StepsTakeNoMemory) {
  const bodies::Body body = bodies::Plate{}.make(20, decay);
  CoupledModes modes(body.energy, body.modes, 48000.0);
  const std::vector<ModeConstants> above{{bodies::to_eigenvalue(6000.0), 1.0}, {bodies::to_eigenvalue(7000.0), 1.0}};
  Cascade cascade(body.modes, above, {.mass_kg = 0.9, .thickness_m = 1e-3}, 48000.0);
  const std::vector<double> soft(20, 1e-3), hard(20, 1e3), none(20, 0.0);
  const long before = g_allocations;
  modes.step(soft, none);
  for (int n = 0; n < 500; ++n) modes.step();
  modes.step(hard, none);
  for (int n = 0; n < 500; ++n) {
    modes.step();
    cascade.step(modes, {}, {}, {});
  }
  modes.set_limit(7);
  for (int n = 0; n < 500; ++n) modes.step();
  modes.set_state(3, 1e-3, 0.1);
  modes.reset();
  modes.step();
  EXPECT_EQ(g_allocations - before, 0);
  EXPECT_GT(modes.get_counters().guarded, 0);
  EXPECT_GT(cascade.get_book().taken_j, 0.0);
}

}  // namespace
}  // namespace carillon::nonlinear
