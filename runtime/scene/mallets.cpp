// Method: an impact (runtime/physics/impact) in the frame of the mesh. The head has neither spin nor modes; the struck body has the bank's
// modes, and its mass and inertia unless fixed. Springs: Hertz contact of head and body, or the felt's power law. Forces are output as
// samples. The surface is flat within the contact; speeds are relative to a moving body.
// Source: docs/equations.md E5a.
#include "runtime/scene/mallets.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "runtime/base/error.hpp"
#include "runtime/physics/impact/predict.hpp"

namespace carillon::scene {
namespace {

constexpr double kLongestBlowS = 1.0;  // of one blow and those that overlap it
constexpr double kMinCosine = 0.05;    // of the angle of incidence; below it the head misses
constexpr double kDeepM = 0.05;        // compression of a felt

double calc_energy(double mass_kg, const Vec3& v) { return 0.5 * mass_kg * dot(v, v); }

/// Place, outward normal and mode shapes.
struct Spot {
  Vec3 where_m{}, normal{};
  std::vector<double> shape;  // (n, 3)
};

Spot find_spot(const bank::Bank& bank, std::int32_t triangle, const Vec3& barycentric) {
  const auto& corners = bank.triangles[triangle];
  std::array<Vec3, 3> at;
  for (std::size_t c = 0; c < 3; ++c) at[c] = bank.vertices_m[corners[c]];
  Spot spot;
  const Vec3 across = cross(at[1] - at[0], at[2] - at[0]);
  if (norm(across) > 0.0) spot.normal = normalise(across);
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t k = 0; k < 3; ++k) spot.where_m[k] += barycentric[c] * at[c][k];
  spot.shape = bank::calc_shapes(bank, triangle, barycentric);
  return spot;
}

impact::Spring make_spring(const Mallet& mallet, const bank::Bank& bank) {
  if (mallet.felt) return {.stiffness = mallet.felt->stiffness_n_m_p, .exponent = mallet.felt->exponent};
  return {.stiffness = impact::calc_hertz_stiffness(mallet.young_modulus_pa, mallet.poisson_ratio, bank.material.young_modulus_pa,
                                                    bank.material.poisson_ratio, mallet.radius_m)};
}

impact::Body make_struck(const SceneBody& body, const bank::Bank& bank, const impact::Modes* modes) {
  impact::Body struck;
  struck.modes = modes;
  struck.centre_m = bank.rigid.centre_m;
  if (body.spec.fixed) return struck;
  struck.mass_kg = bank.rigid.mass_kg;
  for (std::size_t i = 0; i < 9; ++i) struck.inertia_kg_m2[i / 3][i % 3] = bank.rigid.inertia_kg_m2[i];
  return struck;
}

/// One head approaching the body.
struct Head {
  const Mallets::Strike* strike = nullptr;
  Spot spot;
  impact::Body body{};
  impact::Contact contact{};
};

Head make_head(const Mallets::Strike& strike, const bank::Bank& bank, int index) {
  const Mallet& mallet = *strike.from->mallet;
  Head head{.strike = &strike, .spot = find_spot(bank, strike.triangle, strike.barycentric)};
  const double towards = -dot(head.spot.normal, strike.velocity_m_s), speed = norm(strike.velocity_m_s);
  if (!(towards > kMinCosine * speed)) {
    throw InputError(
        fmt::format("{}: the mallet does not move towards the surface, whose normal there is [{:.4g}, {:.4g}, {:.4g}]; turn "
                    "\"direction\" round, or leave it out",
                    strike.from->place, head.spot.normal[0], head.spot.normal[1], head.spot.normal[2]));
  }
  head.body.mass_kg = mallet.mass_kg;
  head.body.centre_m = head.spot.where_m;
  head.body.velocity_m_s = strike.velocity_m_s;
  head.contact.a = index;
  head.contact.b = 0;
  head.contact.where_m = head.spot.where_m;
  head.contact.normal = head.spot.normal;
  head.contact.spring = make_spring(mallet, bank);
  head.contact.restitution = mallet.restitution;
  head.contact.friction = mallet.friction;
  return head;
}

/// Separation speed of the head and a rigid body with spin, at a place.
double calc_parting(const impact::Body& head, const impact::Body& struck, const Spot& spot) {
  const Vec3 turned = cross(struck.spin_rad_s, spot.where_m - struck.centre_m);
  return dot(spot.normal, head.velocity_m_s - struck.velocity_m_s - turned);
}

double calc_rigid_energy(const impact::Body& body) {
  return calc_energy(body.mass_kg, body.velocity_m_s) + 0.5 * dot(body.spin_rad_s, body.inertia_kg_m2 * body.spin_rad_s);
}

std::span<const double> find_shape(const Head& head, const impact::Modes* modes) {
  return modes != nullptr ? std::span<const double>(head.spot.shape) : std::span<const double>();
}

/// Runs the impact to its end. Blows that start meanwhile join it, at the distance of their remaining flight. `next`: index into the
/// strikes sorted by time. False if a head is still in contact after kLongestBlowS.
bool run_to_end(impact::Impact& impact, std::vector<Head>& heads, const std::vector<Mallets::Strike>& strikes, std::size_t& next,
                const bank::Bank& bank, const impact::Modes* modes) {
  const double begin_s = heads[0].strike->from->time_s;
  while (true) {
    const double until_s = next < strikes.size() ? strikes[next].from->time_s - begin_s : kLongestBlowS;
    const bool ended = impact.advance(std::min(until_s - impact.get_step_length(), kLongestBlowS));
    if (ended || next == strikes.size() || until_s > kLongestBlowS) return ended;
    Head head = make_head(strikes[next++], bank, static_cast<int>(heads.size()) + 1);
    head.contact.gap_m = std::max(0.0, until_s - impact.get_time()) * -dot(head.spot.normal, head.body.velocity_m_s);
    head.contact.shape_b = find_shape(head, modes);
    (void)impact.join(head.body);
    impact.join(head.contact);
    heads.push_back(std::move(head));
  }
}

/// Result of one head's blow; `after`: the bodies of the impact, the struck one first.
Blow make_blow(const std::string& body, const impact::Impact& impact, const std::vector<Head>& heads, std::size_t i,
               const std::vector<impact::Body>& after, std::vector<std::string>& warnings) {
  const Head& head = heads[i];
  const double came_m_s = -dot(head.spot.normal, head.body.velocity_m_s);
  const impact::ElasticPulse pulse = impact::calc_elastic_pulse(head.contact.spring, head.body.mass_kg, came_m_s);
  const Mallet& mallet = *head.strike->from->mallet;
  if (const double deep_m = mallet.felt ? kDeepM : mallet.radius_m; pulse.compression_m > deep_m) {
    warnings.push_back(
        fmt::format("{}: against a rigid surface the head would be compressed by {:.3g} m; make it stiffer, lighter or slower",
                    head.strike->from->place, pulse.compression_m));
  }
  return {.body = body,
          .time_s = head.strike->from->time_s,
          .impulse_n_s = impact.get_impulse(static_cast<int>(i)),
          .restitution = calc_parting(after[i + 1], after[0], head.spot) / came_m_s,
          .before_j = calc_rigid_energy(head.body),
          .after_j = calc_rigid_energy(after[i + 1]),
          .together = static_cast<int>(heads.size())};
}

/// Appends the forces of the impact as events, and one result per head.
void add_forces(impact::Impact& impact, const std::vector<Head>& heads, std::span<Blow> blows, std::vector<events::Event>& events) {
  for (const impact::Pulse& pulse : impact.take_pulses()) {
    const Head& head = heads[pulse.contact];
    Blow& blow = blows[pulse.contact];
    std::vector<Vec3> impulses;
    for (const Vec3& j : pulse.impulse_n_s) {
      impulses.push_back(-1.0 * j);
      blow.peak_n = std::max(blow.peak_n, dot(j, head.spot.normal) / pulse.step_s);
    }
    const double start_s = heads[0].strike->from->time_s + pulse.start_s;
    blow.contact_s = start_s + static_cast<double>(impulses.size()) * pulse.step_s - head.strike->from->time_s;
    events::split_force({.time_s = start_s,
                         .step_s = pulse.step_s,
                         .body = static_cast<std::int32_t>(head.strike->body),
                         .triangle = head.strike->triangle,
                         .barycentric = head.strike->barycentric},
                        impulses, [&](const events::Force& piece) { events.emplace_back(piece); });
  }
}

}  // namespace

