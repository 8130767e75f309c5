// Method: a Hertz pulse of the reduced mass that explains the engine's impulse; where modes would take more than 2 % of the blow, the
// impact is integrated from the motions before it. If the engine's impulse is less than that of rigid bodies with the same motions, the
// forces are scaled by the ratio: the engine knows nothing of the modes' momentum. They are reduced further if the modes would have more
// energy than the blows have given, at the end or at any instant. Simultaneous hits of two bodies, as of both ends of
// a tube, are one impact, together with the contacts on which these bodies rest and with further corners of a face that lands.
// Source: runtime/physics/impact; K. L. Johnson, "Contact mechanics" (1985), eq. 11.24.
#include "runtime/drive/hit_sounds.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <utility>

#include "runtime/base/groups.hpp"
#include "runtime/physics/impact/impact.hpp"
#include "runtime/physics/impact/predict.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::drive {
namespace {

constexpr double kQuietRatio = 0.01;       // relative to the strongest hit of the step: -40 dB
constexpr double kModalShare = 0.02;       // of the blow: below, a Hertz pulse suffices
constexpr double kMinElasticShare = 0.01;  // of the blow: least energy of the modes
constexpr double kMinImpactSpeed = 5e-3;   // m/s; slower hits are not integrated
constexpr double kLongestImpactS = 20e-3;  // s
constexpr double kLongestPulses = 50.0;    // an impact lasts at most this many Hertz times, for the sake of its cost,
// Work of impacts with modes, in integration steps of an impact with one contact:
constexpr double kWorkPerImpact = 200.0;  // mean of an impact; that of max_impacts may be spent at once,
constexpr double kBurstsPerS = 20.0;      // 1/s; and as much again so often;
constexpr double kMaxDebt = 200.0;        // the last impact may exceed it by this
constexpr double kShortestPulses = 3.0;   // Hertz times; minimum length of an impact
constexpr double kRingingShare = 0.01;    // of the speed of approach: impacts on bodies that ring faster are integrated
constexpr int kPulsePieces = 16;          // of a Hertz pulse, for its energy at every instant
constexpr double kRattleShare = 0.1;      // of that speed where bodies rattle: slower hits are part of it
constexpr double kLongestRattleS = 0.1;   // s
constexpr double kFacePartRatio = 0.25;   // of a Hertz time; springs of faces are updated so often

/// Energy of the modes of a body after a pulse of this length on it [J]; impulse: mesh axes.
double calc_modal_j(const impact::Modes& modes, const std::vector<double>& shape, const Vec3& impulse, double length_s) {
  const std::vector<double>& omega = modes.get_omega();
  double sum = 0.0;
  for (std::size_t i = 0; i < omega.size(); ++i) {
    const double given = shape[3 * i] * impulse[0] + shape[3 * i + 1] * impulse[1] + shape[3 * i + 2] * impulse[2];
    sum += 0.5 * given * given * impact::calc_pulse_spectrum(omega[i] * length_s);
  }
  return sum;
}

/// Cost of a step of an impact with so many contacts, relative to one (measured: 1.1 at two, 2.3 at four, 4.3 at eight).
double calc_step_work(std::size_t contacts) { return 0.93 + 0.07 * static_cast<double>(contacts * contacts); }

}  // namespace

double HitSounds::RigidBlow::calc_energy_j() const { return 0.5 * mass_kg * speed_m_s * speed_m_s; }

double HitSounds::RigidBlow::calc_lost_j() const { return calc_energy_j() * std::max(kMinElasticShare, 1.0 - restitution * restitution); }

HitSounds::RigidBlow HitSounds::make_rigid(const FinishedHit& hit) {
  RigidBlow blow{.speed_m_s = std::max(hit.approach_m_s, rigid::kMinImpactSpeedMS)};
  blow.restitution = std::clamp(hit.parting_m_s / blow.speed_m_s, 0.0, 1.0);
  blow.mass_kg = hit.push_n_s / ((1.0 + blow.restitution) * blow.speed_m_s);
  if (blow.mass_kg * hit.inverse_mass > 1.0) {  // the impulse came from elsewhere, or from several points
    blow.mass_kg = 1.0 / hit.inverse_mass;
    blow.speed_m_s = hit.push_n_s * hit.inverse_mass / (1.0 + blow.restitution);
  }
  return blow;
}

