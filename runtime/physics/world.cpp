// Runs the rigid bodies of a world (runtime/physics/rigid), and writes the events needed for its sound. One class, whose bodies and records
// change together in every step.
#include "runtime/physics/world.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <variant>

#include "runtime/base/clock.hpp"
#include "runtime/base/error.hpp"
#include "runtime/physics/check.hpp"
#include "runtime/physics/geometry/boxes.hpp"
#include "runtime/physics/make_space.hpp"
#include "runtime/physics/rigid/limits.hpp"
#include "runtime/physics/rigid/space.hpp"
#include "runtime/physics/sounding.hpp"
#include "runtime/physics/watch.hpp"

namespace carillon::physics {
namespace {

constexpr double kMaxGrabWeights = 30.0;   // largest force of a grab by default
constexpr double kStandardGravity = 9.81;  // m/s^2

constexpr double kMaxArmSizes = 10.0;  // sizes of a body from its centre of mass to the point held

void check_vector(const char* what, const Vec3& x, double most) {
  for (const double value : x)
    if (!(std::abs(value) <= most))
      throw InputError(fmt::format("{} must be three finite numbers, each within {:g} and {:g}", what, -most, most));
}

void check_motion(const Vec3& position_m, const Vec3& velocity_m_s, const Vec3& spin_rad_s) {
  check_vector("a position [m]", position_m, kFarthestM);
  check_vector("a velocity [m/s]", velocity_m_s, kMaxSpeedMS);
  check_vector("an angular velocity [rad/s]", spin_rad_s, kMaxSpinRadS);
}

}  // namespace

/// State of the simulation, and the current window.
class World::Course {
 public:
  Course(const WorldSpec& spec, const WorldOptions& options)
      : options_(options),
        gravity_m_s2_(norm(spec.gravity_m_s2)),
        maker_(options.modes),
        space_(make_space(spec, options, maker_)),
        sounding_(spec, space_, options.masks_hits),
        has_links_(spec.bodies.size(), 0) {
    for (const BodySpec& body : spec.bodies) names_.push_back(body.name);
    note_links(spec.joints);
    note_links(spec.cords);
    for (int i = 0; i < count(); ++i)
      if (spec.bodies[i].absent) space_.leave_out(i);
    check_start(spec, space_);
    check_overlaps();
    for (int i = 0; i < count(); ++i) prepare_shape(i);
    for (int i = 0; i < count(); ++i) note_weight(i);
  }

  double advance(double until_s, double cpu_s, const Sink& sink) {
    // The processor clock needs a system call, a tenth of a step; the steady clock does not, and never runs behind it.
    const bool is_limited = std::isfinite(cpu_s);
    const double began_s = is_limited ? base::get_steady_s() : 0.0, started_s = is_limited ? base::get_thread_cpu_s() : 0.0;
    if (std::exchange(is_unsent_, false)) emit(sink);
    while (!begun_ || (until_s - reached_s_ > kTimeToleranceS && !is_over())) {
      step(sink);
      if (is_limited && base::get_steady_s() - began_s >= cpu_s && base::get_thread_cpu_s() - started_s >= cpu_s) break;
    }
    return reached_s_;
  }

  void push(int body, const Vec3& at_m, const Vec3& impulse_n_s);
  void grab(int body, const Vec3& at_m, const GrabSpec& spec);
  void drag(int body, const Vec3& target_m, double over_s);
  void release(int body);
  void allow_modal_impacts(bool may_begin) { space_.allow_modal_impacts(may_begin); }
  void add(int body, const Entry& entry);
  int add(const BodySpec& body);
  void remove(int body);
  bool is_absent(int body) const { return space_.is_absent(body); }
  Vec3 get_centre(int body) const { return space_.state(body).centre; }
  Pose get_pose(int body) const { return calc_pose(make_motion(body, space_.state(body), space_.get_time()), space_.solid(body).centre_m); }

  Statistics get_statistics() const {
    Statistics s;
    const rigid::Costs& costs = space_.get_costs();
    s.steps = costs.steps;
    s.body_steps = costs.body_steps;
    s.islands = space_.count_islands();
    s.searches = costs.searches;
    s.impacts = costs.impacts;
    s.sweeps = costs.sweeps;
    s.mechanisms = space_.count_mechanisms();
    s.flights = costs.flights;
    s.energy = energy_;
    if (options_.audits_energy) s.contacts = watch_.find(space_);
    return s;
  }

