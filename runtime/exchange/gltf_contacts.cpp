#include "runtime/exchange/gltf_contacts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace carillon::exchange {
namespace {

constexpr double kUnnoticed = 0.005;  // difference of a restitution or friction

double combine(const GltfContact& a, const GltfContact& b) {
  const auto has = [&](const char* mode) { return a.mode == mode || b.mode == mode; };
  if (has("average")) return 0.5 * (a.value + b.value);
  if (has("minimum")) return std::min(a.value, b.value);
  if (has("maximum")) return std::max(a.value, b.value);
  return a.value * b.value;
}

}  // namespace

/// True if the geometric means of the given values are those of the extension.
bool GltfContacts::agrees() const {
  const auto is_mean = [](const GltfContact& a, const GltfContact& b) {
    return std::abs(std::sqrt(a.value * b.value) - combine(a, b)) <= 1e-9;
  };
  for (const auto& [a, count] : moving_) {
    for (const auto& [b, number] : moving_)
      if (!(a == b && count == 1) && !is_mean(a, b)) return false;
    for (const auto& [b, number] : fixed_)
      if (!is_mean(a, b)) return false;
  }
  return true;
}

void GltfContacts::settle(const char* key, double limit, std::vector<std::string>& warnings) {
  for (const auto& [contact, count] : moving_) values_[{false, contact}] = contact.value;
  for (const auto& [contact, count] : fixed_) values_[{true, contact}] = contact.value;
  if (moving_.size() == 1 && !agrees()) {
    const auto& [own, count] = *moving_.begin();
    double& mine = values_[{false, own}];
    if (count > 1) mine = combine(own, own);
    if (count == 1 && fixed_.size() == 1) mine = combine(own, fixed_.begin()->first);
    for (const auto& [other, number] : fixed_)
      if (const double wanted = combine(own, other); mine > 0.0) values_[{true, other}] = wanted * wanted / mine;
  }
  for (auto& [of, value] : values_) value = std::clamp(value, 0.0, limit);
  const auto check = [&](bool is_fixed, const GltfContact& a, const GltfContact& b) {
    const double taken = std::sqrt(values_[{false, a}] * values_[{is_fixed, b}]), wanted = combine(a, b);
    if (std::abs(taken - wanted) <= kUnnoticed) return;
    const std::string text =
        fmt::format("the {} of two bodies is the geometric mean of both: {:.3g} where \"{}\" of {:g} and {:g} is {:.3g}", key, taken,
                    std::min(a.mode, b.mode), a.value, b.value, wanted);
    if (std::find(warnings.begin(), warnings.end(), text) == warnings.end()) warnings.push_back(text);
  };
  for (const auto& [a, count] : moving_) {
    for (const auto& [b, number] : moving_)
      if (a < b || (a == b && count > 1)) check(false, a, b);
    for (const auto& [b, number] : fixed_) check(true, a, b);
  }
}

}  // namespace carillon::exchange
