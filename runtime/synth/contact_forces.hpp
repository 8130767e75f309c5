// Lasting contacts of one body: forces by the roughness of both surfaces, and damping by the other body.
//
//   synth::ContactForces contacts(model, {.surface = {.roughness_m = 5e-6}});
//   modes.attach(&contacts);
//   contacts.take(record, ground);  // any number, ahead of the sound
//   modes.process(block);
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "runtime/events/events.hpp"
#include "runtime/synth/effects.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/model.hpp"
#include "runtime/synth/texture.hpp"

namespace carillon::synth {

/// Surface of a body in contacts.
struct ContactSurface {
  double roughness_m = 2e-6;           // rms height: fine machined metal, N7 of ISO 1302 (Ra 1.6 um)
  double friction = 0.4;               // Coulomb; pairs use the geometric mean
  double modulus_pa = 0.0;             // E / (1 - nu^2); 0: from the model's bank
  double wave_impedance_pa_s_m = 0.0;  // bank::calc_wave_impedance; 0: from the model's bank
  std::uint64_t seed = 0;              // profile seed, combined with the contact id
};

/// Fault of a surface as part of a sentence; nullptr: none.
const char* find_fault(const ContactSurface& surface) noexcept;

/// Replaces zero material constants.
ContactSurface complete(ContactSurface surface, double modulus_pa, double wave_impedance_pa_s_m) noexcept;

/// Ground of scenes: smooth trowelled concrete.
inline constexpr ContactSurface kGroundSurface{
    .roughness_m = 20e-6, .friction = 0.5, .modulus_pa = 30e9 / (1.0 - 0.2 * 0.2), .wave_impedance_pa_s_m = 8.944e6};  // 2,400 kg/m^3

/// Noise of a lasting contact at one time: f = a F (exp(s h / h_rms - s^2 / 2) - 1), a = max(1, R), h: heights.
struct ContactNoise {
  double sliding = 0.0;                           // slip ratio, 0..1
  double speed_m_s = 0.0, other_speed_m_s = 0.0;  // sweep speed of each surface
  double motion = 0.0, other_motion = 0.0;        // 0..1: fade-in of each surface by its speed
  double decay_length_m = 0.0;                    // u; 0: no force
  double spread = 0.0;                            // s^2 / 2
  Texture::Gains gains, other_gains;
};

/// Noise of a record that acts on a body of surface `own`, as ContactForces computes it; both surfaces with moduli. No throw; any thread.
ContactNoise calc_contact_noise(const events::LastingContact& contact, const ContactSurface& own, const ContactSurface& other,
                                double rate_hz) noexcept;

/// Impedance [N s/m] of the other body at a contact: of the record, or of its material over the patch.
double find_impedance(const events::LastingContact& contact, const ContactSurface& other) noexcept;

/// Linearised contact spring.
struct ContactSpring {
  double stiffness_n_m = 0.0;  // 2 E* a
  double loss_factor = 0.0;    // of both bodies, weighted by compliance
};

/// Spring of a patch between surfaces of these plane-strain moduli; stiffness 0 if a modulus is 0.
ContactSpring calc_contact_spring(double patch_m, double own_pa, double other_pa) noexcept;

/// Decay added to a mode by the spring [1/s]: eta omega / 2 times the spring's share of the energy, k phi_n^2 / (omega^2 + k phi_n^2).
double calc_spring_loss(const ContactSpring& spring, double omega_rad_s, double shape_along) noexcept;

/// Upper bound of the one-sided density [N^2 / Hz] of the noise under the load: for heights with a power-law density, as here, that of the
/// exponential is e^(s^2) times that of the linear spring.
double calc_density(const ContactNoise& noise, double force_n, double freq_hz) noexcept;

struct ContactForcesOptions {
  ContactSurface surface{};
  EffectSet effects = kContactEffects;  // other effects are ignored
  int max_contacts = 8;                 // active at once, 1 to kMaxContacts
  int max_records = 512;                // waiting records
};

struct ContactCounters {
  std::int64_t accepted = 0;   // accepted records
  std::int64_t refused = 0;    // unplayable records (events::find_fault, missing triangle)
  std::int64_t dropped = 0;    // records of contacts without a slot, weaker than the active ones
  std::int64_t thinned = 0;    // records that replaced the previous one for lack of space
  std::int64_t underruns = 0;  // contacts that ended for lack of records
  std::int64_t samples = 0;    // samples of computed force, per contact
};

/// Lasting contacts of one body. Values between records are linear; they are evaluated every kSubBlock samples and are linear in between. A
/// gap of more than 50 ms is held and changed in its last 50 ms. Contacts fade in and out within 5 ms, in addition to their records. A
/// contact whose last record and last mark (reach) are 20 ms old fades out: an underrun.
///
/// Force: the heights h of both surfaces compress two springs in series: the contact, k = 2 E* a, and the rough skin. Each surface is read
/// at the larger of its sweep and the slip. With u = F / k + skin the force has the rms of the linear spring, R = h_rms / u loads: f = a F
/// (exp(s h / h_rms - s^2 / 2) - 1), s^2 = ln(1 + min(1, R)^2), a = max(1, R), without the slowly changing load F. Up to R = 1 it never
/// pulls. No heights without a load; the exponent is at most 3.
///
/// The skin is h_rms for rolling (blunted by the patch) and 10 um for sliding. Heights below sqrt(g / u), the bouncing frequency of a body
/// on u under its weight, give no force: the body rides over them. Sliding adds friction, -mu f along the slip, by the slip ratio. Below
/// 0.2 mm/s a contact is at rest and gives no force.
///
/// Damping: the impedance Z of the other body adds Z (phi.n)^2 / 2 [1/s] to the decay of each mode, and the contact's spring its own loss:
/// calc_spring_loss() (docs/decisions/contact-sound.md).
///
/// Allocates in the constructor only. One thread at a time.
class ContactForces {
 public:
  /// Throws InputError for options out of range. [main-thread]
  explicit ContactForces(std::shared_ptr<const Model> model, ContactForcesOptions options = {});

