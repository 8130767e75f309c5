// The multipoles of a group of modes at a place, kLanes modes at once; the file that includes this says how many. Nothing from the standard
// library: an inline function of it could end up in code for other processors.
#include "runtime/acoustics/radiation/transfer_loops.hpp"
#include "runtime/bank/multipoles.hpp"

namespace carillon::radiation {
namespace {

typedef std::int32_t Ints __attribute__((vector_size(4 * kLanes)));
typedef float Floats __attribute__((vector_size(4 * kLanes)));

constexpr int kWide = kLanes / 2;
typedef double Doubles __attribute__((vector_size(8 * kWide)));
typedef float HalfFloats __attribute__((vector_size(4 * kWide)));
static_assert(kWide <= kHarmonicsPadding);

constexpr int kParts = kTransferLanes / kLanes;   // vectors that hold a group
constexpr int kAtOnce = kParts < 2 ? kParts : 2;  // more sums than registers cost more than reading the harmonics again
constexpr float kLower = 1.0F / 65536.0F;         // what the real part is of a number
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

/// kWide numbers as harmonics.
void store_harmonics(const Doubles& values, float* to) {
  const Doubles kept = ((values < kNoHarmonic) & (values > -kNoHarmonic)) ? Doubles{} : values;
  store(__builtin_convertvector(kept, HalfFloats), to);
}

void calc_harmonics(const HarmonicWork& work, float* harmonics) {
  constexpr int kRow = bank::kMaxOrder + 1 + 2 * kWide;  // whole vectors, and one of zeros
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
  for (int m = order + 1; m <= order + kWide; ++m) turn_cosine[m] = turn_sine[m] = 0.0;
  // Three rows take turns. In double precision: sin^m leaves the range of a float where its growth with l would bring it back. Whole
  // vectors: what they have beyond the end of a row is zero here, and is written over in `harmonics`.
  double rows[3][kRow];
  for (auto& row : rows)
    for (int m = 0; m <= order + 2 * kWide; ++m) row[m] = 0.0;
  rows[0][0] = 0.28209479177387814;  // sqrt(1 / 4 pi)
  harmonics[0] = 0.28209479177387814F;
  const double *ahead = work.ahead, *behind = work.behind;
  for (int l = 1; l <= order; ++l) {
    double* const here = rows[l % 3];
    const double *const last = rows[(l + 2) % 3], *const before = rows[(l + 1) % 3];
    for (int m = 0; m < l; m += kWide)
      store(load<Doubles>(ahead + m) * work.cosine * load<Doubles>(last + m) - load<Doubles>(behind + m) * load<Doubles>(before + m),
            here + m);
    here[l] = work.diagonal[l] * work.sine * last[l - 1];
    store(Doubles{}, here + l + 1);
    ahead += l;
    behind += l;
    float* const row = harmonics + l * l;
    for (int m = 0; m <= l; m += kWide) store_harmonics(load<Doubles>(here + m) * load<Doubles>(turn_cosine + m), row + m);
    for (int m = 1; m <= l; m += kWide) store_harmonics(load<Doubles>(here + m) * load<Doubles>(turn_sine + m), row + l + m);
  }
}

/// Fills place.radial with F_l = h_l(k r) / h_l(k R) e^{-i k (r - R)}, real and imaginary part, and returns the highest order that counts.
/// F_{l+1} = (2 l + 1) / (k r) u_{l+1} F_l - u_{l+1} u_l F_{l-1} with the steps u of the sphere; F_0 = F_{-1} = R / r.
int calc_radial(const TransferWork& work, const TransferPlace& place) {
  const int order = work.group->order;
  int highest = 0;
  for (int part = 0; part < kParts; ++part) {
    const int lane = part * kLanes;
    float* const to = place.radial + lane;
    const Floats inverse_x = load<Floats>(work.group->inverse_k_m + lane) * place.inverse_r;
    const Floats none{};
    Floats re = none + place.nearness, im = none, before_re = re, before_im = none;
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

/// The modes of kVectors vectors from vector `first` on, at kPlaces places.
template <int kVectors, int kPlaces>
void sum_up(const TransferWork& work, int highest, int first) {
  const MultipoleLine* line = work.lines;
  const float *harmonic[kPlaces], *radial[kPlaces];
  for (int p = 0; p < kPlaces; ++p) {
    harmonic[p] = work.places[p].harmonics;
    radial[p] = work.places[p].radial + first * kLanes;
  }
  Floats sum_re[kVectors][kPlaces] = {}, sum_im[kVectors][kPlaces] = {};
  for (int l = 0; l <= highest; ++l) {
    // Two sums of each row, so that a sum need not wait for itself; one begins with m = 0. Those of whole numbers stand for the imaginary
    // part: what the real parts are of them goes at the end of the row.
    Floats row_re[kVectors][kPlaces] = {}, row_all[kVectors][kPlaces] = {};
    Floats other_re[kVectors][kPlaces] = {}, other_all[kVectors][kPlaces] = {};
    const auto add = [first, &harmonic](const MultipoleLine& steps, int i, int part, Floats* to_re, Floats* to_all) {
      const Ints both = load<Ints>(steps.steps + (first + part) * kLanes);  // each part as a number of its own, 65536 times as large
      const Floats real = __builtin_convertvector(both << 16, Floats), all = __builtin_convertvector(both, Floats);
#pragma GCC unroll 8
      for (int p = 0; p < kPlaces; ++p) {
        to_re[p] += real * harmonic[p][i];
        to_all[p] += all * harmonic[p][i];
      }
    };
#pragma GCC unroll 8
    for (int part = 0; part < kVectors; ++part) add(line[0], 0, part, row_re[part], row_all[part]);
    for (int i = 1; i < 2 * l; i += 2) {
#pragma GCC unroll 8
      for (int part = 0; part < kVectors; ++part) {
        add(line[i], i, part, row_re[part], row_all[part]);
        add(line[i + 1], i + 1, part, other_re[part], other_all[part]);
      }
    }
#pragma GCC unroll 8
    for (int part = 0; part < kVectors; ++part) {
#pragma GCC unroll 8
      for (int p = 0; p < kPlaces; ++p) {
        const Floats f_re = load<Floats>(radial[p] + part * kLanes), f_im = load<Floats>(radial[p] + kTransferLanes + part * kLanes);
        const Floats all_re = row_re[part][p] + other_re[part][p];
        const Floats all_im = row_all[part][p] + other_all[part][p] - all_re * kLower;
        sum_re[part][p] += f_re * all_re - f_im * all_im;
        sum_im[part][p] += f_re * all_im + f_im * all_re;
      }
    }
    line += 2 * l + 1;
    for (int p = 0; p < kPlaces; ++p) {
      harmonic[p] += 2 * l + 1;
      radial[p] += 3 * kTransferLanes;
    }
  }
  for (int part = 0; part < kVectors; ++part) {
    const int lane = (first + part) * kLanes;
    const Floats scale = load<Floats>(work.group->scale + lane);
    for (int p = 0; p < kPlaces; ++p) {
      store(sum_re[part][p] * scale, work.places[p].re + lane);
      store(sum_im[part][p] * scale, work.places[p].im + lane);
    }
  }
}

void calc_transfers(const TransferWork& work) {
  int highest = calc_radial(work, work.places[0]);
  if (work.count == 1) {
    for (int first = 0; first < kParts; first += kAtOnce) sum_up<kAtOnce, 1>(work, highest, first);
    return;
  }
  const int other = calc_radial(work, work.places[1]);
  highest = other > highest ? other : highest;
  for (int first = 0; first < kParts; ++first) sum_up<1, kTransferPlaces>(work, highest, first);
}

}  // namespace
}  // namespace carillon::radiation
