#include "precompute/ldlt/buffer.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <map>
#include <new>
#include <utility>

namespace carillon::ldlt {
namespace {

constexpr std::size_t kMapped = 1 << 20;  // buffers of this size and above are mapped separately
const std::size_t kPage = sysconf(_SC_PAGESIZE);
constexpr std::size_t kLargePage = std::size_t{2} << 20;

std::size_t round_up(std::size_t bytes, std::size_t to) { return (bytes + to - 1) / to * to; }

double* advance(double* pages, std::size_t bytes) { return pages + bytes / sizeof(double); }
std::size_t count_bytes(const double* begin, const double* end) { return sizeof(double) * static_cast<std::size_t>(end - begin); }

/// Free pages kept for reuse.
struct Kept {
  bool is_active = false;
  std::map<double*, std::size_t> runs;  // size in bytes of each run; adjacent runs are merged
  double* lent_begin = nullptr;         // lent tail of a buffer that outlives the reuse: stays mapped
  double* lent_end = nullptr;

  /// First pages of the smallest sufficient run; null if there is none.
  double* take(std::size_t wanted) {
    auto best = runs.end();
    for (auto at = runs.begin(); at != runs.end(); ++at)
      if (at->second >= wanted && (best == runs.end() || at->second < best->second)) best = at;
    if (best == runs.end()) return nullptr;
    double* const taken = best->first;
    cut(best, wanted);
    return taken;
  }
  void put(double* freed, std::size_t bytes) noexcept {
    if (!is_active) return give_back(freed, bytes);
    const auto after = runs.lower_bound(freed);
    const auto before = after == runs.begin() ? runs.end() : std::prev(after);
    const bool follows = before != runs.end() && advance(before->first, before->second) == freed;
    const bool is_followed = after != runs.end() && advance(freed, bytes) == after->first;
    if (follows) {
      before->second += bytes;
      if (!is_followed) return;
      before->second += after->second;
      runs.erase(after);
    } else if (is_followed) {
      auto run = runs.extract(after);
      run.key() = freed;
      run.mapped() += bytes;
      runs.insert(std::move(run));
    } else if (!add(freed, bytes)) {
      give_back(freed, bytes);
    }
  }
  /// Returns up to this many bytes to the system.
  void release(std::size_t bytes) {
    while (bytes > 0 && !runs.empty()) {
      const std::size_t part = std::min(bytes, runs.begin()->second);
      give_back(runs.begin()->first, part);
      cut(runs.begin(), part);
      bytes -= part;
    }
  }
  void clear() { release(std::numeric_limits<std::size_t>::max()); }
  /// Returns lent pages to their buffer.
  void end_loan() noexcept {
    const auto is_lent = [&](const auto& run) { return run.first < lent_end && lent_begin < advance(run.first, run.second); };
    for (auto at = std::find_if(runs.begin(), runs.end(), is_lent); at != runs.end();
         at = std::find_if(runs.begin(), runs.end(), is_lent)) {
      double* const begin = at->first;
      double* const end = advance(begin, at->second);
      runs.erase(at);
      keep(begin, std::min(end, lent_begin));
      keep(std::max(begin, lent_end), end);
    }
    lent_begin = lent_end = nullptr;
  }

