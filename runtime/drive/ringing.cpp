// Method: w = q' + i omega q turns with the angle omega t while a mode moves freely, its energy is |w|^2 / 2, and an impulse g adds g to
// it.
#include "runtime/drive/ringing.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <iterator>
#include <utility>

namespace carillon::drive {
namespace {

using Amplitudes = std::vector<std::complex<double>>;  // n

/// The pieces of a force one after the other, as changes of the amplitudes at `at_s`.
class Pieces {
 public:
  Pieces(const impact::Modes& modes, const ModalForce& force, double at_s, std::size_t first) : force_(&force), next_(first) {
    const double middle_s = force.start_s + (static_cast<double>(first) + 0.5) * force.step_s;
    for (const double omega : modes.get_omega()) {
      const double x = 0.5 * omega * force.step_s;
      turned_.push_back(std::polar(x > 0.0 ? std::sin(x) / x : 1.0, omega * (at_s - middle_s)));
      turn_.push_back(std::polar(1.0, -omega * force.step_s));
    }
  }
  bool is_over() const { return next_ == force_->impulses_n_s.size(); }
  double calc_end_s() const { return force_->start_s + static_cast<double>(next_ + 1) * force_->step_s; }
  /// Calls add(mode, change) for every mode.
  template <class Add>
  void take(Add&& add) {
    const Vec3& impulse = force_->impulses_n_s[next_++];
    for (std::size_t m = 0; m < turned_.size(); ++m) {
      const double* phi = &force_->shape[3 * m];
      add(m, (phi[0] * impulse[0] + phi[1] * impulse[1] + phi[2] * impulse[2]) * turned_[m]);
      turned_[m] *= turn_[m];
    }
  }

