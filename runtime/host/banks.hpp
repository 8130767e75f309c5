// The banks that a scene names.
#pragma once

#include <filesystem>
#include <map>
#include <memory>

#include "runtime/bank/bank.hpp"
#include "runtime/host/scene.hpp"

namespace carillon::host {

struct ReadBank {
  bank::Bank bank;
  double sphere_radius_m = 0.0;
};
using Banks = std::map<std::filesystem::path, std::unique_ptr<ReadBank>>;

/// Reads every bank once, and gives it the gains that the scene asks for. The scene's bodies point into the result and know its radius.
/// Throws InputError, which names scene and body.
Banks read_banks(Scene& scene);

}  // namespace carillon::host
