// Method: the points that carry are gathered into spots, as the impacts are; a spot that has carried for kPatience with no impact is a
// lasting
//   contact, of which a record is made every kInterval. The place of a spot moves with the body whose corner carries it, and jumps when
//   another corner takes over; smoothed, that is the speed of the contact over the world, and what of it is not the speed of a surface is
//   its sweep over that surface.
// Source: K. Johnson, "Contact Mechanics" (1985), 4.2, for the radius of the touch; the impedance of a plane wave, rho c_L, over its area.
// Deviations: a flat contact has no Hertz radius; half the size of the smaller body takes its place, as for the length of impacts.
#include "runtime/contact/lasting.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/config/chance.hpp"
#include "runtime/contact/resting.hpp"

namespace carillon::contact {
namespace {

using SimTK::dot;
using Point = SimTK::Vec3;

constexpr double kPatience = 5e-3;    // s
constexpr double kRise = 5e-3;        // s; the force of a new contact comes within it: the impact before has been heard already
constexpr double kInterval = 1e-3;    // s
constexpr double kGone = 5e-3;        // s; a spot that has not carried for so long has ended
constexpr double kSmooth = 20e-3;     // s
constexpr double kSmallest = 1e-6;    // m; of a patch
constexpr double kRollingSpin = 1.0;  // rad/s; slower, what sways stays where it is
constexpr double kSharpest = 5e-4;    // m; radius of an edge that the mesh has sharp

/// What touches at one place now.
struct Group {
  int a = 0, b = -1;
  Point where{0}, normal{0}, carried{0};  // the velocity of the surface whose corners carry
  double push_n = 0.0;
  std::vector<std::array<int, 3>> features;
};

Point calc_velocity(const Snapshot& now, int body, const Point& where) {
  if (body < 0) return Point(0);
  const Mobile& m = now.mobiles[body];
  return m.inverse_mass > 0.0 ? Point(m.velocity + m.spin % (where - m.centre)) : Point(0);
}

/// How fast the bodies turn against each other, without what is about the normal.
Point calc_turn(const Snapshot& now, const Group& g) {
  const Point turn = now.mobiles[g.a].spin - (g.b >= 0 ? now.mobiles[g.b].spin : Point(0));
  return turn - dot(turn, g.normal) * g.normal;
}

std::vector<Group> make_groups(const Engine& engine, const Snapshot& now) {
  std::vector<PushedPoint> points = engine.calc_pushes(now);
  std::stable_sort(points.begin(), points.end(), [](const PushedPoint& x, const PushedPoint& y) { return x.push_n > y.push_n; });
  std::vector<bool> taken(points.size(), false);
  std::vector<Group> groups;
  for (std::size_t seed = 0; seed < points.size(); ++seed) {
    if (taken[seed]) continue;
    const TouchPoint& first = points[seed].touch;
    Group g;
    g.a = first.a;
    g.b = first.b;
    for (std::size_t i = seed; i < points.size(); ++i) {
      const TouchPoint& t = points[i].touch;
      if (taken[i] || t.a != g.a || t.b != g.b || (t.where - first.where).norm() > engine.spot_radius_m(g.a, g.b)) continue;
      taken[i] = true;
      const double push = points[i].push_n;
      g.push_n += push;
      g.where += push * t.where;
      g.normal += push * t.normal;
      g.carried += push * calc_velocity(now, t.plane_on_b ? t.a : t.b, t.where);
      g.features.push_back(t.feature);
    }
    g.where /= g.push_n;
    g.normal /= g.normal.norm();
    g.carried /= g.push_n;
    std::sort(g.features.begin(), g.features.end());
    groups.push_back(std::move(g));
  }
  return groups;
}

/// Radius of the sphere on a plane that touches as the two surfaces do.
double calc_radius(const Engine& engine, const Snapshot& now, const Group& g) {
  const Elastic a = engine.make_elastic(g.a, now.poses[g.a], g.where, -g.normal);
  const Elastic b = engine.make_elastic(g.b, g.b >= 0 ? now.poses[g.b] : SimTK::Transform(), g.where, g.normal);
  const double largest = 5.0 * engine.spot_radius_m(g.a, g.b);
  return 1.0 / std::clamp(a.curvature_per_m + b.curvature_per_m, 1.0 / largest, 1.0 / kSharpest);
}

double calc_patch(const Engine& engine, const Group& g, double radius_m, double force_n) {
  const auto calc_compliance = [&](int body) {
    const Solid solid = engine.find_solid(body);
    return (1.0 - solid.poisson_ratio * solid.poisson_ratio) / solid.young_modulus_pa;
  };
  const double modulus = 1.0 / (calc_compliance(g.a) + calc_compliance(g.b));
  return std::max(kSmallest, std::cbrt(0.75 * force_n * radius_m / modulus));
}

/// Of a plane wave into the body over the patch. Poisson's ratio is kept from 1/2, where the wave would be of infinite speed.
double calc_impedance(const Engine& engine, int body, double patch_m) {
  const Solid s = engine.find_solid(body);
  const double nu = std::min(s.poisson_ratio, 0.45);
  const double modulus = s.young_modulus_pa * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu));
  return std::sqrt(modulus * s.density_kg_m3) * SimTK::Pi * patch_m * patch_m;
}

