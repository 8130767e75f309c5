// Method: projected Gauss-Seidel for the normal impulses >= 0, and friction within Coulomb's cone, whose sum is the change of velocities
// less gravity and gyroscopic terms; each group of touching bodies separately.
#include <algorithm>
#include <cmath>

#include "runtime/base/groups.hpp"
#include "runtime/drive/touch_bodies.hpp"

namespace carillon::drive {
namespace {

constexpr int kMaxSweeps = 20;
constexpr double kEnough = 1e-4;  // relative to the largest impulse of the group: change in a sweep

/// Change of velocity of a body that no impulse explains yet [m/s, rad/s].
struct Change {
  Vec3 linear{}, angular{};
};

/// Row of the Jacobian: one direction at a point, and the change of velocity of both bodies per impulse along it.
struct Row {
  Vec3 along{};
  std::array<Vec3, 2> turning{}, linear{}, angular{};
  double inverse_mass = 0.0;
};

/// A point whose impulse or friction is not known.
struct Unknown {
  StepPoint* point = nullptr;
  std::array<int, 2> bodies{-1, -1};  // -1: its velocity cannot change
  std::array<Row, 3> rows{};          // normal, tangents
  std::array<double, 2> rubbed{};     // friction along the tangents [N s]
  double friction = 0.0;
  int group = 0;
};

double find_speed(const std::vector<Change>& changes, const Unknown& u, const Row& row) {
  double sum = 0.0;
  for (const std::size_t side : {0, 1}) {
    if (u.bodies[side] < 0) continue;
    const Change& change = changes[static_cast<std::size_t>(u.bodies[side])];
    const double own = dot(change.linear, row.along) + dot(change.angular, row.turning[side]);
    sum += side == 0 ? own : -own;
  }
  return sum;
}

void explain(std::vector<Change>& changes, const Unknown& u, const Row& row, double impulse_n_s) {
  for (const std::size_t side : {0, 1}) {
    if (u.bodies[side] < 0) continue;
    Change& change = changes[static_cast<std::size_t>(u.bodies[side])];
    const double given = side == 0 ? -impulse_n_s : impulse_n_s;
    change.linear = change.linear + given * row.linear[side];
    change.angular = change.angular + given * row.angular[side];
  }
}

class Solver {
 public:
  Solver(const StepView& step, std::vector<StepPoint>& points) : step_(step), changes_(step.before.size()) {
    base::Groups groups(static_cast<int>(changes_.size()));
    for (std::size_t i = 0; i < changes_.size(); ++i) find_change(static_cast<int>(i));
    for (StepPoint& p : points) {
      const bool is_known = p.is_impulse_known && p.is_friction_known;
      Unknown u = make(p);
      explain_known(u);
      if (is_known || !(u.rows[0].inverse_mass > 0.0)) continue;
      if (u.bodies[0] >= 0 && u.bodies[1] >= 0) groups.join(u.bodies[0], u.bodies[1]);
      unknowns_.push_back(u);
    }
    for (Unknown& u : unknowns_) u.group = groups.find(std::max(u.bodies[0], u.bodies[1]));
    std::stable_sort(unknowns_.begin(), unknowns_.end(), [](const Unknown& x, const Unknown& y) { return x.group < y.group; });
  }

  void solve() {
    for (auto first = unknowns_.begin(); first != unknowns_.end();) {
      const auto last = std::find_if(first, unknowns_.end(), [&](const Unknown& u) { return u.group != first->group; });
      for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
        double moved = 0.0, largest = 0.0;
        for (auto u = first; u != last; ++u) {
          moved = std::max(moved, improve(*u));
          largest = std::max(largest, u->point->impulse_n_s);
        }
        if (moved <= kEnough * largest) break;
      }
      for (; first != last; ++first)
        if (!first->point->is_friction_known)
          first->point->friction_n_s = first->rubbed[0] * first->rows[1].along + first->rubbed[1] * first->rows[2].along;
    }
  }

 private:
  bool can_change(int body) const { return step_.moves(body) && step_.bodies[body].is_used && !step_.bodies[body].pose.asleep; }

  void find_change(int body) {
    if (!can_change(body)) return;
    const Motion &before = step_.before[body], &now = step_.scene.motions[body];
    const Mat3 inertia = before.rotation * (step_.bodies[body].inertia * transpose(before.rotation));
    const Vec3 couple = cross(before.spin_rad_s, inertia * before.spin_rad_s);
    changes_[body].linear = now.velocity_m_s - before.velocity_m_s - step_.dt_s * step_.options.gravity_m_s2;
    changes_[body].angular = now.spin_rad_s - before.spin_rad_s + step_.dt_s * (before.inverse_inertia * couple);
  }

  Unknown make(StepPoint& p) const {
    Unknown u{.point = &p, .friction = step_.calc_friction(p.a, p.b)};
    const auto tangents = find_tangents(p.normal);
    u.rows[0].along = p.normal;
    u.rows[1].along = tangents[0];
    u.rows[2].along = tangents[1];
    for (const std::size_t side : {0, 1}) {
      const int body = side == 0 ? p.a : p.b;
      if (!can_change(body)) continue;
      u.bodies[side] = body;
      const Vec3 arm = p.where_m - step_.get_given()[body].centre_m;
      for (Row& row : u.rows) {
        row.turning[side] = cross(arm, row.along);
        row.linear[side] = (1.0 / step_.scene.bodies[body].mass_kg) * row.along;
        row.angular[side] = step_.before[body].inverse_inertia * row.turning[side];
        row.inverse_mass += 1.0 / step_.scene.bodies[body].mass_kg + dot(row.turning[side], row.angular[side]);
      }
    }
    return u;
  }

  void explain_known(const Unknown& u) {
    const Vec3 known = u.point->impulse_n_s * u.point->normal + u.point->friction_n_s;
    if (known == Vec3{}) return;
    for (const Row& row : u.rows) explain(changes_, u, row, dot(known, row.along));
  }

  /// Returns the change of the point's impulse.
  double improve(Unknown& u) {
    StepPoint& p = *u.point;
    double moved = 0.0;
    if (!p.is_impulse_known) {
      const Row& row = u.rows[0];
      const double impulse = std::max(0.0, p.impulse_n_s + find_speed(changes_, u, row) / row.inverse_mass);
      moved = std::abs(impulse - p.impulse_n_s);
      explain(changes_, u, row, impulse - p.impulse_n_s);
      p.impulse_n_s = impulse;
    }
    if (p.is_friction_known) return moved;
    std::array<double, 2> wanted = u.rubbed;
    for (const std::size_t k : {0, 1}) wanted[k] += find_speed(changes_, u, u.rows[k + 1]) / u.rows[k + 1].inverse_mass;
    const double limit = u.friction * p.impulse_n_s, size = std::sqrt(wanted[0] * wanted[0] + wanted[1] * wanted[1]);
    for (const std::size_t k : {0, 1}) {
      if (size > limit) wanted[k] *= limit / size;
      explain(changes_, u, u.rows[k + 1], wanted[k] - u.rubbed[k]);
    }
    u.rubbed = wanted;
    return moved;
  }

  const StepView& step_;
  std::vector<Change> changes_;  // per body
  std::vector<Unknown> unknowns_;
};

}  // namespace

void solve_impulses(const StepView& step, std::vector<StepPoint>& points) {
  const auto is_known = [](const StepPoint& p) { return p.is_impulse_known && p.is_friction_known; };
  if (std::all_of(points.begin(), points.end(), is_known)) return;
  Solver(step, points).solve();
}

}  // namespace carillon::drive
