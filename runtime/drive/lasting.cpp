// Method: load-bearing points are grouped into spots, as in impacts; a spot loaded for kMinQuietS without an impact is a lasting contact,
// with one record every kIntervalS. The position of a spot moves with the body that owns the loaded point, and jumps when another point
// takes over; smoothed, this is the velocity of the contact in the world, and its difference from the velocity of a surface is its sweep
// over that surface. A flat contact has no Hertz radius; half the size of the smaller body is used, as for the duration of impacts.
// Source: K. Johnson, "Contact Mechanics" (1985), 4.2, for the contact radius; the impedance of a plane wave, rho c_L, over its area.
#include "runtime/drive/lasting.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/bank/bank.hpp"
#include "runtime/base/chance.hpp"
#include "runtime/physics/impact/spring.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::drive {
namespace {

constexpr double kMinQuietS = 5e-3;          // s
constexpr double kFadeInS = 5e-3;            // s; fade-in of the force of a new contact, whose impact has already been rendered
constexpr double kIntervalS = 1e-3;          // s
constexpr double kUnloadedEndS = 5e-3;       // s; a spot unloaded for this time has ended
constexpr double kSmoothingS = 20e-3;        // s
constexpr double kMinPatchM = 1e-6;          // m; minimum patch radius
constexpr double kMinRollingSpinRadS = 1.0;  // rad/s; below, the position of a swaying contact is fixed
constexpr double kMinSlipSpeedMS = 1e-6;     // m/s; below, the contact does not slip

std::uint64_t scramble(std::uint64_t state) { return base::draw(state); }

/// Radius of the contact under the group's force [m].
double calc_patch(const Scene& scene, int a, int b, double push_n, double radius_m) {
  return std::max(kMinPatchM, impact::calc_patch_radius(push_n, radius_m, scene.calc_compliance(a, b)));
}

/// Impedance of a plane wave into the body over the patch.
double calc_impedance(const Matter& m, double patch_m) {
  const bank::Material material{.young_modulus_pa = m.young_modulus_pa, .poisson_ratio = m.poisson_ratio, .density_kg_m3 = m.density_kg_m3};
  return bank::calc_wave_impedance(material) * std::numbers::pi * patch_m * patch_m;
}

}  // namespace

/// Fills groups_ with the loaded points, pair by pair.
void LastingContacts::make_groups(const Scene& scene, std::span<Load> loads) {
  groups_.clear();
  taken_.assign(loads.size(), 0);
  for (std::size_t begin = 0, end = 0; begin < loads.size(); begin = end) {
    while (end < loads.size() && loads[end].a == loads[begin].a && loads[end].b == loads[begin].b) ++end;
    std::stable_sort(loads.begin() + static_cast<std::ptrdiff_t>(begin), loads.begin() + static_cast<std::ptrdiff_t>(end),
                     [](const Load& x, const Load& y) { return x.push_n > y.push_n; });
    for (std::size_t seed = begin; seed < end; ++seed)
      if (taken_[seed] == 0) groups_.push_back(make_group(scene, loads.subspan(seed, end - seed), &taken_[seed]));
  }
}

/// Group of the first load and those near it that belong to no group yet.
LastingContacts::Group LastingContacts::make_group(const Scene& scene, std::span<const Load> loads, char* taken) {
  const Load& first = loads.front();
  Group g;
  g.a = first.a;
  g.b = first.b;
  g.spot = first.spot;
  const double near = scene.calc_spot_radius(g.a, g.b);
  for (std::size_t n = 0; n < loads.size(); ++n) {
    const Load& load = loads[n];
    if (taken[n] != 0 || load.spot != first.spot || norm(load.where_m - first.where_m) > near) continue;
    taken[n] = 1;
    g.push_n += load.push_n;
    g.where = g.where + load.push_n * load.where_m;
    g.normal = g.normal + load.push_n * load.normal;
    g.carried = g.carried + load.push_n * scene.calc_velocity(load.owner, load.where_m);
    g.curvature_per_m += load.push_n * load.curvature_per_m;
    g.slip_share = std::max(g.slip_share, load.slip_share);
    g.smooth = g.smooth || load.smooth;
    g.rattles = g.rattles || load.rattles;
    g.features += scramble(load.feature);  // independent of the order
  }
  g.where = (1.0 / g.push_n) * g.where;
  g.carried = (1.0 / g.push_n) * g.carried;
  g.curvature_per_m /= g.push_n;
  g.normal = (1.0 / norm(g.normal)) * g.normal;
  const Vec3 turn = scene.motions[g.a].spin_rad_s - (g.b >= 0 ? scene.motions[g.b].spin_rad_s : Vec3{});
  g.turn = turn - dot(turn, g.normal) * g.normal;
  return g;
}

