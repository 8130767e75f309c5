#include "runtime/acoustics/head/head.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "runtime/base/sinc.hpp"

namespace carillon::head {
namespace {

Blend find_by_angle(const ByAngle& head, const Vec3& direction, const Vec3& ear) noexcept {
  const double square = dot(direction, direction);
  const Vec3 d = std::isfinite(square) && square > 0.0 ? direction : Vec3{1.0, 0.0, 0.0};
  const double angle = std::atan2(norm(cross(d, ear)), dot(d, ear));
  const double place = std::clamp(angle / std::numbers::pi, 0.0, 1.0) * head.steps;
  const int below = std::min(static_cast<int>(place), head.steps - 1);
  const auto mix = static_cast<float>(place - below);
  return {{below, below + 1, below + 1}, {1.0F - mix, mix, 0.0F}};
}

}  // namespace

Head::Head(Content content) : content_(std::move(content)) {
  max_delay_ = *std::max_element(content_.delays.begin(), content_.delays.end());
  base::Sinc::get();  // built here, not on the audio thread
}

int Head::get_latency() const noexcept { return kOnset + base::kSincHalf - 1 + content_.origin_samples; }

std::array<Blend, 2> Head::find(const Vec3& direction) const noexcept {
  if (const auto* by_angle = std::get_if<ByAngle>(&content_.lookup))
    return {find_by_angle(*by_angle, direction, by_angle->ears[0]), find_by_angle(*by_angle, direction, by_angle->ears[1])};
  const Surrounding around = std::get_if<ByDirection>(&content_.lookup)->directions.find(direction);
  std::array<Blend, 2> found;
  for (std::size_t ear = 0; ear < 2; ++ear)
    for (std::size_t i = 0; i < 3; ++i) {
      found[ear].response[i] = 2 * around.direction[i] + static_cast<int>(ear);
      found[ear].weight[i] = static_cast<float>(around.share[i]);
    }
  return found;
}

}  // namespace carillon::head