HitSounds::Contact HitSounds::make_contact(const StepView& step, const FinishedHit& hit) const {
  Contact c{.hit = hit, .blow = {.a = hit.a, .b = hit.b, .touch_s = hit.touch_s, .masked_s = hit.touch_s}};
  c.rigid = make_rigid(hit);
  double curvature = hit.curvature_per_m;
  if (!(curvature >= 0.0)) curvature = calc_curvatures(step, hit.a, hit.b, hit.stations_m, hit.outwards).calc_sum();
  c.compliance = step.scene.calc_compliance(hit.a, hit.b);
  c.radius_m = step.scene.calc_contact_radius(hit.a, hit.b, curvature);
  for (const std::size_t side : {0, 1}) {
    const int body = side == 0 ? hit.a : hit.b;
    if (body < 0 || !step.bodies[body].shape) continue;
    const TouchBody& b = step.bodies[body];
    geometry::Place& place = c.blow.places[side] = b.shape->find_place(hit.stations_m[side], hit.outwards[side]);
    if (b.modes) c.shapes[side] = bank::calc_shapes(*b.given.bank, place.triangle, place.barycentric);
  }
  c.blow.duration_s = impact::calc_hertz_duration(c.compliance, c.radius_m, c.rigid.mass_kg, c.rigid.speed_m_s);
  c.blow.impulses_n_s = hit.impulses_n_s;
  c.blow.impulse_n_s = norm(hit.impulses_n_s[0]);
  for (const std::size_t side : {0, 1})
    if (!c.shapes[side].empty())
      c.modal_j += calc_modal_j(*step.bodies[side == 0 ? hit.a : hit.b].modes, c.shapes[side], hit.impulses_n_s[side], c.blow.duration_s);
  c.ringing_m_s = calc_ringing(step, c, hit.touch_s, true);
  return c;
}

bool HitSounds::Contact::needs_modes() const {
  const double elastic = 2.0 * rigid.mass_kg * rigid.speed_m_s / hit.push_n_s;
  return (modal_j * elastic * elastic > kModalShare * rigid.calc_energy_j() || ringing_m_s > kRingingShare * rigid.speed_m_s) &&
         rigid.speed_m_s > kMinImpactSpeed && hit.approach_m_s > rigid::kMinImpactSpeedMS;
}

/// Divides the energy lost in a step among the hits of connected bodies, in proportion to that of each as a separate impact.
void HitSounds::share_energy(const StepView& step, std::span<FinishedHit* const> hits) {
  if (hits.empty()) return;
  base::Groups groups(static_cast<int>(step.bodies.size()));
  for (const FinishedHit* hit : hits)
    if (step.moves(hit->a) && step.moves(hit->b)) groups.join(hit->a, hit->b);
  struct Sums {
    double lost_j = 0.0, least_j = 0.0, alone_j = 0.0;
  };
  std::map<int, Sums> sums;  // by group
  const auto find = [&](const FinishedHit& hit) -> Sums& { return sums[groups.find(step.moves(hit.a) ? hit.a : hit.b)]; };
  for (const FinishedHit* hit : hits) {
    if (hit->is_shared) continue;
    Sums& sum = find(*hit);
    sum.lost_j += 0.5 * hit->push_n_s * (hit->approach_m_s - hit->parting_m_s);
    sum.least_j += 0.5 * hit->push_n_s * hit->approach_m_s * kMinElasticShare;
    sum.alone_j += make_rigid(*hit).calc_lost_j();
  }
  for (FinishedHit* hit : hits) {
    if (hit->is_shared) continue;
    const Sums& sum = find(*hit);
    if (sum.alone_j > 0.0) hit->energy_share = std::min(1.0, std::max(sum.lost_j, sum.least_j) / sum.alone_j);
  }
}

