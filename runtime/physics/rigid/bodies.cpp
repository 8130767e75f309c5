// Method: states, and frames derived from them; mean properties of two touching bodies.
#include "runtime/physics/rigid/bodies.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "runtime/base/error.hpp"
#include "runtime/physics/impact/spring.hpp"
#include "runtime/physics/rigid/grab.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::rigid {

Bodies::Bodies(std::vector<Solid> solids, std::vector<State> states, std::optional<Ground> ground, const Vec3& gravity,
               const std::vector<joints::Joint>& joints, double joint_tolerance)
    : solids_(std::move(solids)), states_(std::move(states)), ground_(ground), gravity_(gravity), joint_tolerance_(joint_tolerance) {
  placed_.resize(solids_.size());
  stays_.assign(solids_.size(), kAwake);
  in_impact_.assign(solids_.size(), 0);
  struck_s_.assign(solids_.size(), -1.0);
  swings_m_.assign(solids_.size(), 0.0);
  settling_.assign(solids_.size(), 1.0);
  for (int i = 0; i < count(); ++i) placed_[i] = rigid::place(solids_[i], states_[i]);
  make_articulations(joints);
}

void Bodies::append(Solid solid, const State& state) {
  placed_.push_back(rigid::place(solid, state));
  solids_.push_back(std::move(solid));
  states_.push_back(state);
  stays_.push_back(kAbsent);
  in_impact_.push_back(0);
  struck_s_.push_back(-1.0);
  swings_m_.push_back(0.0);
  settling_.push_back(1.0);
  if (!articulation_of_.empty()) articulation_of_.push_back(-1), member_.push_back(-1);
  note_pulls();
  for (BodyTable* table : tables_) table->resize(count());
}

void Bodies::place(int body) {
  const State& s = states_[body];
  double sum = 0.0;
  for (int k = 0; k < 3; ++k) sum += s.centre[k] + s.velocity[k] + s.momentum[k] + s.rotation[k];
  if (!std::isfinite(sum)) throw SolveError(fmt::format("motion of body {} is not finite after {:.6f} s", body, time_s_));
  placed_[body] = rigid::place(solids_[body], s);
}

bool Bodies::are_all_asleep() const {
  for (int i = 0; i < count(); ++i)
    if (moves(i)) return false;
  return true;
}

Vec3 Bodies::calc_velocity(int body, const Vec3& where) const {
  if (is_fixed(body)) return {};
  return states_[body].velocity + cross(placed_[body].spin, where - states_[body].centre);
}

double Bodies::calc_approach(const geometry::Touch& touch, int a, int b) const {
  return -dot(calc_velocity(a, touch.where_m) - calc_velocity(b, touch.where_m), touch.normal);
}

double Bodies::calc_turning_speed(int body) const {
  const Solid& solid = solids_[body];
  const Vec3& spin = placed_[body].spin;
  return std::min(norm(spin) * solid.radius_m, solid.shape->calc_turning_speed(solid.centre_m, turn_back(placed_[body].rotation, spin)));
}

double Bodies::calc_sinking_speed(int body) const {
  const Solid& solid = solids_[body];
  const Vec3& spin = placed_[body].spin;
  const Vec3 lever{-spin[1], spin[0], 0.0};  // a point at r from the centre rises by lever . r
  return std::abs(states_[body].velocity[2]) +
         std::min(norm(lever) * solid.radius_m, solid.shape->calc_reach_m(solid.centre_m, turn_back(placed_[body].rotation, lever)));
}

double Bodies::calc_closing_speed(int a, int b) const {
  Vec3 v{};
  double turning = 0.0;
  for (const int body : {a, b}) {
    if (!moves(body)) continue;
    v = body == a ? v + states_[body].velocity : v - states_[body].velocity;
    turning += norm(placed_[body].spin) * solids_[body].radius_m;
  }
  return norm(v) + turning;
}

geometry::Box Bodies::calc_box(int body, double grown_m) const {
  geometry::Box box = solids_[body].shape->calc_box(placed_[body].frame);
  for (int k = 0; k < 3; ++k) box.low[k] -= grown_m, box.high[k] += grown_m;
  return box;
}

double Bodies::calc_energy(const std::vector<int>& bodies) const {
  double sum = 0.0;
  for (const int i : bodies)
    sum += rigid::calc_kinetic(solids_[i], states_[i], placed_[i]) - solids_[i].mass_kg * dot(gravity_, states_[i].centre);
  return sum;
}

