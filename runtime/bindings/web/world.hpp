// Physics of a page, on a worker: a world of rigid bodies; its events go to the sound engine (engine.hpp) as an endless recording.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/physics/world.hpp"

namespace carillon::web {

/// Banks, and a world that is described and then started. Bodies are numbered in the order in which they were added. One thread.
class PageWorld {
 public:
  /// Throws InputError for an invalid bank.
  void add_bank(int bank, std::span<const std::byte> bytes, const std::string& name);
  /// Adds a body to the description. Numbers: position of the mesh frame (3), rotation w x y z (4), velocity (3), angular velocity (3),
  /// restitution, friction, rolling_resistance, roughness_m, fixed, absent (0 or 1). Returns its number.
  int add_body(int bank, std::span<const double> numbers, const std::string& name);
  /// Starts the world. Numbers: gravity (3), ground (0: none), its height_m, young_modulus_pa, poisson_ratio, restitution, friction,
  /// rolling_resistance, density_kg_m3, roughness_m; impacts with modes and masking of hits (0 or 1). Throws InputError as physics::World
  /// does.
  void start(std::span<const double> numbers);
  /// Advances to a time, and appends the events to `words` (event_words.hpp), in order of time. Returns the time reached [s].
  double advance(double until_s, std::vector<double>& words);
  physics::World& get_world();

 private:
  std::map<int, std::unique_ptr<const bank::Bank>> banks_;
  physics::WorldSpec spec_;
  std::unique_ptr<physics::World> world_;
};

}  // namespace carillon::web
