// Transfers::evaluate() does not allocate. A separate program, see tests/support/heap_counter.hpp.
#include <gtest/gtest.h>

#include <complex>
#include <numeric>
#include <vector>

#include "runtime/acoustics/radiation/transfers.hpp"
#include "tests/support/heap_counter.hpp"
#include "tests/unit/runtime/acoustics/radiation/multipole_bank.hpp"

namespace carillon::radiation {
namespace {

using tests::g_allocations;

TEST(TransfersHeap, EvaluatingTakesNoMemoryAndNeverThrows) {
  bank::Bank bank = testing::make_empty_multipoles();
  for (const int order : {0, 7, 120, 3})
    testing::add_multipoles(bank, 1.0 + order, std::vector<testing::Complex>((order + 1) * (order + 1), 0.1));
  const long before_making = g_allocations;
  const Transfers transfers(bank);
  EXPECT_GT(g_allocations - before_making, 0) << "the counter counts nothing";
  std::vector<std::int32_t> modes(4);
  std::iota(modes.begin(), modes.end(), 0);
  std::vector<std::complex<float>> transfer(4);
  static_assert(noexcept(transfers.evaluate(Vec3{}, modes, transfer)));
  const long before = g_allocations;
  for (int i = 0; i < 20; ++i) transfers.evaluate({0.1 * i, 0.3, -0.2}, modes, transfer);
  EXPECT_EQ(g_allocations - before, 0);
  EXPECT_GT(std::abs(transfer[2]), 0.0F);
}

}  // namespace
}  // namespace carillon::radiation
