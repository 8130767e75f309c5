// What fixes or carries a body, and the vibration energy it absorbs: the words of jobs and scenes, and the numbers behind them.
// The table with the sources: docs/howto/supports.md.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/document.hpp"
#include "runtime/base/json.hpp"

namespace carillon::material {

enum class BaseKind {
  kRigid,      // absorbs nothing
  kPlate,      // an infinite plate: a wall
  kHalfSpace,  // a block that is large compared with the patch
  kLumped,     // mass, dashpot and spring at the patch
};

/// What is behind a patch of fixed nodes, or what touches a point of a body.
struct Base {
  BaseKind kind = BaseKind::kRigid;
  std::string name = {};          // of the table; empty: given by its numbers
  double young_modulus_pa = 0.0;  // plate, half space
  double poisson_ratio = 0.2;
  double density_kg_m3 = 0.0;
  double thickness_m = 0.0;    // plate
  double mass_kg = 0.0;        // lumped: Z = i omega m + c + k (1 + i eta) / (i omega), the same in all directions
  double damping_n_s_m = 0.0;  // c
  double stiffness_n_m = 0.0;  // k
  double loss_factor = 0.0;    // eta, of the stiffness or of the plate
};

/// How a body is fixed at a patch of fixed nodes.
struct Fixing {
  Base base{};              // the key "on"
  std::string joint = {};   // the key "joint", of the table; empty: none, or "loss"
  double joint_loss = 0.0;  // loss factor of the body within one thickness of the patch: of the joint, or the key "loss"
};

/// The names of the table: for "on", for "joint" and for "by".
const std::vector<std::string>& list_base_names();
const std::vector<std::string>& list_joint_names();
const std::vector<std::string>& list_holder_names();

/// Reads "on", "joint" and "loss" of an object; nothing when it has none of them. Throws InputError for an unknown name and for numbers
/// out of range.
std::optional<Fixing> read_fixing(base::Object& object);

/// Reads what touches a point: a name of the table or {"mass_kg": ..., "damping_n_s_m": ..., "stiffness_n_m": ..., "loss_factor": ...}.
Base read_holder(base::Object& object, std::string_view key);

/// Adds to an object what read_fixing() reads back: {"on": "brick wall", "loss": 0.01}; nothing when it is rigid without loss.
base::Json write_fixing(const Fixing& fixing, base::Json json = base::Json::object());

/// For people: "on a brick wall, screwed".
std::string describe(const Fixing& fixing);
std::string describe(const Base& base);

}  // namespace carillon::material
