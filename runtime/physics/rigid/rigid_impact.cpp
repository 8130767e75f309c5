// Method: the points of an impact and the contacts of their bodies are solved simultaneously, with Newton's restitution and Coulomb's cone.
// Impulses are scaled down if friction and restitution together would gain energy.
// Source: B. Mirtich, "Impulse-based dynamic simulation of rigid body systems" (1996); V. Smith et al., "Reflections on simultaneous
// impact", ACM Trans. Graph. 31 (2012), for rows.
#include "runtime/physics/rigid/rigid_impact.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "runtime/physics/rigid/limits.hpp"

namespace carillon::rigid {
namespace {

constexpr int kMaxExactPoints = 8;          // maximum points of an impact solved to rounding, with evenly shared load
constexpr double kMinRowRestitution = 0.9;  // minimum restitution in a row that transmits a blow,
constexpr int kMaxBlows = 100;              // maximum impacts per contact
constexpr int kMaxReachBodies = 3;          // bodies from the striking one to the last one moved

/// With friction Newton's restitution can gain energy (Kane 1984): the fraction of all impulses that does not.
double calc_conserving_part(const std::vector<Mover>& before, const std::vector<Mover>& after, const std::vector<Point>& points) {
  double linear = 0.0, square = 0.0;
  for (const Point& p : points) {
    const Vec3 u0 = calc_relative_velocity(before, p), u1 = calc_relative_velocity(after, p);
    linear += dot(p.impulse, u0);
    square += 0.5 * dot(p.impulse, u1 - u0);
  }
  return linear + square <= 0.0 || square <= 0.0 ? 1.0 : std::clamp(-linear / square, 0.0, 1.0);
}

}  // namespace

std::vector<ContactRef> RigidImpact::gather(const Step& step, const std::vector<ContactRef>& first) const {
  std::vector<ContactRef> taken = first;
  std::set<int> bodies;
  for (const ContactRef& ref : first) bodies.insert(ref.pair->a), bodies.insert(ref.pair->b);
  for (int far = 0; far < kMaxReachBodies; ++far) {
    std::set<int> next = bodies;
    for (Pair* pair : step.island().pairs) {
      if (!step.has(*pair)) continue;
      const auto is_struck = [&](int body) { return bodies_.moves(body) && bodies.contains(body); };
      if (!is_struck(pair->a) && !is_struck(pair->b)) continue;
      for (int k = 0; const Contact& c : pair->contacts) {
        const ContactRef ref{pair, k++};
        if (c.presses) continue;
        const bool soon = c.touch.gap_m - bodies_.calc_approach(c.touch, c.a, c.b) * step.together_s <= kTouchGapM;
        if (!soon && !(c.touching && c.touch.gap_m <= kDeepM)) continue;
        if (std::find(taken.begin(), taken.end(), ref) == taken.end()) taken.push_back(ref);
        next.insert(pair->a);
        next.insert(pair->b);
      }
    }
    if (next == bodies) break;
    bodies = next;
  }
  std::sort(taken.begin(), taken.end(), [](const ContactRef& x, const ContactRef& y) {
    return std::tuple(x.pair->a, x.pair->b, x.pair->cord, x.contact) < std::tuple(y.pair->a, y.pair->b, y.pair->cord, y.contact);
  });
  return taken;
}

Collision RigidImpact::make(const Step& step, std::vector<ContactRef> contacts) const {
  Collision collision;
  collision.contacts = std::move(contacts);
  for (const int i : step.island().bodies)
    collision.movers.push_back(
        {1.0 / bodies_.solid(i).mass_kg, bodies_.placed(i).inverse_inertia, bodies_.state(i).velocity, bodies_.placed(i).spin});
  collision.linkages.reserve(bodies_.articulations().size());
  bodies_.for_articulations(step.island().bodies, [&](Articulation& articulation) {
    Linkage& linkage = collision.linkages.emplace_back();
    linkage.set(*articulation.mechanism, articulation.now);
    for (int k = 0; const int body : articulation.bodies) {
      const int n = step.find(body);
      linkage.movers.push_back(n);
      collision.movers[n].linkage = &linkage;
      collision.movers[n].member = k++;
    }
  });
  for (const ContactRef& ref : collision.contacts) {
    collision.points.push_back(make_point(bodies_, step, ref.get()));
    collision.hits.push_back(make_hit(collision, ref.get(), collision.points.back()));
  }
  return collision;
}

Hit RigidImpact::make_hit(const Collision& collision, const Contact& c, Point& p) const {
  Hit hit{.a = c.a, .b = c.b, .touch = c.touch, .triangles = c.triangles};
  hit.approach_m_s = -dot(calc_relative_velocity(collision.movers, p), p.normal);
  hit.is_cord = c.cord >= 0;
  if (bodies_.find_articulation(c.a) != nullptr || bodies_.find_articulation(c.b) != nullptr) {
    const double mobility = dot(p.normal, calc_mobility(collision.movers, p) * p.normal);
    hit.linked_mass_kg = mobility > 0.0 ? 1.0 / mobility : 0.0;
  }
  if (hit.approach_m_s <= kMinImpactSpeedMS) return hit;
  if (hit.is_cord) {
    hit.restitution = c.touching ? 0.0 : touches_.cord(c.cord).restitution;
  } else if (!c.is_closed()) {
    // A rebound whose flight time 2 e v / g is shorter than the contact time does not occur: gravity keeps the surfaces together.
    const double e = bodies_.calc_restitution(c.a, c.b), mass = 1.0 / dot(p.normal, calc_mobility(collision.movers, p) * p.normal);
    const double pull = std::abs(dot(bodies_.gravity(), p.normal)), flight = 2.0 * e * hit.approach_m_s;
    hit.restitution = flight > pull * bodies_.calc_contact_time(hit.touch, hit.a, hit.b, mass, hit.approach_m_s) ? e : 0.0;
  }
  p.wanted = (hit.restitution * hit.approach_m_s) * p.normal;  // tangentially it may stick where it stops
  return hit;
}

/// Bodies that touch at most two others at one point each: a blow propagates through them as a wave.
bool RigidImpact::is_row(const Collision& collision) const {
  std::map<int, int> others;
  std::set<std::pair<int, int>> pairs;
  for (const Hit& hit : collision.hits) {
    if (hit.linked_mass_kg > 0.0) return false;
    if (hit.is_cord || !bodies_.moves(hit.a) || !bodies_.moves(hit.b)) continue;
    if (bodies_.calc_restitution(hit.a, hit.b) < kMinRowRestitution || !pairs.insert({hit.a, hit.b}).second) return false;
    if (++others[hit.a] > 2 || ++others[hit.b] > 2) return false;
  }
  return pairs.size() > 1;
}

/// One contact at a time, the fastest closing one first, until none closes.
void RigidImpact::solve_row(Collision& collision) const {
  std::vector<Point>& points = collision.points;
  const auto calc_approach = [&](const Point& p) { return -dot(calc_relative_velocity(collision.movers, p), p.normal); };
  for (int blow = 0; blow < kMaxBlows * static_cast<int>(points.size()); ++blow) {
    const auto fastest =
        std::max_element(points.begin(), points.end(), [&](const Point& x, const Point& y) { return calc_approach(x) < calc_approach(y); });
    const double approach = calc_approach(*fastest);
    if (approach <= 1e-9) break;
    Hit& hit = collision.hits[fastest - points.begin()];
    if (!hit.is_cord && bodies_.moves(hit.a) && bodies_.moves(hit.b) && approach > kMinImpactSpeedMS)
      hit.restitution = bodies_.calc_restitution(hit.a, hit.b);
    hit.approach_m_s = std::max(hit.approach_m_s, approach);
    const Vec3& n = fastest->normal;
    const Vec3 push = ((1.0 + (approach > kMinImpactSpeedMS ? hit.restitution : 0.0)) * approach /
                       dot(n, calc_mobility(collision.movers, *fastest) * n)) *
                      n;
    rigid::apply(collision.movers, *fastest, push);
    hit.impulse = hit.impulse + push;
  }
}

void RigidImpact::solve(Collision& collision) {
  if (is_row(collision)) return solve_row(collision);
  std::vector<Point>& points = collision.points;
  double scale = kMinImpactSpeedMS;
  for (const Hit& hit : collision.hits) scale = std::max(scale, std::abs(hit.approach_m_s));
  const std::vector<Mover> before = collision.movers;
  const int count = static_cast<int>(points.size());
  const bool is_few = count <= kMaxExactPoints;
  solver_.solve_evenly(collision.movers, points, is_few ? 20 * count : 0, (is_few ? 1e-9 : 1e-4) * scale, is_few ? 1000 : 60);
  const double part = calc_conserving_part(before, collision.movers, points);
  for (int n = 0; n < count; ++n) collision.hits[n].impulse = part * points[n].impulse;
}

Strike RigidImpact::apply(Collision& collision, double& lost_j) {
  std::set<int> moved;
  for (const Hit& hit : collision.hits) {
    if (hit.impulse == Vec3{}) continue;
    for (const int body : {hit.a, hit.b})
      if (bodies_.moves(body)) moved.insert(body);
  }
  std::vector<Articulation*> pushed;
  for (const int body : std::vector<int>(moved.begin(), moved.end()))
    if (Articulation* articulation = bodies_.find_articulation(body);
        articulation != nullptr && std::find(pushed.begin(), pushed.end(), articulation) == pushed.end()) {
      pushed.push_back(articulation);
      moved.insert(articulation->bodies.begin(), articulation->bodies.end());
    }
  Strike strike;
  strike.hits = std::move(collision.hits);
  strike.bodies.assign(moved.begin(), moved.end());
  const auto calc_kinetic = [&] {
    double sum = 0.0;
    for (const int body : moved) sum += rigid::calc_kinetic(bodies_.solid(body), bodies_.state(body));
    return sum;
  };
  for (const int body : moved) strike.before.push_back(bodies_.state(body));
  const double before_j = calc_kinetic();
  // Passes the impulses of all hits on moving bodies.
  const auto for_impulses = [&](const auto& act) {
    for (int n = 0; const Hit& hit : strike.hits) {
      const Point& p = collision.points[n++];
      if (p.a >= 0) act(hit.a, p.arm_a, hit.impulse);
      if (p.b >= 0) act(hit.b, p.arm_b, -1.0 * hit.impulse);
    }
  };
  for_impulses([&](int body, const Vec3& arm, const Vec3& impulse) {
    if (bodies_.find_articulation(body) != nullptr) return;
    State& s = bodies_.state(body);
    s.velocity = s.velocity + (1.0 / bodies_.solid(body).mass_kg) * impulse;
    s.momentum = s.momentum + cross(arm, impulse);
  });
  for (Articulation* articulation : pushed) {
    std::vector<joints::Spatial> impulses(articulation->bodies.size());
    for_impulses([&](int body, const Vec3& arm, const Vec3& impulse) {
      if (bodies_.find_articulation(body) != articulation) return;
      joints::Spatial& on = impulses[bodies_.get_member(body)];
      on.linear = on.linear + impulse;
      on.angular = on.angular + cross(arm, impulse);
    });
    bodies_.apply_impulses(*articulation, impulses);
  }
  lost_j = before_j - calc_kinetic();
  for (const int body : moved) {
    bodies_.place(body);
    strike.after.push_back(bodies_.state(body));
  }
  for (int n = 0; const Hit& hit : strike.hits) {
    Contact& c = collision.contacts[n++].get();
    const bool rebounds = hit.restitution > 0.0;
    c.touching = !rebounds && c.touch.gap_m <= kDeepM;
    if (rebounds) c.impulse = c.couple = {};
  }
  return strike;
}

}  // namespace carillon::rigid
