// A scene file: bodies, joints, strikes, listener, output. Reference: docs/howto/scene-files.md.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/bank/mounting/losses.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/keys.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/material/mallets.hpp"
#include "runtime/physics/world.hpp"
#include "runtime/scene/effects/effect_selector.hpp"
#include "runtime/synth/ambisonics.hpp"
#include "runtime/synth/effects.hpp"
#include "runtime/synth/floor.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/sensor.hpp"
#include "runtime/synth/trajectory.hpp"

namespace carillon::recording {
class RecordedSurface;
}

namespace carillon::scene {

enum class SampleFormat { kPcm16, kPcm24, kPcm32, kFloat };
/// Names of --format and output.format, in the order of SampleFormat.
inline const std::vector<std::string> kSampleFormatNames{"pcm16", "pcm24", "pcm32", "float"};

/// Names of the key "frequencies", in the order of bank::Frequencies.
inline const std::vector<std::string> kFrequenciesNames{"corrected", "mesh"};

/// Names of the key "ears" of a listener, in the order of Ears.
enum class Ears { kFree, kHrtf, kAmbisonic };
inline const std::vector<std::string> kEarsNames{"free", "hrtf", "ambisonic"};

/// Names of the key "kind" of a joint, in the order of joints::Kind.
inline const std::vector<std::string> kJointNames{"weld", "hinge", "slider", "universal", "ball"};

/// Default effects without planning.
inline constexpr synth::EffectSet kDefaultEffects = synth::kDefaultEffects;

/// Effect of supports on a body's modes; filled when the banks are read, empty without losses.
struct Mounting {
  std::string text;                                     // summary, T60 before and after
  std::size_t beyond = 0, mixed = 0;                    // as in mounting::Losses
  std::vector<double> freq_hz;                          // (m) with supports
  std::vector<double> decay_before_per_s, decay_per_s;  // (m)
};

struct SceneBody {
  std::string name;
  std::string place;                                        // "file:line", for messages
  std::filesystem::path bank;                               // absolute; empty: `job` describes the body
  base::Object::Excerpt job{};                              // keys of a job, for `carillon bank-for`
  physics::BodySpec spec;                                   // spec.bank is filled when the banks are read
  effects::EffectOverrides overrides;                       // the body's key "effects", or the scene's
  mounting::MountingRequest support{};                      // keys "on", "joint", "loss", "supports" and "held"
  std::string support_place;                                // "file:line" of the first of them, for messages
  Mounting mounting;                                        // losses by these or the bank's supports
  double sphere_radius_m = 0.0;                             // radiation::calc_sphere_radius_m() of the bank, once read
  std::shared_ptr<const radiation::Transfers> transfers{};  // of the bank, once read, if it has multipoles
  radiation::Limited limited;                               // radiation gains limited by damping
  double variation = 0.0;                                   // variation of equal strikes, 0..1
  double gain = 1.0;                                        // factor of the pressure
};

/// A body that plays a recorded surface (docs/surface-format.md), outside the physics.
struct SceneSurface {
  std::string name;
  std::string place;           // "file:line", for messages
  std::filesystem::path file;  // absolute
  physics::Pose pose{};        // of the recording's world in the scene
  double start_s = 0.0;        // start of the recording
  bool loop = false;           // repeats
  double gain = 1.0;           // factor of the pressure
  double high_pass_hz = 20.0;  // as in a simulation; 0: none
  /// The open file, set by read_surfaces().
  std::shared_ptr<const recording::RecordedSurface> recording{};
};

/// Felt with F = K y^p at compression y.
struct Felt {
  double stiffness_n_m_p = 0.0;  // K
  double exponent = 2.5;         // p
};

/// Head of a mallet in free flight: an elastic sphere, or a felt.
struct Mallet {
  double mass_kg = 0.0, speed_m_s = 0.0;
  double radius_m = 0.0, young_modulus_pa = 0.0, poisson_ratio = 0.3;  // without felt
  std::optional<Felt> felt{};
  double restitution = 1.0;         // on a rigid surface: loss in the head
  double friction = 0.0;            // between head and body
  std::optional<Vec3> direction{};  // of flight, unit, in the frame of the mesh; empty: along the surface normal
};

/// The head of a named mallet.
Mallet make_mallet(const material::NamedMallet& named);

/// A blow given in the scene. Point and impulse are in the frame of the body's mesh.
struct SceneStrike {
  std::string place = {};                     // "file:line", for messages
  std::size_t body = 0;                       // index into Scene::bodies
  double time_s = 0.0;                        // centre of the pulse; mallet: first contact
  std::optional<Vec3> point_m = {};           // moved to the nearest point of the surface; or
  std::optional<std::int32_t> triangle = {};  // centre of this triangle of the bank
  Vec3 impulse_n_s{};
  double duration_s = 0.0;         // of the pulse; 0: ideal impulse
  std::optional<Mallet> mallet{};  // replaces impulse and duration
};

/// A sensor on a modal body. Point and direction are in the frame of the body's mesh.
struct SceneSensor {
  std::string name;
  std::string place;                          // "file:line", for messages
  std::size_t body = 0;                       // index into Scene::bodies
  std::optional<Vec3> point_m{};              // moved to the nearest point of the surface; or
  std::optional<std::int32_t> triangle = {};  // centre of this triangle of the bank
  Vec3 direction{0.0, 0.0, 1.0};              // unit
  synth::Quantity quantity = synth::Quantity::kAcceleration;
};

struct SceneListener {
  Vec3 position_m{0.0, -1.5, 0.5};     // between the ears, at the start
  std::vector<synth::PathPoint> path;  // of a moving listener
  Vec3 facing{0.0, 1.0, 0.0};          // unit vector
  double ear_distance_m = 0.2;         // OCE01; with a head: its width
  Ears ears = Ears::kFree;
  int order = 1;               // of Ambisonics
  std::filesystem::path sofa;  // absolute, file of a measured head; empty: rigid sphere
};

struct Output {
  std::optional<double> gain_per_pa;  // full scale per pascal; empty: the peak is at peak_dbfs
  double peak_dbfs = -1.0;
  SampleFormat format = SampleFormat::kPcm24;
  bool fade_end = true;  // fades within the last 10 ms if not silent
};

/// Names of quality.instructions.
inline const std::vector<std::string> kInstructionNames(base::kInstructionNames.begin(), base::kInstructionNames.end());

/// Accuracy against CPU time; the defaults are chosen in docs/accuracy.md.
struct Quality {
  effects::SelectionThresholds thresholds{};
  std::optional<double> silence_pa{};   // sleep threshold of bodies; empty: chosen by the selector
  std::optional<std::int64_t> modes{};  // maximum number of ringing modes; empty: all
  double contact_step_s = physics::WorldOptions{}.contact_step_s;
  double joint_tolerance = physics::WorldOptions{}.joint_tolerance;
  bool modes_in_impacts = true;  // solve impacts together with the modes
  bool masking = true;           // omit hits masked by earlier ones of the body
  synth::Isa instructions = synth::Isa::kBest;
};

/// World frame: z up, metres, seconds.
struct Scene {
  std::filesystem::path file;
  double duration_s = 0.0;
  int sample_rate_hz = 48000;
  Vec3 gravity_m_s2{0.0, 0.0, -9.81};
  std::optional<physics::GroundSpec> ground;
  std::optional<double> reflection;    // of the ground, 0..1, for ground_reflection; empty: none
  std::vector<SceneBody> bodies;       // modal bodies
  std::vector<SceneSurface> surfaces;  // recorded ones
  std::vector<physics::JointSpec> joints;
  std::vector<physics::CordSpec> cords;
  std::vector<SceneStrike> strikes;  // in the order of the file
  std::vector<SceneSensor> sensors;
  std::optional<int> sensor_rate_hz;  // empty: sample_rate_hz
  SceneListener listener;
  std::vector<Vec3> microphones_m;  // replace the listener's ears, one per channel
  radiation::GainKind radiation = radiation::GainKind::kAuto;
  bank::Frequencies frequencies = bank::Frequencies::kCorrected;  // played frequencies of the banks
  double variation = 0.0;                                         // of bodies without their own
  effects::EffectOverrides overrides;                             // the key "effects"
  synth::EffectSet effects = kDefaultEffects;                     // without planning
  Output output;
  Quality quality;
  std::vector<std::string> warnings;  // implausible values, a line each
};

/// Reads a scene file. Throws InputError like parse_scene, and for an unreadable file.
Scene read_scene(const std::filesystem::path& file);

/// Reads a scene. Banks are not opened, and descriptions of bodies without a bank are not checked. Throws InputError "file:line: ..." for
/// an invalid scene.
Scene parse_scene(const base::Document& document);

/// Reference of the keys, for carillon-render --keys.
std::vector<base::KeyTable> describe_scene_keys();

/// A sensor on the bank of its body. Throws InputError "file:line: ..." for a place that is not there.
synth::SensorSettings locate_sensor(const Scene& scene, const SceneSensor& sensor, const bank::Bank& bank);

/// Reflecting ground; empty if it does not reflect.
std::optional<synth::Floor> find_floor(const Scene& scene);

/// True if the listener has a head, or hears Ambisonics: the sound depends on the direction from which it comes.
bool has_head(const Scene& scene);
bool has_ambisonics(const Scene& scene);

/// Channels of the sound: microphones, two ears, or those of Ambisonics.
std::size_t count_channels(const Scene& scene);

/// Initial positions of the left and right ear, on a horizontal line unless the listener looks straight up or down.
std::array<Vec3, 2> calc_ears(const SceneListener& listener);

}  // namespace carillon::scene