 private:
  const ModalForce* force_;
  std::size_t next_;
  Amplitudes turned_, turn_;
};

/// First piece of a force whose middle is later than a time.
std::size_t find_later(const ModalForce& force, double time_s) {
  const double done = std::floor((time_s - force.start_s) / force.step_s + 0.5);
  return static_cast<std::size_t>(std::clamp(done, 0.0, static_cast<double>(force.impulses_n_s.size())));
}

/// Adds the pieces of a force from `first` on to the state at a time.
void apply(const impact::Modes& modes, const ModalForce& force, double at_s, std::size_t first, double factor, ModalState& state) {
  Pieces pieces(modes, force, at_s, first);
  while (!pieces.is_over())
    pieces.take([&](std::size_t m, std::complex<double> change) {
      const double omega = modes.get_omega()[m];
      state.q_dot[m] += factor * change.real();
      if (omega > 0.0) state.q[m] += factor * change.imag() / omega;
    });
}

void turn_undamped(const impact::Modes& modes, ModalState& state, double time_s) {
  for (std::size_t i = 0; i < state.q.size(); ++i) {
    const double omega = modes.get_omega()[i], c = std::cos(omega * time_s), s = std::sin(omega * time_s);
    const double before = state.q[i];
    state.q[i] = omega > 0.0 ? c * before + s / omega * state.q_dot[i] : before + time_s * state.q_dot[i];
    state.q_dot[i] = c * state.q_dot[i] - omega * s * before;
  }
}

}  // namespace

const ModalState& Ringing::move_to(const impact::Modes& modes, double time_s) {
  if (!state_.q.empty()) {
    if (time_s > time_s_) modes.move_freely(state_.q, state_.q_dot, time_s - time_s_);
    if (time_s < time_s_) turn_undamped(modes, state_, time_s - time_s_);
  }
  time_s_ = time_s;
  return state_;
}

ModalState Ringing::find_without_later(const impact::Modes& modes, double time_s) {
  ModalState state = move_to(modes, time_s);
  for (const ModalForce& force : forces_) apply(modes, force, time_s, find_later(force, time_s), -1.0, state);
  return state;
}

void Ringing::add(const impact::Modes& modes, std::vector<ModalForce> forces) {
  state_.q.resize(modes.get_omega().size());
  state_.q_dot.resize(modes.get_omega().size());
  for (const ModalForce& force : forces) apply(modes, force, time_s_, 0, 1.0, state_);
  std::move(forces.begin(), forces.end(), std::back_inserter(forces_));
}

void Ringing::add(std::vector<ModalForce> forces, const ModalState& change) {
  state_.q.resize(change.q.size());
  state_.q_dot.resize(change.q.size());
  for (std::size_t m = 0; m < change.q.size(); ++m) {
    state_.q[m] += change.q[m];
    state_.q_dot[m] += change.q_dot[m];
  }
  std::move(forces.begin(), forces.end(), std::back_inserter(forces_));
}

bool Ringing::has_later(double time_s) const {
  return std::any_of(forces_.begin(), forces_.end(), [&](const ModalForce& force) { return force.calc_end_s() > time_s; });
}

void Ringing::drop_forces(double before_s) {
  std::erase_if(forces_, [&](const ModalForce& force) { return force.calc_end_s() < before_s; });
}

double limit_factor(double factor, double shared_j, double own_j, double most_j) {
  if (factor * (shared_j + factor * own_j) <= most_j) return factor;
  // The larger root, without cancellation for either sign of shared_j.
  const double root = std::sqrt(shared_j * shared_j + 4.0 * own_j * most_j);
  return shared_j > 0.0 ? 2.0 * most_j / (root + shared_j) : (root - shared_j) / (2.0 * own_j);
}

double limit_further(std::span<const StruckBody> bodies, double factor, double during_j, double after_j) {
  double start_s = HUGE_VAL, end_s = -HUGE_VAL;
  for (const StruckBody& body : bodies)
    for (const ModalForce& force : body.further) {
      start_s = std::min(start_s, force.start_s);
      end_s = std::max(end_s, force.calc_end_s());
    }
  struct Course {
    Amplitudes earlier, further;  // of a body, turned back to start_s
  };
  struct Running {
    Pieces pieces;
    std::size_t body;
    bool is_further;
  };
  std::vector<Course> courses(bodies.size());
  std::vector<Running> running;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const StruckBody& body = bodies[i];
    if (body.modes == nullptr) continue;
    const std::vector<double>& omega = body.modes->get_omega();
    const ModalState state = body.ringing->find_without_later(*body.modes, start_s);
    courses[i].further.resize(omega.size());
    courses[i].earlier.resize(omega.size());
    for (std::size_t m = 0; m < state.q.size(); ++m) courses[i].earlier[m] = {state.q_dot[m], omega[m] * state.q[m]};
    for (const ModalForce& force : body.ringing->get_forces())
      running.push_back({Pieces(*body.modes, force, start_s, find_later(force, start_s)), i, false});
    for (const ModalForce& force : body.further) running.push_back({Pieces(*body.modes, force, start_s, 0), i, true});
  }
  double shared_j = 0.0, own_j = 0.0;
  while (true) {
    std::erase_if(running, [](const Running& r) { return r.pieces.is_over(); });
    const auto next = std::min_element(running.begin(), running.end(),
                                       [](const Running& x, const Running& y) { return x.pieces.calc_end_s() < y.pieces.calc_end_s(); });
    if (next == running.end()) return factor;
    const double now_s = next->pieces.calc_end_s();
    Course& course = courses[next->body];
    if (next->is_further)
      next->pieces.take([&](std::size_t m, std::complex<double> change) {
        own_j += std::real(std::conj(course.further[m] + 0.5 * change) * change);
        shared_j += std::real(std::conj(course.earlier[m]) * change);
        course.further[m] += change;
      });
    else
      next->pieces.take([&](std::size_t m, std::complex<double> change) {
        shared_j += std::real(std::conj(course.further[m]) * change);
        course.earlier[m] += change;
      });
    factor = limit_factor(factor, shared_j, std::max(own_j, 0.0), now_s < end_s ? during_j : after_j);
  }
}

}  // namespace carillon::drive