void HitSounds::add(const StepView& step, std::vector<FinishedHit>& hits, double open_s, LastingContacts& lasting,
                    TouchesCounters& counters, std::vector<events::Event>& events) {
  join_predicted(step, hits);
  const auto name = [&](int body) { return step.scene.get_matter(body).name_hash; };
  std::vector<FinishedHit*> sorted;
  for (FinishedHit& hit : hits) sorted.push_back(&hit);
  std::stable_sort(sorted.begin(), sorted.end(), [&](const FinishedHit* x, const FinishedHit* y) {
    if (x->is_shared != y->is_shared) return y->is_shared;  // impacts may include shared ones
    if (x->push_n_s != y->push_n_s) return x->push_n_s > y->push_n_s;
    if (x->touch_s != y->touch_s) return x->touch_s < y->touch_s;
    return std::pair(name(x->a), name(x->b)) < std::pair(name(y->a), name(y->b));
  });
  share_energy(step, sorted);
  const double burst = kWorkPerImpact * step.options.max_impacts;
  work_left_ = std::min(burst, work_left_ + burst * kBurstsPerS * (step.scene.time_s - std::exchange(worked_s_, step.scene.time_s)));
  const double oldest_s = step.scene.before_s - 2.0 * step.options.longest_hit_s;
  for (auto* times : {&included_s_, &rattles_s_}) std::erase_if(*times, [&](const auto& spot) { return spot.second < oldest_s; });
  double largest_n_s = 0.0;
  for (const FinishedHit* hit : sorted) largest_n_s = std::max(largest_n_s, hit->push_n_s);
  std::vector<const FinishedHit*> heard;
  for (const FinishedHit* hit : sorted) {
    const Vec3 where = step.place(step.scene.motions, hit->a, hit->stations_m[0]);
    lasting.note_impact(step.scene, hit->a, hit->b, where, step.scene.time_s);
    const bool is_felt = hit->push_n_s * hit->inverse_mass >= 0.2 * rigid::kMinImpactSpeedMS;
    if (is_felt && hit->push_n_s >= kQuietRatio * largest_n_s)
      heard.push_back(hit);
    else
      ++counters.masked;
  }
  taken_.assign(heard.size(), 0);
  const auto is_included = [&](const FinishedHit& hit) {
    const auto found = included_s_.find(hit.spot);
    return hit.is_shared && found != included_s_.end() && hit.opened_s < found->second;
  };
  // Modes hit a position that rattles again and again; an engine knows these hits in part, or not at all.
  for (std::size_t i = 0; i < heard.size(); ++i) {
    if (!is_rattling(heard[i]->spot, heard[i]->touch_s)) continue;
    if (kRattleShare * make_contact(step, *heard[i]).ringing_m_s <= heard[i]->approach_m_s) continue;
    taken_[i] = 1;
    ++counters.masked;
  }
  for (std::size_t first = 0; first < heard.size(); ++first)
    if (taken_[first] == 0 && !is_included(*heard[first])) sound(step, gather(step, heard, first), counters, events);
  for (Ringing& ringing : ringing_) ringing.drop_forces(open_s);
}

void HitSounds::sound(const StepView& step, const std::vector<Contact>& contacts, TouchesCounters& counters,
                      std::vector<events::Event>& events) {
  const auto count = static_cast<int>(contacts.size());
  if (std::any_of(contacts.begin(), contacts.end(), [](const Contact& c) { return c.needs_modes(); })) {
    if (work_left_ > 0.0 && integrate(step, contacts, counters, events)) {
      counters.hits += count;
      for (const Contact& c : contacts)
        for (const int body : {c.hit.a, c.hit.b})
          if (body >= 0) (void)masks_.take(body, c.hit.touch_s, c.blow.impulse_n_s, c.blow.duration_s);
      return;
    }
    if (!(work_left_ > 0.0)) counters.simplified += count;
  }
  for (const Contact& c : contacts) {
    Blow blow = c.blow;
    std::vector<StruckBody> struck;
    if (c.needs_modes() || c.modal_j > c.hit.energy_share * c.rigid.calc_lost_j()) struck = find_struck(step, c);
    const double share = c.hit.energy_share;
    const double scale = limit_further(struck, 1.0, share * c.rigid.calc_energy_j(), share * c.rigid.calc_lost_j());
    if (scale < 1.0) {
      ++counters.limited;
      for (Vec3& impulse : blow.impulses_n_s) impulse = scale * impulse;
      blow.impulse_n_s *= scale;
    }
    if (add_pulses(step.scene, blow, &masks_, events) == 0) {
      ++counters.masked;
      continue;
    }
    ++counters.hits;
    if (struck.empty()) excite(step, c, blow);
    for (StruckBody& body : struck) {
      for (ModalForce& force : body.further) force.scale(scale);
      body.ringing->add(*body.modes, std::move(body.further));
    }
  }
}

