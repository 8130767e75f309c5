// Banks and models of the C interface.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/bank/edits.hpp"
#include "runtime/bank/mounting/losses.hpp"
#include "runtime/bindings/c_api/calls.hpp"
#include "runtime/bindings/c_api/structures.hpp"

namespace carillon::c_api {

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

namespace {

/// Radius for acceleration noise; 0 for an open surface.
double find_sphere_radius_m(const bank::Bank& bank) {
  try {
    return radiation::calc_sphere_radius_m(bank);
  } catch (const InputError&) {
    return 0.0;
  }
}

bank::Frequencies to_frequencies(int32_t frequencies) {
  if (frequencies != CARILLON_FREQUENCIES_CORRECTED && frequencies != CARILLON_FREQUENCIES_MESH)
    throw InputError("frequencies " + std::to_string(frequencies) + " is no carillon_frequencies");
  return frequencies == CARILLON_FREQUENCIES_MESH ? bank::Frequencies::kMesh : bank::Frequencies::kCorrected;
}

}  // namespace
}  // namespace carillon::c_api

using namespace carillon;
using namespace carillon::c_api;

extern "C" {

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
  return mode < 0 || mode >= carillon_bank_mode_count(bank) ? 0.0 : bank->bank.freq_hz(mode);
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
    const radiation::GainKind kind = radiation::choose_gain_kind(bank->bank, kKinds[ours->radiation]);
    std::vector<double> gains = radiation::calc_gains(bank->bank, kind);
    // Support losses of the bank; a bank without losses is not copied.
    std::optional<bank::Bank> mounted;
    if (const mounting::Losses losses = mounting::calc_losses(bank->bank, {}); !losses.is_empty())
      mounting::apply(losses, mounted.emplace(bank->bank));
    const bank::Bank& played = mounted ? *mounted : bank->bank;
    if (kind == radiation::GainKind::kSphere) radiation::limit_gains(gains, played.decay_per_s);
    *model = new carillon_model{
        synth::Model::make(played, {.rate_hz = ours->rate_hz, .gains = gains, .sphere_radius_m = find_sphere_radius_m(played)})};
  });
}

void carillon_model_release(carillon_model* model) { delete model; }

int32_t carillon_model_mode_count(const carillon_model* model) { return model == nullptr ? 0 : model->model->get_mode_count(); }

}  // extern "C"
