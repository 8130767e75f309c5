// Parts of a scene file: bodies, modal and recorded, with their effects and supports; strikes; values of keys and their ranges.
#pragma once

#include <cstddef>
#include <limits>
#include <map>
#include <string>
#include <string_view>

#include "runtime/base/document.hpp"
#include "runtime/base/ranges.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/material/material.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::scene {

inline constexpr double kLongestS = 3600.0;
inline constexpr double kRoughestM = 1e-3;   // larger heights belong to the shape
inline constexpr double kSoftestPa = 100.0;  // a jelly
inline constexpr double kStiffestPa = 1e13;  // ten times diamond

using base::read_vector;
using base::read_within;
using physics::kFarthestM;
using physics::kMaxSpeedMS;

/// Three required numbers of magnitude at most `limit`.
Vec3 read_required_vector(base::Object& object, std::string_view key, double limit = kFarthestM);
/// A direction, of length 1.
Vec3 read_direction(base::Object& object, std::string_view key);
/// Reads elastic constants from the key "material"; nullptr without the key.
const material::Material* read_material(base::Object& object, double& young_modulus_pa, double& poisson_ratio);

inline constexpr std::size_t kMaxBodies = 1000;
inline constexpr std::size_t kNotModal = std::numeric_limits<std::size_t>::max();
using Names = std::map<std::string, std::size_t>;  // body to index in Scene::bodies; kNotModal: a recorded surface

/// Reads the keys "bodies", "effects" and "variation" of a scene. Throws InputError "file:line: ...".
Names parse_bodies(base::Object& root, Scene& scene);

/// Reads a body that joins a scene: a document with the keys of one of "bodies". Throws InputError as parse_bodies() does, and for a
/// recording, which has no motion.
SceneBody parse_new_body(const base::Document& document, const Scene& scene);

/// Appends the tables "body" and "recording" of the reference.
void describe_body_keys(std::vector<base::KeyTable>& tables);

/// Index of the modal body named by a key.
std::size_t find_body(base::Object& object, const Names& bodies, std::string_view key = "body");

inline constexpr std::size_t kMaxStrikes = 100000;

/// Reads the key "strikes" of a scene whose duration is known. Throws InputError "file:line: ...".
void parse_strikes(base::Object& root, const Names& names, Scene& scene);

/// Reads the key "sensors" of a scene. Throws InputError "file:line: ...".
void parse_sensors(base::Object& root, const Names& names, Scene& scene);

/// Appends the table "sensor" of the reference.
void describe_sensor_keys(std::vector<base::KeyTable>& tables);

/// Appends the tables "strike" and "mallet" of the reference.
void describe_strike_keys(std::vector<base::KeyTable>& tables);

}  // namespace carillon::scene
