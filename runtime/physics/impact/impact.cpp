// Method: see impact.hpp. A row is a direction of relative motion at a contact; phi of a row has the sign of the body in it, so that the
// motion of row r is  free_r + sum_s A_rs f_s,   A = h^2/2 J M^-1 J^T + sum over modes phi_r g phi_s. Frames and mobilities are constant
// during an impact; gyroscopic couples enter as given constant accelerations.
// Source: discrete gradients, Gonzalez 1996 (J. Nonlinear Sci. 6, 449); modes inside an impact of a ball and a beam, Timoshenko 1913.
#include "runtime/physics/impact/impact.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

namespace carillon::impact {
namespace {

constexpr double kMinSpeedMS = 1e-6;      // m/s; assumed for the step length if nothing approaches
constexpr double kSettledSpeedMS = 1e-3;  // m/s; maximum speed of settled contacts
constexpr double kMaxTouchDelayS = 1e-3;  // s; maximum time to the next touch of bodies still in contact

/// Zero unless positive definite, as for a mallet head without spin.
Mat3 invert_inertia(const Mat3& m) {
  const Mat3 minors{cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])};
  const double determinant = dot(m[0], minors[0]);
  if (!(determinant > 0.0)) return {};
  Mat3 inverse{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) inverse[i][j] = minors[j][i] / determinant;
  return inverse;
}

/// Unit vector perpendicular to `n`, near the axis with its smallest component.
Vec3 make_tangent(const Vec3& n) {
  const Vec3 axis = find_least_axis(n);
  const Vec3 t = axis - dot(axis, n) * n;
  return 1.0 / std::sqrt(dot(t, t)) * t;
}

void check(bool right, const char* what) {
  if (!right) throw std::invalid_argument(std::string("impact: ") + what);
}

}  // namespace

double Books::calc_error() const {
  const double end = rigid + spring + yielded + modal + dissipated_modes + dissipated_contact + dissipated_friction + above_band;
  const double largest = std::max({std::abs(start), std::abs(given), std::abs(end), rigid, 1e-300});
  return (start + given - end) / largest;
}

Impact::Impact(std::vector<Body> bodies, const std::vector<Contact>& contacts, const Options& options)
    : above_band_(options.above_band), max_yielded_m_(options.max_yielded_m), settling_s_(options.settling_s) {
  check(!contacts.empty(), "no contacts");
  check(options.steps_per_pulse >= 1.0 && options.longest_step_s > 0.0 && options.part_s >= 0.0 && options.max_yielded_m > 0.0,
        "options out of range");
  for (Body& body : bodies) place_body(std::move(body));
  for (const Contact& contact : contacts) add_contact(contact);
  choose_step(options);
  set_up_step();
  books_.start += calc_rigid_energy() + calc_spring_energies();
}

/// Adds a body and books the energy of its modes.
void Impact::place_body(Body body) {
  check_body(body);
  const std::size_t modes = body.modes ? body.modes->size() : 0;
  if (body.q.empty()) body.q.assign(modes, 0.0);
  if (body.q_dot.empty()) body.q_dot.assign(modes, 0.0);
  check(body.q.size() == modes && body.q_dot.size() == modes, "modal state and modes differ in size");
  body.moved_m = body.turned_rad = {};
  body.impulse_n_s = body.couple_n_m_s = body.shift_n_s2 = body.turning_n_m_s2 = {};
  body.work_j = 0.0;
  inverse_inertia_.push_back(body.mass_kg > 0.0 && !body.on_joints ? invert_inertia(body.inertia_kg_m2) : Mat3{});
  if (modes > 0) books_.start += modes_.add_body(static_cast<int>(bodies_.size()), *body.modes, body.q, body.q_dot);
  bodies_.push_back(std::move(body));
}

int Impact::join(const Body& body) {
  const double before = calc_rigid_energy();
  place_body(body);
  books_.start += calc_rigid_energy() - before;
  set_up_step();
  return static_cast<int>(bodies_.size()) - 1;
}

void Impact::check_spring(const Spring& spring) {
  check(spring.stiffness > 0.0 && std::isfinite(spring.stiffness) && spring.exponent >= 1.0, "invalid contact spring");
}

