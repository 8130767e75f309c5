// carillon explore: a folder with a web page on which bodies are struck and heard.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::explore {

enum class Up { kZ, kY };

struct PageOrder {
  std::vector<std::filesystem::path> subjects = {};  // banks, side by side; or one scene
  std::filesystem::path folder;                      // created or replaced; empty: NAME-explore
  std::string title = {};                            // of the page; empty: the name of the subject
  Up up = Up::kZ;                                    // axis of the meshes of banks that points up
  bool keeps_banks = false;                          // do not pack large banks
};

/// A bank in the folder.
struct PageBank {
  std::string name;                          // of the file in the folder
  std::uintmax_t bytes = 0, full_bytes = 0;  // of the file, and of the original
  std::filesystem::path original = {};       // that it was made from
  std::string change;                        // description of the packing; empty: unchanged
};

struct Explored {
  std::filesystem::path folder;
  std::vector<PageBank> banks;
  std::uintmax_t bytes = 0;  // of all files
  bool has_recording = false;
  double duration_s = 0.0;            // of the recording
  std::vector<std::string> warnings;  // of carillon-render, a line each
};

/// Writes the folder: page, sound engine, banks, scene and, for a scene with motion or strikes, the contacts simulated by carillon-render.
/// Atomic; replaces only folders of this program. InputError for subjects that cannot be played and for a folder with other content,
/// SystemError if page or engine are not installed or the disk refuses.
Explored explore(const PageOrder& order);

/// True if page and sound engine are installed; other commands omit the page otherwise.
bool is_installed();

/// True for a folder written by explore().
bool is_explorer(const std::filesystem::path& folder);

}  // namespace carillon::explore