std::array<double, 3> to_array(const Point& x) { return {x[0], x[1], x[2]}; }

void record(const Engine& engine, const Snapshot& now, const Group& g, Spot& spot, std::vector<stream::Contact>& events) {
  const bool is_new = spot.begun_s < 0.0;
  if (is_new) {
    spot.begun_s = now.time_s;
    spot.radius_m = calc_radius(engine, now, g);
  }
  spot.recorded_s = now.time_s;
  const Point va = calc_velocity(now, g.a, g.where), vb = calc_velocity(now, g.b, g.where), u = va - vb;
  Point slip = u - dot(u, g.normal) * g.normal;
  // Below kCreep friction holds: what is left there is the engine's creep and no slip. Above, without a jump.
  const Point creep = std::min(1.0, kCreep * kCreep / std::max(dot(slip, slip), 1e-30)) * slip;
  slip -= creep;
  // How much of the place's speed is that of b's surface: the creep belongs to the sweep over the other one.
  const double share = dot(u, u) > 0.0 ? std::clamp(dot(va - g.carried, u) / dot(u, u), 0.0, 1.0) : 0.0;
  const Point turn = calc_turn(now, g);
  const auto calc_sweep = [&](const Point& surface) {
    const Point w = g.carried + spot.drift - surface;
    return (w - dot(w, g.normal) * g.normal).norm();
  };
  const double sweep_a = calc_sweep(va - share * creep), sweep_b = calc_sweep(vb + (1.0 - share) * creep);
  const double patch = calc_patch(engine, g, spot.radius_m, g.push_n);
  for (const int side : {0, 1}) {
    const int body = side == 0 ? g.a : g.b, other = side == 0 ? g.b : g.a;
    if (body < 0) continue;
    const SimTK::Transform& pose = now.poses[body];
    const double sign = side == 0 ? 1.0 : -1.0;
    bool inside = false;
    int face = 0;
    SimTK::Vec2 uv;
    engine.surface(body).mesh().find_nearest(~pose * g.where, inside, face, uv);
    stream::Contact c;
    c.time_s = now.time_s;
    c.id = spot.id;
    c.body = body;
    c.other = other;
    c.triangle = engine.surface(body).bank_triangle(face);
    c.state = is_new ? stream::ContactState::kBegin : stream::ContactState::kHold;
    c.barycentric = {uv[0], uv[1], 1.0 - uv[0] - uv[1]};
    c.normal = to_array(~pose.R() * (sign * g.normal));
    c.slip_m_s = to_array(~pose.R() * (sign * slip));
    c.force_n = g.push_n * std::min(1.0, (now.time_s - spot.begun_s) / kRise);
    c.sweep_m_s = side == 0 ? sweep_a : sweep_b;
    c.other_sweep_m_s = side == 0 ? sweep_b : sweep_a;
    c.spin_rad_s = turn.norm();
    c.patch_radius_m = patch;
    c.impedance_n_s_m = calc_impedance(engine, other, patch);
    spot.last[side] = c;
    events.push_back(c);
  }
}

