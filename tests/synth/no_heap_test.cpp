// process() and strike() take no memory: operator new is replaced by one that counts. A program of its own, so that no other test is
// disturbed.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>
#include <vector>

#include "runtime/synth/modal_body.hpp"
#include "runtime/synth/propagation.hpp"
#include "tests/synth/cube_bank.hpp"

namespace {
std::atomic<long> g_allocations{0};
}

void* operator new(std::size_t size) {
  ++g_allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void* operator new(std::size_t size, std::align_val_t align) {
  ++g_allocations;
  const auto a = static_cast<std::size_t>(align);
  if (void* memory = std::aligned_alloc(a, (size + a - 1) / a * a)) return memory;
  throw std::bad_alloc();
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  ++g_allocations;
  return std::malloc(size);
}
void operator delete(void* memory, const std::nothrow_t&) noexcept { std::free(memory); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

namespace carillon::synth {
namespace {

TEST(NoHeap, TheCounterSeesAllocations) {
  const long before = g_allocations;
  auto* memory = new std::vector<double>(1000);
  EXPECT_GE(g_allocations - before, 2);
  delete memory;
}

TEST(NoHeap, StrikingAndProcessingTakeNoMemory) {
  std::vector<testing::InventedMode> modes;
  for (int m = 0; m < 50; ++m) modes.push_back({100.0 + 300.0 * m, 5.0 + (m % 7 == 0 ? 1e5 : 0.0)});
  const bank::Bank bank = testing::make_cube_bank(modes);
  ModalBody body(bank, 48000.0, {.max_strikes = 8});
  const Path path({{0.0, {1.0, 0.0, 0.0}}, {0.5, {2.0, 0.0, 0.0}}});
  Propagation propagation(path, {0.0, 0.0, 0.0}, 48000.0, 10.0);
  std::vector<double> block(128), out(128);
  const long before = g_allocations;
  for (int i = 0; i < 300; ++i) {
    for (int k = 0; k < (i % 10 == 0 ? 20 : 0); ++k) {  // more than there is room for
      body.strike({.sample = body.get_position() + 30.3, .duration_s = 2e-4, .impulse_n_s = {0.0, 0.0, 1.0}});
    }
    body.process(block);
    propagation.process(block, out);
  }
  EXPECT_EQ(g_allocations - before, 0);
  EXPECT_GT(body.get_counters().accepted, 0);
  EXPECT_GT(body.get_counters().refused, 0);
}

}  // namespace
}  // namespace carillon::synth
