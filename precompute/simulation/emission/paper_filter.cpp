// Method: see paper_filter.hpp. OCE01 eq. 5 to 8.
#include "precompute/simulation/emission/paper_filter.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace carillon::emission {
namespace {

// Method: a value between two samples is added to the samples around it with the kernel weights at their distances (polyphase): each step
//   is convolved once, without a step history.
// Source: OCE01 eq. 6 to 8.

/// At x samples from the centre.
double calc_kernel(double x, double half) {
  if (std::abs(x) > half) return 0.0;
  const double sinc = x == 0.0 ? 1.0 : std::sin(std::numbers::pi * x) / (std::numbers::pi * x);
  return sinc * (0.5 + 0.5 * std::cos(std::numbers::pi * x / half));
}

}  // namespace

LowPass::LowPass(std::size_t rows, int values, double first)
    : rows_(rows), weight_(static_cast<std::size_t>(values)), open_(rows * kSlots, 0.0), waiting_(rows * kValuesPerCall, 0.0) {
  double total = 0.0;
  for (int i = 0; i < values; ++i)
    for (int s = 0; s < kSlots; ++s) total += weight_[i][s] = calc_kernel((first + i) / values + (kHalf - 1) - s, kHalfWidth);
  for (auto& weight : weight_)
    for (std::size_t s = 0; s < kSlots; ++s) weight[s + kSlots] = weight[s] /= total;
}

void LowPass::add(int i, const double* value) {
  // Slot s of the ring has the weight of position (s - ring_) mod kSlots.
  const double* weight = weight_[i].data() + (kSlots - ring_) % kSlots;
  std::copy_n(value, rows_, waiting_.begin() + static_cast<std::ptrdiff_t>(waiting_count_ * rows_));
  waiting_weight_[waiting_count_++] = weight;
  if (waiting_count_ == kValuesPerCall) take_in();
  for (std::size_t s = 0; s < kSlots; ++s) weights_[s] += weight[s];
}

void LowPass::take_in() {
  loops_->add_rows(open_.data(), waiting_.data(), rows_, waiting_weight_.data(), waiting_count_);
  waiting_count_ = 0;
}

void LowPass::close(double* out) {
  take_in();
  const std::size_t slot = ring_;
  const double scale = weights_[slot] > 0.0 ? 1.0 / weights_[slot] : 0.0;
  for (std::size_t row = 0; row < rows_; ++row) {
    double& open = open_[row * kSlots + slot];
    out[row] = open * scale;
    open = 0.0;
  }
  weights_[slot] = 0.0;
  ring_ = (ring_ + 1) % kSlots;
}

// w = ceil(3 / (fmax h)) = ceil(6 m), tolerant to rounding.
PaperFilter::PaperFilter(const Surfaces& surfaces, double sample_rate_hz, int steps_per_sample, double rho_c,
                         std::function<void(std::int64_t)> take)
    : surfaces_(surfaces),
      steps_(steps_per_sample),
      scale_(rho_c * sample_rate_hz * steps_per_sample / 3.0),
      take_(std::move(take)),
      places_filter_(surfaces.get_rows(), steps_per_sample, 0.0),
      pressure_filter_(surfaces.get_slots(), steps_per_sample, 0.5),
      now_(surfaces.get_rows()),
      last_(now_),
      pressure_(surfaces.get_slots()),
      places_(now_),
      sources_(pressure_) {}

void PaperFilter::add_step(const double* u) {
  for (std::size_t v = 0; v < surfaces_.node.size(); ++v) std::copy_n(u + 4 * surfaces_.node[v], 3, now_.get() + surfaces_.row[v]);
  advance();
}

void PaperFilter::advance() {
  if (has_last_) {
    for (std::size_t t = 0; t < surfaces_.get_slots(); ++t) {
      if (surfaces_.place[t] < 0) continue;
      Vec3 at[3], moved{};
      for (std::size_t c = 0; c < 3; ++c) {
        const std::int32_t corner = surfaces_.corners[t][c];
        const Vec3 before = get_vertex(last_.get(), corner), after = get_vertex(now_.get(), corner);
        at[c] = get_vertex(surfaces_.rest.get(), corner) + 0.5 * (before + after);
        moved = moved + (after - before);
      }
      const Vec3 twice = cross(at[1] - at[0], at[2] - at[0]);
      pressure_.get()[t] = scale_ * dot(moved, twice) / norm(twice);
    }
    pressure_filter_.add(static_cast<int>(step_) - 1, pressure_.get());
    if (step_ == steps_) {
      places_filter_.close(places_.get());
      for (std::size_t i = 0; i < surfaces_.get_rows(); ++i) places_.get()[i] += surfaces_.rest.get()[i];
      pressure_filter_.close(sources_.get());
      step_ = 0;
      take_(++interval_ - LowPass::kHalf);
    }
  }
  std::copy_n(now_.get(), surfaces_.get_rows(), last_.get());
  has_last_ = true;
  places_filter_.add(static_cast<int>(step_++), now_.get());
}

void PaperFilter::finish(const std::function<bool()>& is_done) {
  while (!is_done()) advance();  // now_ is the last step
}

}  // namespace carillon::emission
