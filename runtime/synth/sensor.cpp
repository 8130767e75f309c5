// Method: a reading is one complex weight per ringing mode: with z = (q' + d q) + i omega_d q, Re(w z) is
//   -omega^2 q - 2 d q' for w = -2 d + i (omega^2 - 2 d^2) / omega_d, q' for w = 1 + i d / omega_d, q for w = -i / omega_d.
// The immediate response to a force, phi_i(p) phi_i(s) summed over modes, and the rigid body are a field over the vertices.
// Source: rigid-body dynamics; strain: runtime/bank/gauge.hpp.
#include "runtime/synth/sensor.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <complex>
#include <limits>
#include <string>

#include "runtime/bank/gauge.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/sinc.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/synth/oscillator.hpp"

namespace carillon::synth {
namespace {

// A mode is dropped when all sensors read less: 0.1 ug, 1 nm/s, 1 pm, 1e-13.
constexpr std::array<double, 4> kSilence{1e-6, 1e-9, 1e-12, 1e-13};
constexpr double kBarycentricSlack = 1e-6;

/// Of any length: its square may overflow or vanish.
Vec3 calc_direction(const SensorSettings& settings) {
  const Vec3& given = settings.direction;
  const double largest = std::max({std::abs(given[0]), std::abs(given[1]), std::abs(given[2])});
  return calc_unit({given[0] / largest, given[1] / largest, given[2] / largest});
}

std::complex<double> calc_weight(Quantity quantity, double lambda, double decay) {
  const double omega_d = calc_damped_omega(lambda, decay);
  if (quantity == Quantity::kAcceleration) return {-2.0 * decay, (lambda - 2.0 * decay * decay) / omega_d};
  if (quantity == Quantity::kVelocity) return {1.0, decay / omega_d};
  return {0.0, -1.0 / omega_d};
}

/// Force on the body at a vertex to acceleration of the rigid body at a point, along a direction [1/kg].
class RigidAnswer {
 public:
  RigidAnswer(const bank::RigidBody& body, const Vec3& point_m, const Vec3& along)
      : centre_m_(body.centre_m), along_((1.0 / body.mass_kg) * along) {
    const Mat3 inertia = make_matrix(body.inertia_kg_m2);
    if (calc_det(inertia[0], inertia[1], inertia[2]) > 0.0) spin_ = calc_inverse(inertia) * cross(point_m - centre_m_, along);
  }
  Vec3 at(const Vec3& vertex_m) const { return along_ + cross(spin_, vertex_m - centre_m_); }

