// Method:     the response of each uncoupled mode to strikes and contacts is computed for the whole sub-block, as by the kernels, in double
//             precision; then the modes are stepped. The force of contacts over the last interval of a sub-block is heard with the first
//             sample of the next.
// Source:     docs/equations.md E5, E12.
#include "runtime/synth/nonlinear_modes.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/synth/nonlinear/cascade.hpp"
#include "runtime/synth/nonlinear/coupled_modes.hpp"
#include "runtime/synth/oscillator.hpp"

namespace carillon::synth {
namespace {

constexpr int kIntervals = kSubBlock + 1;

/// phi . impulse of a mode [N s kg^-1/2], from rows of the model's shapes.
double calc_amplitude(const std::int16_t* const* row, const float* weight, int mode, double scale) noexcept {
  double amplitude = 0.0;
  for (int r = 0; r < kStrikeRows; ++r) amplitude += static_cast<double>(weight[r]) * row[r][mode];
  return amplitude * scale;
}

/// Amplitude loss of a mode over a sample by one end of all contacts, 1 - factor, as defined for Kernels::drive.
double calc_damping(const ContactBlock& drive, std::size_t end, int mode, double scale, double angle) noexcept {
  double x = 0.0;
  for (std::size_t c = 0; c < static_cast<std::size_t>(drive.contacts); ++c) {
    const ContactEnd& push = drive.push[c][end];
    const double along = calc_amplitude(push.row, push.damping, mode, scale), taken = along * along;
    const double spring = static_cast<double>(push.give) * taken;
    x += taken + static_cast<double>(push.half_loss) * angle * spring / (angle * angle + spring + 1e-30);
  }
  x *= angle / (angle + x + 1e-30);
  const double p = x + x * x * (0.5 + x / 6.0);
  return p / (1.0 + p);
}

/// States of the modes in a row: the coupled ones, then those of the cascade.
class CoupledResonators final : public NonlinearModes {
 public:
  CoupledResonators(const Model& model, bool has_cascade);

  bool is_live() const noexcept override { return modes_.is_moving() || has_carry_ || (cascade_ && cascade_->is_moving()); }
  int get_coupled_count() const noexcept override { return modes_.get_count(); }
  int get_cascade_count() const noexcept override { return cascade_ ? cascade_->get_count() : 0; }
  std::span<const int> get_modes() const noexcept override { return mode_; }
  const StrikeTable* get_strike_tables() const noexcept override { return cascade_ ? strike_.data() : nonlinear_->strike.data(); }
  int get_group_count() const noexcept override { return groups_; }
  int find_place(int mode) const noexcept override { return place_[mode]; }
  void add(std::int64_t sample, const StrikeQueue& strikes, bool struck, const ContactBlock* drive, float* out, SampleStates* kept,
           int groups) noexcept override;
  DampedState get_state(int i) const noexcept override;
  void set_state(int i, const DampedState& state) noexcept override;
  void set_limit(int modes) noexcept override { modes_.set_limit(modes); }
  int get_limit() const noexcept override { return modes_.get_limit(); }
  void drop_below(double pressure_pa) noexcept override;
  void reset() noexcept override;
  double calc_energy_j() const noexcept override { return modes_.get_energy_j() + (cascade_ ? cascade_->calc_energy_j() : 0.0); }

 private:
  double get_re(int i) const noexcept { return i < get_coupled_count() ? modes_.get_re(i) : cascade_->get_re(i - get_coupled_count()); }
  double get_im(int i) const noexcept { return i < get_coupled_count() ? modes_.get_im(i) : cascade_->get_im(i - get_coupled_count()); }
  double calc_pressure() const noexcept;
  void add_pulses(std::int64_t sample, std::span<const QueuedPulse> pulses) noexcept;
  void add_forces(std::int64_t sample, std::span<const QueuedForce> forces) noexcept;
  void add_contacts(const ContactBlock& drive) noexcept;
  void add_push(int interval, std::size_t i, double amplitude, const Moments& moments) noexcept;

