// The multipoles of a group of modes at a place, a vector of modes at once.
#include "runtime/acoustics/radiation/transfer_loops.hpp"

#include "runtime/bank/multipoles.hpp"
#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::radiation::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
const hn::ScalableTag<float> kFloats;
const hn::ScalableTag<std::int32_t> kInts;
using Floats = hn::Vec<decltype(kFloats)>;

constexpr int kLanes = static_cast<int>(hn::MaxLanes(kFloats));
constexpr int kParts = kTransferLanes / kLanes;   // vectors that hold a group
constexpr int kAtOnce = kParts < 2 ? kParts : 2;  // more sums than registers cost more than reading the harmonics again
constexpr float kLower = 1.0F / 65536.0F;         // what the real part is of a number
constexpr float kSilent = 1e-30F;                 // a radial factor below is 0, so that nothing becomes denormal
constexpr float kLeftOut = 5e-5F;                 // of the level may be left out, rms over directions: -86 dB
constexpr double kNoHarmonic = 1e-20;             // a harmonic below is 0

// Vectors of doubles of the compiler: Highway 1.0 has none for WebAssembly.
constexpr int kWide = HWY_MAX_BYTES / sizeof(double);
typedef double Doubles __attribute__((vector_size(8 * kWide)));
typedef float HalfFloats __attribute__((vector_size(4 * kWide)));
static_assert(kWide <= kHarmonicsPadding);

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

struct Complex {
  Floats re, im;
};
Complex multiply(const Complex& a, const Complex& b) { return {hn::MulSub(a.re, b.re, a.im * b.im), hn::MulAdd(a.re, b.im, a.im * b.re)}; }

