// Method: docs/howto/my-engine.md. A hit needs a speed of approach before the step; a lasting contact has a hit only above
// three times its load, as engines shake resting bodies.
#include "runtime/drive/touch_spots.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

namespace carillon::drive {
namespace {

constexpr double kLoadS = 5e-3;  // s; averaging time of loads, at least four steps
constexpr int kLoadSteps = 4;
constexpr double kMeanS = 50e-3;  // s; averaging time of all impulses of a position
constexpr double kSlipS = 50e-3;  // s; averaging time of slip, at least eight steps
constexpr int kSlipSteps = 8;
constexpr double kPartedM = 1e-6;       // m; gap of surfaces that have parted
constexpr double kCreepMS = 1e-3;       // m/s; slower slip is creep of an engine's friction
constexpr double kSettledS = 0.1;       // s; a position older than this has settled
constexpr double kSettledRatio = 3.0;   // a hit on a loaded position is above this times its load
constexpr double kSharedRatio = 2.0;    // an impulse that comes from a hit elsewhere on the body: above this times weight and load
constexpr double kPassedOnRatio = 0.1;  // of the fastest hit of its bodies: a slower one where they rest comes from it
constexpr double kDecayedRatio = 0.05;  // of the largest force: the end of a compliant hit
constexpr double kMatchRatio = 0.2;     // of the size: distance from the last position
constexpr double kGroupRatio = 0.05;    // of the size: points of one position; corners of an edge that lands are apart
constexpr double kMinLoadN = 1e-9;
constexpr std::size_t kMaxSupports = 6;  // of a hit: its impact is cubic in them
constexpr double kNever = std::numeric_limits<double>::infinity();

double calc_load_s(double dt_s) { return std::max(kLoadS, kLoadSteps * dt_s); }

/// Closing acceleration of two bodies without contact [m/s^2], >= 0.
double calc_pull(const StepView& step, int a, int b, const Vec3& normal) {
  const double along = dot(step.options.gravity_m_s2, normal);
  return std::max(0.0, (step.moves(b) ? along : 0.0) - (step.moves(a) ? along : 0.0));
}

/// Time from the start of the step until the surfaces touch, in free fall across their gap [s].
double calc_wait_s(const StepView& step, int a, int b, const std::array<Vec3, 2>& stations, const Vec3& normal, double gap_m,
                   double approach_m_s) {
  if (step.options.points_after) gap_m = dot(step.place(step.before, a, stations[0]) - step.place(step.before, b, stations[1]), normal);
  if (!(approach_m_s > 0.0) || !(gap_m > 0.0)) return 0.0;
  const double pull = calc_pull(step, a, b, normal);
  return std::min(step.dt_s, 2.0 * gap_m / (approach_m_s + std::sqrt(approach_m_s * approach_m_s + 2.0 * pull * gap_m)));
}

/// Impulse that carries the weight of the pair along the normal in this step [N s].
double calc_weight(const StepView& step, int a, int b, const Vec3& normal) {
  double inverse = 0.0;
  for (const int body : {a, b})
    if (step.moves(body)) inverse += 1.0 / step.scene.bodies[body].mass_kg;
  return inverse > 0.0 ? calc_pull(step, a, b, normal) * step.dt_s / inverse : 0.0;
}

/// Speed at which the surfaces closed before the step [m/s].
double calc_approach(const StepView& step, const StepPoint& p) {
  const double of_surfaces = -dot(step.calc_relative(step.before, step.before, p.a, p.b, p.stations_m), p.normal);
  if (!step.options.points_after) return of_surfaces;
  // A point of a surface that rolls came down to the contact during the step; the contact itself did not.
  const auto calc = [&](int body) {
    if (body < 0) return Vec3{};
    const Motion& before = step.before[body];
    return before.velocity_m_s + cross(before.spin_rad_s, p.where_m - step.scene.motions[body].centre_m);
  };
  return std::min(of_surfaces, -dot(calc(p.a) - calc(p.b), p.normal));
}

bool rests(const StepView& step, int a, int b) { return step.scene.is_still(a) && step.scene.is_still(b); }

}  // namespace

void TouchSpots::advance(const StepView& step, std::span<const StepPoint> points, TouchesCounters& counters, std::vector<FinishedHit>& hits,
                         std::vector<Load>& loads) {
  counters_ = &counters;
  struck_s_.assign(step.bodies.size(), kNever);
  fastest_.assign(step.bodies.size(), 0.0);
  std::vector<Group> groups = make_groups(step, points);
  for (const Group& g : groups) {
    if (!(g.approach_m_s > step.calc_slowest())) continue;
    const double touch_s = step.scene.before_s + calc_wait_s(step, g.a, g.b, g.stations_m, g.normal, g.gap_m, g.approach_m_s);
    for (const int body : {g.a, g.b}) {
      if (body < 0) continue;
      struck_s_[body] = std::min(struck_s_[body], touch_s);
      fastest_[body] = std::max(fastest_[body], g.approach_m_s);
    }
  }
  for (auto first = groups.begin(); first != groups.end();) {
    const auto last = std::find_if(first, groups.end(), [&](const Group& g) { return g.a != first->a || g.b != first->b; });
    std::vector<Spot>& spots = spots_[{first->a, first->b}];
    const int count = static_cast<int>(last - first);
    for (; first != last; ++first) follow(step, *first, count, find_spot(step, *first, spots), hits);
  }
  for (auto pair = spots_.begin(); pair != spots_.end();) {
    for (Spot& spot : pair->second) {
      if (spot.seen_s < step.scene.time_s) miss(step, spot, hits);
      if (!spot.is_gone) add_load(step, spot, loads);
    }
    std::erase_if(pair->second, [](const Spot& spot) { return spot.is_gone; });
    pair = pair->second.empty() ? spots_.erase(pair) : std::next(pair);
  }
  hold_shared(hits);
}

void TouchSpots::forget(int body) {
  std::erase_if(spots_, [&](const auto& pair) { return pair.first.first == body || pair.first.second == body; });
  std::erase_if(held_, [&](const FinishedHit& hit) { return hit.a == body || hit.b == body; });
}

/// Keeps back shared hits of bodies with an open hit: its impact may include them.
void TouchSpots::hold_shared(std::vector<FinishedHit>& hits) {
  std::move(held_.begin(), held_.end(), std::back_inserter(hits));
  held_.clear();
  if (std::none_of(hits.begin(), hits.end(), [](const FinishedHit& hit) { return hit.is_shared; })) return;
  std::set<int> struck;
  for (const auto& [pair, spots] : spots_)
    for (const Spot& spot : spots)
      if (spot.is_open && !spot.is_reported && !spot.hit.is_shared) struck.insert({pair.first, pair.second});
  struck.erase(-1);
  const auto kept = std::stable_partition(hits.begin(), hits.end(), [&](const FinishedHit& hit) {
    return !hit.is_shared || (!struck.contains(hit.a) && !struck.contains(hit.b));
  });
  std::move(kept, hits.end(), std::back_inserter(held_));
  hits.erase(kept, hits.end());
}

double TouchSpots::find_first_open(double now_s) const {
  for (const auto& [pair, spots] : spots_)
    for (const Spot& spot : spots)
      if (spot.is_open && !spot.is_reported) now_s = std::min(now_s, spot.hit.touch_s);
  for (const FinishedHit& hit : held_) now_s = std::min(now_s, hit.touch_s);
  return now_s;
}

/// Points nearer to each other than the spot radius, strongest first.
std::vector<TouchSpots::Group> TouchSpots::make_groups(const StepView& step, std::span<const StepPoint> points) const {
  std::vector<Group> groups;
  std::vector<char> taken(points.size(), 0);
  for (std::size_t seed = 0; seed < points.size(); ++seed) {
    const StepPoint& first = points[seed];
    if (taken[seed] != 0 || !(first.impulse_n_s > 0.0)) continue;
    const double near = kGroupRatio * step.scene.calc_size(first.a, first.b);
    Group g{.a = first.a, .b = first.b, .gap_m = first.gap_m};
    for (std::size_t i = seed; i < points.size() && points[i].a == first.a && points[i].b == first.b; ++i) {
      const StepPoint& p = points[i];
      if (taken[i] != 0 || !(p.impulse_n_s > 0.0) || norm(p.where_m - first.where_m) > near) continue;
      taken[i] = 1;
      const double push = p.impulse_n_s;
      g.push_n_s += push;
      g.normal = g.normal + push * p.normal;
      g.impulse_n_s = g.impulse_n_s + push * p.normal + p.friction_n_s;
      g.curvature_per_m += push * p.curvature_per_m;
      g.gap_m = std::min(g.gap_m, p.gap_m);
      g.approach_m_s = std::max(g.approach_m_s, calc_approach(step, p));
      for (const std::size_t side : {0, 1}) g.stations_m[side] = g.stations_m[side] + push * p.stations_m[side];
    }
    g.normal = calc_unit(g.normal);
    if (g.normal == Vec3{}) continue;  // the normals cancel
    g.curvature_per_m /= g.push_n_s;
    for (Vec3& station : g.stations_m) station = (1.0 / g.push_n_s) * station;
    g.where_m = step.place(step.scene.motions, g.a, g.stations_m[0]);
    if (g.b >= 0) g.where_m = 0.5 * (g.where_m + step.place(step.scene.motions, g.b, g.stations_m[1]));
    groups.push_back(g);
  }
  return groups;
}

/// The nearest position of the pair that was not seen in this step, at rest or carried along by one of the bodies; else a new one.
TouchSpots::Spot& TouchSpots::find_spot(const StepView& step, const Group& g, std::vector<Spot>& spots) {
  const Vec3 va = step.scene.calc_velocity(g.a, g.where_m), vb = step.scene.calc_velocity(g.b, g.where_m);
  double min = kMatchRatio * step.scene.calc_size(g.a, g.b) + std::max(norm(va), norm(vb)) * step.dt_s;
  Spot* nearest = nullptr;
  for (Spot& spot : spots) {
    if (spot.seen_s >= step.scene.time_s) continue;
    for (const Vec3& moved : {Vec3{}, step.dt_s * va, step.dt_s * vb}) {
      const double distance = norm(spot.where_m + moved - g.where_m);
      if (distance >= min) continue;
      nearest = &spot;
      min = distance;
    }
  }
  if (nearest != nullptr) return *nearest;
  Spot spot;
  spot.number = ++numbers_;
  spot.a = g.a;
  spot.b = g.b;
  spot.born_s = spot.seen_s = spot.quiet_s = step.scene.before_s;
  spots.push_back(spot);
  return spots.back();
}

/// Position at the end of the step: a corner moves with its body, a contact that rolls with the centre of the round one.
Vec3 TouchSpots::calc_where(const StepView& step, const Group& g, const Spot& spot) {
  if (!spot.is_round || step.options.points_after) return g.where_m;
  const Vec3 given = step.place(step.before, g.a, g.stations_m[0]);
  return given + step.scene.motions[spot.owner].centre_m - step.before[spot.owner].centre_m;
}

/// `count`: positions of the pair in this step, which share its weight.
void TouchSpots::follow(const StepView& step, Group g, int count, Spot& spot, std::vector<FinishedHit>& hits) {
  const double dt = step.dt_s, slowest = step.calc_slowest();
  // Springs of an engine pass on the begin of a hit: their bodies close a little where they rest.
  const double fastest = std::max(fastest_[g.a], g.b >= 0 ? fastest_[g.b] : 0.0);
  if (g.approach_m_s < kPassedOnRatio * fastest && carries(step, spot)) g.approach_m_s = std::min(g.approach_m_s, slowest);
  // Engines solve for the velocities at the end of the step, at the points that they report (get_given()).
  const double parting = dot(step.calc_relative(step.scene.motions, step.get_given(), g.a, g.b, g.stations_m), g.normal);
  double weight = calc_weight(step, g.a, g.b, g.normal) / count;
  double inverse = step.scene.calc_inverse_mass(step.get_given(), g.a, g.b, step.place(step.get_given(), g.a, g.stations_m[0]), g.normal);
  const bool is_jointed = step.bodies[g.a].pose.jointed || (g.b >= 0 && step.bodies[g.b].pose.jointed);
  if (is_jointed && parting + g.approach_m_s > slowest) inverse = std::min(inverse, (parting + g.approach_m_s) / g.push_n_s);
  const double struck_s = std::min(struck_s_[g.a], g.b >= 0 ? struck_s_[g.b] : kNever);
  const bool shares = struck_s < kNever && (g.push_n_s - kSharedRatio * (weight + spot.load_n * dt)) * inverse > slowest;
  const bool is_loaded = step.scene.before_s - spot.quiet_s > kLoadS && step.scene.before_s - spot.seen_s < 1.5 * dt;
  const bool is_shaken = is_loaded && g.push_n_s < kSettledRatio * spot.load_n * dt;
  double hit = 0.0;
  if (spot.is_open || ((g.approach_m_s > slowest || shares) && !is_shaken)) {
    double wait_s = 0.0;
    if (!spot.is_open)
      wait_s = g.approach_m_s > slowest ? calc_wait_s(step, g.a, g.b, g.stations_m, g.normal, g.gap_m, g.approach_m_s)
                                        : struck_s - step.scene.before_s;
    // Sums over internal steps: nothing carries the bodies before they touch, nor after they have parted.
    if (!spot.is_open && step.options.points_after) weight *= parting > slowest ? 0.0 : 1.0 - wait_s / dt;
    hit = std::max(0.0, g.push_n_s - weight);
    if (hit > 0.0) {
      if (!spot.is_open) open(step, g, wait_s, inverse, spot);
      gather(step, g, hit, spot);
    }
  } else {
    ++counters_->weights;
  }
  spot.where_m = calc_where(step, g, spot);
  spot.normal = g.normal;
  spot.stations_m = g.stations_m;
  note_slip(step, g, spot);
  spot.seen_s = step.scene.time_s;
  spot.mean_n += dt / (dt + kMeanS) * (g.push_n_s / dt - spot.mean_n);
  // Averages since the contact began or was last hit.
  const double known_s = step.scene.before_s - std::max(spot.born_s, spot.quiet_s);
  spot.load_n += dt / (dt + std::min(calc_load_s(dt), known_s)) * ((g.push_n_s - hit) / dt - spot.load_n);
  if (g.curvature_per_m >= 0.0) spot.curvature_per_m = g.curvature_per_m;
  if (!spot.is_open) return;
  spot.hit.parting_m_s = std::max(0.0, parting);
  // Hits of a settled contact are distinguished from shaking only at their end.
  const bool is_settled = step.scene.time_s - spot.born_s > kSettledS;
  if (step.options.early && !spot.is_reported && !is_settled) report_early(step, spot, hits);
  const double gap =
      dot(step.place(step.scene.motions, g.a, g.stations_m[0]) - step.place(step.scene.motions, g.b, g.stations_m[1]), g.normal);
  const bool has_decayed = !step.options.compliant || hit < kDecayedRatio * spot.peak_n * dt || (gap > kPartedM && parting > slowest);
  const bool is_long = step.scene.time_s - spot.hit.touch_s > step.options.longest_hit_s;
  if (is_long) ++counters_->cut;
  if (is_long || !(hit > 0.0) || (parting > -slowest && has_decayed)) close(step, spot, hits);
}

void TouchSpots::open(const StepView& step, const Group& g, double wait_s, double inverse_mass, Spot& spot) {
  spot.is_open = true;
  spot.peak_n = 0.0;
  spot.hit = {.a = g.a, .b = g.b};
  FinishedHit& hit = spot.hit;
  hit.spot = spot.number;
  hit.is_shared = !(g.approach_m_s > step.calc_slowest());
  hit.opened_s = step.scene.before_s;
  hit.touch_s = step.scene.before_s + wait_s;
  hit.inverse_mass = inverse_mass;
  for (const std::size_t side : {0, 1}) {
    const int body = side == 0 ? g.a : g.b;
    if (body >= 0) hit.before[side] = step.before[body];
  }
  if (!hit.is_shared) hit.supports = find_supports(step, spot);
  // Until the touch bodies without support fall.
  const auto falls = [&](int body) {
    return !hit.is_shared && step.moves(body) &&
           std::none_of(hit.supports.begin(), hit.supports.end(), [&](const FinishedHit& s) { return s.a == body || s.b == body; });
  };
  const Vec3 fall = wait_s * step.options.gravity_m_s2;
  double closing = 0.0;
  for (const std::size_t side : {0, 1}) {
    const int body = side == 0 ? g.a : g.b;
    if (!falls(body)) continue;
    hit.before[side].velocity_m_s = hit.before[side].velocity_m_s + fall;
    closing += (side == 0 ? -1.0 : 1.0) * dot(fall, g.normal);
  }
  hit.approach_m_s = g.approach_m_s + std::max(0.0, closing);
}

/// True if the bodies of a position rested on each other there before the step.
bool TouchSpots::carries(const StepView& step, const Spot& spot) {
  return spot.born_s < step.scene.before_s && spot.load_n > kMinLoadN && step.scene.before_s - spot.seen_s < 1.5 * step.dt_s &&
         (!spot.is_open || spot.hit.is_shared);
}

FinishedHit TouchSpots::make_support(const StepView& step, const Spot& spot) {
  FinishedHit support{.a = spot.a, .b = spot.b, .normal = spot.normal, .stations_m = spot.stations_m, .spot = spot.number};
  support.curvature_per_m = spot.curvature_per_m >= 0.0 ? spot.curvature_per_m : TouchPoint::kUnknown;
  for (const std::size_t side : {0, 1}) {
    const int body = side == 0 ? spot.a : spot.b;
    if (body < 0) continue;
    support.before[side] = step.before[body];
    support.outwards[side] = turn_back(step.before[body].rotation, (side == 0 ? -1.0 : 1.0) * spot.normal);
  }
  return support;
}

/// Loaded positions of the struck bodies, of those that support them, and so on; nearest bodies first.
std::vector<FinishedHit> TouchSpots::find_supports(const StepView& step, const Spot& struck) const {
  std::vector<FinishedHit> supports;
  std::vector<int> bodies;
  const auto add_body = [&](int body) {
    if (step.moves(body) && std::find(bodies.begin(), bodies.end(), body) == bodies.end()) bodies.push_back(body);
  };
  add_body(struck.a);
  add_body(struck.b);
  std::set<std::uint64_t> found{struck.number};
  for (std::size_t n = 0; n < bodies.size(); ++n) {
    std::map<std::uint64_t, const Spot*> carrying;  // in the order of their numbers, which does not depend on that of the bodies
    for (const auto& [pair, spots] : spots_) {
      if (pair.first != bodies[n] && pair.second != bodies[n]) continue;
      for (const Spot& spot : spots)
        if (carries(step, spot) && !found.contains(spot.number)) carrying[spot.number] = &spot;
    }
    for (const auto& [number, spot] : carrying) {
      if (supports.size() >= kMaxSupports) return supports;
      found.insert(number);
      supports.push_back(make_support(step, *spot));
      add_body(spot->a);
      add_body(spot->b);
    }
  }
  return supports;
}

/// Adds the part `push_n_s` of the group's impulse to the open hit.
void TouchSpots::gather(const StepView& step, const Group& g, double push_n_s, Spot& spot) {
  FinishedHit& hit = spot.hit;
  hit.approach_m_s = std::max(hit.approach_m_s, g.approach_m_s);
  hit.is_shared = hit.is_shared && !(g.approach_m_s > step.calc_slowest());
  hit.push_n_s += push_n_s;
  hit.curvature_per_m += push_n_s * g.curvature_per_m;
  hit.normal = hit.normal + push_n_s * g.normal;
  for (const std::size_t side : {0, 1}) {
    const int body = side == 0 ? g.a : g.b;
    if (body < 0) continue;
    const double sign = side == 0 ? 1.0 : -1.0;
    const Mat3& rotation = step.get_given()[body].rotation;
    hit.stations_m[side] = hit.stations_m[side] + push_n_s * g.stations_m[side];
    hit.outwards[side] = hit.outwards[side] + turn_back(rotation, (-sign * push_n_s) * g.normal);
    hit.impulses_n_s[side] = hit.impulses_n_s[side] + turn_back(rotation, (sign * push_n_s / g.push_n_s) * g.impulse_n_s);
  }
  spot.peak_n = std::max(spot.peak_n, push_n_s / step.dt_s);
}

namespace {

/// Sums weighted by impulse become means.
FinishedHit make_mean(const FinishedHit& sums, double end_s) {
  FinishedHit hit = sums;
  hit.end_s = end_s;
  hit.curvature_per_m /= sums.push_n_s;
  hit.normal = calc_unit(sums.normal);
  for (const std::size_t side : {0, 1}) {
    hit.stations_m[side] = (1.0 / sums.push_n_s) * sums.stations_m[side];
    hit.outwards[side] = calc_unit(sums.outwards[side]);
  }
  return hit;
}

}  // namespace

/// The hit as a rigid impact of the pair's restitution at this point alone.
void TouchSpots::report_early(const StepView& step, Spot& spot, std::vector<FinishedHit>& hits) {
  spot.is_reported = true;
  FinishedHit hit = make_mean(spot.hit, step.scene.time_s);
  if (!(hit.inverse_mass > 0.0)) return;
  const double e = step.calc_restitution(hit.a, hit.b);
  const double push = (1.0 + e) * hit.approach_m_s / hit.inverse_mass;
  for (Vec3& impulse : hit.impulses_n_s) impulse = (push / hit.push_n_s) * impulse;
  hit.push_n_s = push;
  hit.is_predicted = true;
  hit.parting_m_s = e * hit.approach_m_s;
  hits.push_back(hit);
}

void TouchSpots::close(const StepView& step, Spot& spot, std::vector<FinishedHit>& hits) {
  const double now_s = step.scene.time_s, length_s = now_s - spot.hit.touch_s;
  spot.is_open = false;
  if (!std::exchange(spot.is_reported, false)) {
    const double load = kSettledRatio * spot.mean_n * std::max(length_s, 2.0 * step.dt_s);
    if (now_s - spot.born_s > kSettledS && spot.hit.push_n_s < load) {
      ++counters_->settled;
      spot.load_n = std::max(spot.load_n, spot.mean_n);
      return;
    }
    hits.push_back(make_mean(spot.hit, now_s));
  }
  if (spot.hit.parting_m_s > step.calc_slowest()) spot.load_n = 0.0;  // it bounces: nothing rests here
  spot.quiet_s = now_s;
  counters_->longest_hit_s = std::max(counters_->longest_hit_s, length_s);
}

/// A position without an impulse in this step.
void TouchSpots::miss(const StepView& step, Spot& spot, std::vector<FinishedHit>& hits) {
  const double dt = step.dt_s;
  if (spot.is_open) {
    const double parting = dot(step.calc_relative(step.scene.motions, step.scene.motions, spot.a, spot.b, spot.stations_m), spot.normal);
    spot.hit.parting_m_s = std::max(spot.hit.parting_m_s, parting);
    close(step, spot, hits);
  }
  if (rests(step, spot.a, spot.b)) {
    spot.seen_s = step.scene.time_s;
    return;
  }
  spot.mean_n -= dt / (dt + kMeanS) * spot.mean_n;
  spot.load_n -= dt / (dt + calc_load_s(dt)) * spot.load_n;
  spot.where_m =
      spot.where_m + step.dt_s * step.scene.calc_velocity(spot.a, spot.is_round ? step.scene.motions[spot.a].centre_m : spot.where_m);
  spot.is_gone = step.scene.time_s - spot.seen_s > calc_load_s(dt);
}

void TouchSpots::note_slip(const StepView& step, const Group& g, Spot& spot) {
  const Vec3 relative = step.scene.calc_velocity(g.a, spot.where_m) - step.scene.calc_velocity(g.b, spot.where_m);
  const Vec3 slip = relative - dot(relative, g.normal) * g.normal;
  const double mean_s = std::min(std::max(kSlipS, kSlipSteps * step.dt_s), step.scene.before_s - spot.born_s);
  const double share = step.dt_s / (step.dt_s + mean_s);
  spot.slip_m_s = spot.slip_m_s + share * (slip - spot.slip_m_s);
  spot.slip_speed_m_s += share * (norm(slip) - spot.slip_speed_m_s);
}

void TouchSpots::add_load(const StepView& step, Spot& spot, std::vector<Load>& loads) const {
  if (!(spot.load_n > kMinLoadN) || rests(step, spot.a, spot.b)) return;
  if (spot.owner < -1) {
    std::array<Vec3, 2> outwards{};
    outwards[0] = turn_back(step.scene.motions[spot.a].rotation, -1.0 * spot.normal);
    if (spot.b >= 0) outwards[1] = turn_back(step.scene.motions[spot.b].rotation, spot.normal);
    const Curvatures c = calc_curvatures(step, spot.a, spot.b, spot.stations_m, outwards);
    spot.owner = c.a_per_m >= c.b_per_m ? spot.a : spot.b;
    spot.is_round = spot.owner == spot.a ? c.is_a_round : c.is_b_round;
    if (!(spot.curvature_per_m >= 0.0)) spot.curvature_per_m = c.calc_sum();
  }
  // Slip that averages out is solver jitter.
  const double mean = norm(spot.slip_m_s);
  const double slip_share = mean > kCreepMS ? mean / spot.slip_speed_m_s * std::sqrt(1.0 - kCreepMS * kCreepMS / (mean * mean)) : 0.0;
  loads.push_back({.a = spot.a,
                   .b = spot.b,
                   .owner = spot.owner,
                   .where_m = spot.where_m,
                   .normal = spot.normal,
                   .push_n = spot.load_n,
                   .curvature_per_m = spot.curvature_per_m,
                   .slip_share = std::min(1.0, slip_share),
                   .feature = spot.number,
                   .spot = spot.number});
}

}  // namespace carillon::drive
