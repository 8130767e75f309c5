#include "runtime/events/events.hpp"

#include <cmath>
#include <cstddef>

namespace carillon::events {
namespace {

constexpr double kBarycentricSlack = 1e-6;
constexpr double kUnitSlack = 1e-3;
static_assert(kMaxForceSteps == 16, "the number is in a message");

template <std::size_t n>
bool is_finite(const std::array<double, n>& x) noexcept {
  for (const double value : x) {
    if (!std::isfinite(value)) return false;
  }
  return true;
}

template <std::size_t n>
bool is_unit(const std::array<double, n>& x) noexcept {
  double sum = 0.0;
  for (const double value : x) sum += value * value;
  return std::abs(std::sqrt(sum) - 1.0) <= kUnitSlack;  // false for NaN
}

/// Finite and non-negative.
bool is_amount(double x) noexcept { return std::isfinite(x) && x >= 0.0; }

const char* find_place_fault(std::int32_t body, std::int32_t other, std::int32_t triangle, const Vec3& barycentric) noexcept {
  if (body < 0) return "the index of the body is negative";
  if (other < -1) return "the index of the other body is below -1";
  if (triangle < 0) return "the index of the triangle is negative";
  for (const double weight : barycentric) {
    if (!(weight >= -kBarycentricSlack && weight <= 1.0 + kBarycentricSlack)) return "a barycentric coordinate is outside 0..1";
  }
  if (std::abs(barycentric[0] + barycentric[1] + barycentric[2] - 1.0) > kBarycentricSlack)
    return "the barycentric coordinates do not sum to 1";
  return nullptr;
}

/// Position, velocity and attitude of a BodyMotion or a Listener.
template <class Moving>
const char* find_moving_fault(const Moving& moving) noexcept {
  if (!is_finite(moving.position_m)) return "the position is not finite";
  if (!is_finite(moving.velocity_m_s)) return "the velocity is not finite";
  if (!is_unit(moving.rotation)) return "the rotation is not a unit quaternion";
  return nullptr;
}

const char* find_own_fault(const TimeWatermark&) noexcept { return nullptr; }

const char* find_own_fault(const Impulse& impulse) noexcept {
  const char* const place = find_place_fault(impulse.body, impulse.other, impulse.triangle, impulse.barycentric);
  if (place != nullptr) return place;
  if (impulse.shape != PulseShape::kHertz && impulse.shape != PulseShape::kGaussian) return "the shape of the pulse is unknown";
  if (!is_finite(impulse.impulse_n_s)) return "the impulse is not finite";
  if (!is_amount(impulse.duration_s)) return "the duration is negative or not finite";
  return nullptr;
}

const char* find_own_fault(const Force& force) noexcept {
  const char* const place = find_place_fault(force.body, force.other, force.triangle, force.barycentric);
  if (place != nullptr) return place;
  if (force.count < 1 || force.count > kMaxForceSteps) return "the number of steps is not 1 to 16";
  if (!(is_amount(force.step_s) && force.step_s > 0.0)) return "the length of a step is not above 0";
  for (int k = 0; k < force.count; ++k) {
    for (const float x : force.impulse_n_s[k]) {
      if (!std::isfinite(x)) return "an impulse is not finite";
    }
  }
  return nullptr;
}

const char* find_own_fault(const LastingContact& contact) noexcept {
  const char* const place = find_place_fault(contact.body, contact.other, contact.triangle, contact.barycentric);
  if (place != nullptr) return place;
  if (contact.state != ContactState::kBegin && contact.state != ContactState::kHold && contact.state != ContactState::kEnd)
    return "the state of the contact is unknown";
  if (!is_unit(contact.normal)) return "the normal is not a unit vector";
  if (!is_finite(contact.slip_m_s)) return "the slip is not finite";
  if (!is_amount(contact.force_n)) return "the force is negative or not finite";
  if (!is_amount(contact.sweep_m_s) || !is_amount(contact.other_sweep_m_s)) return "a sweep is negative or not finite";
  if (!is_amount(contact.spin_rad_s)) return "the spin is negative or not finite";
  if (!(is_amount(contact.patch_radius_m) && contact.patch_radius_m > 0.0)) return "the radius of the patch is not above 0";
  if (!is_amount(contact.impedance_n_s_m) && contact.impedance_n_s_m != LastingContact::kByMaterial)
    return "the impedance is negative or not finite";
  return nullptr;
}

const char* find_own_fault(const BodyMotion& motion) noexcept {
  if (motion.body < 0) return "the index of the body is negative";
  return find_moving_fault(motion);
}

const char* find_own_fault(const Listener& listener) noexcept { return find_moving_fault(listener); }

}  // namespace

Vec3 calc_impulse(const Force& force) noexcept {
  Vec3 sum{};
  for (int k = 0; k < force.count; ++k) {
    for (std::size_t axis = 0; axis < 3; ++axis) sum[axis] += static_cast<double>(force.impulse_n_s[k][axis]);
  }
  return sum;
}

Impulse to_impulse(const Force& force) noexcept {
  double weights = 0.0, middle = 0.0;
  for (int k = 0; k < force.count; ++k) {
    const auto& [x, y, z] = force.impulse_n_s[k];
    const double size = std::hypot(static_cast<double>(x), static_cast<double>(y), static_cast<double>(z));
    weights += size;
    middle += size * (k + 0.5);
  }
  const double steps = weights > 0.0 ? middle / weights : 0.5 * force.count;
  return {.time_s = force.time_s + steps * force.step_s,
          .body = force.body,
          .other = force.other,
          .triangle = force.triangle,
          .barycentric = force.barycentric,
          .impulse_n_s = calc_impulse(force)};
}

double get_time_s(const Event& event) noexcept {
  return std::visit([](const auto& e) noexcept { return e.time_s; }, event);
}

const char* find_fault(const Event& event) noexcept {
  if (!std::isfinite(get_time_s(event))) return "the time is not finite";
  return std::visit([](const auto& e) noexcept { return find_own_fault(e); }, event);
}

}  // namespace carillon::events
