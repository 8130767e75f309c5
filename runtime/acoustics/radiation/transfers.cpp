// Method:     T = sum over l of F_l(r) sum over m of a_lm Y_lm(d), F_l = h_l(k r) / h_l(k R) e^{-i k (r - R)}. Harmonics once for all
//             modes: rows of normalised Legendre functions by recurrence in l. 16 modes at a time, one per lane, at one or two places:
//             their multipoles are contiguous 16-bit steps, and those of a row are multiplied by the same harmonic. F_l by the upward
//             recurrence of h_l in l, which is stable, divided by h_l(k R) at each step to avoid overflow: the steps u_l = h_{l-1}(k R) /
//             h_l(k R) are computed in double precision (runtime/base/hankel.hpp).
// Source:     DLMF 10.51 (recurrences of spherical Bessel functions); Holmes & Featherstone, J. Geodesy 76 (2002), eq. 11 (Legendre
//             functions by rows).
// Deviations: the highest orders of a group of modes are omitted if they are 86 dB below the rest, as most near-field orders are far away.
#include "runtime/acoustics/radiation/transfers.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <numeric>

#include "runtime/base/hankel.hpp"

namespace carillon::radiation {
namespace {

using Complex = std::complex<double>;
using std::numbers::pi;

void check(const bank::Multipoles& air, std::size_t modes) {
  if (air.is_empty()) throw InputError("the bank has no multipoles: its modes were solved without air");
  bool fits = air.order.size() == modes && air.freq_hz.size() == modes && air.scale.size() == modes && air.radius_m > 0.0 &&
              air.sound_speed_ms > 0.0;
  std::size_t needed = 0;
  for (const std::int32_t order : air.order) {
    fits = fits && order >= 0 && order <= bank::kMaxOrder;
    if (fits) needed += 2 * bank::count_coefficients(order);
  }
  for (const double freq_hz : air.freq_hz) fits = fits && freq_hz > 0.0;
  if (!fits || air.coefficient.size() != needed) throw InputError("the arrays of the bank's multipoles disagree");
}

/// Position in the row of a group of harmonic i of order l, m = i - l.
std::size_t find_place(int l, int i) { return i >= l ? i - l : l + (l - i); }

}  // namespace

Transfers::Transfers(const bank::Bank& bank, base::Instructions best) : loops_(&find_transfer_loops(best)) {
  const bank::Multipoles& air = bank.multipoles;
  const std::size_t modes = bank.mode_count();
  check(air, modes);
  centre_m_ = air.centre_m;
  radius_m_ = air.radius_m;
  orders_.assign(air.order.begin(), air.order.end());
  rms_.resize(modes);
  turn_orders_.resize(modes);
  slots_.resize(modes);
  std::vector<std::size_t> first(modes), sorted(modes);  // first coefficient of each mode; modes by window and order
  for (std::size_t m = 0, at = 0; m < modes; ++m) {
    first[m] = at;
    at += 2 * bank::count_coefficients(orders_[m]);
  }
  std::iota(sorted.begin(), sorted.end(), std::size_t{0});
  for (std::size_t window = 0; window < modes; window += kWindow)
    std::stable_sort(sorted.begin() + static_cast<std::ptrdiff_t>(window),
                     sorted.begin() + static_cast<std::ptrdiff_t>(std::min(window + kWindow, modes)),
                     [&](std::size_t a, std::size_t b) { return orders_[a] < orders_[b]; });
  for (std::size_t begin = 0; begin < modes; begin += kTransferLanes)
    add_group(air, first, std::span(sorted).subspan(begin, std::min<std::size_t>(kTransferLanes, modes - begin)));
  set_recurrences(modes == 0 ? 0 : *std::max_element(orders_.begin(), orders_.end()));
}

void Transfers::add_group(const bank::Multipoles& air, std::span<const std::size_t> first, std::span<const std::size_t> modes) {
  const int order = orders_[modes.back()];
  TransferGroup group{.inverse_k_m = {}, .scale = {}, .first_line = lines_.size(), .first_radial = radial_.size(), .order = order};
  const std::size_t first_slot = groups_.size() * kTransferLanes;
  lines_.resize(lines_.size() + bank::count_coefficients(order));
  radial_.resize(radial_.size() + static_cast<std::size_t>(order) + 1);
  for (std::size_t lane = 0; lane < kTransferLanes; ++lane) {
    const bool is_mode = lane < modes.size();
    const std::size_t mode = modes[is_mode ? lane : 0];
    const double k = 2.0 * pi * air.freq_hz[mode] / air.sound_speed_ms, x = k * radius_m_;
    const std::vector<Complex> steps = base::calc_hankel_quotients(x, order);
    group.inverse_k_m[lane] = static_cast<float>(1.0 / k);
    RadialLine* const radial = &radial_[group.first_radial];
    for (std::size_t l = 0; l < steps.size(); ++l) {
      radial[l].step_re[lane] = static_cast<float>(steps[l].real());
      radial[l].step_im[lane] = static_cast<float>(steps[l].imag());
    }
    if (!is_mode) continue;
    slots_[mode] = static_cast<std::int32_t>(first_slot + lane);
    group.scale[lane] = static_cast<float>(air.scale[mode] / 65536.0);
    const std::int16_t* from = &air.coefficient[first[mode]];
    double power = 0.0;
    double decay = 1.0;  // |F_l| r / R far away: product of the steps, since far h_l differ by phases only
    double near = 1.0;   // |F_l| r / R at kTurnRadii
    const std::vector<Complex> outer = base::calc_hankel_quotients(kTurnRadii * x, order);
    double turned = 0.0, all = 0.0;
    for (int l = 0; l <= orders_[mode]; ++l) {
      double sum = 0.0;
      for (int i = 0; i <= 2 * l; ++i, from += 2) {
        // Values below -32767, which no written bank has, would overflow the sum.
        lines_[group.first_line + static_cast<std::size_t>(l * l) + find_place(l, i)].steps[lane] =
            std::max<std::int32_t>(from[1], -32767) * 65536 + from[0];
        sum += static_cast<double>(from[0]) * from[0] + static_cast<double>(from[1]) * from[1];
      }
      radial[l].level[lane] = static_cast<float>(std::sqrt(sum / (4.0 * pi)));
      if (l > 0) decay *= std::abs(steps[l]);
      power += sum / (4.0 * pi) * decay * decay;
      if (l > 0) near *= std::abs(steps[l] / outer[l]);
      turned += sum * near * near * l * l;
      all += sum * near * near;
    }
    turn_orders_[mode] = all > 0.0 ? std::sqrt(turned / all) : 0.0;
    rms_[mode] = radius_m_ * air.scale[mode] * std::sqrt(power);
  }
  groups_.push_back(group);
}

void Transfers::set_recurrences(int highest) {
  diagonal_.assign(1, 0.0);
  for (int l = 1; l <= highest; ++l) {
    diagonal_.push_back(std::sqrt((2.0 * l + 1.0) / (2.0 * l)));
    for (int m = 0; m < l; ++m) {
      const double n = static_cast<double>(l - m) * (l + m), before = static_cast<double>(l - 1 - m) * (l - 1 + m);
      ahead_.push_back(std::sqrt((2.0 * l - 1.0) * (2.0 * l + 1.0) / n));
      behind_.push_back(m + 1 == l ? 0.0 : std::sqrt((2.0 * l + 1.0) * before / ((2.0 * l - 3.0) * n)));
    }
  }
  ahead_.resize(ahead_.size() + kHarmonicsPadding);
  behind_.resize(behind_.size() + kHarmonicsPadding);
}

std::size_t Transfers::calc_bytes() const noexcept {
  return sizeof(Transfers) + orders_.capacity() * sizeof(int) + (rms_.capacity() + turn_orders_.capacity()) * sizeof(double) +
         slots_.capacity() * sizeof(std::int32_t) + groups_.capacity() * sizeof(TransferGroup) + lines_.capacity() * sizeof(MultipoleLine) +
         radial_.capacity() * sizeof(RadialLine) + (ahead_.capacity() + behind_.capacity() + diagonal_.capacity()) * sizeof(double);
}

std::shared_ptr<const Transfers> make_transfers(const bank::Bank& bank) {
  return bank.multipoles.is_empty() ? nullptr : std::make_shared<const Transfers>(bank);
}

void Transfers::evaluate_at(std::span<const Vec3> places_m, std::span<const std::int32_t> modes,
                            const std::array<std::span<std::complex<float>>, 2>& transfers) const noexcept {
  int order = -1;
  const auto find_group = [this](std::int32_t slot) -> const TransferGroup& { return groups_[slot / kTransferLanes]; };
  for (const std::int32_t mode : modes) order = std::max(order, find_group(slots_[mode]).order);
  if (order < 0) return;

  static_assert(kWindow == 64 * kTransferLanes);
  struct Room {
    alignas(64) std::array<float, (bank::kMaxOrder + 1) * (bank::kMaxOrder + 1) + kHarmonicsPadding> harmonics;
    alignas(64) std::array<float, (bank::kMaxOrder + 1) * 3 * kTransferLanes> radial;
    alignas(64) std::array<float, kWindow> re, im;  // of the window of the last mode; valid for the groups in `done`
  };
  std::array<Room, kTransferPlaces> rooms;
  TransferWork work;
  work.count = static_cast<int>(places_m.size());
  for (std::size_t p = 0; p < places_m.size(); ++p) {
    const Vec3 way = places_m[p] - centre_m_;
    const double distance = std::sqrt(dot(way, way)), across = std::sqrt(way[0] * way[0] + way[1] * way[1]);
    const double r = std::max(distance, kNearestRadii * radius_m_);
    loops_->calc_harmonics({.ahead = ahead_.data(),
                            .behind = behind_.data(),
                            .diagonal = diagonal_.data(),
                            .cosine = distance > 0.0 ? way[2] / distance : 1.0,
                            .sine = distance > 0.0 ? across / distance : 0.0,
                            .turn_cosine = across > 0.0 ? way[0] / across : 1.0,
                            .turn_sine = across > 0.0 ? way[1] / across : 0.0,
                            .order = order},
                           rooms[p].harmonics.data());
    work.places[p] = {.harmonics = rooms[p].harmonics.data(),
                      .nearness = static_cast<float>(radius_m_ / r),
                      .inverse_r = static_cast<float>(1.0 / r),
                      .radial = rooms[p].radial.data(),
                      .re = nullptr,
                      .im = nullptr};
  }

  std::uint64_t done = 0;
  std::int32_t window = -1;
  for (std::size_t i = 0; i < modes.size(); ++i) {
    const std::int32_t slot = slots_[modes[i]], place = slot % kWindow, lane = place % kTransferLanes;
    if (slot / kWindow != window) {
      window = slot / kWindow;
      done = 0;
    }
    if (const std::uint64_t bit = std::uint64_t{1} << (place / kTransferLanes); (done & bit) == 0) {
      const TransferGroup& group = find_group(slot);
      work.group = &group;
      work.lines = &lines_[group.first_line];
      work.steps = &radial_[group.first_radial];
      for (std::size_t p = 0; p < places_m.size(); ++p) {
        work.places[p].re = &rooms[p].re[place - lane];
        work.places[p].im = &rooms[p].im[place - lane];
      }
      loops_->calc_transfers(work);
      done |= bit;
    }
    for (std::size_t p = 0; p < places_m.size(); ++p) transfers[p][i] = {rooms[p].re[place], rooms[p].im[place]};
  }
}

}  // namespace carillon::radiation
