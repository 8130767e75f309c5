// Method: one thread advances the physics and pushes events (runtime/render/stage.hpp); the card's thread plays them.
#include "runtime/render/live/player.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "runtime/base/clock.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/render/live/commands.hpp"
#include "runtime/render/live/device.hpp"
#include "runtime/render/live/osc.hpp"
#include "runtime/render/live/warning_limit.hpp"
#include "runtime/render/render.hpp"
#include "runtime/render/stage.hpp"
#include "runtime/render/surface_playback.hpp"
#include "runtime/scene/banks.hpp"
#include "runtime/scene/scene.hpp"
#include "runtime/synth/load_keeper.hpp"
#include "runtime/synth/synthesiser.hpp"

namespace carillon::live {
namespace {

void warn(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) fmt::print(stderr, "carillon-live: warning: {}\n", base::printable(warning));
}

/// Commands from standard input and by OSC.
class CommandInput {
 public:
  CommandInput(const PlayerOptions& options, Hands hands) : hands_(std::move(hands)) {
    if (options.takes_commands) reader_.emplace(STDIN_FILENO);
    if (options.osc.empty()) return;
    port_.emplace(options.osc);
    if (!options.quiet) fmt::print("commands by OSC    UDP port {}\n", port_->get_port());
    std::fflush(stdout);
  }

  /// Carries out the commands that have arrived. False: quit.
  bool obey() {
    if (reader_)
      for (const std::string& line : reader_->read())
        if (!take([&] { return split(line); })) return false;
    if (port_)
      for (const Words& words : port_->read([&](const std::string& reason) { refuse("OSC packet ignored: " + reason, packets_); }))
        if (!take([&] { return words; })) return false;
    return true;
  }
  void print() const {
    if (port_)
      fmt::print("OSC                {} commands or packets rejected\n", refused_);
    else if (refused_ > 0)
      fmt::print("commands           {} rejected\n", refused_);
  }

 private:
  template <class GetWords>
  bool take(GetWords&& get_words) {
    try {
      const Words words = get_words();
      if (words == Words{"quit"}) return false;
      if (const std::string text = carry_out(words, hands_); !text.empty()) {
        fmt::print("{}\n", text);
        std::fflush(stdout);
      }
    } catch (const InputError& error) {
      refuse(error.what(), commands_);
    }
    return true;
  }
  /// A flood of packets that are none leaves room for the warnings of commands.
  void refuse(const std::string& reason, WarningLimit& limit) {
    ++refused_;
    const std::int64_t left_out = limit.pass(base::get_steady_s());
    if (left_out >= 0) warn({left_out == 0 ? reason : fmt::format("{}; before it {} more were only counted", reason, left_out)});
  }

  Hands hands_;
  std::optional<LineReader> reader_;
  std::optional<OscPort> port_;
  std::int64_t refused_ = 0;
  WarningLimit packets_, commands_;
};

void print_statistics(const DeviceStatistics& card, const synth::SynthesiserCounters& counters, render::Stage& stage, double rate_hz) {
  const double card_s = std::max(static_cast<double>(card.frames), 1.0) / rate_hz;
  fmt::print("played             {:.2f} s in {} blocks, {} underflows, latency {:.1f} ms\n", static_cast<double>(card.frames) / rate_hz,
             card.callbacks, card.underflows, 1e3 * card.latency_s);
  fmt::print("strikes            {}, {} late, {} refused\n", counters.strikes, counters.late, counters.refused);
  if (const std::int64_t faults = counters.faults + stage.get_faults(); faults > 0)
    fmt::print("faulty events      {}, not played\n", faults);
  fmt::print("physics            {} times behind the sound", counters.underruns);
  if (const double lead_s = stage.get_min_lead_s(); std::isfinite(lead_s))
    fmt::print(", {:.0f} ms {} at the worst; 2 ms of it took {:.1f} ms of CPU at most", 1e3 * std::abs(lead_s),
               lead_s < 0.0 ? "behind" : "in front", 1e3 * stage.get_worst_window_s());
  fmt::print("\n");
  fmt::print("work               {:.1f} % of a core, {:.3g} mode-samples/s, {} groups of modes faded\n", 100.0 * card.busy_s / card_s,
             static_cast<double>(counters.mode_samples) / card_s, counters.faded);
}

}  // namespace

void play(const PlayerOptions& options) {
  scene::Scene scene = scene::read_scene(options.scene);
  render::refuse_surfaces(scene, "carillon-live");
  scene::Banks banks = scene::read_banks(scene, options.quiet);
  warn(scene.warnings);
  const double gain_per_pa = options.gain_per_pa > 0.0 ? options.gain_per_pa : scene.output.gain_per_pa.value_or(1.0);
  render::Stage stage(
      scene,
      {.look_ahead_s = options.look_ahead_s, .gain_per_pa = gain_per_pa, .is_handled = options.takes_commands || !options.osc.empty()});
  warn(stage.get_warnings());
  synth::Synthesiser& synthesiser = stage.get_synthesiser();
  const double rate_hz = scene.sample_rate_hz;
  Device device(synthesiser, {.name = options.device, .null = options.null, .rate_hz = rate_hz, .frames = options.frames});
  Hands hands{.world = stage.get_world(), .names = {}, .make = [&](const std::string& text) { return stage.add_body(text, banks); }};
  for (const scene::SceneBody& body : scene.bodies) hands.names.push_back(body.name);
  CommandInput commands(options, std::move(hands));
  stage.begin();
  device.start();
  synth::LoadKeeper keeper;
  for (double now_s = 0.0; now_s < scene.duration_s; now_s = synthesiser.get_time_s()) {
    if (!commands.obey()) break;
    const bool advanced = stage.step(now_s);
    if (options.cpu_share > 0.0) keeper.keep(synthesiser, options.cpu_share, device.get_statistics().busy_s);
    if (!advanced) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  device.stop();
  for (std::size_t i = 0; i < scene.bodies.size(); ++i)
    if (const std::string text =
            render::describe_bending(scene.bodies[i].name, *scene.bodies[i].spec.bank, synthesiser.get_deflection(static_cast<int>(i)));
        !text.empty())
      warn({text});
  if (options.quiet) return;
  print_statistics(device.get_statistics(), synthesiser.get_counters(), stage, rate_hz);
  commands.print();
}

}  // namespace carillon::live
