// Method: load-bearing points are grouped into spots, as in impacts; a spot loaded for kMinQuietS without an impact is a lasting contact,
// with one record every kIntervalS. The position of a spot moves with the body that owns the loaded point, and jumps when another point
// takes over; smoothed, this is the velocity of the contact in the world, and its difference from the velocity of a surface is its sweep
// over that surface. A flat contact has no Hertz radius; half the size of the smaller body is used, as for the duration of impacts.
// Source: K. Johnson, "Contact Mechanics" (1985), 4.2, for the contact radius; the impedance of a plane wave, rho c_L, over its area.
#include "runtime/physics/lasting.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/bank/bank.hpp"
#include "runtime/base/chance.hpp"
#include "runtime/physics/impact/spring.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::physics {
namespace {

constexpr double kTimeToleranceS = 1e-8;     // s; shorter than any step, longer than the permitted remainder of a step
constexpr double kMinQuietS = 5e-3;          // s
constexpr double kFadeInS = 5e-3;            // s; fade-in of the force of a new contact, whose impact has already been rendered
constexpr double kIntervalS = 1e-3;          // s
constexpr double kUnloadedEndS = 5e-3;       // s; a spot unloaded for this time has ended
constexpr double kSmoothingS = 20e-3;        // s
constexpr double kMinPatchM = 1e-6;          // m; minimum patch radius
constexpr double kMinRollingSpinRadS = 1.0;  // rad/s; below, the position of a swaying contact is fixed
constexpr double kMinSlipSpeedMS = 1e-6;     // m/s; below, the contact does not slip

std::uint64_t scramble(std::uint64_t state) { return base::draw(state); }

}  // namespace

double calc_spot_radius(const rigid::Space& space, int a, int b) {
  const double size = space.solid(a).shape->get_size_m();
  return 0.1 * (b >= 0 ? std::min(size, space.solid(b).shape->get_size_m()) : size);
}

Spotted find_place(const rigid::Solid& solid, const rigid::State& state, const Vec3& where, const Vec3& outward, std::int32_t hint) {
  const Mat3 back = transpose(rigid::make_rotation(state.rotation));
  const geometry::Place place = solid.shape->find_place(solid.centre_m + back * (where - state.centre), back * outward, hint);
  return {place.triangle, place.barycentric};
}

/// Fills groups_ with the currently loaded points, pair by pair.
void LastingContacts::make_groups(const rigid::Space& space) {
  groups_.clear();
  carriers_.clear();
  space.list_contacts(contacts_);
  for (const rigid::Contact* c : contacts_) {
    // Groups have steps of different lengths: each counts when its step ends.
    if (!(c->step_s > 0.0) || !c->touching || std::abs(c->until_s - space.get_time()) > kTimeToleranceS) continue;
    const double push = dot(c->impulse, c->touch.normal) / c->step_s;
    if (push > 0.0) carriers_.push_back({c, push, false});
  }
  const auto is_of_other_pair = [](const Carrier& x, const Carrier& y) {
    return x.contact->a != y.contact->a || x.contact->b != y.contact->b;
  };
  for (auto begin = carriers_.begin(); begin != carriers_.end();) {
    const auto end = std::find_if(begin, carriers_.end(), [&](const Carrier& c) { return is_of_other_pair(c, *begin); });
    std::stable_sort(begin, end, [](const Carrier& x, const Carrier& y) { return x.push_n > y.push_n; });
    for (auto seed = begin; seed != end; ++seed)
      if (!seed->is_taken) groups_.push_back(make_group(space, {seed, end}));
    begin = end;
  }
}

/// Group of the first carrier and those near it that belong to no group yet.
LastingContacts::Group LastingContacts::make_group(const rigid::Space& space, std::span<Carrier> carriers) {
  const rigid::Contact& first = *carriers.front().contact;
  Group g;
  g.a = first.a;
  g.b = first.b;
  const double near = calc_spot_radius(space, g.a, g.b);
  for (Carrier& carrier : carriers) {
    const rigid::Contact& c = *carrier.contact;
    if (carrier.is_taken || norm(c.touch.where_m - first.touch.where_m) > near) continue;
    carrier.is_taken = true;
    g.push_n += carrier.push_n;
    g.where = g.where + carrier.push_n * c.touch.where_m;
    g.normal = g.normal + carrier.push_n * c.touch.normal;
    g.carried = g.carried + carrier.push_n * space.calc_velocity(c.touch.side_a == geometry::Side::plane ? g.b : g.a, c.touch.where_m);
    g.curvature_per_m += carrier.push_n * (c.touch.curvature_a_per_m + c.touch.curvature_b_per_m);
    g.smooth = g.smooth || c.touch.smooth;
    g.features += scramble(c.touch.id);  // independent of the order
  }
  g.where = (1.0 / g.push_n) * g.where;
  g.carried = (1.0 / g.push_n) * g.carried;
  g.curvature_per_m /= g.push_n;
  g.normal = (1.0 / norm(g.normal)) * g.normal;
  const Vec3 turn = space.get_spin(g.a) - (g.b >= 0 ? space.get_spin(g.b) : Vec3{});
  g.turn = turn - dot(turn, g.normal) * g.normal;
  return g;
}

