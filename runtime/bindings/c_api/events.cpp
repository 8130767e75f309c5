// Events of the C interface.
#include "runtime/events/events.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "runtime/base/chance.hpp"
#include "runtime/bindings/c_api/calls.hpp"
#include "runtime/bindings/c_api/structures.hpp"
#include "runtime/synth/variation.hpp"

namespace carillon::c_api {

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

namespace {

static_assert(CARILLON_BY_MATERIAL == events::LastingContact::kByMaterial);

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
    (void)synth->synthesiser.push(event);  // counted there
    return CARILLON_BAD_INPUT;
  }
  return synth->synthesiser.push(event) ? CARILLON_OK : CARILLON_FULL;
}

}  // namespace
}  // namespace carillon::c_api

using namespace carillon;
using namespace carillon::c_api;

extern "C" {

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
  // The first pass validates, so that a force is played completely or not at all.
  for (int pass = 0; pass < 2; ++pass) {
    for (std::int32_t done = 0; done < ours->count; done += events::kMaxForceSteps) {
      std::array<Vec3, events::kMaxForceSteps> impulses{};
      const std::int32_t count = std::min(events::kMaxForceSteps, ours->count - done);
      for (std::int32_t k = 0; k < count; ++k) impulses[k] = to_vector(ours->impulse_n_s[done + k]);
      events::Force first = piece;
      first.time_s += done * piece.step_s;
      first.continues = piece.continues || done > 0;
      carillon_status status = CARILLON_OK;
      events::split_force(first, std::span(impulses).first(count), [&](const events::Force& part) {
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
        event.triangle >= std::ssize(bank->bank.triangles))
      throw InputError("no strike that can be varied");
    if (variation == 0.0) return;
    synth::vary_strike(
        bank->bank, [&](const Vec3& point_m) { return bank->get_tree().find(point_m); }, variation, seed, strike, event);
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
                                        .rotation = to_quaternion(ours->rotation),
                                        .cut = ours->cut != 0});
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

}  // extern "C"
