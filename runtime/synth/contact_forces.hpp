// What contacts that last do to one body: forces by the roughness of both surfaces, and the damping by the other body.
//
//   synth::ContactForces contacts(model, {.surface = {.roughness_m = 5e-6}});
//   voice.attach(&contacts);
//   contacts.take(record, ground);  // as many as come, ahead of the sound
//   voice.process(block);
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

/// What a surface is like to those who touch it.
struct ContactSurface {
  double roughness_m = 2e-6;           // rms height: fine machined metal, N7 of ISO 1302 (Ra 1.6 um)
  double friction = 0.4;               // Coulomb; a contact of two takes the geometric mean
  double modulus_pa = 0.0;             // E / (1 - nu^2); 0: that of the model's bank
  double wave_impedance_pa_s_m = 0.0;  // bank::calc_wave_impedance; 0: that of the model's bank
  std::uint64_t seed = 0;  // of its profile, together with the id of a contact: bodies of different seeds have different profiles
};

/// What is wrong with a surface, as part of a sentence; nullptr: nothing.
const char* find_fault(const ContactSurface& surface) noexcept;

/// The surface with these constants of its material in place of zeros.
ContactSurface complete(ContactSurface surface, double modulus_pa, double wave_impedance_pa_s_m) noexcept;

/// The ground of scenes: concrete, smoothly trowelled.
inline constexpr ContactSurface kGroundSurface{
    .roughness_m = 20e-6, .friction = 0.5, .modulus_pa = 30e9 / (1.0 - 0.2 * 0.2), .wave_impedance_pa_s_m = 8.944e6};  // 2,400 kg/m^3

/// The noise of a lasting contact at one moment: f = a F (exp(s h / h_rms - s^2 / 2) - 1), a = max(1, R), of the heights h.
struct ContactNoise {
  double sliding = 0.0;                           // 0..1: share of the movement that is slip
  double speed_m_s = 0.0, other_speed_m_s = 0.0;  // with which each surface passes
  double motion = 0.0, other_motion = 0.0;        // 0..1: whether it does
  double decay_length_m = 0.0;                    // u; 0: no force
  double spread = 0.0;                            // s^2 / 2
  Texture::Gains gains, other_gains;
};

/// As ContactForces has it for a record that acts on a body of the surface `own`; both with their moduli. No throw; any thread.
ContactNoise calc_contact_noise(const events::LastingContact& contact, const ContactSurface& own, const ContactSurface& other,
                                double rate_hz) noexcept;

/// Impedance [N s/m] of the other body at a contact: the record's, else its material's over the patch.
double find_impedance(const events::LastingContact& contact, const ContactSurface& other) noexcept;

/// The spring of a contact as a mode meets it, however little it moves.
struct ContactSpring {
  double stiffness_n_m = 0.0;  // 2 E* a
  double loss_factor = 0.0;    // of both bodies there, each by its part of the give
};

/// Of a patch of that radius between surfaces of these plane-strain moduli; of stiffness 0 where one of them has none.
ContactSpring calc_contact_spring(double patch_m, double own_pa, double other_pa) noexcept;

/// What the spring takes of a mode [1/s]: eta omega / 2 times the spring's share of the energy, k phi_n^2 / (omega^2 + k phi_n^2).
double calc_spring_loss(const ContactSpring& spring, double omega_rad_s, double shape_along) noexcept;

/// One-sided density [N^2 / Hz] of the noise under the load at a frequency, at least as large as it is: of heights whose density falls with
/// a power of the frequency, as these do, the exponential's is e^(s^2) times that of the linear spring.
double calc_density(const ContactNoise& noise, double force_n, double freq_hz) noexcept;

struct ContactForcesOptions {
  ContactSurface surface{};
  EffectSet effects = kContactEffects;  // others are not looked at
  int max_contacts = 8;                 // that act at once, 1 to kMaxContacts
  int max_records = 512;                // that wait for their time
};

struct ContactCounters {
  std::int64_t accepted = 0;   // records taken
  std::int64_t refused = 0;    // records that cannot be played (events::find_fault, or no such triangle)
  std::int64_t dropped = 0;    // records of contacts for which there was no place, being weaker than those there
  std::int64_t thinned = 0;    // records that took the place of the one before, for lack of room
  std::int64_t underruns = 0;  // contacts that ended because nothing more came
  std::int64_t samples = 0;    // of force worked out, contact by contact
};

