// Commands that move the bodies of a running scene.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/physics/world.hpp"

namespace carillon::live {

/// One line for each command, for help texts.
extern const char* const kCommandText;

/// Bodies of a running world by their names.
struct Hands {
  physics::World* world = nullptr;
  std::vector<std::string> names;  // of the bodies, in order
};

/// Carries out one command: a word, the name of a body (in double quotes if it has spaces), and numbers; points in metres, in the world.
/// Returns a line of text to print, or none. An empty line, and one that begins with #, does nothing. Throws InputError, and changes
/// nothing, for a line that cannot be used.
std::string carry_out(std::string_view line, const Hands& hands);

/// Lines that have arrived at a file descriptor, without waiting for more.
class LineReader {
 public:
  explicit LineReader(int descriptor) : descriptor_(descriptor) {}
  /// The complete lines since the last call; at the end of the input also the last one without an end. Lines of more than 1,000 characters
  /// are cut.
  std::vector<std::string> read();

 private:
  int descriptor_;
  bool is_open_ = true;
  std::string begun_;
};

}  // namespace carillon::live
