// A scene played while it happens: physics runs a little ahead of the sound card.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace carillon::live {

struct PlayerOptions {
  std::filesystem::path scene;
  std::string device;         // empty: the system's default
  bool null = false;          // no device: nothing is heard, and real time is the clock
  int frames = 256;           // of a block
  double look_ahead_s = 0.1;  // by which physics runs ahead of the sound
  double cpu_share = 0.0;     // of a core that the sound may take; 0: all that it needs
  double gain_per_pa = 0.0;   // 0: the scene's gain_per_pa, or 1
  bool quiet = false;
};

/// Plays a scene to its end on a device; prints what it did. Throws InputError before any sound for a bad scene, bank or device, SolveError
/// when the physics breaks down, SystemError when there is no sound card.
void play(const PlayerOptions& options);

}  // namespace carillon::live