  /// Queues a record; `other`: surface of the other body. Times since the first sample of the modes; `body` only orders two surfaces of the
  /// same seed. False if not played (counted). [audio-thread]: no heap, no lock, no throw.
  bool take(const events::LastingContact& contact, const ContactSurface& other = kGroundSurface) noexcept;

  /// No earlier record will follow: contacts without newer records hold until then. [audio-thread]
  void reach(double time_s) noexcept;

  /// Takes over the contacts of an object of the same options, whose modes are taken over likewise; that object is then unused. Contacts on
  /// triangles missing in this model end. [audio-thread]
  void take_over(ContactForces& other) noexcept;

  /// True without active or waiting contacts.
  bool is_idle() const noexcept { return live_ == 0; }

  /// True if all contacts are at rest and none waits: a body without energy may skip begin_sub_block().
  bool is_resting() const noexcept;

  /// Contacts from this sample on for one sub-block; nullptr: none. Call once per sub-block, in order. [audio-thread]
  const ContactBlock* begin_sub_block(std::int64_t sample) noexcept;

  /// Sum over contacts of phi . f [N kg^-1/2] for damped mode `i`, at the sample before the sub-block and its kSubBlock + 1 samples. After
  /// a begin_sub_block() with forces.
  const float* get_damped_force(std::size_t i) const noexcept { return &damped_force_[i * (kSubBlock + 2)]; }

  /// Moments of 1 - u and u over a sample against the Chebyshev polynomials, times its length [s].
  const std::array<Moments, 2>& get_ramp() const noexcept { return ramp_; }

  const ContactCounters& get_counters() const noexcept { return counters_; }

 private:
  /// Waiting record; times in samples.
  struct Record {
    double time = 0.0;
    double force_n = 0.0, sweep_m_s = 0.0, other_sweep_m_s = 0.0, patch_m = 1.0, impedance = 0.0;
    Vec3 normal{}, slip_m_s{}, barycentric{};
    std::int32_t triangle = 0;
    bool ends = false;
    std::int32_t next = -1;
  };
  /// Contact at a border of sub-blocks.
  struct Node {
    Record values;
    double level = 0.0;  // 0..1: fade
    ContactNoise noise;  // gains times motion over u: heights in the exponent
    std::array<float, kStrikeRows> force{}, damping{};
    float give = 0.0F, half_loss = 0.0F;  // as in ContactEnd
    std::array<const std::int16_t*, kStrikeRows> row{};
  };
  struct Slot {
    std::uint64_t id = 0;
    bool used = false, acts = false, ended = false, holds = false;
    std::int32_t head = -1, tail = -1;  // records that wait
    Record from;
    Record to;
    bool has_to = false;
    double level = 0.0;
    double friction = 0.0, modulus_pa = 0.0, other_modulus_pa = 0.0;
    Texture texture, other_texture;
    Node node;  // at the start of the next sub-block
  };

  Slot* find_place(const events::LastingContact& contact) noexcept;
  std::int32_t take_free(Slot& slot) noexcept;
  void free(Slot& slot) noexcept;
  void find_modulus(Slot& slot) const noexcept;
  void find_rows(Node& node) const noexcept;
  bool find_values(Slot& slot, double time, Record& values) noexcept;
  Node make_node(const Slot& slot, const Record& values) const noexcept;
  void add_push(Slot& slot, const Node& from, const Node& to) noexcept;
  void calc_damped_force() noexcept;

  std::shared_ptr<const Model> model_;
  ContactSurface surface_;
  EffectSet effects_;
  double rate_hz_ = 0.0;
  double reached_ = -1e300;  // sample
  double looked_ = 0.0;      // last evaluated border of sub-blocks
  int live_ = 0;             // used slots
  std::vector<Slot> slots_;
  std::vector<Record> records_;
  std::int32_t free_ = -1;  // first free record
  std::vector<float> damped_force_;
  std::array<Moments, 2> ramp_{};
  ContactBlock drive_{};
  ContactCounters counters_;
};

}  // namespace carillon::synth
