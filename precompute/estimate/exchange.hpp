// Values at nodes that several ranks touch: copied from their owner, or summed over all. Found by node numbers, so that held nodes count
// too.
#pragma once

#include <mpi.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "precompute/fem/distribute.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::estimate {

/// MPI counts in int: longer messages go in pieces of so many bytes.
inline constexpr std::size_t kPieceBytes = std::size_t{1} << 30;

/// Calls post(first byte, bytes) for every piece of `bytes`.
template <typename Post>
void for_pieces(std::size_t bytes, std::size_t piece_bytes, const Post& post) {
  for (std::size_t at = 0; at < bytes; at += piece_bytes) post(at, static_cast<int>(std::min(piece_bytes, bytes - at)));
}

/// Sends out[r] to rank r and returns what came, by rank. T: trivially copyable. Collective. Throws on every rank when memory runs out on
/// one.
template <typename T>
std::vector<std::vector<T>> exchange_lists(MPI_Comm comm, const std::vector<std::vector<T>>& out, std::size_t piece_bytes = kPieceBytes) {
  static_assert(std::is_trivially_copyable_v<T>);
  constexpr int kTag = 72;
  const std::size_t ranks = out.size();
  std::vector<std::int64_t> sent(ranks), got(ranks);
  for (std::size_t r = 0; r < ranks; ++r) sent[r] = static_cast<std::int64_t>(out[r].size());
  MPI_Alltoall(sent.data(), 1, MPI_INT64_T, got.data(), 1, MPI_INT64_T, comm);
  std::vector<std::vector<T>> in;
  std::vector<MPI_Request> requests;
  petsc::run_agreed(comm, [&] {
    in.resize(ranks);
    std::size_t messages = 0;
    for (std::size_t r = 0; r < ranks; ++r) {
      in[r].resize(static_cast<std::size_t>(got[r]));
      messages += 2 + (in[r].size() + out[r].size()) * sizeof(T) / piece_bytes;
    }
    requests.reserve(messages);
  });
  for (std::size_t r = 0; r < ranks; ++r) {
    auto* bytes = reinterpret_cast<char*>(in[r].data());
    for_pieces(in[r].size() * sizeof(T), piece_bytes, [&](std::size_t at, int count) {
      MPI_Irecv(bytes + at, count, MPI_BYTE, static_cast<int>(r), kTag, comm, &requests.emplace_back());
    });
  }
  for (std::size_t r = 0; r < ranks; ++r) {
    const auto* bytes = reinterpret_cast<const char*>(out[r].data());
    for_pieces(out[r].size() * sizeof(T), piece_bytes, [&](std::size_t at, int count) {
      MPI_Isend(bytes + at, count, MPI_BYTE, static_cast<int>(r), kTag, comm, &requests.emplace_back());
    });
  }
  MPI_Waitall(static_cast<int>(requests.size()), requests.data(), MPI_STATUSES_IGNORE);
  return in;
}

/// The halo of a LocalMesh as messages between owners and users. Each rank talks with its neighbours only, once it is made.
class NodeExchange {
 public:
  /// place: (nodes) where in the arrays of values a node has its own; -1: it has none, on any rank. Collective.
  NodeExchange(MPI_Comm comm, const fem::LocalMesh& local, const std::vector<std::int32_t>& place, std::size_t piece_bytes = kPieceBytes);

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
  std::size_t piece_bytes_;
  std::vector<Neighbour> neighbours_;
  std::vector<char> send_, receive_;
  std::vector<MPI_Request> requests_;
};

}  // namespace carillon::estimate
