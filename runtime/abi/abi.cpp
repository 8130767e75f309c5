// The whole C interface, a short function for each of carillon.h; longer than most files.
// Method:     opaque handles around the C++ classes; exceptions end here and become a status and a message.
// Source:     none.
// Deviations: none.
#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstring>
#include <exception>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "runtime/abi/carillon.h"
#include "runtime/bank/bank.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/bank/edits.hpp"
#include "runtime/bank/nearest.hpp"
#include "runtime/base/chance.hpp"
#include "runtime/base/error.hpp"
#include "runtime/events/events.hpp"
#include "runtime/head/sphere.hpp"
#include "runtime/radiation/gains.hpp"
#include "runtime/support/losses.hpp"
#include "runtime/synth/load_keeper.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "runtime/synth/variation.hpp"

struct carillon_bank {
  explicit carillon_bank(carillon::bank::Bank given) : bank(std::move(given)) {}
  carillon::bank::Bank bank;

  /// Made when it is asked for first. Throws std::bad_alloc.
  const carillon::bank::SurfaceTree& get_tree() const {
    const carillon::bank::SurfaceTree* made = ready.load(std::memory_order_acquire);
    if (made != nullptr) return *made;
    const std::lock_guard lock(making);
    if (!tree) tree.emplace(bank);
    ready.store(&*tree, std::memory_order_release);
    return *tree;
  }

 private:
  mutable std::mutex making;
  mutable std::optional<carillon::bank::SurfaceTree> tree;
  mutable std::atomic<const carillon::bank::SurfaceTree*> ready{nullptr};
};
struct carillon_model {
  std::shared_ptr<const carillon::synth::Model> model;
};
struct carillon_synth {
  explicit carillon_synth(carillon::synth::SynthesiserOptions options) : synthesiser(std::move(options)) {}
  carillon::synth::Synthesiser synthesiser;
  carillon::synth::LoadKeeper load;
};