  const Model* model_;
  const ModelNonlinear* nonlinear_;  // of the model
  nonlinear::CoupledModes modes_;
  std::vector<int> mode_;  // modes of the model: coupled ones, then those above
  std::vector<nonlinear::ModeConstants> constants_;
  std::vector<ForceAnswer> answer_;
  std::vector<double> gain_;  // [Pa at 1 m] per velocity
  std::unique_ptr<nonlinear::Cascade> cascade_;
  std::vector<StrikeTable> strike_;  // with a cascade
  std::vector<int> place_;
  int groups_ = 0;
  std::vector<double> push_re_, push_im_, keep_;  // (kSubBlock + 1, N): at the samples of this sub-block and the next one
  bool pushes_ = false;                           // any push in this sub-block
  bool has_carry_ = false, carry_damps_ = false;  // the last row applies to the next sub-block
};

CoupledResonators::CoupledResonators(const Model& model, bool has_cascade)
    : model_(&model),
      nonlinear_(model.get_nonlinear()),
      modes_(nonlinear_->energy, nonlinear_->constants, model.get_rate_hz()),
      mode_(nonlinear_->mode),
      constants_(nonlinear_->constants),
      place_(static_cast<std::size_t>(model.get_mode_count()), -1) {
  if (has_cascade) {
    strike_ = nonlinear_->strike;
    mode_.reserve(mode_.size() + nonlinear_->above.size());
    constants_.reserve(mode_.size() + nonlinear_->above.size());
    for (const int m : nonlinear_->above) {
      mode_.push_back(m);
      constants_.push_back(model.calc_constants(m));
      strike_[m / kGroup].scale[m % kGroup] = 0.0F;
    }
    const std::span<const nonlinear::ModeConstants> all = constants_;
    cascade_ = std::make_unique<nonlinear::Cascade>(
        all.first(nonlinear_->mode.size()), all.subspan(nonlinear_->mode.size()),
        nonlinear::CascadeBody{.mass_kg = model.get_mass_kg(), .thickness_m = nonlinear_->energy.thickness_m}, model.get_rate_hz());
  }
  gain_.reserve(mode_.size());
  answer_.reserve(mode_.size());
  for (std::size_t i = 0; i < mode_.size(); ++i) {
    place_[mode_[i]] = static_cast<int>(i);
    groups_ = std::max(groups_, mode_[i] / kGroup + 1);
    gain_.push_back(model.get_gain(mode_[i]));
    answer_.push_back(i < nonlinear_->mode.size() ? nonlinear_->answer[i] : calc_force_answer(constants_[i], model.get_rate_hz()));
  }
  for (auto* values : {&push_re_, &push_im_, &keep_}) values->assign(kIntervals * mode_.size(), 0.0);
}

void CoupledResonators::add_push(int interval, std::size_t i, double amplitude, const Moments& moments) noexcept {
  const std::size_t at = static_cast<std::size_t>(interval) * mode_.size() + i;
  for (int j = 0; j < kMoments; ++j) {
    push_re_[at] += amplitude * moments[j] * answer_[i].re[j];
    push_im_[at] += amplitude * moments[j] * answer_[i].im[j];
  }
}

void CoupledResonators::add_pulses(std::int64_t sample, std::span<const QueuedPulse> pulses) noexcept {
  for (const QueuedPulse& pulse : pulses) {
    const double begin = pulse.begin - static_cast<double>(sample - 1);
    for (int n = 0; n < kSubBlock; ++n) {
      if (begin - n > 1.0 || begin - n + pulse.length <= 0.0) continue;
      pushes_ = true;
      const Moments moments = calc_pulse_moments(pulse.shape, begin - n, pulse.length);
      for (std::size_t i = 0; i < mode_.size(); ++i) {
        const int mode = mode_[i];
        add_push(n, i, calc_amplitude(pulse.row, pulse.weight, mode, model_->get_scale(mode)), moments);
      }
    }
  }
}

void CoupledResonators::add_forces(std::int64_t sample, std::span<const QueuedForce> forces) noexcept {
  for (const QueuedForce& force : forces) {
    const double begin = force.begin - static_cast<double>(sample - 1), end = force.calc_end() - static_cast<double>(sample - 1);
    const std::int16_t* row[kStrikeRows];
    float weight[3][kStrikeRows];
    model_->find_rows(force.triangle, row);
    for (int axis = 0; axis < force.axes; ++axis) force.find_weights(axis, weight[axis]);
    for (int n = 0; n < kSubBlock; ++n) {
      if (begin - n > 1.0 || end - n <= 0.0) continue;
      pushes_ = true;
      const ForceMoments moments = calc_force_moments(force, begin - n, force.step);
      for (std::size_t i = 0; i < mode_.size(); ++i) {
        const int mode = mode_[i];
        for (int axis = 0; axis < force.axes; ++axis)
          add_push(n, i, calc_amplitude(row, weight[axis], mode, model_->get_scale(mode)), moments[axis]);
      }
    }
  }
}

void CoupledResonators::add_contacts(const ContactBlock& drive) noexcept {
  const std::size_t count = mode_.size();
  for (std::size_t i = 0; i < count; ++i) {
    const int mode = mode_[i];
    const double scale = model_->get_scale(mode);
    if (drive.forces) {
      double force[kIntervals] = {};
      for (std::size_t c = 0; c < static_cast<std::size_t>(drive.contacts); ++c)
        for (const ContactEnd& push : drive.push[c]) {
          if (!push.forces) continue;
          const double amplitude = calc_amplitude(push.row, push.force, mode, scale);
          for (int n = 0; n < kIntervals; ++n) force[n] += amplitude * static_cast<double>(push.signal[n]);
        }
      double first[2] = {}, second[2] = {};  // responses to 1 - u and u
      for (int j = 0; j < kTerms; ++j) {
        first[0] += static_cast<double>(drive.ramp[0][j]) * answer_[i].re[j];
        first[1] += static_cast<double>(drive.ramp[0][j]) * answer_[i].im[j];
        second[0] += static_cast<double>(drive.ramp[1][j]) * answer_[i].re[j];
        second[1] += static_cast<double>(drive.ramp[1][j]) * answer_[i].im[j];
      }
      for (int n = 1; n < kIntervals; ++n) {
        push_re_[static_cast<std::size_t>(n) * count + i] += first[0] * force[n - 1] + second[0] * force[n];
        push_im_[static_cast<std::size_t>(n) * count + i] += first[1] * force[n - 1] + second[1] * force[n];
      }
    }
    if (!drive.damps) continue;
    const double angle = std::sqrt(constants_[i].eigenvalue_rad2_s2) / model_->get_rate_hz();
    const double begin = calc_damping(drive, 0, mode, scale, angle), end = calc_damping(drive, 1, mode, scale, angle);
    for (int n = 1; n < kIntervals; ++n) {
      const double share = (n - 0.5) / kSubBlock, lost = (1.0 - share) * begin + share * end;
      keep_[static_cast<std::size_t>(n) * count + i] = 1.0 - lost;
    }
  }
}

void CoupledResonators::add(std::int64_t sample, const StrikeQueue& strikes, bool struck, const ContactBlock* drive, float* out,
                            SampleStates* kept, int groups) noexcept {
  const std::size_t count = mode_.size(), coupled = nonlinear_->mode.size();
  const auto row = [count](std::vector<double>& values, int n) {
    return std::span(values).subspan(static_cast<std::size_t>(n) * count, count);
  };
  const bool damps_first = carry_damps_, damps = drive != nullptr && drive->damps;
  pushes_ = has_carry_;
  if (struck) {
    add_pulses(sample, strikes.get_pulses());
    add_forces(sample, strikes.get_forces());
  }
  if (drive != nullptr) {
    add_contacts(*drive);
    pushes_ = pushes_ || drive->forces;
  }
  for (int n = 0; n < kSubBlock; ++n) {
    const bool keeps = n == 0 ? damps_first : damps;
    const std::span<const double> re = row(push_re_, n), im = row(push_im_, n), keep = row(keep_, n);
    if (keeps)
      modes_.step(re.first(coupled), im.first(coupled), keep.first(coupled));
    else if (pushes_)
      modes_.step(re.first(coupled), im.first(coupled));
    else
      modes_.step();
    if (cascade_) {
      constexpr std::span<const double> kNone;
      const bool pushed = keeps || pushes_;
      cascade_->step(modes_, pushed ? re.subspan(coupled) : kNone, pushed ? im.subspan(coupled) : kNone,
                     keeps ? keep.subspan(coupled) : kNone);
    }
    const double pressure = calc_pressure();
    out[n] += static_cast<float>(pressure);
    if (kept == nullptr) continue;
    for (std::size_t i = 0; i < count; ++i) {
      const int group = mode_[i] / kGroup, lane = mode_[i] % kGroup;
      if (group >= groups) continue;
      kept[group].re[n][lane] += static_cast<float>(get_re(static_cast<int>(i)));
      kept[group].im[n][lane] += static_cast<float>(get_im(static_cast<int>(i)));
    }
  }
  // The last row is the first of the next sub-block.
  has_carry_ = drive != nullptr && drive->forces;
  carry_damps_ = damps;
  for (auto* values : {&push_re_, &push_im_}) {
    if (has_carry_) std::copy_n(values->begin() + static_cast<std::ptrdiff_t>(kSubBlock * count), count, values->begin());
    if (pushes_) std::fill(values->begin() + static_cast<std::ptrdiff_t>(has_carry_ ? count : 0), values->end(), 0.0);
  }
  if (damps) std::copy_n(keep_.begin() + static_cast<std::ptrdiff_t>(kSubBlock * count), count, keep_.begin());
}

/// Advanced by one sample, as the lanes of the groups are.
DampedState CoupledResonators::get_state(int i) const noexcept {
  const nonlinear::ModeConstants& mode = constants_[i];
  const double d = mode.decay_per_s, damped = calc_damped_omega(mode.eigenvalue_rad2_s2, d), k = 1.0 / model_->get_rate_hz();
  const double size = std::exp(-d * k), c = std::cos(damped * k), s = std::sin(damped * k);
  const double re = get_re(i), im = get_im(i), q = size * (im * c + re * s) / damped;
  return {q, size * (re * c - im * s) - d * q};
}

void CoupledResonators::set_state(int i, const DampedState& state) noexcept {
  const nonlinear::ModeConstants& mode = constants_[i];
  const double d = mode.decay_per_s, damped = calc_damped_omega(mode.eigenvalue_rad2_s2, d), k = 1.0 / model_->get_rate_hz();
  const double size = std::exp(d * k), c = std::cos(damped * k), s = std::sin(damped * k);
  const double re = state.v + d * state.q, im = damped * state.q, q = size * (im * c - re * s) / damped;
  const double velocity = size * (re * c + im * s) - d * q;
  if (i < get_coupled_count())
    modes_.set_state(i, q, velocity);
  else
    cascade_->set_state(i - get_coupled_count(), q, velocity);
}

void CoupledResonators::drop_below(double pressure_pa) noexcept {
  double bound = 0.0;
  for (int i = 0; i < get_count(); ++i) bound += std::abs(gain_[i]) * std::hypot(get_re(i), get_im(i));
  if (bound < pressure_pa && !has_carry_) reset();
}

void CoupledResonators::reset() noexcept {
  modes_.reset();
  if (cascade_) cascade_->reset();
  has_carry_ = carry_damps_ = false;
  std::fill(push_re_.begin(), push_re_.end(), 0.0);
  std::fill(push_im_.begin(), push_im_.end(), 0.0);
}

/// Pressure at the sample.
double CoupledResonators::calc_pressure() const noexcept {
  double pressure = 0.0;
  for (int i = 0; i < get_coupled_count(); ++i) pressure += gain_[i] * modes_.get_velocity(i);
  if (!cascade_) return pressure;
  const std::span<const double> velocity = cascade_->get_velocities();
  const double* gain = gain_.data() + get_coupled_count();
  for (std::size_t m = 0; m < velocity.size(); ++m) pressure += gain[m] * velocity[m];
  return pressure;
}

}  // namespace

std::unique_ptr<NonlinearModes> make_nonlinear_modes(const Model& model, bool has_cascade) {
  return std::make_unique<CoupledResonators>(model, has_cascade);
}

}  // namespace carillon::synth
