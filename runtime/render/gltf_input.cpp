#include "runtime/render/gltf_input.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <system_error>

#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/standard_output.hpp"
#include "runtime/exchange/gltf_scene.hpp"

namespace carillon::render {

std::unique_ptr<base::TemporaryFolder> convert_gltf(ProgramOptions& options) {
  if (!exchange::is_gltf(options.scene)) return nullptr;
  for (const auto& out :
       {std::optional(options.sound), options.spectrogram, options.trajectory, options.report, options.record, options.labels}) {
    std::error_code error;
    if (out && std::filesystem::equivalent(*out, options.scene, error))
      throw InputError(fmt::format("{}: this would overwrite the scene; name another file", out->string()));
  }
  auto folder = std::make_unique<base::TemporaryFolder>("carillon-");
  const exchange::GltfScene made =
      exchange::write_gltf_scene(options.scene, {.scales_frequencies = options.scales_frequencies}, folder->path());
  for (const std::string& warning : made.warnings)
    fmt::print(stderr, "warning: {}: {}\n", base::printable(options.scene.string()), warning);
  std::FILE* const notes = base::is_standard_output(options.sound) ? stderr : stdout;
  if (!options.quiet)
    for (const std::string& reading : made.readings) fmt::print(notes, "{}\n", reading);
  options.scene = folder->path() / exchange::kSceneFile;
  return folder;
}

}  // namespace carillon::render
