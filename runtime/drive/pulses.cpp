// Method: the real contact lasts one Hertz time from the touch, so its pulse is centred half that time later. If several spots share an
// impact, each carries its share of the mass.
// Source: J. O'Brien, C. Shen, C. Gatchalian, "Synthesizing sounds from rigid-body simulations" (2002), section 4.
#include "runtime/drive/pulses.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/physics/impact/spring.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::drive {
namespace {

constexpr double kForwardMaskRatio = 0.005;  // relative to an earlier impulse of the same body: -46 dB
constexpr double kMaskDecayS = 0.05;         // s; decay time (1/e) of the latter threshold

}  // namespace

bool Masks::take(int body, double time_s, double impulse_n_s, double duration_s) {
  Mask& mask = masks_[body];
  mask.impulse_n_s *= std::exp(-std::max(time_s - mask.time_s, 0.0) / kMaskDecayS);
  mask.time_s = std::max(time_s, mask.time_s);
  if (impulse_n_s < kForwardMaskRatio * mask.impulse_n_s && duration_s >= mask.duration_s) return true;
  if (impulse_n_s >= mask.impulse_n_s) mask = {impulse_n_s, mask.time_s, duration_s};
  return false;
}

int add_pulses(const Scene& scene, const Blow& blow, Masks* masks, std::vector<events::Event>& events) {
  int count = 0;
  for (const int side : {0, 1}) {
    const int body = side == 0 ? blow.a : blow.b;
    if (body < 0 || scene.bodies[body].shape == nullptr) continue;
    if (masks != nullptr && masks->take(body, blow.masked_s, blow.impulse_n_s, blow.duration_s)) continue;
    events.push_back(events::Impulse{.time_s = blow.touch_s + 0.5 * blow.duration_s,
                                     .body = body,
                                     .other = side == 0 ? blow.b : blow.a,
                                     .triangle = blow.places[side].triangle,
                                     .barycentric = blow.places[side].barycentric,
                                     .impulse_n_s = blow.impulses_n_s[side],
                                     .duration_s = blow.duration_s});
    ++count;
  }
  return count;
}

}  // namespace carillon::drive
