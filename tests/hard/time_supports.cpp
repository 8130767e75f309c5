// GROUP time: extreme supports.
#include <gtest/gtest.h>

#include <cmath>

#include "runtime/bank/mounting/losses.hpp"
#include "runtime/base/printable.hpp"
#include "tests/hard/figure.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"

namespace carillon::hard {
namespace {

TEST(time, support_extremes) {
  double max_decay = 0.0, max_shift = 0.0, wrong = 0.0;
  for (const double softer : {1.0, 1e3, 1e6, 1e12}) {
    for (const double area : {0.0, 1e-30, 2e-4, 1e6}) {
      for (const double normal : {1.0, 0.0}) {
        for (const std::string& name : material::list_base_names()) {
          bank::Bank bank = bank::example::make_supported_bank(2, 9);
          for (std::size_t s = 0; s < 2; ++s) {
            bank.supports.area_m2[s] = area;
            bank.supports.normal[s] = {normal, 0.0, 0.0};
          }
          base::Object words = base::parse_document("{\"on\": " + base::quote(name) + ", \"loss\": 1}", "words").root();
          material::Fixing fixing = *material::read_fixing(words);
          fixing.base.young_modulus_pa /= softer;
          const mounting::Losses losses = mounting::calc_losses(bank, {.all = fixing});
          for (std::size_t m = 0; m < bank.mode_count(); ++m) {
            const double omega = std::sqrt(bank.eigenvalue_rad2_s2[m]);
            const bool is_number =
                std::isfinite(losses.decay_per_s[m]) && std::isfinite(losses.shift_rad_s[m]) && losses.decay_per_s[m] >= 0.0;
            wrong += is_number ? 0.0 : 1.0;
            max_decay = std::max(max_decay, losses.decay_per_s[m] / omega);
            max_shift = std::max(max_shift, std::abs(losses.shift_rad_s[m]) / omega);
          }
          mounting::apply(losses, bank);
          wrong += static_cast<double>(bank::find_faults(bank).size());
        }
      }
    }
  }
  hold("support_extremes", wrong, 0.0, "numbers that are none, faults of the bank");
  hold("support_extremes", max_decay, mounting::kMaxDecay * (1.0 + 1e-12), "decay over the frequency");
  hold("support_extremes", max_shift, mounting::kMaxShift * (1.0 + 1e-12), "shift over the frequency");
}

}  // namespace
}  // namespace carillon::hard
