// Prepares a scene for playback, offline or live: microphones, models of the banks, a synthesiser with its bodies.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/scene/microphones.hpp"
#include "runtime/scene/scene.hpp"
#include "runtime/synth/effects.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/synthesiser.hpp"

namespace carillon::scene {

/// Body i of the scene is body i of the synthesiser; bodies with the same bank share a model. Contains the decisions common to offline and
/// live playback; the caller chooses the event capacity.
class Session {
 public:
  /// Makes the models. banks[i] belongs to scene.bodies[i]; scene and banks must outlive the result. `has_clicks`: models include the
  /// radius for acceleration noise. `head`: make_head() of the scene at this rate.
  Session(const Scene& scene, const std::vector<const bank::Bank*>& banks, double rate_hz, bool has_clicks,
          std::optional<synth::ListeningHead> head);

  const Microphones& get_microphones() const { return microphones_; }
  const std::optional<synth::ListeningHead>& get_head() const { return head_; }
  const synth::Model& get_model(std::size_t body) const { return *models_[body]; }

  /// Rate, microphones, head, listener, number of bodies, budget and ground.
  synth::SynthesiserOptions make_options() const;
  /// Initial pose, silence threshold, surface and instruction set of a body with these effects.
  synth::BodySettings make_settings(std::size_t body, synth::EffectSet effects) const;

  /// Makes the model of the last, new body of the scene, or shares that of another body. Throws InputError for effects that its bank does
  /// not support.
  void add_model(const bank::Bank* bank);
  /// Drops the models of the bodies from `count` on.
  void keep_models(std::size_t count);

  /// Makes the synthesiser. Throws as synth::Synthesiser does.
  synth::Synthesiser& open(const synth::SynthesiserOptions& options);
  /// Adds the next body of the scene.
  void add_body(const synth::BodySettings& settings);

 private:
  const Scene* scene_;
  std::vector<const bank::Bank*> banks_;
  double rate_hz_;
  bool has_clicks_;
  Microphones microphones_;
  std::optional<synth::ListeningHead> head_;
  std::map<const bank::Bank*, std::shared_ptr<const synth::Model>> shared_;
  std::vector<std::shared_ptr<const synth::Model>> models_;  // per body
  std::unique_ptr<synth::Synthesiser> synthesiser_;
  std::size_t added_ = 0;
};

/// Effects that a body of the scene can have. Fixed bodies and fixed microphones have no Doppler shift; directivity needs multipoles,
/// ground_reflection a reflecting ground, head a listener with a head.
synth::EffectSet find_effects(const Scene& scene, std::size_t body, synth::EffectSet effects);

/// Time by which a strike must be known before it begins: a click starts at the side of the body nearest to the listener.
double calc_strike_lead_s(const synth::Model& model, synth::EffectSet effects);

/// Mode-samples per second of sound: quality.modes at all times, or unlimited.
double calc_budget(const Quality& quality, double rate_hz);

}  // namespace carillon::scene
