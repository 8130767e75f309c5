// Method: owners announce their nodes at a meeting place (rank = number modulo ranks), users ask there who owns theirs; afterwards every
// rank
//   exchanges with its neighbours alone.
// Source: the rendezvous of Pinar and Hendrickson 2001, as Zoltan's distributed directory.
// Deviations: none.
#include "precompute/estimate/exchange.hpp"

#include <algorithm>
#include <cstring>
#include <unordered_map>

namespace carillon::estimate {

NodeExchange::NodeExchange(MPI_Comm comm, const fem::LocalMesh& local, const std::vector<std::int32_t>& place, std::size_t piece_bytes)
    : comm_(comm), piece_bytes_(piece_bytes) {
  int ranks = 1;
  MPI_Comm_size(comm, &ranks);
  if (ranks == 1) return;
  using Lists = std::vector<std::vector<std::int32_t>>;
  Lists announced, asked, asked_local;
  petsc::run_agreed(comm, [&] {
    for (Lists* lists : {&announced, &asked, &asked_local}) lists->resize(ranks);
    for (std::int32_t n = 0; n < static_cast<std::int32_t>(local.nodes_m.size()); ++n) {
      const std::int32_t id = local.node_in_mesh[n];
      if (n < local.owned_nodes) {
        announced[id % ranks].push_back(id);
      } else if (place[n] >= 0) {
        asked[id % ranks].push_back(id);
        asked_local[id % ranks].push_back(place[n]);
      }
    }
  });
  const Lists known = exchange_lists(comm, announced);
  const Lists questions = exchange_lists(comm, asked);
  Lists answers;
  petsc::run_agreed(comm, [&] {
    std::unordered_map<std::int32_t, std::int32_t> owner_of;
    for (int r = 0; r < ranks; ++r)
      for (const std::int32_t id : known[r]) owner_of[id] = r;
    answers.resize(ranks);
    for (int r = 0; r < ranks; ++r)
      for (const std::int32_t id : questions[r]) answers[r].push_back(owner_of.at(id));
  });
  const Lists owners = exchange_lists(comm, answers);

  Lists halo, halo_ids;
  petsc::run_agreed(comm, [&] {
    for (Lists* lists : {&halo, &halo_ids}) lists->resize(ranks);
    for (int r = 0; r < ranks; ++r)
      for (std::size_t i = 0; i < owners[r].size(); ++i) {
        halo[owners[r][i]].push_back(asked_local[r][i]);
        halo_ids[owners[r][i]].push_back(asked[r][i]);
      }
  });
  const Lists wanted = exchange_lists(comm, halo_ids);
  petsc::run_agreed(comm, [&] {
    std::unordered_map<std::int32_t, std::int32_t> local_of;
    for (std::int32_t n = 0; n < local.owned_nodes; ++n) local_of[local.node_in_mesh[n]] = place[n];
    for (int r = 0; r < ranks; ++r) {
      if (halo[r].empty() && wanted[r].empty()) continue;
      Neighbour neighbour{r, std::move(halo[r]), {}};
      for (const std::int32_t id : wanted[r]) neighbour.owned.push_back(local_of.at(id));
      neighbours_.push_back(std::move(neighbour));
    }
  });
}

void NodeExchange::reserve(std::size_t width) {
  std::size_t halo = 0, owned = 0;
  for (const Neighbour& neighbour : neighbours_) {
    halo += neighbour.halo.size();
    owned += neighbour.owned.size();
  }
  const std::size_t bytes = std::max(halo, owned) * width * sizeof(double);
  if (send_.size() < bytes) {
    send_.resize(bytes);
    receive_.resize(bytes);
  }
  requests_.reserve(2 * (neighbours_.size() + bytes / piece_bytes_));
}

template <typename T, typename Take>
void NodeExchange::pass(T* values, std::size_t width, std::vector<std::int32_t> Neighbour::*from, std::vector<std::int32_t> Neighbour::*to,
                        const Take& take) {
  constexpr int kTag = 71;
  T* receive = reinterpret_cast<T*>(receive_.data());
  char* arriving = receive_.data();
  requests_.clear();
  for (const Neighbour& neighbour : neighbours_) {
    const std::size_t bytes = (neighbour.*to).size() * width * sizeof(T);
    for_pieces(bytes, piece_bytes_, [&](std::size_t at, int count) {
      MPI_Irecv(arriving + at, count, MPI_BYTE, neighbour.rank, kTag, comm_, &requests_.emplace_back());
    });
    arriving += bytes;
  }
  char* leaving = send_.data();
  for (const Neighbour& neighbour : neighbours_) {
    char* end = leaving;
    for (const std::int32_t node : neighbour.*from) {
      std::memcpy(end, values + static_cast<std::size_t>(node) * width, width * sizeof(T));
      end += width * sizeof(T);
    }
    for_pieces(static_cast<std::size_t>(end - leaving), piece_bytes_, [&](std::size_t at, int count) {
      MPI_Isend(leaving + at, count, MPI_BYTE, neighbour.rank, kTag, comm_, &requests_.emplace_back());
    });
    leaving = end;
  }
  std::size_t at = 0;
  MPI_Waitall(static_cast<int>(requests_.size()), requests_.data(), MPI_STATUSES_IGNORE);
  for (const Neighbour& neighbour : neighbours_)
    for (const std::int32_t node : neighbour.*to) {
      take(values + static_cast<std::size_t>(node) * width, receive + at);
      at += width;
    }
}

template <typename T>
void NodeExchange::copy_to_halo(T* values, std::size_t width) {
  if (neighbours_.empty()) return;
  reserve(width);
  pass(values, width, &Neighbour::owned, &Neighbour::halo, [&](T* to, const T* from) { std::memcpy(to, from, width * sizeof(T)); });
}

template <typename T>
void NodeExchange::sum(T* values, std::size_t width) {
  if (neighbours_.empty()) return;
  reserve(width);
  pass(values, width, &Neighbour::halo, &Neighbour::owned, [&](T* to, const T* from) {
    for (std::size_t i = 0; i < width; ++i) to[i] += from[i];
  });
  copy_to_halo(values, width);
}

template void NodeExchange::copy_to_halo(float*, std::size_t);
template void NodeExchange::copy_to_halo(double*, std::size_t);
template void NodeExchange::sum(float*, std::size_t);
template void NodeExchange::sum(double*, std::size_t);

}  // namespace carillon::estimate
