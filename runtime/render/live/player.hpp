// Live playback of a scene: physics runs slightly ahead of the sound card.
#pragma once

#include <filesystem>
#include <string>

namespace carillon::live {

struct PlayerOptions {
  std::filesystem::path scene;
  std::string device;           // empty: the system's default
  bool null = false;            // no device; blocks are timed by the clock
  int frames = 256;             // per block
  double look_ahead_s = 0.1;    // lead of the physics over the sound
  double cpu_share = 0.0;       // share of a core available to the sound; 0: unlimited
  double gain_per_pa = 0.0;     // 0: the scene's gain_per_pa, or 1
  bool takes_commands = false;  // from standard input: carry_out() (commands.hpp)
  std::string osc;              // address of commands by OSC: OscPort (osc.hpp); empty: none
  bool quiet = false;
};

/// Plays a scene to its end on a device and prints figures. Throws InputError before any sound for an invalid scene, bank or device,
/// SolveError if the physics fails, SystemError without a sound card.
void play(const PlayerOptions& options);

}  // namespace carillon::live
