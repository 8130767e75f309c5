// Method: see paper_filter.hpp. OCE01 eq. 5 to 8.
#include "precompute/simulation/emission/paper_filter.hpp"

#include <algorithm>
#include <utility>

namespace carillon::emission {

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
