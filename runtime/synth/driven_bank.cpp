// Method:     the exact answer of a mode to a force that is constant over each interval: q' after a step of force is the imaginary part of
//             c^n / omega_d, c = e^{(-d + i omega_d) h}. The force of a period is the mean of the period before, a step that all modes
//             take at once, and what differs from that, small where the force is slow, as pulses of one interval, each the difference of
//             two steps. The answer is split at the start of the period in which a sample is: later pulses go through the first kPeriod
//             samples of the response of the whole bank, earlier ones and steps through one complex state a mode, kept in double
//             precision. How the modes are filled from the input and read out: kernels_driven.inl.
// Source:     docs/equations.md E4; docs/decisions/driven-bank.md. The grid with least-squares weights: Fessler and Sutton 2003.
// Deviations: none.
#include "runtime/synth/driven_bank.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

#include "runtime/base/error.hpp"
#include "runtime/synth/fp_guard.hpp"

namespace carillon::synth {
namespace {

using Complex = std::complex<double>;
constexpr double kGridStep = 2.0 * std::numbers::pi / kGridPoints;
constexpr double kMiddle = 0.5 * (kPeriod - 1);
// Shape of the window, of the Kaiser-Bessel family: the best of 15 to 20 by steps of 0.2 for modes without damping (-141 dB).
constexpr double kShape = 18.4;
// Of the largest value of an exponential: the error of its sum of grid exponentials, and the sum of their sizes, which single precision
// rounds.
constexpr double kWorst = 1e-6, kLargest = 3.0;
// Below, products with all samples of an exponential are cheaper than the two transforms.
constexpr int kFewest = 64;

int round_up(int count, int step) { return (count + step - 1) / step * step; }

Complex calc_turn(double angle) { return std::polar(1.0, angle); }

/// Nothing times zero is zero unless it is infinite or no number; in partial sums, which the compiler may make side by side.
bool are_finite(std::span<const float, kQuantum> numbers) {
  float sum[8] = {};
  for (std::size_t n = 0; n < kQuantum; n += 8) {
    for (std::size_t part = 0; part < 8; ++part) sum[part] += numbers[n + part] * 0.0F;
  }
  return ((sum[0] + sum[1]) + (sum[2] + sum[3])) + ((sum[4] + sum[5]) + (sum[6] + sum[7])) == 0.0F;
}

/// In partial sums, so that no addition waits for the one before it.
double calc_mean(std::span<const float, kPeriod> numbers) {
  double sum[8] = {};
  for (std::size_t t = 0; t < kPeriod; t += 8) {
    for (std::size_t part = 0; part < 8; ++part) sum[part] += numbers[t + part];
  }
  return (((sum[0] + sum[4]) + (sum[1] + sum[5])) + ((sum[2] + sum[6]) + (sum[3] + sum[7]))) / kPeriod;
}

GridTransform make_transform() {
  GridTransform transform = {};
  for (int t = 0; t < kPeriod; ++t) {
    const double x = std::numbers::pi * kReach * (t - kMiddle) / kGridPoints, root = std::sqrt(kShape * kShape - x * x);
    transform.window[t] = static_cast<float>(root / std::sinh(root) * std::sinh(kShape) / kShape);
  }
  for (int j = 0; j < 16; ++j) {
    for (int k = 0; k < 16; ++k) {
      const Complex turn = calc_turn(16 * kGridStep * j * k), twiddle = calc_turn(kGridStep * j * k);
      if (j < 8) transform.turn_re[j][k] = static_cast<float>(turn.real()), transform.turn_im[j][k] = static_cast<float>(turn.imag());
      transform.twiddle_re[j][k] = static_cast<float>(twiddle.real());
      transform.twiddle_im[j][k] = static_cast<float>(twiddle.imag());
    }
    transform.alternate[j] = j % 2 == 0 ? 1.0F : -1.0F;
  }
  return transform;
}

const GridTransform& get_transform() {
  static const GridTransform kTransform = make_transform();
  return kTransform;
}

/// Least squares by `points` windowed grid exponentials about the middle of the period.
class Fit {
 public:
  explicit Fit(int points) : points_(points), basis_(static_cast<std::size_t>(points)), inverse_(static_cast<std::size_t>(points)) {
    for (int j = 0; j < points; ++j) {
      for (int t = 0; t < kPeriod; ++t) {
        basis_[at(j)].push_back(static_cast<double>(get_transform().window[t]) * calc_turn(kGridStep * j * (t - kMiddle)));
      }
    }
    // basis = Q R by Gram and Schmidt, twice for orthogonality to rounding; the rows of R^-1 Q* are the answer to any right-hand side.
    std::vector<std::vector<Complex>> q = basis_, r(at(points), std::vector<Complex>(at(points)));
    for (int j = 0; j < points; ++j) {
      for (int pass = 0; pass < 2; ++pass) {
        for (int i = 0; i < j; ++i) {
          const Complex part = calc_product(q[at(i)], q[at(j)]);
          r[at(i)][at(j)] += part;
          for (int t = 0; t < kPeriod; ++t) q[at(j)][at(t)] -= part * q[at(i)][at(t)];
        }
      }
      const double length = std::sqrt(calc_product(q[at(j)], q[at(j)]).real());
      r[at(j)][at(j)] = length;
      for (Complex& x : q[at(j)]) x /= length;
    }
    for (int j = points - 1; j >= 0; --j) {
      for (int t = 0; t < kPeriod; ++t) {
        Complex x = std::conj(q[at(j)][at(t)]);
        for (int i = j + 1; i < points; ++i) x -= r[at(j)][at(i)] * inverse_[at(i)][at(t)];
        inverse_[at(j)].push_back(x / r[at(j)][at(j)]);
      }
    }
  }

