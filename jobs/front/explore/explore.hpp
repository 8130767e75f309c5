// carillon explore: a folder that any web server can serve, a page on which bodies are struck and heard.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::explore {

enum class Up { kZ, kY };

struct PageOrder {
  std::vector<std::filesystem::path> subjects = {};  // banks, side by side; or one scene
  std::filesystem::path folder;                      // made, or made again; empty: NAME-explore here
  std::string title = {};                            // of the page; empty: the name of the subject
  Up up = Up::kZ;                                    // axis of the meshes of banks that points up
  bool keeps_banks = false;                          // banks as they are, however large
};

/// A bank as the folder has it.
struct PageBank {
  std::string name;                          // of the file in the folder
  std::uintmax_t bytes = 0, full_bytes = 0;  // of the file, and of the one that was given
  std::string change;                        // what was done to it; empty: nothing
};

struct Explored {
  std::filesystem::path folder;
  std::vector<PageBank> banks;
  std::uintmax_t bytes = 0;  // of all files
  bool has_recording = false;
  double duration_s = 0.0;            // of the recording
  std::vector<std::string> warnings;  // of carillon-render, a line each
};

/// Makes the folder: page, sound engine, banks, scene and, for a scene with motion or strikes, the contacts of its simulation by
/// carillon-render. It appears whole or not at all, in place of an earlier one of this program. Throws InputError for subjects that
/// cannot be played and for a folder that holds something else, SystemError when page or engine are not installed or the disk refuses.
Explored explore(const PageOrder& order);

/// Whether page and sound engine are installed with this program; otherwise other commands omit the page.
bool is_installed();

/// Whether explore() made this folder.
bool is_explorer(const std::filesystem::path& folder);

}  // namespace carillon::explore
