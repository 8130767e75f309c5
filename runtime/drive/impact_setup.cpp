// Hits that are one impact with modes: its contacts, bodies and springs.
#include <algorithm>
#include <cmath>
#include <utility>

#include "runtime/drive/corners.hpp"
#include "runtime/drive/hit_sounds.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::drive {
namespace {

constexpr double kTogetherPulses = 2.0;   // Hertz times; hits of two bodies that begin within them are one impact
constexpr double kSamePlaceRatio = 0.05;  // of the size
constexpr std::size_t kMaxTogether = 4;   // hits of an impact,
constexpr std::size_t kMaxContacts = 8;   // and contacts, with those of supports: the cost of a step is quadratic in them

/// True at an edge or a corner of one of the bodies.
bool is_sharp(const StepView& step, const FinishedHit& hit) {
  const auto is_at_edge = [&](int body, const Vec3& station) {
    return body >= 0 && step.bodies[body].edges && step.bodies[body].edges->find_near(station).directions > 0;
  };
  return is_at_edge(hit.a, hit.stations_m[0]) || is_at_edge(hit.b, hit.stations_m[1]);
}

std::vector<double> turn_shape(const Mat3& rotation, const std::vector<double>& shape) {
  std::vector<double> turned(shape.size());
  for (std::size_t i = 0; i + 2 < shape.size(); i += 3) {
    const Vec3 x = rotation * Vec3{shape[i], shape[i + 1], shape[i + 2]};
    std::copy(x.begin(), x.end(), turned.begin() + static_cast<std::ptrdiff_t>(i));
  }
  return turned;
}

}  // namespace

/// The hit with the simultaneous ones of its bodies, if any of them needs modes; else the hit alone.
std::vector<HitSounds::Contact> HitSounds::gather(const StepView& step, std::span<const FinishedHit* const> hits, std::size_t first) {
  const FinishedHit& seed = *hits[first];
  std::vector<Contact> alone{make_contact(step, seed)};
  std::vector<std::size_t> chosen{first};
  for (std::size_t i = first + 1; i < hits.size() && chosen.size() < kMaxTogether; ++i) {
    const FinishedHit& hit = *hits[i];
    if (taken_[i] == 0 && hit.a == seed.a && hit.b == seed.b &&
        std::abs(hit.touch_s - seed.touch_s) <= kTogetherPulses * alone.front().blow.duration_s)
      chosen.push_back(i);
  }
  if (chosen.size() == 1) return alone;
  // The earliest has the motions before the impact, and supports, which a shared hit has not.
  std::stable_sort(chosen.begin(), chosen.end(), [&](std::size_t i, std::size_t j) {
    return std::pair(hits[i]->is_shared, hits[i]->opened_s) < std::pair(hits[j]->is_shared, hits[j]->opened_s);
  });
  std::vector<Contact> together;
  for (const std::size_t i : chosen) together.push_back(i == first ? alone.front() : make_contact(step, *hits[i]));
  if (std::none_of(together.begin(), together.end(), [](const Contact& c) { return c.needs_modes(); })) return alone;
  for (const std::size_t i : chosen) taken_[i] = 1;
  return together;
}

/// Body of an impact at touch_s, with the modal state that earlier hits left.
impact::Body HitSounds::make_body(const StepView& step, int index, const Motion& before, bool has_modes, double touch_s) {
  const TouchBody& given = step.bodies[index];
  impact::Body body;
  body.centre_m = before.centre_m;
  if (step.moves(index)) {
    body.mass_kg = step.scene.bodies[index].mass_kg;
    body.inertia_kg_m2 = before.rotation * (given.inertia * transpose(before.rotation));
  }
  body.velocity_m_s = before.velocity_m_s;
  body.spin_rad_s = before.spin_rad_s;
  if (!has_modes) return body;
  body.modes = given.modes.get();
  ModalState state = ringing_[static_cast<std::size_t>(index)].find_without_later(*body.modes, touch_s);
  body.q = std::move(state.q);
  body.q_dot = std::move(state.q_dot);
  return body;
}

/// The contacts of an impact: hits, corners that land with them, and supports, as our own contact strikes supported bodies together with
/// their supports.
HitSounds::Setup HitSounds::choose_contacts(const StepView& step, const std::vector<Contact>& hits) const {
  const FinishedHit& first = hits.front().hit;
  const bool are_sharp = std::all_of(hits.begin(), hits.end(), [&](const Contact& c) { return is_sharp(step, c.hit); });
  std::vector<Corner> corners;
  if (are_sharp) corners = find_corners(step, first, kTogetherPulses * hits.front().blow.duration_s);
  Setup setup;
  setup.made.reserve(hits.size() + corners.size());
  setup.touch_s = first.touch_s;
  for (const Contact& c : hits) setup.touch_s = std::min(setup.touch_s, c.hit.touch_s);
  for (const Contact& c : hits) {
    if (c.hit.opened_s == first.opened_s) {
      setup.contacts.push_back(c);
    } else {  // its own motion before is after the first blow
      FinishedHit& hit = setup.made.emplace_back(c.hit);
      hit.before = first.before;
      hit.approach_m_s = calc_approach_before(step, first, hit.stations_m);
      setup.contacts.push_back(make_contact(step, hit));
    }
    const FinishedHit& hit = setup.contacts.back().hit;
    setup.gaps_m.push_back((hit.touch_s - setup.touch_s) * std::max(hit.approach_m_s, 0.0));
  }
  std::vector<const FinishedHit*> supports;
  for (const FinishedHit& support : first.supports) {
    const auto is_same = [&](const Contact& c) { return c.hit.spot == support.spot; };
    if (hits.size() + supports.size() < kMaxContacts && std::none_of(hits.begin(), hits.end(), is_same)) supports.push_back(&support);
  }
  add_corners(step, first, corners, supports, setup);
  setup.struck = setup.contacts.size();
  for (const FinishedHit* support : supports) {
    setup.contacts.push_back(make_contact(step, *support));
    setup.gaps_m.push_back(0.0);  // closed
  }
  return setup;
}

