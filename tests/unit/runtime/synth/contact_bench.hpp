// Records of lasting contacts, and modes that play them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <numbers>
#include <span>
#include <vector>

#include "runtime/synth/contact_forces.hpp"
#include "runtime/synth/resonator_bank.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::testing {

using namespace synth;

using events::ContactState;
using events::LastingContact;
using std::numbers::pi;

inline constexpr double kRate = 48000.0;
inline const ContactSurface kOther{.roughness_m = 2e-6, .friction = 0.5, .modulus_pa = 70e9};
inline const ContactSurface kRigidOther{.roughness_m = 2e-6, .friction = 0.5, .modulus_pa = 0.0};  // no spring, impedance alone
inline const EffectSet kNoise{Effect::kRoughness, Effect::kRolling};
inline const EffectSet kBrake{Effect::kContactDamping};

/// Flat sliding: the contact moves over the other surface only.
inline LastingContact make_sliding(double time_s, double speed_m_s, double force_n = 1.0) {
  LastingContact c;
  c.time_s = time_s;
  c.id = 77;
  c.barycentric = {0.2, 0.3, 0.5};
  c.normal = {0.0, 0.0, 1.0};
  c.slip_m_s = {speed_m_s, 0.0, 0.0};
  c.force_n = force_n;
  c.other_sweep_m_s = speed_m_s;
  c.patch_radius_m = 20e-6;
  return c;
}

/// One record every 2 ms from 0 on, with begin and end.
inline std::vector<LastingContact> make_records(double end_s, const std::function<LastingContact(double)>& make) {
  std::vector<LastingContact> records;
  for (int i = 0; 2e-3 * i <= end_s; ++i) records.push_back(make(2e-3 * i));
  records.front().state = ContactState::kBegin;
  records.back().state = ContactState::kEnd;
  return records;
}

/// Plays the records, each queued 100 ms before its time.
inline std::vector<float> play(ResonatorBank& voice, ContactForces& contacts, std::vector<LastingContact> records, double seconds,
                               std::size_t block = 480, const ContactSurface& other = kOther) {
  std::vector<float> out(seconds * kRate, 0.0F);
  voice.attach(&contacts);
  std::size_t next = 0;
  for (std::size_t n = 0; n < out.size(); n += block) {
    while (next < records.size() && records[next].time_s < static_cast<double>(n) / kRate + 0.1) contacts.take(records[next++], other);
    contacts.reach(static_cast<double>(n) / kRate + 0.1);
    voice.process(std::span(out).subspan(n, std::min(block, out.size() - n)));
  }
  return out;
}

inline double calc_rms(const std::vector<float>& x, double from_s, double to_s) {
  double sum = 0.0;
  const std::size_t first = from_s * kRate, last = to_s * kRate;
  for (std::size_t n = first; n < last; ++n) sum += static_cast<double>(x[n]) * x[n];
  return std::sqrt(sum / static_cast<double>(last - first));
}

inline float calc_peak(const std::vector<float>& x) {
  float peak = 0.0F;
  for (const float p : x) peak = std::max(peak, std::abs(p));
  return peak;
}

/// Noise force of each sample along the contact's direction.
inline std::vector<double> trace(ContactForces& contacts, const std::vector<LastingContact>& records, double seconds,
                                 const ContactSurface& other = kOther) {
  std::vector<double> force;
  std::size_t next = 0;
  for (std::int64_t sample = 0; static_cast<double>(sample) < seconds * kRate; sample += kSubBlock) {
    while (next < records.size() && records[next].time_s < static_cast<double>(sample) / kRate + 0.1) contacts.take(records[next++], other);
    contacts.reach(static_cast<double>(sample) / kRate + 0.1);
    const ContactBlock* drive = contacts.begin_sub_block(sample);
    for (int n = 0; n < kSubBlock; ++n) {
      double sum = 0.0;
      for (int c = 0; drive != nullptr && drive->forces && c < drive->contacts; ++c) {
        for (const ContactEnd& push : drive->push[c]) sum += static_cast<double>(push.signal[n]);
      }
      force.push_back(sum);
    }
  }
  return force;
}

inline std::vector<InventedMode> make_modes() {
  return {{120.0, 4.0, 0.7, {0.0, 0.0, 1.0}},
          {700.0, 9.0, -0.4, {0.5, 0.0, 0.8}},
          {5100.0, 60.0, 0.2, {0.1, 0.3, 0.6}, 0.1},
          {17000.0, 300.0, 0.1, {0.0, 0.2, -0.7}}};
}

}  // namespace carillon::testing