/// Fills place.radial with F_l = h_l(k r) / h_l(k R) e^{-i k (r - R)}, real and imaginary part, and returns the highest order that counts.
/// F_{l+1} = (2 l + 1) / (k r) u_{l+1} F_l - u_{l+1} u_l F_{l-1} with the steps u of the sphere; F_0 = F_{-1} = R / r.
int calc_radial(const TransferWork& work, const TransferPlace& place) {
  const int order = work.group->order;
  int highest = 0;
  for (int part = 0; part < kParts; ++part) {
    const int lane = part * kLanes;
    float* const to = place.radial + lane;
    const Floats inverse_x = hn::Load(kFloats, work.group->inverse_k_m + lane) * hn::Set(kFloats, place.inverse_r);
    const Floats none = hn::Zero(kFloats);
    Floats re = hn::Set(kFloats, place.nearness), im = none, before_re = re, before_im = none;
    Floats u_re = hn::Load(kFloats, work.steps[0].step_re + lane), u_im = hn::Load(kFloats, work.steps[0].step_im + lane);
    Floats most = re * hn::Load(kFloats, work.steps[0].level + lane);
    hn::Store(re, kFloats, to);
    hn::Store(im, kFloats, to + kTransferLanes);
    hn::Store(most, kFloats, to + 2 * kTransferLanes);
    for (int l = 0; l < order; ++l) {
      const RadialLine& line = work.steps[l + 1];
      const Floats v_re = hn::Load(kFloats, line.step_re + lane), v_im = hn::Load(kFloats, line.step_im + lane);
      const Complex both = multiply({v_re, v_im}, {u_re, u_im}), rest = multiply(both, {before_re, before_im});
      const Floats odd = hn::Set(kFloats, static_cast<float>(2 * l + 1)) * inverse_x;
      const Floats grow_re = odd * v_re, grow_im = odd * v_im;
      const Floats next_re = hn::NegMulAdd(grow_im, im, hn::MulSub(grow_re, re, rest.re));
      const Floats next_im = hn::MulAdd(grow_im, re, hn::MulSub(grow_re, im, rest.im));
      const Floats size = hn::Abs(next_re) + hn::Abs(next_im);
      const auto sounds = size > hn::Set(kFloats, kSilent);
      const Floats level = size * hn::Load(kFloats, line.level + lane);
      most = hn::Max(level, most);
      before_re = re;
      before_im = im;
      re = hn::IfThenElseZero(sounds, next_re);
      im = hn::IfThenElseZero(sounds, next_im);
      u_re = v_re;
      u_im = v_im;
      float* const row = to + static_cast<std::ptrdiff_t>(l + 1) * 3 * kTransferLanes;
      hn::Store(re, kFloats, row);
      hn::Store(im, kFloats, row + kTransferLanes);
      hn::Store(level, kFloats, row + 2 * kTransferLanes);
    }
    // The tail from each order on: it shrinks with the order, so that the number of those that count says where it stops to count.
    const Floats one = hn::Set(kFloats, 1.0F);
    Floats tail = none, count = none;
    most = most * hn::Set(kFloats, kLeftOut);
    for (int l = order; l > 0; --l) {
      tail = tail + hn::Load(kFloats, to + (static_cast<std::ptrdiff_t>(l) * 3 + 2) * kTransferLanes);
      count = count + hn::IfThenElseZero(tail > most, one);
    }
    const int counted = static_cast<int>(hn::GetLane(hn::MaxOfLanes(kFloats, count)));
    highest = counted > highest ? counted : highest;
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
  struct Sums {
    Floats at[kVectors][kPlaces];
    Sums() {
#pragma GCC unroll 8
      for (auto& part : at) {
#pragma GCC unroll 8
        for (Floats& one : part) one = hn::Zero(kFloats);
      }
    }
  };
  Sums sum_re, sum_im;
  for (int l = 0; l <= highest; ++l) {
    // Two sums of each row, so that a sum need not wait for itself; one begins with m = 0. Those of whole numbers stand for the imaginary
    // part: what the real parts are of them goes at the end of the row.
    Sums row_re, row_all, other_re, other_all;
    const auto add = [first, &harmonic](const MultipoleLine& steps, int i, int part, Floats* to_re, Floats* to_all) HWY_ATTR {
      const auto both = hn::Load(kInts, steps.steps + (first + part) * kLanes);  // each part as a number of its own, 65536 times as large
      const Floats real = hn::ConvertTo(kFloats, hn::ShiftLeft<16>(both)), all = hn::ConvertTo(kFloats, both);
#pragma GCC unroll 8
      for (int p = 0; p < kPlaces; ++p) {
        const Floats factor = hn::Set(kFloats, harmonic[p][i]);
        to_re[p] = hn::MulAdd(real, factor, to_re[p]);
        to_all[p] = hn::MulAdd(all, factor, to_all[p]);
      }
    };
#pragma GCC unroll 8
    for (int part = 0; part < kVectors; ++part) add(line[0], 0, part, row_re.at[part], row_all.at[part]);
    for (int i = 1; i < 2 * l; i += 2) {
#pragma GCC unroll 8
      for (int part = 0; part < kVectors; ++part) {
        add(line[i], i, part, row_re.at[part], row_all.at[part]);
        add(line[i + 1], i + 1, part, other_re.at[part], other_all.at[part]);
      }
    }
#pragma GCC unroll 8
    for (int part = 0; part < kVectors; ++part) {
#pragma GCC unroll 8
      for (int p = 0; p < kPlaces; ++p) {
        const Floats f_re = hn::Load(kFloats, radial[p] + part * kLanes);
        const Floats f_im = hn::Load(kFloats, radial[p] + kTransferLanes + part * kLanes);
        const Floats all_re = row_re.at[part][p] + other_re.at[part][p];
        const Floats all_im = hn::NegMulAdd(all_re, hn::Set(kFloats, kLower), row_all.at[part][p] + other_all.at[part][p]);
        const Complex sound = multiply({f_re, f_im}, {all_re, all_im});
        sum_re.at[part][p] = sum_re.at[part][p] + sound.re;
        sum_im.at[part][p] = sum_im.at[part][p] + sound.im;
      }
    }
    line += 2 * l + 1;
    for (int p = 0; p < kPlaces; ++p) {
      harmonic[p] += 2 * l + 1;
      radial[p] += 3 * kTransferLanes;
    }
  }
#pragma GCC unroll 8
  for (int part = 0; part < kVectors; ++part) {
    const int lane = (first + part) * kLanes;
    const Floats scale = hn::Load(kFloats, work.group->scale + lane);
#pragma GCC unroll 8
    for (int p = 0; p < kPlaces; ++p) {
      hn::Store(sum_re.at[part][p] * scale, kFloats, work.places[p].re + lane);
      hn::Store(sum_im.at[part][p] * scale, kFloats, work.places[p].im + lane);
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

const TransferLoops& get_table() {
  static constexpr TransferLoops kLoops{calc_harmonics, calc_transfers};
  return kLoops;
}

}  // namespace
}  // namespace carillon::radiation::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::radiation {

HWY_EXPORT(get_table);
const TransferLoops& find_transfer_loops(base::Instructions best) { return base::choose(HWY_DISPATCH_TABLE(get_table), best)(); }

}  // namespace carillon::radiation
#endif
