// A synthesiser on a sound card, or on a clock alone.
//
//   live::Device device(synthesiser, {.frames = 256});
//   device.start();  // from now on the card calls process()
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "runtime/synth/synthesiser.hpp"

namespace carillon::live {

/// What a program says where nothing can be heard.
inline constexpr const char* kNoCardText =
    "there is no sound card, and no sound server runs; --null plays without sound, and carillon-render writes a WAV file";

struct DeviceOptions {
  std::string name;        // of list_devices(); empty: the system's default
  bool null = false;       // no sound system is asked for: a thread takes the blocks at the pace of real time and drops them
  double rate_hz = 48000;  // that of the synthesiser
  int frames = 256;        // of a block; the card may take others
};

struct DeviceStatistics {
  std::int64_t callbacks = 0;
  std::int64_t frames = 0;
  std::int64_t underflows = 0;  // blocks that came too late, as the card says; without a card, by a block or more
  double latency_s = 0.0;       // of the output, as the card says; without a card, of a block
  double busy_s = 0.0;          // CPU time that process() took
};

/// Output devices by name, the default one first. Throws SystemError when there is no sound system. [main-thread]
std::vector<std::string> list_devices();

/// One output stream, a channel for each microphone. All members [main-thread]; the card's thread calls Synthesiser::process() and nothing
/// else.
class Device {
 public:
  /// Opens the device; the synthesiser must outlive it. Throws InputError for a name that no device has, SystemError when there is none or
  /// it does not open.
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
