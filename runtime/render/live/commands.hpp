// Commands that move the bodies of a running scene.
#pragma once

#include <cstddef>
#include <functional>
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
  std::vector<std::string> names;                                   // of the bodies, in order
  std::function<std::string(const std::string& description)> make;  // Stage::add_body(): returns the name
};

/// Words of a line; a word in double quotes may have spaces, and one that begins with { is the rest of the line. None if it begins with #.
/// Throws InputError for quotes that are not closed.
std::vector<std::string> split(std::string_view line);

/// Carries out one command: a word, the name of a body, and numbers; points in metres, in the world. Or "add" and the JSON of a new body.
/// Returns a line of text to print, or none. Without words it does nothing. Throws InputError, without effect, for invalid commands.
std::string carry_out(const std::vector<std::string>& words, Hands& hands);

/// Lines that have arrived at a file descriptor, without waiting for more.
class LineReader {
 public:
  explicit LineReader(int descriptor) : descriptor_(descriptor) {}
  /// The complete lines since the last call, of at most 4 KiB of input: a flood does not keep its caller from other work. At the end of
  /// the input also the last one without an end. Lines of more than 100,000 characters are cut.
  std::vector<std::string> read();

 private:
  int descriptor_;
  bool is_open_ = true;
  std::string begun_;
};

}  // namespace carillon::live