void Impact::check_contact(const Contact& contact) const {
  const auto count = static_cast<int>(bodies_.size());
  check(contact.a >= 0 && contact.a < count && contact.b >= -1 && contact.b < count && contact.a != contact.b,
        "contact does not name two different bodies");
  check(std::abs(dot(contact.normal, contact.normal) - 1.0) < 1e-6, "normal is not a unit vector");
  check(is_finite(contact.where_m) && std::isfinite(contact.gap_m), "contact position or gap is not finite");
  check_spring(contact.spring);
  check(contact.restitution >= 0.0 && contact.friction >= 0.0 && contact.tangential_ratio > 0.0,
        "restitution, friction or tangential ratio out of range");
  for (const bool first : {true, false}) {
    const int body = first ? contact.a : contact.b;
    const std::span<const double> shape = first ? contact.shape_a : contact.shape_b;
    check(shape.empty() || (body >= 0 && shape.size() == 3 * bodies_[body].q.size()),
          "number of shape values differs from the body's modes");
  }
}

void Impact::check_body(const Body& body) {
  check(std::isfinite(body.mass_kg) && body.mass_kg >= 0.0, "mass is negative or not finite");
  check(is_finite(body.centre_m) && is_finite(body.velocity_m_s) && is_finite(body.spin_rad_s) && is_finite(body.acceleration_m_s2) &&
            is_finite(body.spin_acceleration_rad_s2) && is_finite(body.inertia_kg_m2[0]) && is_finite(body.inertia_kg_m2[1]) &&
            is_finite(body.inertia_kg_m2[2]),
        "motion of a body is not finite");
  for (const auto& row : body.mobility)
    for (const double w : row) check(std::isfinite(w), "mobility is not finite");
}

void Impact::add_contact(const Contact& contact) {
  check_contact(contact);
  ContactLaw law;
  law.spring = contact.spring;
  law.friction = contact.friction;
  law.compression_m = -contact.gap_m;
  law.row = static_cast<int>(rows_.size());
  rows_.resize(rows_.size() + law.count_rows());
  force_.resize(rows_.size(), 0.0);
  const int index = static_cast<int>(contacts_.size());
  place_contact(contact, index, law.row);
  laws_.push_back(law);
  History& history = contacts_.emplace_back();
  history.given = contact;
  history.given.shape_a = history.given.shape_b = {};  // stored in modes_
  history.is_limited = contact.is_limit && !(contact.shape_a.empty() && contact.shape_b.empty());
  history.pulse.contact = index;
  history.is_open = contact.gap_m > 0.0;
  history.yielded_m = contact.yielded_m;
}

/// Axes, mobilities and shape values of a new or moved contact; its rows begin with `row`.
void Impact::place_contact(const Contact& contact, int index, int row) {
  const Vec3 n = contact.normal, t = make_tangent(n), axes[3] = {n, t, cross(n, t)};
  const int rows = contact.friction > 0.0 ? 3 : 1;
  for (int k = 0; k < rows; ++k) {
    Row one;
    one.contact = index;
    one.axis = axes[k];
    for (std::size_t side = 0; side < 2; ++side) {
      const int body = side == 0 ? contact.a : contact.b;
      if (body < 0) continue;
      const auto b = body;
      one.body[side] = body;
      if (!(bodies_[b].mass_kg > 0.0)) continue;
      one.linear[side] = (side == 0 ? 1.0 : -1.0) * axes[k];
      if (bodies_[b].on_joints) {
        one.angular[side] = cross(contact.where_m - bodies_[b].centre_m, one.linear[side]);
        const Vec3 &f = one.linear[side], &m = one.angular[side];
        const auto gain = [&](std::size_t row) {
          const auto& w = bodies_[b].mobility[row];
          return w[0] * f[0] + w[1] * f[1] + w[2] * f[2] + w[3] * m[0] + w[4] * m[1] + w[5] * m[2];
        };
        one.to_velocity[side] = {gain(0), gain(1), gain(2)};
        one.to_spin[side] = {gain(3), gain(4), gain(5)};
        continue;
      }
      one.to_velocity[side] = 1.0 / bodies_[b].mass_kg * one.linear[side];
      one.angular[side] = cross(contact.where_m - bodies_[b].centre_m, one.linear[side]);
      one.to_spin[side] = inverse_inertia_[b] * one.angular[side];
      if (dot(one.to_spin[side], one.to_spin[side]) == 0.0) one.angular[side] = {};
    }
    rows_[row + k] = one;
  }
  for (const bool first : {true, false}) {
    const int body = first ? contact.a : contact.b;
    const std::span<const double> shape = first ? contact.shape_a : contact.shape_b;
    if (body >= 0 && !shape.empty())
      modes_.place(body, shape, first ? 1.0 : -1.0, row, std::span<const Vec3>(axes).first(rows), above_band_);
  }
}

