// The recorded surfaces of a scene, heard.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "runtime/base/json.hpp"
#include "runtime/scene/microphones.hpp"
#include "runtime/scene/scene.hpp"
#include "runtime/synth/listener.hpp"

namespace carillon::render {

/// Opens the recordings that a scene names, each file once. Throws InputError, which names scene, body, file and fault.
void read_surfaces(scene::Scene& scene);

/// Throws InputError, which names the first of them, when a scene has recorded surfaces: of what `who` cannot play.
void refuse_surfaces(const scene::Scene& scene, const char* who);

/// How a recorded surface is heard, and why: by what, how often, with what price.
struct SurfacePlan {
  std::size_t receivers = 0;  // ears or microphones, mirrored ones too
  bool has_head = false, is_reflected = false, is_resampled = false;
  double sounding_s = 0.0;  // of it in the scene
  double cost_s = 0.0;      // CPU time, about
};
/// Its recording is read.
SurfacePlan make_surface_plan(const scene::Scene& scene, const scene::SceneSurface& surface);
/// In words, for the output of the program: a few sentences.
std::string describe_surface(const scene::Scene& scene, const scene::SceneSurface& surface);

/// What was measured of a surface.
struct SurfaceFigures {
  double peak_pa = 0.0;  // at any ear or microphone
  double seconds_cpu = 0.0;
};
base::Json make_surface_json(const scene::Scene& scene, const scene::SceneSurface& surface, const SurfaceFigures& figures);

/// Plays all recorded surfaces of a scene, from its beginning on. Invariant: sample n is what arrives at n / rate, however calls
/// divide time; surfaces do not change each other's sound. Takes memory and reads files while it plays.
class SurfacePlayback {
 public:
  /// The scene, whose recordings are read, must outlive it. `microphones` and `head` are those of the scene.
  SurfacePlayback(const scene::Scene& scene, const scene::Microphones& microphones, const std::optional<synth::ListeningHead>& head, int rate_hz);
  ~SurfacePlayback();

  /// Adds the next `count` samples [Pa] to out[c][0 .. count), a channel each. Throws InputError when a surface makes a sound that cannot
  /// be.
  void add(std::span<float* const> out, std::size_t count);

  const std::vector<SurfaceFigures>& get_figures() const { return figures_; }

 private:
  class Voice;

  void fill();

  std::size_t channels_;
  std::vector<std::unique_ptr<Voice>> voices_;  // per surface
  std::vector<SurfaceFigures> figures_;
  std::vector<std::vector<float>> ready_;  // (channels): what is made and not yet added, from used_ on
  std::size_t used_ = 0, latency_left_ = 0;
};

}  // namespace carillon::render
