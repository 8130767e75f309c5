// carillon-samples: strikes of a body as samples for any sampler.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
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
#include "runtime/render/samples/samples.hpp"

namespace {

using namespace carillon;

int fail(int code, const char* message) {
  std::fflush(stdout);
  fmt::print(stderr, "carillon-samples: {}\n", base::show_message(message));
  return code;
}

void run(samples::SampleOptions& options, bool is_quiet) {
  int next = 10;
  if (!is_quiet)
    options.progress = [&next](double share) {
      if (100.0 * share + 1e-9 < next) return;
      fmt::print(stderr, "samples: {} %\n", next);
      next += 10;
    };
  const samples::SampleSet set = samples::make_samples(options);
  if (!set.warning.empty()) fmt::print(stderr, "carillon-samples: warning: {}\n", base::printable(set.warning));
  if (is_quiet) return;
  fmt::print("samples     {}, {:.3g} MB\n", set.samples, 1e-6 * set.bytes);
  fmt::print("full scale  {:.4g} Pa at 1 m, at velocity 127\n", set.full_scale_pa);
  fmt::print("layers      {}; mean error of a velocity {:.1f} dB(A) relative to a blow at its speed\n", options.layers, set.error_db);
  for (const auto& file : set.instruments) fmt::print("instrument  {}\n", base::printable(file.string()));
}

/// Parses --at, three numbers per point.
void take_points(const std::vector<double>& numbers, samples::SampleOptions& options) {
  if (numbers.size() % 3 != 0) throw InputError(fmt::format("--at has {} numbers; give three for each point, in metres", numbers.size()));
  for (std::size_t i = 0; i < numbers.size(); i += 3) options.points_m.push_back({numbers[i], numbers[i + 1], numbers[i + 2]});
}

}  // namespace

int main(int argc, char** argv) {
  base::report_file_limit();
  samples::SampleOptions options;
  bool is_quiet = false;
  std::string keys = samples::kKeysNames[0], format = "pcm24";
  std::vector<double> at;
  CLI::App app("Strikes a body and writes the sounds as samples: WAV files and an SFZ instrument, which any sampler plays.",
               "carillon-samples");
  app.failure_message(
      [](const CLI::App* asked, const CLI::Error& error) { return base::printable_lines(CLI::FailureMessage::simple(asked, error)); });
  app.set_version_flag("--version", base::describe("carillon-samples"));
  app.add_option("BANK", options.bank, "The bank file")->required();
  app.add_option("-o,--output", options.folder, "The folder for the instrument and its samples")->required();
  app.add_option("--name", options.name, "Name of the instrument; without it that of the bank's file");
  CLI::Option* places = app.add_option("--places", options.places, "Number of points to strike, far from each other")
                            ->check(base::whole_range(1, 64), base::describe_whole_range(1, 64))
                            ->capture_default_str();
  app.add_option("--at", at, "Points to strike: X Y Z in metres, three numbers each")->excludes(places)->option_text("X Y Z ...");
  app.add_option("--layers", options.layers, "Layers of velocity")
      ->check(base::whole_range(1, 16), base::describe_whole_range(1, 16))
      ->capture_default_str();
  app.add_option("--mallets", options.mallets, "Names, separated by commas: steel, hard-wood, plastic, rubber, hard-felt, soft-felt, yarn")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--round-robin", options.round_robin, "Number of alternating strikes around each point")
      ->check(base::whole_range(1, 16), base::describe_whole_range(1, 16))
      ->capture_default_str();
  app.add_option("--speed", options.speed_m_s, "Speed of the mallet at velocity 127, in m/s")->capture_default_str();
  app.add_option("--keys", keys,
                 "What a key plays: \"places\", one struck point per key, or \"pitches\", one sound transposed over the keyboard")
      ->check(CLI::IsMember(samples::kKeysNames))
      ->capture_default_str();
  app.add_option("--first-key", options.first_key, "First key with --keys places, 0 to 127; 60 is middle C")->capture_default_str();
  app.add_option("--rate", options.rate_hz, "Sample rate in Hz")
      ->check(base::whole_range(8000, 192000), base::describe_whole_range(8000, 192000))
      ->capture_default_str();
  app.add_option("--format", format, "pcm16, pcm24, pcm32 or float")
      ->check(CLI::IsMember(scene::kSampleFormatNames))
      ->capture_default_str();
  app.add_option("--seconds", options.max_seconds, "Longest sample, in s; a sample ends 80 dB below its peak")->capture_default_str();
  app.add_flag("-q,--quiet", is_quiet, "Print errors only");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kExitInput;
  }
  const auto find = [](const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) - names.begin();
  };
  options.keys = static_cast<samples::Keys>(find(samples::kKeysNames, keys));
  options.format = static_cast<scene::SampleFormat>(find(scene::kSampleFormatNames, format));
  try {
    take_points(at, options);
    run(options, is_quiet);
  } catch (const InputError& error) {
    return fail(kExitInput, error.what());
  } catch (const SolveError& error) {
    return fail(kExitSolve, error.what());
  } catch (const std::exception& error) {
    return fail(kExitSystem, error.what());
  }
  return 0;
}
