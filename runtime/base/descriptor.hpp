// RAII for POSIX file descriptors.
#pragma once

#include <unistd.h>

#include <string_view>
#include <utility>
#include <vector>

namespace carillon::base {

/// Unique owner of a descriptor; negative: none.
class Descriptor {
 public:
  explicit Descriptor(int value = -1) : value_(value) {}
  Descriptor(Descriptor&& other) noexcept : value_(std::exchange(other.value_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(value_, other.value_);
    return *this;
  }
  ~Descriptor() { close(); }

  int get() const { return value_; }
  void close() {
    if (value_ >= 0) ::close(value_);
    value_ = -1;
  }

 private:
  int value_;
};

/// Open descriptors of this process, in any order.
std::vector<int> list_descriptors();

/// Writes all bytes. Returns 0 or errno; ENOSPC if write() accepts no more.
int write_all(int descriptor, std::string_view bytes) noexcept;

}  // namespace carillon::base