double LastingContacts::calc_patch(const Group& g, double radius_m) const {
  const Matter &a = get_matter(g.a), &b = get_matter(g.b);
  const double compliance = impact::calc_contact_compliance(a.young_modulus_pa, a.poisson_ratio, b.young_modulus_pa, b.poisson_ratio);
  return std::max(kMinPatchM, impact::calc_patch_radius(g.push_n, radius_m, compliance));
}

/// Impedance of a plane wave into the body over the patch.
double LastingContacts::calc_impedance(int body, double patch_m) const {
  const Matter& m = get_matter(body);
  const bank::Material material{.young_modulus_pa = m.young_modulus_pa, .poisson_ratio = m.poisson_ratio, .density_kg_m3 = m.density_kg_m3};
  return bank::calc_wave_impedance(material) * std::numbers::pi * patch_m * patch_m;
}

/// A contact at rest has no records. Repeats its last values, so that nothing is interpolated over the time at rest.
void LastingContacts::stir(const rigid::Space& space, Spot& spot, std::vector<events::Event>& events) {
  if (!spot.lies) return;
  spot.lies = false;
  if (spot.begun_s < 0.0) return;
  spot.rises_s = space.get_window_start();
  spot.from_n = spot.last[0].force_n;
  for (events::LastingContact& c : spot.last) {
    if (c.body < 0) continue;
    c.time_s = spot.rises_s;
    events.push_back(c);
  }
}

void LastingContacts::record(const rigid::Space& space, const Group& g, Spot& spot, std::vector<events::Event>& events) {
  const double time_s = space.get_time();
  const bool is_new = spot.begun_s < 0.0;
  stir(space, spot, events);
  if (is_new) {
    spot.begun_s = spot.rises_s = time_s;
    const double max_m = std::max(5.0 * calc_spot_radius(space, g.a, g.b), rigid::kMinContactRadiusM);
    spot.radius_m = 1.0 / std::clamp(g.curvature_per_m, 1.0 / max_m, 1.0 / rigid::kMinContactRadiusM);
  }
  spot.recorded_s = time_s;
  const Vec3 va = space.calc_velocity(g.a, g.where), vb = space.calc_velocity(g.b, g.where), u = va - vb;
  Vec3 slip = u - dot(u, g.normal) * g.normal;
  if (norm(slip) < kMinSlipSpeedMS) slip = {};
  const auto calc_sweep = [&](const Vec3& surface) {
    const Vec3 w = g.carried + spot.drift - surface;
    return norm(w - dot(w, g.normal) * g.normal);
  };
  const double sweep_a = calc_sweep(va), sweep_b = calc_sweep(vb), patch = calc_patch(g, spot.radius_m);
  for (const int side : {0, 1}) {
    const int body = side == 0 ? g.a : g.b, other = side == 0 ? g.b : g.a;
    if (body < 0) continue;
    const double sign = side == 0 ? 1.0 : -1.0;
    const rigid::State& state = space.state(body);
    const Mat3 back = transpose(rigid::make_rotation(state.rotation));
    const Spotted place = find_place(space.solid(body), state, g.where, (-sign) * g.normal, is_new ? -1 : spot.last[side].triangle);
    events::LastingContact c;
    c.time_s = time_s;
    c.id = spot.id;
    c.body = body;
    c.other = other;
    c.triangle = place.triangle;
    c.state = is_new ? events::ContactState::kBegin : events::ContactState::kHold;
    c.barycentric = place.barycentric;
    c.normal = back * (sign * g.normal);
    c.slip_m_s = back * (sign * slip);
    c.force_n = spot.from_n + (spot.load_n - spot.from_n) * std::min(1.0, (time_s - spot.rises_s) / kFadeInS);
    c.sweep_m_s = side == 0 ? sweep_a : sweep_b;
    c.other_sweep_m_s = side == 0 ? sweep_b : sweep_a;
    c.spin_rad_s = norm(g.turn);
    c.patch_radius_m = patch;
    c.impedance_n_s_m = calc_impedance(other, patch);
    spot.last[side] = c;
    events.push_back(c);
  }
}

/// 0 for the ground.
std::uint64_t LastingContacts::hash_name(int body) const { return body < 0 ? 0 : base::hash_name(get_matter(body).name); }

