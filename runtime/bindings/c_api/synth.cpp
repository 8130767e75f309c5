// The synthesiser of the C interface: its bodies, its sound and its counters.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include "runtime/acoustics/head/sphere.hpp"
#include "runtime/bindings/c_api/calls.hpp"
#include "runtime/bindings/c_api/structures.hpp"

namespace carillon::c_api {
namespace {

uint32_t to_bits(synth::EffectSet effects) {
  uint32_t bits = 0;
  for (const synth::Effect effect : effects) bits |= 1U << static_cast<unsigned>(effect);
  return bits;
}

synth::EffectSet to_effects(uint32_t bits) {
  if (bits >= 1U << static_cast<unsigned>(synth::kEffectCount))
    throw InputError("effects " + std::to_string(bits) + " are no sum of carillon_effect");
  return synth::EffectSet::from_mask(bits);
}

/// `make_settings` may throw.
template <typename MakeSettings>
carillon_status add_body(carillon_synth* synth, const carillon_model* model, int32_t* body, char* message, size_t message_size,
                         MakeSettings&& make_settings) noexcept {
  if (synth->synthesiser.is_full()) {
    write_message("there is no room for another body; raise max_bodies, or remove one", message, message_size);
    return CARILLON_FULL;
  }
  return run(message, message_size, [&] { *body = synth->synthesiser.add_body(model->model, make_settings()); });
}

static_assert(CARILLON_EFFECT_COUNT + CARILLON_LATER_EFFECT_COUNT + 3 == synth::kEffectCount &&
              CARILLON_CASCADE == 1 << static_cast<int>(synth::Effect::kCascade) &&
              CARILLON_NONLINEAR == 1 << static_cast<int>(synth::Effect::kNonlinear) &&
              CARILLON_HEAD == 1 << static_cast<int>(synth::Effect::kHead) &&
              CARILLON_TWO_EARS == 1 << static_cast<int>(synth::Effect::kTwoEars) &&
              CARILLON_GROUND_REFLECTION == 1 << static_cast<int>(synth::Effect::kGroundReflection) &&
              CARILLON_ACCELERATION_NOISE == 1 << static_cast<int>(synth::Effect::kAccelerationNoise));

}  // namespace

template <>
carillon_options make_default() {
  const synth::SynthesiserOptions ours{.microphones_m = {}};  // does not allocate: carillon_options_init cannot fail
  carillon_options options{};
  options.rate_hz = ours.rate_hz;
  options.max_bodies = ours.max_bodies;
  options.max_strikes = ours.max_strikes;
  options.ring_events = ours.ring_events;
  options.longest_m = ours.longest_m;
  options.max_waypoints = ours.max_waypoints;
  options.budget = ours.budget;
  options.ground_roughness_m = ours.ground.roughness_m;
  options.ground_friction = ours.ground.friction;
  return options;
}

template <>
carillon_body_options make_default() {
  const synth::BodySettings ours;
  carillon_body_options options{};
  options.effects = to_bits(ours.effects);
  options.rotation[0] = 1.0;
  options.longest_m = ours.longest_m;
  options.silence_pa = ours.silence_pa;
  options.roughness_m = ours.surface.roughness_m;
  options.friction = ours.surface.friction;
  return options;
}

}  // namespace carillon::c_api

using namespace carillon;
using namespace carillon::c_api;

