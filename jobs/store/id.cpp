// Hashes and names.
// Method: SHA-256 of OpenSSL, fed in pieces of 1 MiB.
// Source: FIPS 180-4.
// Deviations: none.
#include "jobs/store/id.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <openssl/evp.h>
#include <openssl/rand.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "runtime/config/error.hpp"

namespace carillon::store {
namespace {

constexpr std::size_t kIdDigits = 64;
constexpr std::size_t kPieceBytes = 1 << 20;

std::string to_hex(const unsigned char* bytes, std::size_t count) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i) text += fmt::format("{:02x}", bytes[i]);
  return text;
}

/// A file descriptor that closes itself.
struct Descriptor {
  int value = -1;
  ~Descriptor() {
    if (value >= 0) ::close(value);
  }
};

}  // namespace

std::optional<Id> parse_id(std::string_view text) {
  const auto is_digit = [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); };
  if (text.size() != kIdDigits || !std::all_of(text.begin(), text.end(), is_digit)) return std::nullopt;
  return Id(std::string(text));
}

Id require_id(std::string_view text, const std::string& where) {
  if (auto id = parse_id(text)) return *id;
  throw InputError(fmt::format("{}: an id is {} hex digits, and this is none", where, kIdDigits));
}

struct Hasher::State {
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  ~State() { EVP_MD_CTX_free(context); }
};

Hasher::Hasher() : state_(std::make_unique<State>()) {
  if (state_->context == nullptr || EVP_DigestInit_ex(state_->context, EVP_sha256(), nullptr) != 1)
    throw SystemError("OpenSSL has no SHA-256; check its installation");
}

Hasher::~Hasher() = default;

void Hasher::add(std::string_view bytes) { EVP_DigestUpdate(state_->context, bytes.data(), bytes.size()); }

Id Hasher::finish() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  EVP_DigestFinal_ex(state_->context, digest.data(), &size);
  return *parse_id(to_hex(digest.data(), size));
}

Id hash_text(std::string_view text) {
  Hasher hasher;
  hasher.add(text);
  return hasher.finish();
}

Id hash_file(const std::filesystem::path& file, std::string_view what, const std::function<void(std::string_view)>& take) {
  const auto refuse = [&](const std::string& why) { throw InputError(fmt::format("{}: {}", file.string(), why)); };
  // O_NONBLOCK: opening a pipe without a writer must not wait.
  const Descriptor fd{::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)};
  if (fd.value < 0) refuse(fmt::format("cannot open this {}: {}; check the path", what, std::strerror(errno)));
  struct stat info {};
  if (::fstat(fd.value, &info) != 0 || !S_ISREG(info.st_mode))
    refuse(fmt::format("a {} must be a regular file, and this is {}; name the file itself", what,
                       S_ISDIR(info.st_mode) ? "a folder" : "a pipe or a device"));
  Hasher hasher;
  std::string piece(kPieceBytes, '\0');
  for (;;) {
    const ssize_t got = ::read(fd.value, piece.data(), piece.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) refuse(fmt::format("cannot read this {}: {}; check the disk", what, std::strerror(errno)));
    if (got == 0) break;
    const std::string_view bytes(piece.data(), static_cast<std::size_t>(got));
    hasher.add(bytes);
    if (take) take(bytes);
  }
  return hasher.finish();
}

std::string make_random_name() {
  std::array<unsigned char, 16> bytes{};
  if (RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) != 1) throw SystemError("OpenSSL has no random numbers; check the machine");
  return to_hex(bytes.data(), bytes.size());
}

}  // namespace carillon::store