namespace {

using namespace carillon;

void write_message(std::string_view text, char* message, size_t message_size) {
  if (message == nullptr || message_size == 0) return;
  const std::size_t length = std::min(text.size(), message_size - 1);
  std::memcpy(message, text.data(), length);
  message[length] = '\0';
}

/// Runs `work` and makes a status of what it throws.
template <typename Work>
carillon_status run(char* message, size_t message_size, Work&& work) noexcept {
  try {
    work();
    write_message("", message, message_size);
    return CARILLON_OK;
  } catch (const InputError& error) {
    write_message(error.what(), message, message_size);
    return CARILLON_BAD_INPUT;
  } catch (const std::bad_alloc&) {
    write_message("out of memory", message, message_size);
  } catch (const std::exception& error) {
    write_message(error.what(), message, message_size);
  } catch (...) {
    write_message("unknown error", message, message_size);
  }
  return CARILLON_SYSTEM;
}

carillon_status refuse(const char* text, char* message, size_t message_size) {
  write_message(text, message, message_size);
  return CARILLON_BAD_ARGUMENT;
}

/// The sizes that structures had first: no caller's is smaller. Once one has grown, its first size stands here.
template <typename T>
constexpr std::size_t kMinSize = sizeof(T);
template <>
constexpr std::size_t kMinSize<carillon_options> = offsetof(carillon_options, head_radius_m);
template <>
constexpr std::size_t kMinSize<carillon_effect_counters> = offsetof(carillon_effect_counters, head_units);

template <>
constexpr std::size_t kMinSize<carillon_counters> = offsetof(carillon_counters, contacts_accepted);

template <typename T>
T make_default() {
  return T{};
}

/// Writes the defaults of as many fields as the caller's structure has.
template <typename T>
void init(T* given, size_t size) {
  if (given == nullptr || size < kMinSize<T>) return;
  T ours = make_default<T>();
  ours.size = static_cast<uint32_t>(std::min(size, sizeof(T)));
  std::memcpy(given, &ours, ours.size);
}

/// A structure of the caller's with the defaults of the fields that it has not; nothing when it was not initialised.
template <typename T>
std::optional<T> read(const T* given) {
  if (given == nullptr || given->size < kMinSize<T>) return std::nullopt;
  T ours = make_default<T>();
  std::memcpy(&ours, given, std::min<std::size_t>(given->size, sizeof(T)));
  return ours;
}

/// Gives the caller as many fields as its structure has, which must have been initialised.
template <typename T>
void write(T ours, T* given) {
  ours.size = given->size;
  std::memcpy(given, &ours, std::min<std::size_t>(given->size, sizeof(T)));
}

template <>
carillon_model_options make_default() {
  carillon_model_options options{};
  options.radiation = CARILLON_RADIATION_AUTO;
  options.rate_hz = 48000.0;
  return options;
}

template <>
carillon_edits make_default() {
  carillon_edits edits{};
  edits.density_scale = edits.stiffness_scale = edits.size_scale = 1.0;
  return edits;
}

template <>
carillon_options make_default() {
  const synth::SynthesiserOptions ours{.microphones_m = {}};  // takes no memory, as carillon_options_init cannot fail
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

template <>
carillon_impulse make_default() {
  carillon_impulse impulse{};
  impulse.barycentric[0] = 1.0;
  impulse.other = -1;
  return impulse;
}

template <>
carillon_force make_default() {
  carillon_force force{};
  force.other = -1;
  force.barycentric[0] = 1.0;
  return force;
}

template <>
carillon_contact make_default() {
  carillon_contact contact{};
  contact.state = CARILLON_CONTACT_HOLD;
  contact.barycentric[0] = 1.0;
  contact.normal[2] = 1.0;
  contact.patch_radius_m = 1e-4;
  contact.impedance_n_s_m = CARILLON_BY_MATERIAL;
  contact.other = -1;
  return contact;
}

template <>
carillon_motion make_default() {
  carillon_motion motion{};
  motion.rotation[0] = 1.0;
  return motion;
}

static_assert(CARILLON_BY_MATERIAL == events::LastingContact::kByMaterial);
static_assert(CARILLON_EFFECT_COUNT + CARILLON_LATER_EFFECT_COUNT + 3 == synth::kEffectCount &&
              CARILLON_CASCADE == 1 << static_cast<int>(synth::Effect::kCascade) &&
              CARILLON_NONLINEAR == 1 << static_cast<int>(synth::Effect::kNonlinear) &&
              CARILLON_HEAD == 1 << static_cast<int>(synth::Effect::kHead) &&
              CARILLON_TWO_EARS == 1 << static_cast<int>(synth::Effect::kTwoEars) &&
              CARILLON_GROUND_REFLECTION == 1 << static_cast<int>(synth::Effect::kGroundReflection) &&
              CARILLON_ACCELERATION_NOISE == 1 << static_cast<int>(synth::Effect::kAccelerationNoise));

carillon::Vec3 to_vector(const double* x) { return {x[0], x[1], x[2]}; }
events::Quaternion to_quaternion(const double* x) { return {x[0], x[1], x[2], x[3]}; }

/// For the click of the body; 0, which a body without clicks may have, when the surface has no inside.
double find_sphere_radius_m(const bank::Bank& bank) {
  try {
    return radiation::calc_sphere_radius_m(bank);
  } catch (const InputError&) {
    return 0.0;
  }
}

events::Impulse to_event(const carillon_impulse& impulse) {
  return {.time_s = impulse.time_s,
          .body = impulse.body,
          .other = impulse.other,
          .triangle = impulse.triangle,
          .shape = impulse.gaussian != 0 ? events::PulseShape::kGaussian : events::PulseShape::kHertz,
          .barycentric = to_vector(impulse.barycentric),
          .impulse_n_s = to_vector(impulse.impulse_n_s),
          .duration_s = impulse.duration_s};
}

carillon_status push(carillon_synth* synth, const events::Event& event) noexcept {
  if (events::find_fault(event) != nullptr) {
    (void)synth->synthesiser.push(event);  // counts it
    return CARILLON_BAD_INPUT;
  }
  return synth->synthesiser.push(event) ? CARILLON_OK : CARILLON_FULL;
}

bank::Frequencies to_frequencies(int32_t frequencies) {
  if (frequencies != CARILLON_FREQUENCIES_CORRECTED && frequencies != CARILLON_FREQUENCIES_MESH)
    throw InputError("frequencies " + std::to_string(frequencies) + " is no carillon_frequencies");
  return frequencies == CARILLON_FREQUENCIES_MESH ? bank::Frequencies::kMesh : bank::Frequencies::kCorrected;
}

}  // namespace

extern "C" {

uint32_t carillon_abi_version(void) { return CARILLON_ABI_VERSION; }

carillon_status carillon_bank_open(const char* file, carillon_bank** bank, char* message, size_t message_size) {
  return carillon_bank_open_as(file, CARILLON_FREQUENCIES_CORRECTED, bank, message, message_size);
}

carillon_status carillon_bank_parse(const void* bytes, size_t size, carillon_bank** bank, char* message, size_t message_size) {
  return carillon_bank_parse_as(bytes, size, CARILLON_FREQUENCIES_CORRECTED, bank, message, message_size);
}

carillon_status carillon_bank_open_as(const char* file, int32_t frequencies, carillon_bank** bank, char* message, size_t message_size) {
  if (bank != nullptr) *bank = nullptr;
  if (file == nullptr || bank == nullptr) return refuse("carillon_bank_open: file and bank must not be NULL", message, message_size);
  return run(message, message_size,
             [&] { *bank = new carillon_bank(bank::choose_frequencies(bank::read_bank(file), to_frequencies(frequencies))); });
}

carillon_status carillon_bank_parse_as(const void* bytes, size_t size, int32_t frequencies, carillon_bank** bank, char* message,
                                       size_t message_size) {
  if (bank != nullptr) *bank = nullptr;
  if (bytes == nullptr || bank == nullptr) return refuse("carillon_bank_parse: bytes and bank must not be NULL", message, message_size);
  return run(message, message_size, [&] {
    *bank = new carillon_bank(
        bank::choose_frequencies(bank::parse_bank({static_cast<const std::byte*>(bytes), size}), to_frequencies(frequencies)));
  });
}

void carillon_bank_close(carillon_bank* bank) { delete bank; }

int32_t carillon_bank_mode_count(const carillon_bank* bank) { return bank == nullptr ? 0 : static_cast<int32_t>(bank->bank.mode_count()); }

int32_t carillon_bank_triangle_count(const carillon_bank* bank) {
  return bank == nullptr ? 0 : static_cast<int32_t>(bank->bank.triangles.size());
}

double carillon_bank_frequency_hz(const carillon_bank* bank, int32_t mode) {
  return mode < 0 || mode >= carillon_bank_mode_count(bank) ? 0.0 : bank->bank.freq_hz(static_cast<std::size_t>(mode));
}

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

int32_t carillon_bank_vertex_count(const carillon_bank* bank) {
  return bank == nullptr ? 0 : static_cast<int32_t>(bank->bank.vertices_m.size());
}

const double* carillon_bank_vertices_m(const carillon_bank* bank) {
  static_assert(sizeof(carillon::Vec3) == 3 * sizeof(double));
  return bank == nullptr || bank->bank.vertices_m.empty() ? nullptr : bank->bank.vertices_m.front().data();
}

const int32_t* carillon_bank_triangles(const carillon_bank* bank) {
  static_assert(sizeof(bank->bank.triangles[0]) == 3 * sizeof(int32_t));
  return bank == nullptr || bank->bank.triangles.empty() ? nullptr : bank->bank.triangles.front().data();
}

void carillon_bank_centre_m(const carillon_bank* bank, double centre_m[3]) {
  if (centre_m == nullptr) return;
  const carillon::Vec3 centre = bank == nullptr ? carillon::Vec3{} : bank->bank.rigid.centre_m;
  std::copy(centre.begin(), centre.end(), centre_m);
}

void carillon_body_facts_init_sized(carillon_body_facts* facts, size_t size) { init(facts, size); }

carillon_status carillon_bank_get_facts(const carillon_bank* bank, carillon_body_facts* facts) {
  if (bank == nullptr || !read(facts)) return CARILLON_BAD_ARGUMENT;
  const bank::RigidBody& rigid = bank->bank.rigid;
  const bank::Material& material = bank->bank.material;
  carillon_body_facts ours{};
  ours.mass_kg = rigid.mass_kg;
  ours.volume_m3 = rigid.volume_m3;
  std::copy(rigid.inertia_kg_m2.begin(), rigid.inertia_kg_m2.end(), ours.inertia_kg_m2);
  ours.density_kg_m3 = material.density_kg_m3;
  ours.young_modulus_pa = material.young_modulus_pa;
  ours.poisson_ratio = material.poisson_ratio;
  write(ours, facts);
  return CARILLON_OK;
}

carillon_status carillon_bank_nearest_point(const carillon_bank* bank, const double point_m[3], int32_t* triangle, double barycentric[3],
                                            double closest_m[3], double* distance_m) {
  if (triangle != nullptr) *triangle = -1;
  if (bank == nullptr || point_m == nullptr || triangle == nullptr || barycentric == nullptr) return CARILLON_BAD_ARGUMENT;
  return run(nullptr, 0, [&] {
    const bank::NearestPlace place = bank->get_tree().find(to_vector(point_m));
    if (place.triangle < 0) throw InputError("the point is not finite or too far away");
    *triangle = place.triangle;
    std::copy(place.barycentric.begin(), place.barycentric.end(), barycentric);
    if (closest_m != nullptr) std::copy(place.point_m.begin(), place.point_m.end(), closest_m);
    if (distance_m != nullptr) *distance_m = place.distance_m;
  });
}

void carillon_edits_init_sized(carillon_edits* edits, size_t size) { init(edits, size); }

carillon_status carillon_bank_edit(const carillon_bank* bank, const carillon_edits* edits, carillon_bank** edited, char* message,
                                   size_t message_size) {
  const auto ours = read(edits);
  if (edited != nullptr) *edited = nullptr;
  if (bank == nullptr || edited == nullptr || !ours)
    return refuse("carillon_bank_edit: bank and edited must not be NULL, edits must be initialised", message, message_size);
  return run(message, message_size, [&] {
    bank::Edits wanted{.density_scale = ours->density_scale, .stiffness_scale = ours->stiffness_scale, .size_scale = ours->size_scale};
    if (ours->sets_damping != 0) wanted.alphas = {ours->alpha1_s, ours->alpha2_per_s};
    *edited = new carillon_bank(bank::calc_edited(bank->bank, wanted));
  });
}

void carillon_model_options_init_sized(carillon_model_options* options, size_t size) { init(options, size); }

carillon_status carillon_model_make(const carillon_bank* bank, const carillon_model_options* options, carillon_model** model, char* message,
                                    size_t message_size) {
  const auto ours = read(options);
  if (model != nullptr) *model = nullptr;
  if (bank == nullptr || model == nullptr || !ours)
    return refuse("carillon_model_make: bank and model must not be NULL, options must be initialised", message, message_size);
  static constexpr std::array kKinds{radiation::GainKind::kSphere, radiation::GainKind::kOsg02, radiation::GainKind::kBem,
                                     radiation::GainKind::kAuto};  // in the order of carillon_radiation
  if (ours->radiation < 0 || ours->radiation >= static_cast<std::int32_t>(kKinds.size()))
    return refuse("carillon_model_make: options.radiation is none of carillon_radiation", message, message_size);
  return run(message, message_size, [&] {
    const radiation::GainKind kind = radiation::choose_gain_kind(bank->bank, kKinds[static_cast<std::size_t>(ours->radiation)]);
    std::vector<double> gains = radiation::calc_gains(bank->bank, kind);
    // What fixes the body takes of its modes what the bank says; a bank without losses is not copied.
    std::optional<bank::Bank> mounted;
    if (const support::Losses losses = support::calc_losses(bank->bank, {}); !losses.is_empty())
      support::apply(losses, mounted.emplace(bank->bank));
    const bank::Bank& played = mounted ? *mounted : bank->bank;
    if (kind == radiation::GainKind::kSphere) radiation::limit_gains(gains, played.decay_per_s);
    *model = new carillon_model{
        synth::Model::make(played, {.rate_hz = ours->rate_hz, .gains = gains, .sphere_radius_m = find_sphere_radius_m(played)})};
  });
}

void carillon_model_release(carillon_model* model) { delete model; }

int32_t carillon_model_mode_count(const carillon_model* model) { return model == nullptr ? 0 : model->model->get_mode_count(); }

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
  if (synth->synthesiser.is_full()) {
    write_message("there is no room for another body; raise max_bodies, or remove one", message, message_size);
    return CARILLON_FULL;
  }
  return run(message, message_size, [&] { *body = synth->synthesiser.add_body(model->model, {.position_m = to_vector(position_m)}); });
}

void carillon_body_options_init_sized(carillon_body_options* options, size_t size) { init(options, size); }

carillon_status carillon_add_body_with(carillon_synth* synth, const carillon_model* model, const carillon_body_options* options,
                                       int32_t* body, char* message, size_t message_size) {
  const auto ours = read(options);
  if (body != nullptr) *body = -1;
  if (synth == nullptr || model == nullptr || body == nullptr || !ours)
    return refuse("carillon_add_body_with: synth, model and body must not be NULL, options must be initialised", message, message_size);
  if (synth->synthesiser.is_full()) {
    write_message("there is no room for another body; raise max_bodies, or remove one", message, message_size);
    return CARILLON_FULL;
  }
  return run(message, message_size, [&] {
    *body = synth->synthesiser.add_body(model->model, {.position_m = to_vector(ours->position_m),
                                                       .rotation = to_quaternion(ours->rotation),
                                                       .effects = to_effects(ours->effects),
                                                       .silence_pa = ours->silence_pa,
                                                       .surface = {.roughness_m = ours->roughness_m, .friction = ours->friction},
                                                       .longest_m = ours->longest_m,
                                                       .max_waypoints = ours->max_waypoints});
  });
}

carillon_status carillon_set_effects(carillon_synth* synth, int32_t body, uint32_t effects, char* message, size_t message_size) {
  if (synth == nullptr) return refuse("carillon_set_effects: synth must not be NULL", message, message_size);
  return run(message, message_size, [&] { synth->synthesiser.set_effects(body, to_effects(effects)); });
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

void carillon_impulse_init_sized(carillon_impulse* impulse, size_t size) { init(impulse, size); }
void carillon_force_init_sized(carillon_force* force, size_t size) { init(force, size); }
void carillon_contact_init_sized(carillon_contact* contact, size_t size) { init(contact, size); }
void carillon_motion_init_sized(carillon_motion* motion, size_t size) { init(motion, size); }
void carillon_listener_init_sized(carillon_listener* listener, size_t size) { init(listener, size); }

carillon_status carillon_push_impulse(carillon_synth* synth, const carillon_impulse* impulse) {
  const auto ours = read(impulse);
  if (synth == nullptr || !ours) return CARILLON_BAD_ARGUMENT;
  return push(synth, to_event(*ours));
}

carillon_status carillon_push_force(carillon_synth* synth, const carillon_force* force) {
  const auto ours = read(force);
  if (synth == nullptr || !ours || ours->impulse_n_s == nullptr || ours->count < 1) return CARILLON_BAD_ARGUMENT;
  events::Force piece{.time_s = ours->time_s,
                      .step_s = ours->step_s,
                      .body = ours->body,
                      .other = ours->other,
                      .triangle = ours->triangle,
                      .continues = ours->continues != 0,
                      .barycentric = to_vector(ours->barycentric)};
  // Nothing of it is played unless all of it can be.
  for (int pass = 0; pass < 2; ++pass) {
    for (std::int32_t done = 0; done < ours->count; done += events::kMaxForceSteps) {
      std::array<carillon::Vec3, events::kMaxForceSteps> impulses{};
      const std::int32_t count = std::min(events::kMaxForceSteps, ours->count - done);
      for (std::int32_t k = 0; k < count; ++k) impulses[static_cast<std::size_t>(k)] = to_vector(ours->impulse_n_s[done + k]);
      events::Force first = piece;
      first.time_s += done * piece.step_s;
      first.continues = piece.continues || done > 0;
      carillon_status status = CARILLON_OK;
      events::split_force(first, std::span(impulses).first(static_cast<std::size_t>(count)), [&](const events::Force& part) {
        if (pass > 0 || events::find_fault(part) != nullptr) status = push(synth, part);
      });
      if (status != CARILLON_OK) return status;
    }
  }
  return CARILLON_OK;
}

carillon_status carillon_vary_impulse(const carillon_bank* bank, double variation, uint64_t seed, uint64_t strike,
                                      carillon_impulse* impulse) {
  auto ours = read(impulse);
  if (bank == nullptr || !ours) return CARILLON_BAD_ARGUMENT;
  return run(nullptr, 0, [&] {
    events::Impulse event = to_event(*ours);
    if (!(variation >= 0.0 && variation <= 1.0) || events::find_fault(event) != nullptr || event.triangle < 0 ||
        static_cast<std::size_t>(event.triangle) >= bank->bank.triangles.size())
      throw InputError("no strike that can be varied");
    if (variation == 0.0) return;
    synth::vary_strike(
        bank->bank, [&](const carillon::Vec3& point_m) { return bank->get_tree().find(point_m); }, variation, seed, strike, event);
    if (events::find_fault(event) != nullptr) throw InputError("the varied strike is too large for a number");
    ours->triangle = event.triangle;
    ours->duration_s = event.duration_s;
    std::copy(event.barycentric.begin(), event.barycentric.end(), ours->barycentric);
    std::copy(event.impulse_n_s.begin(), event.impulse_n_s.end(), ours->impulse_n_s);
    write(*ours, impulse);
  });
}

uint64_t carillon_name_seed(const char* name) { return name == nullptr ? 0 : base::hash_name(name); }

carillon_status carillon_push_contact(carillon_synth* synth, const carillon_contact* contact) {
  const auto ours = read(contact);
  if (synth == nullptr || !ours) return CARILLON_BAD_ARGUMENT;
  if (ours->state < CARILLON_CONTACT_BEGIN || ours->state > CARILLON_CONTACT_END) return CARILLON_BAD_INPUT;
  return push(synth, events::LastingContact{.time_s = ours->time_s,
                                            .id = ours->id,
                                            .body = ours->body,
                                            .other = ours->other,
                                            .triangle = ours->triangle,
                                            .state = static_cast<events::ContactState>(ours->state),
                                            .barycentric = to_vector(ours->barycentric),
                                            .normal = to_vector(ours->normal),
                                            .slip_m_s = to_vector(ours->slip_m_s),
                                            .force_n = ours->force_n,
                                            .sweep_m_s = ours->sweep_m_s,
                                            .other_sweep_m_s = ours->other_sweep_m_s,
                                            .spin_rad_s = ours->spin_rad_s,
                                            .patch_radius_m = ours->patch_radius_m,
                                            .impedance_n_s_m = ours->impedance_n_s_m});
}

carillon_status carillon_push_motion(carillon_synth* synth, const carillon_motion* motion) {
  const auto ours = read(motion);
  if (synth == nullptr || !ours) return CARILLON_BAD_ARGUMENT;
  return push(synth, events::BodyMotion{.time_s = ours->time_s,
                                        .body = ours->body,
                                        .position_m = to_vector(ours->position_m),
                                        .velocity_m_s = to_vector(ours->velocity_m_s),
                                        .rotation = to_quaternion(ours->rotation)});
}

carillon_status carillon_push_listener(carillon_synth* synth, const carillon_listener* listener) {
  const auto ours = read(listener);
  if (synth == nullptr || !ours) return CARILLON_BAD_ARGUMENT;
  return push(synth, events::Listener{
                         .time_s = ours->time_s, .position_m = to_vector(ours->position_m), .velocity_m_s = to_vector(ours->velocity_m_s)});
}

carillon_status carillon_push_mark(carillon_synth* synth, double time_s) {
  if (synth == nullptr) return CARILLON_BAD_ARGUMENT;
  return push(synth, events::TimeWatermark{time_s});
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
  const auto put = [](const synth::PerEffect<std::int64_t>& values, std::int64_t* first, std::int64_t* later) {
    std::copy_n(values.begin(), CARILLON_EFFECT_COUNT, first);
    std::copy_n(values.begin() + CARILLON_EFFECT_COUNT, CARILLON_LATER_EFFECT_COUNT, later);
  };
  put(ours.units, given.units, given.later_units);
  put(ours.bytes, given.bytes, given.later_bytes);
  given.head_units = ours.units[synth::Effect::kHead];
  given.head_bytes = ours.bytes[synth::Effect::kHead];
  given.nonlinear_units = ours.units[synth::Effect::kNonlinear];
  given.nonlinear_bytes = ours.bytes[synth::Effect::kNonlinear];
  given.cascade_units = ours.units[synth::Effect::kCascade];
  given.cascade_bytes = ours.bytes[synth::Effect::kCascade];
  write(given, counters);
  return CARILLON_OK;
}

double carillon_peak_pa(const carillon_synth* synth, int32_t body) { return synth == nullptr ? 0.0 : synth->synthesiser.get_peak_pa(body); }

double carillon_deflection(const carillon_synth* synth, int32_t body) {
  return synth == nullptr ? 0.0 : synth->synthesiser.get_deflection(body);
}

}  // extern "C"