/// A contact at rest has no records. Repeats its last values, so that nothing is interpolated over the time at rest.
void LastingContacts::stir(const Scene& scene, Spot& spot, std::vector<events::Event>& events) {
  if (!spot.lies) return;
  spot.lies = false;
  if (spot.begun_s < 0.0) return;
  spot.rises_s = scene.before_s;
  spot.from_n = spot.last[0].force_n;
  for (events::LastingContact& c : spot.last) {
    if (c.body < 0) continue;
    c.time_s = spot.rises_s;
    events.push_back(c);
  }
}

void LastingContacts::record(const Scene& scene, const Group& g, Spot& spot, std::vector<events::Event>& events) {
  const double time_s = scene.time_s;
  const bool is_new = spot.begun_s < 0.0;
  stir(scene, spot, events);
  if (is_new) {
    spot.begun_s = spot.rises_s = time_s;
    const double max_m = std::max(5.0 * scene.calc_spot_radius(g.a, g.b), rigid::kMinContactRadiusM);
    spot.radius_m = 1.0 / std::clamp(g.curvature_per_m, 1.0 / max_m, 1.0 / rigid::kMinContactRadiusM);
  }
  spot.recorded_s = time_s;
  const Vec3 va = scene.calc_velocity(g.a, g.where), vb = scene.calc_velocity(g.b, g.where), u = va - vb;
  Vec3 slip = u - dot(u, g.normal) * g.normal;
  const auto calc_sweep = [&](const Vec3& surface) {
    const Vec3 w = g.carried + spot.drift - surface;
    return w - dot(w, g.normal) * g.normal;
  };
  Vec3 over_a = calc_sweep(va), over_b = calc_sweep(vb);
  if (g.slip_share < 1.0) {  // solver jitter is taken from the surface that moves faster under the contact
    slip = g.slip_share * slip;
    if (norm(over_a) <= norm(over_b))
      over_b = over_a + slip;
    else
      over_a = over_b - slip;
  }
  if (norm(slip) < kMinSlipSpeedMS) slip = {};
  const double sweep_a = norm(over_a), sweep_b = norm(over_b), patch = calc_patch(scene, g.a, g.b, g.push_n, spot.radius_m);
  for (const int side : {0, 1}) {
    const int body = side == 0 ? g.a : g.b, other = side == 0 ? g.b : g.a;
    if (body < 0 || scene.bodies[body].shape == nullptr) continue;
    const double sign = side == 0 ? 1.0 : -1.0;
    const Mat3 back = transpose(scene.motions[body].rotation);
    const geometry::Place place = scene.find_place(body, g.where, (-sign) * g.normal, is_new ? -1 : spot.last[side].triangle);
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
    c.impedance_n_s_m = g.rattles ? 0.0 : calc_impedance(scene.get_matter(other), patch);
    spot.last[side] = c;
    events.push_back(c);
  }
}

/// From the names of the pair and the number of the touch within it: independent of other bodies of the scene and of their order.
std::uint64_t LastingContacts::make_id(const Scene& scene, const Spot& spot) {
  std::uint64_t& touch = touches_[{spot.a, spot.b}];
  std::uint64_t id = scramble(scramble(scene.get_matter(spot.a).name_hash) + scramble(scene.get_matter(spot.b).name_hash) + touch) >>
                     1;  // files hold signed numbers
  ++touch;
  // Bodies may share a name.
  const auto is_taken = [&](const auto& of_pair) {
    return std::any_of(of_pair.second.begin(), of_pair.second.end(),
                       [&](const Spot& other) { return other.begun_s >= 0.0 && other.id == id; });
  };
  while (std::any_of(spots_.begin(), spots_.end(), is_taken)) id = scramble(id) >> 1;
  return id;
}

