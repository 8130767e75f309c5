// Checks a world, runs its rigid bodies (runtime/physics/rigid), and writes the events needed for its sound. One class, whose bodies,
// shapes and records change together in every step; longer than most files.
#include "runtime/physics/world.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>
#include <variant>

#include "runtime/base/clock.hpp"
#include "runtime/base/error.hpp"
#include "runtime/drive/mode_sets.hpp"
#include "runtime/physics/check.hpp"
#include "runtime/physics/geometry/boxes.hpp"
#include "runtime/physics/rigid/limits.hpp"
#include "runtime/physics/rigid/space.hpp"
#include "runtime/physics/sounding.hpp"
#include "runtime/physics/watch.hpp"

namespace carillon::physics {
namespace {

Mat3 to_matrix(const std::array<double, 9>& m) { return {Vec3{m[0], m[1], m[2]}, Vec3{m[3], m[4], m[5]}, Vec3{m[6], m[7], m[8]}}; }

/// Bodies of one bank share their shape.
using Shapes = std::map<const bank::Bank*, std::shared_ptr<const geometry::Shape>>;

rigid::Solid make_solid(const BodySpec& b, Shapes& shapes) {
  rigid::Solid solid;
  auto& shared = shapes[b.bank];
  if (!shared) {
    try {
      shared = std::make_shared<geometry::Shape>(b.bank->vertices_m, b.bank->triangles);
    } catch (const InputError& e) {
      throw InputError(fmt::format("body '{}': {}", b.name, e.what()));
    }
  }
  solid.shape = shared;
  solid.fixed = b.fixed;
  solid.mass_kg = b.bank->rigid.mass_kg;
  solid.centre_m = b.bank->rigid.centre_m;
  if (!b.fixed) {
    solid.inertia_kg_m2 = to_matrix(b.bank->rigid.inertia_kg_m2);
    solid.inverse_inertia = calc_inverse(solid.inertia_kg_m2);
  }
  for (const Vec3& v : b.bank->vertices_m) solid.radius_m = std::max(solid.radius_m, calc_length(v - solid.centre_m));
  solid.restitution = b.restitution;
  solid.friction = b.friction;
  solid.young_modulus_pa = b.bank->material.young_modulus_pa;
  solid.poisson_ratio = b.bank->material.poisson_ratio;
  return solid;
}

void add_modes(rigid::Solid& solid, const bank::Bank& bank, drive::ModeSets& sets) {
  solid.modes = sets.find(bank);
  if (!solid.modes) return;
  solid.find_shape = [&bank](const geometry::Place& place) { return bank::calc_shapes(bank, place.triangle, place.barycentric); };
}

rigid::State make_state(const BodySpec& b, const rigid::Solid& solid) {
  rigid::State state;
  state.rotation = rigid::normalise(b.initial.rotation);
  const Mat3 rotation = rigid::make_rotation(state.rotation);
  state.centre = b.initial.position_m + rotation * solid.centre_m;
  state.velocity = b.velocity_m_s;
  if (!b.fixed) state.momentum = rotation * (solid.inertia_kg_m2 * (transpose(rotation) * b.angular_velocity_rad_s));
  return state;
}

/// Stops of a joint: one at each end of its travel.
void add_stops(const JointSpec& j, const std::vector<rigid::Solid>& solids, const std::vector<rigid::State>& states, rigid::Links& links) {
  const bool turned = solids[j.body].fixed;  // the moving body comes first
  const int a = turned ? j.to : j.body, b = turned ? j.body : j.to;
  const auto get_turn = [&](int body) {
    return body < 0 ? Mat3{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}} : transpose(rigid::make_rotation(states[body].rotation));
  };
  const auto get_place = [&](int body) { return body < 0 ? j.at_m : get_turn(body) * (j.at_m - states[body].centre); };
  const Vec3 lever = find_across(j.axis);
  double arm = solids[a].radius_m;
  if (b >= 0 && !solids[b].fixed) arm = std::min(arm, solids[b].radius_m);
  for (const bool is_lower : {true, false}) {
    rigid::Stop stop{.turns = j.kind == joints::Kind::kHinge, .at_a = get_place(a), .at_b = get_place(b), .axis = get_turn(b) * j.axis};
    stop.lever_a = get_turn(a) * lever;
    stop.lever_b = get_turn(b) * lever;
    stop.arm_m = arm;
    stop.is_lower = is_lower;
    stop.max = turned ? -(*j.limits)[is_lower ? 1 : 0] : (*j.limits)[is_lower ? 0 : 1];
    links.cords.push_back({.a = a, .b = b, .restitution = j.stop_restitution, .stop = stop});
  }
}

rigid::Links make_links(const WorldSpec& spec, const std::vector<rigid::Solid>& solids, const std::vector<rigid::State>& states) {
  rigid::Links links;
  for (const JointSpec& j : spec.joints) {
    links.joints.push_back({j.kind, j.body, j.to, j.at_m, j.axis, j.second_axis, j.damping});
    if (j.limits) add_stops(j, solids, states, links);
  }
  for (const CordSpec& c : spec.cords) {
    const auto tie = [&](int body, const Vec3& where) {
      if (body < 0) return where;
      const rigid::State& state = states[body];
      return transpose(rigid::make_rotation(state.rotation)) * (where - state.centre);
    };
    rigid::Cord cord;
    // The moving body comes first.
    const bool turned = solids[c.body].fixed;
    cord.a = turned ? c.to : c.body;
    cord.b = turned ? c.body : c.to;
    cord.at_a = tie(cord.a, turned ? c.to_m : c.from_m);
    cord.at_b = tie(cord.b, turned ? c.from_m : c.to_m);
    cord.length_m = std::max(c.length_m.value_or(0.0), calc_length(c.from_m - c.to_m));
    cord.restitution = c.restitution;
    links.cords.push_back(cord);
  }
  return links;
}

/// Checks that the start velocities are compatible with the joints.
void check_start(const WorldSpec& spec, const rigid::Space& space) {
  for (std::size_t i = 0; i < spec.bodies.size() && !spec.joints.empty(); ++i) {
    const BodySpec& body = spec.bodies[i];
    const double error = space.get_start_error(static_cast<int>(i));
    if (body.fixed || (body.velocity_m_s == Vec3{} && body.angular_velocity_rad_s == Vec3{})) continue;
    double fastest = 0.0;
    for (const BodySpec& other : spec.bodies) fastest = std::max(fastest, calc_length(other.velocity_m_s));
    if (error > 1e-3 + 0.01 * fastest)
      throw InputError(fmt::format(
          "body '{}': its start velocities differ by {:.3g} m/s from those that its joints allow; a body that rotates about a joint has "
          "\"velocity_m_s\" = \"angular_velocity_rad_s\" x (its centre of mass - the joint), and bodies attached to it move along",
          body.name, error));
  }
}

rigid::Space make_space(const WorldSpec& spec, const WorldOptions& options) {
  check(spec, options);
  Shapes shapes;
  drive::ModeSets modes;
  std::vector<rigid::Solid> solids;
  std::vector<rigid::State> states;
  for (const BodySpec& body : spec.bodies) {
    solids.push_back(make_solid(body, shapes));
    if (options.modes) add_modes(solids.back(), *body.bank, modes);
    states.push_back(make_state(body, solids.back()));
  }
  std::optional<rigid::Ground> ground;
  if (spec.ground)
    ground = {spec.ground->height_m, spec.ground->restitution, spec.ground->friction, spec.ground->young_modulus_pa,
              spec.ground->poisson_ratio};
  const rigid::Links links = make_links(spec, solids, states);
  try {
    return rigid::Space(std::move(solids), std::move(states), ground, spec.gravity_m_s2,
                        {.step_s = options.contact_step_s, .islands = options.islands, .joint_tolerance = options.joint_tolerance}, links);
  } catch (const std::invalid_argument& error) {  // joints that do not form trees
    throw InputError(error.what());
  }
}

}  // namespace

