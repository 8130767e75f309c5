// Bodies of a scene file, modal and recorded, with their effects and supports.
#pragma once

#include <cstddef>
#include <limits>
#include <map>
#include <string>
#include <string_view>

#include "runtime/base/document.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::scene {

inline constexpr std::size_t kMaxBodies = 1000;
inline constexpr std::size_t kNotModal = std::numeric_limits<std::size_t>::max();
using Names = std::map<std::string, std::size_t>;  // body to index in Scene::bodies; kNotModal: a recorded surface

/// Reads the keys "bodies", "effects" and "variation" of a scene. Throws InputError "file:line: ...".
Names parse_bodies(base::Object& root, Scene& scene);

/// Appends the tables "body" and "recording" of the reference.
void describe_body_keys(std::vector<base::KeyTable>& tables);

/// Index of the modal body named by a key.
std::size_t find_body(base::Object& object, const Names& bodies, std::string_view key = "body");

}  // namespace carillon::scene
