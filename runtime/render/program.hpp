// The program carillon-render: scene in, sound out.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace carillon::render {

struct ProgramOptions {
  std::filesystem::path scene;
  std::filesystem::path sound;  // codec by its extension; "-": WAV to standard output
  std::optional<std::filesystem::path> spectrogram, trajectory, report;
  std::optional<std::filesystem::path> contacts;  // replaces the scene's physics and strikes
  std::optional<std::filesystem::path> record;
  std::optional<std::filesystem::path> labels;  // .npz or .jsonl
  std::optional<int> rate_hz;                   // overrides the scene's
  std::optional<std::string> format;            // overrides the scene's
  std::optional<bool> scales_frequencies;       // of scaled nodes of a glTF scene; empty: by the masses
  bool audit = false;                           // energy balance
  bool plan = false;                            // print the planned effects with reasons; no sound
  bool quiet = false;                           // print warnings only
};

/// "NAME.sensors.wav" next to the file of the sound.
std::filesystem::path find_sensor_file(const std::filesystem::path& sound);

/// Reads all inputs, simulates, renders and writes all outputs. Notes go to stdout (stderr if the sound goes to stdout), progress and
/// warnings to stderr. Outputs appear together and complete, or not at all. Memory does not grow with the length of the scene, but for
/// labels. Throws InputError before any work for an invalid input or an unwritable output.
void run(const ProgramOptions& options);

}  // namespace carillon::render
