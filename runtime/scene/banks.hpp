// The banks that a scene names.
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
/// By file, and what carries the body (mounting::write_key()).
using Banks = std::map<std::pair<std::filesystem::path, std::string>, std::unique_ptr<ReadBank>>;

/// Reads every bank once for every way in which its bodies are mounted, puts in what the supports take, and gives it the gains that the
/// scene asks for; those of `"sphere"` are limited to what damping takes. The scene's bodies point into the result, and know its radius and
/// in words how they are mounted; warnings about supports join the scene's. Throws InputError, which names scene and body.
/// Banks that are missing are found or computed first (find_missing_banks()).
Banks read_banks(Scene& scene, bool is_quiet = false);

}  // namespace carillon::scene
