#include "runtime/scene/banks.hpp"

#include <fmt/format.h>

#include "runtime/acoustics/radiation/transfers.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/scene/missing_banks.hpp"

namespace carillon::scene {
namespace {

/// Applies the support losses to the body's bank.
void mount(Scene& scene, SceneBody& body, bank::Bank& bank) {
  const mounting::Losses losses = mounting::calc_losses(bank, body.support);
  if (losses.is_empty()) return;
  body.mounting = {mounting::describe(losses, bank), losses.beyond, losses.mixed, {}, bank.decay_per_s, {}};
  if (const std::string limits = mounting::describe_limits(losses, bank); !limits.empty())
    scene.warnings.push_back(fmt::format("{}: the support of body \"{}\": {}", scene.file.string(), body.name, limits));
  mounting::apply(losses, bank);
  body.mounting.decay_per_s = bank.decay_per_s;
  for (std::size_t m = 0; m < bank.mode_count(); ++m) body.mounting.freq_hz.push_back(bank.freq_hz(m));
}

}  // namespace

Banks read_banks(Scene& scene, bool is_quiet) {
  find_missing_banks(scene, is_quiet);
  Banks banks;
  std::map<std::filesystem::path, int> left;  // bodies that still need the unmodified bank
  for (const SceneBody& body : scene.bodies) ++left[body.bank];
  std::map<std::filesystem::path, bank::Bank> files;
  std::map<const ReadBank*, const Mounting*> mountings;
  for (SceneBody& body : scene.bodies) {
    const bool is_last = --left[body.bank] == 0;
    auto& slot = banks[{body.bank, mounting::write_key(body.support)}];
    if (!slot) {
      const std::string place = body.support_place.empty() ? scene.file.string() : body.support_place;
      try {
        slot = std::make_unique<ReadBank>();
        if (!files.contains(body.bank)) files[body.bank] = bank::choose_frequencies(bank::read_bank(body.bank), scene.frequencies);
        slot->bank = is_last ? std::move(files[body.bank]) : files[body.bank];
        mount(scene, body, slot->bank);
        const radiation::PutGains put = radiation::put_gains(slot->bank, scene.radiation);
        slot->sphere_radius_m = put.sphere_radius_m;
        slot->limited = put.limited;
        slot->transfers = radiation::make_transfers(slot->bank);
      } catch (const InputError& error) {
        throw InputError(fmt::format("{}: the bank of body \"{}\": {}", place, body.name, error.what()));
      }
      mountings[slot.get()] = &body.mounting;
    } else {
      body.mounting = *mountings[slot.get()];
    }
    body.spec.bank = &slot->bank;
    body.sphere_radius_m = slot->sphere_radius_m;
    body.limited = slot->limited;
    body.transfers = slot->transfers;
  }
  return banks;
}

}  // namespace carillon::scene