/// State of the simulation, and the current window.
class World::Course {
 public:
  Course(const WorldSpec& spec, const WorldOptions& options)
      : options_(options), space_(make_space(spec, options)), sounding_(spec, space_, options.masks_hits) {
    check_start(spec, space_);
    check_overlaps(spec);
    prepare_shapes(spec.ground.has_value());
    if (!options_.audits_energy) return;
    for (int i = 0; i < count(); ++i)
      if (!space_.solid(i).fixed) energy_.weight_n += space_.solid(i).mass_kg * norm(spec.gravity_m_s2);
  }

  double advance(double until_s, double cpu_s, const Sink& sink) {
    // The processor clock needs a system call, a tenth of a step; the steady clock does not, and never runs behind it.
    const bool is_limited = std::isfinite(cpu_s);
    const double began_s = is_limited ? base::get_steady_s() : 0.0, started_s = is_limited ? base::get_thread_cpu_s() : 0.0;
    while (!begun_ || (until_s - reached_s_ > kTimeToleranceS && !is_over())) {
      step(sink);
      if (is_limited && base::get_steady_s() - began_s >= cpu_s && base::get_thread_cpu_s() - started_s >= cpu_s) break;
    }
    return reached_s_;
  }

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
    const bool slept = space_.is_at_window() && space_.is_all_asleep();  // and no impact is in progress
    if (slept) {
      space_.skip_window(options_.end_s);
    } else {
      space_.step(options_.end_s);
      const std::vector<rigid::Strike> strikes = space_.take_strikes();
      const std::vector<rigid::Forces> all_forces = space_.take_forces();
      for (const rigid::Strike& strike : strikes) take(strike);
      for (const rigid::Forces& forces : all_forces) take(forces);
      if (options_.audits_energy) watch(strikes, all_forces);
      if (options_.lasting_contacts) sounding_.update(events_);
    }
    if (!space_.is_at_window()) return;
    if (!slept) audit();
    reached_s_ = space_.get_time();
    for (int i = 0; i < count(); ++i) {
      const bool fell_asleep = just_slept(i);
      if (is_over() || (!space_.is_still(i) && !slept) || fell_asleep) events_.push_back(make_motion(i, space_.state(i), reached_s_));
    }
    emit(sink);
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

