// A precompute job: what is asked for. One schema, one set of defaults (the initialisers here).
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>

#include "runtime/config/document.hpp"

namespace carillon::spec {

enum class Element { T4, T10 };
enum class Mass { consistent, lumped };
/// Which sparse factorisation serves shift-invert. automatic: CHOLMOD on one rank, MUMPS on several.
enum class Factorisation { automatic, mumps, cholmod };

/// Isotropic material with Rayleigh damping. Young's modulus and Poisson's ratio are derived where the job gives Lamé's constants.
struct Material {
  double young_modulus_pa = 0.0;
  double poisson_ratio = 0.0;
  double density_kg_m3 = 0.0;
  double alpha1_s = 0.0;
  double alpha2_per_s = 0.0;

  double lame_lambda_pa() const { return young_modulus_pa * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio)); }
  double lame_mu_pa() const { return young_modulus_pa / (2 * (1 + poisson_ratio)); }
};

/// Nodes whose displacement is zero: a named node set of the mesh, or all nodes inside a closed axis-parallel box.
struct Fixed {
  std::optional<std::string> node_set;
  std::optional<std::array<std::array<double, 3>, 2>> box_m;  // {min, max}
};

struct JobSpec {
  std::filesystem::path file;  // where it was read from
  std::filesystem::path mesh;  // absolute
  std::filesystem::path bank;  // absolute
  Material material;
  Element element = Element::T10;
  Mass mass = Mass::consistent;
  std::array<double, 2> band_hz{20.0, 20000.0};
  std::optional<int> max_modes;  // the lowest that many of the band
  std::optional<Fixed> fixed;
  double tolerance = 1e-8;  // solver.tolerance: relative residual of every mode; a bank takes none above 1e-4
  Factorisation factorisation = Factorisation::automatic;  // solver.factorisation
};

/// Reads and validates a job. Throws InputError. Not collective: rank 0 reads, then broadcasts the text.
JobSpec read_job(const std::filesystem::path& file);
JobSpec parse_job(std::string_view text, const std::filesystem::path& file);

/// Where the resolved job goes: beside the bank, "<bank>.resolved.json".
std::filesystem::path find_resolved_path(const std::filesystem::path& bank);

/// The job as JSON text with every value used. Paths are written relative to `folder` where they can be. `run_json` (an object, may be
/// empty) is stored under the key "run", which read_job() accepts and ignores, so that the result runs again as a job.
std::string resolved_json(const JobSpec& job, const std::filesystem::path& folder, const std::string& run_json);

}  // namespace carillon::spec
