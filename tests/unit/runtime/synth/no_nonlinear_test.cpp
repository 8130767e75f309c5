// Banks with a nonlinear energy in a build without the component NONLINEAR.
#include <gtest/gtest.h>

#include <string>

#include "runtime/base/error.hpp"
#include "runtime/synth/resonator_bank.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::synth {
namespace {

TEST(NonlinearResonators, AreRefusedWithTheOptionThatBringsThem) {
  bank::Bank bank = testing::make_cube_bank({{500.0, 6.0, 1.0}, {900.0, 6.0, 1.0}});
  bank.quartic.modes = {0};
  bank.quartic.rows = {1e6F};
  const auto model = Model::make(bank);
  EXPECT_NO_THROW(ResonatorBank linear(model));
  const std::string message = tests::catch_message<InputError>([&] { ResonatorBank(model, {.is_nonlinear = true}); });
  EXPECT_NE(message.find("-DCARILLON_NONLINEAR=ON"), std::string::npos) << message;
}

}  // namespace
}  // namespace carillon::synth
