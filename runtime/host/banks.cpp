#include "runtime/host/banks.hpp"

#include <fmt/format.h>

namespace carillon::host {

Banks read_banks(Scene& scene) {
  Banks banks;
  for (SceneBody& body : scene.bodies) {
    auto& slot = banks[body.bank];
    if (!slot) {
      try {
        slot = std::make_unique<ReadBank>();
        slot->bank = bank::read_bank(body.bank);
        radiation::Radiation radiation = radiation::calc_radiation(slot->bank, scene.radiation);
        slot->bank.radiation_gain = std::move(radiation.gains);
        slot->sphere_radius_m = radiation.sphere_radius_m;
      } catch (const InputError& error) {
        throw InputError(fmt::format("{}: the bank of body \"{}\": {}", scene.file.string(), body.name, error.what()));
      }
    }
    body.spec.bank = &slot->bank;
    body.sphere_radius_m = slot->sphere_radius_m;
  }
  return banks;
}

}  // namespace carillon::host
