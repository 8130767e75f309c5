// Open Sound Control 1.0 over UDP: messages as words of commands.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace carillon::live {

using Words = std::vector<std::string>;

/// The messages of a packet, those of bundles in order without regard to time tags: "/push" ,sfff becomes "push" and four more words.
/// Arguments are strings, symbols, numbers (i, f, h, d) and booleans. Throws InputError for a packet that cannot be used.
std::vector<Words> parse_osc(std::span<const std::byte> packet);

/// A UDP port. [main-thread]
class OscPort {
 public:
  /// "PORT" of this machine only, or "ADDRESS:PORT" (IPv4, 0.0.0.0 is all networks). Port 0: any free one. Throws InputError for an
  /// invalid address, SystemError if the port cannot be opened.
  explicit OscPort(const std::string& where);
  ~OscPort();
  OscPort(const OscPort&) = delete;
  OscPort& operator=(const OscPort&) = delete;

  /// The messages that have arrived, without waiting for more: of at most 256 packets. `refuse` gets the reason for each packet that cannot
  /// be used.
  std::vector<Words> read(const std::function<void(const std::string& reason)>& refuse);
  int get_port() const { return port_; }

 private:
  int socket_ = -1, port_ = 0;
};

}  // namespace carillon::live
