// One step of an impact: forces of the contacts, motion of bodies and modes, losses. Method and source: impact.cpp.
#include <algorithm>
#include <cmath>
#include <utility>

#include "runtime/physics/impact/impact.hpp"

namespace carillon::impact {
namespace {

constexpr double kReboundDecayRatio = 0.05;  // time constant of a limited rebound over the compression time
constexpr int kLimitIterations = 8;          // iterations over contacts that share bodies,
constexpr double kForceTolerance = 1e-4;     // relative to the force of a step,
constexpr double kMinModalRatio = 1e-3;      // and minimum share of modes and spring in the yield of a contact

}  // namespace

/// Propagators, A and the free motion of the first step with the current contacts.
void Impact::set_up_step() {
  const std::size_t n = rows_.size();
  A_.assign(n * n, 0.0);
  mobility_.assign(n * n, 0.0);
  free_.assign(n, 0.0);
  moved_.assign(n, 0.0);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j <= i; ++j) {
      double gain = 0.0;
      for (std::size_t s = 0; s < 2; ++s)
        for (std::size_t t = 0; t < 2; ++t)
          if (rows_[i].body[s] >= 0 && rows_[i].body[s] == rows_[j].body[t])
            gain += dot(rows_[i].linear[s], rows_[j].to_velocity[t]) + dot(rows_[i].angular[s], rows_[j].to_spin[t]);
      mobility_[i * n + j] = mobility_[j * n + i] = gain;
      A_[i * n + j] = A_[j * n + i] = 0.5 * h_ * h_ * gain;
    }
  modes_.set_up(step_index_, n, A_);
}

/// Contact forces of the step, within the restitution limit of each contact.
void Impact::solve_forces() {
  bool found = solver_.solve(laws_, A_, free_, h_, force_);
  for (int round = 0; round < kLimitIterations && limit_forces(false); ++round)
    found = solver_.solve(laws_, A_, free_, h_, force_) && found;
  limit_forces(true);
  if (!found) ++misses_;
}

/// Speed of a row at the end of the step.
double Impact::calc_parting(int row) const {
  const std::size_t n = rows_.size();
  double parting = calc_row_speed(rows_[row]);
  for (std::size_t side = 0; side < 2; ++side) {
    if (rows_[row].body[side] < 0) continue;
    const Body& body = bodies_[rows_[row].body[side]];
    parting += h_ * (dot(rows_[row].linear[side], body.acceleration_m_s2) + dot(rows_[row].angular[side], body.spin_acceleration_rad_s2));
  }
  for (std::size_t r = 0; r < n; ++r) parting += h_ * mobility_[row * n + r] * force_[r];
  for (std::size_t c = 0; c < laws_.size(); ++c) parting -= h_ * mobility_[row * n + laws_[c].row] * contacts_[c].braked_n;
  return parting;
}

/// Share of a limit of the rebound that acts on the rigid bodies alone, 0 to 1: it grows with the compression without force.
double Impact::calc_rigid_share(const History& contact) const {
  const double yielded = std::min(contact.yielded_m / max_yielded_m_, 1.0);
  return std::pow(yielded, 4);
}

/// Reduces the normal forces that would make the rigid bodies separate too fast at the end of the step. At first modes and springs lose the
/// same part: the deformed surfaces may approach without force. As this compression grows, more of the part is kept from the rigid bodies
/// alone, so that the surfaces do not pass through each other. Rigid bodies that separate by x lose braked_n x: never a gain. The distance
/// to the limit decays as exp(-t / tau), without an audible discontinuity. Forces during the approach are unbounded. True if the forces
/// must be solved again: Newton iteration with the yield of modes, spring and rigid bodies.
bool Impact::limit_forces(bool is_last) {
  const std::size_t n = rows_.size();
  bool any = false;
  for (std::size_t c = 0; c < laws_.size(); ++c) {
    History& contact = contacts_[c];
    ContactLaw& t = laws_[c];
    const std::size_t row = t.row;
    const double mobility = mobility_[row * n + row];
    if (!contact.is_limited || contact.given.restitution >= 1.0 || !(mobility > 0.0)) continue;
    if (!(force_[row] > 0.0) && contact.braked_n == 0.0) continue;
    const double before = calc_row_speed(rows_[row]), limit = contact.given.restitution * contact.closing_m_s, left = limit - before,
                 decayed = -left * std::expm1(-h_ / (kReboundDecayRatio * (contact.pressed_s + h_))),
                 allowed = std::max({left > 0.0 ? before + decayed : limit, 0.0, -before});
    const double wanted =
        std::clamp((calc_parting(t.row) - allowed) / (h_ * mobility), -contact.braked_n, std::max(0.0, force_[row] - contact.braked_n));
    if (std::abs(wanted) <= (is_last ? 0.0 : kForceTolerance) * force_[row]) continue;
    double more = wanted;
    if (!is_last) {
      const double share = calc_rigid_share(contact);
      if (share < 1.0 && wanted > 0.0) {
        t.max_n = std::max(0.0, force_[row] - (1.0 - share) * wanted);
        more = share * wanted;
      } else if (!std::isfinite(t.max_n)) {
        double moved = free_[row];
        for (std::size_t r = 0; r < n; ++r) moved += A_[row * n + r] * force_[r];
        const double slope = calc_step_force(t.spring, t.compression_m, t.compression_m - moved, h_).slope,
                     soft = slope > 0.0 ? 1.0 / slope : 0.0, all = A_[row * n + row],
                     deformed = std::max(all - 0.5 * h_ * h_ * mobility + soft, kMinModalRatio * all);
        more = std::max(wanted * (all + soft) / deformed, -contact.braked_n);
      }
    }
    contact.braked_n += more;
    for (std::size_t r = 0; r < n; ++r) free_[r] -= 0.5 * h_ * h_ * mobility_[r * n + row] * more;
    any = true;
  }
  return any;
}

