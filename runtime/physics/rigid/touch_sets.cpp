// Method: search with a margin of several steps' movement; touches are followed until their pair may have moved by the margin.
// Source: runtime/physics/geometry/touch.hpp.
#include "runtime/physics/rigid/touch_sets.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

#include "runtime/physics/rigid/cords.hpp"
#include "runtime/physics/rigid/limits.hpp"
#include "runtime/physics/rigid/modal_impact.hpp"

namespace carillon::rigid {
namespace {

constexpr double kMarginSteps = 4.0;         // steps of movement in the margin of a search,
constexpr double kRollingMarginSteps = 8.0;  // the same for curved bodies on the ground, where few points come near
constexpr double kMaxLookAheadS = 4e-3;      // s; maximum look-ahead of these
constexpr double kSearchIntervalS = 2e-3;    // s; interval of searches for missing touches of a pair
constexpr double kSameTouchRatio = 0.02;     // fraction of the size: maximum distance of identical touches
constexpr double kMergeRatio = 1e-4;         // fraction of the size: maximum distance of merged touches
constexpr double kFarJumpRatio = 0.25;       // relative to the size: a touch that moves farther within a step is a different one
constexpr double kJumpRad = 0.2;             // rad; rotation of the normal in the body by which a touch has jumped
constexpr double kSagDecayS = 10e-3;         // s
constexpr double kMinMissingSpeedMS = 0.1;   // m/s; slower polyhedra miss touches by less than the margin of a search
constexpr int kMaxAdded = 4;                 // missing touches added at the end of a flight
constexpr double kDeepRatio = 0.1;           // fraction of the thickness: bodies with deeper penetration are searched apart

/// Lower bound of the gap of any vertex of a body over the ground, from that at an earlier frame.
double calc_least_gap(const Pair& pair, const geometry::Shape& shape, const geometry::Frame& now) {
  const Vec3 &middle = shape.get_middle_m(), turned = now.rotation[2] - pair.measured.rotation[2];
  const double moved = now.position_m[2] - pair.measured.position_m[2] + dot(turned, middle);
  return pair.lowest_m + moved - norm(turned) * shape.get_radius_m();
}

geometry::Frame move(geometry::Frame frame, const Vec3& by) {
  frame.position_m = frame.position_m + by;
  return frame;
}

geometry::Touch move(geometry::Touch touch, const Vec3& by) {
  touch.gap_m += dot(touch.normal, by);
  touch.where_m = touch.where_m + by;
  return touch;
}

}  // namespace

TouchSets::TouchSets(const Bodies& bodies, std::vector<Cord> cords, const ModalImpacts& impacts, Ledger& ledger)
    : bodies_(bodies), impacts_(impacts), ledger_(ledger), cords_(std::move(cords)), cord_pairs_(cords_.size()) {
  for (int n = 0; Pair & pair : cord_pairs_) {
    pair.a = cords_[n].a;
    pair.b = cords_[n].b;
    pair.cord = n++;
    refresh(pair);
  }
}

Pair& TouchSets::get(int a, int b) {
  Pair& pair = pairs_[{a, b}];
  pair.a = a;
  pair.b = b;
  return pair;
}

void TouchSets::forget_far(std::int64_t window) {
  for (auto at = pairs_.begin(); at != pairs_.end();) {
    Pair& pair = at->second;
    const bool is_far = pair.window != window && (bodies_.moves(pair.a) || bodies_.moves(pair.b));
    if (is_far) lose_all(pair);
    at = is_far ? pairs_.erase(at) : std::next(at);
  }
}

void TouchSets::forget(int body) {
  for (auto& [key, pair] : pairs_)
    if (key.first == body || key.second == body) lose_all(pair);
  std::erase_if(pairs_, [&](const auto& entry) { return entry.first.first == body || entry.first.second == body; });
}

void TouchSets::search(Pair& pair, double step_s, double least_m_s) {
  if (pair.cord >= 0) return refresh(pair);
  ++ledger_.costs.searches;
  const double speed = std::max(bodies_.calc_closing_speed(pair.a, pair.b), least_m_s) + norm(bodies_.gravity()) * step_s;
  const double ahead_s =
      pair.b < 0 && !bodies_.is_flat(pair.a) ? std::min(kRollingMarginSteps * step_s, kMaxLookAheadS) : kMarginSteps * step_s;
  pair.margin_m = std::min(std::max(2e-4, ahead_s * speed), kSearchRangeRatio * bodies_.calc_size(pair.a, pair.b));
  const double margin_m = pair.margin_m + bodies_.get_swing(pair.a) + bodies_.get_swing(pair.b);
  pair.travelled_m = 0.0;
  pair.searched = true;
  const std::vector<Contact> old = std::exchange(pair.contacts, {});
  pair.ahead.touches.clear();
  for (geometry::Touch& last : pair.memory.last) {  // ids follow touches along their path
    const auto at = std::find_if(old.begin(), old.end(), [&](const Contact& c) { return c.touch.id == last.id; });
    if (at != old.end()) last = move(at->touch, pair.apart_m);
  }
  found_.clear();
  const geometry::Shape& a = *bodies_.get_shape(pair.a);
  const geometry::Frame frame_a = bodies_.get_frame(pair.a);
  if (pair.b < 0)
    geometry::find_ground_touches(a, frame_a, bodies_.ground()->height_m, margin_m, pair.memory, found_,
                                  bodies_.is_moved_by_impact(pair.a) || bodies_.get_swing(pair.a) > kMaxDepthM);
  else
    geometry::find_touches(a, move(frame_a, pair.apart_m), *bodies_.get_shape(pair.b), bodies_.get_frame(pair.b), margin_m, pair.memory,
                           found_);
  for (geometry::Touch& touch : found_) {
    if (pair.apart_m != Vec3{}) touch = move(touch, -1.0 * pair.apart_m);
    const auto same = std::find_if(old.begin(), old.end(), [&](const Contact& c) { return c.touch.id == touch.id; });
    Contact contact;
    if (same != old.end()) {
      contact = *same;
      if (is_jump(pair, same->touch, touch)) contact.touching = false;  // its id has moved to another point, which may strike
    } else {
      contact.a = pair.a;
      contact.b = pair.b;
      contact.presses = impacts_.is_pressed(pair, touch.where_m);
    }
    contact.touch = touch;
    pair.contacts.push_back(contact);
  }
  const bool is_complete = pair.b >= 0 && bodies_.is_flat(pair.a) && bodies_.is_flat(pair.b);  // of polyhedra
  if (!is_complete) keep_lost(pair, old);
  remove_false(pair);
  if (!is_complete) complete(pair, frame_a, bodies_.get_frame(pair.b), 0.0);
}

/// Keeps touches that a search has lost. Between two bodies: those that touched and are within kDeepM. With the ground: closed load-bearing
/// ones, closed corners, and any deeper than all found.
void TouchSets::keep_lost(Pair& pair, const std::vector<Contact>& old) const {
  const geometry::Frame a = bodies_.get_frame(pair.a), b = bodies_.get_frame(pair.b);
  double least_m = pair.margin_m;
  for (const Contact& c : pair.contacts) least_m = std::min(least_m, c.touch.gap_m);
  const double near_m = kSameTouchRatio * bodies_.calc_size(pair.a, pair.b);
  const auto is_between = [&](const geometry::Touch& touch) {  // between two closed ones, which bear the load without it
    for (const geometry::Touch& f : found_)
      for (const geometry::Touch& g : found_)
        if (std::max(f.gap_m, g.gap_m) <= kTouchGapM && dot(f.where_m - touch.where_m, g.where_m - touch.where_m) < 0.0) return true;
    return false;
  };
  for (const Contact& c : old) {
    if (pair.b >= 0 && !c.touching) continue;
    geometry::Touch touch = c.touch;
    if (!follow(pair, touch, a, b)) continue;
    const auto found = std::find_if(pair.contacts.begin(), pair.contacts.end(), [&](const Contact& other) {
      return other.touch.id == touch.id || norm(other.touch.where_m - touch.where_m) < near_m;
    });
    const bool carries = pair.b < 0 && c.touching && dot(c.impulse, c.touch.normal) > 0.0 && !is_between(touch);
    const double most_m = pair.b >= 0                ? kDeepM
                          : touch.smooth && !carries ? least_m - kMissingDepthM
                                                     : std::max(least_m - kMissingDepthM, kTouchGapM);
    if (touch.gap_m > most_m) continue;
    if (found == pair.contacts.end())
      pair.contacts.emplace_back(c).touch = touch;
    else if (touch.gap_m < found->touch.gap_m - kMissingDepthM)  // the search has found a neighbouring point that is less deep
      (*found = c).touch = touch;
  }
}

/// Merges touches of curved surfaces that have reached the same point.
void TouchSets::merge(Pair& pair) const {
  const double near_m = kMergeRatio * bodies_.calc_size(pair.a, pair.b);
  for (auto c = pair.contacts.begin(); c != pair.contacts.end();) {
    const auto same = std::find_if(pair.contacts.begin(), c, [&](const Contact& other) {
      return c->touch.smooth && other.touch.smooth && !c->presses && !other.presses &&
             norm(c->touch.where_m - other.touch.where_m) < near_m;
    });
    if (same == c) {
      ++c;
      continue;
    }
    same->impulse = same->impulse + c->impulse;
    same->couple = same->couple + c->couple;
    same->touching = same->touching || c->touching;
    c = pair.contacts.erase(c);
    pair.ahead.touches.clear();
  }
}

/// True if a touch has moved to another part of its surface.
bool TouchSets::is_jump(const Pair& pair, const geometry::Touch& from, const geometry::Touch& to) const {
  const double way_m = geometry::calc_travel(from, to);
  return way_m > kSameTouchRatio * bodies_.calc_size(pair.a, pair.b) && way_m * from.steepest_per_m > kJumpRad;
}

bool TouchSets::is_far_jump(const Pair& pair, const geometry::Touch& from, const geometry::Touch& to) const {
  return is_jump(pair, from, to) && geometry::calc_travel(from, to) > kFarJumpRatio * bodies_.calc_size(pair.a, pair.b);
}

void TouchSets::refresh(Pair& pair) const {
  if (pair.cord >= 0) return update_cord(bodies_, cords_[pair.cord], pair);
  const geometry::Frame a = bodies_.get_frame(pair.a), b = bodies_.get_frame(pair.b);
  const bool is_there = !pair.ahead.touches.empty() && pair.ahead.a == a && pair.ahead.b == b;
  std::erase_if(pair.contacts, [&, k = std::size_t{0}](Contact& c) mutable {
    const geometry::Touch before = c.touch;
    const bool follows = is_there || follow(pair, c.touch, a, b);
    if (is_there) c.touch = pair.ahead.touches[k++];
    pair.searched = pair.searched && follows;
    if (c.touch.smooth && c.is_close()) {
      const double way_m = geometry::calc_travel(before, c.touch);
      if (c.touching) pair.errors.drift_m = std::max(pair.errors.drift_m, std::abs(c.touch.gap_m - before.gap_m));
      pair.errors.way_m = std::max(pair.errors.way_m, way_m);
      pair.errors.turn = std::max(pair.errors.turn, way_m * c.touch.steepest_per_m);
    }
    return !follows;
  });
  pair.ahead.touches.clear();
}

void TouchSets::remove_false(Pair& pair) const {
  if (pair.b < 0) return;
  const auto erased = std::erase_if(pair.contacts, [&](const Contact& c) {
    if (!c.touch.smooth || !(c.touch.gap_m < -kMaxDepthM)) return false;
    const geometry::Touch touch = move(c.touch, pair.apart_m);
    return touch.gap_m < -kMaxDepthM &&
           !geometry::is_overlap(touch, *bodies_.get_shape(pair.a), move(bodies_.get_frame(pair.a), pair.apart_m),
                                 *bodies_.get_shape(pair.b), bodies_.get_frame(pair.b));
  });
  if (erased == 0) return;
  pair.ahead.touches.clear();
  pair.searched = false;
}

void TouchSets::update(Pair& pair, double step_s) {
  if (pair.cord >= 0) return refresh(pair);
  if (!pair.searched || pair.travelled_m + calc_way(pair, step_s, step_s) > pair.margin_m)
    search(pair, step_s);
  else if (pair.travelled_m > 0.0) {
    refresh(pair);
    merge(pair);
    remove_false(pair);
    if (!pair.searched)  // a touch was lost
      search(pair, step_s);
    else
      complete(pair, bodies_.get_frame(pair.a), bodies_.get_frame(pair.b), 0.0);
  }
  if (!(pair.sag_m > 0.0)) return;
  double deepest = 0.0;
  for (const Contact& c : pair.contacts) deepest = std::max(deepest, -c.touch.gap_m);
  pair.sag_m = std::min(pair.sag_m, deepest);
  limit_apart(pair);
}

/// Touch with the least gap at the frames `a` and `b`, with the bodies apart, and that gap; none: infinite.
std::pair<Contact*, double> TouchSets::find_least(Pair& pair, const geometry::Frame& a, const geometry::Frame& b) const {
  std::pair<Contact*, double> least{nullptr, std::numeric_limits<double>::infinity()};
  pair.ahead.a = a;
  pair.ahead.b = b;
  pair.ahead.touches.clear();
  bool all_follow = true;
  for (Contact& c : pair.contacts) {
    geometry::Touch& moved = pair.ahead.touches.emplace_back(c.touch);
    const bool follows = follow(pair, moved, a, b);
    all_follow = all_follow && follows;
    const double gap_m = moved.gap_m + dot(moved.normal, pair.apart_m);
    if (follows && !is_far_jump(pair, c.touch, moved) && gap_m < least.second) least = {&c, gap_m};
  }
  if (!all_follow) pair.ahead.touches.clear();  // refresh() drops lost ones
  return least;
}

/// Adds the deepest point of a pair at the frames `a` and `b`, `closing_s` later (0: unused), if it is deeper than all touches.
TouchSets::Ahead TouchSets::complete(Pair& pair, const geometry::Frame& a, const geometry::Frame& b, double closing_s) {
  const geometry::Shape& mine = *bodies_.get_shape(pair.a);
  const geometry::Shape* theirs = bodies_.get_shape(pair.b);
  if (theirs != nullptr && mine.is_polyhedron() && theirs->is_polyhedron()) return complete_polyhedra(pair, a, b);
  geometry::Deepest deepest;
  if (theirs == nullptr) {
    if (calc_least_gap(pair, mine, a) >= -kMissingDepthM) return {};
    deepest = geometry::find_lowest(mine, a, bodies_.ground()->height_m);
    pair.measured = a;
    pair.lowest_m = deepest.gap_m;
    if (deepest.gap_m - mine.get_sag_m() >= -kMissingDepthM) return {};  // no touch is deeper either
  } else {
    deepest = geometry::find_deepest(mine, move(a, pair.apart_m), *theirs, b, -kMissingDepthM, pair.memory);
    if (deepest.gap_m >= -kMissingDepthM) return {};
  }
  const double depth_m = -deepest.gap_m - (pair.b < 0 ? calc_explained_depth(pair) : 0.0);
  const auto [lowest, least_m] = find_least(pair, a, b);
  if (deepest.gap_m < std::min(least_m, 0.0) - kMissingDepthM) return add(pair, deepest), Ahead{true, depth_m};
  if (lowest == nullptr || lowest->is_closed() || lowest->touch.gap_m <= kTouchGapM || least_m > -kMissingDepthM || lowest->rests ||
      !(closing_s > 0.0))
    return {false, depth_m};
  lowest->touching = false;
  const bool closes = std::exchange(lowest->closes_s, closing_s * lowest->touch.gap_m / (lowest->touch.gap_m - least_m)) < 0.0;
  return {closes, depth_m};
}

/// The same for two polyhedra, whose touches are complete only near the poses of their search: fast bodies may meet with other features.
TouchSets::Ahead TouchSets::complete_polyhedra(Pair& pair, const geometry::Frame& a, const geometry::Frame& b) {
  if (bodies_.calc_closing_speed(pair.a, pair.b) < kMinMissingSpeedMS) return {};
  std::optional<geometry::Touch> touch = find_deepest(pair, a, b);
  if (!touch || touch->gap_m >= -kMissingDepthM) return {};
  const double depth_m = -touch->gap_m - (pair.apart_m == Vec3{} ? calc_explained_depth(pair) : 0.0);
  if (touch->gap_m >= std::min(find_least(pair, a, b).second, 0.0) - kMissingDepthM) return {false, depth_m};
  const geometry::Frame now_a = bodies_.get_frame(pair.a), now_b = bodies_.get_frame(pair.b);
  *touch = move(*touch, -1.0 * pair.apart_m);
  if (!follow(pair, *touch, now_a, now_b)) return {false, depth_m};
  if (touch->gap_m < -kMaxDepthM) {  // if the bodies are not yet as deep, it is past an edge of its facet
    const std::optional<geometry::Touch> now = find_deepest(pair, now_a, now_b);
    if (!now || now->gap_m >= -kMaxDepthM) return {false, depth_m};
  }
  add(pair, *touch);
  return {true, depth_m};
}

/// Deepest touch of two polyhedra at the frames `a` and `b`, with the bodies apart. None if it is less than kMissingDepthM deep.
std::optional<geometry::Touch> TouchSets::find_deepest(const Pair& pair, const geometry::Frame& a, const geometry::Frame& b) {
  geometry::PairMemory memory;
  memory.axis = pair.memory.axis;
  geometry::find_touches(*bodies_.get_shape(pair.a), move(a, pair.apart_m), *bodies_.get_shape(pair.b), b, -kMissingDepthM, memory, found_);
  const auto deepest = std::min_element(found_.begin(), found_.end(), [](const auto& x, const auto& y) { return x.gap_m < y.gap_m; });
  return deepest == found_.end() ? std::nullopt : std::optional(*deepest);
}

/// Adds the touch of a point at the current poses.
void TouchSets::add(Pair& pair, const geometry::Deepest& deepest) {
  const geometry::Shape& mine = *bodies_.get_shape(pair.a);
  const geometry::Frame a = bodies_.get_frame(pair.a), b = bodies_.get_frame(pair.b);
  add(pair, pair.b < 0
                ? geometry::make_ground_touch(mine, a, bodies_.ground()->height_m, deepest.place)
                : move(geometry::make_touch(mine, move(a, pair.apart_m), *bodies_.get_shape(pair.b), b, deepest), -1.0 * pair.apart_m));
}

void TouchSets::add(Pair& pair, const geometry::Touch& touch) {
  pair.ahead.touches.clear();
  const auto same = std::find_if(pair.contacts.begin(), pair.contacts.end(), [&](const Contact& c) { return c.touch.id == touch.id; });
  if (same != pair.contacts.end()) {  // it has moved away from its point
    same->touching = same->touching && dot(same->touch.normal, touch.normal) > std::cos(kJumpRad);
    same->touch = touch;
    return;
  }
  Contact added;
  added.a = pair.a;
  added.b = pair.b;
  added.touch = touch;
  added.presses = impacts_.is_pressed(pair, touch.where_m);
  pair.contacts.push_back(added);
}

bool TouchSets::may_meet(Pair& pair, double step_s) const {
  if (!pair.contacts.empty()) return true;
  if (pair.cord >= 0) return false;
  // A search may miss curved surfaces that turn towards each other.
  return geometry::find_deepest(*bodies_.get_shape(pair.a), bodies_.get_frame(pair.a), *bodies_.get_shape(pair.b),
                                bodies_.get_frame(pair.b), calc_way(pair, step_s, step_s), pair.memory)
             .place >= 0;
}

void TouchSets::forget_closing(const Step& step) const {
  for (Pair* pair : step.island().pairs)
    for (Contact& c : pair->contacts) c.closes_s = -1.0;
}

TouchSets::Ahead TouchSets::complete(const Step& step, bool finds_closing) {
  std::vector<geometry::Frame> then;
  for (int n = 0; n < step.count(); ++n) {
    const int i = step.body(n);
    then.push_back(bodies_.is_moved_by_impact(i) ? bodies_.get_frame(i) : place(bodies_.solid(i), step.calc_moved(n, step.length_s)).frame);
  }
  const auto get_then = [&](int body) {
    const int n = step.find(body);
    return n < 0 ? bodies_.get_frame(body) : then[n];
  };
  Ahead ahead;
  for (Pair* pair : step.island().pairs) {
    if (pair->cord >= 0 || !step.has(*pair) || bodies_.is_moved_by_impact(pair->a) || bodies_.is_moved_by_impact(pair->b)) continue;
    const std::size_t before = pair->contacts.size();
    const Ahead found = complete(*pair, get_then(pair->a), get_then(pair->b), finds_closing ? step.length_s : 0.0);
    ahead = {ahead.was_missing || found.was_missing, std::max(ahead.depth_m, found.depth_m)};
    if (pair->contacts.size() == before || bodies_.get_time() < pair->next_search_s) continue;
    pair->searched = pair->memory.known = false;  // a lying body has more touches
    pair->next_search_s = bodies_.get_time() + kSearchIntervalS;
  }
  return ahead;
}

geometry::Frame TouchSets::find_flown(int body, double time_s) const {
  if (!bodies_.moves(body)) return bodies_.get_frame(body);
  return place(bodies_.solid(body), fly(bodies_.solid(body), bodies_.state(body), bodies_.gravity(), time_s)).frame;
}

void TouchSets::complete_in_flight(Pair& pair, double time_s) {
  const geometry::Frame a = find_flown(pair.a, time_s), b = find_flown(pair.b, time_s);
  for (int n = 0; n < kMaxAdded && complete(pair, a, b, 0.0).was_missing; ++n) {
  }
}

geometry::Touch TouchSets::find_closing(Pair& pair, const Contact& contact, double time_s) const {
  const double approach = bodies_.calc_approach(contact.touch, contact.a, contact.b);
  if (!contact.touch.smooth || !(contact.touch.gap_m > kTouchGapM) || !(approach > 0.0)) return contact.touch;
  const double closes_s = std::min(time_s, contact.touch.gap_m / approach);
  geometry::Touch touch = find_moved(pair, contact.touch, find_flown(pair.a, closes_s), find_flown(pair.b, closes_s));
  const Vec3 at_a = to_world(bodies_.get_frame(pair.a), touch.station_a), at_b = to_world(bodies_.get_frame(pair.b), touch.station_b);
  touch.gap_m = dot(at_a - at_b, touch.normal);
  touch.where_m = at_a;
  return touch;
}

/// Upper bound of the approach of any two points in `time_s` of a step; over the ground only vertical motion counts.
double TouchSets::calc_way(const Pair& pair, double time_s, double step_s) const {
  const bool is_over_ground = pair.b < 0 && bodies_.moves(pair.a);
  const double speed = is_over_ground ? bodies_.calc_sinking_speed(pair.a) : bodies_.calc_closing_speed(pair.a, pair.b);
  const double pull = bodies_.get_pull(pair.a) + bodies_.get_pull(pair.b);
  return (speed + (norm(bodies_.gravity()) + pull) * step_s) * time_s;
}

void TouchSets::travel(Pair& pair, double time_s, double step_s) const {
  pair.travelled_m += calc_way(pair, time_s, step_s) + Pair::kMovedM;
  if (pair.sag_m > 0.0) pair.sag_m *= std::exp(-time_s / kSagDecayS);
  limit_apart(pair);
  const auto is_deep = [](const Contact& c) { return c.touch.gap_m < -kDeepM; };
  if (pair.stored_j > 0.0 && calc_explained_depth(pair) < kDeepM && std::none_of(pair.contacts.begin(), pair.contacts.end(), is_deep))
    lose_stored(pair);
}

void TouchSets::part(Pair& pair, double depth_m, const Vec3& normal) const {
  pair.apart_m = pair.b >= 0 && depth_m > kDeepRatio * bodies_.calc_thickness(pair.a, pair.b) ? depth_m * normal : Vec3{};
}

double TouchSets::calc_explained_depth(const Pair& pair) const { return std::max(pair.sag_m, impacts_.calc_depth(pair)); }

double TouchSets::calc_explained_depth(const Pair& pair, const geometry::Touch& touch, double after_s) const {
  return std::max(pair.sag_m * std::exp(-after_s / kSagDecayS), impacts_.calc_depth(pair, touch.where_m));
}

/// Limits the separation of a pair in searches to the currently explained depth.
void TouchSets::limit_apart(Pair& pair) const {
  if (pair.apart_m != Vec3{}) part(pair, calc_explained_depth(pair), carillon::normalise(pair.apart_m));
}

void TouchSets::lose_stored(Pair& pair) const {
  ledger_.lose(pair.stored_j);
  pair.stored_j = 0.0;
}

/// Before the pair is removed.
void TouchSets::lose_all(Pair& pair) const {
  lose_stored(pair);
  ledger_.lose(pair.take_stopped_j());
}

void TouchSets::add_to(Books& books) const {
  for (const auto& [bodies, pair] : pairs_) books.springs_j += pair.stored_j + pair.stopped_j;
}

void TouchSets::release(int a, int b, double depth_m, double stored_j) {
  if (b >= 0 && a > b) std::swap(a, b);
  const auto at = pairs_.find({a, b});
  if (at == pairs_.end()) return ledger_.lose(stored_j);
  Pair& pair = at->second;
  for (Contact& c : pair.contacts)
    if (c.presses) c.presses = c.touching = false;
  pair.sag_m = std::max(pair.sag_m, depth_m);
  pair.stored_j += stored_j;
}

geometry::Touch TouchSets::find_moved(const Pair& pair, geometry::Touch touch, const geometry::Frame& a, const geometry::Frame& b) const {
  follow(pair, touch, a, b);
  return touch;
}

bool TouchSets::follow(const Pair& pair, geometry::Touch& touch, const geometry::Frame& a, const geometry::Frame& b) const {
  if (pair.apart_m == Vec3{}) return geometry::refresh(touch, *bodies_.get_shape(pair.a), a, bodies_.get_shape(pair.b), b);
  touch = move(touch, pair.apart_m);
  const bool follows = geometry::refresh(touch, *bodies_.get_shape(pair.a), move(a, pair.apart_m), bodies_.get_shape(pair.b), b);
  touch = move(touch, -1.0 * pair.apart_m);
  return follows;
}

}  // namespace carillon::rigid
