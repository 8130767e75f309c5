#include "precompute/ldlt/buffer.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <new>
#include <utility>

namespace carillon::ldlt {
namespace {

constexpr std::size_t kMapped = 1 << 20;  // from here on buffers have pages of their own
constexpr std::size_t kMostKept = std::size_t{256} << 20;
const std::size_t kPage = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
constexpr std::size_t kLargePage = std::size_t{2} << 20;

std::size_t round_up(std::size_t bytes, std::size_t to) { return (bytes + to - 1) / to * to; }

double* advance(double* pages, std::size_t bytes) { return pages + bytes / sizeof(double); }

/// Pages that wait for their next use, by size.
struct Kept {
  bool is_active = false;
  std::size_t bytes = 0;
  std::multimap<std::size_t, double*> pages;

  /// The first pages of the smallest run that has enough; what is behind them stays, if a buffer can use it. Null: no run has enough.
  double* take(std::size_t wanted) {
    const auto at = pages.lower_bound(wanted);
    if (at == pages.end()) return nullptr;
    auto run = pages.extract(at);
    double* taken = run.mapped();
    const std::size_t rest = run.key() - wanted;
    bytes -= run.key();
    if (rest >= kMapped) {
      run.key() = rest;
      run.mapped() = advance(taken, wanted);
      pages.insert(std::move(run));
      bytes += rest;
    } else if (rest > 0) {
      munmap(advance(taken, wanted), rest);
    }
    return taken;
  }
  /// As much as there is room for; the rest goes back.
  void put(double* freed, std::size_t size) {
    std::size_t kept = is_active ? std::min(size, kMostKept - bytes) : 0;
    if (kept < kMapped) kept = 0;
    if (kept > 0) pages.emplace(kept, freed);
    bytes += kept;
    if (size > kept) munmap(advance(freed, kept), size - kept);
  }
  void clear() {
    for (const auto& [size, page] : pages) munmap(page, size);
    pages.clear();
    bytes = 0;
  }
};

Kept& get_kept() {
  static thread_local Kept kept;
  return kept;
}

/// Fresh memory of the system, in large pages where it has some; null: there is none. bytes: whole pages.
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
  get_kept().is_active = false;
  get_kept().clear();
}

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
  if (pages == nullptr) pages = map_pages(mapped);
  if (pages == nullptr && !kept.pages.empty()) {
    kept.clear();
    pages = map_pages(mapped);
  }
  if (pages == nullptr) throw std::bad_alloc();
  data_ = {pages, FreeNumbers{mapped}};
  if (is_fresh_ && pages_come == Pages::kAtOnce && madvise(pages, mapped, MADV_POPULATE_WRITE) != 0 && errno == ENOMEM)
    throw std::bad_alloc();
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