/// Motion of the rows in this step without contact forces.
void Impact::calc_free_motion() {
  const double half = 0.5 * h_ * h_;
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    free_[r] = h_ * calc_row_speed(rows_[r]);
    for (std::size_t side = 0; side < 2; ++side) {
      if (rows_[r].body[side] < 0) continue;
      const Body& body = bodies_[rows_[r].body[side]];
      free_[r] += half * (dot(rows_[r].linear[side], body.acceleration_m_s2) + dot(rows_[r].angular[side], body.spin_acceleration_rad_s2));
    }
  }
  modes_.add_free_motion(free_);
}

/// Motion of the rows with the contact forces.
void Impact::calc_motion() {
  const std::size_t n = rows_.size();
  for (std::size_t i = 0; i < n; ++i) {
    moved_[i] = free_[i];
    for (std::size_t j = 0; j < n; ++j) moved_[i] += A_[i * n + j] * force_[j];
  }
}

/// Updates the compression of a contact, and books the loss of its spring.
void Impact::compress(std::size_t contact) {
  History& c = contacts_[contact];
  ContactLaw& t = laws_[contact];
  const double before = t.compression_m;
  t.compression_m -= moved_[t.row];
  // A contact without force yields to further compression: it stores no energy and returns less than it holds.
  const bool is_limited = std::isfinite(t.max_n);
  if (is_limited && t.compression_m > before) {
    c.yielded_m += t.compression_m - before;
    t.compression_m = before;
  }
  // Yielded compression recovers before the surfaces part.
  if (t.compression_m < 0.0 && c.yielded_m > 0.0) {
    const double recovered = std::min(c.yielded_m, -t.compression_m), recovered_j = c.yielded_j * recovered / c.yielded_m;
    c.yielded_j -= recovered_j;
    books_.dissipated_contact += recovered_j;
    c.yielded_m -= recovered;
    t.compression_m += recovered;
  }
  t.max_n = std::numeric_limits<double>::infinity();
  c.pressed_s = t.compression_m > 0.0 ? c.pressed_s + h_ : 0.0;
  const double taken_j =
      -(force_[t.row] * moved_[t.row] + (calc_spring_energy(t.spring, t.compression_m) - calc_spring_energy(t.spring, before)));
  (is_limited ? c.yielded_j : books_.dissipated_contact) += taken_j;
  if (c.braked_n > 0.0) c.yielded_j += c.braked_n * 0.5 * h_ * (calc_row_speed(rows_[t.row]) + calc_parting(t.row));
  if (!(t.compression_m > 0.0) && c.yielded_m == 0.0) books_.dissipated_contact += std::exchange(c.yielded_j, 0.0);
}

/// Stretches the anchor spring of a contact with friction, and books the loss. Adds the tangential impulse.
void Impact::slide(ContactLaw& t, Vec3& impulse) {
  const auto row = t.row;
  const std::array<double, 2> u0 = t.stretch;
  t.stretch = calc_shortened({u0[0] + moved_[row + 1], u0[1] + moved_[row + 2]}, t.friction * force_[row] / t.tangential_n_m);
  for (std::size_t k = 0; k < 2; ++k) {
    books_.dissipated_friction -=
        force_[row + 1 + k] * moved_[row + 1 + k] + 0.5 * t.tangential_n_m * (t.stretch[k] * t.stretch[k] - u0[k] * u0[k]);
    impulse = impulse + h_ * force_[row + 1 + k] * rows_[row + 1 + k].axis;
  }
}

