#include "runtime/host/banks.hpp"

#include <fmt/format.h>

namespace carillon::host {

Banks read_banks(Scene& scene) {
  Banks banks;
  for (SceneBody& body : scene.bodies) {
    auto& slot = banks[body.bank];
    if (!slot) {
      try {
        slot = std::make_unique<bank::Bank>(bank::read_bank(body.bank));
        slot->radiation_gain = radiation::calc_gains(*slot, scene.radiation);
      } catch (const InputError& error) {
        throw InputError(fmt::format("{}: the bank of body \"{}\": {}", scene.file.string(), body.name, error.what()));
      }
    }
    body.spec.bank = slot.get();
  }
  return banks;
}

}  // namespace carillon::host