/// The nearest known spot that was not seen in this step, or the one of the given identity; else a new one.
LastingContacts::Spot& LastingContacts::find_spot(const Scene& scene, const Group& g) {
  Spot* nearest = nullptr;
  double min = 2.0 * scene.calc_spot_radius(g.a, g.b);
  std::vector<Spot>& spots = spots_[{g.a, g.b}];
  for (Spot& spot : spots) {
    if (spot.seen_s >= scene.time_s || spot.spot != g.spot) continue;
    if (g.spot != 0) return spot;
    const double distance = norm(spot.where - g.where);
    if (distance >= min) continue;
    nearest = &spot;
    min = distance;
  }
  if (nearest != nullptr) return *nearest;
  Spot spot;
  spot.a = g.a;
  spot.b = g.b;
  spot.spot = g.spot;
  spot.last[0].body = scene.bodies[g.a].shape != nullptr ? g.a : -1;
  spot.last[1].body = g.b >= 0 && scene.bodies[g.b].shape != nullptr ? g.b : -1;
  spot.where = g.where;
  spot.features = g.features;
  spot.load_n = g.push_n;
  spot.seen_s = scene.time_s;
  spot.quiet_s = scene.time_s - scene.before_s > kMinQuietS ? scene.before_s : scene.time_s;
  spots.push_back(spot);
  return spots.back();
}

void LastingContacts::update(const Scene& scene, std::span<Load> loads, bool ends, std::vector<events::Event>& events) {
  const double time_s = scene.time_s;
  make_groups(scene, loads);
  for (const Group& g : groups_) {
    Spot& spot = find_spot(scene, g);
    if (spot.seen_s >= time_s) continue;  // new
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
    if (spot.begun_s < 0.0) {
      spot.id = make_id(scene, spot);
      ++begun_;
    }
    record(scene, g, spot, events);
  }
  if (!ends) return;
  for (auto pair = spots_.begin(); pair != spots_.end();) {
    end_or_keep(scene, pair->second, events);
    pair = pair->second.empty() ? spots_.erase(pair) : std::next(pair);
  }
}

/// Records without a force for both bodies.
void LastingContacts::end_records(const Spot& spot, double time_s, std::vector<events::Event>& events) {
  if (spot.begun_s < 0.0) return;
  for (events::LastingContact c : spot.last) {
    if (c.body < 0) continue;
    c.time_s = time_s;
    c.state = events::ContactState::kEnd;
    c.force_n = 0.0;
    events.push_back(c);
  }
}

void LastingContacts::end(const Scene& scene, int body, std::vector<events::Event>& events) {
  for (auto pair = spots_.begin(); pair != spots_.end();) {
    if (pair->first.first != body && pair->first.second != body) {
      ++pair;
      continue;
    }
    for (const Spot& spot : pair->second) end_records(spot, scene.time_s, events);
    pair = spots_.erase(pair);
  }
}

/// Ends or keeps the spots of a pair that were not seen, or are at rest.
void LastingContacts::end_or_keep(const Scene& scene, std::vector<Spot>& spots, std::vector<events::Event>& events) {
  const double time_s = scene.time_s;
  for (Spot& spot : spots) {
    // If both bodies are at rest the contact lasts; one record is written, after which nothing changes.
    const bool lies = scene.is_still(spot.a) && scene.is_still(spot.b);
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
        c.impedance_n_s_m = calc_impedance(scene.get_matter(c.other), c.patch_radius_m);
        events.push_back(c);
      }
    }
    if (!lies) stir(scene, spot, events);
    spot.lies = lies;
    if (lies) continue;
    if (time_s - spot.seen_s > kUnloadedEndS) end_records(spot, time_s, events);
  }
  std::erase_if(spots, [&](const Spot& s) { return time_s - s.seen_s > kUnloadedEndS; });
}

void LastingContacts::note_impact(const Scene& scene, int a, int b, const Vec3& where, double time_s) {
  const auto found = spots_.find({a, b});
  if (found == spots_.end()) return;
  for (Spot& spot : found->second)
    if (norm(spot.where - where) < 2.0 * scene.calc_spot_radius(a, b)) spot.quiet_s = time_s;
}

}  // namespace carillon::drive
