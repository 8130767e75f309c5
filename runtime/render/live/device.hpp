// A synthesiser on a sound card or on a clock.
//
//   live::Device device(synthesiser, {.frames = 256});
// the card then calls process()
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "runtime/synth/synthesiser.hpp"

namespace carillon::live {

/// Message without an audio device.
inline constexpr const char* kNoCardText =
    "there is no sound card, and no sound server runs; --null plays without sound, and carillon-render writes a WAV file";

struct DeviceOptions {
  std::string name;        // one of list_devices(); empty: the system's default
  bool null = false;       // no sound system: a thread takes blocks in real time and drops them
  double rate_hz = 48000;  // the synthesiser's
  int frames = 256;        // per block; the card may use others
};

struct DeviceStatistics {
  std::int64_t callbacks = 0;
  std::int64_t frames = 0;
  std::int64_t underflows = 0;  // late blocks as reported by the card; without a card: late by a block or more
  double latency_s = 0.0;       // output latency as reported by the card; without a card: one block
  double busy_s = 0.0;          // CPU time of process()
};

/// Names of the output devices, default first. Throws SystemError without a sound system. [main-thread]
std::vector<std::string> list_devices();

/// One output stream, one channel per microphone. All members [main-thread]; the card's thread calls only Synthesiser::process().
class Device {
 public:
  /// Opens the device; the synthesiser must outlive it. Throws InputError for an unknown name, SystemError if no device opens.
  Device(synth::Synthesiser& synthesiser, const DeviceOptions& options);
  ~Device();  // stops
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  void start();
  void stop();
  DeviceStatistics get_statistics() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace carillon::live
