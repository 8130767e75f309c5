#include "precompute/ldlt/buffer.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <new>

namespace carillon::ldlt {
namespace {

constexpr std::size_t kMostKept = std::size_t{256} << 20;

/// Pages that wait for their next use, by size.
struct Kept {
  bool is_active = false;
  std::size_t bytes = 0;
  std::multimap<std::size_t, double*> pages;

  /// Pages of at least `wanted` bytes and at most twice that; null: there are none.
  double* take(std::size_t& wanted) {
    const auto at = pages.lower_bound(wanted);
    if (at == pages.end() || at->first > 2 * wanted) return nullptr;
    wanted = at->first;
    double* taken = at->second;
    bytes -= at->first;
    pages.erase(at);
    return taken;
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

}  // namespace

BufferReuse::BufferReuse() { get_kept().is_active = true; }
BufferReuse::~BufferReuse() {
  get_kept().is_active = false;
  get_kept().clear();
}

Buffer::Buffer(std::int64_t count, Pages pages_come) : size_(count) {
  if (count == 0) return;
  // Pages of the usual size: large ones made the solves 5 % faster, and the first factorisation up to twice as slow.
  constexpr std::size_t kAlignment = 64;
  constexpr std::size_t kMapped = 1 << 20;
  const std::size_t bytes = sizeof(double) * static_cast<std::size_t>(count);
  if (bytes < kMapped) {
    data_.reset(static_cast<double*>(std::aligned_alloc(kAlignment, (bytes + kAlignment - 1) / kAlignment * kAlignment)));
    if (data_ == nullptr) throw std::bad_alloc();
    return;
  }
  std::size_t mapped = bytes;
  if (double* kept = get_kept().is_active ? get_kept().take(mapped) : nullptr) {
    data_ = {kept, FreeNumbers{mapped}};
    return;
  }
  const int populate = pages_come == Pages::kAtOnce ? MAP_POPULATE : 0;
  void* pages = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | populate, -1, 0);
  if (pages == MAP_FAILED && !get_kept().pages.empty()) {
    get_kept().clear();
    pages = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | populate, -1, 0);
  }
  if (pages == MAP_FAILED) throw std::bad_alloc();
  data_ = {static_cast<double*>(pages), FreeNumbers{bytes}};
  is_fresh_ = true;
}

Buffer Buffer::make_zero(std::int64_t count) {
  Buffer zero(count, Pages::kAtOnce);
  if (!zero.is_fresh_) std::fill_n(zero.data(), count, 0.0);
  return zero;
}

void FreeNumbers::operator()(double* p) const {
  if (mapped_bytes == 0) {
    std::free(p);
    return;
  }
  Kept& kept = get_kept();
  if (kept.is_active && kept.bytes + mapped_bytes <= kMostKept) {
    kept.pages.emplace(mapped_bytes, p);
    kept.bytes += mapped_bytes;
  } else {
    munmap(p, mapped_bytes);
  }
}

}  // namespace carillon::ldlt
