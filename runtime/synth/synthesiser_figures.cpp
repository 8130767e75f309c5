// Figures of a synthesiser and its bodies, published for all threads.
#include <algorithm>
#include <array>
#include <atomic>
#include <tuple>

#include "runtime/synth/synthesiser.hpp"

namespace carillon::synth {

void Synthesiser::publish(int number) noexcept {
  const std::size_t i = number;
  const BodyWork& work = playing_[i]->get_work();
  Published& published = published_bodies_[i];
  for (const Effect effect : EffectSet::all()) published.units[effect].store(work.units[effect], std::memory_order_relaxed);
  published.peak_pa.store(work.peak_pa, std::memory_order_relaxed);
  published.deflection.store(work.deflection, std::memory_order_relaxed);
  published.energy_rise.store(work.energy_rise, std::memory_order_relaxed);
  published.given_j.store(work.energy.given_j, std::memory_order_relaxed);
  published.lost_j.store(work.energy.lost_j, std::memory_order_relaxed);
  published.held_j.store(work.energy.held_j, std::memory_order_relaxed);
  published.radiated_j.store(work.energy.radiated_j, std::memory_order_relaxed);
}

EffectCounters Synthesiser::get_effect_counters(int body) const noexcept {
  EffectCounters counters;
  if (body < 0 || body >= options_.max_bodies) return counters;
  const Published& published = published_bodies_[body];
  for (const Effect effect : EffectSet::all()) counters.units[effect] = published.units[effect].load(std::memory_order_relaxed);
  return counters;
}

double Synthesiser::get_peak_pa(int body) const noexcept {
  if (body < 0 || body >= options_.max_bodies) return 0.0;
  return static_cast<double>(published_bodies_[body].peak_pa.load(std::memory_order_relaxed));
}

bool Synthesiser::measure_amplitudes(int body, std::span<float> by_bank_mode) const noexcept {
  std::fill(by_bank_mode.begin(), by_bank_mode.end(), 0.0F);
  if (body < 0 || body >= options_.max_bodies || playing_[body] == nullptr) return false;
  const ResonatorBank* modes = playing_[body]->get_modes();
  if (modes != nullptr) modes->measure_amplitudes(by_bank_mode);
  return true;
}

double Synthesiser::get_deflection(int body) const noexcept {
  if (body < 0 || body >= options_.max_bodies) return 0.0;
  return published_bodies_[body].deflection.load(std::memory_order_relaxed);
}

double Synthesiser::get_energy_rise(int body) const noexcept {
  if (body < 0 || body >= options_.max_bodies) return 0.0;
  return published_bodies_[body].energy_rise.load(std::memory_order_relaxed);
}

ModeEnergy Synthesiser::get_mode_energy(int body) const noexcept {
  if (body < 0 || body >= options_.max_bodies) return {};
  const Published& of = published_bodies_[body];
  const auto get = [](const std::atomic<double>& x) { return x.load(std::memory_order_relaxed); };
  return {get(of.given_j), get(of.lost_j), get(of.held_j), get(of.radiated_j)};
}

void Synthesiser::publish_counters() noexcept {
  const ContactRecordCounters& contacts = work_.contacts;
  const std::array values{work_.strikes,    work_.refused,    work_.late,          work_.resets,      work_.mode_samples,
                          work_.faded,      work_.underruns,  work_.zeroed,        contacts.accepted, contacts.refused,
                          contacts.dropped, contacts.thinned, contacts.without_use};
  static_assert(values.size() == std::tuple_size_v<decltype(published_)>);
  for (std::size_t i = 0; i < values.size(); ++i) published_[i].store(values[i], std::memory_order_relaxed);
}

SynthesiserCounters Synthesiser::get_counters() const noexcept {
  const auto get = [this](std::size_t i) { return published_[i].load(std::memory_order_relaxed); };
  return {.strikes = get(0),
          .refused = get(1),
          .late = get(2),
          .faults = ring_.get_faults(),
          .overflows = ring_.get_overflows(),
          .resets = get(3),
          .mode_samples = get(4),
          .faded = get(5),
          .underruns = get(6),
          .zeroed = get(7),
          .contacts = {.accepted = get(8), .refused = get(9), .dropped = get(10), .thinned = get(11), .without_use = get(12)}};
}

}  // namespace carillon::synth
