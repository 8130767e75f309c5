// Stages of a run and their results, in the order of a run, and its record.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "precompute/eigen/types.hpp"
#include "precompute/fem/assemble.hpp"
#include "precompute/fem/energy.hpp"
#include "precompute/fem/error_bars/error_bars.hpp"
#include "precompute/fem/materials.hpp"
#include "precompute/fem/supports.hpp"
#include "precompute/job/cost/problem_size.hpp"
#include "precompute/job/setting.hpp"
#include "precompute/mesh/check.hpp"
#include "precompute/mesh/distributed/distributed_mesh.hpp"
#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/run/io/surface_modes.hpp"
#include "precompute/run/run.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/bank/quartic_energy.hpp"
#include "runtime/base/json.hpp"

namespace carillon::ldlt {
class MeshOrder;
}  // namespace carillon::ldlt

namespace carillon::run {

using io::Surface;
using job::Setting;

/// The mesh of the body, distributed over the ranks.
struct Body {
  mesh::DistributedMesh pieces;
  std::shared_ptr<const ldlt::MeshOrder> order;      // elimination order of the factorisation (CutMesh), until make_layout()
  mesh::CheckReport check;                           // rank 0
  std::vector<std::string> mesher_warnings;          // differences between mesh and surface; rank 0
  std::int64_t fixed_nodes = 0;                      // rank 0
  bool is_extruded = false;                          // from a surface with a thin wall; rank 0
  Surface surface;                                   // rank 0
  std::map<std::int32_t, std::string> region_names;  // rank 0
  fem::FileMaterials file_materials;                 // rank 0
  std::string source;                                // "bunny.msh", "bar, 2000 nodes wanted"; for messages
};

struct BodyProperties {
  fem::Materials materials;
  std::vector<double> volume_m3;  // of each material
  fem::RigidBody rigid;
};

struct AssembledSystem {
  fem::System matrices;  // K and M
  BodyProperties properties;
};

struct ModeProperties {
  std::vector<double> decay_per_s;  // (m)
  fem::EnergyShares shares;         // of the materials; empty for a single one
  fem::Supports supports;           // energy and reactions at the fixed nodes
  error_bars::ErrorBars bars;
};

struct SolvedBody {
  BodyProperties properties;
  eigen::Modes modes;
  ModeProperties errors;
};

/// A solved setting of the job.
struct Solution {
  Setting setting;
  Body body;
  SolvedBody solved;
};

struct CouplingReport {
  bank::QuarticEnergy energy;  // on rank 0; mode numbers of the bank. Empty: nothing is coupled
  std::string result;          // "30 coupled modes up to 2710 Hz, ..."; empty: not requested
};

struct AirReport {
  bool is_solved = false;
  std::string why;     // reason for or against boundary elements; empty: not requested
  std::string result;  // "boundary elements ..., error -41 dB"
};

/// Printed by main at the end; filled on rank 0.
struct RunSummary {
  std::filesystem::path bank;
  std::filesystem::path resolved;
  std::string result;       // "227 modes in 20 .. 20000 Hz ...": count, completeness, accuracy
  std::string warning;      // audible error bars, and the remedy; empty: none
  bool is_stopped = false;  // by a signal, with a checkpoint; described in `result`
};

/// The job's key for the unit of its mesh, with a suggested value, for messages about the size of the body.
std::string describe_scale_key(const job::JobSpec& job);

/// Number of modes to compute: more than `max_modes`, so that the lowest corrected ones are reliable; nullopt: all of the band.
std::optional<std::int64_t> find_computed_count(const job::JobSpec& job);

/// Number of modes whose corrected frequency is below the job's band.
std::int64_t count_below_band(const job::JobSpec& job, const error_bars::Corrections& corrections);

/// Modes of the bank, ascending: those whose corrected frequency is in the job's band, the lowest `max_modes` of them.
std::vector<std::size_t> find_bank_modes(const job::JobSpec& job, const error_bars::Corrections& corrections);

/// Rank 0.
cost::ProblemSize find_problem_size(const Run& run, const Setting& setting, const Body& body);

/// Cuts every tetrahedron into eight: four corner tetrahedra and four from the inner octahedron, cut along its shortest diagonal. Ten-node
/// elements keep their curved sides: new nodes are on the quadratic map of the old element. Node sets gain the nodes whose old edge or face
/// is entirely in the set. Pre: a mesh accepted by check_mesh. Not collective.
mesh::TetMesh refine_mesh(const mesh::TetMesh& mesh);

/// Reads or makes the mesh, checks it, and distributes it; rank 0 frees the whole mesh. Collective. Throws on every rank: InputError naming
/// the file or the job's line, SystemError.
Body make_body(Run& run, const Setting& setting);

/// Finds the materials, assembles K and M, and integrates volumes and inertia. Warns of locking. Phase "assemble". Collective. Throws on
/// every rank: InputError, SolveError, SystemError, naming the body or the job's line.
AssembledSystem assemble_system(Run& run, const Setting& setting, const Body& body);

/// Modes of the mesh to be found.
struct Range {
  double low_hz = 0.0, high_hz = 0.0;
  std::optional<std::int64_t> max_modes;  // the lowest; nullopt: all
};

/// A little wider than the job's band, for modes whose corrected frequencies are in it.
Range find_range(const job::JobSpec& job, const Setting& setting);

/// Options of the eigensolver.
eigen::Options make_options(const job::JobSpec& job, const Setting& setting, const Range& range);

/// Lower end of the bank's band [Hz]: from the job, or higher if rounding hides lower modes.
double find_low_hz(const job::JobSpec& job, const eigen::Modes& modes);

/// Positions and components of the free nodes; moves the elimination order out of the body.
eigen::NodeLayout make_layout(Body& body);

/// All modes of find_range(), with the proof of completeness. Phase "modes". Collective. Throws on every rank: InputError, SolveError,
/// SystemError, naming the body and the job; eigen::Stopped when a signal requested a checkpoint.
eigen::Modes find_modes(Run& run, const Setting& setting, const Body& body, const eigen::Problem& problem);

/// The same of a wider range. Continues `known`, a result of find_modes(), unless the range has only the lowest modes. Without checkpoints:
/// a run stopped there resumes from `known`.
eigen::Modes find_more_modes(Run& run, const Setting& setting, const Body& body, const eigen::Problem& problem, const Range& range,
                             const eigen::Modes& known);

/// Warns of modes below the band and of mechanisms.
void warn_of_band(Run& run, const Body& body, const eigen::Modes& modes, const error_bars::Corrections& corrected);

/// Assembles K and M, finds the modes of the job's band, and estimates their errors. Frees K, M and the elimination order of the body.
/// Collective. Throws on every rank: InputError, SolveError, SystemError, naming the body and the job; eigen::Stopped when a signal
/// requested a checkpoint.
SolvedBody solve_body(Run& run, const Setting& setting, Body& body);

/// True if air or coupled modes follow the modes and their errors.
bool has_later_stages(const job::JobSpec& job);

/// Refuses "nonlinear" in a build without the component NONLINEAR. Throws InputError.
void check_coupling(const job::JobSpec& job);

/// Condenses the quartic energy of the modes requested by "nonlinear", from the unrounded shapes. Assembles K and M again. Warns if
/// condensed motions are not much faster than the coupled modes. A run stopped here resumes from its modes. Phase "coupling". Collective.
/// Throws on every rank: InputError, SolveError, SystemError, naming the body and the job.
CouplingReport couple_modes(Run& run, const Solution& found);

/// Refuses "radiation" in a build without the component AIR. Throws InputError.
void check_air(const job::JobSpec& job);

/// Adds the multipoles of all modes to the bank (rank 0 only), as the job's "radiation" says. With a checkpoint, solved wave numbers are
/// kept in a file next to it. Phase "air". Collective. Throws on every rank: InputError, SolveError, SystemError; eigen::Stopped when a
/// signal requested a checkpoint.
AirReport add_air(Run& run, bank::Bank& bank);

/// Reads the bank options.radiate, adds the multipoles of all modes by boundary elements, and writes it to options.bank, which may be the
/// same file. The same bytes on any number of ranks. Resumes from options.checkpoint. Collective. Throws as run_job().
RunSummary radiate_bank(const comm::Communicator& comm, const RunOptions& options);

/// Reads the job on rank 0 and runs it on all ranks: mesh, partition, assembly, modes, error bars, bank. Writes the bank and
/// <bank>.resolved.json, each atomically; checks before the solve that they can be written. Unused words of options.solver_options are an
/// error, before anything is written. Progress goes to standard output (unless quiet) and warnings to standard error, on rank 0.
/// Collective. Throws the same on every rank: InputError, SolveError, SystemError.
RunSummary run_job(const comm::Communicator& comm, const std::filesystem::path& job_file, const RunOptions& options);

/// "run" of the resolved job and of the bank's provenance. Rank 0 only.
base::Json describe_run(const Run& run, const Solution& found, const Measured& measured);

/// Writes the bank of a job, its shapes packed unless the job wants them exact or nothing is gained. Rank 0 only.
void write_bank(Run& run, const bank::Bank& bank);

/// Its part about the program: name, version, ranks, phases.
base::Json describe_program(const Run& run);

/// Materials by region: constants, damping, volume.
base::Json describe_materials(const fem::Materials& materials, const std::vector<double>& volume_m3);

}  // namespace carillon::run
