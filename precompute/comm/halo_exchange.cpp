// Method: Every rank sends the owners the list of the numbers that it needs, once; afterwards only values are exchanged, between
// neighbours.
#include "precompute/comm/halo_exchange.hpp"

#include <algorithm>
#include <cstring>

namespace carillon::comm {
namespace {

constexpr int kHaloTag = 7103;

Halo make_halo(const IndexPartition& owners, std::span<const std::int32_t> numbers, std::span<const std::int32_t> places) {
  Halo halo{{numbers.begin(), numbers.end()}, {}, {places.begin(), places.end()}};
  for (const std::int32_t number : numbers) halo.owner.push_back(owners.find_owner(number));
  return halo;
}

/// Copies the items at `places` into a contiguous buffer.
void pack(const std::byte* values, const std::vector<std::int32_t>& places, std::size_t item_bytes, std::byte* out) {
  for (const std::int32_t place : places) {
    std::memcpy(out, values + static_cast<std::size_t>(place) * item_bytes, item_bytes);
    out += item_bytes;
  }
}

}  // namespace

HaloExchange::HaloExchange(const Communicator& comm, const IndexPartition& owners, std::span<const std::int32_t> halo_numbers,
                           std::span<const std::int32_t> halo_places, std::int32_t own_begin)
    : HaloExchange(comm, comm.agree([&] { return make_halo(owners, halo_numbers, halo_places); }),
                   [&](std::int32_t number) { return own_begin + static_cast<std::int32_t>(owners.to_local(number)); }) {}

void HaloExchange::add(Neighbour neighbour) {
  if (neighbour.halo.empty() && neighbour.owned.empty()) return;
  const auto& halo = neighbour.halo;
  neighbour.is_halo_one_run = std::adjacent_find(halo.begin(), halo.end(), [](auto a, auto b) { return b != a + 1; }) == halo.end();
  halo_count_ += halo.size();
  owned_count_ += neighbour.owned.size();
  neighbours_.push_back(std::move(neighbour));
}

void HaloExchange::reserve(std::size_t item_bytes) {
  const std::size_t bytes = std::max(halo_count_, owned_count_) * item_bytes;
  if (sent_.size() < bytes) {
    sent_.resize(bytes);
    received_.resize(bytes);
  }
  messages_.reserve(2 * neighbours_.size(), (halo_count_ + owned_count_) * item_bytes);
}

void HaloExchange::begin_copy(std::byte* values, std::size_t item_bytes) {
  if (neighbours_.empty()) return;
  reserve(item_bytes);
  std::byte* arriving = received_.data();
  for (const Neighbour& neighbour : neighbours_) {
    const std::size_t bytes = neighbour.halo.size() * item_bytes;
    if (bytes == 0) continue;
    std::byte* to = neighbour.is_halo_one_run ? values + static_cast<std::size_t>(neighbour.halo.front()) * item_bytes : arriving;
    messages_.receive(comm_, to, bytes, neighbour.rank, kHaloTag);
    arriving += bytes;
  }
  std::byte* leaving = sent_.data();
  for (const Neighbour& neighbour : neighbours_) {
    const std::size_t bytes = neighbour.owned.size() * item_bytes;
    pack(values, neighbour.owned, item_bytes, leaving);
    messages_.send(comm_, leaving, bytes, neighbour.rank, kHaloTag);
    leaving += bytes;
  }
}

void HaloExchange::end_copy(std::byte* values, std::size_t item_bytes) {
  messages_.wait();
  const std::byte* arrived = received_.data();
  for (const Neighbour& neighbour : neighbours_) {
    if (!neighbour.is_halo_one_run)
      for (std::size_t i = 0; i < neighbour.halo.size(); ++i)
        std::memcpy(values + static_cast<std::size_t>(neighbour.halo[i]) * item_bytes, arrived + i * item_bytes, item_bytes);
    arrived += neighbour.halo.size() * item_bytes;
  }
}

template <typename T>
void HaloExchange::add_to_owner(T* values, std::size_t width) {
  if (neighbours_.empty()) return;
  const std::size_t item_bytes = width * sizeof(T);
  reserve(item_bytes);
  std::byte* arriving = received_.data();
  for (const Neighbour& neighbour : neighbours_) {
    messages_.receive(comm_, arriving, neighbour.owned.size() * item_bytes, neighbour.rank, kHaloTag);
    arriving += neighbour.owned.size() * item_bytes;
  }
  std::byte* leaving = sent_.data();
  for (const Neighbour& neighbour : neighbours_) {
    pack(reinterpret_cast<const std::byte*>(values), neighbour.halo, item_bytes, leaving);
    messages_.send(comm_, leaving, neighbour.halo.size() * item_bytes, neighbour.rank, kHaloTag);
    leaving += neighbour.halo.size() * item_bytes;
  }
  messages_.wait();
  const T* arrived = reinterpret_cast<const T*>(received_.data());
  for (const Neighbour& neighbour : neighbours_)
    for (const std::int32_t place : neighbour.owned) {
      T* to = values + static_cast<std::size_t>(place) * width;
      for (std::size_t i = 0; i < width; ++i) to[i] += arrived[i];
      arrived += width;
    }
}

void HaloExchange::sum_to_owner(float* values, std::size_t width) { add_to_owner(values, width); }
void HaloExchange::sum_to_owner(double* values, std::size_t width) { add_to_owner(values, width); }

}  // namespace carillon::comm
