// What the Simbody side sees of a world. C++17: Simbody 3.7's headers do not compile as C++20 (their index types' operator== become
// ambiguous), and the bank's header needs C++20. So world.cpp looks into the banks, checks, and hands over this.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "runtime/contact/events.hpp"

namespace carillon::contact {

struct BodyModel {
  std::string name;
  const std::vector<std::array<double, 3>>* vertices_m = nullptr;  // of the bank; the same address means the same surface
  const std::vector<std::array<std::int32_t, 3>>* triangles = nullptr;
  bool fixed = false;
  Pose initial;
  std::array<double, 3> velocity_m_s{};
  std::array<double, 3> angular_velocity_rad_s{};
  double mass_kg = 0.0;
  std::array<double, 3> centre_m{};
  std::array<double, 9> inertia_kg_m2{};
  double young_modulus_pa = 0.0;
  double poisson_ratio = 0.0;
  double density_kg_m3 = 0.0;
  double restitution = 0.0;
  double friction = 0.0;
};

struct GroundModel {
  double height_m = 0.0;
  double young_modulus_pa = 0.0;
  double poisson_ratio = 0.0;
  double density_kg_m3 = 0.0;
  double restitution = 0.0;
  double friction = 0.0;
};

struct WorldModel {
  std::vector<BodyModel> bodies;
  std::optional<GroundModel> ground;
  std::array<double, 3> gravity_m_s2{};
};

/// The bodies of a checked world on their way, island by island. All of it [main-thread].
class Runner {
 public:
  /// Throws InputError as World does.
  Runner(WorldModel world, const WorldOptions& options);
  ~Runner();

  /// As World::advance.
  double advance(double until_s, double cpu_s, const std::function<void(const stream::Event&)>& sink);
  Statistics get_statistics() const;

 private:
  class Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace carillon::contact
