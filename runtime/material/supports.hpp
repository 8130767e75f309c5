// Supports of bodies and the vibration energy they absorb: names in jobs and scenes, and their values.
// Table with sources: docs/howto/materials.md.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/document.hpp"
#include "runtime/base/json.hpp"

namespace carillon::material {

enum class BaseKind {
  kRigid,      // no absorption
  kPlate,      // infinite plate: wall
  kHalfSpace,  // block, large compared with the patch
  kLumped,     // mass, dashpot and spring at the patch
};

/// Foundation behind a patch of fixed nodes, or impedance at a point of a body.
struct Base {
  BaseKind kind = BaseKind::kRigid;
  std::string name = {};          // in the table; empty: custom
  double young_modulus_pa = 0.0;  // plate, half space
  double poisson_ratio = 0.2;
  double density_kg_m3 = 0.0;
  double thickness_m = 0.0;    // plate
  double mass_kg = 0.0;        // lumped: Z = i omega m + c + k (1 + i eta) / (i omega), isotropic
  double damping_n_s_m = 0.0;  // c
  double stiffness_n_m = 0.0;  // k
  double loss_factor = 0.0;    // eta of the stiffness or the plate
};

/// Attachment at a patch of fixed nodes.
struct Fixing {
  Base base{};              // key "on"
  std::string joint = {};   // key "joint", name in the table; empty: none, or "loss"
  double joint_loss = 0.0;  // loss factor of the body within one thickness of the patch (joint, or key "loss")
};

/// Table names for "on", "joint" and "by".
const std::vector<std::string>& list_base_names();
const std::vector<std::string>& list_joint_names();
const std::vector<std::string>& list_holder_names();

/// Reads "on", "joint" and "loss"; nullopt if all are missing. Throws InputError for unknown names and numbers out of range.
std::optional<Fixing> read_fixing(base::Object& object);

/// Reads a point support: a table name or {"mass_kg": ..., "damping_n_s_m": ..., "stiffness_n_m": ..., "loss_factor": ...}.
Base read_holder(base::Object& object, std::string_view key);

/// Inverse of read_fixing(): {"on": "brick wall", "loss": 0.01}; adds nothing for rigid and lossless.
base::Json write_fixing(const Fixing& fixing, base::Json json = base::Json::object());

/// For display: "on a brick wall, screwed".
std::string describe(const Fixing& fixing);
std::string describe(const Base& base);

}  // namespace carillon::material
