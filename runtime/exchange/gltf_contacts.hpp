// Restitution and friction of bodies as KHR_physics_rigid_bodies combines them, in scenes that take the geometric mean. Internal header.
#pragma once

#include <compare>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace carillon::exchange {

/// Restitution or friction of a body, and how it combines with that of another one.
struct GltfContact {
  double value = 0.0;
  std::string mode;  // "average", "minimum", "maximum", "multiply"
  auto operator<=>(const GltfContact&) const = default;
};

class GltfContacts {
 public:
  void add(const GltfContact& contact, bool is_fixed) { ++(is_fixed ? fixed_ : moving_)[contact]; }

  /// Finds the values whose geometric means are the values of the extension, from 0 to `limit`. With one kind of moving bodies they exist;
  /// else the values are those given, with a warning for each pair that differs. `key`: their name in scenes.
  void settle(const char* key, double limit, std::vector<std::string>& warnings);

  /// Of a body that was added, after settle().
  double get(const GltfContact& contact, bool is_fixed) const { return values_.at({is_fixed, contact}); }

 private:
  bool agrees() const;
  std::map<GltfContact, int> moving_, fixed_;              // number of bodies
  std::map<std::pair<bool, GltfContact>, double> values_;  // by is_fixed
};

}  // namespace carillon::exchange