double Impact::calc_row_speed(const Row& row) const {
  double speed = 0.0;
  for (std::size_t side = 0; side < 2; ++side) {
    if (row.body[side] < 0) continue;
    const Body& body = bodies_[row.body[side]];
    speed += dot(row.linear[side], body.velocity_m_s) + dot(row.angular[side], body.spin_rad_s);
  }
  return speed;
}

double Impact::calc_approach(int contact) const { return -calc_row_speed(rows_[laws_[contact].row]); }

double Impact::calc_depth(int contact) const {
  return std::max(laws_[contact].compression_m, 0.0) + contacts_[contact].yielded_m + modes_.calc_displacement(laws_[contact].row);
}

/// Step length, hysteresis and anchor springs, from the elastic pulses of the rigid bodies. With h_ set: of new contacts only.
void Impact::choose_step(const Options& options) {
  const std::size_t first = h_ > 0.0 ? laws_.size() - 1 : 0;
  std::vector<double> speed(laws_.size(), 0.0), inverse_mass(laws_.size(), 0.0);
  for (std::size_t c = first; c < laws_.size(); ++c) {
    const Row& row = rows_[laws_[c].row];
    speed[c] = -calc_row_speed(row);
    for (std::size_t side = 0; side < 2; ++side)
      inverse_mass[c] += dot(row.linear[side], row.to_velocity[side]) + dot(row.angular[side], row.to_spin[side]);
    double modal = 0.0;
    modes_.add_approach(laws_[c].row, speed[c], modal);
    contacts_[c].closing_m_s = std::max({0.0, speed[c], -calc_row_speed(row)});
    if (inverse_mass[c] == 0.0) inverse_mass[c] = modal;
    fastest_ = std::max(fastest_, speed[c]);
  }
  fastest_ = std::max(fastest_, kMinSpeedMS);
  double shortest = options.longest_step_s * options.steps_per_pulse;
  for (std::size_t c = first; c < laws_.size(); ++c) {
    if (!(inverse_mass[c] > 0.0)) continue;
    // A contact pushed only by its neighbours uses the fastest speed.
    const double v = speed[c] > 0.01 * fastest_ ? speed[c] : fastest_;
    const ElasticPulse pulse = set_law(static_cast<int>(c), inverse_mass[c], v);
    shortest = std::min(shortest, pulse.length_s);
    part_s_ = std::max(part_s_, pulse.length_s);
  }
  if (h_ > 0.0) return;
  if (options.part_s > 0.0) part_s_ = options.part_s;
  step_index_ = find_step(modes_.limit_step(std::min(shortest / options.steps_per_pulse, options.longest_step_s)));
  h_ = get_step(step_index_);
}

/// Hysteresis and anchor spring of a contact for its striking speed. Returns its elastic pulse.
ElasticPulse Impact::set_law(int contact, double inverse_mass, double speed_m_s) {
  ContactLaw& law = laws_[contact];
  const ElasticPulse pulse = calc_elastic_pulse(law.spring, 1.0 / inverse_mass, speed_m_s);
  if (contacts_[contact].given.restitution != hysteresis_of_) {
    hysteresis_of_ = contacts_[contact].given.restitution;
    hysteresis_ = calc_hysteresis(hysteresis_of_, 1.0);
  }
  law.spring.hysteresis_s_m = hysteresis_ / speed_m_s;
  const double peak = std::max(pulse.compression_m, law.compression_m);
  law.tangential_n_m = contacts_[contact].given.tangential_ratio * law.spring.stiffness * std::pow(peak, law.spring.exponent - 1.0);
  return pulse;
}