/// The bodies of a Hertz pulse with its force on their modes.
std::vector<StruckBody> HitSounds::find_struck(const StepView& step, const Contact& c) {
  std::vector<StruckBody> struck;
  for (const std::size_t side : {0, 1}) {
    if (c.shapes[side].empty()) continue;
    const int body = side == 0 ? c.hit.a : c.hit.b;
    ModalForce force{.start_s = c.blow.touch_s, .step_s = c.blow.duration_s / kPulsePieces, .shape = c.shapes[side], .impulses_n_s = {}};
    double sum = 0.0;
    for (int k = 0; k < kPulsePieces; ++k) {
      const double height = std::pow(std::sin(M_PI * (k + 0.5) / kPulsePieces), 1.5);
      force.impulses_n_s.push_back(height * c.blow.impulses_n_s[side]);
      sum += height;
    }
    force.scale(1.0 / sum);
    struck.push_back({step.bodies[body].modes.get(), &ringing_[static_cast<std::size_t>(body)], {std::move(force)}});
  }
  return struck;
}

/// Sum over the modes of both bodies of their amplitudes at a contact along its normal: speed [m/s], or swing [m].
double HitSounds::calc_ringing(const StepView& step, const Contact& c, double time_s, bool is_speed) const {
  double sum = 0.0;
  for (const std::size_t side : {0, 1}) {
    const int body = side == 0 ? c.hit.a : c.hit.b;
    if (c.shapes[side].empty()) continue;
    const Ringing& ringing = ringing_[static_cast<std::size_t>(body)];
    const ModalState& state = ringing.get_state();
    const std::vector<double>&omega = step.bodies[body].modes->get_omega(), &decay = step.bodies[body].given.bank->decay_per_s;
    const Vec3 normal = turn_back(c.hit.before[side].rotation, c.hit.normal);
    for (std::size_t m = 0; m < state.q.size(); ++m) {
      if (!(omega[m] > 0.0)) continue;
      const double* phi = &c.shapes[side][3 * m];
      sum += std::abs(phi[0] * normal[0] + phi[1] * normal[1] + phi[2] * normal[2]) * std::hypot(state.q[m], state.q_dot[m] / omega[m]) *
             (is_speed ? omega[m] : 1.0) * std::exp(-decay[m] * std::max(0.0, time_s - ringing.get_time_s()));
    }
  }
  return sum;
}

/// Until the surfaces swing less than bodies may sink at a contact after an impact that ends at `time_s`; the swing decays exponentially.
double HitSounds::find_rattle_end(const StepView& step, const Contact& c, double time_s) const {
  const double first = calc_ringing(step, c, time_s, false) / rigid::kMaxDepthM;
  if (!(first > 1.0)) return time_s;
  const double last = calc_ringing(step, c, time_s + kLongestRattleS, false) / rigid::kMaxDepthM;
  return time_s + kLongestRattleS * (last < 1.0 ? std::log(first) / std::log(first / last) : 1.0);
}

/// Adds a pulse to the modal states of its bodies.
void HitSounds::excite(const StepView& step, const Contact& c, const Blow& blow) {
  for (const std::size_t side : {0, 1}) {
    if (c.shapes[side].empty()) continue;
    const int body = side == 0 ? blow.a : blow.b;
    const impact::Modes& modes = *step.bodies[body].modes;
    const std::vector<double>& omega = modes.get_omega();
    ModalState change{.q = std::vector<double>(omega.size()), .q_dot = std::vector<double>(omega.size())};
    const Vec3& impulse = blow.impulses_n_s[side];
    for (std::size_t m = 0; m < omega.size(); ++m) {
      const double* phi = &c.shapes[side][3 * m];
      change.q_dot[m] = (phi[0] * impulse[0] + phi[1] * impulse[1] + phi[2] * impulse[2]) *
                        std::sqrt(impact::calc_pulse_spectrum(omega[m] * blow.duration_s));
    }
    Ringing& ringing = ringing_[static_cast<std::size_t>(body)];
    (void)ringing.move_to(modes, blow.touch_s + 0.5 * blow.duration_s);
    ringing.add({}, change);
  }
}

