// The program carillon-render: scene in, sound out.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace carillon::render {

struct ProgramOptions {
  std::filesystem::path scene;
  std::filesystem::path wav;  // "-" is standard output
  std::optional<std::filesystem::path> spectrogram, trajectory, report;
  std::optional<std::filesystem::path> contacts;  // played instead of the scene's physics and strikes
  std::optional<std::filesystem::path> record;
  std::optional<int> rate_hz;         // instead of the scene's
  std::optional<std::string> format;  // instead of the scene's
  bool audit = false;                 // books of energy
  bool plan = false;                  // say which effects are called for and why, instead of everything else
  bool quiet = false;                 // print nothing but warnings
};

/// Reads everything, simulates, renders, writes everything; prints what it does on stdout (on stderr where the sound goes to stdout),
/// progress and warnings on stderr. Files appear whole or not at all, and all together. Memory does not grow with the length of the scene.
/// Throws InputError before any work when an input is bad or an output cannot be written.
void run(const ProgramOptions& options);

}  // namespace carillon::render
