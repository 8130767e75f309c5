// Append-only lists that move to a nameless temporary file when they outgrow memory.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::base {

/// Append-only bytes. Up to `memory` bytes stay in memory; beyond that all go to a nameless file in `folder` (empty: temporary folder), so
/// that nothing is left behind however the process ends. I/O errors throw SystemError naming `what` and the folder.
class Spool {
 public:
  static constexpr std::size_t kMemory = 4 << 20;

  /// Performs no I/O.
  explicit Spool(std::filesystem::path folder = {}, std::string what = "list", std::size_t memory = kMemory);
  ~Spool();
  Spool(Spool&& other) noexcept;
  Spool& operator=(Spool&& other) noexcept;

  void append(std::span<const std::byte> bytes);
  std::uint64_t size() const { return written_ + tail_.size(); }
  /// Fills `bytes` from `offset`; the range must exist.
  void read(std::uint64_t offset, std::span<std::byte> bytes) const;

 private:
  void write_tail();
  [[noreturn]] void refuse(int error) const;

  std::filesystem::path folder_;
  std::string what_;
  std::size_t memory_ = 0;
  int descriptor_ = -1;
  std::uint64_t written_ = 0;    // bytes in the file
  std::vector<std::byte> tail_;  // bytes after those
};

/// List of trivially copyable records in a spool.
template <class Record>
class Records {
  static_assert(std::is_trivially_copyable_v<Record>);

 public:
  Records() = default;
  explicit Records(Spool spool) : spool_(std::move(spool)) {}

  void append(const Record& record) { append(std::span(&record, 1)); }
  void append(std::span<const Record> records) { spool_.append(std::as_bytes(records)); }
  std::uint64_t size() const { return spool_.size() / sizeof(Record); }
  void read(std::uint64_t first, std::span<Record> records) const { spool_.read(first * sizeof(Record), std::as_writable_bytes(records)); }
  Record get(std::uint64_t i) const {
    Record record;
    read(i, std::span(&record, 1));
    return record;
  }

  /// Sequential reader. The list must outlive it.
  class Reader {
   public:
    explicit Reader(const Records& records) : records_(&records) {}
    /// Index of the next record.
    std::uint64_t get_number() const { return first_ + at_; }
    /// nullptr at the end. Valid until next().
    const Record* peek() {
      if (at_ == buffer_.size()) {
        first_ += at_;
        at_ = 0;
        buffer_.resize(std::min<std::uint64_t>(kBuffered, records_->size() - first_));
        records_->read(first_, buffer_);
      }
      return at_ < buffer_.size() ? &buffer_[at_] : nullptr;
    }
    void next() { ++at_; }

   private:
    static constexpr std::size_t kBuffered = 512;
    const Records* records_;
    std::uint64_t first_ = 0;  // index of buffer_[0]
    std::size_t at_ = 0;
    std::vector<Record> buffer_;
  };

  template <class Work>
  void for_each(Work&& work) const {
    Reader reader(*this);
    for (const Record* record = reader.peek(); record != nullptr; record = reader.peek()) {
      work(*record);
      reader.next();
    }
  }

 private:
  Spool spool_;
};

/// Several lists appended alternately to one spool.
template <class Record>
class RecordLists {
  struct List {
    std::vector<std::uint64_t> pieces;  // index of the first record of each piece
    std::vector<Record> tail;
  };

 public:
  explicit RecordLists(std::size_t lists, Spool spool = Spool()) : lists_(lists), records_(std::move(spool)) {}

  std::size_t count() const { return lists_.size(); }
  void append(std::size_t list, const Record& record) {
    List& to = lists_[list];
    to.tail.push_back(record);
    if (to.tail.size() < kPiece) return;
    to.pieces.push_back(records_.size());
    records_.append(std::span<const Record>(to.tail));
    to.tail.clear();
  }

  /// Sequential reader of one list. The lists must outlive it and must not grow meanwhile.
  class Reader {
   public:
    Reader(const RecordLists& lists, std::size_t list) : lists_(&lists), list_(&lists.lists_[list]) {}
    const Record* peek() {
      if (at_ == buffer_.size() && piece_ <= list_->pieces.size()) {
        at_ = 0;
        if (piece_ < list_->pieces.size()) {
          buffer_.resize(kPiece);
          lists_->records_.read(list_->pieces[piece_], buffer_);
        } else {
          buffer_ = list_->tail;
        }
        ++piece_;
      }
      return at_ < buffer_.size() ? &buffer_[at_] : nullptr;
    }
    void next() { ++at_; }

   private:
    const RecordLists* lists_;
    const List* list_;
    std::size_t piece_ = 0, at_ = 0;
    std::vector<Record> buffer_;
  };

 private:
  static constexpr std::size_t kPiece = 128;
  std::vector<List> lists_;
  Records<Record> records_;
};

}  // namespace carillon::base
