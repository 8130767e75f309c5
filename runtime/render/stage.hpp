// A scene that is simulated while it is played: physics ahead of the events, events ahead of the sound.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/physics/world.hpp"
#include "runtime/scene/banks.hpp"
#include "runtime/scene/effects/effect_selector.hpp"
#include "runtime/scene/event_scheduler.hpp"
#include "runtime/scene/scene.hpp"
#include "runtime/scene/session.hpp"
#include "runtime/synth/synthesiser.hpp"

namespace carillon::render {

/// Index of a name of a body. Throws InputError with the nearest one for an unknown name.
int find_body(const std::vector<std::string>& names, const std::string& name);

struct StageOptions {
  double look_ahead_s = 0.1;  // lead of the physics over the sound, > 0
  double gain_per_pa = 1.0;   // of the synthesiser's output
  bool is_handled = false;    // bodies may be added, and fixed ones removed and added elsewhere
};

/// A synthesiser with the bodies of a scene, and the physics that plays them. Bodies have all effects that they may need. Scene and banks
/// must outlive it. process() of the synthesiser may run on another thread; everything else is for one thread.
class Stage {
 public:
  /// The bodies of the scene must have their banks. Throws InputError for an invalid scene.
  Stage(scene::Scene& scene, const StageOptions& options);
  ~Stage();
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

  synth::Synthesiser& get_synthesiser() { return *synthesiser_; }
  /// nullptr: no body can move.
  physics::World* get_world();
  const std::vector<std::string>& get_warnings() const { return warnings_; }

  /// Adds the bodies and pushes the first events.
  void begin();
  /// Work when the sound has reached a time. False if the physics need not advance. Throws SolveError if the physics fails.
  bool step(double now_s);

  /// Puts a new body into the scene and its world. `text`: JSON with the keys of a body in a scene file; paths are relative to the
  /// scene file. A bank that is not in `banks` is read here, which blocks the physics. Returns the name. Throws InputError as for a scene
  /// file, without effect, for an invalid body or after kMaxAdded.
  std::string add_body(const std::string& text, scene::Banks& banks);
  static constexpr int kMaxAdded = 256;

  /// Smallest lead of the physics over the sound; infinite without physics.
  double get_min_lead_s() const { return min_lead_s_; }
  /// Largest CPU time of one window of physics (2 ms of scene time).
  double get_worst_window_s() const;
  std::int64_t get_faults() const { return scheduler_.get_faults(); }

 private:
  class Physics;

  synth::EffectSet find_effects(std::size_t body) const;
  scene::ScheduledBody schedule(std::size_t body, synth::EffectSet effects) const;
  std::vector<scene::ScheduledBody> list_scheduled_bodies() const;
  synth::Synthesiser& open();
  void push(double now_s);

  scene::Scene* scene_;
  bool is_handled_;
  double look_ahead_s_;  // of the physics
  double pushed_s_;      // of the events
  scene::Session session_;
  effects::EffectSelector selector_;
  scene::EventScheduler scheduler_;
  std::unique_ptr<Physics> physics_;
  synth::Synthesiser* synthesiser_;
  std::vector<std::string> warnings_;
  double min_lead_s_ = std::numeric_limits<double>::infinity();
};

}  // namespace carillon::render
