// Source: M. Wright, "The Open Sound Control 1.0 Specification" (2002): big-endian numbers, strings padded with zeros to a multiple of
// four.
#include "runtime/render/live/osc.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <system_error>

#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"

namespace carillon::live {
namespace {

constexpr int kMaxDepth = 8;      // of bundles within bundles
constexpr int kMaxPackets = 256;  // of a call of read()
constexpr std::size_t kMaxPacket = 65536;
constexpr std::string_view kBundle = "#bundle";

/// Takes the parts of a packet in order.
class Reader {
 public:
  explicit Reader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  bool is_at_end() const { return bytes_.empty(); }
  std::span<const std::byte> take(std::size_t count) {
    if (count > bytes_.size()) throw InputError("it ends too early");
    const std::span<const std::byte> taken = bytes_.first(count);
    bytes_ = bytes_.subspan(count);
    return taken;
  }
  template <class Unsigned>
  Unsigned take_number() {
    Unsigned value = 0;
    for (const std::byte b : take(sizeof(Unsigned))) value = static_cast<Unsigned>(value << 8 | std::to_integer<Unsigned>(b));
    return value;
  }
  std::string take_string() {
    const auto end = std::find(bytes_.begin(), bytes_.end(), std::byte{0});
    const auto length = static_cast<std::size_t>(end - bytes_.begin());
    const std::span<const std::byte> taken = take((length / 4 + 1) * 4);
    return {reinterpret_cast<const char*>(taken.data()), length};
  }

 private:
  std::span<const std::byte> bytes_;
};

std::string take_argument(Reader& reader, char type) {
  switch (type) {
    case 'i':
      return fmt::format("{}", static_cast<std::int32_t>(reader.take_number<std::uint32_t>()));
    case 'h':
      return fmt::format("{}", static_cast<std::int64_t>(reader.take_number<std::uint64_t>()));
    case 'f':
      return fmt::format("{}", std::bit_cast<float>(reader.take_number<std::uint32_t>()));
    case 'd':
      return fmt::format("{}", std::bit_cast<double>(reader.take_number<std::uint64_t>()));
    case 's':
    case 'S':
      return reader.take_string();
    case 'T':
      return "1";
    case 'F':
      return "0";
    default:
      throw InputError(fmt::format("it has an argument of type \"{}\"; give strings and numbers", base::printable({&type, 1})));
  }
}

void parse(std::span<const std::byte> bytes, int depth, std::vector<Words>& messages) {
  if (bytes.size() % 4 != 0) throw InputError(fmt::format("{} bytes are no multiple of 4", bytes.size()));
  Reader reader(bytes);
  const std::string address = reader.take_string();
  if (address == kBundle) {
    if (depth == kMaxDepth) throw InputError("it has too many bundles within bundles");
    reader.take(8);  // time tag
    while (!reader.is_at_end()) {
      const auto size = reader.take_number<std::uint32_t>();
      parse(reader.take(size), depth + 1, messages);
    }
    return;
  }
  if (!address.starts_with('/')) throw InputError("it has no address that begins with /");
  const std::string types = reader.is_at_end() ? "," : reader.take_string();
  if (!types.starts_with(',')) throw InputError(fmt::format("{} has no type tags", base::printable(address)));
  Words& words = messages.emplace_back(Words{address.substr(1)});
  for (const char type : std::string_view(types).substr(1)) words.push_back(take_argument(reader, type));
  if (!reader.is_at_end()) throw InputError(fmt::format("{} has more than its type tags say", base::printable(address)));
}

}  // namespace

std::vector<Words> parse_osc(std::span<const std::byte> packet) {
  std::vector<Words> messages;
  parse(packet, 0, messages);
  return messages;
}

OscPort::OscPort(const std::string& where) {
  const std::size_t colon = where.find(':');
  const std::string host = colon == std::string::npos ? "127.0.0.1" : where.substr(0, colon);
  const std::string_view port = std::string_view(where).substr(colon == std::string::npos ? 0 : colon + 1);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  std::uint16_t number = 0;
  const auto [stop, fault] = std::from_chars(port.data(), port.data() + port.size(), number);
  if (fault != std::errc() || stop != port.data() + port.size() || inet_pton(AF_INET, host.c_str(), &address.sin_addr) != 1)
    throw InputError(fmt::format("--osc: \"{}\" is no port; give one like 9000, or with an address like 0.0.0.0:9000", where));
  address.sin_port = htons(number);
  const auto fail = [&] {
    const int error = errno;
    if (socket_ >= 0) close(socket_);
    throw SystemError(fmt::format("--osc: {} cannot be used: {}", where, std::generic_category().message(error)));
  };
  socket_ = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (socket_ < 0) fail();
  socklen_t size = sizeof address;
  if (bind(socket_, reinterpret_cast<const sockaddr*>(&address), size) != 0) fail();
  if (getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size) != 0) fail();
  port_ = ntohs(address.sin_port);
}

OscPort::~OscPort() { close(socket_); }

std::vector<Words> OscPort::read(const std::function<void(const std::string&)>& refuse) {
  std::vector<Words> messages;
  std::array<std::byte, kMaxPacket> packet;
  for (int n = 0; n < kMaxPackets; ++n) {
    const ssize_t size = recv(socket_, packet.data(), packet.size(), 0);
    if (size < 0) break;
    try {
      for (Words& words : parse_osc(std::span(packet).first(static_cast<std::size_t>(size)))) messages.push_back(std::move(words));
    } catch (const InputError& error) {
      refuse(error.what());
    }
  }
  return messages;
}

}  // namespace carillon::live