/// Stores the modal states after an impact that began at `touch_s` with the bodies `before`. Its forces, in `struck`, are scaled by a
/// factor of at most `scale`, so that modes gain at most `most_j`, and `blow_j` while it lasts [J]. Returns the factor.
double HitSounds::keep_ringing(const impact::Impact& impact, std::vector<impact::Body> before, std::vector<StruckBody>& struck,
                               double touch_s, double scale, double blow_j, double most_j) {
  const impact::Books books = impact.get_books();
  const std::vector<impact::Body> after = impact.get_bodies();
  std::vector<ModalState> changes;
  double at_first_j = 0.0, of_forces_j = books.above_band;
  for (std::size_t i = 0; i < after.size(); ++i) {
    ModalState& change = changes.emplace_back();
    const impact::Modes* modes = after[i].modes;
    if (modes == nullptr) continue;
    change = {after[i].q, after[i].q_dot};
    if (!before[i].q.empty()) {
      at_first_j += modes->calc_energy(before[i].q, before[i].q_dot);
      modes->move_freely(before[i].q, before[i].q_dot, impact.get_time());
      for (std::size_t m = 0; m < change.q.size(); ++m) {
        change.q[m] -= before[i].q[m];
        change.q_dot[m] -= before[i].q_dot[m];
      }
    }
    of_forces_j += modes->calc_energy(change.q, change.q_dot);
  }
  const double gain_j = books.modal + books.dissipated_modes + books.above_band - at_first_j;
  if (at_first_j == 0.0) of_forces_j = gain_j;
  // The work on the earlier motion is in proportion to the forces.
  scale = limit_factor(scale, gain_j - of_forces_j, std::max(of_forces_j, 0.0), most_j);
  // During an impact alone, its own books keep the energy below that of the blow.
  if (std::any_of(struck.begin(), struck.end(), [&](const StruckBody& s) { return s.modes && s.ringing->has_later(touch_s); }))
    scale = limit_further(struck, scale, blow_j, most_j);
  for (std::size_t i = 0; i < after.size(); ++i) {
    if (after[i].modes == nullptr) continue;
    StruckBody& body = struck[i];
    for (double& q : changes[i].q) q *= scale;
    for (double& speed : changes[i].q_dot) speed *= scale;
    for (ModalForce& force : body.further) force.scale(scale);
    (void)body.ringing->move_to(*body.modes, touch_s + impact.get_time());
    body.ringing->add(std::move(body.further), changes[i]);
  }
  return scale;
}

/// Normal impulses after which rigid bodies part at all contacts with their restitution [N s]. Projected Gauss-Seidel.
std::vector<double> HitSounds::calc_rigid_pushes(const StepView& step, std::span<const FinishedHit* const> hits) {
  constexpr int kSweeps = 20;
  // Of a hit: levers and spins per impulse of sides a and b; inverse effective mass.
  struct Row {
    std::array<Vec3, 2> turning{}, spinning{};
    double inverse_mass = 0.0;
  };
  std::vector<Row> rows(hits.size());
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const FinishedHit& hit = *hits[i];
    for (const std::size_t side : {0, 1}) {
      const int body = side == 0 ? hit.a : hit.b;
      if (!step.moves(body)) continue;
      const Vec3 along = side == 0 ? hit.normal : -1.0 * hit.normal;
      rows[i].turning[side] = cross(hit.before[side].rotation * (hit.stations_m[side] - step.scene.bodies[body].centre_m), along);
      rows[i].spinning[side] = hit.before[side].inverse_inertia * rows[i].turning[side];
      rows[i].inverse_mass += 1.0 / step.scene.bodies[body].mass_kg + dot(rows[i].turning[side], rows[i].spinning[side]);
    }
  }
  std::vector<double> pushes(hits.size(), 0.0);
  std::array<Vec3, 2> linear{}, angular{};  // changes of the velocities of a and b
  for (int sweep = 0; sweep < (hits.size() > 1 ? kSweeps : 1); ++sweep) {
    for (std::size_t i = 0; i < hits.size(); ++i) {
      const FinishedHit& hit = *hits[i];
      const double e = step.calc_restitution(hit.a, hit.b);
      double missing = (1.0 + e) * std::max(0.0, hit.approach_m_s);
      const Row& row = rows[i];
      for (const std::size_t side : {0, 1})
        missing -= (side == 0 ? 1.0 : -1.0) * dot(linear[side], hit.normal) + dot(angular[side], row.turning[side]);
      const double given = std::max(-pushes[i], missing / row.inverse_mass);
      pushes[i] += given;
      for (const std::size_t side : {0, 1}) {
        const int body = side == 0 ? hit.a : hit.b;
        if (!step.moves(body)) continue;
        linear[side] = linear[side] + (side == 0 ? given : -given) / step.scene.bodies[body].mass_kg * hit.normal;
        angular[side] = angular[side] + given * row.spinning[side];
      }
    }
  }
  return pushes;
}