/// From the names of the pair and the number of the touch within it: independent of other bodies of the scene and of their order.
std::uint64_t LastingContacts::make_id(const Spot& spot) {
  std::uint64_t& touch = touches_[{spot.a, spot.b}];
  std::uint64_t id = scramble(scramble(hash_name(spot.a)) + scramble(hash_name(spot.b)) + touch) >> 1;  // files hold signed numbers
  ++touch;
  // Bodies may share a name.
  const auto is_taken = [&](const auto& of_pair) {
    return std::any_of(of_pair.second.begin(), of_pair.second.end(),
                       [&](const Spot& other) { return other.begun_s >= 0.0 && other.id == id; });
  };
  while (std::any_of(spots_.begin(), spots_.end(), is_taken)) id = scramble(id) >> 1;
  return id;
}

void LastingContacts::update(const rigid::Space& space, std::vector<events::Event>& events) {
  const double time_s = space.get_time();
  make_groups(space);
  for (const Group& g : groups_) {
    Spot* nearest = nullptr;
    double min = 2.0 * calc_spot_radius(space, g.a, g.b);
    std::vector<Spot>& spots = spots_[{g.a, g.b}];
    for (Spot& spot : spots) {
      if (spot.seen_s >= time_s) continue;
      const double distance = norm(spot.where - g.where);
      if (distance >= min) continue;
      nearest = &spot;
      min = distance;
    }
    if (nearest == nullptr) {
      Spot spot;
      spot.a = g.a;
      spot.b = g.b;
      spot.last[0].body = g.a;
      spot.last[1].body = g.b;
      spot.where = g.where;
      spot.features = g.features;
      spot.load_n = g.push_n;
      spot.quiet_s = spot.seen_s = time_s;
      spots.push_back(spot);
      continue;
    }
    Spot& spot = *nearest;
    const double dt = time_s - spot.seen_s;
    // While a body rolls the load shifts from point to point, before points appear or disappear.
    const bool stays = !g.smooth && spot.features == g.features && norm(g.turn) < kMinRollingSpinRadS;
    const Vec3 velocity = stays ? g.carried : (1.0 / dt) * (g.where - spot.where);
    spot.drift = spot.drift + (dt / (dt + kSmoothingS)) * (velocity - g.carried - spot.drift);
    spot.load_n += dt / (dt + kFadeInS) * (g.push_n - spot.load_n);
    spot.where = g.where;
    spot.features = g.features;
    spot.seen_s = time_s;
    const bool is_due = spot.begun_s < 0.0 ? time_s - spot.quiet_s > kMinQuietS : time_s - spot.recorded_s >= kIntervalS - 1e-9;
    if (!is_due) continue;
    if (spot.begun_s < 0.0) spot.id = make_id(spot);
    record(space, g, spot, events);
  }
  // At times independent of the steps of other groups.
  if (!space.is_at_window()) return;
  for (auto pair = spots_.begin(); pair != spots_.end();) {
    end_or_keep(space, pair->second, events);
    pair = pair->second.empty() ? spots_.erase(pair) : std::next(pair);
  }
}

/// Ends or keeps the spots of a pair that were not seen, or are at rest.
void LastingContacts::end_or_keep(const rigid::Space& space, std::vector<Spot>& spots, std::vector<events::Event>& events) {
  const double time_s = space.get_time();
  for (Spot& spot : spots) {
    // If both bodies are at rest the contact lasts; one record is written, after which nothing changes.
    const bool lies = space.is_still(spot.a) && (spot.b < 0 || space.is_still(spot.b));
    if (lies) {
      spot.seen_s = time_s;
      for (const int side : {0, 1}) {
        events::LastingContact& c = spot.last[side];
        if (spot.lies || spot.begun_s < 0.0 || c.body < 0) continue;
        c.time_s = time_s;
        c.state = events::ContactState::kHold;
        c.slip_m_s = {};
        c.sweep_m_s = c.other_sweep_m_s = c.spin_rad_s = 0.0;
        c.force_n = spot.load_n;
        events.push_back(c);
      }
    }
    if (!lies) stir(space, spot, events);
    spot.lies = lies;
    if (lies) continue;
    if (time_s - spot.seen_s <= kUnloadedEndS || spot.begun_s < 0.0) continue;
    for (const int side : {0, 1}) {
      events::LastingContact c = spot.last[side];
      if (c.body < 0) continue;
      c.time_s = time_s;
      c.state = events::ContactState::kEnd;
      c.force_n = 0.0;
      events.push_back(c);
    }
  }
  std::erase_if(spots, [&](const Spot& s) { return time_s - s.seen_s > kUnloadedEndS; });
}

void LastingContacts::note_impact(const rigid::Space& space, int a, int b, const Vec3& where, double time_s) {
  const auto found = spots_.find({a, b});
  if (found == spots_.end()) return;
  for (Spot& spot : found->second)
    if (norm(spot.where - where) < 2.0 * calc_spot_radius(space, a, b)) spot.quiet_s = time_s;
}

}  // namespace carillon::physics