  /// One event per ringing or moving body, split at the maximum length of events.
  void take(const rigid::Forces& forces) {
    sounding_.note(forces);
    for (const int side : {0, 1}) {
      const int body = side == 0 ? forces.a : forces.b;
      if (body < 0) continue;
      const geometry::Place& place = side == 0 ? forces.place_a : forces.place_b;
      const std::vector<Vec3>& impulses = side == 0 ? forces.on_a : forces.on_b;
      events::Force first;
      first.time_s = forces.time_s;
      first.step_s = forces.step_s;
      first.body = body;
      first.other = side == 0 ? forces.b : forces.a;
      first.triangle = place.triangle;
      first.barycentric = place.barycentric;
      first.continues = forces.continues;
      events::split_force(first, impulses, [&](const events::Force& force) { events_.push_back(force); });
    }
  }

  void audit() {
    if (!options_.audits_energy) return;
    double kinetic = 0.0;
    for (int i = 0; i < count(); ++i) kinetic += rigid::calc_kinetic(space_.solid(i), space_.state(i));
    const rigid::Books books = space_.calc_books();
    const double now = books.motion_j + books.modes_j + books.springs_j - books.lifted_j;
    if (!has_books_) energy_.start_j = now, has_books_ = true;
    energy_.motion_j = books.motion_j;
    energy_.modes_j = books.modes_j;
    energy_.max_modes_j = std::max(energy_.max_modes_j, books.modes_j);
    if (books.modes_j > 0.0) energy_.modes_share = std::max(energy_.modes_share, books.modes_j / (energy_.start_j - books.motion_j));
    energy_.lost_j = books.lost_j;
    energy_.lifted_j = books.lifted_j;
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
      if (!forces.continues) watch_.add_hit(now_s, forces.a, forces.b);
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

  std::vector<std::vector<int>> find_near() const;
  void check_overlaps(const WorldSpec& spec) const;
  void prepare_shapes(bool has_ground) const;

  WorldOptions options_;
  rigid::Space space_;
  Sounding sounding_;
  std::vector<events::Event> events_, later_;  // of this window; those not reported yet
  std::vector<std::pair<double, std::size_t>> order_;
  std::vector<char> still_;
  bool begun_ = false;
  double reached_s_ = 0.0;
  EnergyAudit energy_;
  ContactWatch watch_;
  bool has_books_ = false;
  double taken_j_ = 0.0;                                    // by hits
  double min_j_ = std::numeric_limits<double>::infinity();  // minimum energy so far, with losses by hits added back
};

/// For each body those with overlapping boxes; each pair is listed once, at the body with the lower index, and not if both are fixed.
/// Sorted.
std::vector<std::vector<int>> World::Course::find_near() const {
  std::vector<geometry::Box> boxes;
  for (int i = 0; i < count(); ++i) boxes.push_back(space_.solid(i).shape->calc_box(rigid::place(space_.solid(i), space_.state(i)).frame));
  std::vector<std::vector<int>> near(boxes.size());
  geometry::for_overlaps(boxes, [&](int a, int b) {
    if (!space_.solid(a).fixed || !space_.solid(b).fixed) near[std::min(a, b)].push_back(std::max(a, b));
  });
  for (std::vector<int>& bodies : near) std::sort(bodies.begin(), bodies.end());
  return near;
}

/// Creates the search data of the shapes now, so that real-time scenes do not wait for it. Polyhedra need it only against other kinds of
/// bodies.
void World::Course::prepare_shapes(bool has_ground) const {
  for (int a = 0; a < count(); ++a) {
    const rigid::Solid& solid = space_.solid(a);
    const auto can_meet = [&](const rigid::Solid& other) {
      return !(solid.fixed && other.fixed) && !(solid.shape->is_polyhedron() && other.shape->is_polyhedron());
    };
    bool meets_bodies = false;
    for (int b = 0; b < count() && !meets_bodies; ++b) meets_bodies = b != a && can_meet(space_.solid(b));
    const bool meets_ground = has_ground && !solid.fixed && !solid.shape->is_polyhedron();
    if (meets_bodies || meets_ground) solid.shape->prepare(meets_bodies);
  }
}

void World::Course::check_overlaps(const WorldSpec& spec) const {
  const std::vector<std::vector<int>> near = find_near();
  const auto allowed_m = [&](int body) { return std::min(2e-4, 5e-3 * space_.solid(body).shape->get_size_m()); };
  for (int a = 0; a < count(); ++a) {
    const rigid::Placed at_a = rigid::place(space_.solid(a), space_.state(a));
    if (spec.ground && !space_.solid(a).fixed) {
      geometry::PairMemory memory;
      std::vector<geometry::Touch> touches;
      geometry::find_ground_touches(*space_.solid(a).shape, at_a.frame, spec.ground->height_m, allowed_m(a), memory, touches);
      double depth = 0.0;
      for (const geometry::Touch& touch : touches) depth = std::max(depth, -touch.gap_m);
      if (depth > allowed_m(a))
        throw InputError(fmt::format("body '{}' starts {:.2f} mm inside the ground (height {:g} m); raise it by that much",
                                     spec.bodies[a].name, depth * 1e3, spec.ground->height_m));
    }
    for (const int b : near[a]) {
      if (space_.is_joined(a, b)) continue;
      Vec3 where{};
      const double depth = geometry::calc_overlap(*space_.solid(a).shape, at_a.frame, *space_.solid(b).shape,
                                                  rigid::place(space_.solid(b), space_.state(b)).frame, where);
      if (depth > std::min(allowed_m(a), allowed_m(b)))
        throw InputError(
            fmt::format("bodies '{}' and '{}' start inside each other, {:.2f} mm deep near ({:.4f}, {:.4f}, {:.4f}) m; move one of them",
                        spec.bodies[a].name, spec.bodies[b].name, depth * 1e3, where[0], where[1], where[2]));
    }
  }
}

World::World(const WorldSpec& spec, const WorldOptions& options) : course_(std::make_unique<Course>(spec, options)) {}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

double World::advance(double until_s, double cpu_s, const Sink& sink) { return course_->advance(until_s, cpu_s, sink); }

Statistics World::get_statistics() const { return course_->get_statistics(); }

std::vector<std::string> ask_about_links(const WorldSpec& spec) {
  constexpr double kFarRadii = 30.0;  // radii of a body
  std::vector<std::string> questions;
  const auto calc_distance = [&](int body, const Vec3& where, double& radius) {
    const BodySpec& b = spec.bodies[body];
    radius = 0.0;
    for (const Vec3& v : b.bank->vertices_m) radius = std::max(radius, norm(v - b.bank->rigid.centre_m));
    const Mat3 rotation = rigid::make_rotation(rigid::normalise(b.initial.rotation));
    return norm(where - b.initial.position_m - rotation * b.bank->rigid.centre_m);
  };
  const auto name = [&](int body) { return spec.bodies[body].name; };
  for (const JointSpec& joint : spec.joints) {
    bool far = true;
    double nearest = std::numeric_limits<double>::infinity(), of = 0.0;
    int body = joint.body;
    for (const int one : {joint.body, joint.to}) {
      if (one < 0) continue;
      double radius = 0.0;
      const double distance = calc_distance(one, joint.at_m, radius);
      far = far && distance > kFarRadii * radius;
      if (distance < nearest) nearest = distance, of = radius, body = one;
    }
    if (far)
      questions.push_back(fmt::format("{} is {:.3g} m from the centre of '{}', a body of {:.2g} m: is \"at_m\" the place in the world?",
                                      describe(spec, joint.place, "joint", joint.body, joint.to), nearest, name(body), 2.0 * of));
  }
  for (const CordSpec& cord : spec.cords)
    for (const bool from : {true, false}) {
      const int body = from ? cord.body : cord.to;
      if (body < 0) continue;
      double radius = 0.0;
      const double distance = calc_distance(body, from ? cord.from_m : cord.to_m, radius);
      if (distance > 1.01 * radius)
        questions.push_back(fmt::format("{} is tied {:.3g} m from the centre of '{}', outside of it: is that the place in the world?",
                                        describe(spec, cord.place, "cord", cord.body, cord.to), distance, name(body)));
    }
  return questions;
}

Pose calc_pose(const events::BodyMotion& motion, const Vec3& c) {
  const auto& q = motion.rotation;
  const Vec3 u{q[1], q[2], q[3]};
  const Vec3 t = cross(u, c), s = cross(u, t);
  Pose pose{motion.time_s, motion.position_m, q};
  for (std::size_t k = 0; k < 3; ++k) pose.position_m[k] -= c[k] + 2.0 * (q[0] * t[k] + s[k]);
  return pose;
}

Simulation collect(const std::vector<events::Event>& events, const std::vector<Vec3>& centres_m) {
  Simulation all;
  all.poses.resize(centres_m.size());
  const auto is_known = [&](std::int32_t body) { return body >= 0 && body < std::ssize(centres_m); };
  for (const events::Event& event : events) {
    if (const auto* impulse = std::get_if<Impulse>(&event); impulse != nullptr && is_known(impulse->body)) {
      all.impulses.push_back(*impulse);
    } else if (const auto* motion = std::get_if<events::BodyMotion>(&event); motion != nullptr && is_known(motion->body)) {
      const std::size_t body = motion->body;
      auto& path = all.poses[body];
      if (!path.empty() && path.back().time_s >= motion->time_s) continue;  // after an impact the pose is unchanged
      path.push_back(calc_pose(*motion, centres_m[body]));
    }
  }
  const auto earlier = [](const Impulse& x, const Impulse& y) { return x.time_s < y.time_s; };
  std::stable_sort(all.impulses.begin(), all.impulses.end(), earlier);
  return all;
}

Simulation simulate(const WorldSpec& spec, double duration_s, const std::function<void(double)>& progress) {
  if (!(duration_s >= 0.0 && std::isfinite(duration_s)))
    throw InputError(fmt::format("the duration {} s must be a finite number, 0 or more", duration_s));
  World world(spec, {.end_s = duration_s, .lasting_contacts = false});
  std::vector<events::Event> events;
  constexpr int kParts = 100;
  for (int part = 1; part <= kParts; ++part) {
    world.advance(duration_s * part / kParts, std::numeric_limits<double>::infinity(),
                  [&](const events::Event& event) { events.push_back(event); });
    if (progress) progress(static_cast<double>(part) / kParts);
  }
  std::vector<Vec3> centres_m;
  for (const BodySpec& body : spec.bodies) centres_m.push_back(body.bank->rigid.centre_m);
  Simulation all = collect(events, centres_m);
  all.steps = world.get_statistics().steps;
  return all;
}

}  // namespace carillon::physics
