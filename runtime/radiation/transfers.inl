// The multipoles of a group of modes at a place, kLanes modes at once; the file that includes this says how many. Nothing from the standard
// library: an inline function of it could end up in code for other processors.
#include "runtime/bank/multipoles.hpp"
#include "runtime/radiation/transfer_loops.hpp"

namespace carillon::radiation {
namespace {

typedef std::int32_t Ints __attribute__((vector_size(4 * kLanes)));
typedef float Floats __attribute__((vector_size(4 * kLanes)));

constexpr int kParts = kTransferLanes / kLanes;   // vectors that hold a group
constexpr int kAtOnce = kParts < 2 ? kParts : 2;  // more sums than registers cost more than reading the harmonics again
constexpr std::int32_t kUpper = -65536;           // the upper half of a number
constexpr float kSilent = 1e-30F;                 // a radial factor below is 0, so that nothing becomes denormal
constexpr float kLeftOut = 5e-5F;                 // of the level may be left out, rms over directions: -86 dB
constexpr double kNoHarmonic = 1e-20;             // a harmonic below is 0

template <class Vector, class Number>
Vector load(const Number* from) {
  Vector vector;
  __builtin_memcpy(&vector, from, sizeof vector);
  return vector;
}

template <class Vector, class Number>
void store(const Vector& vector, Number* to) {
  __builtin_memcpy(to, &vector, sizeof vector);
}

float to_harmonic(double value) { return static_cast<float>(value < kNoHarmonic && value > -kNoHarmonic ? 0.0 : value); }

void calc_harmonics(const HarmonicWork& work, float* __restrict harmonics) {
  constexpr int kRow = bank::kMaxOrder + 1;
  const int order = work.order;
  double turn_cosine[kRow], turn_sine[kRow];  // sqrt(2) cos(m phi), sqrt(2) sin(m phi)
  turn_cosine[0] = 1.0;
  turn_sine[0] = 0.0;
  double c = 1.4142135623730951, s = 0.0;
  for (int m = 1; m <= order; ++m) {
    const double turned = work.turn_cosine * c - work.turn_sine * s;
    s = work.turn_sine * c + work.turn_cosine * s;
    c = turned;
    turn_cosine[m] = c;
    turn_sine[m] = s;
  }
  // Three rows take turns. In double precision: sin^m leaves the range of a float where its growth with l would bring it back.
  double rows[3][kRow];
  for (auto& row : rows)
    for (int m = 0; m <= order; ++m) row[m] = 0.0;
  rows[0][0] = 0.28209479177387814;  // sqrt(1 / 4 pi)
  harmonics[0] = 0.28209479177387814F;
  const double *ahead = work.ahead, *behind = work.behind;
  for (int l = 1; l <= order; ++l) {
    double* __restrict here = rows[l % 3];
    const double *last = rows[(l + 2) % 3], *before = rows[(l + 1) % 3];
    for (int m = 0; m < l; ++m) here[m] = ahead[m] * work.cosine * last[m] - behind[m] * before[m];
    here[l] = work.diagonal[l] * work.sine * last[l - 1];
    ahead += l;
    behind += l;
    float* __restrict row = harmonics + l * l;
    for (int m = 0; m <= l; ++m) row[m] = to_harmonic(here[m] * turn_cosine[m]);
    for (int m = 1; m <= l; ++m) row[l + m] = to_harmonic(here[m] * turn_sine[m]);
  }
}

/// Fills work.radial with F_l = h_l(k r) / h_l(k R) e^{-i k (r - R)}, real and imaginary part, and returns the highest order that counts.
/// F_{l+1} = (2 l + 1) / (k r) u_{l+1} F_l - u_{l+1} u_l F_{l-1} with the steps u of the sphere; F_0 = F_{-1} = R / r.
int calc_radial(const TransferWork& work) {
  const int order = work.group->order;
  int highest = 0;
  for (int part = 0; part < kParts; ++part) {
    const int lane = part * kLanes;
    float* const to = work.radial + lane;
    const Floats inverse_x = load<Floats>(work.group->inverse_k_m + lane) * work.inverse_r;
    const Floats none{};
    Floats re = none + work.nearness, im = none, before_re = re, before_im = none;
    Floats u_re = load<Floats>(work.steps[0].step_re + lane), u_im = load<Floats>(work.steps[0].step_im + lane);
    Floats most = re * load<Floats>(work.steps[0].level + lane);
    store(re, to);
    store(im, to + kTransferLanes);
    store(most, to + 2 * kTransferLanes);
    for (int l = 0; l < order; ++l) {
      const RadialLine& line = work.steps[l + 1];
      const Floats v_re = load<Floats>(line.step_re + lane), v_im = load<Floats>(line.step_im + lane);
      const Floats both_re = v_re * u_re - v_im * u_im, both_im = v_re * u_im + v_im * u_re;
      const Floats rest_re = both_re * before_re - both_im * before_im, rest_im = both_re * before_im + both_im * before_re;
      const Floats odd = static_cast<float>(2 * l + 1) * inverse_x;
      const Floats grow_re = odd * v_re, grow_im = odd * v_im;
      Floats next_re = grow_re * re - rest_re - grow_im * im, next_im = grow_re * im - rest_im + grow_im * re;
      const Floats size = (next_re < none ? -next_re : next_re) + (next_im < none ? -next_im : next_im);
      next_re = size > kSilent ? next_re : none;
      next_im = size > kSilent ? next_im : none;
      const Floats level = size * load<Floats>(line.level + lane);
      most = level > most ? level : most;
      before_re = re;
      before_im = im;
      re = next_re;
      im = next_im;
      u_re = v_re;
      u_im = v_im;
      float* const row = to + static_cast<std::ptrdiff_t>(l + 1) * 3 * kTransferLanes;
      store(re, row);
      store(im, row + kTransferLanes);
      store(level, row + 2 * kTransferLanes);
    }
    // The tail from each order on: it shrinks with the order, so that the number of those that count says where it stops to count.
    Floats tail = none;
    Ints count{};
    most *= kLeftOut;
    for (int l = order; l > 0; --l) {
      tail += load<Floats>(to + (static_cast<std::ptrdiff_t>(l) * 3 + 2) * kTransferLanes);
      count -= tail > most;
    }
    std::int32_t counts[kLanes];
    store(count, counts);
    for (const std::int32_t one : counts) highest = one > highest ? one : highest;
  }
  return highest;
}

/// The modes of kAtOnce vectors from vector `first` on.
void sum_up(const TransferWork& work, int highest, int first, float* re, float* im) {
  const MultipoleLine* line = work.lines;
  const float *harmonic = work.harmonics, *radial = work.radial + first * kLanes;
  Floats sum_re[kAtOnce] = {}, sum_im[kAtOnce] = {};
  for (int l = 0; l <= highest; ++l) {
    // Two sums of each row, so that a sum need not wait for itself; one begins with m = 0.
    Floats row_re[kAtOnce] = {}, row_im[kAtOnce] = {}, other_re[kAtOnce] = {}, other_im[kAtOnce] = {};
    const auto add = [first](const MultipoleLine& steps, int part, float by, Floats& to_re, Floats& to_im) {
      const Ints both = load<Ints>(steps.steps + (first + part) * kLanes);  // each half as a number of its own, 65536 times as large
      to_re += __builtin_convertvector(both << 16, Floats) * by;
      to_im += __builtin_convertvector(both & kUpper, Floats) * by;
    };
#pragma GCC unroll 8
    for (int part = 0; part < kAtOnce; ++part) add(line[0], part, harmonic[0], row_re[part], row_im[part]);
    for (int i = 1; i < 2 * l; i += 2) {
#pragma GCC unroll 8
      for (int part = 0; part < kAtOnce; ++part) {
        add(line[i], part, harmonic[i], row_re[part], row_im[part]);
        add(line[i + 1], part, harmonic[i + 1], other_re[part], other_im[part]);
      }
    }
#pragma GCC unroll 8
    for (int part = 0; part < kAtOnce; ++part) {
      const Floats f_re = load<Floats>(radial + part * kLanes), f_im = load<Floats>(radial + kTransferLanes + part * kLanes);
      const Floats all_re = row_re[part] + other_re[part], all_im = row_im[part] + other_im[part];
      sum_re[part] += f_re * all_re - f_im * all_im;
      sum_im[part] += f_re * all_im + f_im * all_re;
    }
    line += 2 * l + 1;
    harmonic += 2 * l + 1;
    radial += 3 * kTransferLanes;
  }
  for (int part = 0; part < kAtOnce; ++part) {
    const int lane = (first + part) * kLanes;
    const Floats scale = load<Floats>(work.group->scale + lane);
    store(sum_re[part] * scale, re + lane);
    store(sum_im[part] * scale, im + lane);
  }
}

void calc_transfers(const TransferWork& work, float* re, float* im) {
  const int highest = calc_radial(work);
  for (int first = 0; first < kParts; first += kAtOnce) sum_up(work, highest, first, re, im);
}

}  // namespace
}  // namespace carillon::radiation
