// Integer lists of varying length in one message. Internal header of carillon::ldlt.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/comm/exchange.hpp"

namespace carillon::ldlt {

/// One list per rank, in the form of an all-to-all.
inline comm::ByRank<std::int32_t> join(const std::vector<std::vector<std::int32_t>>& lists) {
  comm::ByRank<std::int32_t> joined;
  joined.begin.push_back(0);
  std::size_t count = 0;
  for (const std::vector<std::int32_t>& list : lists) count += list.size();
  joined.items.reserve(count);
  for (const std::vector<std::int32_t>& list : lists) {
    joined.items.insert(joined.items.end(), list.begin(), list.end());
    joined.begin.push_back(static_cast<std::int64_t>(joined.items.size()));
  }
  return joined;
}

/// Sequential reader of a received list.
class ListReader {
 public:
  explicit ListReader(std::span<const std::int32_t> items) : items_(items) {}

  bool is_at_end() const { return at_ == items_.size(); }
  std::size_t place() const { return at_; }
  std::int32_t next() { return items_[at_++]; }
  void skip(std::int32_t count) { at_ += static_cast<std::size_t>(count); }
  std::vector<std::int32_t> take(std::int32_t count) {
    const std::span<const std::int32_t> taken = items_.subspan(at_, count);
    skip(count);
    return {taken.begin(), taken.end()};
  }

 private:
  std::span<const std::int32_t> items_;
  std::size_t at_ = 0;
};

}  // namespace carillon::ldlt
