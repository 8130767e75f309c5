// What the targets share that play: a folder with a bank, and one run of carillon-render in this process.
#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/host/program.hpp"
#include "tests/synth/cube_bank.hpp"

namespace carillon::fuzz {

/// A folder of this process, gone with it.
class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "carillon-fuzz-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) std::abort();
    path_ = name;
    testing_bank_to("cube.h5");
  }
  ~Folder() {
    std::error_code none;
    std::filesystem::remove_all(path_, none);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  std::filesystem::path write(const std::string& name, std::string_view bytes) const {
    std::ofstream(path_ / name, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return path_ / name;
  }

 private:
  void testing_bank_to(const std::string& name) const {
    bank::write_bank(testing::make_cube_bank({{820.0, 12.0, 0.3, {0.4, 0.7, 1.1}, 0.07}, {1730.0, 12.0, 0.3, {0.4, 0.7, 1.1}, 0.07}}),
                     path_ / name);
  }
  std::filesystem::path path_;
};

inline const Folder& get_folder() {
  static const Folder folder;
  return folder;
}

inline std::string_view to_text(const std::uint8_t* data, std::size_t size) { return {reinterpret_cast<const char*>(data), size}; }

/// How far an input came, for the tally of tests/fuzz/mutants.py.
inline void tell(const char* what) { std::fprintf(stderr, "mutant: %s\n", what); }

/// Renders with every output there is; the WAV has to be whole. False: refused.
inline bool play(host::ProgramOptions options) {
  const Folder& folder = get_folder();
  options.wav = folder / "out.wav";
  options.report = folder / "out.json";
  options.quiet = true;
  try {
    host::run(options);
  } catch (const InputError&) {
    tell("refused");
    return false;
  } catch (const SolveError&) {
    tell("not solved");
    return false;
  }
  tell("played");
  return true;
}

}  // namespace carillon::fuzz
