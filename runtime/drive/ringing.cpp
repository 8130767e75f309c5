// Method: w = q' + i omega q turns with the angle omega t while a mode moves freely, its energy is |w|^2 / 2, and an impulse g adds g to
// it.
#include "runtime/drive/ringing.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <iterator>
#include <queue>
#include <utility>

namespace carillon::drive {
namespace {

/// Complex amplitudes of the modes. Plain numbers, as products of std::complex check for NaN, which takes most of the time.
struct Amplitudes {
  std::vector<double> real, imag;  // n

  explicit Amplitudes(std::size_t n) : real(n), imag(n) {}
};

/// The pieces of a force one after the other, as changes of the amplitudes at `at_s`.
class Pieces {
 public:
  Pieces(const impact::Modes& modes, const ModalForce& force, double at_s, std::size_t first)
      : force_(&force), next_(first), turned_(modes.get_omega().size()), turn_(modes.get_omega().size()) {
    const double middle_s = force.start_s + (static_cast<double>(first) + 0.5) * force.step_s;
    for (std::size_t m = 0; m < turn_.real.size(); ++m) {
      const double omega = modes.get_omega()[m], x = 0.5 * omega * force.step_s, s = std::sin(x), c = std::cos(x);
      const double size = x > 0.0 ? s / x : 1.0, angle = omega * (at_s - middle_s);
      turned_.real[m] = size * std::cos(angle);
      turned_.imag[m] = size * std::sin(angle);
      turn_.real[m] = c * c - s * s;
      turn_.imag[m] = -2.0 * s * c;
    }
  }
  bool is_over() const { return next_ == force_->impulses_n_s.size(); }
  double calc_end_s() const { return force_->start_s + static_cast<double>(next_ + 1) * force_->step_s; }
  /// Calls add(mode, change: real, imaginary) for every mode.
  template <class Add>
  void take(Add&& add) {
    const Vec3& impulse = force_->impulses_n_s[next_++];
    for (std::size_t m = 0; m < turn_.real.size(); ++m) {
      const double* phi = &force_->shape[3 * m];
      const double given = phi[0] * impulse[0] + phi[1] * impulse[1] + phi[2] * impulse[2], real = turned_.real[m], imag = turned_.imag[m];
      add(m, given * real, given * imag);
      turned_.real[m] = real * turn_.real[m] - imag * turn_.imag[m];
      turned_.imag[m] = real * turn_.imag[m] + imag * turn_.real[m];
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

/// Adds the pieces of a force, which are changes at its time, to a state.
void add_pieces(const impact::Modes& modes, Pieces pieces, double factor, ModalState& state) {
  while (!pieces.is_over())
    pieces.take([&](std::size_t m, double real, double imag) {
      const double omega = modes.get_omega()[m];
      state.q_dot[m] += factor * real;
      if (omega > 0.0) state.q[m] += factor * imag / omega;
    });
}

/// Pieces of the forces that are later than `at_s`, as changes at this time.
std::vector<Pieces> list_later(const impact::Modes& modes, const std::vector<ModalForce>& forces, double at_s) {
  std::vector<Pieces> later;
  for (const ModalForce& force : forces)
    if (const std::size_t first = find_later(force, at_s); first < force.impulses_n_s.size()) later.emplace_back(modes, force, at_s, first);
  return later;
}

}  // namespace

const ModalState& Ringing::move_to(const impact::Modes& modes, double time_s) {
  if (!state_.q.empty()) {
    if (time_s > time_s_) modes.move_freely(state_.q, state_.q_dot, time_s - time_s_);
    if (time_s < time_s_) modes.turn(state_.q, state_.q_dot, time_s - time_s_);
  }
  time_s_ = time_s;
  return state_;
}

ModalState Ringing::find_without_later(const impact::Modes& modes, double time_s) {
  ModalState state = move_to(modes, time_s);
  for (Pieces& pieces : list_later(modes, forces_, time_s)) add_pieces(modes, std::move(pieces), -1.0, state);
  return state;
}

void Ringing::add(const impact::Modes& modes, std::vector<ModalForce> forces) {
  state_.q.resize(modes.get_omega().size());
  state_.q_dot.resize(modes.get_omega().size());
  for (const ModalForce& force : forces) add_pieces(modes, {modes, force, time_s_, 0}, 1.0, state_);
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
  std::vector<Course> courses;
  std::vector<Running> running;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const StruckBody& body = bodies[i];
    const std::size_t n = body.modes != nullptr ? body.modes->get_omega().size() : 0;
    courses.push_back({Amplitudes(n), Amplitudes(n)});
    if (n == 0) continue;
    ModalState state = body.ringing->move_to(*body.modes, start_s);
    for (Pieces& pieces : list_later(*body.modes, body.ringing->get_forces(), start_s)) {
      add_pieces(*body.modes, pieces, -1.0, state);
      running.push_back({std::move(pieces), i, false});
    }
    for (std::size_t m = 0; m < state.q.size(); ++m) {
      courses[i].earlier.real[m] = state.q_dot[m];
      courses[i].earlier.imag[m] = body.modes->get_omega()[m] * state.q[m];
    }
    for (const ModalForce& force : body.further) running.push_back({Pieces(*body.modes, force, start_s, 0), i, true});
  }
  // The next pieces of all forces by their ends.
  std::priority_queue<std::pair<double, std::size_t>, std::vector<std::pair<double, std::size_t>>, std::greater<>> next;
  const auto push = [&](std::size_t k) {
    if (!running[k].pieces.is_over()) next.emplace(running[k].pieces.calc_end_s(), k);
  };
  for (std::size_t k = 0; k < running.size(); ++k) push(k);
  double shared_j = 0.0, own_j = 0.0;
  while (!next.empty()) {
    const auto [now_s, k] = next.top();
    next.pop();
    auto& [pieces, body, is_further] = running[k];
    Course& course = courses[body];
    double shared = 0.0, own = 0.0;
    if (is_further)
      pieces.take([&](std::size_t m, double real, double imag) {
        own += (course.further.real[m] + 0.5 * real) * real + (course.further.imag[m] + 0.5 * imag) * imag;
        shared += course.earlier.real[m] * real + course.earlier.imag[m] * imag;
        course.further.real[m] += real;
        course.further.imag[m] += imag;
      });
    else
      pieces.take([&](std::size_t m, double real, double imag) {
        shared += course.further.real[m] * real + course.further.imag[m] * imag;
        course.earlier.real[m] += real;
        course.earlier.imag[m] += imag;
      });
    shared_j += shared;
    own_j += own;
    factor = limit_factor(factor, shared_j, std::max(own_j, 0.0), now_s < end_s ? during_j : after_j);
    push(k);
  }
  return factor;
}

}  // namespace carillon::drive
