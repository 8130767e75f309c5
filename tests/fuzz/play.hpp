// Shared by the targets that play: a folder with a bank, and a run of carillon-render in this process.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/render/program.hpp"
#include "tests/support/folder.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::fuzz {

/// Folder of this process with a bank in it.
class Folder : public tests::Folder {
 public:
  Folder() {
    bank::write_bank(testing::make_cube_bank({{820.0, 12.0, 0.3, {0.4, 0.7, 1.1}, 0.07}, {1730.0, 12.0, 0.3, {0.4, 0.7, 1.1}, 0.07}}),
                     *this / "cube.h5");
  }
};

inline const Folder& get_folder() {
  static const Folder folder;
  return folder;
}

inline std::string_view to_text(const std::uint8_t* data, std::size_t size) { return {reinterpret_cast<const char*>(data), size}; }

/// Reports how far an input came, for the tally of tests/fuzz/mutants.py.
inline void report(const char* what) { std::fprintf(stderr, "mutant: %s\n", what); }

/// Renders with all outputs; the WAV must be complete. False: rejected.
inline bool play(render::ProgramOptions options) {
  const Folder& folder = get_folder();
  options.sound = folder / "out.wav";
  options.report = folder / "out.json";
  options.quiet = true;
  try {
    render::run(options);
  } catch (const InputError&) {
    report("refused");
    return false;
  } catch (const SolveError&) {
    report("not solved");
    return false;
  }
  report("played");
  return true;
}

}  // namespace carillon::fuzz