 private:
  /// Unmaps the pages; of lent pages only the memory is freed.
  void give_back(double* pages, std::size_t bytes) const {
    double* const end = advance(pages, bytes);
    double* const lent = std::clamp(lent_begin, pages, end);
    double* const after = std::clamp(lent_end, pages, end);
    if (pages < lent) munmap(pages, count_bytes(pages, lent));
    if (lent < after) madvise(lent, count_bytes(lent, after), MADV_DONTNEED);
    if (after < end) munmap(after, count_bytes(after, end));
  }
  /// Removes the first `bytes` of a run.
  void cut(std::map<double*, std::size_t>::iterator at, std::size_t bytes) {
    auto run = runs.extract(at);
    run.key() = advance(run.key(), bytes);
    run.mapped() -= bytes;
    if (run.mapped() > 0) runs.insert(std::move(run));
  }
  /// Keeps pages that are not lent.
  void keep(double* begin, double* end) noexcept {
    if (begin < end && !add(begin, count_bytes(begin, end))) munmap(begin, count_bytes(begin, end));
  }
  /// False if the heap is out of memory.
  bool add(double* pages, std::size_t bytes) noexcept {
    try {
      runs.emplace(pages, bytes);
      return true;
    } catch (const std::bad_alloc&) {
      return false;
    }
  }
};

Kept& get_kept() {
  static thread_local Kept kept;
  return kept;
}

/// Fresh system memory, in large pages where available; null if there is none. bytes: a multiple of the page size.
double* map_pages(std::size_t bytes) {
  const std::size_t mapped = bytes + kLargePage;
  void* all = mmap(nullptr, mapped, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (all == MAP_FAILED) return nullptr;
  const auto address = reinterpret_cast<std::uintptr_t>(all);
  const std::size_t before = round_up(address, kLargePage) - address;
  double* pages = advance(static_cast<double*>(all), before);
  if (before > 0) munmap(all, before);
  if (mapped > before + bytes) munmap(advance(pages, bytes), mapped - before - bytes);
  madvise(pages, bytes, MADV_HUGEPAGE);
  return pages;
}

}  // namespace

BufferReuse::BufferReuse() { get_kept().is_active = true; }
BufferReuse::~BufferReuse() {
  Kept& kept = get_kept();
  kept.is_active = false;
  kept.end_loan();
}
void BufferReuse::give_back_waiting() { get_kept().clear(); }

Buffer::Buffer(std::int64_t count, Pages pages_come) : size_(count) {
  if (count == 0) return;
  constexpr std::size_t kAlignment = 64;
  const std::size_t bytes = sizeof(double) * static_cast<std::size_t>(count);
  if (bytes < kMapped) {
    data_.reset(static_cast<double*>(std::aligned_alloc(kAlignment, round_up(bytes, kAlignment))));
    if (data_ == nullptr) throw std::bad_alloc();
    return;
  }
  Kept& kept = get_kept();
  const std::size_t mapped = round_up(bytes, kPage);
  double* pages = kept.take(mapped);
  is_fresh_ = pages == nullptr;
  if (is_fresh_) {
    kept.release(mapped);  // resident memory, kept pages included, never exceeds the peak in use
    pages = map_pages(mapped);
  }
  if (pages == nullptr && !kept.runs.empty()) {
    kept.clear();
    pages = map_pages(mapped);
  }
  if (pages == nullptr) throw std::bad_alloc();
  data_ = {pages, FreeNumbers{mapped}};
  if (is_fresh_ && pages_come == Pages::kAtOnce) populate();
}

void Buffer::populate() const {
  const std::size_t mapped = data_.get_deleter().mapped_bytes;
  if (mapped > 0 && madvise(data_.get(), mapped, MADV_POPULATE_WRITE) != 0 && errno == ENOMEM) throw std::bad_alloc();
}

void Buffer::give_back_tail(std::int64_t count) const {
  const std::size_t kept_bytes = round_up(sizeof(double) * static_cast<std::size_t>(count), kPage);
  const std::size_t mapped = data_.get_deleter().mapped_bytes;
  if (kept_bytes < mapped) madvise(advance(data_.get(), kept_bytes), mapped - kept_bytes, MADV_DONTNEED);
}

void Buffer::lend_tail(std::int64_t count) const {
  const std::size_t kept_bytes = round_up(sizeof(double) * static_cast<std::size_t>(count), kPage);
  const std::size_t mapped = data_.get_deleter().mapped_bytes;
  Kept& kept = get_kept();
  if (kept_bytes >= mapped || !kept.is_active || kept.lent_begin != nullptr) return;
  kept.lent_begin = advance(data_.get(), kept_bytes);
  kept.lent_end = advance(data_.get(), mapped);
  kept.put(kept.lent_begin, mapped - kept_bytes);
}

Buffer Buffer::make_zero(std::int64_t count) {
  Buffer zero(count, Pages::kAtOnce);
  if (!zero.is_fresh_) std::fill_n(zero.data(), count, 0.0);
  return zero;
}

void FreeNumbers::operator()(double* p) const {
  if (mapped_bytes == 0)
    std::free(p);
  else
    get_kept().put(p, mapped_bytes);
}

}  // namespace carillon::ldlt
