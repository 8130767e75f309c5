// A scene file: which bodies, where, who listens, how loud. Reference: docs/howto/scene-files.md.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/bank/corrected.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/physics/world.hpp"
#include "runtime/scene/effects/effect_selector.hpp"
#include "runtime/material/mallets.hpp"
#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/bank/mounting/losses.hpp"
#include "runtime/synth/effects.hpp"
#include "runtime/synth/floor.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/trajectory.hpp"

namespace carillon::recording {
class RecordedSurface;
}

namespace carillon::scene {

enum class SampleFormat { kPcm16, kPcm24, kPcm32, kFloat };
/// The names of --format and output.format, in the order of SampleFormat.
inline const std::vector<std::string> kSampleFormatNames{"pcm16", "pcm24", "pcm32", "float"};

/// The names of the key "frequencies", in the order of bank::Frequencies.
inline const std::vector<std::string> kFrequenciesNames{"corrected", "mesh"};

/// The names of the key "ears" of a listener, in the order of Ears.
enum class Ears { kFree, kHrtf };
inline const std::vector<std::string> kEarsNames{"free", "hrtf"};

/// The names of the key "kind" of a joint, in the order of joints::Kind.
inline const std::vector<std::string> kJointNames{"weld", "hinge", "slider", "universal", "ball"};

/// What carillon-render can play, and what it plays where effects are not planned.
inline constexpr synth::EffectSet kDefaultEffects = synth::kDefaultEffects;

/// What supports take of a body's modes; filled when the banks are read, empty without losses.
struct Mounting {
  std::string text;                                     // in words, T60 before and after
  std::size_t beyond = 0, mixed = 0;                    // as mounting::Losses has them
  std::vector<double> freq_hz;                          // (m) as the body is mounted
  std::vector<double> decay_before_per_s, decay_per_s;  // (m)
};

struct SceneBody {
  std::string name;
  std::string place;                                        // "file:line", for messages
  std::filesystem::path bank;                               // absolute; empty: `job` describes the body
  base::Object::Excerpt job{};                              // keys of a job, for `carillon bank-for`
  physics::BodySpec spec;                                   // spec.bank is filled when the banks are read
  effects::EffectOverrides overrides;              // its own key "effects", or the scene's
  mounting::MountingRequest support{};                       // its keys "on", "joint", "loss", "supports" and "held"
  std::string support_place;                                // "file:line" of the first of them, for messages
  Mounting mounting;                                        // what they, or the bank's own supports, take of its modes
  double sphere_radius_m = 0.0;                             // of its bank, when that is read: radiation::calc_sphere_radius_m()
  std::shared_ptr<const radiation::Transfers> transfers{};  // of its bank, when that is read and has multipoles
  radiation::Limited limited;                               // gains of its modes that its damping would not allow
  double variation = 0.0;                                   // its own key "variation", or the scene's: how much equal strikes differ, 0..1
};

/// A body of the scene that plays a recorded surface (docs/surface-format.md): it sounds and is not in the physics.
struct SceneSurface {
  std::string name;
  std::string place;           // "file:line", for messages
  std::filesystem::path file;  // absolute
  physics::Pose pose{};        // of the recording's world in the scene's
  double start_s = 0.0;        // when the recording begins
  bool loop = false;           // it begins again where it ends
  double gain = 1.0;           // of the pressure
  double high_pass_hz = 20.0;  // as in a simulation; 0: none
  /// The file, open, when that is read (read_surfaces()).
  std::shared_ptr<const recording::RecordedSurface> recording{};
};

/// F = K y^p of a felt that is pressed in by y.
struct Felt {
  double stiffness_n_m_p = 0.0;  // K
  double exponent = 2.5;         // p
};

/// The head of a mallet that flies freely into a body: a sphere of a solid, or a felt.
struct Mallet {
  double mass_kg = 0.0, speed_m_s = 0.0;
  double radius_m = 0.0, young_modulus_pa = 0.0, poisson_ratio = 0.3;  // without felt
  std::optional<Felt> felt{};
  double restitution = 1.0;         // that it has on something rigid: what is lost in the head
  double friction = 0.0;            // between head and body
  std::optional<Vec3> direction{};  // of its way, unit, in the frame of the body's mesh; nothing: straight into the surface
};

/// The head that a name stands for.
Mallet make_mallet(const material::NamedMallet& named);

/// A blow that the scene gives without physics. Point and impulse are in the frame of the body's mesh.
struct SceneStrike {
  std::string place;                     // "file:line", for messages
  std::size_t body = 0;                  // index into Scene::bodies
  double time_s = 0.0;                   // centre of the pulse; of a mallet: of the touch
  std::optional<Vec3> point_m;           // its nearest point of the surface is struck; or
  std::optional<std::int32_t> triangle;  // the middle of this triangle of the bank
  Vec3 impulse_n_s{};
  double duration_s = 0.0;         // of the pulse; 0 is an ideal impulse
  std::optional<Mallet> mallet{};  // in place of impulse and duration
};

struct SceneListener {
  Vec3 position_m{0.0, -1.5, 0.5};     // between the ears; at the beginning
  std::vector<synth::PathPoint> path;  // of the listener when it moves
  Vec3 facing{0.0, 1.0, 0.0};          // unit vector
  double ear_distance_m = 0.2;         // OCE01; with a head: the width of the sphere
  Ears ears = Ears::kFree;
  std::filesystem::path sofa;  // absolute; of a measured head; empty: a rigid sphere
};

struct Output {
  std::optional<double> gain_per_pa;  // full scale per pascal; nothing is "auto": the peak comes to peak_dbfs
  double peak_dbfs = -1.0;
  SampleFormat format = SampleFormat::kPcm24;
  bool fade_end = true;  // what still sounds at the end fades within its last 10 ms
};

/// The names of quality.instructions, in the order of synth::Isa.
inline const std::vector<std::string> kInstructionNames{"plain", "simd128", "sse2", "avx2", "avx512", "best"};

/// What accuracy is bought with; the initialisers are the defaults that docs/accuracy.md chose.
struct Quality {
  effects::SelectionThresholds thresholds{};
  std::optional<double> silence_pa{};   // below which a body sleeps; nothing: as the selector says
  std::optional<std::int64_t> modes{};  // of all bodies that may ring at once; nothing: all
  double contact_step_s = physics::WorldOptions{}.contact_step_s;
  double joint_tolerance = physics::WorldOptions{}.joint_tolerance;
  bool modes_in_impacts = true;  // impacts are solved with the modes of what rings
  bool masking = true;           // hits far below those that a body had just before are left out
  synth::Isa instructions = synth::Isa::kBest;
};

/// World frame: z up, metres, seconds.
struct Scene {
  std::filesystem::path file;
  double duration_s = 0.0;
  int sample_rate_hz = 48000;
  Vec3 gravity_m_s2{0.0, 0.0, -9.81};
  std::optional<physics::GroundSpec> ground;
  std::optional<double> reflection;    // of the ground, 0..1, for ground_reflection; nothing: it is silent
  std::vector<SceneBody> bodies;       // those that are modal
  std::vector<SceneSurface> surfaces;  // the others
  std::vector<physics::JointSpec> joints;
  std::vector<physics::CordSpec> cords;
  std::vector<SceneStrike> strikes;  // in the order of the file
  SceneListener listener;
  std::vector<Vec3> microphones_m;  // places in the world, a channel each, instead of the listener's ears
  radiation::GainKind radiation = radiation::GainKind::kAuto;
  bank::Frequencies frequencies = bank::Frequencies::kCorrected;  // of the banks, that are played
  effects::EffectOverrides overrides;                    // the key "effects"
  synth::EffectSet effects = kDefaultEffects;                     // of all bodies where they are not planned
  Output output;
  Quality quality;
  std::vector<std::string> warnings;  // of numbers that may be meant, a line each
};

/// Reads a scene file. Throws as parse_scene does, and for a file that cannot be read.
Scene read_scene(const std::filesystem::path& file);

/// Reads a scene. Banks are only named, not opened, and what describes a body in place of a bank is not looked at. Throws InputError
/// "file:line: ..." for anything that is not a scene.
Scene parse_scene(const base::Document& document);

/// The ground as sound meets it; nothing where it is silent.
std::optional<synth::Floor> find_floor(const Scene& scene);

/// Whether there is a head between the ears.
bool has_head(const Scene& scene);

/// Channels of the sound: microphones, or two ears.
std::size_t count_channels(const Scene& scene);

/// The places of the left and the right ear at the beginning: the line between them is level when the listener does not look straight up or
/// down.
std::array<Vec3, 2> calc_ears(const SceneListener& listener);

}  // namespace carillon::scene