 private:
  static constexpr double kTimeToleranceS = 2e-7;  // s; times nearer than this to the end of a window count as its end
  static constexpr double kMaxPulseLeadS =
      rigid::kSimultaneousS;  // a pulse found in a window may have begun this much earlier (pulses.cpp)

  static constexpr double kLeaveS = 1e-5;       // s; a body that is moved by hand leaves its place this much earlier
  static constexpr double kContactEndS = 0.02;  // s; longer than contacts take to end

  template <typename Links>
  void note_links(const Links& links) {
    for (const auto& link : links)
      for (const int body : {link.body, link.to})
        if (body >= 0) has_links_[body] = 1;
  }
  int count() const { return static_cast<int>(space_.states().size()); }
  bool is_over() const { return options_.end_s - reached_s_ <= kTimeToleranceS; }

  events::BodyMotion make_motion(int body, const rigid::State& state, double time_s) const {
    return {time_s, body, state.centre, state.velocity, state.rotation};
  }

  void step(const Sink& sink) {
    if (!begun_) {
      begun_ = true;
      for (int i = 0; i < count(); ++i) sink(make_motion(i, space_.state(i), 0.0));
      audit();
      watch_start();
      return;
    }
    walk();
    if (space_.is_at_window()) emit(sink);
  }

  /// One step; at the end of a window its poses.
  void walk() {
    // No impact is in progress, and no contact of a removed body.
    const bool slept = space_.is_at_window() && space_.is_all_asleep() && space_.get_time() >= ends_until_s_;
    if (slept) {
      space_.skip_window(options_.end_s);
    } else {
      space_.step(options_.end_s);
      const std::vector<rigid::Strike> strikes = space_.take_strikes();
      const std::vector<rigid::Forces> all_forces = space_.take_forces();
      for (const rigid::Strike& strike : strikes) take(strike);
      for (const rigid::Forces& forces : all_forces) sounding_.add(forces, events_);
      if (options_.audits_energy) watch(strikes, all_forces);
      if (options_.lasting_contacts) sounding_.update(events_);
    }
    if (!space_.is_at_window()) return;
    if (!slept) audit();
    reached_s_ = space_.get_time();
    for (int i = 0; i < count(); ++i) {
      const bool fell_asleep = just_slept(i);
      const bool moves = !space_.is_still(i) && !slept && !space_.is_absent(i);
      if (is_over() || moves || fell_asleep) events_.push_back(make_motion(i, space_.state(i), reached_s_));
    }
  }

  /// A body's motion ends with the window in which it falls asleep.
  bool just_slept(int body) {
    still_.resize(count(), 1);
    const char now = space_.is_still(body) ? 1 : 0, before = std::exchange(still_[body], now);
    return now != 0 && before == 0;
  }

  void take(const rigid::Strike& strike) {
    for (std::size_t k = 0; k < strike.bodies.size(); ++k)
      events_.push_back(make_motion(strike.bodies[k], strike.before[k], strike.time_s));
    for (std::size_t k = 0; k < strike.bodies.size(); ++k) events_.push_back(make_motion(strike.bodies[k], strike.after[k], strike.time_s));
    sounding_.add(strike, events_);
    if (!options_.audits_energy) return;
    double taken = 0.0;
    for (std::size_t k = 0; k < strike.bodies.size(); ++k)
      taken += rigid::calc_kinetic(space_.solid(strike.bodies[k]), strike.before[k]) -
               rigid::calc_kinetic(space_.solid(strike.bodies[k]), strike.after[k]);
    taken_j_ += taken - strike.modes_j;
    energy_.hit_rise_j = std::max(energy_.hit_rise_j, strike.modes_j - taken);
  }

  void audit() {
    if (!options_.audits_energy) return;
    double kinetic = 0.0;
    for (int i = 0; i < count(); ++i) kinetic += rigid::calc_kinetic(space_.solid(i), space_.state(i));
    const rigid::Books books = space_.calc_books();
    const double now = books.motion_j + books.modes_j + books.springs_j - books.lifted_j - books.given_j;
    if (!has_books_) energy_.start_j = now, has_books_ = true;
    energy_.motion_j = books.motion_j;
    energy_.modes_j = books.modes_j;
    energy_.max_modes_j = std::max(energy_.max_modes_j, books.modes_j);
    if (books.modes_j > 0.0)
      energy_.modes_share = std::max(energy_.modes_share, books.modes_j / (energy_.start_j + books.given_j - books.motion_j));
    energy_.lost_j = books.lost_j;
    energy_.lifted_j = books.lifted_j;
    energy_.given_j = books.given_j;
    energy_.error_j = std::max(energy_.error_j, std::abs(now + books.lost_j - energy_.start_j));
    energy_.rise_j = std::max(energy_.rise_j, now + taken_j_ - min_j_);
    energy_.kinetic_j = std::max(energy_.kinetic_j, kinetic);
    min_j_ = std::min(min_j_, now + taken_j_);
  }

