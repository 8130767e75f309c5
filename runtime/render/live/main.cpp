// carillon-live: plays a scene file on a sound card.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "runtime/base/error.hpp"
#include "runtime/base/file_limit.hpp"
#include "runtime/base/message.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/version.hpp"
#include "runtime/base/whole_range.hpp"
#include "runtime/render/live/commands.hpp"
#include "runtime/render/live/device.hpp"
#include "runtime/render/live/player.hpp"

namespace {

int fail(int code, const char* message) {
  fmt::print(stderr, "carillon-live: {}\n", carillon::base::show_message(message));
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  carillon::base::report_file_limit();
  carillon::live::PlayerOptions options;
  bool lists = false;
  CLI::App app("Simulates and plays a scene in real time.", "carillon-live");
  app.failure_message([](const CLI::App* asked, const CLI::Error& error) {
    return carillon::base::printable_lines(CLI::FailureMessage::simple(asked, error));
  });
  auto* scene = app.add_option("scene", options.scene, "Scene file (JSON)")->option_text("SCENE.json");
  app.add_flag("--list", lists, "List output devices, default first")->excludes(scene);
  auto* device = app.add_option("--device", options.device, "Output to play on, by its name")->option_text("NAME");
  app.add_flag("--null", options.null, "Play in real time without a sound card")->excludes(device);
  app.set_version_flag("--version", carillon::base::describe("carillon-live"));
  app.add_option("--frames", options.frames, "Frames per block, 16 to 8192")
      ->check(carillon::base::whole_range(16, 8192), carillon::base::describe_whole_range(16, 8192))
      ->option_text("N");
  app.add_option("--look-ahead", options.look_ahead_s, "Lead of the physics over the sound in seconds, 0.02 to 10")
      ->check(CLI::Range(0.02, 10.0))
      ->option_text("S");
  app.add_option("--gain", options.gain_per_pa, "Full scale per pascal, instead of the scene's (or 1)")
      ->check(CLI::Range(1e-12, 1e12))
      ->option_text("G");
  app.add_option("--cpu", options.cpu_share,
                 "Share of one core available to the sound, 0.01 to 1; the least audible modes fade out to meet it")
      ->check(CLI::Range(0.01, 1.0))
      ->option_text("SHARE");
  app.add_flag("--commands", options.takes_commands, "Move bodies by commands from standard input, one a line");
  app.add_option("--osc", options.osc, "Take commands as OSC messages on this UDP port; from this machine only if no address is given")
      ->option_text("[ADDRESS:]PORT");
  app.footer(std::string("Commands (--commands, --osc); a NAME with spaces in double quotes:\n") + carillon::live::kCommandText);
  app.add_flag("-q,--quiet", options.quiet, "Print warnings and errors only");
  try {
    app.parse(argc, argv);
    if (!lists && scene->empty()) throw CLI::RequiredError("scene");
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : carillon::kExitInput;
  }
  try {
    if (lists) {
      const std::vector<std::string> names = carillon::live::list_devices();
      for (const std::string& name : names) fmt::print("{}\n", carillon::base::printable(name));
      if (names.empty()) fmt::print("{}\n", carillon::live::kNoCardText);
      return 0;
    }
    carillon::live::play(options);
  } catch (const carillon::InputError& error) {
    return fail(carillon::kExitInput, error.what());
  } catch (const carillon::SolveError& error) {
    return fail(carillon::kExitSolve, error.what());
  } catch (const std::exception& error) {
    return fail(carillon::kExitSystem, error.what());
  }
  return 0;
}