/// Appends the impulse of the step to the pulse of a contact.
void Impact::record(History& contact, const Vec3& impulse) {
  Pulse& pulse = contact.pulse;
  if (dot(impulse, impulse) > 0.0) {
    if (pulse.impulse_n_s.empty()) pulse.start_s = get_time();
    pulse.step_s = h_;
    pulse.impulse_n_s.resize(pulse.impulse_n_s.size() + contact.silent);
    pulse.impulse_n_s.push_back(impulse);
    contact.silent = 0;
  } else if (!pulse.impulse_n_s.empty()) {
    ++contact.silent;
  }
}

/// Rigid motion: constant acceleration during the step.
void Impact::move_body(std::size_t b) {
  Body& body = bodies_[b];
  if (!(body.mass_kg > 0.0)) return;
  const double half = 0.5 * h_ * h_;
  Vec3 linear = body.acceleration_m_s2, angular = body.spin_acceleration_rad_s2, force{}, couple{};
  const bool is_pushed = std::any_of(force_.begin(), force_.end(), [](double f) { return f != 0.0; });
  for (std::size_t r = 0; r < rows_.size() && is_pushed; ++r)
    for (std::size_t side = 0; side < 2; ++side)
      if (rows_[r].body[side] == static_cast<int>(b)) {
        const int contact = rows_[r].contact;
        const double pushed_n = force_[r] - (laws_[contact].row == static_cast<int>(r) ? contacts_[contact].braked_n : 0.0);
        linear = linear + pushed_n * rows_[r].to_velocity[side];
        angular = angular + pushed_n * rows_[r].to_spin[side];
        if (!body.on_joints) continue;
        force = force + pushed_n * rows_[r].linear[side];
        couple = couple + pushed_n * rows_[r].angular[side];
      }
  const Vec3 moved = h_ * body.velocity_m_s + half * linear, turned = h_ * body.spin_rad_s + half * angular;
  body.velocity_m_s = body.velocity_m_s + h_ * linear;
  body.spin_rad_s = body.spin_rad_s + h_ * angular;
  body.moved_m = body.moved_m + moved;
  body.turned_rad = body.turned_rad + turned;
  if (body.on_joints) {
    const double work = dot(force, moved) + dot(couple, turned);
    on_joints_j_ += work;
    body.work_j += work;
    body.shift_n_s2 = body.shift_n_s2 + h_ * body.impulse_n_s + half * force;
    body.turning_n_m_s2 = body.turning_n_m_s2 + h_ * body.couple_n_m_s + half * couple;
    body.impulse_n_s = body.impulse_n_s + h_ * force;
    body.couple_n_m_s = body.couple_n_m_s + h_ * couple;
    return;
  }
  books_.given += body.mass_kg * dot(body.acceleration_m_s2, moved) + dot(body.inertia_kg_m2 * body.spin_acceleration_rad_s2, turned);
}

void Impact::step() {
  calc_free_motion();
  for (std::size_t c = 0; c < laws_.size(); ++c)
    contacts_[c].closing_m_s = std::max(contacts_[c].closing_m_s, -calc_row_speed(rows_[laws_[c].row]));
  close_contacts();

  const bool reached = std::any_of(laws_.begin(), laws_.end(),
                                   [&](const ContactLaw& t) { return t.compression_m > 0.0 || t.compression_m - free_[t.row] > 0.0; });
  if (reached)
    solve_forces();
  else
    std::fill(force_.begin(), force_.end(), 0.0);

  calc_motion();
  bool struck = false;
  for (std::size_t r = 0; r < rows_.size(); ++r) struck = struck || (force_[r] != 0.0 && !contacts_[rows_[r].contact].given.rests);
  for (std::size_t c = 0; c < laws_.size(); ++c) {
    compress(c);
    ContactLaw& t = laws_[c];
    Vec3 impulse = h_ * force_[t.row] * rows_[t.row].axis;
    contacts_[c].impulse_n_s += h_ * force_[t.row];
    if (t.friction > 0.0) slide(t, impulse);
    record(contacts_[c], impulse);
  }
  for (std::size_t b = 0; b < bodies_.size(); ++b) move_body(b);
  modes_.move(force_);
  for (History& c : contacts_) c.braked_n = 0.0;
  ++steps_;
  quiet_ = struck ? 0 : quiet_ + 1;
}

}  // namespace carillon::impact