void Impact::exchange_spring(int contact, const Spring& spring) {
  check_spring(spring);
  ContactLaw& law = laws_[contact];
  History& history = contacts_[contact];
  const double before_m = law.compression_m, after_m = calc_compression(spring, calc_spring_energy(law.spring, before_m));
  if (after_m > std::max(before_m, 0.0)) return;
  history.given.spring = spring;
  law.spring.stiffness = spring.stiffness;
  law.spring.exponent = spring.exponent;
  if (!(before_m > 0.0)) return;
  law.compression_m = after_m;
  history.yielded_m += before_m - after_m;
  const double tangential_n_m = history.given.tangential_ratio * spring.stiffness * std::pow(after_m, spring.exponent - 1.0);
  for (double& stretch : law.stretch) stretch *= std::sqrt(law.tangential_n_m / tangential_n_m);
  law.tangential_n_m = tangential_n_m;
}

/// Open contacts close with their current closing speed as the striking speed.
void Impact::close_contacts() {
  for (std::size_t c = 0; c < laws_.size(); ++c) {
    const std::size_t row = laws_[c].row;
    if (!contacts_[c].is_open || !(laws_[c].compression_m - free_[row] > 0.0)) continue;
    contacts_[c].is_open = false;
    const double speed = -free_[row] / h_;
    // The limit of the rebound is the approach of the bodies; the approach of their modes counts for the first blow only.
    const bool is_first = std::all_of(contacts_.begin(), contacts_.end(), [](const History& h) { return h.impulse_n_s == 0.0; });
    double& closing_m_s = contacts_[c].closing_m_s;
    if (contacts_[c].impulse_n_s == 0.0) closing_m_s = is_first ? speed : 0.0;
    closing_m_s = std::max(closing_m_s, -calc_row_speed(rows_[row]));
    if (mobility_[row * rows_.size() + row] > 0.0)
      set_law(static_cast<int>(c), mobility_[row * rows_.size() + row], std::max(speed, 0.01 * fastest_));
  }
}

/// True after all contacts have separated, except settled contacts and those whose time is over.
bool Impact::is_over() const {
  const double quiet_s = quiet_ * h_;
  if (quiet_s < part_s_) return false;
  for (std::size_t c = 0; c < laws_.size(); ++c) {
    if (laws_[c].compression_m <= 0.0) {
      if (-laws_[c].compression_m < kMaxTouchDelayS * calc_approach(static_cast<int>(c))) return false;
      continue;
    }
    if (!contacts_[c].given.rests) return false;
    const double moved = moved_[laws_[c].row];
    if (std::abs(moved) > kSettledSpeedMS * h_ && quiet_s < settling_s_) return false;
  }
  return true;
}

bool Impact::advance(double until_s) {
  while (!ended_ && get_time() < until_s) {
    step();
    ended_ = is_over();
  }
  return ended_;
}

void Impact::join(const Contact& contact) {
  add_contact(contact);
  choose_step({});
  set_up_step();
  books_.start += calc_spring_energy(laws_.back().spring, laws_.back().compression_m);
  ended_ = false;
}

void Impact::push(int body, const Vec3& velocity_m_s, const Vec3& spin_rad_s) {
  check(body >= 0 && body < static_cast<int>(bodies_.size()), "body index out of range");
  check(is_finite(velocity_m_s) && is_finite(spin_rad_s), "velocity change is not finite");
  const double before = calc_rigid_energy();
  Body& b = bodies_[body];
  b.velocity_m_s = b.velocity_m_s + velocity_m_s;
  b.spin_rad_s = b.spin_rad_s + spin_rad_s;
  books_.given += calc_rigid_energy() - before;
}

