// Contact tracker of the C interface.
#include "runtime/drive/touches.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "runtime/bindings/c_api/calls.hpp"
#include "runtime/bindings/c_api/structures.hpp"

using namespace carillon;
using namespace carillon::c_api;

namespace carillon::c_api {

template <>
carillon_touches_options make_default() {
  const drive::TouchesOptions ours;
  carillon_touches_options options{};
  options.max_points = ours.max_points;
  options.max_impacts = ours.max_impacts;
  std::copy(ours.gravity_m_s2.begin(), ours.gravity_m_s2.end(), options.gravity_m_s2);
  options.longest_hit_s = ours.longest_hit_s;
  options.ground_young_pa = ours.ground_young_pa;
  options.ground_poisson = ours.ground_poisson;
  options.ground_density_kg_m3 = ours.ground_density_kg_m3;
  options.ground_restitution = ours.ground_restitution;
  options.ground_friction = ours.ground_friction;
  return options;
}

template <>
carillon_touches_body make_default() {
  const drive::TouchesBody ours;
  carillon_touches_body body{};
  body.body = -1;
  body.restitution = ours.restitution;
  body.friction = ours.friction;
  return body;
}

namespace {

/// Passes events to a sink of C, as the structures of carillon_push_*.
class SinkCaller {
 public:
  SinkCaller(void (*sink)(void*, int32_t, const void*), void* user) : sink_(sink), user_(user) {}

  void operator()(const events::TimeWatermark& mark) const { sink_(user_, CARILLON_EVENT_MARK, &mark.time_s); }
  void operator()(const events::Listener&) const {}
  void operator()(const events::Impulse& e) const {
    carillon_impulse impulse;
    carillon_impulse_init(&impulse);
    set_place(e, impulse);
    std::copy(e.impulse_n_s.begin(), e.impulse_n_s.end(), impulse.impulse_n_s);
    impulse.duration_s = e.duration_s;
    sink_(user_, CARILLON_EVENT_IMPULSE, &impulse);
  }
  void operator()(const events::Force& e) const {
    carillon_force force;
    carillon_force_init(&force);
    set_place(e, force);
    double impulses[events::kMaxForceSteps][3];
    for (int k = 0; k < e.count; ++k) std::copy(e.impulse_n_s[k].begin(), e.impulse_n_s[k].end(), impulses[k]);
    force.step_s = e.step_s;
    force.impulse_n_s = impulses;
    force.count = e.count;
    force.continues = e.continues ? 1 : 0;
    sink_(user_, CARILLON_EVENT_FORCE, &force);
  }
  void operator()(const events::LastingContact& e) const {
    carillon_contact contact;
    carillon_contact_init(&contact);
    set_place(e, contact);
    contact.state = static_cast<int32_t>(e.state);
    contact.id = e.id;
    std::copy(e.normal.begin(), e.normal.end(), contact.normal);
    std::copy(e.slip_m_s.begin(), e.slip_m_s.end(), contact.slip_m_s);
    contact.force_n = e.force_n;
    contact.sweep_m_s = e.sweep_m_s;
    contact.other_sweep_m_s = e.other_sweep_m_s;
    contact.spin_rad_s = e.spin_rad_s;
    contact.patch_radius_m = e.patch_radius_m;
    contact.impedance_n_s_m = e.impedance_n_s_m;
    sink_(user_, CARILLON_EVENT_CONTACT, &contact);
  }
  void operator()(const events::BodyMotion& e) const {
    carillon_motion motion;
    carillon_motion_init(&motion);
    motion.body = e.body;
    motion.time_s = e.time_s;
    std::copy(e.position_m.begin(), e.position_m.end(), motion.position_m);
    std::copy(e.velocity_m_s.begin(), e.velocity_m_s.end(), motion.velocity_m_s);
    std::copy(e.rotation.begin(), e.rotation.end(), motion.rotation);
    motion.cut = e.cut ? 1 : 0;
    sink_(user_, CARILLON_EVENT_MOTION, &motion);
  }

