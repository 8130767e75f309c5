// Method: one group through one small step. A touch that lasts is a row of one velocity problem; impulses act at the middle of the step and
//   places follow from the mean of the velocities at its two ends. With the arm from x0 + h v0 / 2 momentum and angular momentum of a free
//   group are conserved to rounding, and a contact that neither slides nor strikes does no work. Rest is proven by a solution with zero
//   velocities.
// Source: J. J. Moreau, "Unilateral contact and dry friction in finite freedom dynamics" (1988), the step with the impulse at its middle.
// Deviations: fast touches end the step at their instant (strike.cpp).
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>

#include "runtime/rigid/limits.hpp"
#include "runtime/rigid/space.hpp"

namespace carillon::rigid {
namespace {

constexpr double kShortest = 1e-9;                           // s; what is left of a step and shorter than this is not made
constexpr double kDrilling = 3.0 * std::numbers::pi / 16.0;  // of friction times patch radius: arm of the couple against drilling
constexpr double kSettling = 0.02;                           // m/s; a group that is slower is about to rest
constexpr double kAtRest = 1e-6;                             // m/s
constexpr std::size_t kMaxDirect = 24;                       // points of a small group
constexpr std::size_t kTurns = 16;                           // points that take turns by their pairs
constexpr int kMaxAtOnce = 12;                               // bodies that are about to rest and are factorised without sweeps before
constexpr double kLoose = 1000.0;                            // times the tolerance
constexpr double kLooseOfSpeed = 1e-3;                       // of the fastest of its bodies, where that is more,
constexpr double kLoosest = 0.3 * kSlowest;                  // and no more than this: what stands must not strike
constexpr int kGuesses = 6;                                  // of a factorised problem in a step
constexpr double kRetry = 4e-3;                              // s; a group whose guesses failed goes by sweeps for so long,
constexpr double kRetrySmall = 1e-3;                         // s; a small one for so long
constexpr int kMaxMissed = 30;                               // in a step: instants at which nothing struck after all
constexpr int kMaxImpacts = 4;                               // of a group in a step, each at its instant; a group with more is crowded
constexpr int kMinImpacts = 2;                               // the same of the largest groups, each of whose impacts costs more
constexpr int kStruckBodies = 48;                            // bodies of a group times its impacts in a step
constexpr double kCrowded = 2e-3;                            // s; for so long after

}  // namespace

void Space::step_island(Island& island, double start_s, double step_s) {
  for (std::size_t n = 0; n < island.bodies.size(); ++n) index_[static_cast<std::size_t>(island.bodies[n])] = static_cast<int>(n);
  stepped_ = &island.bodies;
  double done = 0.0;
  int impacts = 0, missed = 0;
  bool begun = false;
  const double g = norm(gravity_);
  const bool is_crowded = std::any_of(island.bodies.begin(), island.bodies.end(),
                                      [&](int body) { return paces_[static_cast<std::size_t>(body)].crowded_until_s > start_s; });
  const int max_impacts = std::clamp(kStruckBodies / static_cast<int>(island.bodies.size()), kMinImpacts, kMaxImpacts);
  if (is_crowded) {
    strike_at_once(island, start_s, step_s);
    impacts = max_impacts;
  }
  while (step_s - done > kShortest) {
    const double h = step_s - done;
    time_s_ = start_s + done;
    if (!std::exchange(begun, true) && may_rest(island, h) && rest(island, h) != Rest::none) break;
    release_what_rests(island);
    predict(island, h, false);
    make_points(island, h, impacts < max_impacts);
    const double tolerance = options_.tolerance * std::max(g, 1.0) * h;
    const double energy_before = calc_energy(island);
    solve(tolerance);
    sum_turned();
    push_linked(island);
    double at = h;
    std::vector<Ref> first;
    together_s_ = kTogether;
    const bool struck = impacts < max_impacts && find_impact(island, h, at, first);
    keep_impulses(at, h);
    for (Pair* pair : island.pairs) pair->travelled_m += (calc_pair_speed(pair->a, pair->b) + g * h) * at + 1e-12;
    move_bodies(island, start_s + done + at, at, h, energy_before);
    done += at;
    if (struck) {
      time_s_ = start_s + done;
      for (Pair* pair : island.pairs)
        if (!pair->contacts.empty()) refresh(*pair);
      if (confirm_impact(first, step_s - done, kDeep * (1 + missed))) {
        strike(island, first, time_s_);
        ++costs_.impacts;
        if (++impacts == max_impacts) note_crowd(island, start_s + step_s);
      } else if (++missed > kMaxMissed) {
        impacts = max_impacts;
      }
    }
    if (step_s - done > kShortest)
      for (Pair* pair : island.pairs) update(*pair, step_s - done);
  }
  for (const int body : island.bodies) index_[static_cast<std::size_t>(body)] = -1;
}

void Space::note_crowd(const Island& island, double time_s) {
  for (const int body : island.bodies) paces_[static_cast<std::size_t>(body)].crowded_until_s = time_s + kCrowded;
}

/// The impacts of a crowded group: all touches that close within a step strike at its beginning.
void Space::strike_at_once(Island& island, double start_s, double step_s) {
  time_s_ = start_s;
  together_s_ = step_s;
  std::vector<Ref> first;
  for (Pair* pair : island.pairs)
    for (std::size_t k = 0; k < pair->contacts.size() && is_stepped(*pair); ++k)
      if (is_fast(pair->contacts[k], step_s) && calc_approach(pair->contacts[k]) > 0.0) first.push_back({pair, k});
  if (!confirm_impact(first, step_s, std::numeric_limits<double>::infinity())) return;
  if (first.front().pair != first.back().pair) note_crowd(island, start_s + step_s);
  strike(island, first, time_s_);
  ++costs_.impacts;
}

/// What every body of the group does without contacts; `at_rest`: as if it had no velocity.
void Space::predict(const Island& island, double h, bool at_rest) {
  movers_.resize(island.bodies.size());
  free_spin_.resize(island.bodies.size());
  free_.resize(island.bodies.size());
  free_state_.resize(island.bodies.size());
  free_centre_.resize(island.bodies.size());
  free_velocity_.resize(island.bodies.size());
  for_linked(island, [&](Linked& linked) { predict_linked(linked, h, at_rest); });
  for (std::size_t n = 0; n < island.bodies.size(); ++n) {
    const auto i = static_cast<std::size_t>(island.bodies[n]);
    if (find_linked(island.bodies[n]) != nullptr) continue;
    State from = states_[i];
    if (at_rest) from.velocity = from.momentum = {};
    const State to = fly(solids_[i], from, gravity_, h);
    const Placed there = place(solids_[i], to);
    movers_[n] = {1.0 / solids_[i].mass_kg, there.inverse_inertia, to.velocity, there.spin};
    free_spin_[n] = there.spin;
    free_[n] = there;
    free_state_[n] = to;
    free_centre_[n] = to.centre;
  }
  add_loads(island, h);
}

/// A contact as it is now, between the bodies of the group that is being stepped.
Point Space::make_point(const Contact& c) const {
  Point p;
  p.a = find_index(c.a);
  p.b = find_index(c.b);
  p.normal = c.touch.normal;
  if (p.a >= 0) p.arm_a = c.touch.where_m - states_[static_cast<std::size_t>(c.a)].centre;
  if (p.b >= 0) p.arm_b = c.touch.where_m - states_[static_cast<std::size_t>(c.b)].centre;
  p.friction = c.cord >= 0 ? 0.0 : calc_pair_friction(c.a, c.b);
  return p;
}

/// Of the Hertz contact under the load of the last step [m]; 0 without.
double Space::calc_patch_radius(const Contact& c) const {
  const double push = c.step_s > 0.0 ? dot(c.impulse, c.touch.normal) / c.step_s : 0.0;
  if (!(push > 0.0)) return 0.0;
  return impact::calc_patch_radius(push, calc_contact_radius(c.touch, c.a, c.b), calc_compliance(c.a, c.b));
}

/// Where a smooth touch will be at the end of the step, contacts apart.
Vec3 Space::calc_travelled(Pair& pair, shape::Touch touch) const {
  const auto get_frame = [&](int body) {
    if (body < 0) return shape::Frame{};
    const int n = find_index(body);
    return n >= 0 ? free_[static_cast<std::size_t>(n)].frame : placed_[static_cast<std::size_t>(body)].frame;
  };
  shape::refresh(touch, *solid(pair.a).shape, get_frame(pair.a), get_shape(pair.b), get_frame(pair.b), pair.memory);
  return touch.where_m;
}

/// A touch that lasts, as a row of the step.
Point Space::make_lasting_point(Pair& pair, const Contact& c, double h) const {
  const shape::Touch& t = c.touch;
  const double approach = calc_approach(c);
  Point p = make_point(c);
  // The touch of a curved surface travels over it: where it will be.
  const Vec3 later = t.smooth ? calc_travelled(pair, t) : Vec3{};
  // Where the impulse acts: half a step on, the same point for both bodies.
  struct Side {
    Vec3 middle{}, first{}, last{};  // centre half a step on; arms at both ends
    Vec3 centre{};                   // from which the impulse has its arm
    bool linked = false;
  };
  const auto make_side = [&](int body, int index) {
    const auto i = static_cast<std::size_t>(body), n = static_cast<std::size_t>(index);
    Side side;
    side.middle = states_[i].centre + (0.5 * h) * states_[i].velocity;
    side.centre = side.middle;
    side.linked = movers_[n].linkage != nullptr;
    if (side.linked) {
      side.middle = 0.5 * (states_[i].centre + free_centre_[n]);
      side.centre = free_centre_[n];
    }
    side.first = t.where_m - states_[i].centre;
    side.last = t.smooth ? later - free_centre_[n] : free_[n].rotation * (transpose(placed_[i].rotation) * side.first);
    return side;
  };
  Vec3 where{};
  Side sa, sb;
  if (p.a >= 0) sa = make_side(c.a, p.a), where = sa.middle + 0.5 * (sa.first + sa.last);
  if (p.b >= 0) {
    sb = make_side(c.b, p.b);
    const Vec3 other = sb.middle + 0.5 * (sb.first + sb.last);
    where = p.a >= 0 ? 0.5 * (where + other) : other;
  }
  // What the arms turn beyond that point until the end of the step belongs to the velocity there.
  Vec3 beyond{};
  if (p.a >= 0) {
    p.arm_a = where - sa.centre;
    beyond = beyond + cross(free_spin_[static_cast<std::size_t>(p.a)], sa.linked ? sa.last - p.arm_a : 0.5 * (sa.last - sa.first));
  }
  if (p.b >= 0) {
    p.arm_b = where - sb.centre;
    beyond = beyond - cross(free_spin_[static_cast<std::size_t>(p.b)], sb.linked ? sb.last - p.arm_b : 0.5 * (sb.last - sb.first));
  }
  // What touches and is at rest stays so exactly: a picometre is no gap, and would be a force.
  const bool rests = t.gap_m <= kTouch && c.touching && std::abs(approach) < kAtRest;
  // What is too deep and parts may come back to where it is now: a push that ends its parting would do work.
  const double free_way = t.gap_m < -kDeep ? 0.0 : t.gap_m;
  double speed = rests ? 0.0 : std::min(0.0, approach - 2.0 * free_way / h);
  // What is too deep comes up, at half the power that the contact loses, so that no energy comes of it.
  if (t.gap_m < -kDeep) {
    const double push = dot(c.impulse, t.normal), paid = push > 0.0 ? 0.5 * c.lost_j / push : 0.0;
    const double up = std::min(0.02 * (-kDeep - t.gap_m) / h, t.gap_m < -kFarTooDeep - pair.sag_m ? 0.005 : paid);
    if (approach > -up) speed = up;
  }
  p.wanted = speed * t.normal - beyond;
  const double curvature = t.curvature_a_per_m + t.curvature_b_per_m;
  if (t.smooth && curvature > 0.0) {
    p.rolling_m = options_.rolling_resistance / std::max(curvature, t.steepest_per_m);
    p.twisting_m = kDrilling * p.friction * calc_patch_radius(c);
  }
  p.impulse = (c.step_s > 0.0 ? h / c.step_s : 0.0) * c.impulse;
  if (c.is_load) p.impulse = p.impulse - h * c.rest_n;
  p.couple = (c.step_s > 0.0 ? h / c.step_s : 0.0) * c.couple;
  return p;
}

void Space::make_points(Island& island, double h, bool leaves_impacts) {
  points_.clear();
  rows_.clear();
  for (Pair* pair : island.pairs) {
    if (!is_stepped(*pair)) continue;
    for (std::size_t k = 0; k < pair->contacts.size(); ++k) {
      Contact& c = pair->contacts[k];
      const shape::Touch& t = c.touch;
      const double approach = calc_approach(c);
      if (c.presses || (leaves_impacts && is_fast(c, h))) continue;
      // The impact has these bodies; what stands still and rings continues to carry others.
      if (c.cord < 0 && (has_impact(pair->a) || has_impact(pair->b))) continue;
      if (t.gap_m > kTouch + 2.0 * h * std::max(approach, 0.0) + 4.0 * norm(gravity_) * h * h && !c.touching) continue;
      const Point p = c.cord >= 0 ? make_cord_point(c, h) : make_lasting_point(*pair, c, h);
      points_.push_back(p);
      rows_.push_back({pair, k});
    }
  }
  sort_points();
}

/// From below to above, so that a sweep carries the weight down a pile. Of each kTurns points in that order those that are the first of
/// their pairs come first, then the second ones, and so on: sweeps over such an order need a tenth fewer.
void Space::sort_points() {
  const std::size_t count = points_.size();
  std::vector<double> heights;
  heights.reserve(count);
  for (const Ref& row : rows_) heights.push_back(-dot(row.get().touch.where_m, gravity_));
  order_.resize(count);
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  std::stable_sort(order_.begin(), order_.end(), [&](std::size_t x, std::size_t y) { return heights[x] < heights[y]; });
  std::array<const Pair*, kTurns> pairs;
  std::array<std::size_t, kTurns> sorted;
  std::array<int, kTurns> turns;  // of each point among those of its pair
  for (std::size_t begin = 0; begin < count; begin += kTurns) {
    const std::size_t size = std::min(kTurns, count - begin);
    int last = 0;
    for (std::size_t n = 0; n < size; ++n) {
      sorted[n] = order_[begin + n];
      pairs[n] = rows_[sorted[n]].pair;
      turns[n] = static_cast<int>(std::count(pairs.begin(), pairs.begin() + n, pairs[n]));
      last = std::max(last, turns[n]);
    }
    std::size_t at = begin;
    for (int turn = 0; turn <= last; ++turn)
      for (std::size_t n = 0; n < size; ++n)
        if (turns[n] == turn) order_[at++] = sorted[n];
  }
  std::vector<Point> points;
  std::vector<Ref> rows;
  points.reserve(count);
  rows.reserve(count);
  for (const std::size_t n : order_) points.push_back(points_[n]), rows.push_back(rows_[n]);
  points_.swap(points);
  rows_.swap(rows);
}

/// Small groups at once; large ones in sweeps, which begin at the impulses of the step before.
void Space::solve(double tolerance_m_s) {
  ++costs_.solves;
  if (points_.empty()) return;
  const std::vector<Mover> free = movers_;
  const std::vector<Point> begun = points_;
  // Contacts take energy from the motion without them, or none.
  const auto gains = [&] {
    double gained = 0.0, size = 0.0;
    for (const Point& p : points_) {
      const double work = 0.5 * dot(p.impulse, calc_relative_velocity(free, p) + calc_relative_velocity(movers_, p));
      gained += work;
      size += std::abs(work);
    }
    return gained > 1e-9 * size;
  };
  double fastest = 0.0;
  for (std::size_t n = 0; n < stepped_->size(); ++n) {
    const auto i = static_cast<std::size_t>((*stepped_)[n]);
    fastest = std::max(fastest, norm(states_[i].velocity) + norm(placed_[i].spin) * solids_[i].radius_m);
  }
  const int count = static_cast<int>(movers_.size());
  const bool settles = fastest < kSettling;
  const bool is_small = count <= options_.max_direct && points_.size() <= kMaxDirect;
  const bool rolls = std::any_of(points_.begin(), points_.end(), [](const Point& p) { return p.rolling_m > 0.0; });
  const auto factorise = [&](bool are_swept) {
    if (solver_.solve_directly(movers_, points_, is_small ? kMaxGuesses : kGuesses, are_swept) && !gains()) return true;
    // What rolls keeps its energy better that way, even where a guess fails now and then.
    const double pause_s = !is_small ? kRetry : rolls ? 0.0 : kRetrySmall;
    for (const int body : *stepped_) paces_[static_cast<std::size_t>(body)].next_guess_s = time_s_ + pause_s;
    return false;
  };
  const auto sweep = [&](int max) {
    const bool is_loose = !settles && !is_small;  // what moves fast needs less than what is about to stand still
    const double tolerance = is_loose ? std::max(kLoose * tolerance_m_s, std::min(kLooseOfSpeed * fastest, kLoosest)) : tolerance_m_s,
                 left = solver_.solve(movers_, points_, tolerance, max);
    costs_.sweeps += solver_.get_sweeps();
    return left <= tolerance && !gains();
  };
  const bool may_guess = std::all_of(stepped_->begin(), stepped_->end(),
                                     [&](int body) { return time_s_ >= paces_[static_cast<std::size_t>(body)].next_guess_s; });
  const bool at_once = is_small || (settles && count <= kMaxAtOnce);
  if (at_once && may_guess) {
    // What slid in the last step is guessed to slide; what rolls is guessed again.
    if (factorise(is_small && !rolls)) return;
    movers_ = free;
    points_ = begun;
  }
  if (sweep(options_.max_sweeps)) return;
  if (!at_once && may_guess && settles && count <= options_.max_settling) {
    // From the guess that the sweeps have made; they would let a pile tremble for long.
    const std::vector<Point> swept = points_;
    movers_ = free;
    if (factorise(true)) return;
    movers_ = free;
    points_ = swept;
    sweep(2);
  }
  if (!gains()) return;
  // Sweeps that begin at zero impulses never add any.
  movers_ = free;
  points_ = begun;
  for (Point& p : points_) p.impulse = p.couple = {};
  sweep(options_.max_sweeps);
}

/// The angular impulses of all points on each body.
void Space::sum_turned() {
  turned_.assign(movers_.size(), Vec3{});
  for (std::size_t n = 0; n < loads_.size(); ++n) turned_[n] = loads_[n].angular;
  for (const Point& p : points_) {
    if (p.a >= 0) turned_[static_cast<std::size_t>(p.a)] = turned_[static_cast<std::size_t>(p.a)] + cross(p.arm_a, p.impulse) + p.couple;
    if (p.b >= 0) turned_[static_cast<std::size_t>(p.b)] = turned_[static_cast<std::size_t>(p.b)] - cross(p.arm_b, p.impulse) - p.couple;
  }
}

/// The nth body of the group, a part of the step on: what the contacts gave it acts all along.
State Space::calc_moved(std::size_t n, double part_s, double step_s) const {
  const auto i = static_cast<std::size_t>((*stepped_)[n]);
  if (const Linked* linked = find_linked((*stepped_)[n]); linked != nullptr) {
    std::vector<joints::Motion> motions;
    linked->mechanism->find_motions(calc_linked_moved(*linked, part_s, step_s), motions);
    return make_state(solids_[i], motions[static_cast<std::size_t>(movers_[n].member)]);
  }
  State to = part_s == step_s ? free_state_[n] : fly(solids_[i], states_[i], gravity_, part_s);
  const Vec3 gained = (1.0 / step_s) * (movers_[n].velocity - (states_[i].velocity + step_s * gravity_));
  to.velocity = to.velocity + part_s * gained;
  to.centre = to.centre + (0.5 * part_s * part_s) * gained;
  const Vec3 spun = movers_[n].spin - free_spin_[n];
  to.rotation = normalise(multiply(make_turn((0.5 * part_s * part_s / step_s) * spun), to.rotation));
  // The impulses act at the middle of the part: there the centre is less far than where their arms begin.
  const Vec3 late = cross((0.5 * (step_s - part_s)) * states_[i].velocity, (solids_[i].mass_kg * step_s) * gained);
  to.momentum = to.momentum + (part_s / step_s) * (turned_[n] + late);
  return to;
}

/// What a point took from the motion in the first part of a step [J]: its impulses times the means of the velocities before and after.
double Space::calc_loss(const Point& p, double part) const {
  Vec3 u = part * calc_relative_velocity(movers_, p), w = part * calc_relative_spin(movers_, p);
  const auto add = [&](int index, const Vec3& arm, double sign) {
    if (index < 0) return;
    const auto i = static_cast<std::size_t>((*stepped_)[static_cast<std::size_t>(index)]);
    if (movers_[static_cast<std::size_t>(index)].linkage != nullptr) {
      // The arm is from where the centre is at the end.
      const Vec3 moved = 0.5 * (free_centre_[static_cast<std::size_t>(index)] - states_[i].centre);
      u = u + ((2.0 - part) * sign) * cross(placed_[i].spin, moved);
    }
    u = u + ((2.0 - part) * sign) * (states_[i].velocity + cross(placed_[i].spin, arm));
    w = w + ((2.0 - part) * sign) * placed_[i].spin;
  };
  add(p.a, p.arm_a, 1.0);
  add(p.b, p.arm_b, -1.0);
  return -0.5 * part * (dot(p.impulse, u) + dot(p.couple, w));
}

/// Writes the impulses of a step into its contacts; `at_s` of it is made.
void Space::keep_impulses(double at_s, double h) {
  for (std::size_t n = 0; n < points_.size(); ++n) {
    Contact& c = rows_[n].get();
    c.impulse = points_[n].impulse;
    if (c.is_load) c.impulse = c.impulse + h * c.rest_n;
    c.couple = points_[n].couple;
    c.step_s = h;
    c.until_s = time_s_ + at_s;
    c.lost_j = calc_loss(points_[n], 1.0);
    lost_j_ += at_s < h ? calc_loss(points_[n], at_s / h) : c.lost_j;
    c.touching = dot(c.impulse, c.touch.normal) > 0.0 || (c.touching && c.touch.gap_m <= kTouch);
  }
}

/// Takes the bodies of a group through the part of a step that is made.
void Space::move_bodies(const Island& island, double to_s, double part_s, double h, double before_j) {
  bool rings = false;
  std::vector<State> moved;
  std::vector<char> is_ringing;  // one that ends in this part has been moved by it, too
  double loads_j = 0.0;          // done by what sleeps on them
  for (std::size_t n = 0; n < island.bodies.size(); ++n) {
    is_ringing.push_back(has_impact(island.bodies[n]) ? 1 : 0);
    rings = rings || is_ringing.back() != 0;
    moved.push_back(movers_[n].linkage == nullptr ? calc_moved(n, part_s, h) : State{});
    if (is_ringing.back() == 0 && movers_[n].linkage == nullptr) loads_j += calc_load_work(n, moved.back(), part_s, h);
  }
  lost_j_ -= loads_j;  // what lies on them does not fall as they do: until it wakes, within kDeep, this energy comes from nowhere
  std::vector<Linked*> flown;
  for_linked(island, [&](Linked& linked) {
    if (linked.ringing < 0) flown.push_back(&linked);
  });
  if (rings) advance_ringings(island, to_s, part_s, h);
  for (Linked* linked : flown) {
    linked->now = calc_linked_moved(*linked, part_s, h);
    place_linked(*linked);
  }
  for (std::size_t n = 0; n < island.bodies.size(); ++n) {
    const int body = island.bodies[n];
    if (movers_[n].linkage != nullptr) continue;
    if (!is_ringing[n]) states_[static_cast<std::size_t>(body)] = moved[n];
    check_finite(body);
    place_body(body);
  }
  if (!rings) take_gain(island, before_j + loads_j);
}

/// Kinetic and of gravity [J].
double Space::calc_energy(const Island& island) const {
  double sum = 0.0;
  for (const int body : island.bodies) {
    const auto i = static_cast<std::size_t>(body);
    sum += rigid::calc_kinetic(solids_[i], states_[i], placed_[i]) - solids_[i].mass_kg * dot(gravity_, states_[i].centre);
  }
  return sum;
}

/// Contacts do no work on a group, but for rounding, for what comes up from too deep and for surfaces whose curvature changes within a
/// step. What the group gained by that its motion pays back, where it touches what does not move (a free group would lose momentum).
void Space::take_gain(const Island& island, double before_j) {
  const double gained = calc_energy(island) - before_j;
  if (!(gained > 0.0)) return;
  if (std::all_of(rows_.begin(), rows_.end(), [&](const Ref& row) { return moves(row.pair->a) && moves(row.pair->b); })) return;
  double kinetic = 0.0;
  for (const int body : island.bodies) {
    const auto i = static_cast<std::size_t>(body);
    kinetic += rigid::calc_kinetic(solids_[i], states_[i], placed_[i]);
  }
  lost_j_ += std::min(gained, kinetic);
  const double part = kinetic > gained ? std::sqrt(1.0 - gained / kinetic) : 0.0;
  for_linked(island, [&](Linked& linked) {
    for (double& u : linked.now.u) u *= part;
    place_linked(linked);
  });
  for (const int body : island.bodies) {
    if (find_linked(body) != nullptr) continue;
    State& s = states_[static_cast<std::size_t>(body)];
    s.velocity = part * s.velocity;
    s.momentum = part * s.momentum;
    place_body(body);
  }
}

}  // namespace carillon::rigid