  void watch_start() {
    if (!options_.audits_energy) return;
    std::vector<ContactWatch::Bodies> pairs;
    const std::vector<std::vector<int>> near = find_near();
    for (int a = 0; a < count(); ++a)
      for (const int b : near[a])
        if (!space_.is_joined(a, b)) pairs.emplace_back(a, b);
    watch_.look_at_ground(space_);
    watch_.look_at_pairs(space_, pairs, true);
  }

  void watch(const std::vector<rigid::Strike>& strikes, const std::vector<rigid::Forces>& all_forces) {
    const double now_s = space_.get_time();
    for (const rigid::Strike& strike : strikes)
      for (const rigid::Hit& hit : strike.hits)
        if (!hit.is_cord && hit.approach_m_s > 0.0 && norm(hit.impulse) > 0.0) watch_.add_hit(now_s, hit.a, hit.b);
    for (const rigid::Forces& forces : all_forces)
      if (!forces.continues && !forces.moves) watch_.add_hit(now_s, forces.a, forces.b);
    watch_.look_at_ground(space_);
    if (!space_.is_at_window()) return;
    std::vector<ContactWatch::Bodies> pairs;
    for (const auto& [bodies, pair] : space_.pairs()) pairs.push_back(bodies);
    watch_.look_at_pairs(space_, pairs, false);
  }

  /// Emits events earlier than any that may still come, in time order; then a Mark.
  void emit(const Sink& sink) {
    const double mark_s = is_over() ? options_.end_s : std::max(0.0, reached_s_ - kMaxPulseLeadS);
    // Events are large: sorted by times and indices only.
    order_.clear();
    for (std::size_t n = 0; n < events_.size(); ++n) order_.emplace_back(events::get_time_s(events_[n]), n);
    std::sort(order_.begin(), order_.end());
    later_.clear();
    for (const auto& [time_s, n] : order_) {
      if (is_over() || time_s <= mark_s)
        sink(events_[n]);
      else
        later_.push_back(events_[n]);
    }
    events_.swap(later_);
    sink(events::TimeWatermark{mark_s});
  }

  void finish_window() {
    for (; begun_ && !space_.is_at_window(); is_unsent_ = true) walk();
  }
  template <typename Act>
  void handle(int body, Act&& act);
  void check_handled(int body, bool must_move) const;
  void check_push(int body, const Vec3& at_m, const Vec3& impulse_n_s) const;
  /// A body at its present pose, or at one to be checked.
  struct Posed {
    const std::string& name;
    const rigid::Solid& solid;
    const rigid::State& state;
  };
  Posed get_posed(int body) const { return {names_[body], space_.solid(body), space_.state(body)}; }
  static geometry::Box get_box(const Posed& posed) { return posed.solid.shape->calc_box(rigid::place(posed.solid, posed.state).frame); }
  std::vector<std::vector<int>> find_near() const;
  void check_overlaps() const;
  void check_overlap(const Posed& posed, const std::vector<int>& others) const;
  void check_free(const Posed& posed) const;
  void prepare_shape(int body) const;
  void note_weight(int body) {
    if (options_.audits_energy && !space_.solid(body).fixed) energy_.weight_n += space_.solid(body).mass_kg * gravity_m_s2_;
  }

