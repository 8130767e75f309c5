// Method: projected Gauss-Seidel for the normal impulses >= 0, and friction within Coulomb's cone, whose sum is the change of velocities
// less gravity and gyroscopic terms.
#include <algorithm>
#include <cmath>

#include "runtime/drive/touch_bodies.hpp"

namespace carillon::drive {
namespace {

constexpr int kMaxSweeps = 60;
constexpr double kEnough = 1e-5;  // relative to the largest impulse: change in a sweep

/// Changes of velocity that no impulse explains yet.
class Unexplained {
 public:
  explicit Unexplained(const StepView& step) : step_(step), change_(step.before.size()) {
    for (std::size_t i = 0; i < change_.size(); ++i) {
      if (!can_change(static_cast<int>(i))) continue;
      const Motion &before = step.before[i], &now = step.scene.motions[i];
      const Mat3 inertia = before.rotation * (step.bodies[i].inertia * transpose(before.rotation));
      const Vec3 couple = cross(before.spin_rad_s, inertia * before.spin_rad_s);
      change_[i].linear = now.velocity_m_s - before.velocity_m_s - step.dt_s * step.options.gravity_m_s2;
      change_[i].angular = now.spin_rad_s - before.spin_rad_s + step.dt_s * (before.inverse_inertia * couple);
    }
  }

  bool can_change(int body) const { return step_.moves(body) && step_.bodies[body].is_used && !step_.bodies[body].pose.asleep; }

  double calc_inverse_mass(const StepPoint& p, const Vec3& along) const {
    double sum = 0.0;
    for (const int body : {p.a, p.b}) {
      if (!can_change(body)) continue;
      const Vec3 arm = cross(p.where_m - step_.get_given()[body].centre_m, along);
      sum += 1.0 / step_.scene.bodies[body].mass_kg + dot(arm, step_.before[body].inverse_inertia * arm);
    }
    return sum;
  }

  /// Of a relative to b.
  Vec3 find(const StepPoint& p) const {
    Vec3 sum{};
    for (const int body : {p.a, p.b}) {
      if (!can_change(body)) continue;
      const Vec3 own = change_[body].linear + cross(change_[body].angular, p.where_m - step_.get_given()[body].centre_m);
      sum = body == p.a ? sum + own : sum - own;
    }
    return sum;
  }

  void explain(const StepPoint& p, const Vec3& impulse) {
    for (const int body : {p.a, p.b}) {
      if (!can_change(body)) continue;
      const double sign = body == p.a ? -1.0 : 1.0;
      const Vec3 arm = p.where_m - step_.get_given()[body].centre_m;
      change_[body].linear = change_[body].linear + (sign / step_.scene.bodies[body].mass_kg) * impulse;
      change_[body].angular = change_[body].angular + sign * (step_.before[body].inverse_inertia * cross(arm, impulse));
    }
  }

 private:
  struct Change {
    Vec3 linear{}, angular{};
  };
  const StepView& step_;
  std::vector<Change> change_;
};

/// Returns the change of the point's impulse.
double improve(const StepView& step, Unexplained& rest, StepPoint& p) {
  double moved = 0.0;
  if (!p.is_impulse_known) {
    const double inverse = rest.calc_inverse_mass(p, p.normal);
    if (!(inverse > 0.0)) return 0.0;
    const double impulse = std::max(0.0, p.impulse_n_s + dot(rest.find(p), p.normal) / inverse);
    moved = std::abs(impulse - p.impulse_n_s);
    rest.explain(p, (impulse - p.impulse_n_s) * p.normal);
    p.impulse_n_s = impulse;
  }
  if (p.is_friction_known) return moved;
  const double limit = step.calc_friction(p.a, p.b) * p.impulse_n_s;
  Vec3 wanted = p.friction_n_s;
  for (const Vec3& along : find_tangents(p.normal)) {
    const double inverse = rest.calc_inverse_mass(p, along);
    if (inverse > 0.0) wanted = wanted + (dot(rest.find(p), along) / inverse) * along;
  }
  if (const double size = norm(wanted); size > limit) wanted = (limit / size) * wanted;
  rest.explain(p, wanted - p.friction_n_s);
  p.friction_n_s = wanted;
  return moved;
}

}  // namespace

void solve_impulses(const StepView& step, std::vector<StepPoint>& points) {
  const auto is_known = [](const StepPoint& p) { return p.is_impulse_known && p.is_friction_known; };
  if (std::all_of(points.begin(), points.end(), is_known)) return;
  Unexplained rest(step);
  for (const StepPoint& p : points) rest.explain(p, p.impulse_n_s * p.normal + p.friction_n_s);
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    double moved = 0.0, largest = 0.0;
    for (StepPoint& p : points) {
      if (!is_known(p)) moved = std::max(moved, improve(step, rest, p));
      largest = std::max(largest, p.impulse_n_s);
    }
    if (moved <= kEnough * largest) break;
  }
}

}  // namespace carillon::drive