extern "C" {

uint32_t carillon_abi_version(void) { return CARILLON_ABI_VERSION; }

const char* carillon_status_text(carillon_status status) {
  switch (status) {
    case CARILLON_OK:
      return "ok";
    case CARILLON_BAD_ARGUMENT:
      return "bad argument";
    case CARILLON_BAD_INPUT:
      return "bad input";
    case CARILLON_FULL:
      return "no room";
    case CARILLON_SYSTEM:
      return "the system failed";
  }
  return "unknown status";
}

void carillon_options_init_sized(carillon_options* options, size_t size) { init(options, size); }

carillon_status carillon_create(const carillon_options* options, carillon_synth** synth, char* message, size_t message_size) {
  const auto given = read(options);
  if (synth != nullptr) *synth = nullptr;
  if (synth == nullptr || !given)
    return refuse("carillon_create: synth must not be NULL, options must be initialised", message, message_size);
  if (given->microphones_m != nullptr && given->microphone_count < 1)
    return refuse("carillon_create: microphone_count must be positive where microphones are given", message, message_size);
  return run(message, message_size, [&] {
    synth::SynthesiserOptions ours{.rate_hz = given->rate_hz,
                                   .listener_m = to_vector(given->listener_m),
                                   .max_bodies = given->max_bodies,
                                   .max_strikes = given->max_strikes,
                                   .max_forces = 2 * std::min(given->max_strikes, 1 << 20),
                                   .max_waypoints = given->max_waypoints,
                                   .ring_events = given->ring_events,
                                   .longest_m = given->longest_m,
                                   .budget = given->budget};
    ours.ground.roughness_m = given->ground_roughness_m;
    ours.ground.friction = given->ground_friction;
    if (given->microphones_m != nullptr) {
      ours.microphones_m.clear();
      for (int32_t m = 0; m < given->microphone_count; ++m) ours.microphones_m.push_back(to_vector(given->microphones_m[m]));
    }
    if (given->head_radius_m != 0.0)
      ours.head = synth::make_level_head(head::make_sphere(ours.rate_hz, {.radius_m = given->head_radius_m}), ours.microphones_m);
    if (given->floor_reflection != 0.0)
      ours.floor = synth::Floor{.point_m = {0.0, 0.0, given->floor_height_m}, .reflection = given->floor_reflection};
    *synth = new carillon_synth(std::move(ours));
  });
}

void carillon_destroy(carillon_synth* synth) { delete synth; }

carillon_status carillon_add_body(carillon_synth* synth, const carillon_model* model, const double position_m[3], int32_t* body,
                                  char* message, size_t message_size) {
  if (body != nullptr) *body = -1;
  if (synth == nullptr || model == nullptr || position_m == nullptr || body == nullptr)
    return refuse("carillon_add_body: synth, model, position_m and body must not be NULL", message, message_size);
  return add_body(synth, model, body, message, message_size, [&] { return synth::BodySettings{.position_m = to_vector(position_m)}; });
}

void carillon_body_options_init_sized(carillon_body_options* options, size_t size) { init(options, size); }

carillon_status carillon_add_body_with(carillon_synth* synth, const carillon_model* model, const carillon_body_options* options,
                                       int32_t* body, char* message, size_t message_size) {
  const auto ours = read(options);
  if (body != nullptr) *body = -1;
  if (synth == nullptr || model == nullptr || body == nullptr || !ours)
    return refuse("carillon_add_body_with: synth, model and body must not be NULL, options must be initialised", message, message_size);
  return add_body(synth, model, body, message, message_size, [&] {
    return synth::BodySettings{.position_m = to_vector(ours->position_m),
                               .rotation = to_quaternion(ours->rotation),
                               .effects = to_effects(ours->effects),
                               .silence_pa = ours->silence_pa,
                               .surface = {.roughness_m = ours->roughness_m, .friction = ours->friction},
                               .longest_m = ours->longest_m,
                               .max_waypoints = ours->max_waypoints};
  });
}

uint32_t carillon_get_effects(const carillon_synth* synth, int32_t body) {
  uint32_t bits = 0;
  if (synth != nullptr) (void)run(nullptr, 0, [&] { bits = to_bits(synth->synthesiser.get_effects(body)); });
  return bits;
}

carillon_status carillon_swap_model(carillon_synth* synth, int32_t body, const carillon_model* model, char* message, size_t message_size) {
  if (synth == nullptr || model == nullptr) return refuse("carillon_swap_model: synth and model must not be NULL", message, message_size);
  return run(message, message_size, [&] { synth->synthesiser.swap_model(body, model->model); });
}

carillon_status carillon_remove_body(carillon_synth* synth, int32_t body) {
  if (synth == nullptr) return CARILLON_BAD_ARGUMENT;
  return run(nullptr, 0, [&] { synth->synthesiser.remove_body(body); });
}

void carillon_collect(carillon_synth* synth) {
  if (synth != nullptr) synth->synthesiser.collect();
}

void carillon_set_gain(carillon_synth* synth, double per_pa) {
  if (synth != nullptr) synth->synthesiser.set_gain(per_pa);
}

void carillon_set_budget(carillon_synth* synth, double mode_samples_per_s) {
  if (synth != nullptr) synth->synthesiser.set_budget(mode_samples_per_s);
}

double carillon_get_budget(const carillon_synth* synth) { return synth == nullptr ? 0.0 : synth->synthesiser.get_budget(); }

carillon_status carillon_keep_load(carillon_synth* synth, double share, double busy_s) {
  if (synth == nullptr) return CARILLON_BAD_ARGUMENT;
  if (!(share >= 0.01 && share <= 1.0) || !(busy_s >= 0.0)) return CARILLON_BAD_INPUT;
  synth->load.keep(synth->synthesiser, share, busy_s);
  return CARILLON_OK;
}

void carillon_process(carillon_synth* synth, float* const* out, int32_t channels, int32_t frames) {
  if (synth == nullptr || out == nullptr || channels <= 0 || frames <= 0) return;
  synth->synthesiser.process(out, channels, frames);
}

double carillon_time_s(const carillon_synth* synth) { return synth == nullptr ? 0.0 : synth->synthesiser.get_time_s(); }
double carillon_horizon_s(const carillon_synth* synth) { return synth == nullptr ? 0.0 : synth->synthesiser.get_horizon_s(); }

void carillon_counters_init_sized(carillon_counters* counters, size_t size) { init(counters, size); }

carillon_status carillon_get_counters(const carillon_synth* synth, carillon_counters* counters) {
  if (synth == nullptr || !read(counters)) return CARILLON_BAD_ARGUMENT;
  const synth::SynthesiserCounters ours = synth->synthesiser.get_counters();
  write(carillon_counters{.size = 0,
                          .reserved = 0,
                          .strikes = ours.strikes,
                          .refused = ours.refused,
                          .late = ours.late,
                          .faults = ours.faults,
                          .overflows = ours.overflows,
                          .resets = ours.resets,
                          .mode_samples = ours.mode_samples,
                          .faded = ours.faded,
                          .underruns = ours.underruns,
                          .zeroed = ours.zeroed,
                          .contacts_accepted = ours.contacts.accepted,
                          .contacts_refused = ours.contacts.refused,
                          .contacts_dropped = ours.contacts.dropped,
                          .contacts_thinned = ours.contacts.thinned,
                          .contacts_without_use = ours.contacts.without_use},
        counters);
  return CARILLON_OK;
}

void carillon_effect_counters_init_sized(carillon_effect_counters* counters, size_t size) { init(counters, size); }

carillon_status carillon_get_effect_counters(const carillon_synth* synth, int32_t body, carillon_effect_counters* counters) {
  if (synth == nullptr || !read(counters)) return CARILLON_BAD_ARGUMENT;
  const synth::EffectCounters ours = synth->synthesiser.get_effect_counters(body);
  carillon_effect_counters given{};
  std::copy_n(ours.units.begin(), CARILLON_EFFECT_COUNT, given.units);
  std::copy_n(ours.units.begin() + CARILLON_EFFECT_COUNT, CARILLON_LATER_EFFECT_COUNT, given.later_units);
  given.head_units = ours.units[synth::Effect::kHead];
  given.nonlinear_units = ours.units[synth::Effect::kNonlinear];
  given.cascade_units = ours.units[synth::Effect::kCascade];
  write(given, counters);
  return CARILLON_OK;
}

double carillon_peak_pa(const carillon_synth* synth, int32_t body) { return synth == nullptr ? 0.0 : synth->synthesiser.get_peak_pa(body); }

double carillon_deflection(const carillon_synth* synth, int32_t body) {
  return synth == nullptr ? 0.0 : synth->synthesiser.get_deflection(body);
}

}  // extern "C"
