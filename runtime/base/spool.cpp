#include "runtime/base/spool.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "runtime/base/signal_pause.hpp"

namespace carillon::base {
namespace {

/// Nameless file in `folder`; -1 and errno on failure.
int open_unlinked(const std::filesystem::path& folder) {
  const int descriptor = ::open(folder.c_str(), O_RDWR | O_TMPFILE | O_CLOEXEC, 0600);
  if (descriptor >= 0) return descriptor;
  // File systems without nameless files (NFS): create and unlink.
  const SignalPause pause;
  std::string name = (folder / ".carillon-spool-XXXXXX").string();
  const int named = ::mkostemp(name.data(), O_CLOEXEC);
  if (named >= 0) ::unlink(name.c_str());
  return named;
}

}  // namespace

Spool::Spool(std::filesystem::path folder, std::string what, std::size_t memory)
    : folder_(std::move(folder)), what_(std::move(what)), memory_(memory) {}

Spool::~Spool() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Spool::Spool(Spool&& other) noexcept { *this = std::move(other); }

Spool& Spool::operator=(Spool&& other) noexcept {
  std::swap(folder_, other.folder_);
  std::swap(what_, other.what_);
  std::swap(memory_, other.memory_);
  std::swap(descriptor_, other.descriptor_);
  std::swap(written_, other.written_);
  std::swap(tail_, other.tail_);
  return *this;
}

void Spool::refuse(int error) const {
  throw SystemError(fmt::format("{}: the temporary file of the {} cannot be written: {}, after {} bytes; make room or choose another place",
                                folder_.string(), what_, std::strerror(error), written_));
}

void Spool::append(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const std::size_t room = memory_ > tail_.size() ? memory_ - tail_.size() : 0;
    const auto taken = bytes.first(std::min(room, bytes.size()));
    tail_.insert(tail_.end(), taken.begin(), taken.end());
    bytes = bytes.subspan(taken.size());
    if (!bytes.empty()) write_tail();
  }
}

void Spool::write_tail() {
  constexpr std::size_t kTail = 1 << 18;
  if (descriptor_ < 0) {
    if (folder_.empty()) {
      std::error_code error;
      folder_ = std::filesystem::temp_directory_path(error);
      if (error) folder_ = ".";
    }
    descriptor_ = open_unlinked(folder_);
    if (descriptor_ < 0) refuse(errno);
    memory_ = std::clamp<std::size_t>(memory_, 1, kTail);  // memory is now a write buffer only
  }
  std::span<const std::byte> rest(tail_);
  while (!rest.empty()) {
    const ssize_t put = ::pwrite(descriptor_, rest.data(), rest.size(), static_cast<off_t>(written_));
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) refuse(put < 0 ? errno : ENOSPC);
    written_ += static_cast<std::uint64_t>(put);
    rest = rest.subspan(put);
  }
  tail_.clear();
  if (tail_.capacity() > 2 * memory_) {
    std::vector<std::byte> small;
    small.reserve(memory_);
    tail_ = std::move(small);
  }
}

void Spool::read(std::uint64_t offset, std::span<std::byte> bytes) const {
  while (!bytes.empty() && offset < written_) {
    const std::size_t wanted = std::min<std::uint64_t>(bytes.size(), written_ - offset);
    const ssize_t got = ::pread(descriptor_, bytes.data(), wanted, static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) {
      throw SystemError(fmt::format("{}: the temporary file of the {} cannot be read: {}", folder_.string(), what_,
                                    got < 0 ? std::strerror(errno) : "it ends early"));
    }
    offset += static_cast<std::uint64_t>(got);
    bytes = bytes.subspan(got);
  }
  if (!bytes.empty()) std::memcpy(bytes.data(), tail_.data() + (offset - written_), bytes.size());
}

}  // namespace carillon::base