  int get_points() const { return points_; }

  /// Weights of the grid points from `first` on for e^{root (t - kMiddle)}; empty when kWorst or kLargest is not kept.
  std::vector<Complex> calc_weights(Complex root, int first) const {
    std::array<Complex, kPeriod> wanted;
    double largest = 0.0, error = 0.0;
    for (int t = 0; t < kPeriod; ++t) {
      wanted[at(t)] = std::exp((root - Complex(0.0, kGridStep * first)) * (t - kMiddle));
      largest = std::max(largest, std::abs(wanted[at(t)]));
    }
    std::vector<Complex> weights(at(points_));
    for (int j = 0; j < points_; ++j) {
      for (int t = 0; t < kPeriod; ++t) weights[at(j)] += inverse_[at(j)][at(t)] * wanted[at(t)];
    }
    for (int t = 0; t < kPeriod; ++t) {
      Complex sum = 0.0;
      for (int j = 0; j < points_; ++j) sum += weights[at(j)] * basis_[at(j)][at(t)];
      error = std::max(error, std::abs(sum - wanted[at(t)]));
    }
    double size = 0.0;
    for (const Complex& weight : weights) size += std::abs(weight);
    if (!(error <= kWorst * largest && size <= kLargest * largest)) return {};
    // The transforms count time from the start of the period.
    for (int j = 0; j < points_; ++j) weights[at(j)] *= calc_turn(-kGridStep * (first + j) * kMiddle);
    return weights;
  }

 private:
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  static Complex calc_product(const std::vector<Complex>& a, const std::vector<Complex>& b) {
    Complex sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += std::conj(a[i]) * b[i];
    return sum;
  }