/// The lasting contacts of one body. Between two records of a contact its values change linearly; they are looked at every kSubBlock
/// samples and go linearly between. A gap of more than 50 ms is held and changed in its last 50 ms. A contact rises and falls within 5 ms
/// on top of what its records say. When its last record, and the last mark (reach), are 20 ms old it falls as if it had ended: an underrun.
///
/// Force: the heights h of both surfaces press two springs in series, the contact's, k = 2 E* a, and the rough skin's. Each surface is read
/// at the larger of the speed of the contact over it and the slip. With u = F / k + skin the force has the rms of the linear
/// spring, R = h_rms / u loads: f = a F (exp(s h / h_rms - s^2 / 2) - 1), s^2 = ln(1 + min(1, R)^2), a = max(1, R), without the slowly
/// changing load F. Up to R = 1 it never pulls. Without a load there are no heights, and the exponent is at most 3.
///
/// The skin is h_rms for rolling (blunted by the patch) and 10 um for sliding. No force comes from heights below sqrt(g / u), the bouncing
/// frequency of a body on u under its weight: the body rides over them. Sliding adds friction, -mu f along the slip, by its share of the
/// larger sweep. Below 0.2 mm/s a contact is at rest and gives no force.
///
/// Damping: the impedance Z of the other body adds Z (phi.n)^2 / 2 [1/s] to the decay of each mode, and the contact's spring its own loss:
/// calc_spring_loss() (docs/decisions/contact-sound.md).
///
/// Memory is taken in the constructor only. One thread at a time.
class ContactForces {
 public:
  /// Throws InputError for options out of range. [main-thread]
  explicit ContactForces(std::shared_ptr<const Model> model, ContactForcesOptions options = {});

  /// A record, with what the other body's surface is like. Times are since the first sample of the voice; `body` is not looked at beyond
  /// which of two surfaces of the same seed comes first. False when it is not played (counted). [audio-thread]: no heap, no lock, no throw.
  bool take(const events::LastingContact& contact, const ContactSurface& other = kGroundSurface) noexcept;

  /// Nothing earlier than this will come: contacts without newer records stay as they are until then. [audio-thread]
  void reach(double time_s) noexcept;

  /// Takes the place of another one of the same options, of a voice that is taken over likewise; that one is not used afterwards. Contacts
  /// on triangles that the model has not are cut off. [audio-thread]
  void take_over(ContactForces& other) noexcept;

  /// Whether nothing acts and nothing waits.
  bool is_idle() const noexcept { return live_ == 0; }

  /// Whether all that acts is at rest and nothing waits: a body without energy hears nothing of it, and may leave out begin_sub_block().
  bool is_resting() const noexcept;

  /// What acts from this sample on for a sub-block; nullptr: nothing. Called once a sub-block, in order. [audio-thread]
  const ContactBlock* begin_sub_block(std::int64_t sample) noexcept;

  /// Sum over the mode and the contacts of phi . f [N kg^-1/2] for mode `i` of those that do not ring, at the sample before the sub-block
  /// and its kSubBlock + 1 samples. After begin_sub_block() gave a drive with forces.
  const float* get_damped_force(std::size_t i) const noexcept { return &damped_force_[i * (kSubBlock + 2)]; }

  /// Moments of 1 - u and of u over a sample against the Chebyshev polynomials, times its length [s].
  const std::array<Moments, 2>& get_ramp() const noexcept { return ramp_; }

  const ContactCounters& get_counters() const noexcept { return counters_; }

 private:
  /// A record as it waits; times in samples.
  struct Record {
    double time = 0.0;
    double force_n = 0.0, sweep_m_s = 0.0, other_sweep_m_s = 0.0, patch_m = 1.0, impedance = 0.0;
    Vec3 normal{}, slip_m_s{}, barycentric{};
    std::int32_t triangle = 0;
    bool ends = false;
    std::int32_t next = -1;
  };
  /// A contact at the border of two sub-blocks.
  struct Node {
    Record values;
    double level = 0.0;  // 0..1: its rise and its fall
    ContactNoise noise;  // its gains times motion over u: the heights in the exponent
    std::array<float, kStrikeRows> force{}, damping{};
    float give = 0.0F, half_loss = 0.0F;  // as ContactEnd has them
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
  double looked_ = 0.0;      // the last border of sub-blocks that was looked at
  int live_ = 0;             // slots in use
  std::vector<Slot> slots_;
  std::vector<Record> records_;
  std::int32_t free_ = -1;  // first record without use
  std::vector<float> damped_force_;
  std::array<Moments, 2> ramp_{};
  ContactBlock drive_{};
  ContactCounters counters_;
};

}  // namespace carillon::synth
