// carillon-render: a scene file to a sound file.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <new>
#include <string>
#include <vector>

#include "runtime/base/error.hpp"
#include "runtime/base/file_limit.hpp"
#include "runtime/base/message.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/version.hpp"
#include "runtime/base/whole_range.hpp"
#include "runtime/render/batch.hpp"
#include "runtime/render/gltf_input.hpp"
#include "runtime/render/program.hpp"
#include "runtime/scene/scene.hpp"

namespace {

int fail(int code, const char* message) {
  fmt::print(stderr, "carillon-render: {}\n", carillon::base::show_message(message));
  return code;
}

/// Runs `work`, which returns an exit code; errors become a message and theirs.
template <class Work>
int guard(Work&& work) {
  try {
    return work();
  } catch (const carillon::InputError& error) {
    return fail(carillon::kExitInput, error.what());
  } catch (const carillon::SolveError& error) {
    return fail(carillon::kExitSolve, error.what());
  } catch (const std::bad_alloc&) {
    return fail(carillon::kExitSystem, "not enough memory; use smaller banks or fewer microphones");
  } catch (const std::exception& error) {
    return fail(carillon::kExitSystem, error.what());
  }
}

int try_run(const carillon::render::ProgramOptions& options) {
  return guard([&] {
    carillon::render::ProgramOptions own = options;
    const auto folder = carillon::render::convert_gltf(own);
    carillon::render::run(own);
    return 0;
  });
}

std::string describe_keys() {
  std::vector<carillon::base::KeyTable> tables = carillon::scene::describe_scene_keys();
  tables.push_back(carillon::render::describe_manifest_keys());
  return carillon::base::write_key_tables(tables);
}

}  // namespace

int main(int argc, char** argv) {
  carillon::base::report_file_limit();
  carillon::render::ProgramOptions options;
  CLI::App app("Simulates a scene of falling bodies and renders what two ears or microphones hear.", "carillon-render");
  app.failure_message([](const CLI::App* asked, const CLI::Error& error) {
    return carillon::base::printable_lines(CLI::FailureMessage::simple(asked, error));
  });
  int jobs = 0;
  app.add_option("scene", options.scene, "Scene file (JSON, or glTF with KHR_audio_rigid_bodies); with --jobs a manifest of scenes")
      ->required()
      ->option_text("SCENE");
  auto* output =
      app.add_option("-o,--output", options.sound,
                     "Sound to write: .wav, .flac, .opus or .ogg; a channel for each ear or microphone; - is WAV to standard output; "
                     "required without --plan")
          ->option_text("OUT.wav");
  app.add_option("--spectrogram", options.spectrogram, "Picture of the sound: level over time and frequency")->option_text("OUT.png");
  app.add_option("--trajectory", options.trajectory, "Paths of the bodies and their contacts")->option_text("OUT.json");
  app.add_option("--report", options.report, "Figures of the run: counts, seconds, level, gain")->option_text("OUT.json");
  app.add_option("--contacts", options.contacts, "Contacts file to play instead of the scene's physics and strikes")
      ->option_text("IN.jsonl");
  app.add_option("--record", options.record, "Contacts file to write: all events, for replay")->option_text("OUT.jsonl");
  app.add_option("--labels", options.labels, "Labels for learning: contacts, hits, poses and modal energies on the clock of the WAV")
      ->option_text("OUT.npz|OUT.jsonl");
  app.add_option("--rate", options.rate_hz, "Sample rate instead of the scene's, 8000 to 192000")
      ->check(carillon::base::whole_range(8000, 192000), carillon::base::describe_whole_range(8000, 192000))
      ->option_text("HZ");
  app.add_option("--format", options.format, "pcm16, pcm24 (default), pcm32 or float, instead of the scene's")
      ->check(CLI::IsMember(carillon::scene::kSampleFormatNames))
      ->option_text("FORMAT");
  auto* batch = app.add_option("--jobs", jobs, "Render the scenes of a manifest, so many at once; one that fails stops no other")
                    ->check(carillon::base::whole_range(1, 1024), carillon::base::describe_whole_range(1, 1024))
                    ->option_text("N");
  app.add_option_function<std::string>(
         "--scale-frequencies", [&options](const std::string& word) { options.scales_frequencies = word == "yes"; },
         "Of a glTF scene: whether the scale of nodes divides the frequencies of their models; default: by the masses")
      ->check(CLI::IsMember({"yes", "no"}));
  app.add_flag("--audit", options.audit,
               "Audit energy (motion, modes, losses, radiation, balance error) and contacts (penetration depth, hit rate)");
  app.add_flag("--plan", options.plan,
               "Print the effects of each body with reasons, and the estimated cost of recordings; no sound is made");
  app.add_flag("-q,--quiet", options.quiet, "Print warnings and errors only");
  app.add_flag_callback(
      "--keys", [] { throw CLI::CallForVersion(describe_keys(), 0); },
      "Print the keys of scene files and manifests with defaults, ranges and meaning");
  app.set_version_flag("--version", carillon::base::describe("carillon-render"));
  try {
    app.parse(argc, argv);
    if (!options.plan && jobs == 0 && output->empty()) throw CLI::RequiredError("--output");
    for (const CLI::Option* option : app.get_options())
      if (jobs > 0 && option != batch && option->get_name() != "scene" && option->count() > 0)
        throw CLI::ExcludesError("--jobs", option->get_name());
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : carillon::kExitInput;
  }
  return guard([&] {
    if (jobs == 0) return try_run(options);
    return carillon::render::run_batch(carillon::render::read_manifest(options.scene), jobs, [](const auto& run) { return try_run(run); });
  });
}