  int points_;
  std::vector<std::vector<Complex>> basis_, inverse_;  // [point][sample]
};

}  // namespace

struct DrivenBank::Mode {
  Complex root;  // of one sample: -d h + i angle
  // The pressure n samples after a step or a pulse is Re step c^n, Re pulse c^n.
  Complex step, pulse;
  int first = 0;  // grid point, from kGridMargin below zero on
  std::vector<Complex> weights;
  Complex calc_power(double samples) const { return std::exp(root * samples); }
};

DrivenBank::DrivenBank(const Model& model, std::int32_t triangle, const Vec3& barycentric, const Vec3& direction, Isa isa)
    : kernels_(&get_kernels(isa)) {
  for (const double x : {barycentric[0], barycentric[1], barycentric[2], direction[0], direction[1], direction[2]}) {
    if (!std::isfinite(x)) throw InputError("the point and the direction of a driving force must be finite numbers");
  }
  const double h = 1.0 / model.get_rate_hz();
  std::vector<Mode> modes;
  std::array<double, kPeriod> response = {};
  for (int m = 0; m < model.get_ringing_mode_count(); ++m) {
    const double d = model.get_decay_per_s(m), omega = std::sqrt(model.get_eigenvalue_rad2_s2(m));
    const double angle = std::sqrt((omega - d) * (omega + d)) * h;
    Mode mode;
    mode.root = Complex(-d * h, angle);
    const double size = model.get_gain(m) * model.calc_projection(m, triangle, barycentric, direction) * h / angle;
    const Complex turn = mode.calc_power(1.0);
    mode.step = Complex(0.0, -size) * turn;
    mode.pulse = Complex(0.0, -size) * (turn - 1.0);
    Complex value = mode.pulse;
    for (double& x : response) {
      x += value.real();
      value *= turn;
    }
    modes.push_back(std::move(mode));
  }
  for (int shift = 0; shift < 16; ++shift) {
    for (int n = shift; n < kPeriod; ++n) {
      response_.tap[shift][kTapMargin + n] = static_cast<float>(response[static_cast<std::size_t>(n - shift)]);
    }
  }
  place(modes);
}

/// Shares the modes out between the grid and the products, and makes the tables.
void DrivenBank::place(std::vector<Mode>& modes) {
  static const std::array<Fit, 3> kFits{Fit(kReach), Fit(2 * kReach), Fit(3 * kReach)};
  for (Mode& mode : modes) {
    for (const Fit& fit : kFits) {
      const int first = static_cast<int>(std::floor(mode.root.imag() / kGridStep)) - fit.get_points() / 2 + 1;
      mode.first = first + kGridMargin;
      mode.weights = fit.calc_weights(mode.root, first);
      if (!mode.weights.empty()) break;
    }
  }
  std::sort(modes.begin(), modes.end(), [](const Mode& a, const Mode& b) {
    // Those that are on no grid come last.
    const std::size_t points_a = a.weights.size() - 1, points_b = b.weights.size() - 1;
    if (points_a != points_b) return points_a < points_b;
    return a.root.imag() < b.root.imag();
  });
  auto count = static_cast<std::size_t>(std::count_if(modes.begin(), modes.end(), [](const Mode& mode) { return !mode.weights.empty(); }));
  if (count < kFewest) count = 0;
  const std::size_t groups = (count + kGroup - 1) / kGroup, direct_groups = (modes.size() - count + kGroup - 1) / kGroup;
  turns_.resize(groups + direct_groups);
  states_.resize(groups + direct_groups);
  starts_.resize(2 * (groups + direct_groups) + 1);  // behind the last mode runs may read
  if (groups > 0) copies_.resize(kReach * 2 * kGridSize / kGroup);
  bank_.groups = static_cast<int>(groups);
  bank_.direct_groups = static_cast<int>(direct_groups);
  add_grid_modes(std::span(modes).first(count));
  add_direct_modes(std::span(modes).subspan(count));

  bank_.transform = &get_transform();
  bank_.run_count = static_cast<int>(runs_.size());
}

void DrivenBank::add_grid_modes(std::span<const Mode> modes) {
  for (std::size_t begin = 0; begin < modes.size(); begin += kGroup) {
    const auto group = modes.subspan(begin, std::min<std::size_t>(kGroup, modes.size() - begin));
    GridWindow window{kGridSize, 0};
    int end = 0;
    for (const Mode& mode : group) {
      window.first = std::min(window.first, mode.first);
      end = std::max(end, mode.first + static_cast<int>(mode.weights.size()));
    }
    window.points = round_up(end - window.first, kPointStep);
    window.first = std::min(window.first, kGridSize - window.points);
    const std::size_t row = weights_.size();
    weights_.resize(row + 2 * static_cast<std::size_t>(window.points));
    for (std::size_t lane = 0; lane < group.size(); ++lane) {
      const Mode& mode = group[lane];
      // States are those in the middle of the period, about which the weights are made.
      const Complex turn = mode.calc_power(kPeriod), scale = mode.pulse * mode.calc_power(kPeriod),
                    step = mode.step * mode.calc_power(kMiddle);
      turns_[begin / kGroup].re[lane] = turn.real();
      turns_[begin / kGroup].im[lane] = turn.imag();
      turns_[begin / kGroup].step_re[lane] = static_cast<float>(step.real());
      turns_[begin / kGroup].step_im[lane] = static_cast<float>(step.imag());
      for (std::size_t j = 0; j < mode.weights.size(); ++j) {
        const std::size_t point = row + 2 * (static_cast<std::size_t>(mode.first - window.first) + j);
        const Complex weight = mode.weights[j] * scale;
        weights_[point].value[lane] = static_cast<float>(weight.real());
        weights_[point + 1].value[lane] = static_cast<float>(weight.imag());
      }
    }
    windows_.push_back(window);
  }
  for (std::size_t m = 0; m < modes.size();) {
    std::size_t end = m + 1;
    while (end < modes.size() && modes[end].first == modes[m].first && modes[end].weights.size() == modes[m].weights.size()) ++end;
    for (std::size_t reach = 0; reach < modes[m].weights.size(); reach += kReach) {
      const int first = modes[m].first + static_cast<int>(reach);
      runs_.push_back({static_cast<int>(m), round_up(static_cast<int>(end - m), kRunStep), first % kReach * 2 * kGridSize + first});
      for (std::size_t i = m; i < end; ++i) {
        LaneRow row;
        for (std::size_t j = 0; j < kReach; ++j) {
          row.value[j] = static_cast<float>(modes[i].weights[reach + j].real());
          row.value[kReach + j] = static_cast<float>(modes[i].weights[reach + j].imag());
        }
        rows_.push_back(row);
      }
      rows_.resize(rows_.size() + m + static_cast<std::size_t>(runs_.back().modes) - end);
    }
    m = end;
  }
}

void DrivenBank::add_direct_modes(std::span<const Mode> modes) {
  direct_.resize((modes.size() + kGroup - 1) / kGroup);
  for (std::size_t m = 0; m < modes.size(); ++m) {
    const Mode& mode = modes[m];
    const std::size_t lane = m % kGroup;
    DirectTable& table = direct_[m / kGroup];
    FilterTurn& turn = turns_[static_cast<std::size_t>(bank_.groups) + m / kGroup];
    const Complex period = mode.calc_power(kPeriod), scale = mode.pulse * mode.calc_power(1.0);
    turn.re[lane] = period.real();
    turn.im[lane] = period.imag();
    turn.step_re[lane] = static_cast<float>(mode.step.real());
    turn.step_im[lane] = static_cast<float>(mode.step.imag());
    table.scale_re[lane] = static_cast<float>(scale.real());
    table.scale_im[lane] = static_cast<float>(scale.imag());
    for (int t = 0; t < kPeriod; ++t) {
      const Complex value = mode.calc_power(t);
      table.re[lane][t] = static_cast<float>(value.real());
      table.im[lane][t] = static_cast<float>(value.imag());
    }
  }
}

void DrivenBank::process(std::span<const float> force_n, std::span<float> pressure_pa) noexcept {
  const FpGuard guard;
  while (!force_n.empty()) {
    // At most to the end of a quantum, which is made as a whole: its samples are the same sums however many of them are asked for.
    const int in_quantum = at_ % kQuantum;
    const std::size_t count = std::min<std::size_t>(static_cast<std::size_t>(kQuantum - in_quantum), force_n.size());
    alignas(64) float answer[kQuantum];
    if (!take(force_n.first(count), answer)) {
      replace_faults(force_n.first(count));
      if (!take(force_n.first(0), answer)) {
        silence();
        std::fill(std::begin(answer), std::end(answer), 0.0F);
      }
    }
    for (std::size_t n = 0; n < count; ++n) pressure_pa[n] += answer[static_cast<std::size_t>(in_quantum) + n];
    force_n = force_n.subspan(count);
    pressure_pa = pressure_pa.subspan(count);
    at_ += static_cast<int>(count);
    if (at_ == kPeriod) end_period();
  }
}

/// Takes what follows of the force, and gives the answer of this quantum; false when not all of it is finite.
bool DrivenBank::take(std::span<const float> force_n, std::span<float, kQuantum> answer) noexcept {
  for (std::size_t n = 0; n < force_n.size(); ++n) {
    input_[static_cast<std::size_t>(at_) + n] = static_cast<float>(force_n[n] - held_force_n_);
  }
  kernels_->respond(response_, input_, at_ / kQuantum, answer.data());
  const float* ringing = ringing_ + at_ / kQuantum * kQuantum;
  for (std::size_t n = 0; n < kQuantum; ++n) answer[n] += ringing[n];
  return are_finite(answer);
}

/// Puts the force before in the place of what is not finite.
void DrivenBank::replace_faults(std::span<const float> force_n) noexcept {
  for (std::size_t n = 0; n < force_n.size(); ++n) {
    const std::size_t at = static_cast<std::size_t>(at_) + n;
    if (std::isfinite(force_n[n])) continue;
    ++faults_;
    input_[at] = at > 0 ? input_[at - 1] : last_input_;
  }
}

void DrivenBank::end_period() noexcept {
  FilterBank bank = bank_;
  bank.turns = turns_.data();
  bank.windows = windows_.data();
  bank.weights = weights_.empty() ? nullptr : weights_.data()->value;
  bank.runs = runs_.data();
  bank.rows = rows_.empty() ? nullptr : rows_.data()->value;
  bank.direct = direct_.data();
  bank.states = states_.data();
  bank.start_re = starts_.empty() ? nullptr : starts_.data()->value;
  bank.start_im = bank.start_re ? bank.start_re + turns_.size() * kGroup : nullptr;
  bank.copies = copies_.empty() ? nullptr : copies_.data()->value;
  const double step = calc_mean(input_);
  held_force_n_ += step;
  last_input_ = static_cast<float>(input_[kPeriod - 1] - step);
  kernels_->filter(bank, input_, step, ringing_);
  std::fill(std::begin(input_), std::end(input_), 0.0F);
  at_ = 0;
}

void DrivenBank::silence() noexcept {
  ++faults_;
  std::fill(std::begin(input_), std::end(input_), 0.0F);
  std::fill(std::begin(ringing_), std::end(ringing_), 0.0F);
  std::fill(states_.begin(), states_.end(), ModeState{});
  held_force_n_ = 0.0;
  last_input_ = 0.0F;
}

std::size_t DrivenBank::calc_bytes() const {
  return sizeof(*this) + turns_.size() * sizeof(FilterTurn) + windows_.size() * sizeof(GridWindow) + runs_.size() * sizeof(GridRun) +
         direct_.size() * sizeof(DirectTable) + states_.size() * sizeof(ModeState) +
         (weights_.size() + rows_.size() + starts_.size() + copies_.size()) * sizeof(LaneRow);
}

}  // namespace carillon::synth