/// Predicted impulses are of single points. Points of two bodies in a step get the impulses of rigid bodies that are struck there together.
void HitSounds::join_predicted(const StepView& step, std::vector<FinishedHit>& hits) {
  for (std::size_t first = 0; first < hits.size(); ++first) {
    std::vector<FinishedHit*> together;
    bool is_done = false;
    for (std::size_t i = 0; i < hits.size(); ++i) {
      if (!hits[i].is_predicted || hits[i].a != hits[first].a || hits[i].b != hits[first].b) continue;
      is_done = is_done || i < first;
      together.push_back(&hits[i]);
    }
    if (is_done || together.size() < 2) continue;
    const std::vector<double> pushes = calc_rigid_pushes(step, std::vector<const FinishedHit*>(together.begin(), together.end()));
    for (std::size_t i = 0; i < together.size(); ++i) {
      FinishedHit& hit = *together[i];
      const double share = hit.push_n_s > 0.0 ? pushes[i] / hit.push_n_s : 0.0;
      hit.push_n_s *= share;
      for (Vec3& impulse : hit.impulses_n_s) impulse = share * impulse;
    }
  }
}

/// Gives bodies of an impact that began at `touch_s` its forces on their modes. `springs`: contacts with the indices of the bodies.
void HitSounds::add_modal_forces(std::span<const Contact> contacts, std::span<const impact::Contact> springs,
                                 std::span<const impact::Pulse> pulses, double touch_s, std::vector<StruckBody>& struck) {
  for (const impact::Pulse& pulse : pulses) {
    const auto index = static_cast<std::size_t>(pulse.contact);
    const Contact& c = contacts[index];
    for (const std::size_t side : {0, 1}) {
      if (c.shapes[side].empty()) continue;
      ModalForce force{.start_s = touch_s + pulse.start_s, .step_s = pulse.step_s, .shape = c.shapes[side], .impulses_n_s = {}};
      for (const Vec3& impulse : pulse.impulse_n_s)
        force.impulses_n_s.push_back(turn_back(c.hit.before[side].rotation, side == 0 ? impulse : -1.0 * impulse));
      struck[static_cast<std::size_t>(side == 0 ? springs[index].a : springs[index].b)].further.push_back(std::move(force));
    }
  }
}

/// Integrates an impact within the remaining work. `faces`: as its contacts. False: below kShortestPulses; no work remains.
bool HitSounds::advance(impact::Impact& impact, std::span<const impact::FaceCorner> faces, double hertz_s) {
  const double work = calc_step_work(faces.size()), most_s = (work_left_ + kMaxDebt) / work * impact.get_step_length();
  if (most_s < kShortestPulses * hertz_s) {
    work_left_ = 0.0;
    return false;
  }
  const double end_s = std::min({kLongestImpactS, kLongestPulses * hertz_s, most_s});
  const bool has_face = std::count_if(faces.begin(), faces.end(), [](const impact::FaceCorner& c) { return c.is_sharp; }) >= 3;
  const double part_s = has_face ? std::max(kFacePartRatio * hertz_s, impact.get_step_length()) : end_s;
  for (double to_s = part_s; !impact.has_ended() && impact.get_time() < end_s; to_s += part_s) {
    if (has_face) {
      const std::vector<impact::Spring> springs = impact::find_springs(impact, faces, rigid::kMaxDepthM, part_s);
      for (int k = 0; k < std::ssize(faces); ++k)
        if (springs[k] != impact.get_contact(k).spring) impact.exchange_spring(k, springs[k]);
    }
    (void)impact.advance(std::min(to_s, end_s));
  }
  work_left_ -= work * impact.get_steps();
  return true;
}

