#include "runtime/drive/touches.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "runtime/base/definite.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/quaternion.hpp"
#include "runtime/drive/hit_sounds.hpp"
#include "runtime/drive/lasting.hpp"
#include "runtime/drive/mode_sets.hpp"
#include "runtime/drive/touch_bodies.hpp"
#include "runtime/drive/touch_spots.hpp"

namespace carillon::drive {
namespace {

constexpr double kMotionS = 2e-3;               // s; interval of motions
constexpr double kUnitTolerance = 1e-3;         // of quaternions
constexpr double kNormalTolerance = 1e-2;       // of normals of points
constexpr std::size_t kMaxWaiting = 1'000'000;  // events

constexpr double kMost = 1e9;  // of any unit; squares stay finite

bool is_sane(double x) { return std::abs(x) <= kMost; }
bool is_sane(const Vec3& x) { return is_sane(x[0]) && is_sane(x[1]) && is_sane(x[2]); }
bool is_nan(const Vec3& x) { return std::isnan(x[0]) || std::isnan(x[1]) || std::isnan(x[2]); }
void require(bool holds, const std::string& fault) {
  if (!holds) throw InputError(fault);
}
bool is_positive(double x) { return x > 0.0 && std::isfinite(x); }

void check_options(const TouchesOptions& o) {
  require(o.max_points >= 1 && o.max_points <= 1 << 24, "max_points: give 1 to 16,777,216");
  require(o.max_impacts >= 0, "max_impacts: give 0 or more");
  require(is_sane(o.gravity_m_s2), "gravity_m_s2: give finite numbers of at most 1e9");
  require(o.slowest_m_s >= 0.0 && std::isfinite(o.slowest_m_s), "slowest_m_s: give 0 or more");
  require(is_positive(o.longest_hit_s), "longest_hit_s: give more than 0");
  require(is_positive(o.ground_young_pa), "ground_young_pa: give more than 0");
  require(is_positive(o.ground_density_kg_m3), "ground_density_kg_m3: give more than 0");
  require(o.ground_poisson > -1.0 && o.ground_poisson < 0.5, "ground_poisson: give more than -1 and less than 0.5");
  require(o.ground_restitution >= 0.0 && o.ground_restitution <= 1.0, "ground_restitution: give 0 to 1");
  require(o.ground_friction >= 0.0 && std::isfinite(o.ground_friction), "ground_friction: give 0 or more");
}

/// Zeros become the values of the bank.
TouchesBody complete(TouchesBody body, const geometry::Shape* shape) {
  const auto fill = [](double& value, double of_bank) {
    if (value == 0.0) value = of_bank;
  };
  if (const bank::Bank* bank = body.bank) {
    const bool has_mass = body.mass_kg != 0.0;
    fill(body.mass_kg, bank->rigid.mass_kg);
    fill(body.young_pa, bank->material.young_modulus_pa);
    fill(body.poisson, bank->material.poisson_ratio);
    fill(body.density_kg_m3, bank->material.density_kg_m3);
    fill(body.size_m, shape->get_size_m());
    if (body.inertia_kg_m2 == std::array<double, 9>{}) {
      body.inertia_kg_m2 = bank->rigid.inertia_kg_m2;
      if (has_mass && bank->rigid.mass_kg > 0.0)
        for (double& x : body.inertia_kg_m2) x *= body.mass_kg / bank->rigid.mass_kg;
    }
  } else if (body.inertia_kg_m2 == std::array<double, 9>{}) {
    const double ball = 0.1 * body.mass_kg * body.size_m * body.size_m;  // 2/5 m r^2
    body.inertia_kg_m2 = {ball, 0, 0, 0, ball, 0, 0, 0, ball};
  }
  return body;
}

void check_body(const TouchesBody& b) {
  require(b.body >= -1, "body: give its number in the synthesiser, or -1 for a silent body");
  require(b.bank != nullptr || b.body < 0, "bank: a body that sounds needs one; only silent bodies, whose body is -1, have none");
  const std::string of_bank = b.bank != nullptr ? ", or 0 for that of the bank" : "; the body has no bank to take it from";
  require(is_positive(b.young_pa), "young_pa: give more than 0" + of_bank);
  require(is_positive(b.density_kg_m3), "density_kg_m3: give more than 0" + of_bank);
  require(b.poisson > -1.0 && b.poisson <= 0.5, "poisson: give more than -1 and at most 0.5");
  require(is_positive(b.size_m), "size_m: give more than 0" + of_bank);
  require(b.restitution >= 0.0 && b.restitution <= 1.0, "restitution: give 0 to 1");
  require(b.friction >= 0.0 && std::isfinite(b.friction), "friction: give 0 or more");
  if (b.fixed) return;
  require(is_positive(b.mass_kg), "mass_kg: a body that moves needs more than 0" + of_bank);
  const Mat3 inertia = make_matrix(b.inertia_kg_m2);
  const bool is_set = is_sane(inertia[0]) && is_sane(inertia[1]) && is_sane(inertia[2]);
  require(is_set && is_positive_definite(inertia), "inertia_kg_m2: a body that moves needs a positive definite matrix" + of_bank);
}

void check_pose(const TouchesPose& pose, std::size_t index) {
  const auto& q = pose.rotation;
  const double size = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  if (!is_sane(pose.position_m) || !is_sane(pose.velocity_m_s) || !is_sane(pose.spin_rad_s) || !std::isfinite(size))
    throw InputError("the pose of body " + std::to_string(index) + " has a number that is not finite, or above 1e9");
  if (std::abs(std::sqrt(size) - 1.0) > kUnitTolerance)
    throw InputError("the rotation of body " + std::to_string(index) + " is no unit quaternion");
}

}  // namespace

class Touches::Course {
 public:
  Course(const TouchesOptions& options, Sink sink) : options_(options), sink_(std::move(sink)) {
    check_options(options_);
    scene_.ground = {.young_modulus_pa = options_.ground_young_pa,
                     .poisson_ratio = options_.ground_poisson,
                     .density_kg_m3 = options_.ground_density_kg_m3,
                     .fixed = true};
  }

