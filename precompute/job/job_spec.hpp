// A precompute job. The initialisers are the defaults of its keys (keys.hpp).
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "precompute/job/analytic_body.hpp"
#include "runtime/base/document.hpp"
#include "runtime/material/material.hpp"
#include "runtime/material/supports.hpp"

namespace carillon::job {

using material::Material;

enum class Element { T4, T10 };
enum class Mass { consistent, lumped };
enum class Shapes { packed, exact };
/// Eigensolver. automatic: dense LAPACK for small problems, else the fastest for the band.
enum class Method { automatic, block_lanczos, krylov_schur, dense };
/// Sparse factorisation of shift-invert. automatic: the own L D L^T, and MUMPS if that is unstable.
enum class Factorisation { automatic, ldlt, mumps };

/// Radiation of the modes. none: gains from the motion of the surface alone; bem: boundary elements; automatic: boundary elements for
/// bodies that need them.
enum class AirMethod { none, automatic, bem };

/// A rigid plane; the body is on the side of the normal.
struct HalfSpace {
  std::array<double, 3> point_m{};
  std::array<double, 3> normal{};  // as given, not 0
};

inline constexpr int kSkinNodes = 4500;  // default number of surface nodes of the air solve

/// Settings of the air solve.
struct Air {
  AirMethod method = AirMethod::none;
  int skin_nodes = kSkinNodes;  // a finer surface is coarsened
  double error_db = -40.0;      // interpolation error over the wave number, per mode
  std::optional<HalfSpace> half_space = {};
};

inline constexpr int kMaxCoupledModes = 400;

inline constexpr int kMaxPlateModes = 200;  // plate in closed form: 900 rows, 72 MB

/// Coupling of modes in large motion, and accuracy of its energy.
struct Nonlinear {
  bool is_stretch = false;     // "form": mean stretch only, in a few rows
  int modes = 50;              // maximum; the lowest that bend or twist
  double below_hz = 3000.0;    // maximum frequency
  double energy_error = 1e-2;  // relative, of the stored energy: 1e-3 doubles the cost of playback
};

/// Nodes whose displacement is zero: a named node set of the mesh, or all nodes inside a closed axis-parallel box.
struct Fixed {
  std::optional<std::string> node_set = {};
  std::optional<std::array<std::array<double, 3>, 2>> box_m = {};  // {min, max}
  std::string place = {};                                          // "file:line" of the job, for messages
  std::string name = {};                                           // of the support in the bank; default: the node set's, or "box N"
  material::Fixing fixing = {};                                    // default of scenes
};

/// A body meshed by the program: a parametric shape or a surface, as in carillon-mesh.
struct Body {
  std::string shape = {};                         // of carillon-mesh --shape; empty: a surface
  std::map<std::string, double> dimensions = {};  // by carillon-mesh's names ("outer-radius"): metres, degrees
  std::filesystem::path surface = {};             // absolute; empty: a shape
  std::optional<double> wall_m = {};              // surface: wall thickness; empty: solid
  std::string side = {};                          // position of the surface in the wall; empty: carillon-mesh's default
  std::optional<double> height_m = {};            // surface: scaled to this extent along `up`
  std::optional<double> scale = {};               // surface: metres per unit of the file
  std::optional<double> close_holes = {};         // surface: closes holes up to this share of the body's diagonal
  bool facets = false;                            // surface: facets are true planes, not samples of a smooth surface
  std::string up = "y";                           // surface: axis of height_m
  std::string method = "auto";                    // surface: mesher
  std::optional<long long> nodes = {};            // including mid-side nodes; at most one of nodes and edge_m
  std::optional<double> edge_m = {};
  std::string place = {};  // "file:line" of the job, for messages
};

/// Limits of the machine for `carillon`; they do not affect the result. 0: not given.
struct Resources {
  int ranks = 0;
  double memory_gb = 0.0;     // all ranks together, 1e9 bytes
  double time_limit_s = 0.0;  // of one attempt
};

struct JobSpec {
  std::filesystem::path file;                 // source
  std::filesystem::path mesh;                 // absolute; empty if the job gives a body
  double mesh_scale = 1.0;                    // metres per unit of the mesh file
  std::optional<Body> body;                   // alternative to mesh
  std::optional<AnalyticBody> analytic;       // alternative to both: known modes, no mesh
  std::filesystem::path bank;                 // absolute; empty: none given
  Shapes shapes = Shapes::packed;             // in the bank
  int sensitivities = 0;                      // modes with sensitivities, the lowest; 0: none
  Material material;                          // of the whole body, or of regions not in `materials`
  bool takes_file_material = false;           // "material": "file": the mesh file has it
  bool has_material = true;                   // false: `materials` must cover all regions; `material` is its first
  std::map<std::string, Material> materials;  // by region of the mesh: its tag as text, or its name
  Element element = Element::T10;
  Mass mass = Mass::consistent;
  std::array<double, 2> band_hz{20.0, 20000.0};
  std::optional<int> max_modes;          // maximum number, the lowest of the band
  std::vector<Fixed> fixed;              // union; empty: free body
  double tolerance = 1e-8;               // relative residual of every mode; banks accept at most 1e-4
  std::optional<double> accuracy_cents;  // the program then chooses element, mesh size and tolerance
  Method method = Method::automatic;
  Factorisation factorisation = Factorisation::automatic;
  Air air;                             // "radiation"
  std::optional<Nonlinear> nonlinear;  // empty: the bank is linear
  Resources resources;
  std::vector<std::string> warnings;  // "file:line: ..." of implausible values
};

/// "bank" is optional for `carillon`, which keeps banks in its store.
enum class BankKey { required, optional };

/// Reads and validates a job. Throws InputError. Not collective: rank 0 reads, then broadcasts the text.
JobSpec read_job(const std::filesystem::path& file, BankKey bank = BankKey::required);
/// The same from text; `file` names it in messages and anchors relative paths, `first_line` is the number of its first line there.
JobSpec parse_job(std::string_view text, const std::filesystem::path& file, BankKey bank = BankKey::required, int first_line = 1);

/// File of the mesh, surface or table; empty for shapes and formulas.
const std::filesystem::path& get_input(const JobSpec& job);

/// Replaces it, if any.
void set_input(JobSpec& job, const std::filesystem::path& file);

/// Path to open for an output (absolute, or empty) of the job `file` (absolute). If the job was given as a name without a folder, outputs
/// in its folder become relative names: they stay in the working directory even if that is renamed.
std::filesystem::path find_opened(const std::filesystem::path& output, const std::filesystem::path& file,
                                  const std::filesystem::path& given);

/// Path of the resolved job: "<bank>.resolved.json".
std::filesystem::path find_resolved_path(const std::filesystem::path& bank);

/// The job as JSON text with all values used, without "resources". Paths are relative to `folder` if possible. `run_json` (an object, may
/// be empty) is stored under the key "run", which read_job() ignores, so the result is a job again.
std::string resolved_json(const JobSpec& job, const std::filesystem::path& folder, const std::string& run_json);

/// Reference of the keys, for carillon-precompute --keys.
std::vector<base::KeyTable> describe_job_keys();

/// Words of the job.
std::string to_text(Element element);
std::string to_text(Mass mass);
std::string to_text(Shapes shapes);

}  // namespace carillon::job
