// Method:     every touching point that does not strike is a damped spring (resting.cpp). Which points there are changes from step to
//             step; the books of each pair see to it that no change brings energy.
// Source:     none.
// Deviations: none.
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "runtime/contact/engine.hpp"

namespace carillon::contact {
namespace {

using SimTK::dot;
using SimTK::Transform;
using Point = SimTK::Vec3;

constexpr double kSink = 2e-5;       // m; how far a resting body sinks into its contact under its own weight
constexpr double kHeld = 1e-3;       // of the size; a point that holds a body up is held so far from where it was found last
constexpr double kTakesOver = 0.02;  // rad; so far below the plane a neighbour takes over (touch.cpp)
constexpr double kSettling =
    0.1;  // s; in which the share of a load that a point takes falls to what is its own, and a spring that begins deep comes up at most
constexpr double kRolling = 2e-3;  // rolling resistance arm over the size of the smaller body; hard bodies on hard floors: 1e-3 to 5e-3

Point to_vec(const std::array<double, 3>& x) { return {x[0], x[1], x[2]}; }

/// The springs of two bodies when the points between them change: what those that are there no more, or take less, have left, and what
/// those that come, and those that could take more, would hold.
struct PairBooks {
  int points = 0;
  double left_j = 0.0, new_j = 0.0, rise_j = 0.0, lift_j = 0.0;
};

/// How much of what is wanted there is, 0..1.
double calc_part(double there_is, double wanted) { return wanted > 0.0 ? std::clamp(there_is / wanted, 0.0, 1.0) : 1.0; }

bool is_same(const TouchPoint& x, const TouchPoint& y) { return x.a == y.a && x.b == y.b && x.feature == y.feature; }

/// What the spring of a point holds [J] at the depth of its touch when it begins at that depth.
double calc_spring_j(const RestingPoint& p, double offset_m) {
  const double pressed = std::max(0.0, p.touch.depth_m - offset_m);
  return 0.5 * p.stiffness_n_m * pressed * pressed;
}

/// Whether no neighbour of a vertex is clearly below it along a normal of the plane that it stands on: where a body rolls, its corners take
/// turns.
bool is_lowest(const Surface& surface, int vertex, const Point& normal) {
  for (const int w : surface.neighbours(vertex)) {
    const Point d = surface.vertex(w) - surface.vertex(vertex);
    if (dot(d, normal) < -kTakesOver * d.norm()) return false;
  }
  return true;
}

}  // namespace

void Engine::add_held(std::vector<TouchPoint>& touches, const Snapshot& now) const {
  for (const RestingPoint& p : resting_->points()) {
    if (std::any_of(touches.begin(), touches.end(), [&](const TouchPoint& t) { return is_same(t, p.touch); })) continue;
    TouchPoint t = p.touch;
    place_touch(t, now.poses[t.a], t.b >= 0 ? now.poses[t.b] : Transform());
    if (t.depth_m <= p.offset_m) continue;
    const int carrier = t.plane_on_b ? t.a : t.b, plane = t.plane_on_b ? t.b : t.a;
    const Transform X_plane = plane >= 0 ? now.poses[plane] : Transform();
    const Point away = t.where - X_plane * t.plane_point, outward = X_plane.R() * t.plane_normal;
    if (t.feature[0] != 2 && !is_lowest(surface(carrier), t.feature[1], ~now.poses[carrier].R() * outward)) continue;
    if ((away - dot(away, outward) * outward).norm() < kHeld * surface(t.a).size_m()) touches.push_back(t);
  }
}

/// Points of a pair share its load, and which of them there are changes from step to step. Their springs must not hold more after a change
/// than before, or what sways on them is pushed at every sway and never lies. So the share of one that stays falls little by little, for
/// what it holds would be lost; what others leave, first those that come may have (a spring begins at the depth where it holds no more than
/// that), then those whose share could rise, then springs that began deep and may come up.
void Engine::set_resting(const std::vector<TouchPoint>& touches, const Snapshot& now) {
  const double passed = std::max(0.0, now.time_s - rested_s_);
  rested_s_ = now.time_s;
  std::map<std::pair<int, int>, PairBooks> books;
  for (const TouchPoint& t : touches) ++books[{t.a, t.b}].points;
  for (RestingPoint gone : resting_->points()) {
    if (std::any_of(touches.begin(), touches.end(), [&](const TouchPoint& t) { return is_same(t, gone.touch); })) continue;
    place_touch(gone.touch, now.poses[gone.touch.a], gone.touch.b >= 0 ? now.poses[gone.touch.b] : Transform());
    books[{gone.touch.a, gone.touch.b}].left_j += calc_spring_j(gone, gone.offset_m);
  }
  std::vector<RestingPoint> points;
  for (const TouchPoint& t : touches) {
    RestingPoint p = make_resting(t);
    PairBooks& pair = books[{t.a, t.b}];
    p.share = 1.0 / pair.points;
    const auto old = std::find_if(rested_.begin(), rested_.end(),
                                  [&](const RestedPoint& o) { return o.a == t.a && o.b == t.b && o.feature == t.feature; });
    p.is_new = old == rested_.end();
    if (p.is_new) {
      pair.new_j += p.share * calc_spring_j(p, 0.0);
    } else {
      pair.left_j += old->share * calc_spring_j(p, old->offset_m);
      const double stays = std::exp(-passed / kSettling);
      p.share = std::min(old->share, p.share + (old->share - p.share) * stays);
      p.offset_m = old->offset_m;
      const double held = p.share * calc_spring_j(p, p.offset_m);
      pair.left_j -= held;
      pair.rise_j += std::max(0.0, 1.0 / pair.points - p.share) * calc_spring_j(p, p.offset_m);
      pair.lift_j += p.share * calc_spring_j(p, p.offset_m * stays) - held;
    }
    points.push_back(p);
  }
  rested_.clear();
  for (RestingPoint& p : points) {
    const PairBooks& pair = books[{p.touch.a, p.touch.b}];
    if (p.is_new) {
      p.offset_m = std::max(0.0, p.touch.depth_m) * (1.0 - std::sqrt(calc_part(pair.left_j, pair.new_j)));
    } else {
      p.share += std::max(0.0, 1.0 / pair.points - p.share) * calc_part(pair.left_j - pair.new_j, pair.rise_j);
      const double lifted = calc_part(pair.left_j - pair.new_j - pair.rise_j, pair.lift_j);
      p.offset_m *= 1.0 + lifted * lifted * (std::exp(-passed / kSettling) - 1.0);
    }
    p.stiffness_n_m *= p.share;
    p.damping_n_s_m *= p.share;
    rested_.push_back({p.touch.a, p.touch.b, p.touch.feature, p.share, p.offset_m});
  }
  resting_->set_points(std::move(points));
}

/// A point that takes all of the load.
RestingPoint Engine::make_resting(const TouchPoint& t) const {
  const double omega = std::sqrt(std::max(to_vec(world_.gravity_m_s2).norm(), 1.0) / kSink);
  RestingPoint p;
  p.touch = t;
  p.body_a = bodies_[t.a].mobilized;
  p.frame_a = bodies_[t.a].frame;
  p.body_b = t.b >= 0 ? bodies_[t.b].mobilized : SimTK::MobilizedBodyIndex(0);
  if (t.b >= 0) p.frame_b = bodies_[t.b].frame;
  double inverse_mass = is_fixed(t.a) ? 0.0 : 1.0 / world_.bodies[t.a].mass_kg;
  if (t.b >= 0 && !is_fixed(t.b)) inverse_mass += 1.0 / world_.bodies[t.b].mass_kg;
  p.stiffness_n_m = omega * omega / inverse_mass;
  p.damping_n_s_m = 2.0 * omega / inverse_mass;  // critical
  p.rolling_arm_m = kRolling * 10.0 * spot_radius_m(t.a, t.b);
  p.friction = make_impact_point(t).friction;
  return p;
}

std::vector<PushedPoint> Engine::calc_pushes(const Snapshot& now) const {
  std::vector<PushedPoint> pushed;
  for (const RestingPoint& p : resting_->points()) {
    TouchPoint t = p.touch;
    place_touch(t, now.poses[t.a], t.b >= 0 ? now.poses[t.b] : Transform());
    const Point turn = now.mobiles[t.a].spin - (t.b >= 0 ? now.mobiles[t.b].spin : Point(0));
    const double push = calc_push(p, t.depth_m - p.offset_m, dot(calc_relative_velocity(now.mobiles, make_impact_point(t)), t.normal),
                                  (turn - dot(turn, t.normal) * t.normal).norm());
    if (push > 0.0) pushed.push_back({t, push});
  }
  return pushed;
}

double Engine::calc_kinetic_j(const Snapshot& now) const {
  double energy = 0.0;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (world_.bodies[i].fixed) continue;
    const Mobile& m = now.mobiles[i];
    const Point spin = ~now.poses[i].R() * m.spin;
    energy += 0.5 * (world_.bodies[i].mass_kg * m.velocity.normSqr() + dot(spin, bodies_[i].inertia * spin));
  }
  return energy;
}

double Engine::calc_energy_j(const Snapshot& now) const {
  double energy = calc_kinetic_j(now);
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (!world_.bodies[i].fixed) energy -= world_.bodies[i].mass_kg * dot(to_vec(world_.gravity_m_s2), now.mobiles[i].centre);
  }
  for (RestingPoint p : resting_->points()) {
    place_touch(p.touch, now.poses[p.touch.a], p.touch.b >= 0 ? now.poses[p.touch.b] : Transform());
    energy += calc_spring_j(p, p.offset_m);
  }
  return energy;
}

}  // namespace carillon::contact
