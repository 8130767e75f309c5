// Method: PortAudio's callback with non-interleaved channels, as process() fills them. The null device is a thread that sleeps until the
// next block is due; a delay of a block or more is lost time, as on a card. Source: PortAudio V19 reference, portaudio.h.
#include "runtime/render/live/device.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <portaudio.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <stop_token>
#include <thread>

#include "runtime/base/clock.hpp"
#include "runtime/base/error.hpp"

namespace carillon::live {
namespace {

/// PortAudio, initialised while in use.
class Library {
 public:
  Library() {
    // Back ends print to standard error for every missing sound system.
    const int kept = dup(STDERR_FILENO);
    const int nothing = open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (kept >= 0 && nothing >= 0) dup2(nothing, STDERR_FILENO);
    const PaError error = Pa_Initialize();
    if (kept >= 0) {
      dup2(kept, STDERR_FILENO);
      close(kept);
    }
    if (nothing >= 0) close(nothing);
    if (error != paNoError) throw SystemError(fmt::format("the sound system does not start: {}", Pa_GetErrorText(error)));
  }
  ~Library() { Pa_Terminate(); }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
};

/// Indices of the output devices, default first.
std::vector<PaDeviceIndex> find_outputs() {
  std::vector<PaDeviceIndex> outputs;
  const PaDeviceIndex preferred = Pa_GetDefaultOutputDevice();
  if (preferred != paNoDevice) outputs.push_back(preferred);
  for (PaDeviceIndex i = 0; i < Pa_GetDeviceCount(); ++i)
    if (i != preferred && Pa_GetDeviceInfo(i)->maxOutputChannels > 0) outputs.push_back(i);
  return outputs;
}

PaDeviceIndex find_device(const std::string& name) {
  const std::vector<PaDeviceIndex> outputs = find_outputs();
  if (outputs.empty()) throw SystemError(kNoCardText);
  if (name.empty()) return outputs.front();
  std::string names;
  for (const PaDeviceIndex i : outputs) {
    if (Pa_GetDeviceInfo(i)->name == name) return i;
    names += fmt::format("{}\"{}\"", names.empty() ? "" : ", ", Pa_GetDeviceInfo(i)->name);
  }
  throw InputError(fmt::format("no output is called \"{}\"; there are {}", name, names));
}

}  // namespace

struct Device::State {
  std::optional<Library> library;  // unset for the null device
  double period_s = 0.0;           // of a block, null device only
  int frames_of_block = 0;
  std::vector<std::vector<float>> channels;  // buffers of the null device
  std::jthread clock;
  synth::Synthesiser* synthesiser = nullptr;
  PaStream* stream = nullptr;
  std::atomic<std::int64_t> callbacks{0}, frames{0}, underflows{0}, busy_ns{0};
  bool is_running = false;

  void keep_time(const std::stop_token& stop) {
    std::vector<float*> out;
    for (std::vector<float>& channel : channels) out.push_back(channel.data());
    const auto period = std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(period_s));
    auto due = std::chrono::steady_clock::now();
    while (!stop.stop_requested()) {
      play(nullptr, out.data(), static_cast<unsigned long>(frames_of_block), nullptr, 0, this);
      due += period;
      const auto now = std::chrono::steady_clock::now();
      if (now > due + period) {
        underflows.fetch_add(1, std::memory_order_relaxed);
        due = now;
      }
      std::this_thread::sleep_until(due);
    }
  }

  static int play(const void*, void* out, unsigned long frames, const PaStreamCallbackTimeInfo*, PaStreamCallbackFlags flags, void* self) {
    auto& state = *static_cast<State*>(self);
    if ((flags & paOutputUnderflow) != 0) state.underflows.fetch_add(1, std::memory_order_relaxed);
    state.callbacks.fetch_add(1, std::memory_order_relaxed);
    state.frames.fetch_add(static_cast<std::int64_t>(frames), std::memory_order_relaxed);
    const std::uint64_t started_ns = base::read_clock_ns(CLOCK_THREAD_CPUTIME_ID);
    state.synthesiser->process(static_cast<float* const*>(out), state.synthesiser->get_microphone_count(), static_cast<int>(frames));
    state.busy_ns.fetch_add(static_cast<std::int64_t>(base::read_clock_ns(CLOCK_THREAD_CPUTIME_ID) - started_ns),
                            std::memory_order_relaxed);
    return paContinue;
  }
};

std::vector<std::string> list_devices() {
  const Library library;
  std::vector<std::string> names;
  for (const PaDeviceIndex i : find_outputs()) names.emplace_back(Pa_GetDeviceInfo(i)->name);
  return names;
}

Device::Device(synth::Synthesiser& synthesiser, const DeviceOptions& options) : state_(std::make_unique<State>()) {
  state_->synthesiser = &synthesiser;
  if (options.null) {
    state_->period_s = options.frames / options.rate_hz;
    state_->frames_of_block = options.frames;
    state_->channels.assign(synthesiser.get_microphone_count(), std::vector<float>(options.frames));
    return;
  }
  state_->library.emplace();
  PaStreamParameters output{};
  output.device = find_device(options.name);
  output.channelCount = synthesiser.get_microphone_count();
  output.sampleFormat = paFloat32 | paNonInterleaved;
  output.suggestedLatency = Pa_GetDeviceInfo(output.device)->defaultLowOutputLatency;
  const PaError error = Pa_OpenStream(&state_->stream, nullptr, &output, options.rate_hz, static_cast<unsigned long>(options.frames),
                                      paNoFlag, State::play, state_.get());
  if (error != paNoError) {
    throw SystemError(fmt::format("\"{}\" does not play {} channels at {} Hz: {}", Pa_GetDeviceInfo(output.device)->name,
                                  output.channelCount, options.rate_hz, Pa_GetErrorText(error)));
  }
}

Device::~Device() {
  stop();
  if (state_->stream != nullptr) Pa_CloseStream(state_->stream);
}

void Device::start() {
  if (state_->period_s > 0.0) {
    state_->clock = std::jthread([state = state_.get()](const std::stop_token& stop) { state->keep_time(stop); });
    return;
  }
  const PaError error = Pa_StartStream(state_->stream);
  if (error != paNoError) throw SystemError(fmt::format("the sound card does not start: {}", Pa_GetErrorText(error)));
  state_->is_running = true;
}

void Device::stop() {
  if (state_->clock.joinable()) {
    state_->clock.request_stop();
    state_->clock.join();
  }
  if (state_->is_running) Pa_StopStream(state_->stream);
  state_->is_running = false;
}

DeviceStatistics Device::get_statistics() const noexcept {
  const PaStreamInfo* info = state_->stream != nullptr ? Pa_GetStreamInfo(state_->stream) : nullptr;
  return {.callbacks = state_->callbacks.load(std::memory_order_relaxed),
          .frames = state_->frames.load(std::memory_order_relaxed),
          .underflows = state_->underflows.load(std::memory_order_relaxed),
          .latency_s = info != nullptr ? info->outputLatency : state_->period_s,
          .busy_s = 1e-9 * static_cast<double>(state_->busy_ns.load(std::memory_order_relaxed))};
}

}  // namespace carillon::live
