// Method: triangle fluxes once per sample; their derivative over 33 samples; one pole per body over 32. docs/equations.md E14.
#include "precompute/simulation/emission/sources.hpp"

#include <algorithm>

namespace carillon::emission {

Sources::Sources(const Surfaces& surfaces, double sample_rate_hz, double sound_speed_m_s, bool has_poles, bool has_twins)
    : surfaces_(surfaces),
      sample_rate_hz_(sample_rate_hz),
      has_poles_(has_poles),
      has_twins_(has_twins),
      flux_(surfaces.get_slots(), 2 * kDerivativeHalf + kBatch),
      rates_(surfaces.get_slots(), kPoleSpan + kBatch) {
  static_assert(recording::kPoleTaps == kPoleSpan);
  poles_.fill(Rows(has_poles ? surfaces.get_slots() : 0));
  for (const Surfaces::Run& run : surfaces.runs)
    pole_.push_back(recording::make_pole(surfaces.tables.radius_m[run.body], sample_rate_hz, sound_speed_m_s));
}

std::optional<std::int64_t> Sources::calc(const MotionFilter& motion, std::int64_t k) {
  // Mean of three, half of the cross product, and two derivatives by samples.
  const double scale = sample_rate_hz_ * sample_rate_hz_ / 6.0;
  for (std::int64_t b = k; b < k + kBatch; ++b)
    for (const Surfaces::Run& run : surfaces_.runs)
      loops_->calc_flux(motion.get_places(b), motion.get_velocities(b), surfaces_.corners[run.begin].data(),
                        (run.middle - run.begin) / kLane, scale, flux_.get(run.begin, b));
  const std::int64_t derived = k - kDerivativeHalf;
  if (derived < -kPoleSpan / 2) return {};
  std::array<std::size_t, 2 * kDerivativeHalf + kBatch> from;
  std::array<std::size_t, kBatch> to;
  for (std::size_t i = 0; i < from.size(); ++i) from[i] = flux_.find_offset(derived - kDerivativeHalf + static_cast<std::int64_t>(i));
  for (std::size_t b = 0; b < to.size(); ++b) to[b] = rates_.find_offset(derived + static_cast<std::int64_t>(b));
  for (const Surfaces::Run& run : surfaces_.runs) {
    loops_->calc_rates(flux_.get(run.begin), from.data(), (run.middle - run.begin) / kLane, derivative_.data(), rates_.get(run.begin),
                       to.data());
    // The flux of one side of a sheet is minus that of the other.
    if (has_twins_)
      for (std::size_t t = run.middle; t < run.end; ++t)
        if (const std::size_t twin = surfaces_.twin[t]; surfaces_.twin[t] >= 0)
          for (const std::size_t at : to)
            rates_.get(t / kLane * kLane).data[at + t % kLane] = -rates_.get(twin / kLane * kLane).data[at + twin % kLane];
  }
  const std::int64_t first = derived - kPoleSpan / 2;
  if (first < 0) return {};
  if (has_poles_) calc_poles(first);
  return first;
}

/// For the kBatch samples after `first`, for which there is one.
void Sources::calc_poles(std::int64_t first) {
  std::array<std::size_t, kPoleSpan + kBatch - 1> from;
  for (std::size_t j = 0; j < from.size(); ++j) from[j] = rates_.find_offset(first - kPoleSpan / 2 + 1 + static_cast<std::int64_t>(j));
  for (std::size_t r = 0; r < surfaces_.runs.size(); ++r) {
    const Surfaces::Run& run = surfaces_.runs[r];
    std::array<double*, kBatch> out;
    for (std::size_t b = 0; b < out.size(); ++b)
      out[b] = poles_[(static_cast<std::size_t>(first) + 1 + b) % poles_.size()].get() + run.begin;
    loops_->sum_frames(rates_.get(run.begin), from.data(), (run.middle - run.begin) / kLane, pole_[r].weight.data(), pole_[r].keep,
                       get_poles(first) + run.begin, out.data());
  }
}

}  // namespace carillon::emission
