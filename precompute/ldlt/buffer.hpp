// Memory for numbers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

namespace carillon::ldlt {

struct FreeNumbers {
  std::size_t mapped_bytes = 0;  // 0: from the heap
  void operator()(double* p) const;
};

/// When a large buffer gets its memory: all of it at once takes two thirds of the time, and is for what will be used from end to end.
enum class Pages { kWhenTouched, kAtOnce };

/// Uninitialised numbers, aligned for vectors. Large ones are pages of their own, of 2 MB where the system has such, which go back to it at
/// once: letters, panels and tiles come and go, and what the heap keeps of them would count as memory of the rank. Throws std::bad_alloc.
class Buffer {
 public:
  Buffer() = default;
  explicit Buffer(std::int64_t count, Pages pages_come = Pages::kWhenTouched);
  /// The same, all zero.
  static Buffer make_zero(std::int64_t count);
  double* data() const { return data_.get(); }
  std::int64_t size() const { return size_; }

  /// The pages after the first `count` numbers serve other buffers until the BufferReuse that lives now ends, which this buffer must
  /// outlive. What is in them is lost. Once in a BufferReuse.
  void lend_tail(std::int64_t count) const;
  /// The memory of the pages after the first `count` numbers goes back to the system, and the next touch brings fresh pages.
  void give_back_tail(std::int64_t count) const;
  /// Gets memory for all pages that have none. Throws std::bad_alloc.
  void populate() const;

 private:
  std::unique_ptr<double, FreeNumbers> data_;
  std::int64_t size_ = 0;
  bool is_fresh_ = false;  // pages of the system, which are zero
};

/// While one lives, the pages of large buffers that are given back serve others: fresh pages cost more than what is done with them. What
/// large buffers have in memory, with what waits, never exceeds what they had in use at most. Afterwards they wait for the next one, until
/// give_back_waiting(). One at a time.
class BufferReuse {
 public:
  BufferReuse();
  ~BufferReuse();
  BufferReuse(const BufferReuse&) = delete;
  BufferReuse& operator=(const BufferReuse&) = delete;

  /// Pages that wait go back to the system. Pre: none lives.
  static void give_back_waiting();
};

}  // namespace carillon::ldlt
