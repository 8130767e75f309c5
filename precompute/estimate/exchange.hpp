// Values at nodes that several ranks touch: copied from their owner, or summed over all. Found by node numbers, so that held nodes count
// too.
#pragma once

#include <mpi.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "precompute/fem/distribute.hpp"

namespace carillon::estimate {

/// Sends out[r] to rank r and returns what came, by rank. T: trivially copyable. Collective.
template <typename T>
std::vector<std::vector<T>> exchange_lists(MPI_Comm comm, const std::vector<std::vector<T>>& out) {
  const std::size_t ranks = out.size();
  std::vector<int> sent(ranks), sent_at(ranks), got(ranks), got_at(ranks);
  std::vector<T> flat;
  for (std::size_t r = 0; r < ranks; ++r) {
    sent[r] = static_cast<int>(out[r].size() * sizeof(T));
    sent_at[r] = static_cast<int>(flat.size() * sizeof(T));
    flat.insert(flat.end(), out[r].begin(), out[r].end());
  }
  MPI_Alltoall(sent.data(), 1, MPI_INT, got.data(), 1, MPI_INT, comm);
  std::size_t total = 0;
  for (std::size_t r = 0; r < ranks; ++r) {
    got_at[r] = static_cast<int>(total);
    total += static_cast<std::size_t>(got[r]);
  }
  std::vector<T> arrived(total / sizeof(T));
  MPI_Alltoallv(flat.data(), sent.data(), sent_at.data(), MPI_BYTE, arrived.data(), got.data(), got_at.data(), MPI_BYTE, comm);
  std::vector<std::vector<T>> in(ranks);
  for (std::size_t r = 0; r < ranks; ++r) {
    const auto begin = arrived.begin() + static_cast<std::ptrdiff_t>(got_at[r] / sizeof(T));
    in[r].assign(begin, begin + static_cast<std::ptrdiff_t>(got[r] / sizeof(T)));
  }
  return in;
}

/// The halo of a LocalMesh as messages between owners and users. Each rank talks with its neighbours only, once it is made.
class NodeExchange {
 public:
  /// place: (nodes) where in the arrays of values a node has its own; -1: it has none, on any rank. Collective.
  NodeExchange(MPI_Comm comm, const fem::LocalMesh& local, const std::vector<std::int32_t>& place);

  /// Makes room for values of `width` numbers a node, so that what follows does not allocate. Local.
  void reserve(std::size_t width);

  /// values: (places, width). Halo nodes get what their owner has. Collective.
  template <typename T>
  void copy_to_halo(T* values, std::size_t width);

  /// Every copy of a node gets the sum of what all ranks had, in the order of the ranks. Collective.
  template <typename T>
  void sum(T* values, std::size_t width);

 private:
  struct Neighbour {
    int rank = 0;
    std::vector<std::int32_t> halo;   // places of the nodes of ours that it owns
    std::vector<std::int32_t> owned;  // places of the nodes that we own and it uses, in its order
  };
  /// Sends the values at `from` lists and lets `take(node, value pointer)` have what comes for the `to` lists.
  template <typename T, typename Take>
  void pass(T* values, std::size_t width, std::vector<std::int32_t> Neighbour::*from, std::vector<std::int32_t> Neighbour::*to,
            const Take& take);

  MPI_Comm comm_;
  std::vector<Neighbour> neighbours_;
  std::vector<char> send_, receive_;
  std::vector<MPI_Request> requests_;
};

}  // namespace carillon::estimate
