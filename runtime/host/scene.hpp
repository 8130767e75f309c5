// A scene file: which bodies, where, who listens, how loud. Reference: docs/howto/scene-files.md.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/config/document.hpp"
#include "runtime/contact/world.hpp"

namespace carillon::host {

using Vec3 = std::array<double, 3>;

inline constexpr double kMostSamples = 2e8;  // duration times rate; about 3 GB of intermediate results

enum class SampleFormat { kPcm16, kPcm24, kFloat };
/// The names of --format and output.format, in the order of SampleFormat.
inline const std::vector<std::string> kSampleFormatNames{"pcm16", "pcm24", "float"};

struct SceneBody {
  std::string name;
  std::filesystem::path bank;  // absolute
  contact::BodySpec spec;      // spec.bank is filled when the banks are read
};

struct Listener {
  Vec3 position_m{0.0, -1.5, 0.5};  // between the ears
  Vec3 facing{0.0, 1.0, 0.0};       // unit vector
  double ear_distance_m = 0.2;      // OCE01
};

struct Output {
  std::optional<double> gain_per_pa;  // full scale per pascal; nothing is "auto": the peak comes to peak_dbfs
  double peak_dbfs = -1.0;
  SampleFormat format = SampleFormat::kPcm24;
};

/// World frame: z up, metres, seconds.
struct Scene {
  std::filesystem::path file;
  double duration_s = 0.0;
  int sample_rate_hz = 48000;
  Vec3 gravity_m_s2{0.0, 0.0, -9.81};
  std::optional<contact::GroundSpec> ground;
  std::vector<SceneBody> bodies;
  Listener listener;
  Output output;
};

/// Reads a scene. Banks are only named, not opened. Throws InputError "file:line: ..." for anything that is not a scene.
Scene parse_scene(const config::Document& document);

/// The places of the left and the right ear: the line between them is level when the listener does not look straight up or down.
std::array<Vec3, 2> calc_ears(const Listener& listener);

}  // namespace carillon::host