  int add(const TouchesBody& given);
  void remove(int index);
  void start(double time_s, std::span<const TouchesPose> poses);
  bool step(double time_s, std::span<const TouchesPose> poses, std::span<const TouchPoint> points);

  int count() const { return static_cast<int>(bodies_.size()); }
  double get_mark_s() const { return mark_s_.load(std::memory_order_acquire); }
  const TouchesCounters& get_counters() const { return counters_; }

 private:
  void check_poses(std::span<const TouchesPose> poses) const;
  void take_poses(std::span<const TouchesPose> poses);
  void take_points(const StepView& step, std::span<const TouchPoint> points);
  bool take_point(const StepView& step, const TouchPoint& given);
  void end_teleported();
  void add_motions(bool all);
  void hand_over(double mark_s);
  bool flush();

  TouchesOptions options_;
  Sink sink_;
  Scene scene_;
  std::vector<Motion> before_;
  std::vector<TouchBody> bodies_;
  std::map<const bank::Bank*, std::pair<std::shared_ptr<const geometry::Shape>, std::shared_ptr<const SharpEdges>>> shapes_;
  ModeSets modes_;
  TouchSpots spots_;
  HitSounds sounds_;
  LastingContacts lasting_;
  TouchesCounters counters_;
  std::deque<events::Event> waiting_;  // not taken by the sink yet
  bool is_started_ = false;
  double moved_s_ = 0.0;             // time of the last motions
  std::vector<char> stirred_;        // 1: moved since its last motion event, 2: reported with this step
  double last_mark_s_ = 0.0;         // queued
  std::atomic<double> mark_s_{0.0};  // passed to the sink
  // Of the current step:
  std::vector<StepPoint> points_;
  std::vector<FinishedHit> hits_;
  std::vector<Load> loads_;
  std::vector<events::Event> events_;
};

int Touches::Course::add(const TouchesBody& given) {
  TouchBody body;
  if (given.bank != nullptr) {
    auto found = shapes_.find(given.bank);
    if (found == shapes_.end()) {
      auto shape = std::make_shared<const geometry::Shape>(given.bank->vertices_m, given.bank->triangles);
      auto edges = std::make_shared<const SharpEdges>(given.bank->vertices_m, given.bank->triangles, shape->get_size_m());
      found = shapes_.emplace(given.bank, std::pair(std::move(shape), std::move(edges))).first;
    }
    std::tie(body.shape, body.edges) = found->second;
    body.modes = given.body >= 0 ? modes_.find(*given.bank) : nullptr;
  }
  body.given = complete(given, body.shape.get());
  check_body(body.given);
  body.is_used = true;
  if (!given.fixed) {
    body.inertia = make_matrix(body.given.inertia_kg_m2);
    body.inverse_inertia = calc_inverse(body.inertia);
  }
  const auto free = std::find_if(bodies_.begin(), bodies_.end(), [](const TouchBody& b) { return !b.is_used; });
  const int index = static_cast<int>(free - bodies_.begin());
  if (free == bodies_.end()) {
    bodies_.emplace_back();
    scene_.bodies.emplace_back();
    scene_.motions.emplace_back();
    stirred_.push_back(1);
    sounds_.resize(count());
  }
  sounds_.forget(index);
  stirred_[index] = 1;
  scene_.motions[index] = {};
  scene_.bodies[index] = {.name_hash = body.given.name_hash,
                          .young_modulus_pa = body.given.young_pa,
                          .poisson_ratio = body.given.poisson,
                          .density_kg_m3 = body.given.density_kg_m3,
                          .shape = given.body >= 0 ? body.shape.get() : nullptr,
                          .size_m = body.given.size_m,
                          .fixed = given.fixed,
                          .mass_kg = body.given.mass_kg,
                          .centre_m = given.bank != nullptr ? given.bank->rigid.centre_m : Vec3{}};
  bodies_[index] = std::move(body);
  return index;
}

void Touches::Course::remove(int index) {
  if (index < 0 || index >= count() || !bodies_[index].is_used) throw InputError("there is no body " + std::to_string(index));
  events_.clear();
  spots_.forget(index);
  lasting_.end(scene_, index, events_);
  hand_over(last_mark_s_);
  bodies_[index] = {};
  (void)flush();
}

void Touches::Course::check_poses(std::span<const TouchesPose> poses) const {
  if (std::ssize(poses) != count())
    throw InputError("there are " + std::to_string(poses.size()) + " poses for " + std::to_string(count()) + " bodies");
  for (std::size_t i = 0; i < poses.size(); ++i)
    if (bodies_[i].is_used) check_pose(poses[i], i);
}

void Touches::Course::start(double time_s, std::span<const TouchesPose> poses) {
  require(is_sane(time_s), "time_s is not finite, or above 1e9 s");
  check_poses(poses);
  is_started_ = true;
  scene_.time_s = scene_.before_s = time_s;
  events_.clear();
  take_poses(poses);
  for (int i = 0; i < count(); ++i) {
    spots_.forget(i);
    sounds_.forget(i);
    lasting_.end(scene_, i, events_);
    bodies_[i].is_new = false;
    stirred_[i] = 1;
  }
  add_motions(true);
  hand_over(time_s);
  (void)flush();
}

void Touches::Course::take_poses(std::span<const TouchesPose> poses) {
  before_ = scene_.motions;
  for (int i = 0; i < count(); ++i) {
    TouchBody& body = bodies_[i];
    if (!body.is_used) continue;
    Motion& now = scene_.motions[i];
    const TouchesPose& pose = poses[i];
    const bool has_moved = pose.position_m != body.pose.position_m || pose.rotation != body.pose.rotation;
    if (has_moved || pose.asleep != body.pose.asleep) stirred_[i] = 1;
    now.centre_m = pose.position_m;
    now.velocity_m_s = pose.velocity_m_s;
    now.spin_rad_s = pose.spin_rad_s;
    now.rotation = make_rotation(normalise(pose.rotation));
    now.inverse_inertia = now.rotation * (body.inverse_inertia * transpose(now.rotation));
    now.is_still = pose.asleep || (body.given.fixed && !has_moved && pose.velocity_m_s == Vec3{} && pose.spin_rad_s == Vec3{});
    body.pose = pose;
    if (body.is_new || pose.teleported) before_[i] = now;
  }
}

bool Touches::Course::step(double time_s, std::span<const TouchesPose> poses, std::span<const TouchPoint> points) {
  require(is_started_, "no start: give time and poses before the first step to start()");
  require(is_sane(time_s), "time_s is not finite, or above 1e9 s");
  require(time_s > scene_.time_s, "time_s must be later than that of the last step");
  check_poses(poses);
  scene_.before_s = std::exchange(scene_.time_s, time_s);
  events_.clear();
  hits_.clear();
  loads_.clear();
  ++counters_.steps;
  take_poses(poses);
  const StepView view{scene_, before_, bodies_, options_, scene_.time_s - scene_.before_s};
  end_teleported();
  take_points(view, points);
  solve_impulses(view, points_);
  spots_.advance(view, points_, counters_, hits_, loads_);
  for (const FinishedHit& hit : hits_)
    for (const int body : {hit.a, hit.b})
      if (body >= 0) stirred_[body] = 2;
  const double open_s = spots_.find_first_open(scene_.time_s);
  sounds_.add(view, hits_, open_s, lasting_, counters_, events_);
  for (Load& load : loads_) load.rattles = sounds_.is_rattling(load.spot, scene_.time_s);
  lasting_.update(scene_, loads_, true, events_);
  counters_.touches = lasting_.count_begun();
  add_motions(scene_.time_s - moved_s_ >= kMotionS - 1e-9);
  for (TouchBody& body : bodies_) body.is_new = false;
  hand_over(open_s);
  return flush();
}

/// Their contacts end, and a motion event reports the jump.
void Touches::Course::end_teleported() {
  for (int i = 0; i < count(); ++i) {
    if (!bodies_[i].is_used || !bodies_[i].pose.teleported) continue;
    ++counters_.teleports;
    spots_.forget(i);
    lasting_.end(scene_, i, events_);
    stirred_[i] = 2;
  }
}

void Touches::Course::take_points(const StepView& view, std::span<const TouchPoint> points) {
  points_.clear();
  for (const TouchPoint& point : points)
    if (!take_point(view, point)) ++counters_.bad_points;
  const auto strength = [](const StepPoint& p) { return p.is_impulse_known ? p.impulse_n_s : -p.gap_m; };
  if (std::ssize(points_) > options_.max_points) {
    counters_.dropped_points += std::ssize(points_) - options_.max_points;
    std::stable_sort(points_.begin(), points_.end(), [&](const StepPoint& x, const StepPoint& y) { return strength(x) > strength(y); });
    points_.resize(options_.max_points);
  }
  counters_.points += std::ssize(points_);
  // An order that does not depend on the engine's.
  const auto name = [&](int body) { return std::pair(scene_.get_matter(body).name_hash, body); };
  std::stable_sort(points_.begin(), points_.end(), [&](const StepPoint& x, const StepPoint& y) {
    if (x.a != y.a) return name(x.a) < name(y.a);
    if (x.b != y.b) return name(x.b) < name(y.b);
    if (strength(x) != strength(y)) return strength(x) > strength(y);
    return x.where_m < y.where_m;
  });
}

/// False if it cannot be used. Points of two bodies that do not move are ignored, and those of bodies that have just been set somewhere.
bool Touches::Course::take_point(const StepView& view, const TouchPoint& given) {
  const auto is_body = [&](int body) { return body >= 0 && body < count() && bodies_[body].is_used; };
  if (!is_body(given.a) || (given.b != -1 && !is_body(given.b)) || given.a == given.b) return false;
  const auto is_usable = [](double x) { return std::isnan(x) || is_sane(x); };
  if (!is_sane(given.point_m) || !is_sane(given.normal) || !is_sane(given.gap_m) || !is_usable(given.impulse_n_s) ||
      !is_usable(given.curvature_per_m))
    return false;
  const double length = norm(given.normal);
  if (std::abs(length - 1.0) > kNormalTolerance || (!is_nan(given.friction_n_s) && !is_sane(given.friction_n_s))) return false;
  if (!view.moves(given.a) && !view.moves(given.b)) return true;
  for (const int body : {given.a, given.b})
    if (body >= 0 && (bodies_[body].is_new || bodies_[body].pose.teleported)) return true;
  StepPoint p;
  p.a = given.a;
  p.b = given.b;
  p.normal = (1.0 / length) * given.normal;
  p.gap_m = given.gap_m;
  p.is_impulse_known = !std::isnan(given.impulse_n_s);
  p.impulse_n_s = p.is_impulse_known ? std::max(0.0, given.impulse_n_s) : 0.0;
  p.is_friction_known = !is_nan(given.friction_n_s);
  if (p.is_friction_known) p.friction_n_s = given.friction_n_s;
  p.curvature_per_m = given.curvature_per_m;
  std::array<Vec3, 2> sides{given.point_m + given.gap_m * p.normal, given.point_m};
  const auto name = [&](int body) { return std::pair(scene_.bodies[body].name_hash, body); };
  if (p.b >= 0 && name(p.b) < name(p.a)) {
    std::swap(p.a, p.b);
    std::swap(sides[0], sides[1]);
    p.normal = -1.0 * p.normal;
    p.friction_n_s = -1.0 * p.friction_n_s;
  }
  const std::vector<Motion>& motions = view.get_given();
  for (const std::size_t side : {0, 1}) {
    const int body = side == 0 ? p.a : p.b;
    p.stations_m[side] = sides[side];
    if (body >= 0)
      p.stations_m[side] = scene_.bodies[body].centre_m + turn_back(motions[body].rotation, sides[side] - motions[body].centre_m);
  }
  p.where_m = 0.5 * (sides[0] + sides[1]);
  points_.push_back(p);
  return true;
}

/// Motions of bodies that have moved since the last ones if `all`, else of those that were struck.
void Touches::Course::add_motions(bool all) {
  for (int i = 0; i < count(); ++i) {
    const TouchBody& body = bodies_[i];
    if (!body.is_used || body.given.body < 0 || stirred_[i] < (all ? 1 : 2)) continue;
    events::BodyMotion motion{scene_.time_s, i, body.pose.position_m, body.pose.velocity_m_s, body.pose.rotation};
    motion.cut = body.pose.teleported;
    events_.push_back(motion);
    stirred_[i] = 0;
  }
  if (all) moved_s_ = scene_.time_s;
}

/// Queues the events in time order, with the numbers of the synthesiser, and a mark.
void Touches::Course::hand_over(double mark_s) {
  std::stable_sort(events_.begin(), events_.end(),
                   [](const events::Event& x, const events::Event& y) { return events::get_time_s(x) < events::get_time_s(y); });
  const auto number = [&](int body) { return body < 0 ? -1 : bodies_[body].given.body; };
  for (events::Event& event : events_) {
    std::visit(
        [&](auto& e) {
          if constexpr (requires { e.body; }) e.body = number(e.body);
          if constexpr (requires { e.other; }) e.other = number(e.other);
        },
        event);
    if (events::find_fault(event) != nullptr) {  // of extreme input
      ++counters_.lost;
      continue;
    }
    if (std::holds_alternative<events::LastingContact>(event)) ++counters_.records;
    waiting_.push_back(event);
  }
  if (!waiting_.empty() && std::holds_alternative<events::TimeWatermark>(waiting_.back())) waiting_.pop_back();  // the new one says more
  waiting_.push_back(events::TimeWatermark{mark_s});
  last_mark_s_ = mark_s;
  for (; waiting_.size() > kMaxWaiting; waiting_.pop_front()) ++counters_.lost;
}

bool Touches::Course::flush() {
  for (; !waiting_.empty() && sink_(waiting_.front()); waiting_.pop_front())
    if (const auto* mark = std::get_if<events::TimeWatermark>(&waiting_.front())) mark_s_.store(mark->time_s, std::memory_order_release);
  counters_.waiting = std::ssize(waiting_);
  return waiting_.empty();
}

Touches::Touches(const TouchesOptions& options, Sink sink) : course_(std::make_unique<Course>(options, std::move(sink))) {}
Touches::~Touches() = default;

int Touches::add(const TouchesBody& body) { return course_->add(body); }
void Touches::remove(int index) { course_->remove(index); }
void Touches::start(double time_s, std::span<const TouchesPose> poses) { course_->start(time_s, poses); }
bool Touches::step(double time_s, std::span<const TouchesPose> poses, std::span<const TouchPoint> points) {
  return course_->step(time_s, poses, points);
}
double Touches::get_mark_s() const noexcept { return course_->get_mark_s(); }
const TouchesCounters& Touches::get_counters() const noexcept { return course_->get_counters(); }
int Touches::count() const noexcept { return course_->count(); }

}  // namespace carillon::drive