void Impact::update(std::span<const Body> bodies, std::span<const Contact> contacts) {
  check(bodies.size() == bodies_.size() && contacts.size() == contacts_.size(), "update has a different number of bodies or contacts");
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    check_body(bodies[b]);
    check((bodies[b].mass_kg > 0.0) == (bodies_[b].mass_kg > 0.0), "update frees or fixes a body");
    check(bodies[b].on_joints == bodies_[b].on_joints, "update adds a body to joints or removes it from them");
  }
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    check_contact(contacts[c]);
    check(contacts[c].a == contacts_[c].given.a && contacts[c].b == contacts_[c].given.b &&
              (contacts[c].friction > 0.0) == (contacts_[c].given.friction > 0.0),
          "update has different contacts");
  }
  const double before = calc_rigid_energy();
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    Body& body = bodies_[b];
    body.centre_m = bodies[b].centre_m;
    body.inertia_kg_m2 = bodies[b].inertia_kg_m2;
    body.acceleration_m_s2 = bodies[b].acceleration_m_s2;
    body.spin_acceleration_rad_s2 = bodies[b].spin_acceleration_rad_s2;
    body.moved_m = body.turned_rad = {};
    if (body.on_joints) {
      body.mobility = bodies[b].mobility;
      body.velocity_m_s = bodies[b].velocity_m_s;
      body.spin_rad_s = bodies[b].spin_rad_s;
      body.impulse_n_s = body.couple_n_m_s = body.shift_n_s2 = body.turning_n_m_s2 = {};
      body.work_j = 0.0;
      continue;
    }
    inverse_inertia_[b] = body.mass_kg > 0.0 ? invert_inertia(body.inertia_kg_m2) : Mat3{};
  }
  books_.given += calc_rigid_energy() - before;
  for (std::size_t c = 0; c < contacts.size(); ++c) {
    ContactLaw& t = laws_[c];
    const auto row = t.row;
    const bool rubs = t.friction > 0.0;
    if (contacts[c].spring != contacts_[c].given.spring) exchange_spring(static_cast<int>(c), contacts[c].spring);
    const Vec3 stretch = rubs ? t.stretch[0] * rows_[row + 1].axis + t.stretch[1] * rows_[row + 2].axis : Vec3{};
    Contact contact = contacts_[c].given;
    contact.where_m = contacts[c].where_m;
    contact.normal = contacts[c].normal;
    contact.shape_a = contacts[c].shape_a;
    contact.shape_b = contacts[c].shape_b;
    place_contact(contact, static_cast<int>(c), t.row);
    contact.shape_a = contact.shape_b = {};
    contacts_[c].given = contact;
    if (!(t.compression_m > 0.0) && contacts_[c].yielded_m == 0.0) {
      t.compression_m = std::min(0.0, -contacts[c].gap_m);
      contacts_[c].is_open = t.compression_m < 0.0;
    }
    if (!rubs) continue;
    // The component of the anchor spring along the new normal is lost.
    t.stretch = {dot(stretch, rows_[row + 1].axis), dot(stretch, rows_[row + 2].axis)};
    books_.dissipated_friction +=
        0.5 * t.tangential_n_m * (dot(stretch, stretch) - t.stretch[0] * t.stretch[0] - t.stretch[1] * t.stretch[1]);
  }
  set_up_step();
}

double Impact::calc_rigid_energy() const {
  double sum = on_joints_j_;
  for (const Body& body : bodies_)
    if (!body.on_joints)
      sum += 0.5 * (body.mass_kg * dot(body.velocity_m_s, body.velocity_m_s) + dot(body.spin_rad_s, body.inertia_kg_m2 * body.spin_rad_s));
  return sum;
}

double Impact::calc_spring_energies() const {
  double sum = 0.0;
  for (const ContactLaw& t : laws_)
    sum += calc_spring_energy(t.spring, t.compression_m) +
           0.5 * t.tangential_n_m * (t.stretch[0] * t.stretch[0] + t.stretch[1] * t.stretch[1]);
  return sum;
}

std::vector<Body> Impact::get_bodies() const {
  std::vector<Body> bodies = bodies_;
  for (std::size_t b = 0; b < bodies.size(); ++b) modes_.read_state(static_cast<int>(b), bodies[b].q, bodies[b].q_dot);
  return bodies;
}

Books Impact::get_books() const {
  Books books = books_;
  books.rigid = calc_rigid_energy();
  books.spring = calc_spring_energies();
  for (const History& contact : contacts_) books.yielded += contact.yielded_j;
  const ModalEnergy modes = modes_.calc_energy();
  books.modal = modes.modal;
  books.dissipated_modes = modes.dissipated;
  books.above_band = modes.above_band;
  return books;
}

std::vector<Pulse> Impact::take_pulses() {
  std::vector<Pulse> taken;
  for (History& contact : contacts_) {
    if (!contact.pulse.impulse_n_s.empty()) taken.push_back(contact.pulse);
    contact.pulse.impulse_n_s.clear();
    contact.silent = 0;
  }
  return taken;
}

}  // namespace carillon::impact