double Bodies::calc_kinetic(const std::vector<int>& bodies) const {
  double sum = 0.0;
  for (const int i : bodies) sum += rigid::calc_kinetic(solids_[i], states_[i], placed_[i]);
  return sum;
}

void Bodies::add_to(Books& books) const {
  for (const Articulation& articulation : articulations_) books.lost_j += articulation.now.lost_j;
  for (int i = 0; i < count(); ++i)
    if (!is_absent(i)) books.motion_j += rigid::calc_energy(solids_[i], states_[i], gravity_);
}

double Bodies::apply_impulse(int body, const joints::Spatial& impulse) {
  if (Articulation* articulation = find_articulation(body); articulation != nullptr) {
    const double before_j = calc_kinetic(articulation->bodies);
    std::vector<joints::Spatial> impulses(articulation->bodies.size());
    impulses[get_member(body)] = impulse;
    apply_impulses(*articulation, impulses);
    return calc_kinetic(articulation->bodies) - before_j;
  }
  const double before_j = calc_kinetic({body});
  State& s = states_[body];
  s.velocity = s.velocity + (1.0 / solids_[body].mass_kg) * impulse.linear;
  s.momentum = s.momentum + impulse.angular;
  place(body);
  return calc_kinetic({body}) - before_j;
}

const Grab* Bodies::find_grab(int body) const {
  const auto at = std::find_if(grabs_.begin(), grabs_.end(), [&](const Grab& grab) { return grab.body == body; });
  return at == grabs_.end() ? nullptr : &*at;
}

void Bodies::set_grab(const Grab& grab) {
  drop_grab(grab.body);
  grabs_.push_back(grab);
  note_pulls();
}

void Bodies::drop_grab(int body) {
  std::erase_if(grabs_, [&](const Grab& grab) { return grab.body == body; });
  note_pulls();
}

void Bodies::note_pulls() {
  pulls_m_s2_.assign(solids_.size(), 0.0);
  for (const Grab& grab : grabs_) {
    const double pull = calc_pull(solids_[grab.body], grab.max_force_n);
    const Articulation* articulation = find_articulation(grab.body);
    if (articulation == nullptr) pulls_m_s2_[grab.body] += pull;
    for (std::size_t k = 0; articulation != nullptr && k < articulation->bodies.size(); ++k) pulls_m_s2_[articulation->bodies[k]] += pull;
  }
}

double Bodies::calc_friction(int a, int b) const {
  return std::sqrt(solids_[a].friction * (b >= 0 ? solids_[b].friction : ground_->friction));
}

double Bodies::calc_settling(int a, int b) const {
  if (moves(a)) return moves(b) ? std::min(settling_[a], settling_[b]) : settling_[a];
  return moves(b) ? settling_[b] : 1.0;
}

double Bodies::calc_rolling_resistance(int a, int b) const {
  return std::max(solids_[a].rolling_resistance, b >= 0 ? solids_[b].rolling_resistance : ground_->rolling_resistance);
}

double Bodies::calc_restitution(int a, int b) const {
  return std::sqrt(solids_[a].restitution * (b >= 0 ? solids_[b].restitution : ground_->restitution));
}

double Bodies::calc_size(int a, int b) const {
  const double size = solids_[a].shape->get_size_m();
  return b >= 0 ? std::min(size, solids_[b].shape->get_size_m()) : size;
}

double Bodies::calc_thickness(int a, int b) const {
  const double thickness = solids_[a].shape->get_thickness_m();
  return b >= 0 ? std::min(thickness, solids_[b].shape->get_thickness_m()) : thickness;
}

double Bodies::calc_compliance(int a, int b) const {
  const double young = b >= 0 ? solids_[b].young_modulus_pa : ground_->young_modulus_pa;
  const double poisson = b >= 0 ? solids_[b].poisson_ratio : ground_->poisson_ratio;
  return impact::calc_contact_compliance(solids_[a].young_modulus_pa, solids_[a].poisson_ratio, young, poisson);
}

double Bodies::calc_contact_radius(const geometry::Touch& touch, int a, int b) const {
  const double curvature = std::max(touch.curvature_a_per_m + touch.curvature_b_per_m, 0.0);
  return 1.0 / std::clamp(curvature, 1.0 / std::max(0.5 * calc_size(a, b), kMinContactRadiusM), 1.0 / kMinContactRadiusM);
}

}  // namespace carillon::rigid
