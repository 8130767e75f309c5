// Values of numbers that several ranks use: each has one owner, the others keep copies, their halo.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/comm/exchange.hpp"
#include "precompute/comm/index_partition.hpp"

namespace carillon::comm {

/// Numbers of other ranks, and where this rank keeps its copies of them.
struct Halo {
  std::vector<std::int32_t> number;  // (h) each once
  std::vector<std::int32_t> owner;   // (h) a rank, never this one
  std::vector<std::int32_t> place;   // (h) into the arrays of values
};

/// Copies values from owners to halos and sums them the other way. Values are arrays (places, width). Once made, each rank talks to its
/// neighbours only, and what fits the room reserved allocates nothing.
class HaloExchange {
 public:
  HaloExchange() = default;  // of a rank without neighbours
  /// owned: places of the numbers that this rank owns, as find_own_place(number) returns them. Collective.
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
  /// Numbers in one run per rank: own number i is at place own_begin + i - owners.own_begin(). Collective.
  HaloExchange(const Communicator& comm, const IndexPartition& owners, std::span<const std::int32_t> halo_numbers,
               std::span<const std::int32_t> halo_places, std::int32_t own_begin = 0);

  bool has_neighbours() const { return !neighbours_.empty(); }

  /// Makes room for items of so many bytes (width times the size of a value), so that what follows does not allocate. Local.
  void reserve(std::size_t item_bytes);

  /// Halo places get what the owner has. Collective; `begin` sends, `end` waits for what comes: work that needs no halo may go between, and
  /// leaves the values at halo places alone. No other exchange of this object may go between.
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

  /// Adds to the owner's value those of all copies, in the order of the ranks. Collective.
  void sum_to_owner(float* values, std::size_t width);
  void sum_to_owner(double* values, std::size_t width);
  /// The same, and every copy gets the sum. Collective.
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
    std::vector<std::int32_t> halo;   // places of our copies of what it owns
    std::vector<std::int32_t> owned;  // places of what we own and it keeps copies of, in its order
    bool is_halo_one_run = false;     // halo places follow each other: they are received where they belong
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
