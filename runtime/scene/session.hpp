// A scene made ready to sound, offline or live: where it is heard, the models of its banks, and a synthesiser with its bodies.
#pragma once

#include <cstddef>
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

/// Body i of the scene is body i of the synthesiser and sounds by a model that all bodies of its bank share. What is the same however a
/// scene is played is decided here; how much room events need is the caller's.
class Session {
 public:
  /// Makes the models. banks[i] belongs to scene.bodies[i]; scene and banks must outlive the result. `has_clicks`: models know the radius
  /// that acceleration noise needs. `head`: make_head() of the scene at that rate.
  Session(const Scene& scene, const std::vector<const bank::Bank*>& banks, double rate_hz, bool has_clicks,
          std::optional<synth::ListeningHead> head);

  const Microphones& get_microphones() const { return microphones_; }
  const std::optional<synth::ListeningHead>& get_head() const { return head_; }
  const synth::Model& get_model(std::size_t body) const { return *models_[body]; }

  /// Rate, microphones, head, listener, number of bodies, budget and ground of the scene.
  synth::SynthesiserOptions make_options() const;
  /// Place at the start, silence, surface and instructions of a body with these effects.
  synth::BodySettings make_settings(std::size_t body, synth::EffectSet effects) const;

  /// Makes the synthesiser. Throws as synth::Synthesiser does.
  synth::Synthesiser& open(const synth::SynthesiserOptions& options);
  /// Adds the next body.
  void add_body(const synth::BodySettings& settings);

 private:
  const Scene* scene_;
  std::vector<const bank::Bank*> banks_;
  double rate_hz_;
  Microphones microphones_;
  std::optional<synth::ListeningHead> head_;
  std::vector<std::shared_ptr<const synth::Model>> models_;  // per body
  std::unique_ptr<synth::Synthesiser> synthesiser_;
  std::size_t added_ = 0;
};

/// What of its effects a body of the scene can have: nothing pushes one that is fixed, and microphones stay where they are put; directivity
/// is of banks with multipoles, ground_reflection of scenes whose ground reflects, head of listeners that have one.
synth::EffectSet find_effects(const Scene& scene, std::size_t body, synth::EffectSet effects);

/// By how much a strike must be known before it begins: a click starts at the side of the body that is nearest to the listener.
double calc_strike_lead_s(const synth::Model& model, synth::EffectSet effects);

/// Mode-samples that a second of sound may take: quality.modes at all times, or as many as there are.
double calc_budget(const Quality& quality, double rate_hz);

}  // namespace carillon::scene
