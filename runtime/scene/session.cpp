#include "runtime/scene/session.hpp"

#include <algorithm>
#include <limits>
#include <map>

#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/base/error.hpp"
#include "runtime/scene/planning.hpp"
#include "runtime/scene/pose.hpp"

namespace carillon::scene {
namespace {

std::shared_ptr<const synth::Model> make_model(const bank::Bank& bank, const SceneBody& body, double rate_hz, bool has_clicks) {
  double radius_m = has_clicks ? body.sphere_radius_m : 0.0;
  if (has_clicks && radius_m == 0.0) radius_m = radiation::calc_sphere_radius_m(bank);
  return synth::Model::make(bank, {.rate_hz = rate_hz, .sphere_radius_m = radius_m, .transfers = body.transfers});
}

}  // namespace

Session::Session(const Scene& scene, const std::vector<const bank::Bank*>& banks, double rate_hz, bool has_clicks,
                 std::optional<synth::ListeningHead> head)
    : scene_(&scene), banks_(banks), rate_hz_(rate_hz), microphones_(make_microphones(scene)), head_(std::move(head)) {
  std::map<const bank::Bank*, std::shared_ptr<const synth::Model>> models;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    std::shared_ptr<const synth::Model>& model = models[banks[i]];
    if (!model) model = make_model(*banks[i], scene.bodies[i], rate_hz, has_clicks);
    models_.push_back(model);
    if (scene.bodies[i].overrides.on.has(synth::Effect::kDirectivity) && model->get_directivity() == nullptr)
      throw InputError(scene.bodies[i].place +
                       ": \"effects\" names \"directivity\", which needs a bank with multipoles, and this bank has none; compute its bank "
                       "with them, or remove the effect");
    if (scene.bodies[i].overrides.on.has(synth::Effect::kCascade) && !model->has_cascade())
      throw InputError(
          scene.bodies[i].place +
          ": \"effects\" names \"cascade\", which needs a bank with a nonlinear energy, a thickness and modes above the coupled "
          "ones, and this bank lacks one of them; compute the bank with \"nonlinear\", or remove the effect");
    if (scene.bodies[i].overrides.on.has(synth::Effect::kNonlinear) && model->get_nonlinear() == nullptr)
      throw InputError(scene.bodies[i].place +
                       ": the effect \"nonlinear\" is asked for, which needs a bank with a nonlinear energy, and this bank has none; "
                       "compute its bank with it, or remove the effect");
  }
}

synth::SynthesiserOptions Session::make_options() const {
  return {.rate_hz = rate_hz_,
          .microphones_m = microphones_.offset_m,
          .listener_m = microphones_.centre.find(0.0).position_m,
          .max_bodies = std::max(1, static_cast<int>(models_.size())),
          .budget = calc_budget(scene_->quality, rate_hz_),
          .ground = make_ground(*scene_),
          .floor = find_floor(*scene_),
          .head = head_};
}

synth::BodySettings Session::make_settings(std::size_t body, synth::EffectSet effects) const {
  const SceneBody& of = scene_->bodies[body];
  return {.position_m = calc_world_point(of.spec.initial, banks_[body]->rigid.centre_m),
          .rotation = of.spec.initial.rotation,
          .effects = effects,
          .silence_pa = scene_->quality.silence_pa.value_or(synth::BodySettings{}.silence_pa),
          .surface = make_surface(of),
          .isa = scene_->quality.instructions};
}

synth::Synthesiser& Session::open(const synth::SynthesiserOptions& options) {
  synthesiser_ = std::make_unique<synth::Synthesiser>(options);
  return *synthesiser_;
}

void Session::add_body(const synth::BodySettings& settings) { synthesiser_->add_body(models_[added_++], settings); }

synth::EffectSet find_effects(const Scene& scene, std::size_t body, synth::EffectSet effects) {
  const bank::Bank* bank = scene.bodies[body].spec.bank;
  if (bank == nullptr || bank->multipoles.is_empty()) effects = effects.without(synth::Effect::kDirectivity);
  if (bank == nullptr || bank->quartic.is_empty()) effects = effects.without({synth::Effect::kNonlinear, synth::Effect::kCascade});
  if (!find_floor(scene)) effects = effects.without(synth::Effect::kGroundReflection);
  if (!has_head(scene)) effects = effects.without(synth::Effect::kHead);
  if (scene.bodies[body].spec.fixed) effects = effects.without(synth::Effect::kAccelerationNoise);
  if (!scene.microphones_m.empty()) effects = effects.with(synth::Effect::kTwoEars);
  return effects;
}

double calc_strike_lead_s(const synth::Model& model, synth::EffectSet effects) {
  return effects.has(synth::Effect::kAccelerationNoise) ? model.get_sphere_radius_m() / synth::kSoundSpeedMs : 0.0;
}

double calc_budget(const Quality& quality, double rate_hz) {
  return quality.modes ? static_cast<double>(*quality.modes) * rate_hz : std::numeric_limits<double>::infinity();
}

}  // namespace carillon::scene
