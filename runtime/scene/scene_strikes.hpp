// Strikes of a scene file, and their mallets.
#pragma once

#include <cstddef>

#include "runtime/base/document.hpp"
#include "runtime/scene/scene_bodies.hpp"

namespace carillon::scene {

inline constexpr std::size_t kMaxStrikes = 100000;

/// Reads the key "strikes" of a scene whose duration is known. Throws InputError "file:line: ...".
void parse_strikes(base::Object& root, const Names& names, Scene& scene);

/// Appends the tables "strike" and "mallet" of the reference.
void describe_strike_keys(std::vector<base::KeyTable>& tables);

}  // namespace carillon::scene
