// Source: PNG Specification 5.2 (signature), 11.2.5 (IEND).
#include "jobs/front/report/draw.hpp"

#include <fmt/format.h>

#include <array>
#include <fstream>
#include <optional>

#include "runtime/base/command.hpp"
#include "runtime/base/result.hpp"
#include "runtime/base/temporary.hpp"

namespace carillon::report {
namespace {

namespace fs = std::filesystem;

bool is_whole_png(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::array<char, 8> first{}, last{};
  in.read(first.data(), 8);
  in.seekg(-8, std::ios::end);
  in.read(last.data(), 8);
  return in && std::memcmp(first.data(), "\x89PNG\r\n\x1a\n", 8) == 0 && std::memcmp(last.data(), "IEND\xae\x42\x60\x82", 8) == 0;
}

/// Why it failed; empty: success.
std::string run(const fs::path& program, const fs::path& bank, int modes, const fs::path& picture, double limit_s) {
  std::string numbers = "1";
  for (int mode = 2; mode <= modes; ++mode) numbers += fmt::format(",{}", mode);
  const fs::path file = picture.parent_path() / "result.json";
  base::Finished finished;
  try {
    finished = base::run({.words = {program, "modes", bank, "-o", picture, "--modes", numbers, "--result", file}, .default_signals = true},
                         {.patience_s = limit_s});
  } catch (const SystemError& error) {
    return error.what();
  }
  if (finished.was_slow) return fmt::format("carillon-draw took longer than {:g} s and was ended", limit_s);
  if (finished.signal != 0) return fmt::format("carillon-draw was ended by signal {}", finished.signal);
  if (finished.exit_code == 0) return {};
  const std::optional<base::Result> result = base::read_result(file);
  if (!result || result->message.empty()) return fmt::format("carillon-draw failed with exit code {}", finished.exit_code);
  return fmt::format("carillon-draw: {}", result->message);
}

}  // namespace

Drawing draw_modes(const fs::path& given, const fs::path& bank, int modes, const fs::path& picture, double limit_s) {
  std::error_code error;
  fs::remove(picture, error);
  const std::optional<fs::path> program = given.empty() ? base::find_program("carillon-draw") : std::optional(fs::absolute(given, error));
  if (!program || !base::is_program(*program)) return {"carillon-draw is not installed here"};
  // In a temporary folder, removed with all files of the program.
  std::optional<base::TemporaryFolder> place;
  try {
    place.emplace(fs::absolute(picture, error).parent_path(), ".drawing-");
  } catch (const SystemError& failure) {
    return {fmt::format("no temporary folder: {}", failure.what())};
  }
  const fs::path drawn = place->path() / picture.filename();
  Drawing drawing{run(*program, fs::absolute(bank, error), modes, drawn, limit_s)};
  if (drawing.fault.empty() && !is_whole_png(drawn)) drawing.fault = "carillon-draw left no picture";
  if (drawing.fault.empty()) {
    fs::rename(drawn, picture, error);
    if (error) drawing.fault = fmt::format("the picture cannot be kept: {}", error.message());
  }
  return drawing;
}

}  // namespace carillon::report
