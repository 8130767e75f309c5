// Method:     a sample that arrives between two others is spread over 32 of them, with the weights by which runtime/base/sinc.hpp reads
//             between samples, in whole units of 2^-46 Pa.
// Source:     OCE01 section 3.3 and figure 4; docs/equations.md E14.
// Deviations: OCE01 spreads by a Gaussian of two samples, 2 to 9 dB too soft at 10 kHz.
#include "precompute/emission/receivers.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/base/bytes.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/sinc.hpp"

namespace carillon::emission {

static_assert(kSpread == base::kSincTaps);

std::vector<Microphone> make_ears(const Vec3& position_m, const Vec3& look_at_m, double distance_m) {
  const Vec3 view = look_at_m - position_m, right{view[1], -view[0], 0.0};
  if (!(norm(right) > 1e-6 * norm(view)) || !(norm(view) > 0.0))
    throw InputError("the listener looks straight up or down, or nowhere, so its ears have no place; move look_at_m to its side");
  const Vec3 half = (0.5 * distance_m) * normalise(right);
  Microphone left, other;
  left.place_m = position_m - half;
  other.place_m = position_m + half;
  return {left, other};
}

Arrivals::Arrivals(std::size_t frames) : loops_(&find_loops()), frames_(frames), units_(frames + 2 * kSpread, 0) {}

bool Arrivals::add(double time, double pressure_pa) {
  if (!(std::abs(pressure_pa) < 1e4)) return false;
  if (!(time < static_cast<double>(frames_) + base::kSincHalf)) return true;
  const double whole = std::floor(time), part = (time - whole) * base::kSincPhases;
  // Quadratic between three tabulated phases: triangles that cancel each other to 1e-5 lie at other places between them.
  const int middle = std::clamp(static_cast<int>(part + 0.5), 1, base::kSincPhases - 1);
  const double t = part - middle;
  const std::array<float, 3> share{static_cast<float>(0.5 * t * (t - 1.0)), static_cast<float>(1.0 - t * t),
                                   static_cast<float>(0.5 * t * (t + 1.0))};
  const float* row = base::Sinc::get().get_taps(middle - 1);
  const auto first = static_cast<std::int64_t>(whole) - base::kSincHalf + 1 + kSpread;
  if (first < 0) return true;
  std::int64_t* to = units_.data() + first;
  if (std::abs(pressure_pa) <= kLargestPa) {
    loops_->scatter(to, pressure_pa, row, share.data());
    return true;
  }
  for (std::size_t j = 0; j < kSpread; ++j) {
    const float tap = share[0] * row[j] + share[1] * row[j + kSpread] + share[2] * row[j + 2 * kSpread];
    to[j] += std::llrint(pressure_pa * kUnitsPerPa * static_cast<double>(tap));
  }
  return true;
}

std::vector<double> Arrivals::sum(const comm::Communicator& comm) const {
  std::vector<std::int64_t> all(units_);
  comm.sum(std::span<std::int64_t>(all));
  std::vector<double> pressure(frames_);
  for (std::size_t i = 0; i < frames_; ++i) pressure[i] = static_cast<double>(all[i + kSpread]) / kUnitsPerPa;
  return pressure;
}

void Arrivals::save(std::vector<std::byte>& to) const { base::put_list(to, units_); }
void Arrivals::load(std::span<const std::byte>& from) { base::take_list(from, units_); }

}  // namespace carillon::emission
