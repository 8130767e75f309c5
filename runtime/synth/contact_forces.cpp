// Method:     at every border of sub-blocks the values of each contact are interpolated between its records; they give direction, gains and
//             damping. In between, the force is computed per sample and applied through the contact's rows at both borders, blended, so
//             that changes of place or direction cause no step.
// Source:     K. Johnson, Contact Mechanics (1985), 4.2: k = dF/d delta = 2 E* a. Rough surfaces: B. Persson, Phys. Rev. Lett. 99 (2007)
//             125502: load ~ exp(-separation / u0). Coulomb 1785. Rough sliding: the level grows with the logarithms of roughness and
//             speed, the sound is that of shocks between asperities, and the compliance is small against the roughness: H. Ben Abdelounis,
//             A. Le Bot, J. Perret-Liaudet and H. Zahouani, Wear 268 (2010) 335.
// Deviations: Persson's u0 is at least 0.4 h_rms for rigid bodies; here it is h_rms for rolling and a constant for sliding, which
//             reproduces that law. The load is taken as the weight: for bodies pressed by other forces the riding frequency is too low. The
//             modes of both bodies do not yield to the heights.
#include "runtime/synth/contact_forces.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "runtime/base/error.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/synth/smooth_step.hpp"

namespace carillon::synth {
namespace {

constexpr double kRiseS = 5e-3;
constexpr double kPatienceS = 20e-3;
constexpr double kLongestS = 50e-3;
constexpr double kAtRest = 0.2e-3, kMoving = 2e-3;  // m/s
constexpr double kGravity = 9.81;                   // m/s^2
constexpr double kSticking = 1e-3;                  // below, friction fades out
constexpr double kSkinM = 10e-6;                    // skin of rough sliding: decay length of the load
constexpr double kLargestExponent = 3.0;            // 19 loads; heights reach 13
constexpr double kStronger = 2.0;                   // a new contact replaces one with less than half its force

double calc_motion(double speed_m_s) noexcept { return calc_smooth_step((speed_m_s - kAtRest) / (kMoving - kAtRest)); }

/// Profile seed of one surface along the path of a contact: the same for every caller. `first` distinguishes two surfaces of the same seed.
std::uint64_t make_seed(std::uint64_t contact, std::uint64_t surface, bool first) noexcept {
  return contact * 0x9e3779b97f4a7c15U ^ (2U * surface + (first ? 1U : 2U)) * 0xc2b2ae3d27d4eb4fU;
}

double blend(double a, double b, double share) noexcept { return a + share * (b - a); }

bool is_amount(double x) noexcept { return std::isfinite(x) && x >= 0.0; }

/// E* of a pair; 0 if a modulus is 0.
double calc_pair_modulus(double own_pa, double other_pa) noexcept {
  return own_pa > 0.0 && other_pa > 0.0 ? 1.0 / (1.0 / own_pa + 1.0 / other_pa) : 0.0;
}

/// Loss factor by plane-strain modulus: low for metal and stone, ten times that for wood and plastics.
double calc_contact_loss(double modulus_pa) noexcept {
  constexpr double kHardPa = 50e9, kSoftPa = 10e9, kHard = 0.01, kSoft = 0.1;
  const double share = std::clamp(std::log(kHardPa / modulus_pa) / std::log(kHardPa / kSoftPa), 0.0, 1.0);
  return kHard * std::pow(kSoft / kHard, share);
}

/// Slip ratio.
double calc_sliding(double slip_m_s, double sweep_m_s, double other_sweep_m_s) noexcept {
  return slip_m_s <= 0.0 ? 0.0 : std::min(1.0, slip_m_s / std::max({sweep_m_s, other_sweep_m_s, slip_m_s}));
}

/// RMS of the effective heights.
double calc_moved(const ContactNoise& noise) noexcept {
  return std::hypot(noise.motion * noise.gains.rms_m, noise.other_motion * noise.other_gains.rms_m);
}

struct Press {
  double sweep_m_s, other_sweep_m_s, slip_m_s, force_n, patch_m, modulus_pa, rate_hz;
};

ContactNoise calc_noise(const Press& press, const Texture& texture, const Texture& other_texture) noexcept {
  ContactNoise noise;
  noise.sliding = calc_sliding(press.slip_m_s, press.sweep_m_s, press.other_sweep_m_s);
  // The asperities of each surface pass over the other one at the slip speed, whichever surface the contact point stays on.
  noise.speed_m_s = std::max(press.sweep_m_s, press.slip_m_s);
  noise.other_speed_m_s = std::max(press.other_sweep_m_s, press.slip_m_s);
  noise.motion = calc_motion(noise.speed_m_s);
  noise.other_motion = calc_motion(noise.other_speed_m_s);
  // Heights count only on swept surfaces, and fully before they become audible.
  const double own = calc_smooth_step(noise.speed_m_s / kAtRest), other = calc_smooth_step(noise.other_speed_m_s / kAtRest);
  const double stiffness = 2.0 * press.modulus_pa * press.patch_m;
  const double spring_m = stiffness > 0.0 ? press.force_n / stiffness : 0.0;
  const auto calc_give = [&](double own_m, double other_m) {
    return spring_m + blend(std::hypot(own * own_m, other * other_m), kSkinM, noise.sliding);
  };
  const double at_first_m = calc_give(texture.get_roughness_m(), other_texture.get_roughness_m());
  const double ride_rad_s = at_first_m > 0.0 ? std::sqrt(kGravity / at_first_m) : 0.0;
  // Rolling is blunted by the patch; sliding contacts are much smaller asperities.
  const double blunt_m = (1.0 - noise.sliding) * press.patch_m;
  noise.gains = texture.calc_gains(noise.speed_m_s, blunt_m, ride_rad_s, press.rate_hz);
  noise.other_gains = other_texture.calc_gains(noise.other_speed_m_s, blunt_m, ride_rad_s, press.rate_hz);
  noise.decay_length_m = stiffness > 0.0 ? calc_give(noise.gains.rms_m, noise.other_gains.rms_m) : 0.0;
  // For normal x, exp(s x - s^2 / 2) has mean 1 and rms sqrt(exp(s^2) - 1): that of the linear spring, up to one load.
  if (noise.decay_length_m > 0.0) noise.spread = 0.5 * std::log1p(std::pow(std::min(1.0, calc_moved(noise) / noise.decay_length_m), 2.0));
  return noise;
}

void scale(Texture::Gains& gains, double factor) noexcept {
  for (float& height : gains.height_m) height *= static_cast<float>(factor);
  gains.rms_m *= factor;
}

/// f = load (exp(h / over_m - spread) - 1).
struct Shocks {
  double load_n = 0.0, over_m = 0.0;
};

Shocks calc_shocks(const ContactNoise& noise, double force_n) noexcept {
  const double moved_m = calc_moved(noise);
  if (!(noise.spread > 0.0)) return {force_n, noise.decay_length_m};
  return {force_n * std::max(1.0, moved_m / noise.decay_length_m), moved_m / std::sqrt(2.0 * noise.spread)};
}

}  // namespace

ContactNoise calc_contact_noise(const events::LastingContact& contact, const ContactSurface& own, const ContactSurface& other,
                                double rate_hz) noexcept {
  Texture texture, other_texture;
  texture.start(own.roughness_m, 0);
  other_texture.start(other.roughness_m, 0);
  return calc_noise({.sweep_m_s = contact.sweep_m_s,
                     .other_sweep_m_s = contact.other_sweep_m_s,
                     .slip_m_s = norm(contact.slip_m_s),
                     .force_n = contact.force_n,
                     .patch_m = contact.patch_radius_m,
                     .modulus_pa = calc_pair_modulus(own.modulus_pa, other.modulus_pa),
                     .rate_hz = rate_hz},
                    texture, other_texture);
}

ContactSurface complete(ContactSurface surface, double modulus_pa, double wave_impedance_pa_s_m) noexcept {
  if (surface.modulus_pa == 0.0) surface.modulus_pa = modulus_pa;
  if (surface.wave_impedance_pa_s_m == 0.0) surface.wave_impedance_pa_s_m = wave_impedance_pa_s_m;
  return surface;
}

double find_impedance(const events::LastingContact& contact, const ContactSurface& other) noexcept {
  if (contact.impedance_n_s_m != events::LastingContact::kByMaterial) return contact.impedance_n_s_m;
  return other.wave_impedance_pa_s_m * std::numbers::pi * contact.patch_radius_m * contact.patch_radius_m;
}

ContactSpring calc_contact_spring(double patch_m, double own_pa, double other_pa) noexcept {
  const double modulus_pa = calc_pair_modulus(own_pa, other_pa);
  if (!(modulus_pa > 0.0) || !(patch_m > 0.0)) return {};
  return {2.0 * modulus_pa * patch_m, modulus_pa * (calc_contact_loss(own_pa) / own_pa + calc_contact_loss(other_pa) / other_pa)};
}

double calc_spring_loss(const ContactSpring& spring, double omega_rad_s, double shape_along) noexcept {
  const double stiffness = spring.stiffness_n_m * shape_along * shape_along;
  return stiffness > 0.0 ? 0.5 * spring.loss_factor * omega_rad_s * stiffness / (omega_rad_s * omega_rad_s + stiffness) : 0.0;
}

double calc_density(const ContactNoise& noise, double force_n, double freq_hz) noexcept {
  if (!(noise.decay_length_m > 0.0)) return 0.0;
  const double own_m2 = Texture::calc_density(noise.gains, noise.speed_m_s, freq_hz),
               other_m2 = Texture::calc_density(noise.other_gains, noise.other_speed_m_s, freq_hz);
  const double moved_m2 = noise.motion * noise.motion * own_m2 + noise.other_motion * noise.other_motion * other_m2;
  const Shocks shocks = calc_shocks(noise, force_n);
  const double stiffness = shocks.load_n / shocks.over_m;
  return std::exp(2.0 * noise.spread) * stiffness * stiffness * moved_m2;
}

const char* find_fault(const ContactSurface& surface) noexcept {
  if (!is_amount(surface.roughness_m)) return "the roughness is negative or not finite";
  if (!is_amount(surface.friction)) return "the friction is negative or not finite";
  if (!is_amount(surface.modulus_pa)) return "the modulus is negative or not finite";
  if (!is_amount(surface.wave_impedance_pa_s_m)) return "the wave impedance is negative or not finite";
  return nullptr;
}

ContactForces::ContactForces(std::shared_ptr<const Model> model, ContactForcesOptions options)
    : model_(std::move(model)), surface_(options.surface), effects_(options.effects) {
  if (model_ == nullptr) throw InputError("contacts need a model");
  if (const char* fault = find_fault(surface_); fault != nullptr) throw InputError(std::string("surface of a body: ") + fault);
  if (options.max_contacts < 1 || options.max_contacts > kMaxContacts)
    throw InputError("a body needs room for 1 to " + std::to_string(kMaxContacts) + " contacts");
  if (options.max_records < 2 || options.max_records > 1 << 20)
    throw InputError("a body needs room for 2 to 1,048,576 records of contacts");
  surface_ = complete(surface_, model_->get_plane_strain_modulus_pa(), model_->get_wave_impedance_pa_s_m());
  Texture::make_tables();
  rate_hz_ = model_->get_rate_hz();
  slots_.resize(options.max_contacts);
  records_.resize(options.max_records);
  for (std::size_t i = 0; i < records_.size(); ++i) records_[i].next = i + 1 < records_.size() ? static_cast<std::int32_t>(i + 1) : -1;
  free_ = 0;
  damped_force_.resize(model_->get_damped_modes().size() * (kSubBlock + 2));
  // Integrals of 1 - u and u times T_j(2 u - 1) over 0..1, times the length of a sample.
  const auto area = [](int j) { return j % 2 == 0 ? 1.0 / (1.0 - static_cast<double>(j) * j) : 0.0; };
  for (int j = 0; j < kMoments; ++j) {
    const double slope = 0.5 * (area(j + 1) + area(std::abs(j - 1)));
    ramp_[0][j] = 0.5 * (area(j) - slope) / rate_hz_;
    ramp_[1][j] = 0.5 * (area(j) + slope) / rate_hz_;
  }
  for (std::size_t end = 0; end < 2; ++end) {
    for (std::size_t j = 0; j < kTerms; ++j) drive_.ramp[end][j] = static_cast<float>(ramp_[end][j]);
  }
}

/// Slot of the contact, or a free one.
ContactForces::Slot* ContactForces::find_place(const events::LastingContact& contact) noexcept {
  Slot* empty = nullptr;
  Slot* weakest = nullptr;
  double min = 0.0;
  for (Slot& slot : slots_) {
    if (slot.used && slot.id == contact.id && !(slot.ended && contact.state == events::ContactState::kBegin)) return &slot;
    if (!slot.used) empty = &slot;
    if (!slot.used || slot.ended) continue;
    const double force = slot.tail >= 0 ? records_[slot.tail].force_n : slot.from.force_n;
    if (weakest == nullptr || force < min) {
      weakest = &slot;
      min = force;
    }
  }
  if (contact.state == events::ContactState::kEnd) return nullptr;  // end of a dropped contact
  if (empty == nullptr && weakest != nullptr && contact.force_n > kStronger * min) weakest->ended = true;
  return empty;
}

/// New record at the end of the slot's queue, or its last one if there is no space.
std::int32_t ContactForces::take_free(Slot& slot) noexcept {
  const std::int32_t taken = free_;
  if (taken < 0) {
    ++counters_.thinned;
    return slot.tail;
  }
  free_ = records_[taken].next;
  records_[taken].next = -1;
  if (slot.tail >= 0)
    records_[slot.tail].next = taken;
  else
    slot.head = taken;
  slot.tail = taken;
  return taken;
}

bool ContactForces::take(const events::LastingContact& contact, const ContactSurface& other) noexcept {
  if (events::find_fault(events::Event(contact)) != nullptr || contact.triangle >= std::ssize(model_->get_surface()->triangles) ||
      find_fault(other) != nullptr) {
    ++counters_.refused;
    return false;
  }
  Slot* slot = find_place(contact);
  if (slot == nullptr) {
    ++counters_.dropped;
    return false;
  }
  if (!slot->used) {
    *slot = Slot{};
    slot->id = contact.id;
    slot->friction = std::sqrt(surface_.friction * other.friction);
    slot->other_modulus_pa = other.modulus_pa;
    find_modulus(*slot);
    const bool first = surface_.seed != other.seed || contact.body < contact.other;
    slot->texture.start(surface_.roughness_m, make_seed(contact.id, surface_.seed, first));
    slot->other_texture.start(other.roughness_m, make_seed(contact.id, other.seed, surface_.seed != other.seed || !first));
    slot->used = true;
    ++live_;
  }
  const std::int32_t place = take_free(*slot);
  if (place < 0) {  // no space, and no waiting record of its own
    if (!slot->acts && slot->head < 0) free(*slot);
    ++counters_.dropped;
    return false;
  }
  Record& record = records_[place];
  record.time = contact.time_s * rate_hz_;
  record.force_n = contact.force_n;
  record.sweep_m_s = contact.sweep_m_s;
  record.other_sweep_m_s = contact.other_sweep_m_s;
  record.patch_m = contact.patch_radius_m;
  record.impedance = find_impedance(contact, other);
  record.normal = contact.normal;
  record.slip_m_s = contact.slip_m_s;
  record.barycentric = contact.barycentric;
  record.triangle = contact.triangle;
  record.ends = contact.state == events::ContactState::kEnd;
  ++counters_.accepted;
  return true;
}

void ContactForces::reach(double time_s) noexcept {
  if (std::isfinite(time_s)) reached_ = std::max(reached_, time_s * rate_hz_);
}

void ContactForces::find_modulus(Slot& slot) const noexcept {
  slot.modulus_pa = calc_pair_modulus(surface_.modulus_pa, slot.other_modulus_pa);
}

void ContactForces::find_rows(Node& node) const noexcept {
  const auto& triangle = model_->get_surface()->triangles[node.values.triangle];
  for (std::size_t i = 0; i < kStrikeRows; ++i) node.row[i] = model_->get_row(triangle[i / 3], static_cast<int>(i % 3));
}

void ContactForces::take_over(ContactForces& other) noexcept {
  slots_.swap(other.slots_);
  records_.swap(other.records_);
  std::swap(free_, other.free_);
  std::swap(live_, other.live_);
  reached_ = other.reached_;
  looked_ = other.looked_;
  counters_ = other.counters_;
  const auto fits = [this](const Record& record) { return record.triangle < std::ssize(model_->get_surface()->triangles); };
  for (Slot& slot : slots_) {
    if (!slot.used) continue;
    bool all = fits(slot.from) && (!slot.has_to || fits(slot.to)) && fits(slot.node.values);
    for (std::int32_t i = slot.head; i >= 0; i = records_[i].next) all = all && fits(records_[i]);
    if (!all) {
      free(slot);
      continue;
    }
    find_modulus(slot);
    if (slot.acts) find_rows(slot.node);
  }
}

bool ContactForces::is_resting() const noexcept {
  for (const Slot& slot : slots_) {
    if (slot.used && (!slot.acts || !slot.holds || slot.head >= 0 || slot.ended || slot.level < 1.0 || slot.node.noise.motion > 0.0 ||
                      slot.node.noise.other_motion > 0.0))
      return false;
  }
  return true;
}

void ContactForces::free(Slot& slot) noexcept {
  while (slot.head >= 0) {
    const std::int32_t next = records_[slot.head].next;
    records_[slot.head].next = free_;
    free_ = slot.head;
    slot.head = next;
  }
  slot = Slot{};
  --live_;
}

/// Values of a contact at a time [samples]. False before its begin.
bool ContactForces::find_values(Slot& slot, double time, Record& values) noexcept {
  const auto pop = [&] {
    const std::int32_t place = slot.head;
    Record record = records_[place];
    slot.head = record.next;
    if (slot.head < 0) slot.tail = -1;
    records_[place].next = free_;
    free_ = place;
    return record;
  };
  if (!slot.acts) {
    if (slot.head < 0 || records_[slot.head].time > time) return false;
    slot.from = pop();
    slot.acts = true;
  }
  while (true) {
    if (!slot.has_to && slot.head >= 0 && !slot.from.ends) {
      slot.to = pop();
      slot.has_to = true;
      // Held values continue from now.
      if (slot.holds) slot.from.time = std::max(slot.from.time, looked_);
      slot.to.time = std::max(slot.to.time, slot.from.time);
      slot.from.time = std::max(slot.from.time, slot.to.time - kLongestS * rate_hz_);
    }
    if (!slot.has_to || slot.to.time > time) break;
    slot.from = slot.to;
    slot.has_to = false;
  }
  slot.holds = !slot.has_to;
  if (slot.from.ends) slot.ended = true;
  values = slot.from;
  if (slot.has_to && time > slot.from.time) {
    const double share = (time - slot.from.time) / (slot.to.time - slot.from.time);
    const Record &a = slot.from, &b = slot.to;
    values.force_n = blend(a.force_n, b.force_n, share);
    values.sweep_m_s = blend(a.sweep_m_s, b.sweep_m_s, share);
    values.other_sweep_m_s = blend(a.other_sweep_m_s, b.other_sweep_m_s, share);
    values.patch_m = blend(a.patch_m, b.patch_m, share);
    values.impedance = blend(a.impedance, b.impedance, share);
    const bool same = a.triangle == b.triangle;
    for (std::size_t k = 0; k < 3; ++k) {
      values.normal[k] = blend(a.normal[k], b.normal[k], share);
      values.slip_m_s[k] = blend(a.slip_m_s[k], b.slip_m_s[k], share);
      values.barycentric[k] = same ? blend(a.barycentric[k], b.barycentric[k], share) : (share < 0.5 ? a : b).barycentric[k];
    }
    if (!same && share >= 0.5) values.triangle = b.triangle;
  }
  return true;
}

ContactForces::Node ContactForces::make_node(const Slot& slot, const Record& values) const noexcept {
  Node node;
  node.values = values;
  node.level = slot.level;
  const double slip = norm(values.slip_m_s), sliding = calc_sliding(slip, values.sweep_m_s, values.other_sweep_m_s);
  const double rough = effects_.has(Effect::kRoughness) ? sliding : 0.0;
  const double along = rough + (effects_.has(Effect::kRolling) ? 1.0 - sliding : 0.0);
  if (along > 0.0) {
    node.noise = calc_noise({.sweep_m_s = values.sweep_m_s,
                             .other_sweep_m_s = values.other_sweep_m_s,
                             .slip_m_s = slip,
                             .force_n = values.force_n,
                             .patch_m = values.patch_m,
                             .modulus_pa = slot.modulus_pa,
                             .rate_hz = rate_hz_},
                            slot.texture, slot.other_texture);
    const Shocks shocks = calc_shocks(node.noise, values.force_n);
    node.values.force_n = shocks.load_n;
    // Exponents are interpolated, so that none exceeds those of both nodes. No heights without a load.
    const double per_m = values.force_n > 0.0 && shocks.over_m > 0.0 ? 1.0 / shocks.over_m : 0.0;
    scale(node.noise.gains, node.noise.motion * per_m);
    scale(node.noise.other_gains, node.noise.other_motion * per_m);
    if (per_m == 0.0) node.noise.spread = 0.0;
  }
  const double drag = rough * slot.friction / (slip + kSticking);
  const double damping = effects_.has(Effect::kContactDamping) ? std::sqrt(0.5 * node.level * values.impedance / rate_hz_) : 0.0;
  if (damping > 0.0) {
    const ContactSpring spring = calc_contact_spring(values.patch_m, surface_.modulus_pa, slot.other_modulus_pa);
    // k phi_n^2 / omega^2 = k / (Z / (2 rate)) times the damping by Z, over the square of the mode's angle per sample.
    node.give = static_cast<float>(std::min(1e30, 2.0 * spring.stiffness_n_m / (values.impedance * rate_hz_)));
    node.half_loss = static_cast<float>(0.5 * spring.loss_factor);
  }
  find_rows(node);
  for (int corner = 0; corner < 3; ++corner) {
    for (int axis = 0; axis < 3; ++axis) {
      const std::size_t i = corner * 3 + axis, c = corner, k = axis;
      node.force[i] = static_cast<float>(values.barycentric[c] * (along * values.normal[k] - drag * values.slip_m_s[k]));
      node.damping[i] = static_cast<float>(values.barycentric[c] * damping * values.normal[k]);
    }
  }
  return node;
}

/// Adds the action of a contact between two nodes to the drive.
void ContactForces::add_push(Slot& slot, const Node& from, const Node& to) noexcept {
  std::array<ContactEnd, 2>& push = drive_.push[drive_.contacts];
  ++drive_.contacts;
  const std::array<const Node*, 2> nodes{&from, &to};
  for (std::size_t end = 0; end < 2; ++end) {
    std::copy(nodes[end]->row.begin(), nodes[end]->row.end(), push[end].row);
    std::copy(nodes[end]->force.begin(), nodes[end]->force.end(), push[end].force);
    std::copy(nodes[end]->damping.begin(), nodes[end]->damping.end(), push[end].damping);
    push[end].give = nodes[end]->give;
    push[end].half_loss = nodes[end]->half_loss;
    std::fill(std::begin(push[end].signal), std::end(push[end].signal), 0.0F);
  }
  bool damps = false;
  for (std::size_t i = 0; i < kStrikeRows; ++i) damps = damps || from.damping[i] != 0.0F || to.damping[i] != 0.0F;
  drive_.damps = drive_.damps || damps;
  push[0].forces = push[1].forces = false;
  const bool moves = from.noise.motion > 0.0 || to.noise.motion > 0.0,
             other_moves = from.noise.other_motion > 0.0 || to.noise.other_motion > 0.0;
  if (!(moves || other_moves) || !(from.values.force_n > 0.0 || to.values.force_n > 0.0)) return;
  std::array<float, kSubBlock + 1> height{}, other_height{};
  if (moves) slot.texture.render(from.noise.speed_m_s, to.noise.speed_m_s, rate_hz_, from.noise.gains, to.noise.gains, height);
  if (other_moves) {
    slot.other_texture.render(from.noise.other_speed_m_s, to.noise.other_speed_m_s, rate_hz_, from.noise.other_gains, to.noise.other_gains,
                              other_height);
  }
  counters_.samples += kSubBlock;
  double largest = 0.0;
  for (std::size_t n = 0; n <= kSubBlock; ++n) {
    const double share = static_cast<double>(n) / kSubBlock;
    const double load = blend(from.values.force_n, to.values.force_n, share), spread = blend(from.noise.spread, to.noise.spread, share);
    const double over_u = static_cast<double>(height[n]) + static_cast<double>(other_height[n]);
    const double force = blend(from.level, to.level, share) * load * std::expm1(std::min(over_u - spread, kLargestExponent));
    push[0].signal[n] = static_cast<float>(force * (1.0 - share));
    push[1].signal[n] = static_cast<float>(force * share);
    largest = std::max(largest, std::abs(force));
  }
  push[0].forces = push[1].forces = largest > 0.0;
  // Length of the direction with friction: sqrt(1 + mu^2).
  drive_.strength_n_s += static_cast<float>(largest * std::hypot(1.0, slot.friction) * kSubBlock / rate_hz_);
  drive_.forces = drive_.forces || push[0].forces;
}

const ContactBlock* ContactForces::begin_sub_block(std::int64_t sample) noexcept {
  if (live_ == 0) return nullptr;
  drive_.contacts = 0;
  drive_.forces = drive_.damps = false;
  drive_.strength_n_s = 0.0F;
  const double start = static_cast<double>(sample), end = start + kSubBlock, rise = kSubBlock / (kRiseS * rate_hz_);
  looked_ = start;
  for (Slot& slot : slots_) {
    if (!slot.used) continue;
    const bool is_new = !slot.acts;
    Record values;
    if (!find_values(slot, end, values)) {
      if (slot.ended) free(slot);
      continue;
    }
    const bool starves = slot.holds && !slot.ended && end > std::max(reached_, slot.from.time) + kPatienceS * rate_hz_;
    slot.level = std::clamp(slot.level + (slot.ended || starves ? -rise : rise), 0.0, 1.0);
    const Node to = make_node(slot, values);
    if (is_new) {
      slot.node = to;
      slot.node.level = 0.0;
      slot.node.damping = {};
    }
    add_push(slot, slot.node, to);
    slot.node = to;
    if (slot.level == 0.0 && (slot.ended || starves)) {
      counters_.underruns += starves ? 1 : 0;
      free(slot);
    }
  }
  if (drive_.forces) calc_damped_force();
  return drive_.forces || drive_.damps ? &drive_ : nullptr;
}

void ContactForces::calc_damped_force() noexcept {
  for (std::size_t i = 0; i < model_->get_damped_modes().size(); ++i) {
    float* force = &damped_force_[i * (kSubBlock + 2)];
    force[0] = force[kSubBlock];  // last sample of the previous sub-block
    std::fill(force + 1, force + kSubBlock + 2, 0.0F);
    const std::size_t column = model_->get_damped_column(i);
    for (int c = 0; c < drive_.contacts; ++c) {
      for (const ContactEnd& push : drive_.push[c]) {
        double amplitude = 0.0;
        for (int r = 0; r < kStrikeRows; ++r) amplitude += static_cast<double>(push.force[r]) * push.row[r][column];
        amplitude *= model_->get_damped_modes()[i].scale;
        for (int n = 0; n <= kSubBlock; ++n) force[n + 1] += static_cast<float>(amplitude) * push.signal[n];
      }
    }
  }
}

}  // namespace carillon::synth
