// Method: impulses act at mid-step, and positions follow from the mean of the velocities at both ends. For articulations they act in the
// configuration at the end of the step without contacts, at the contact position at mid-step.
// Source: J. J. Moreau, "Unilateral contact and dry friction in finite freedom dynamics" (1988); in generalised coordinates for joints.
#include "runtime/physics/rigid/step.hpp"

namespace carillon::rigid {

void Step::begin(Island& island) {
  island_ = &island;
  for (int n = 0; n < count(); ++n) index_[body(n)] = n;
}

void Step::end() {
  for (const int body : island_->bodies) index_[body] = -1;
}

void Step::add(int body) {
  index_[body] = count();
  island_->bodies.push_back(body);
}

joints::Coordinates Step::calc_moved(const ArticulationStep& a, double part_s) const {
  joints::Coordinates flown = part_s == length_s ? a.free : bodies_.fly(*a.articulation, a.articulation->now, part_s);
  if (a.push.empty()) return flown;
  return a.articulation->mechanism->move(flown, a.push, part_s / length_s, 0.5 * part_s * part_s / length_s);
}

State Step::calc_moved(int n, double part_s) const {
  const int i = body(n);
  if (free[n].articulation >= 0) {
    const ArticulationStep& a = articulations[free[n].articulation];
    std::vector<joints::Motion> motions;
    a.articulation->mechanism->find_motions(calc_moved(a, part_s), motions);
    return bodies_.make_member_state(i, motions[movers[n].member]);
  }
  const State& from = bodies_.state(i);
  State to = part_s == length_s ? free[n].state : fly(bodies_.solid(i), from, bodies_.gravity(), part_s);
  const Vec3 gained = (1.0 / length_s) * (movers[n].velocity - (from.velocity + length_s * bodies_.gravity()));
  to.velocity = to.velocity + part_s * gained;
  to.centre = to.centre + (0.5 * part_s * part_s) * gained;
  const Vec3 spun = movers[n].spin - free[n].placed.spin;
  to.rotation = normalise(multiply(make_turn((0.5 * part_s * part_s / length_s) * spun), to.rotation));
  // The impulses act at the middle of the part: the centre is then behind the origin of their arms.
  Vec3 given = (bodies_.solid(i).mass_kg * length_s) * gained;
  if (!pulls.empty()) given = given - pulls[n].linear;  // a pull moves along with its body
  const Vec3 late = cross((0.5 * (length_s - part_s)) * from.velocity, given);
  to.momentum = to.momentum + (part_s / length_s) * (turned[n] + late);
  return to;
}

double Step::calc_loss(const Point& p, double part) const {
  Vec3 u = part * calc_relative_velocity(movers, p), w = part * calc_relative_spin(movers, p);
  const auto add = [&](int n, const Vec3& arm, double sign) {
    if (n < 0) return;
    const State& state = bodies_.state(body(n));
    const Vec3& spin = bodies_.placed(body(n)).spin;
    if (movers[n].linkage != nullptr) {
      // The arm starts at the centre at the end of the step.
      const Vec3 moved = 0.5 * (free[n].state.centre - state.centre);
      u = u + ((2.0 - part) * sign) * cross(spin, moved);
    }
    u = u + ((2.0 - part) * sign) * (state.velocity + cross(spin, arm));
    w = w + ((2.0 - part) * sign) * spin;
  };
  add(p.a, p.arm_a, 1.0);
  add(p.b, p.arm_b, -1.0);
  return -0.5 * part * (dot(p.impulse, u) + dot(p.couple, w));
}

double Step::calc_load_work(int n, const State& to, double part_s) const {
  const Vec3& spin = bodies_.placed(body(n)).spin;
  const double part = part_s / length_s;
  const Vec3 turn = part_s * (spin + (0.5 * part) * (movers[n].spin - spin));
  return (1.0 / length_s) * (dot(loads[n].linear, to.centre - bodies_.state(body(n)).centre) + dot(loads[n].angular, turn));
}

double Step::calc_pull_work(int n, const State& from, double part_s) const {
  // Twice the mean spin: with the momentum before the pull, and after it.
  const State& to = bodies_.state(body(n));
  const Vec3 spins = bodies_.placed(body(n)).inverse_inertia * (from.momentum + to.momentum);
  return (1.0 / length_s) * (dot(pulls[n].linear, to.centre - from.centre) + (0.5 * part_s) * dot(pulls[n].angular, spins));
}

Point make_point(const Bodies& bodies, const Step& step, const Contact& c) {
  Point p;
  p.a = step.find(c.a);
  p.b = step.find(c.b);
  p.normal = c.touch.normal;
  if (p.a >= 0) p.arm_a = c.touch.where_m - bodies.state(c.a).centre;
  if (p.b >= 0) p.arm_b = c.touch.where_m - bodies.state(c.b).centre;
  p.friction = c.cord >= 0 ? 0.0 : bodies.calc_friction(c.a, c.b);
  return p;
}

void add_pull(const Bodies& bodies, const Contact& c, bool is_a, const Vec3& force_n, joints::Spatial& pull) {
  const Vec3 force = (is_a ? 1.0 : -1.0) * force_n;
  pull.linear = pull.linear + force;
  pull.angular = pull.angular + cross(c.touch.where_m - bodies.state(is_a ? c.a : c.b).centre, force);
}

}  // namespace carillon::rigid
