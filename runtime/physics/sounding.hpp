// Contact events of the rigid bodies of a world.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "runtime/drive/lasting.hpp"
#include "runtime/drive/pulses.hpp"
#include "runtime/physics/rigid/space.hpp"
#include "runtime/physics/world.hpp"

namespace carillon::physics {

/// The bodies of a Space as a drive::Scene. Motions are copied when a contact needs them. The space must outlive it.
class Sounding {
 public:
  /// `masks_hits`: omits hits masked by earlier ones.
  Sounding(const WorldSpec& spec, const rigid::Space& space, bool masks_hits);

  /// Takes up the last body of the space, which is new.
  void add_body(const BodySpec& body);

  /// Pulses of an impact.
  void add(const rigid::Strike& strike, std::vector<events::Event>& events);
  /// Forces of an impact with modes, one event per body, split at the maximum length of events.
  void add(const rigid::Forces& forces, std::vector<events::Event>& events);
  /// After a step: lasting contacts.
  void update(std::vector<events::Event>& events);

 private:
  void copy_motion(int body);
  void add_spot(std::span<const rigid::Hit* const> hits, const rigid::Strike& strike, double audible_n_s,
                std::vector<events::Event>& events);

  const rigid::Space& space_;
  drive::Scene scene_;
  drive::LastingContacts lasting_;
  std::optional<drive::Masks> masks_;
  // Of the current step:
  std::vector<const rigid::Contact*> contacts_;
  std::vector<drive::Load> loads_;
  std::vector<std::int64_t> copied_;  // step of each body's motion
  std::int64_t step_ = 0;
};

}  // namespace carillon::physics
