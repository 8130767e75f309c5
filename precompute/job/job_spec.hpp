// A precompute job: what is asked for. One schema, one set of defaults (the initialisers here).
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
/// Which eigensolver. automatic: dense LAPACK for small problems, else the fastest that suits the band.
enum class Method { automatic, block_lanczos, krylov_schur, dense };
/// Which sparse factorisation serves shift-invert. automatic: our L D L^T, and MUMPS where that proves unstable.
enum class Factorisation { automatic, ldlt, mumps };

/// What becomes of the sound of the modes in the air. none: gains from the motion of the surface alone; bem: boundary elements; automatic:
/// boundary elements for the bodies that need them.
enum class AirMethod { none, automatic, bem };

/// A rigid plane next to the body, which is on the side that the normal shows to.
struct HalfSpace {
  std::array<double, 3> point_m{};
  std::array<double, 3> normal{};  // as given, not 0
};

inline constexpr int kSkinNodes = 4500;  // of the surface outside which the air is solved, unless a job gives another number

/// How the air outside the body is solved.
struct Air {
  AirMethod method = AirMethod::none;
  int skin_nodes = kSkinNodes;  // of the surface; a finer one is coarsened
  double error_db = -40.0;      // of the interpolation over the wave number, in each mode
  std::optional<HalfSpace> half_space = {};
};

inline constexpr int kMaxCoupledModes = 400;

inline constexpr int kMaxPlateModes = 200;  // of them, of a plate in closed form: 900 rows, 72 MB

/// Which modes large motion couples, and how exactly their energy is stored.
struct Nonlinear {
  bool is_stretch = false;     // "form": by the mean stretch alone, in a few rows
  int modes = 50;              // at most; the lowest that bend or twist
  double below_hz = 3000.0;    // of them
  double energy_error = 1e-2;  // relative, of the energy that is stored: 1e-3 takes twice as much to play
};

/// Nodes whose displacement is zero: a named node set of the mesh, or all nodes inside a closed axis-parallel box.
struct Fixed {
  std::optional<std::string> node_set = {};
  std::optional<std::array<std::array<double, 3>, 2>> box_m = {};  // {min, max}
  std::string place = {};                                          // "file:line" of the job, for messages
  std::string name = {};                                           // of the support in the bank; empty: the node set's, or "box N"
  material::Fixing fixing = {};                                    // what is behind these nodes; a scene may choose another
};

/// A body that the program meshes itself, in place of a mesh file: a parametric shape or a surface, as carillon-mesh takes them.
struct Body {
  std::string shape = {};                         // of carillon-mesh --shape; empty: a surface
  std::map<std::string, double> dimensions = {};  // of the shape, by carillon-mesh's names ("outer-radius"): metres, angles in degrees
  std::filesystem::path surface = {};             // absolute; empty: a shape
  std::optional<double> wall_m = {};              // surface: thickness of an open one, or of the shell in a closed one, without it solid
  std::string side = {};                   // surface with a wall: "middle", "outside" or "inside" of it; empty: carillon-mesh's default
  std::optional<double> height_m = {};     // surface: scaled to this extent along `up`
  std::optional<double> scale = {};        // surface: metres per unit of the file
  std::optional<double> close_holes = {};  // surface: holes up to this part of the body's diagonal are closed
  bool facets = false;                     // surface: facets are true planes of the body, not samples of a smooth surface
  char up = 'y';                           // surface: 'x', 'y' or 'z'
  std::string method = "auto";             // surface: "auto", "delaunay", "stuffing" or "extrude"
  std::optional<long long> nodes = {};     // of the mesh, mid-side nodes among them; at most one of nodes and edge_m
  std::optional<double> edge_m = {};
  std::string place = {};  // "file:line" of the job, for messages
};

/// What the job may use of a machine: for `carillon`, which starts it; no part of what is computed. 0: not given.
struct Resources {
  int ranks = 0;
  double memory_gb = 0.0;     // of all ranks together, 1e9 bytes
  double time_limit_s = 0.0;  // of one attempt
};

struct JobSpec {
  std::filesystem::path file;                 // where it was read from
  std::filesystem::path mesh;                 // absolute; empty when the job names a body
  double mesh_scale = 1.0;                    // metres per unit of the mesh file
  std::optional<Body> body;                   // in place of mesh
  std::optional<AnalyticBody> analytic;       // in place of both: its modes are known, and nothing is meshed
  std::filesystem::path bank;                 // absolute; empty: none given
  Material material;                          // of the whole body, or of the regions that `materials` does not name
  bool has_material = true;                   // false: `materials` has to name every region, and `material` is the first of them
  std::map<std::string, Material> materials;  // by region of the mesh: its tag as text, or its name
  Element element = Element::T10;
  Mass mass = Mass::consistent;
  std::array<double, 2> band_hz{20.0, 20000.0};
  std::optional<int> max_modes;          // the lowest that many of the band
  std::vector<Fixed> fixed;              // their union is fixed; empty: a free body
  double tolerance = 1e-8;               // solver.tolerance: relative residual of every mode; a bank takes none above 1e-4
  std::optional<double> accuracy_cents;  // in place of element, the mesh's size and tolerance: those are then the program's to choose
  Method method = Method::automatic;     // solver.method
  Factorisation factorisation = Factorisation::automatic;  // solver.factorisation
  Air air;                                                 // "radiation"
  std::optional<Nonlinear> nonlinear;                      // empty: the bank is linear
  Resources resources;
  std::vector<std::string> warnings;  // "file:line: ..." of numbers that may be meant, but seldom are
};

/// Whether a job without "bank" can be used: `carillon` keeps banks in its store.
enum class BankKey { required, optional };

/// Reads and validates a job. Throws InputError. Not collective: rank 0 reads, then broadcasts the text.
JobSpec read_job(const std::filesystem::path& file, BankKey bank = BankKey::required);
/// The same from text; `file` names it in messages and anchors relative paths, `first_line` is the number of its first line there.
JobSpec parse_job(std::string_view text, const std::filesystem::path& file, BankKey bank = BankKey::required, int first_line = 1);

/// The file of the mesh, the surface or the table that the job is about; empty: a shape or a formula.
const std::filesystem::path& get_input(const JobSpec& job);

/// Puts another file in its place, where there is one.
void set_input(JobSpec& job, const std::filesystem::path& file);

/// An output (absolute, or empty) of the job `file` (absolute) as it is to be opened. Where the job was given as a name without a folder,
/// what lies in its folder is one too: it means the folder that this process is in, even if that is renamed meanwhile.
std::filesystem::path find_opened(const std::filesystem::path& output, const std::filesystem::path& file,
                                  const std::filesystem::path& given);

/// Where the resolved job goes: next to the bank, "<bank>.resolved.json".
std::filesystem::path find_resolved_path(const std::filesystem::path& bank);

/// The job as JSON text with every value used, "resources" left out. Paths are written relative to `folder` where they can be. `run_json`
/// (an object, may be empty) is stored under the key "run", which read_job() accepts and ignores, so that the result runs again as a job.
std::string resolved_json(const JobSpec& job, const std::filesystem::path& folder, const std::string& run_json);

/// The words of the schema, as a job writes them.
std::string to_text(Element element);
std::string to_text(Mass mass);
std::string to_text(Method method);
std::string to_text(Factorisation factorisation);
std::string to_text(AirMethod method);

}  // namespace carillon::job
