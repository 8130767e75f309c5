// Page-backed memory for doubles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

namespace carillon::ldlt {

struct FreeNumbers {
  std::size_t mapped_bytes = 0;  // 0: heap memory
  void operator()(double* p) const;
};

/// Time of page allocation for large buffers: all pages at once takes two thirds of the time, for buffers that are used completely.
enum class Pages { kWhenTouched, kAtOnce };

/// Uninitialised doubles, aligned for vector instructions. Large buffers are separate mappings, of 2 MB pages where available, which return
/// to the system immediately: memory cached by the heap would count as memory of the rank. Throws std::bad_alloc.
class Buffer {
 public:
  Buffer() = default;
  explicit Buffer(std::int64_t count, Pages pages_come = Pages::kWhenTouched);
  /// Zero-initialised buffer.
  static Buffer make_zero(std::int64_t count);
  double* data() const { return data_.get(); }
  std::int64_t size() const { return size_; }

  /// Lends the pages after the first `count` numbers to other buffers until the current BufferReuse ends, which this buffer must outlive.
  /// Their contents are lost. Once per BufferReuse.
  void lend_tail(std::int64_t count) const;
  /// Returns the memory of the pages after the first `count` numbers to the system; the next access maps fresh pages.
  void give_back_tail(std::int64_t count) const;
  /// Allocates memory for all pages that have none. Throws std::bad_alloc.
  void populate() const;

 private:
  std::unique_ptr<double, FreeNumbers> data_;
  std::int64_t size_ = 0;
  bool is_fresh_ = false;  // pages fresh from the system, zero-filled
};

/// While an instance lives, pages of released large buffers serve new ones, as fresh pages cost more than the computation on them. The
/// resident memory of large buffers, kept pages included, never exceeds their peak in use. Afterwards pages are kept for the next instance
/// until give_back_waiting(). One instance at a time.
class BufferReuse {
 public:
  BufferReuse();
  ~BufferReuse();
  BufferReuse(const BufferReuse&) = delete;
  BufferReuse& operator=(const BufferReuse&) = delete;

  /// Returns kept pages to the system. Pre: no instance lives.
  static void give_back_waiting();
};

}  // namespace carillon::ldlt