 private:
  template <class Event, class Given>
  static void set_place(const Event& e, Given& given) {
    given.time_s = e.time_s;
    given.body = e.body;
    given.other = e.other;
    given.triangle = e.triangle;
    std::copy(e.barycentric.begin(), e.barycentric.end(), given.barycentric);
  }

  void (*sink_)(void*, int32_t, const void*);
  void* user_;
};

drive::Touches::Sink make_sink(carillon_synth* synth, const carillon_touches_options& options) {
  if (options.sink == nullptr) return [synth](const events::Event& event) { return synth->synthesiser.push(event); };
  return [call = SinkCaller(options.sink, options.user)](const events::Event& event) {
    std::visit(call, event);
    return true;
  };
}

drive::TouchesOptions to_options(const carillon_touches_options& given) {
  return {.max_points = given.max_points,
          .points_after = given.points_after != 0,
          .compliant = given.compliant != 0,
          .early = given.early != 0,
          .max_impacts = given.max_impacts,
          .gravity_m_s2 = to_vector(given.gravity_m_s2),
          .slowest_m_s = given.slowest_m_s,
          .longest_hit_s = given.longest_hit_s,
          .ground_young_pa = given.ground_young_pa,
          .ground_poisson = given.ground_poisson,
          .ground_density_kg_m3 = given.ground_density_kg_m3,
          .ground_restitution = given.ground_restitution,
          .ground_friction = given.ground_friction};
}

drive::TouchesBody to_body(const carillon_touches_body& given) {
  drive::TouchesBody body{.body = given.body,
                          .fixed = given.fixed != 0,
                          .bank = given.bank != nullptr ? &given.bank->bank : nullptr,
                          .name_hash = given.name_seed,
                          .mass_kg = given.mass_kg,
                          .young_pa = given.young_pa,
                          .poisson = given.poisson,
                          .density_kg_m3 = given.density_kg_m3,
                          .size_m = given.size_m,
                          .restitution = given.restitution,
                          .friction = given.friction};
  std::copy_n(given.inertia_kg_m2, body.inertia_kg_m2.size(), body.inertia_kg_m2.begin());
  return body;
}

drive::TouchesPose to_pose(const carillon_pose& given) {
  return {.position_m = to_vector(given.position_m),
          .rotation = to_quaternion(given.rotation),
          .velocity_m_s = to_vector(given.velocity_m_s),
          .spin_rad_s = to_vector(given.spin_rad_s),
          .asleep = (given.flags & CARILLON_ASLEEP) != 0,
          .teleported = (given.flags & CARILLON_TELEPORTED) != 0,
          .jointed = (given.flags & CARILLON_JOINTED) != 0};
}

drive::TouchPoint to_point(const carillon_point& given) {
  return {.a = given.a,
          .b = given.b,
          .point_m = to_vector(given.point_m),
          .normal = to_vector(given.normal),
          .gap_m = given.gap_m,
          .impulse_n_s = given.impulse_n_s,
          .friction_n_s = to_vector(given.friction_n_s),
          .curvature_per_m = given.curvature_per_m};
}

}  // namespace
}  // namespace carillon::c_api

struct carillon_touches {
  carillon_touches(const drive::TouchesOptions& options, drive::Touches::Sink sink) : touches(options, std::move(sink)) {}

  /// The array may be shorter than its count says, so a wrong count is refused before it is read.
  void set_poses(const carillon_pose* given, int32_t bodies) {
    if (bodies != touches.count())
      throw InputError("bodies is " + std::to_string(bodies) + "; give " + std::to_string(touches.count()) +
                       " poses, one for each index of carillon_touches_add");
    poses.clear();
    for (int32_t i = 0; i < bodies; ++i) poses.push_back(to_pose(given[i]));
  }

  drive::Touches touches;
  std::vector<drive::TouchesPose> poses;
  std::vector<drive::TouchPoint> points;
};