/// Adds corners without a hit or a support to the hits of a setup, if each hit is at a corner: an engine may stop a landing face at only
/// two of its corners.
void HitSounds::add_corners(const StepView& step, const FinishedHit& first, std::span<const Corner> corners,
                            std::span<const FinishedHit* const> supports, Setup& setup) const {
  const double near_m = kSamePlaceRatio * step.scene.calc_size(first.a, first.b);
  const auto calc_distance = [](const Corner& corner, const FinishedHit& hit) { return norm(corner.stations_m[0] - hit.stations_m[0]); };
  std::vector<double> gaps_m;
  for (const Contact& c : setup.contacts) {
    const auto nearest = std::min_element(corners.begin(), corners.end(), [&](const Corner& x, const Corner& y) {
      return calc_distance(x, c.hit) < calc_distance(y, c.hit);
    });
    if (nearest == corners.end() || !(calc_distance(*nearest, c.hit) < near_m)) return;
    gaps_m.push_back(nearest->gap_m);
  }
  setup.gaps_m = std::move(gaps_m);
  std::vector<const Corner*> added;
  for (const Corner& corner : corners) {
    const auto is_near = [&](const Corner* other) { return norm(corner.stations_m[0] - other->stations_m[0]) < near_m; };
    const auto is_hit = [&](const Contact& c) { return calc_distance(corner, c.hit) < near_m; };
    const auto is_support = [&](const FinishedHit* s) { return s->a == first.a && s->b == first.b && calc_distance(corner, *s) < near_m; };
    if (std::none_of(setup.contacts.begin(), setup.contacts.end(), is_hit) && std::none_of(supports.begin(), supports.end(), is_support) &&
        std::none_of(added.begin(), added.end(), is_near))
      added.push_back(&corner);
  }
  // Part of a face would turn the body; hits beyond kMaxTogether are sounded apart.
  if (setup.contacts.size() >= kMaxTogether || setup.contacts.size() + added.size() + supports.size() > kMaxContacts) return;
  for (const Corner* corner : added) {
    const FinishedHit& hit = setup.made.emplace_back(FinishedHit{.a = first.a,
                                                                 .b = first.b,
                                                                 .touch_s = setup.touch_s,
                                                                 .approach_m_s = corner->approach_m_s,
                                                                 .curvature_per_m = TouchPoint::kUnknown,
                                                                 .normal = first.normal,
                                                                 .stations_m = corner->stations_m,
                                                                 .outwards = first.outwards,
                                                                 .before = first.before});
    setup.contacts.push_back(make_contact(step, hit));
    setup.gaps_m.push_back(corner->gap_m);
  }
}

HitSounds::Setup HitSounds::set_up(const StepView& step, const std::vector<Contact>& hits) {
  Setup setup = choose_contacts(step, hits);
  const auto find_body = [&](const Contact& c, std::size_t side) {
    const int body = side == 0 ? c.hit.a : c.hit.b;
    if (body < 0) return -1;
    const auto found = std::find(setup.names.begin(), setup.names.end(), body);
    if (found != setup.names.end()) return static_cast<int>(found - setup.names.begin());
    setup.names.push_back(body);
    setup.bodies.push_back(make_body(step, body, c.hit.before[side], !c.shapes[side].empty(), setup.touch_s));
    return static_cast<int>(setup.names.size()) - 1;
  };
  setup.shapes.resize(setup.contacts.size());
  for (std::size_t i = 0; i < setup.contacts.size(); ++i) {
    const Contact& c = setup.contacts[i];
    const FinishedHit& hit = c.hit;
    impact::Contact& contact = setup.springs.emplace_back();
    contact.a = find_body(c, 0);
    contact.b = find_body(c, 1);
    contact.where_m = hit.before[0].centre_m + hit.before[0].rotation * (hit.stations_m[0] - step.scene.bodies[hit.a].centre_m);
    contact.normal = hit.normal;
    contact.gap_m = setup.gaps_m[i];
    contact.spring.stiffness = impact::calc_hertz_stiffness(c.compliance, c.radius_m);
    contact.restitution = step.calc_restitution(hit.a, hit.b);
    contact.is_limit = true;
    contact.rests = !(hit.approach_m_s > rigid::kMinImpactSpeedMS);
    contact.friction = step.calc_friction(hit.a, hit.b);
    for (const std::size_t side : {0, 1})
      if (!c.shapes[side].empty()) setup.shapes[i][side] = turn_shape(hit.before[side].rotation, c.shapes[side]);
    contact.shape_a = setup.shapes[i][0];
    contact.shape_b = setup.shapes[i][1];
    setup.faces.push_back({.alone = contact.spring,
                           .is_sharp = is_sharp(step, hit),
                           .where_m = contact.where_m,
                           .normal = hit.normal,
                           .size_m = step.scene.calc_size(hit.a, hit.b),
                           .compliance_per_pa = c.compliance});
  }
  return setup;
}

}  // namespace carillon::drive
