// A job of carillon-simulate: deforming bodies, strikers, obstacles, receivers. Reference: docs/howto/simulate.md.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "precompute/job/job_spec.hpp"
#include "precompute/job/obstacles.hpp"
#include "runtime/base/keys.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::job {

/// Nodes of a named set of the mesh, or inside a closed axis-parallel box in the axes of the body's mesh.
struct NodeGroup {
  std::string node_set = {};  // empty: the box
  std::array<Vec3, 2> box_m{};
  std::string place = {};  // "file:line" of the job, for messages
};

/// Nodes that follow a path: rows [t, x, y, z], displacement [m] from the initial position, twice continuously differentiable between rows,
/// at rest before and after.
struct Drive {
  NodeGroup nodes;
  std::vector<std::array<double, 4>> path;
  std::optional<double> release_s = {};  // none: never released
};

/// Initial shape of a bent body, at rest: by a mode, a force, or displaced nodes. Axes of the body's mesh.
struct Bend {
  std::string place = {};  // "file:line" of the job, for messages
  int mode = 0;            // 0: none
  double amplitude_m = 0;  // largest displacement of the mode
  std::optional<Vec3> force_n = {};
  Vec3 point_m{};  // of the force; moved to the nearest point of the surface
  std::optional<NodeGroup> nodes = {};
  Vec3 displacement_m{};
  std::vector<std::array<double, 6>> table = {};  // positions of nodes and their displacements [m]
};

/// A thin sheet, given by its middle surface.
struct Sheet {
  std::string shape = {};            // "rectangle" or "disc"
  double length_m = 0, width_m = 0;  // of a rectangle, along x and y
  double radius_m = 0;               // of a disc
  double bow_m = 0;                  // rise of a rectangle's circular arc over its ends at -x and +x, without stress
  int cells = 24;                    // along the longer side, or the diameter
  double thickness_m = 0;
};

/// A body of the simulation, of Saint Venant and Kirchhoff's law (OCE01). One of mesh, body and sheet is given.
struct SimulatedBody {
  std::string name = {};
  std::string place = {};  // "file:line" of the job, for messages
  std::filesystem::path mesh = {};
  double mesh_scale = 1.0;
  std::optional<Body> body = {};
  std::optional<Sheet> sheet = {};
  Element element = Element::T10;
  Material material = {};              // isotropic, Rayleigh damping
  std::vector<NodeGroup> fixed = {};   // of a sheet: clamped
  std::vector<NodeGroup> hinged = {};  // of a sheet: no displacement, free rotation
  std::vector<Drive> drives = {};
  std::vector<Bend> bends = {};
  Vec3 position_m{};                              // of the mesh's origin
  Vec3 rotation_deg{};                            // about the fixed axes of the world: x first, then y, then z
  Vec3 velocity_m_s{}, angular_velocity_rad_s{};  // at the start, about the centre of mass
  bool sounds = true;
};

struct Striker {
  std::string place;
  BallStriker ball;
};
struct Obstacle {
  std::string place;
  RigidObstacle form;
};

/// Parameters of all contacts.
struct ContactSpec {
  double stiffness = 0.5;    // kappa: penalty over E*/l, the modulus over the local edge length
  double restitution = 1.0;  // of a slow impact on a rigid body: loss in the contact itself
  double friction = 0.3;     // Coulomb
};

/// A distributed force about a point.
struct Blow {
  std::string place = {};
  std::size_t body = 0;
  double time_s = 0;  // middle
  Vec3 point_m{};     // moved to the nearest point of the surface, in the axes of the body's mesh
  Vec3 impulse_n_s{};
  double duration_s = 1e-4;  // of a raised cosine
};

enum class SurfaceSound { kirchhoff, rayleigh, paper2001 };

/// Receivers: two ears, or microphones.
struct Receivers {
  Vec3 position_m{0.0, -1.5, 0.5};
  Vec3 facing{0.0, 1.0, 0.0};  // unit
  double ear_distance_m = 0.2;
  std::vector<Vec3> microphones_m = {};  // replace the ears
  double cardioid = 0.0;                 // q of (1 - q) + q cos: 0 omnidirectional, 0.5 cardioid
};

struct SimulationSpec {
  std::filesystem::path file = {};
  double duration_s = 0;
  int sample_rate_hz = 48000;
  std::optional<double> step_s = {};  // none: chosen by the program
  Vec3 gravity_m_s2{};
  double settle_s = 0;  // gravity grows from 0 in this time
  std::vector<SimulatedBody> bodies = {};
  std::vector<Striker> strikers = {};
  std::vector<Obstacle> obstacles = {};
  ContactSpec contact = {};
  std::vector<Blow> blows = {};
  Receivers receivers = {};
  SurfaceSound radiation = SurfaceSound::kirchhoff;
  bool visibility = false;
  double high_pass_hz = 20;
  double motion_hz = 60;  // frames per second of `motion`
  // Absolute, or a name in the folder of this process; empty: not written. record: energies and figures of the run, JSON.
  std::filesystem::path sound = {}, spectrogram = {}, surface = {}, motion = {}, record = {};
  Resources resources = {};
  std::vector<std::string> warnings = {};
};

/// An output of a simulation: key of the job, member of the spec, name in messages.
struct SimulationOutput {
  const char* key;
  std::filesystem::path SimulationSpec::*file;
  const char* name;
};
inline constexpr SimulationOutput kSimulationOutputs[] = {{"sound", &SimulationSpec::sound, "sound"},
                                                          {"spectrogram", &SimulationSpec::spectrogram, "spectrogram"},
                                                          {"surface", &SimulationSpec::surface, "recorded surface"},
                                                          {"motion", &SimulationSpec::motion, "motion"},
                                                          {"record", &SimulationSpec::record, "record"}};

/// Throws InputError "PLACE: ..." if the job has no output.
void check_has_output(const SimulationSpec& spec, const std::string& place);
/// The first output that would overwrite another, an input or the job; nullptr: none.
const SimulationOutput* find_overwriting_output(const SimulationSpec& spec);

/// True for a job of carillon-simulate: an object with the key "simulate".
bool is_simulation(std::string_view text);

/// Reads and validates. Throws InputError. Not collective.
SimulationSpec parse_simulation(std::string_view text, const std::filesystem::path& file);

/// Reference of the keys, for carillon-simulate --keys.
std::vector<base::KeyTable> describe_simulation_keys();

/// Rayleigh damping with the same loss at both frequencies, which replaces other damping laws in carillon-simulate.
Material make_rayleigh(const Material& material, double low_hz, double high_hz);

}  // namespace carillon::job