/// False if it cannot be integrated: nothing is appended.
bool HitSounds::integrate(const StepView& step, const std::vector<Contact>& hits, TouchesCounters& counters,
                          std::vector<events::Event>& events) {
  double hertz_s = 0.0, end_s = 0.0, wanted = 0.0, blow_j = 0.0, most_j = 0.0;
  for (const Contact& c : hits) {
    end_s = std::max(end_s, c.hit.end_s);
    hertz_s = std::max(hertz_s, c.blow.duration_s);
    wanted += c.hit.push_n_s;
    blow_j += c.hit.energy_share * c.rigid.calc_energy_j();
    most_j += c.hit.energy_share * c.rigid.calc_lost_j();
  }
  const Setup setup = set_up(step, hits);
  const double touch_s = setup.touch_s;
  std::optional<impact::Impact> impact;
  try {
    // The engine keeps the bodies apart, and the impulse of the impact must be that of the rigid bodies.
    impact.emplace(setup.bodies, setup.springs, impact::Options{.max_yielded_m = std::numeric_limits<double>::infinity()});
    bool closes = false;
    for (int i = 0; i < std::ssize(setup.springs); ++i) closes = closes || impact->calc_approach(i) > rigid::kMinImpactSpeedMS;
    if (!closes || !advance(*impact, setup.faces, hertz_s)) return false;
  } catch (const std::invalid_argument&) {
    return false;
  }
  const std::vector<impact::Pulse> pulses = impact->take_pulses();
  if (pulses.empty()) return false;
  std::vector<const FinishedHit*> together;
  for (const Contact& c : std::span(setup.contacts).first(setup.struck)) together.push_back(&c.hit);
  const std::vector<double> pushes = calc_rigid_pushes(step, together);
  const double rigid = std::accumulate(pushes.begin(), pushes.end(), 0.0);
  const double largest = rigid > 0.0 ? std::min(1.0, wanted / rigid) : 1.0;
  std::vector<StruckBody> struck;
  for (std::size_t i = 0; i < setup.names.size(); ++i) struck.push_back({setup.bodies[i].modes, &ringing_[setup.names[i]], {}});
  add_modal_forces(setup.contacts, setup.springs, pulses, touch_s, struck);
  const double scale = keep_ringing(*impact, setup.bodies, struck, touch_s, largest, blow_j, most_j);
  if (scale < largest) ++counters.limited;
  counters.impacts += std::ssize(hits);
  for (const Contact& c : std::span(setup.contacts).subspan(setup.struck)) included_s_[c.hit.spot] = end_s;
  for (std::size_t i = 0; i < setup.contacts.size(); ++i) {
    const Contact& c = setup.contacts[i];
    if (c.hit.spot != 0) rattles_s_[c.hit.spot] = find_rattle_end(step, c, touch_s + impact->get_time());
    add_forces(step, c, touch_s, i, pulses, scale, events);
  }
  return true;
}

/// Appends the forces of one contact of an impact that began at `touch_s`.
void HitSounds::add_forces(const StepView& step, const Contact& c, double touch_s, std::size_t contact,
                           std::span<const impact::Pulse> pulses, double scale, std::vector<events::Event>& events) {
  for (const std::size_t side : {0, 1}) {
    const int body = side == 0 ? c.hit.a : c.hit.b;
    if (body < 0 || step.scene.bodies[body].shape == nullptr) continue;
    const double sign = side == 0 ? scale : -scale;
    bool continues = false;
    for (const impact::Pulse& pulse : pulses) {
      if (pulse.contact != static_cast<int>(contact)) continue;
      events::Force first{.time_s = touch_s + pulse.start_s, .step_s = pulse.step_s, .body = body};
      first.other = side == 0 ? c.hit.b : c.hit.a;
      first.triangle = c.blow.places[side].triangle;
      first.barycentric = c.blow.places[side].barycentric;
      first.continues = std::exchange(continues, true);
      std::vector<Vec3> impulses;
      for (const Vec3& impulse : pulse.impulse_n_s) impulses.push_back(turn_back(c.hit.before[side].rotation, sign * impulse));
      events::split_force(first, impulses, [&](const events::Force& force) { events.push_back(force); });
    }
  }
}

}  // namespace carillon::drive