std::uint64_t scramble(std::uint64_t state) { return config::draw(state); }

/// 0 for the ground.
std::uint64_t hash_name(const Engine& engine, int body) { return body < 0 ? 0 : config::hash_name(engine.world().bodies[body].name); }

}  // namespace

/// Of the names of the pair and the number of the touch among theirs: other bodies of the scene change nothing of it, nor does their order.
std::uint64_t LastingContacts::make_id(const Engine& engine, const std::vector<int>& members, const Spot& spot) {
  const std::pair<int, int> pair{members[spot.a], spot.b < 0 ? -1 : members[spot.b]};
  const auto counted = before_->find(pair);
  std::uint64_t& touch = touches_.try_emplace(pair, counted == before_->end() ? 0 : counted->second).first->second;
  const std::uint64_t of_pair = scramble(hash_name(engine, spot.a)) + scramble(hash_name(engine, spot.b));
  std::uint64_t id = scramble(of_pair + touch) >> 1;  // files hold signed numbers
  ++touch;
  // Bodies may have one name.
  while (std::any_of(spots_.begin(), spots_.end(), [&](const Spot& other) { return other.begun_s >= 0.0 && other.id == id; }))
    id = scramble(id) >> 1;
  return id;
}

void LastingContacts::update(const Engine& engine, const std::vector<int>& members, const Snapshot& now,
                             std::vector<stream::Contact>& events) {
  for (const Group& g : make_groups(engine, now)) {
    Spot* nearest = nullptr;
    double least = 2.0 * engine.spot_radius_m(g.a, g.b);
    for (Spot& spot : spots_) {
      const double distance = (spot.where - g.where).norm();
      if (spot.a == g.a && spot.b == g.b && spot.seen_s < now.time_s && distance < least) {
        nearest = &spot;
        least = distance;
      }
    }
    if (nearest == nullptr) {
      Spot spot;
      spot.a = g.a;
      spot.b = g.b;
      spot.where = g.where;
      spot.features = g.features;
      spot.quiet_s = spot.seen_s = now.time_s;
      spots_.push_back(spot);
      continue;
    }
    Spot& spot = *nearest;
    const double dt = now.time_s - spot.seen_s;
    // The load goes over from corner to corner while a body rolls, before one of them comes or goes.
    const bool stays = spot.features == g.features && calc_turn(now, g).norm() < kRollingSpin;
    const Point velocity = stays ? g.carried : Point((g.where - spot.where) / dt);
    spot.drift += dt / (dt + kSmooth) * (velocity - g.carried - spot.drift);
    spot.where = g.where;
    spot.features = g.features;
    spot.seen_s = now.time_s;
    const bool is_due = spot.begun_s < 0.0 ? now.time_s - spot.quiet_s > kPatience : now.time_s - spot.recorded_s >= kInterval;
    if (!is_due) continue;
    if (spot.begun_s < 0.0) spot.id = make_id(engine, members, spot);
    record(engine, now, g, spot, events);
  }
  for (Spot& spot : spots_) {
    if (now.time_s - spot.seen_s <= kGone || spot.begun_s < 0.0) continue;
    for (const int side : {0, 1}) {
      stream::Contact c = spot.last[side];
      if ((side == 0 ? spot.a : spot.b) < 0) continue;
      c.time_s = now.time_s;
      c.state = stream::ContactState::kEnd;
      c.force_n = 0.0;
      events.push_back(c);
    }
  }
  spots_.erase(std::remove_if(spots_.begin(), spots_.end(), [&](const Spot& s) { return now.time_s - s.seen_s > kGone; }), spots_.end());
}

void LastingContacts::note_impact(const Engine& engine, int a, int b, const Point& where, double time_s) {
  for (Spot& spot : spots_) {
    if (spot.a == a && spot.b == b && (spot.where - where).norm() < 2.0 * engine.spot_radius_m(a, b)) spot.quiet_s = time_s;
  }
}

}  // namespace carillon::contact