  WorldOptions options_;
  double gravity_m_s2_;
  SolidMaker maker_;
  rigid::Space space_;
  Sounding sounding_;
  std::vector<events::Event> events_, later_;  // of this window; those not reported yet
  std::vector<std::pair<double, std::size_t>> order_;
  std::vector<char> still_;
  std::vector<std::string> names_;
  std::vector<char> has_links_;  // of the bodies: on joints or cords
  bool is_unsent_ = false;       // events of a window completed by an operation
  double ends_until_s_ = 0.0;    // contacts of removed bodies end
  bool begun_ = false;
  double reached_s_ = 0.0;
  EnergyAudit energy_;
  ContactWatch watch_;
  bool has_books_ = false;
  double taken_j_ = 0.0;                                    // by hits
  double min_j_ = std::numeric_limits<double>::infinity();  // minimum energy so far, with losses by hits added back
};

/// Completes the window, and reports the motion of the bodies that `act` wakes or, in the list, moves.
template <typename Act>
void World::Course::handle(int body, Act&& act) {
  finish_window();
  std::vector<char> was_still(count());
  for (int i = 0; i < count(); ++i) was_still[i] = space_.is_still(i) ? 1 : 0;
  const rigid::State before = space_.state(body);
  act();
  if (!begun_) return;
  for (int i = 0; i < count(); ++i)
    if (was_still[i] != 0 && !space_.is_still(i) && !space_.is_absent(i))
      events_.push_back(make_motion(i, i == body ? before : space_.state(i), reached_s_));
  const rigid::State& after = space_.state(body);
  if (after.centre != before.centre || after.rotation != before.rotation)
    events_.push_back(make_motion(body, before, reached_s_ - kLeaveS));
  else
    events_.push_back(make_motion(body, before, reached_s_));
  events_.push_back(make_motion(body, after, reached_s_));
}

void World::Course::check_handled(int body, bool must_move) const {
  if (body < 0 || body >= count()) throw InputError(fmt::format("there is no body {}; bodies have the numbers 0 to {}", body, count() - 1));
  if (space_.is_absent(body)) throw InputError(fmt::format("body '{}' is not in the world; add it first", names_[body]));
  if (must_move && space_.solid(body).fixed) throw InputError(fmt::format("body '{}' is fixed: it cannot be pushed or held", names_[body]));
}

/// A body may be faster than the limits, but no push makes it so.
void World::Course::check_push(int body, const Vec3& at_m, const Vec3& impulse_n_s) const {
  const rigid::Solid& solid = space_.solid(body);
  const rigid::State& state = space_.state(body);
  const rigid::Placed& placed = space_.placed(body);
  const auto check = [&](const Vec3& before, const Vec3& change, double most, const char* unit) {
    const double after = norm(before + change);
    if (!(after <= std::max(most, norm(before))))
      throw InputError(
          fmt::format("the push gives body '{}' {:.3g} {}, and {:g} are the most; reduce the impulse", names_[body], after, unit, most));
  };
  check(state.velocity, (1.0 / solid.mass_kg) * impulse_n_s, kMaxSpeedMS, "m/s");
  check(placed.spin, placed.inverse_inertia * cross(at_m - state.centre, impulse_n_s), kMaxSpinRadS, "rad/s");
}

void World::Course::push(int body, const Vec3& at_m, const Vec3& impulse_n_s) {
  check_handled(body, true);
  check_vector("the place of a push [m]", at_m, kFarthestM);
  check_vector("an impulse [N s]", impulse_n_s, std::numeric_limits<double>::max());
  finish_window();
  check_push(body, at_m, impulse_n_s);
  handle(body, [&] { space_.push(body, at_m, impulse_n_s); });
}

void World::Course::grab(int body, const Vec3& at_m, const GrabSpec& spec) {
  check_handled(body, true);
  check_vector("the place of a grab [m]", at_m, kFarthestM);
  if (!(spec.frequency_hz >= 0.1 && spec.frequency_hz <= 100.0))
    throw InputError(fmt::format("the frequency of a grab, {} Hz, is not within 0.1..100", spec.frequency_hz));
  if (!(spec.damping_ratio >= 0.0 && spec.damping_ratio <= 10.0))
    throw InputError(fmt::format("the damping ratio of a grab, {}, is not within 0..10", spec.damping_ratio));
  if (!(spec.max_force_n >= 0.0 && std::isfinite(spec.max_force_n)))
    throw InputError(fmt::format("the largest force of a grab, {} N, must be a finite number, 0 or more", spec.max_force_n));
  finish_window();
  if (const double arm_m = norm(at_m - get_centre(body)), most_m = kMaxArmSizes * space_.solid(body).shape->get_size_m(); arm_m > most_m)
    throw InputError(
        fmt::format("the place of a grab is {:.3g} m from the centre of body '{}', and {:.3g} m is the most", arm_m, names_[body], most_m));
  handle(body, [&] {
    const double mass_kg = space_.solid(body).mass_kg, omega = 2.0 * std::numbers::pi * spec.frequency_hz;
    const rigid::State& state = space_.state(body);
    rigid::Grab grab{.body = body, .stiffness_n_m = mass_kg * omega * omega, .damping_n_s_m = 2.0 * spec.damping_ratio * mass_kg * omega};
    grab.at = transpose(rigid::make_rotation(state.rotation)) * (at_m - state.centre);
    grab.max_force_n = spec.max_force_n > 0.0 ? spec.max_force_n : kMaxGrabWeights * mass_kg * kStandardGravity;
    grab.from_m = grab.to_m = at_m;
    grab.from_s = space_.get_time() - 1.0;
    grab.to_s = space_.get_time();
    space_.grab(grab);
  });
}

void World::Course::drag(int body, const Vec3& target_m, double over_s) {
  check_handled(body, true);
  check_vector("the target of a grab [m]", target_m, kFarthestM);
  if (!(over_s >= 1e-3 && over_s <= 1e3)) throw InputError(fmt::format("the time of a drag, {} s, is not within 0.001..1000", over_s));
  if (space_.find_grab(body) == nullptr) throw InputError(fmt::format("body '{}' is not held; grab it first", names_[body]));
  finish_window();
  rigid::Grab grab = *space_.find_grab(body);
  grab.from_m = grab.find_target(space_.get_time());
  grab.to_m = target_m;
  grab.from_s = space_.get_time();
  grab.to_s = grab.from_s + over_s;
  space_.grab(grab);
}

void World::Course::release(int body) {
  check_handled(body, true);
  finish_window();
  space_.release(body);
}

void World::Course::add(int body, const Entry& entry) {
  if (body < 0 || body >= count()) check_handled(body, false);
  if (!space_.is_absent(body)) throw InputError(fmt::format("body '{}' is in the world already; remove it first", names_[body]));
  BodySpec spec;
  spec.name = names_[body];
  spec.fixed = space_.solid(body).fixed;
  spec.initial = entry.pose;
  spec.velocity_m_s = entry.velocity_m_s;
  spec.angular_velocity_rad_s = entry.angular_velocity_rad_s;
  check_entry(spec);
  check_motion(entry.pose.position_m, entry.velocity_m_s, entry.angular_velocity_rad_s);
  finish_window();
  const rigid::State state = make_state(spec, space_.solid(body));
  check_free({names_[body], space_.solid(body), state});
  handle(body, [&] { space_.add(body, state); });
}

int World::Course::add(const BodySpec& spec) {
  check_body(spec);
  check_motion(spec.initial.position_m, spec.velocity_m_s, spec.angular_velocity_rad_s);
  finish_window();
  rigid::Solid solid = maker_.make(spec);
  const rigid::State state = make_state(spec, solid);
  check_free({spec.name, solid, state});
  const int body = space_.append(std::move(solid), state);
  names_.push_back(spec.name);
  has_links_.push_back(0);
  sounding_.add_body(spec);
  note_weight(body);
  for (int i = 0; i < count(); ++i) prepare_shape(i);
  space_.add(body, state);
  if (begun_) events_.push_back(make_motion(body, state, reached_s_));
  return body;
}

/// Throws InputError if a body overlaps one that is there, or the ground.
void World::Course::check_free(const Posed& posed) const {
  const geometry::Box box = get_box(posed);
  std::vector<int> near;
  for (int i = 0; i < count(); ++i)
    if (!space_.is_absent(i) && !(space_.solid(i).fixed && posed.solid.fixed) && get_box(get_posed(i)).overlaps(box)) near.push_back(i);
  check_overlap(posed, near);
}

void World::Course::remove(int body) {
  check_handled(body, false);
  if (has_links_[body] != 0) throw InputError(fmt::format("body '{}' is on a joint or a cord: it cannot be removed", names_[body]));
  handle(body, [&] { space_.remove(body); });
  ends_until_s_ = space_.get_time() + kContactEndS;
}

/// For each body those with overlapping boxes; each pair is listed once, at the body with the lower index, and not if both are fixed.
/// Sorted.
std::vector<std::vector<int>> World::Course::find_near() const {
  std::vector<geometry::Box> boxes;
  for (int i = 0; i < count(); ++i) boxes.push_back(get_box(get_posed(i)));
  std::vector<std::vector<int>> near(boxes.size());
  geometry::for_overlaps(boxes, [&](int a, int b) {
    if (space_.is_absent(a) || space_.is_absent(b)) return;
    if (!space_.solid(a).fixed || !space_.solid(b).fixed) near[std::min(a, b)].push_back(std::max(a, b));
  });
  for (std::vector<int>& bodies : near) std::sort(bodies.begin(), bodies.end());
  return near;
}

/// Creates the search data of a shape now, so that real-time scenes do not wait for it. Polyhedra need it only against other kinds of
/// bodies.
void World::Course::prepare_shape(int a) const {
  const rigid::Solid& solid = space_.solid(a);
  const auto can_meet = [&](const rigid::Solid& other) {
    return !(solid.fixed && other.fixed) && !(solid.shape->is_polyhedron() && other.shape->is_polyhedron());
  };
  bool meets_bodies = false;
  for (int b = 0; b < count() && !meets_bodies; ++b) meets_bodies = b != a && can_meet(space_.solid(b));
  const bool meets_ground = space_.ground() && !solid.fixed && !solid.shape->is_polyhedron();
  if (meets_bodies || meets_ground) solid.shape->prepare(meets_bodies);
}

void World::Course::check_overlaps() const {
  const std::vector<std::vector<int>> near = find_near();
  for (int a = 0; a < count(); ++a)
    if (!space_.is_absent(a)) {
      std::vector<int> others = near[a];
      std::erase_if(others, [&](int b) { return space_.is_joined(a, b); });
      check_overlap(get_posed(a), others);
    }
}

/// Throws InputError if a body overlaps the ground or one of `others`.
void World::Course::check_overlap(const Posed& posed, const std::vector<int>& others) const {
  const auto calc_allowed_m = [](const rigid::Solid& solid) { return std::min(2e-4, 5e-3 * solid.shape->get_size_m()); };
  const rigid::Placed placed = rigid::place(posed.solid, posed.state);
  const double allowed_m = calc_allowed_m(posed.solid);
  if (space_.ground() && !posed.solid.fixed) {
    const double height_m = space_.ground()->height_m;
    geometry::PairMemory memory;
    std::vector<geometry::Touch> touches;
    geometry::find_ground_touches(*posed.solid.shape, placed.frame, height_m, allowed_m, memory, touches);
    double depth = 0.0;
    for (const geometry::Touch& touch : touches) depth = std::max(depth, -touch.gap_m);
    if (depth > allowed_m)
      throw InputError(fmt::format("body '{}' starts {:.2f} mm inside the ground (height {:g} m); raise it by that much", posed.name,
                                   depth * 1e3, height_m));
  }
  for (const int b : others) {
    Vec3 where{};
    const double depth = geometry::calc_overlap(*posed.solid.shape, placed.frame, *space_.solid(b).shape,
                                                rigid::place(space_.solid(b), space_.state(b)).frame, where);
    if (depth > std::min(allowed_m, calc_allowed_m(space_.solid(b))))
      throw InputError(
          fmt::format("bodies '{}' and '{}' start inside each other, {:.2f} mm deep near ({:.4f}, {:.4f}, {:.4f}) m; move one of them",
                      posed.name, names_[b], depth * 1e3, where[0], where[1], where[2]));
  }
}

World::World(const WorldSpec& spec, const WorldOptions& options) : course_(std::make_unique<Course>(spec, options)) {}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

double World::advance(double until_s, double cpu_s, const Sink& sink) { return course_->advance(until_s, cpu_s, sink); }

Statistics World::get_statistics() const { return course_->get_statistics(); }

void World::push(int body, const Vec3& at_m, const Vec3& impulse_n_s) { course_->push(body, at_m, impulse_n_s); }
void World::grab(int body, const Vec3& at_m, const GrabSpec& spec) { course_->grab(body, at_m, spec); }
void World::drag(int body, const Vec3& target_m, double over_s) { course_->drag(body, target_m, over_s); }
void World::release(int body) { course_->release(body); }
void World::allow_modal_impacts(bool may_begin) { course_->allow_modal_impacts(may_begin); }
void World::add(int body, const Entry& entry) { course_->add(body, entry); }
int World::add(const BodySpec& body) { return course_->add(body); }
void World::remove(int body) { course_->remove(body); }
Pose World::get_pose(int body) const { return course_->get_pose(body); }
Vec3 World::get_centre(int body) const { return course_->get_centre(body); }
bool World::is_absent(int body) const { return course_->is_absent(body); }

}  // namespace carillon::physics
