// A POSIX file descriptor that closes itself.
#pragma once

#include <unistd.h>

#include <string_view>
#include <utility>

namespace carillon::base {

/// Owns one open descriptor, or none (negative). Each descriptor has one owner, and is closed once.
class Descriptor {
 public:
  explicit Descriptor(int value = -1) : value_(value) {}
  Descriptor(Descriptor&& other) noexcept : value_(std::exchange(other.value_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(value_, other.value_);
    return *this;
  }
  ~Descriptor() { close(); }

  /// Negative: none.
  int get() const { return value_; }
  void close() {
    if (value_ >= 0) ::close(value_);
    value_ = -1;
  }

 private:
  int value_;
};

/// Writes all bytes, in as many calls as that takes. 0, or the errno of what went wrong; ENOSPC where nothing more is taken.
int write_all(int descriptor, std::string_view bytes) noexcept;

}  // namespace carillon::base
