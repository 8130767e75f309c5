// Values shared by several ranks: each has one owner, the other ranks keep copies, their halo.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/comm/exchange.hpp"
#include "precompute/comm/index_partition.hpp"

namespace carillon::comm {

/// Numbers of other ranks, and the places of their local copies.
struct Halo {
  std::vector<std::int32_t> number;  // (h) unique
  std::vector<std::int32_t> owner;   // (h) another rank
  std::vector<std::int32_t> place;   // (h) index into the arrays of values
};

/// Copies values from owners to halos and sums them in the opposite direction. Values are arrays (places, width). After construction, each
/// rank communicates only with its neighbours, and exchanges within the reserved size do not allocate.
class HaloExchange {
 public:
  HaloExchange() = default;  // a rank without neighbours
  /// Own numbers are at find_own_place(number). Collective.
  template <typename FindOwnPlace>
  HaloExchange(const Communicator& comm, const Halo& halo, FindOwnPlace&& find_own_place, std::size_t block_bytes = kBlockBytes)
      : comm_(comm), messages_(block_bytes) {
    if (comm.size() == 1) return;
    std::vector<std::size_t> source;
    const auto wanted = comm.agree([&] {
      std::vector<Wanted> list;
      for (std::size_t i = 0; i < halo.number.size(); ++i) list.push_back({halo.number[i], halo.owner[i]});
      return sort_by_receiver(
          comm.size(), list, [](const Wanted& one) { return one.owner; }, &source);
    });
    const auto asked = all_to_all(comm, wanted);
    comm.agree([&] {
      for (int r = 0; r < comm.size(); ++r) {
        Neighbour neighbour;
        neighbour.rank = r;
        for (std::int64_t k = wanted.begin[r]; k < wanted.begin[r + 1]; ++k) neighbour.halo.push_back(halo.place[source[k]]);
        for (const Wanted& one : asked.of(r)) neighbour.owned.push_back(find_own_place(one.number));
        add(std::move(neighbour));
      }
    });
  }
  /// Contiguous numbers per rank: own number i is at place own_begin + i - owners.own_begin(). Collective.
  HaloExchange(const Communicator& comm, const IndexPartition& owners, std::span<const std::int32_t> halo_numbers,
               std::span<const std::int32_t> halo_places, std::int32_t own_begin = 0);

  bool has_neighbours() const { return !neighbours_.empty(); }

  /// Reserves memory for items of this size (width times the size of a value), so that later calls do not allocate. Local.
  void reserve(std::size_t item_bytes);

  /// Copies owner values to halo places. Collective. `begin` sends and `end` waits for the received values: work in between must not touch
  /// the values at halo places or use this object for another exchange.
  template <Plain T>
  void begin_copy_to_halo(T* values, std::size_t width) {
    begin_copy(reinterpret_cast<std::byte*>(values), width * sizeof(T));
  }
  template <Plain T>
  void end_copy_to_halo(T* values, std::size_t width) {
    end_copy(reinterpret_cast<std::byte*>(values), width * sizeof(T));
  }
  template <Plain T>
  void copy_to_halo(T* values, std::size_t width) {
    begin_copy_to_halo(values, width);
    end_copy_to_halo(values, width);
  }

  /// Adds the values of all copies to the owner's value, in rank order. Collective.
  void sum_to_owner(float* values, std::size_t width);
  void sum_to_owner(double* values, std::size_t width);
  /// The same, and then copies the sum to all halos. Collective.
  template <typename T>
  void sum(T* values, std::size_t width) {
    sum_to_owner(values, width);
    copy_to_halo(values, width);
  }

 private:
  struct Wanted {
    std::int32_t number, owner;
  };
  struct Neighbour {
    int rank = 0;
    std::vector<std::int32_t> halo;   // places of local copies of the neighbour's values
    std::vector<std::int32_t> owned;  // places of own values copied by the neighbour, in its order
    bool is_halo_one_run = false;     // halo places are contiguous: received in place
  };
  void add(Neighbour neighbour);
  void begin_copy(std::byte* values, std::size_t item_bytes);
  void end_copy(std::byte* values, std::size_t item_bytes);
  template <typename T>
  void add_to_owner(T* values, std::size_t width);

  MPI_Comm comm_ = MPI_COMM_NULL;
  std::vector<Neighbour> neighbours_;
  std::size_t halo_count_ = 0, owned_count_ = 0;  // of all neighbours
  std::vector<std::byte> sent_, received_;
  Messages messages_;
};

}  // namespace carillon::comm