void Mallets::play(const SceneBody& body, const bank::Bank& bank, std::vector<Strike> strikes, std::vector<events::Event>& events,
                   std::vector<Blow>& blows, std::vector<std::string>& warnings) {
  std::stable_sort(strikes.begin(), strikes.end(), [](const Strike& a, const Strike& b) { return a.from->time_s < b.from->time_s; });
  const impact::Modes* modes = modes_.find(bank).get();
  std::vector<double> q, q_dot;  // modal state at `state_s`
  double state_s = 0.0;
  for (std::size_t next = 0; next < strikes.size();) {
    const double begin_s = strikes[next].from->time_s;
    std::vector<Head> heads;
    heads.push_back(make_head(strikes[next++], bank, 1));
    impact::Body struck = make_struck(body, bank, modes);
    if (!q.empty()) {
      modes->move_freely(q, q_dot, std::max(0.0, begin_s - state_s));
      struck.q = q;
      struck.q_dot = q_dot;
    }
    const double rang_j = q.empty() ? 0.0 : modes->calc_energy(q, q_dot);
    heads[0].contact.shape_b = find_shape(heads[0], modes);
    impact::Impact impact({struck, heads[0].body}, {heads[0].contact});
    if (!run_to_end(impact, heads, strikes, next, bank, modes)) {
      warnings.push_back(fmt::format("{}: the mallet is still in contact with \"{}\" after {:g} s; the rest is omitted",
                                     heads[0].strike->from->place, body.name, kLongestBlowS));
    }
    const std::vector<impact::Body> after = impact.get_bodies();
    const impact::Books books = impact.get_books();
    const std::size_t first = blows.size();
    for (std::size_t i = 0; i < heads.size(); ++i) blows.push_back(make_blow(body.name, impact, heads, i, after, warnings));
    blows[first].motion_j = calc_rigid_energy(after[0]);
    blows[first].modes_j = books.modal - rang_j;
    blows[first].lost_j = books.dissipated_modes + books.dissipated_contact + books.yielded + books.dissipated_friction + books.above_band;
    add_forces(impact, heads, std::span(blows).subspan(first), events);
    q = after[0].q;
    q_dot = after[0].q_dot;
    state_s = begin_s + impact.get_time();
  }
}

}  // namespace carillon::scene
