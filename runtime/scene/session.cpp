#include "runtime/scene/session.hpp"

#include <algorithm>
#include <limits>

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
    : scene_(&scene), rate_hz_(rate_hz), has_clicks_(has_clicks), microphones_(make_microphones(scene)), head_(std::move(head)) {
  for (const bank::Bank* bank : banks) add_model(bank);
}

void Session::add_model(const bank::Bank* bank) {
  const SceneBody& body = scene_->bodies[models_.size()];
  std::shared_ptr<const synth::Model>& shared = shared_[bank];
  if (!shared) shared = make_model(*bank, body, rate_hz_, has_clicks_);
  if (body.overrides.on.has(synth::Effect::kDirectivity) && shared->get_directivity() == nullptr)
    throw InputError(body.place +
                     ": \"effects\" names \"directivity\", which needs a bank with multipoles, and this bank has none; compute its bank "
                     "with them, or remove the effect");
  if (body.overrides.on.has(synth::Effect::kCascade) && !shared->has_cascade())
    throw InputError(body.place +
                     ": \"effects\" names \"cascade\", which needs a bank with a nonlinear energy, a thickness and modes above the coupled "
                     "ones, and this bank lacks one of them; compute the bank with \"nonlinear\", or remove the effect");
  if (body.overrides.on.has(synth::Effect::kNonlinear) && shared->get_nonlinear() == nullptr)
    throw InputError(body.place +
                     ": the effect \"nonlinear\" is asked for, which needs a bank with a nonlinear energy, and this bank has none; "
                     "compute its bank with it, or remove the effect");
  banks_.push_back(bank);
  models_.push_back(shared);
}

void Session::keep_models(std::size_t count) {
  banks_.resize(count);
  models_.resize(count);
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
          .gain = of.gain,
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
  if (has_ambisonics(scene)) effects = effects.with({synth::Effect::kTwoEars, synth::Effect::kHead});
  return effects;
}

double calc_strike_lead_s(const synth::Model& model, synth::EffectSet effects) {
  return effects.has(synth::Effect::kAccelerationNoise) ? model.get_sphere_radius_m() / synth::kSoundSpeedMs : 0.0;
}

double calc_budget(const Quality& quality, double rate_hz) {
  return quality.modes ? static_cast<double>(*quality.modes) * rate_hz : std::numeric_limits<double>::infinity();
}

}  // namespace carillon::scene
