// Playback of the recorded surfaces of a scene.
#pragma once

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

/// Opens the recordings of a scene, each file once. Throws InputError naming scene, body, file and fault.
void read_surfaces(scene::Scene& scene);

/// Throws InputError naming the first recorded surface of the scene; `who` is the program that cannot play it.
void refuse_surfaces(const scene::Scene& scene, const char* who);

/// Playback of one recorded surface: receivers, conversions, estimated cost.
struct SurfacePlan {
  std::size_t receivers = 0;  // ears or microphones, including mirror images
  bool has_head = false, is_reflected = false, is_resampled = false;
  double sounding_s = 0.0;  // sounding time within the scene
  double cost_s = 0.0;      // estimated CPU time
};
/// The recording must be read.
SurfacePlan make_surface_plan(const scene::Scene& scene, const scene::SceneSurface& surface);
/// Text for the program's output, a few sentences.
std::string describe_surface(const scene::Scene& scene, const scene::SceneSurface& surface);

/// Measured figures of a surface.
struct SurfaceFigures {
  double peak_pa = 0.0;  // maximum over ears or microphones
  double seconds_cpu = 0.0;
};
base::Json make_surface_json(const scene::Scene& scene, const scene::SceneSurface& surface, const SurfaceFigures& figures);

/// Plays all recorded surfaces of a scene from its start. Invariant: sample n arrives at n / rate, independent of the block sizes; surfaces
/// do not affect each other. Allocates and reads files during playback.
class SurfacePlayback {
 public:
  /// The scene, with its recordings read, must outlive the result. `microphones` and `head` are the scene's.
  SurfacePlayback(const scene::Scene& scene, const scene::Microphones& microphones, const std::optional<synth::ListeningHead>& head,
                  int rate_hz);
  ~SurfacePlayback();

  /// Adds the next `count` samples [Pa] to out[c][0 .. count), one row per channel. Throws InputError for an implausible pressure.
  void add(std::span<float* const> out, std::size_t count);

  const std::vector<SurfaceFigures>& get_figures() const { return figures_; }

 private:
  class Voice;

  void fill();

  std::size_t channels_;
  std::vector<std::unique_ptr<Voice>> voices_;  // per surface
  std::vector<SurfaceFigures> figures_;
  std::vector<std::vector<float>> ready_;  // (channels): computed samples not yet added, from used_ on
  std::size_t used_ = 0, latency_left_ = 0;
};

}  // namespace carillon::render
