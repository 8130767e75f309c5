// Reads the banks of a scene.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "runtime/bank/bank.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::scene {

struct ReadBank {
  bank::Bank bank;
  double sphere_radius_m = 0.0;
  radiation::Limited limited;
  std::shared_ptr<const radiation::Transfers> transfers;  // nullptr without multipoles
};
/// Key: file and support (mounting::write_key()).
using Banks = std::map<std::pair<std::filesystem::path, std::string>, std::unique_ptr<ReadBank>>;

/// Reads every bank once per way of support, applies the support losses and computes the gains of the scene; those of `"sphere"` are
/// limited by damping. The scene's bodies point into the result and receive its radius and support summary; warnings about supports join
/// the scene's. Missing banks are found or computed first (find_missing_banks()). Throws InputError naming scene and body.
Banks read_banks(Scene& scene, bool is_quiet = false);

/// The same for a body that joins the scene: reads its bank, unless `banks` has it.
void read_bank(Scene& scene, SceneBody& body, Banks& banks);

}  // namespace carillon::scene
