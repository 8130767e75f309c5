// Method: the instant of an impact is found on the paths of a step; its points and what touches their bodies are solved at once, with
//   Newton's restitution and Coulomb's cone, unless the modes take part (ringing.cpp).
// Source: B. Mirtich, "Impulse-based dynamic simulation of rigid body systems" (1996), instants of impact; K. L. Johnson, "Contact
//   mechanics" (1985), eq. 11.24.
// Deviations: impulses are scaled back where friction and restitution together would gain energy.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <tuple>

#include "runtime/base/crossing.hpp"
#include "runtime/impact/predict.hpp"
#include "runtime/rigid/limits.hpp"
#include "runtime/rigid/space.hpp"

namespace carillon::rigid {
namespace {

constexpr double kInstant = 1e-9;      // m; how well an instant of impact is found,
constexpr int kLooks = 20;             // and in how many looks at most
constexpr double kNear = 1e-6;         // m; what is nearer at the end of a step strikes there
constexpr std::size_t kFewPoints = 8;  // of an impact that is solved to rounding, its load shared evenly
constexpr double kLongestHertz = 20e-3;

}  // namespace

double calc_hertz_duration(double compliance, double radius, double mass, double speed) {
  const double duration = 2.87 * std::pow(mass * mass * compliance * compliance / (radius * std::max(speed, 1e-3)), 0.2);
  return std::clamp(duration, 5e-6, kLongestHertz);
}

/// 1/E* of two bodies, or of one and the ground [1/Pa].
double Space::calc_compliance(int a, int b) const {
  const double young = b >= 0 ? solid(b).young_modulus_pa : ground_->young_modulus_pa;
  const double poisson = b >= 0 ? solid(b).poisson_ratio : ground_->poisson_ratio;
  return impact::calc_contact_compliance(solid(a).young_modulus_pa, solid(a).poisson_ratio, young, poisson);
}

/// 1/R is the summed curvature, kept within 1/(0.5 mm) and one over half the size of the smaller body.
double Space::calc_contact_radius(const shape::Touch& touch, int a, int b) const {
  const double curvature = std::max(touch.curvature_a_per_m + touch.curvature_b_per_m, 0.0);
  return 1.0 / std::clamp(curvature, 1.0 / std::max(0.5 * calc_pair_size(a, b), kSharpest), 1.0 / kSharpest);
}

double Space::calc_contact_time(const Hit& hit, double mass_kg, double speed_m_s) const {
  return calc_hertz_duration(calc_compliance(hit.a, hit.b), calc_contact_radius(hit.touch, hit.a, hit.b), mass_kg, speed_m_s);
}

/// Will this touch come so fast within the step that it strikes?
bool Space::is_fast(const Contact& c, double h) const {
  if (c.presses || (c.touching && c.touch.gap_m <= kTouch)) return false;
  const double approach = calc_approach(c), gap = std::max(c.touch.gap_m, 0.0);
  double pull = 0.0;  // closing acceleration in flight
  if (moves(c.a)) pull -= dot(gravity_, c.touch.normal);
  if (moves(c.b)) pull += dot(gravity_, c.touch.normal);
  const double square = approach * approach + 2.0 * std::max(pull, 0.0) * gap;
  if (square <= kSlowest * kSlowest) return false;
  // What has just rebounded comes back within the step only if it is slow.
  if (approach < 0.0) return pull > 0.0 && -approach + std::sqrt(square) <= pull * h;
  return gap <= approach * h + 0.5 * norm(gravity_) * h * h + 1e-6;
}

/// The first instant, from now, at which a fast touch closes on the paths of the step.
bool Space::find_impact(const Island& island, double h, double& at_s, std::vector<Ref>& first) {
  struct Candidate {
    Ref ref;
    double at;
    double apex;  // until when it parts
  };
  std::vector<Candidate> candidates;
  for (Pair* pair : island.pairs)
    for (std::size_t k = 0; k < pair->contacts.size() && is_stepped(*pair); ++k) {
      const Contact& c = pair->contacts[k];
      if (!is_fast(c, h)) continue;
      const double approach = calc_approach(c), later = -dot(calc_relative_velocity(movers_, make_point(c)), c.touch.normal);
      const double rate = (later - approach) / h;
      // gap = approach s + rate s^2 / 2
      const double gap = std::max(c.touch.gap_m, 0.0), root = approach * approach + 2.0 * rate * gap;
      if (root < 0.0) continue;
      if (approach <= 0.0 && rate <= 0.0) continue;
      const double at = approach > 0.0 ? 2.0 * gap / (approach + std::sqrt(root)) : (std::sqrt(root) - approach) / rate;
      if (at <= h) candidates.push_back({{pair, k}, at, approach < 0.0 ? -approach / rate : 0.0});
    }
  std::stable_sort(candidates.begin(), candidates.end(), [](const auto& x, const auto& y) { return x.at < y.at; });
  // Paths are not quite straight: instants are looked for on them, as long as a guess is earlier than the first of those found.
  double earliest = std::numeric_limits<double>::infinity();
  for (Candidate& c : candidates) {
    if (c.at >= earliest) break;
    c.at = find_instant(c.ref, c.apex, c.at, h).value_or(std::numeric_limits<double>::infinity());
    earliest = std::min(earliest, c.at);
  }
  if (!std::isfinite(earliest)) return false;
  at_s = earliest;
  for (const Candidate& c : candidates)
    if (c.at <= at_s + together_s_) first.push_back(c.ref);
  return true;
}

/// When a touch that closes at about `guess_s`, and not before `apex_s`, does so on the path of the step; none if it does not.
std::optional<double> Space::find_instant(const Ref& ref, double apex_s, double guess_s, double h) {
  Pair& pair = *ref.pair;
  const shape::Touch now = ref.get().touch;
  const auto look = [&](double s) {
    const auto get_frame = [&](int body) {
      if (body < 0) return shape::Frame{};
      if (!moves(body)) return placed_[static_cast<std::size_t>(body)].frame;
      return place(solid(body), calc_moved(static_cast<std::size_t>(find_index(body)), s, h)).frame;
    };
    if (pair.cord >= 0) {
      const auto get_state = [&](int body) {
        return moves(body) ? calc_moved(static_cast<std::size_t>(find_index(body)), s, h) : body >= 0 ? state(body) : State{};
      };
      return calc_cord_gap(cords_[static_cast<std::size_t>(pair.cord)], get_state(pair.a), get_state(pair.b));
    }
    shape::Touch touch = now;
    shape::refresh(touch, *solid(pair.a).shape, get_frame(pair.a), get_shape(pair.b), get_frame(pair.b), pair.memory);
    return touch.gap_m;
  };
  if (!(guess_s > 0.0)) return guess_s;
  double open = apex_s, open_m = apex_s > 0.0 ? look(apex_s) : now.gap_m;
  if (!(open_m > 0.0)) return guess_s;  // it parts by less than it is deep
  double shut = guess_s, shut_m = look(guess_s);
  if (shut_m > kInstant) {
    open = shut;
    open_m = shut_m;
    shut = h;
    shut_m = look(h);
    if (shut_m > kNear) return std::nullopt;
  }
  if (shut_m >= -kInstant) return shut;
  return base::find_crossing(look, open, open_m, shut, shut_m, kInstant, 0.0, kLooks);
}

/// Looks at the pairs of an impact again, as they are at its instant: an edge that passes another one close by was taken for a plane until
/// now. Leaves what really strikes: what closes within together_s_ of the first, which is nearer than near_m (infinite: of now).
bool Space::confirm_impact(std::vector<Ref>& first, double step_s, double near_m) {
  std::vector<Pair*> pairs;
  for (const Ref& ref : first)
    if (std::find(pairs.begin(), pairs.end(), ref.pair) == pairs.end()) pairs.push_back(ref.pair);
  first.clear();
  bool any = false;
  for (Pair* pair : pairs) {
    search(*pair, std::max(step_s, 1e-5));
    refresh(*pair);
    for (std::size_t k = 0; k < pair->contacts.size(); ++k) {
      const Contact& c = pair->contacts[k];
      const double approach = calc_approach(c);
      if (c.presses || approach <= 0.5 * kSlowest || (c.touching && c.touch.gap_m <= kTouch) ||
          c.touch.gap_m > std::max(approach * together_s_ + kTouch, std::isfinite(near_m) ? near_m : 0.0))
        continue;
      first.push_back({pair, k});
      any = any || c.touch.gap_m <= near_m;
    }
  }
  return any;
}

/// The points that strike now, and those in touch with the bodies that they move, three bodies far; in order.
std::vector<Space::Ref> Space::gather_points(const Island& island, const std::vector<Ref>& first) const {
  std::vector<Ref> taken = first;
  std::set<int> bodies;
  for (const Ref& ref : first) bodies.insert(ref.pair->a), bodies.insert(ref.pair->b);
  for (int far = 0; far < 3; ++far) {
    std::set<int> next = bodies;
    for (Pair* pair : island.pairs) {
      if (!is_stepped(*pair)) continue;
      const auto is_struck = [&](int body) { return moves(body) && bodies.contains(body); };
      if (!is_struck(pair->a) && !is_struck(pair->b)) continue;
      for (std::size_t k = 0; k < pair->contacts.size(); ++k) {
        const Contact& c = pair->contacts[k];
        if (c.presses) continue;
        const bool soon = c.touch.gap_m - calc_approach(c) * together_s_ <= kTouch;
        if (!soon && !(c.touching && c.touch.gap_m <= kDeep)) continue;
        const Ref ref{pair, k};
        if (std::find(taken.begin(), taken.end(), ref) == taken.end()) taken.push_back(ref);
        next.insert(pair->a);
        next.insert(pair->b);
      }
    }
    if (next == bodies) break;
    bodies = next;
  }
  std::sort(taken.begin(), taken.end(), [](const Ref& x, const Ref& y) {
    return std::tuple(x.pair->a, x.pair->b, x.pair->cord, x.contact) < std::tuple(y.pair->a, y.pair->b, y.pair->cord, y.contact);
  });
  return taken;
}

/// A point of an impact of the group's bodies, which have their velocities in `movers_`; `p` gets the velocity that it is to have.
Hit Space::make_hit(const Contact& c, Point& p) const {
  Hit hit{.a = c.a, .b = c.b, .touch = c.touch, .triangles = c.triangles};
  hit.approach_m_s = -dot(calc_relative_velocity(movers_, p), p.normal);
  hit.is_cord = c.cord >= 0;
  if (find_linked(c.a) != nullptr || find_linked(c.b) != nullptr) {
    const double mobility = dot(p.normal, calc_mobility(movers_, p) * p.normal);
    hit.linked_mass_kg = mobility > 0.0 ? 1.0 / mobility : 0.0;
  }
  if (hit.approach_m_s <= kSlowest) return hit;
  if (hit.is_cord) {
    hit.restitution = c.touching ? 0.0 : cords_[static_cast<std::size_t>(c.cord)].restitution;
  } else if (!(c.touching && c.touch.gap_m <= kTouch)) {
    // A rebound whose flight, 2 e v / g, is shorter than the contact itself is none: weight keeps the surfaces together.
    const double e = calc_pair_restitution(c.a, c.b), mass = 1.0 / dot(p.normal, calc_mobility(movers_, p) * p.normal);
    const double pull = std::abs(dot(gravity_, p.normal)), flight = 2.0 * e * hit.approach_m_s;
    hit.restitution = flight > pull * calc_contact_time(hit, mass, hit.approach_m_s) ? e : 0.0;
  }
  p.wanted = (hit.restitution * hit.approach_m_s) * p.normal;  // across, it may stick where it stops
  return hit;
}

/// With friction Newton's restitution can gain energy (Kane 1984): the part of all impulses with which it does not.
double Space::calc_conserving_part(const std::vector<Mover>& before, const std::vector<Point>& points) const {
  double linear = 0.0, square = 0.0;
  for (const Point& p : points) {
    const Vec3 u0 = calc_relative_velocity(before, p), u1 = calc_relative_velocity(movers_, p);
    linear += dot(p.impulse, u0);
    square += 0.5 * dot(p.impulse, u1 - u0);
  }
  return linear + square <= 0.0 || square <= 0.0 ? 1.0 : std::clamp(-linear / square, 0.0, 1.0);
}

/// Gives the bodies of an impact the impulses of its hits. Records where they were; returns what their motion lost [J].
double Space::give_impulses(Strike& record, const std::vector<Point>& points) {
  std::set<int> moved;
  for (std::size_t n = 0; n < points.size(); ++n) {
    if (record.hits[n].impulse == Vec3{}) continue;
    if (points[n].a >= 0) moved.insert(record.hits[n].a);
    if (points[n].b >= 0) moved.insert(record.hits[n].b);
  }
  std::vector<Linked*> pushed;
  for (const int body : std::vector<int>(moved.begin(), moved.end()))
    if (Linked* linked = find_linked(body); linked != nullptr && std::find(pushed.begin(), pushed.end(), linked) == pushed.end()) {
      pushed.push_back(linked);
      moved.insert(linked->bodies.begin(), linked->bodies.end());
    }
  double before_j = 0.0, after_j = 0.0;
  for (const int body : moved) {
    record.bodies.push_back(body);
    record.before.push_back(state(body));
    before_j += calc_kinetic(solid(body), state(body));
  }
  const auto give = [&](int body, const Vec3& arm, const Vec3& impulse) {
    if (find_linked(body) != nullptr) return;
    State& s = states_[static_cast<std::size_t>(body)];
    s.velocity = s.velocity + (1.0 / solid(body).mass_kg) * impulse;
    s.momentum = s.momentum + cross(arm, impulse);
  };
  for (std::size_t n = 0; n < points.size(); ++n) {
    const Hit& hit = record.hits[n];
    if (points[n].a >= 0) give(hit.a, points[n].arm_a, hit.impulse);
    if (points[n].b >= 0) give(hit.b, points[n].arm_b, -1.0 * hit.impulse);
  }
  for (Linked* linked : pushed) {
    std::vector<joints::Spatial> impulses(linked->bodies.size());
    const auto add = [&](int body, const Vec3& arm, const Vec3& impulse) {
      if (find_linked(body) != linked) return;
      joints::Spatial& on = impulses[static_cast<std::size_t>(get_member(body))];
      on.linear = on.linear + impulse;
      on.angular = on.angular + cross(arm, impulse);
    };
    for (std::size_t n = 0; n < points.size(); ++n) {
      const Hit& hit = record.hits[n];
      if (points[n].a >= 0) add(hit.a, points[n].arm_a, hit.impulse);
      if (points[n].b >= 0) add(hit.b, points[n].arm_b, -1.0 * hit.impulse);
    }
    give_linked(*linked, impulses);
  }
  for (const int body : moved) after_j += calc_kinetic(solid(body), state(body));
  return before_j - after_j;
}

void Space::strike(Island& island, const std::vector<Ref>& first, double time_s) {
  std::vector<Ref> taken = gather_points(island, first);
  while (wake_struck(island, taken)) taken = gather_points(island, first);
  Strike record;
  record.time_s = time_s;
  record.together_s = together_s_;
  movers_.resize(island.bodies.size());
  for (std::size_t n = 0; n < island.bodies.size(); ++n) {
    const auto i = static_cast<std::size_t>(island.bodies[n]);
    movers_[n] = {1.0 / solids_[i].mass_kg, placed_[i].inverse_inertia, states_[i].velocity, placed_[i].spin};
    if (Linked* linked = find_linked(island.bodies[n]); linked != nullptr) {
      movers_[n].linkage = &linked->linkage;
      movers_[n].member = get_member(island.bodies[n]);
    }
  }
  for_linked(island, [this](Linked& linked) {
    linked.linkage.set(*linked.mechanism, linked.now);
    linked.linkage.movers.clear();
    for (const int body : linked.bodies) linked.linkage.movers.push_back(find_index(body));
  });
  std::vector<Point> points;
  double scale = kSlowest;
  for (const Ref& ref : taken) {
    points.push_back(make_point(ref.get()));
    record.hits.push_back(make_hit(ref.get(), points.back()));
    scale = std::max(scale, std::abs(record.hits.back().approach_m_s));
  }
  const auto keep_triangles = [&] {
    for (std::size_t n = 0; n < taken.size(); ++n) taken[n].get().triangles = record.hits[n].triangles;
  };
  if (!record.hits.empty() && predict_hits(taken, record.hits, points) && begin_ringing(taken, record.hits, time_s))
    return keep_triangles();
  // A rigid impact ends the impacts with modes that its bodies were moved by.
  for (const Hit& hit : record.hits)
    for (const int body : {hit.a, hit.b})
      if (has_impact(body)) end_ringing(*find_ringing(body), time_s);
  const std::vector<Mover> before = movers_;
  const bool is_few = points.size() <= kFewPoints;
  solver_.solve_evenly(movers_, points, is_few ? static_cast<int>(20 * points.size()) : 0, (is_few ? 1e-9 : 1e-4) * scale,
                       is_few ? 1000 : 60);
  const double part = calc_conserving_part(before, points);
  for (std::size_t n = 0; n < points.size(); ++n) record.hits[n].impulse = part * points[n].impulse;
  give_to_modes(record, give_impulses(record, points));
  for (const int body : record.bodies) {
    place_body(body);
    paces_[static_cast<std::size_t>(body)].slow_s = 0.0;
    record.after.push_back(state(body));
    reach_out(body);
  }
  keep_triangles();
  for (std::size_t n = 0; n < taken.size(); ++n) {
    Contact& c = taken[n].get();
    const bool rebounds = record.hits[n].restitution > 0.0;
    c.touching = !rebounds && c.touch.gap_m <= kDeep;
    if (rebounds) c.impulse = c.couple = {};
  }
  strikes_.push_back(std::move(record));
}

/// What the pulses of a rigid impact give the modes, at most what the motion lost; the rest of that is lost.
void Space::give_to_modes(Strike& record, double taken_j) {
  std::map<int, Ring> before;  // of the bodies whose modes are struck
  const double lost_before = lost_j_;
  double given = 0.0;
  for (Hit& hit : record.hits) {
    if (hit.impulse == Vec3{} || hit.is_cord || !(hit.approach_m_s > kSlowest)) continue;
    for (const bool is_a : {true, false}) {
      const int body = is_a ? hit.a : hit.b;
      if (!rings(body) || in_ringing_[static_cast<std::size_t>(body)]) continue;
      const auto i = static_cast<std::size_t>(body);
      const Vec3 impulse = transpose(placed_[i].rotation) * ((is_a ? 1.0 : -1.0) * hit.impulse);
      const std::vector<double> shape = solids_[i].find_shape(find_place(hit, is_a));
      const double push = dot(hit.impulse, hit.touch.normal);
      const double mass = push > 0.0 ? push / ((1.0 + hit.restitution) * hit.approach_m_s) : 0.0;
      if (!(mass > 0.0)) continue;
      const double length = calc_contact_time(hit, mass, hit.approach_m_s);
      before.try_emplace(body, rings_[i]);
      Ring& ring = ring_until(body, std::max(record.time_s + 0.5 * length, rings_[i].time_s));
      const auto& omega = solids_[i].modes->get_omega();
      const double energy = solids_[i].modes->calc_energy(ring.q, ring.q_dot);
      for (std::size_t m = 0; m < omega.size(); ++m)
        ring.q_dot[m] += (shape[3 * m] * impulse[0] + shape[3 * m + 1] * impulse[1] + shape[3 * m + 2] * impulse[2]) *
                         std::sqrt(impact::calc_pulse_spectrum(omega[m] * length));
      given += solids_[i].modes->calc_energy(ring.q, ring.q_dot) - energy;
    }
  }
  if (given > std::max(taken_j, 0.0)) {
    // More than there was: they get none of it. A rigid impact is only taken where modes get next to nothing.
    for (auto& [body, ring] : before) rings_[static_cast<std::size_t>(body)] = std::move(ring);
    lost_j_ = lost_before;
    given = 0.0;
  }
  record.modes_j = given;
  lost_j_ += taken_j - given;
}

}  // namespace carillon::rigid