extern "C" {

void carillon_touches_options_init_sized(carillon_touches_options* options, size_t size) { init(options, size); }
void carillon_touches_body_init_sized(carillon_touches_body* body, size_t size) { init(body, size); }
void carillon_touches_counters_init_sized(carillon_touches_counters* counters, size_t size) { init(counters, size); }

carillon_status carillon_touches_create(carillon_synth* synth, const carillon_touches_options* options, carillon_touches** touches,
                                        char* message, size_t message_size) {
  const auto ours = read(options);
  if (touches != nullptr) *touches = nullptr;
  if (touches == nullptr || !ours || (synth == nullptr && ours->sink == nullptr))
    return refuse("carillon_touches_create: touches must not be NULL, options must be initialised, and need a sink where synth is NULL",
                  message, message_size);
  return run(message, message_size, [&] { *touches = new carillon_touches(to_options(*ours), make_sink(synth, *ours)); });
}

void carillon_touches_destroy(carillon_touches* touches) { delete touches; }

carillon_status carillon_touches_add(carillon_touches* touches, const carillon_touches_body* body, int32_t* index, char* message,
                                     size_t message_size) {
  const auto ours = read(body);
  if (index != nullptr) *index = -1;
  if (touches == nullptr || index == nullptr || !ours)
    return refuse("carillon_touches_add: touches and index must not be NULL, body must be initialised", message, message_size);
  return run(message, message_size, [&] { *index = touches->touches.add(to_body(*ours)); });
}

carillon_status carillon_touches_remove(carillon_touches* touches, int32_t index) {
  if (touches == nullptr) return CARILLON_BAD_ARGUMENT;
  return run(nullptr, 0, [&] { touches->touches.remove(index); });
}

carillon_status carillon_touches_start(carillon_touches* touches, double time_s, const carillon_pose* poses, int32_t bodies, char* message,
                                       size_t message_size) {
  if (touches == nullptr || (poses == nullptr && bodies != 0))
    return refuse("carillon_touches_start: touches and poses must not be NULL", message, message_size);
  return run(message, message_size, [&] {
    touches->set_poses(poses, bodies);
    touches->touches.start(time_s, touches->poses);
  });
}

carillon_status carillon_touches_step(carillon_touches* touches, double time_s, const carillon_pose* poses, int32_t bodies,
                                      const carillon_point* points, int32_t count, char* message, size_t message_size) {
  if (touches == nullptr || (poses == nullptr && bodies != 0) || (points == nullptr && count != 0))
    return refuse("carillon_touches_step: touches, poses and points must not be NULL", message, message_size);
  bool has_room = true;
  const carillon_status status = run(message, message_size, [&] {
    if (count < 0) throw InputError("count is " + std::to_string(count) + "; give the number of points, 0 or more");
    touches->set_poses(poses, bodies);
    touches->points.clear();
    for (int32_t i = 0; i < count; ++i) touches->points.push_back(to_point(points[i]));
    has_room = touches->touches.step(time_s, touches->poses, touches->points);
  });
  return status == CARILLON_OK && !has_room ? CARILLON_FULL : status;
}

double carillon_touches_mark_s(const carillon_touches* touches) { return touches == nullptr ? 0.0 : touches->touches.get_mark_s(); }

carillon_status carillon_touches_get_counters(const carillon_touches* touches, carillon_touches_counters* counters) {
  if (touches == nullptr || !read(counters)) return CARILLON_BAD_ARGUMENT;
  const drive::TouchesCounters& ours = touches->touches.get_counters();
  write(carillon_touches_counters{.size = 0,
                                  .reserved = 0,
                                  .steps = ours.steps,
                                  .points = ours.points,
                                  .bad_points = ours.bad_points,
                                  .dropped_points = ours.dropped_points,
                                  .hits = ours.hits,
                                  .impacts = ours.impacts,
                                  .simplified = ours.simplified,
                                  .limited = ours.limited,
                                  .masked = ours.masked,
                                  .weights = ours.weights,
                                  .settled = ours.settled,
                                  .cut = ours.cut,
                                  .touches = ours.touches,
                                  .records = ours.records,
                                  .teleports = ours.teleports,
                                  .waiting = ours.waiting,
                                  .lost = ours.lost,
                                  .longest_hit_s = ours.longest_hit_s},
        counters);
  return CARILLON_OK;
}

}  // extern "C"