 private:
  Vec3 centre_m_, along_, spin_{};
};

}  // namespace

bool moves_freely(const bank::Bank& bank) {
  return bank.rigid.mass_kg > 0.0 && bank.supports.count() == 0 && (bank.element != "analytic" || bank.counts.rigid_modes >= 6);
}

Sensor::Sensor(const std::shared_ptr<const Model>& model, const bank::Bank& bank, const SensorSettings& settings)
    : model_(model), quantity_(settings.quantity), rate_hz_(settings.rate_hz), step_s_(1.0 / model->get_rate_hz()) {
  check(bank, settings);
  if (rate_hz_ == 0.0) rate_hz_ = model->get_rate_hz();
  add_modes(find_weights(bank, settings));
  if (quantity_ != Quantity::kStrain && !settings.is_held && moves_freely(bank)) add_rigid(bank, settings);
  if (rate_hz_ != model->get_rate_hz()) {
    base::Sinc::get();
    ratio_ = model->get_rate_hz() / rate_hz_;
    stretch_ = std::max(1.0, ratio_);
    history_.assign(std::bit_ceil(2 * static_cast<std::size_t>(std::ceil(base::kSincHalf * stretch_)) + kBlock), 0.0);
  }
  ring_.assign(std::bit_ceil(static_cast<std::size_t>(settings.buffer_s * rate_hz_) + 2 * kBlock), 0.0);
}

void Sensor::check(const bank::Bank& bank, const SensorSettings& settings) const {
  if (settings.triangle < 0 || settings.triangle >= std::ssize(bank.triangles) || !model_->has_triangle(settings.triangle))
    throw InputError("sensor: there is no triangle " + std::to_string(settings.triangle) + "; give 0 to " +
                     std::to_string(bank.triangles.size() - 1));
  if (bank.triangles != model_->get_surface()->triangles)
    throw InputError("sensor: the bank has another surface than the model of the body; give the bank that the model was made of");
  const Vec3& share = settings.barycentric;
  if (!(std::min({share[0], share[1], share[2]}) >= -kBarycentricSlack &&
        std::abs(share[0] + share[1] + share[2] - 1.0) <= kBarycentricSlack))
    throw InputError("sensor: its barycentric coordinates are not 0 to 1 with the sum 1");
  if (!is_finite(settings.direction) || !(calc_length(settings.direction) > 0.0))
    throw InputError("sensor: its direction has no length; give a vector in the axes of the mesh");
  const double rate = settings.rate_hz;
  if (rate != 0.0 && !(rate >= kSlowestSensorHz && rate <= kFastestSensorHz))
    throw InputError("sensor: its rate is out of range; give 50 to 192000 Hz, or 0 for that of the sound");
  if (!(settings.buffer_s >= 0.0 && settings.buffer_s <= 600.0)) throw InputError("sensor: its buffer is 0 to 600 s");
}

Sensor::Weights Sensor::find_weights(const bank::Bank& bank, const SensorSettings& settings) const {
  if (quantity_ == Quantity::kStrain)
    return bank::calc_strain_weights(bank, settings.triangle, settings.barycentric, calc_direction(settings));
  const Vec3 along = calc_direction(settings);
  Weights weights;
  for (std::size_t corner = 0; corner < 3; ++corner)
    for (std::size_t axis = 0; axis < 3; ++axis)
      weights.emplace_back(static_cast<std::size_t>(bank.triangles[settings.triangle][corner]) * 3 + axis,
                           settings.barycentric[corner] * along[axis]);
  return weights;
}

void Sensor::add_modes(const Weights& weights) {
  const Model& model = *model_;
  const int ringing = model.get_ringing_mode_count();
  sound_.assign(model.get_sound_tables().size(), SoundTable{});
  weight_.assign(sound_.size(), ModeWeight{});
  const ModelSurface& surface = *model.get_surface();
  std::vector<double> along(surface.columns, 0.0);  // phi(p) times the scale of the shapes, by column
  for (int m = 0; m < model.get_mode_count(); ++m) {
    const std::size_t column = m < ringing ? m : model.get_damped_column(static_cast<std::size_t>(m - ringing));
    double phi = 0.0;
    for (const auto& [row, weight] : weights) phi += weight * surface.shape[row * surface.columns + column];
    phi *= model.get_scale(m);
    along[column] = phi * model.get_scale(m);
    const double lambda = model.get_eigenvalue_rad2_s2(m), d = model.get_decay_per_s(m);
    if (m >= ringing) {
      const bool is_fast = quantity_ == Quantity::kAcceleration, is_slow = quantity_ != Quantity::kVelocity;
      damped_.push_back({phi * (is_fast ? -lambda : is_slow ? 1.0 : 0.0), phi * (is_fast ? -2.0 * d : is_slow ? 0.0 : 1.0)});
      continue;
    }
    const std::complex<double> w = phi * calc_weight(quantity_, lambda, d);
    bound_.push_back(std::abs(w) / kSilence[static_cast<std::size_t>(quantity_)]);
    const std::size_t group = m / kGroup, lane = m % kGroup;
    weight_[group].re[lane] = static_cast<float>(w.real());
    weight_[group].im[lane] = static_cast<float>(w.imag());
    for (int k = 0; k < kColumn; ++k) {
      const std::complex<double> wave = w * std::exp(-d * k * step_s_) * std::polar(1.0, calc_damped_omega(lambda, d) * k * step_s_);
      sound_[group].wave[lane / 2][0][k][lane % 2] = static_cast<float>(wave.real());
      sound_[group].wave[lane / 2][1][k][lane % 2] = static_cast<float>(-wave.imag());
    }
  }
  if (quantity_ == Quantity::kStrain && model.get_mode_count() > 0 &&
      std::none_of(along.begin(), along.end(), [](double x) { return x != 0.0; }))
    throw InputError(
        "sensor: no mode of this bank has strain at its place: theories of thin bodies have no motion in the surface; use "
        "\"theory\": \"timoshenko\", or elements");
  if (quantity_ != Quantity::kAcceleration) return;
  direct_.reserve(surface.shape.size() / surface.columns);
  for (std::size_t first = 0; first < surface.shape.size(); first += surface.columns) {
    double sum = 0.0;
    for (std::size_t column = 0; column < surface.columns; ++column) sum += along[column] * surface.shape[first + column];
    direct_.push_back(sum);
  }
}

void Sensor::add_rigid(const bank::Bank& bank, const SensorSettings& settings) {
  const RigidAnswer answer(bank.rigid, bank::calc_point(bank, settings.triangle, settings.barycentric), calc_direction(settings));
  std::vector<double>& field = quantity_ == Quantity::kAcceleration ? direct_ : rigid_;
  field.resize(3 * bank.vertices_m.size(), 0.0);
  for (std::size_t v = 0; v < bank.vertices_m.size(); ++v) {
    const Vec3 at = answer.at(bank.vertices_m[v]);
    for (std::size_t axis = 0; axis < 3; ++axis) field[3 * v + axis] += at[axis];
  }
}

std::size_t Sensor::read(std::span<double> samples) noexcept {
  const std::uint64_t taken = taken_.load(std::memory_order_relaxed), written = written_.load(std::memory_order_acquire);
  const std::size_t count = std::min<std::uint64_t>(samples.size(), written - taken);
  for (std::size_t i = 0; i < count; ++i) samples[i] = ring_[(taken + i) & (ring_.size() - 1)];
  taken_.store(taken + count, std::memory_order_release);
  return count;
}

void Sensor::emit(const Kernels& kernels, const ColumnStates* starts, int groups, int first, int sub_blocks, int offset) noexcept {
  kernels.emit(sound_.data(), starts, groups, first, sub_blocks, modal_.data() + offset);
}

void Sensor::weigh(const Kernels& kernels, const SampleStates* kept, int groups, int offset) noexcept {
  kernels.weigh(weight_.data(), kept, groups, modal_.data() + offset);
}

void Sensor::add_damped(std::span<const DampedState> states, int offset) noexcept {
  const double silence = kSilence[static_cast<std::size_t>(quantity_)];
  for (std::size_t n = 0; n < kSubBlock; ++n) {
    double sum = 0.0;
    for (std::size_t i = 0; i < damped_.size(); ++i) {
      const DampedState& s = states[n * damped_.size() + i];
      sum += damped_[i].of_q * s.q + damped_[i].of_v * s.v;
    }
    other_[offset + 1 + n] += sum;
    damped_level_ = std::max(damped_level_, std::abs(sum) / silence);
  }
}

/// Sum over the rows of a triangle: a field is laid out as the rows of the shapes.
double Sensor::find_share(const std::vector<double>& field, const std::int16_t* const* row, const float* weight) const noexcept {
  if (field.empty()) return 0.0;
  const ModelSurface& surface = *model_->get_surface();
  double sum = 0.0;
  for (std::size_t r = 0; r < kStrikeRows; ++r)
    sum += static_cast<double>(weight[r]) * field[static_cast<std::size_t>(row[r] - surface.shape.data()) / surface.columns];
  return sum;
}

/// A pulse from `begin` to `end`, in samples since the one before the sub-block; `make(start, scale)`: its moments over an interval of 1 /
/// scale samples that begins there.
template <class MakeMoments>
void Sensor::add_pulse(double direct, double rigid, double begin, double end, int offset, const MakeMoments& make) noexcept {
  const int first = std::clamp(static_cast<int>(std::ceil(begin)) - 1, 0, kSubBlock);
  const int last = std::clamp(static_cast<int>(std::ceil(end)), first, kSubBlock);
  for (int n = first; n < last; ++n) {
    const std::size_t at = offset + n;
    if (direct != 0.0) {
      other_[at] += direct * make(n, 2.0)[0] / step_s_;
      other_[at + 1] += direct * make(n + 0.5, 2.0)[0] / step_s_;
    }
    if (rigid != 0.0) {
      const Moments moments = make(n, 1.0);
      gained_[at + 1] += rigid * moments[0];
      moved_[at + 1] += 0.5 * rigid * (moments[0] - moments[1]) * step_s_;
    }
  }
}

void Sensor::add_forces(const StrikeQueue& strikes, const ContactBlock* drive, std::int64_t sample, int offset) noexcept {
  if (direct_.empty() && rigid_.empty()) return;
  const auto before = static_cast<double>(sample - 1);
  for (const QueuedPulse& pulse : strikes.get_pulses()) {
    if (!pulse.get_interval().overlaps(sample, kSubBlock)) continue;
    const double begin = pulse.begin - before;
    add_pulse(find_share(direct_, pulse.row, pulse.weight), find_share(rigid_, pulse.row, pulse.weight), begin, begin + pulse.length,
              offset,
              [&](double start, double scale) { return calc_pulse_moments(pulse.shape, scale * (begin - start), scale * pulse.length); });
  }
  for (const QueuedForce& force : strikes.get_forces()) {
    if (!force.get_interval().overlaps(sample, kSubBlock)) continue;
    const double begin = force.begin - before;
    const std::int16_t* row[kStrikeRows];
    float weight[kStrikeRows];
    model_->find_rows(force.triangle, row);
    for (int axis = 0; axis < force.axes; ++axis) {
      force.find_weights(axis, weight);
      add_pulse(find_share(direct_, row, weight), find_share(rigid_, row, weight), begin, force.calc_end() - before, offset,
                [&](double start, double scale) { return calc_force_moments(force, scale * (begin - start), scale * force.step)[axis]; });
    }
  }
  if (drive != nullptr && drive->forces) add_contacts(*drive, offset);
}

/// The noise of contacts varies slowly within a sample.
void Sensor::add_contacts(const ContactBlock& drive, int offset) noexcept {
  for (int c = 0; c < drive.contacts; ++c) {
    for (const ContactEnd& push : drive.push[c]) {
      if (!push.forces) continue;
      const double direct = find_share(direct_, push.row, push.force), rigid = find_share(rigid_, push.row, push.force);
      for (std::size_t n = 0; n < kSubBlock; ++n) {
        const auto force = static_cast<double>(push.signal[n]);
        other_[offset + n + 1] += direct * force;
        gained_[offset + n + 1] += rigid * force * step_s_;
      }
    }
  }
}

void Sensor::silence(int from, int samples) noexcept {
  std::fill(modal_.begin() + from, modal_.begin() + samples, 0.0F);
  std::fill(other_.begin() + from + 1, other_.begin() + samples + 1, 0.0);
}

void Sensor::finish(int samples) noexcept {
  std::array<double, kBlock> values;
  for (int n = 0; n < samples; ++n) values[n] = (n == 0 ? last_modal_ : static_cast<double>(modal_[n - 1])) + other_[n];
  if (!rigid_.empty()) add_rigid_way(std::span(values).first(samples));
  for (int n = 0; n < samples; ++n) values[n] = std::abs(values[n]) <= std::numeric_limits<double>::max() ? values[n] : 0.0;
  last_modal_ = static_cast<double>(modal_[samples - 1]);
  other_[0] = other_[samples];
  std::fill_n(other_.begin() + 1, samples, 0.0);
  std::fill_n(modal_.begin(), samples, 0.0F);
  const std::span<const double> ready = std::span<const double>(values).subspan(has_last_ ? 0 : 1, samples - (has_last_ ? 0 : 1));
  has_last_ = true;
  if (history_.empty()) return put(ready);
  for (const double value : ready) convert(value);
}

/// Adds velocity or way of the rigid body.
void Sensor::add_rigid_way(std::span<double> values) noexcept {
  for (std::size_t n = 0; n < values.size(); ++n) {
    way_ += velocity_ * step_s_ + moved_[n];
    velocity_ += gained_[n];
    values[n] += quantity_ == Quantity::kVelocity ? velocity_ : way_;
  }
  for (auto* signal : {&gained_, &moved_}) {
    (*signal)[0] = (*signal)[values.size()];
    std::fill_n(signal->begin() + 1, values.size(), 0.0);
  }
}

/// Converts to the own rate: a sinc, stretched to the lower rate, about each of its samples.
void Sensor::convert(double value) noexcept {
  const auto mask = static_cast<std::int64_t>(history_.size()) - 1;
  history_[inputs_++ & mask] = value;
  const double reach = base::kSincHalf * stretch_;
  for (double at = ratio_ * static_cast<double>(outputs_); static_cast<double>(inputs_ - 1) >= at + reach;
       at = ratio_ * static_cast<double>(++outputs_)) {
    double sum = 0.0, weights = 0.0;
    for (auto k = static_cast<std::int64_t>(std::ceil(at - reach)); static_cast<double>(k) <= at + reach; ++k) {
      const double weight = base::Sinc::get().evaluate(std::abs(static_cast<double>(k) - at) / stretch_);
      weights += weight;
      if (k >= 0) sum += weight * history_[k & mask];
    }
    const double between = sum / weights;
    put({&between, 1});
  }
}

void Sensor::put(std::span<const double> values) noexcept {
  const std::uint64_t written = written_.load(std::memory_order_relaxed);
  const std::size_t room = ring_.size() - (written - taken_.load(std::memory_order_acquire)), count = std::min(room, values.size());
  for (std::size_t i = 0; i < count; ++i) ring_[(written + i) & (ring_.size() - 1)] = values[i];
  written_.store(written + count, std::memory_order_release);
  if (count < values.size()) lost_.fetch_add(static_cast<std::int64_t>(values.size() - count), std::memory_order_relaxed);
}

BodySensors::Trace BodySensors::make_trace(const Model& model) {
  return {std::vector<SampleStates>(model.get_sound_tables().size()),
          std::vector<DampedState>(kSubBlock * model.get_damped_modes().size())};
}

void BodySensors::attach(Sensor& sensor, const Model& model, double silence_pa, double time_s) noexcept {
  if (count_ == kMax) return;
  sensors_[count_++] = &sensor;
  sensor.begin(time_s);
  for (int m = 0; m < model.get_ringing_mode_count(); ++m) {
    float& bound = bounds_[m / kGroup][m % kGroup];
    bound = std::max(bound, static_cast<float>(silence_pa * sensor.get_bound(m)));
  }
}

void BodySensors::begin(int samples) noexcept {
  samples_ = samples;
  for (std::size_t i = 0; i < count_; ++i) sensors_[i]->clear_damped_level();
}

void BodySensors::emit(const Kernels& kernels, const ColumnStates* starts, int groups, int first, int sub_blocks, int offset) noexcept {
  for (std::size_t i = 0; i < count_; ++i) sensors_[i]->emit(kernels, starts, groups, first, sub_blocks, offset);
}

void BodySensors::weigh(const Kernels& kernels, const SampleStates* kept, int groups, int offset) noexcept {
  for (std::size_t i = 0; i < count_; ++i) sensors_[i]->weigh(kernels, kept, groups, offset);
}

void BodySensors::add_damped(int offset) noexcept {
  for (std::size_t i = 0; i < count_; ++i) sensors_[i]->add_damped(trace_.damped, offset);
}

void BodySensors::add_forces(const StrikeQueue& strikes, const ContactBlock* drive, std::int64_t sample, int offset) noexcept {
  for (std::size_t i = 0; i < count_; ++i) sensors_[i]->add_forces(strikes, drive, sample, offset);
}

void BodySensors::silence(int from) noexcept {
  for (std::size_t i = 0; i < count_; ++i) sensors_[i]->silence(from, samples_);
}

bool BodySensors::reads_damped() const noexcept {
  return std::any_of(sensors_.begin(), sensors_.begin() + static_cast<std::ptrdiff_t>(count_),
                     [](const Sensor* sensor) { return sensor->get_damped_level() >= 1.0; });
}

void BodySensors::finish(int samples) noexcept {
  for (std::size_t i = 0; i < count_; ++i) sensors_[i]->finish(samples);
}

}  // namespace carillon::synth
