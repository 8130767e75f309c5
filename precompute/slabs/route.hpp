// Items from every rank to every rank, and questions to the rank that knows. Inner header of the parallel reader.
#pragma once

#include <mpi.h>

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <type_traits>
#include <vector>

#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::slabs {

inline int get_rank(MPI_Comm comm) {
  int rank = 0;
  MPI_Comm_rank(comm, &rank);
  return rank;
}

inline int get_size(MPI_Comm comm) {
  int size = 1;
  MPI_Comm_size(comm, &size);
  return size;
}

/// Numbers 0 ... total - 1 in one run per rank: rank r is home to first[r] ... first[r + 1] - 1.
struct Homes {
  std::vector<std::int64_t> first;  // (ranks + 1), ascending from 0

  int find(std::int64_t number) const { return static_cast<int>(std::upper_bound(first.begin(), first.end(), number) - first.begin()) - 1; }
  std::int64_t total() const { return first.back(); }
};

/// Runs of equal length, to one.
inline Homes make_even_homes(std::int64_t total, int ranks) {
  Homes homes;
  for (int r = 0; r <= ranks; ++r) homes.first.push_back(total / ranks * r + std::min<std::int64_t>(r, total % ranks));
  return homes;
}

/// Runs of the lengths that the ranks bring. Collective.
inline Homes gather_homes(MPI_Comm comm, std::int64_t mine) {
  Homes homes;
  homes.first.assign(static_cast<std::size_t>(get_size(comm)) + 1, 0);
  MPI_Allgather(&mine, 1, MPI_INT64_T, homes.first.data() + 1, 1, MPI_INT64_T, comm);
  std::partial_sum(homes.first.begin(), homes.first.end(), homes.first.begin());
  return homes;
}

template <typename T>
struct Arrived {
  std::vector<T> items;    // by source rank, and of one rank in the order in which they were sent
  std::vector<int> count;  // of each source rank
};

/// Sends items whose receivers are known by count: the first count[0] items go to rank 0, the next count[1] to rank 1, ... Collective.
template <typename T>
Arrived<T> exchange(MPI_Comm comm, const std::vector<T>& items, const std::vector<int>& count) {
  static_assert(std::is_trivially_copyable_v<T>);
  const auto ranks = static_cast<std::size_t>(get_size(comm));
  Arrived<T> arrived;
  std::vector<int> sent_at, got_at;
  petsc::run_agreed(comm, [&] {
    arrived.count.resize(ranks);
    sent_at.assign(ranks + 1, 0);
    got_at.assign(ranks + 1, 0);
  });
  MPI_Alltoall(count.data(), 1, MPI_INT, arrived.count.data(), 1, MPI_INT, comm);
  petsc::run_agreed(comm, [&] {
    std::int64_t total = 0;
    for (const int one : arrived.count) total += one;
    if (std::max<std::int64_t>(total, static_cast<std::int64_t>(items.size())) > INT32_MAX)
      throw SystemError("one rank has to send or take more than 2147483647 items of the mesh; start more ranks");
    std::partial_sum(count.begin(), count.end(), sent_at.begin() + 1);
    std::partial_sum(arrived.count.begin(), arrived.count.end(), got_at.begin() + 1);
    arrived.items.resize(static_cast<std::size_t>(total));
  });
  MPI_Datatype type = MPI_DATATYPE_NULL;
  MPI_Type_contiguous(static_cast<int>(sizeof(T)), MPI_BYTE, &type);
  MPI_Type_commit(&type);
  MPI_Alltoallv(items.data(), count.data(), sent_at.data(), type, arrived.items.data(), arrived.count.data(), got_at.data(), type, comm);
  MPI_Type_free(&type);
  return arrived;
}

/// Sends every item to the rank that `find_receiver(item)` names. `order`, if wanted, becomes the item numbers in the order of sending.
/// Collective.
template <typename T, typename Find>
Arrived<T> route(MPI_Comm comm, const std::vector<T>& items, Find&& find_receiver, std::vector<std::size_t>* order = nullptr) {
  std::vector<int> count;
  std::vector<T> sorted;
  petsc::run_agreed(comm, [&] {
    const auto ranks = static_cast<std::size_t>(get_size(comm));
    std::vector<int> receiver(items.size());
    std::vector<std::size_t> at(ranks + 1, 0);
    for (std::size_t i = 0; i < items.size(); ++i) ++at[static_cast<std::size_t>(receiver[i] = find_receiver(items[i])) + 1];
    count.resize(ranks);
    for (std::size_t r = 0; r < ranks; ++r) count[r] = static_cast<int>(at[r + 1]);
    std::partial_sum(at.begin(), at.end(), at.begin());
    sorted.resize(items.size());
    if (order != nullptr) order->resize(items.size());
    for (std::size_t i = 0; i < items.size(); ++i) {
      const std::size_t place = at[static_cast<std::size_t>(receiver[i])]++;
      sorted[place] = items[i];
      if (order != nullptr) (*order)[place] = i;
    }
  });
  return exchange(comm, sorted, count);
}

/// Asks for every question the rank that `find_home(question)` names; there `answer(question)` is called. Returns the answers in the order
/// of the questions. Collective.
template <typename Answer, typename Question, typename Find, typename Reply>
std::vector<Answer> ask(MPI_Comm comm, const std::vector<Question>& questions, Find&& find_home, Reply&& answer) {
  std::vector<std::size_t> order;
  const Arrived<Question> asked = route(comm, questions, find_home, &order);
  std::vector<Answer> replies;
  petsc::run_agreed(comm, [&] {
    replies.reserve(asked.items.size());
    for (const Question& question : asked.items) replies.push_back(answer(question));
  });
  const Arrived<Answer> back = exchange(comm, replies, asked.count);
  std::vector<Answer> answers;
  petsc::run_agreed(comm, [&] {
    answers.resize(questions.size());
    for (std::size_t i = 0; i < order.size(); ++i) answers[order[i]] = back.items[i];
  });
  return answers;
}

/// All items of all ranks on every rank, in the order of the ranks. For few items. Collective.
template <typename T>
std::vector<T> share(MPI_Comm comm, const std::vector<T>& items) {
  static_assert(std::is_trivially_copyable_v<T>);
  const auto ranks = static_cast<std::size_t>(get_size(comm));
  std::vector<int> bytes, at;
  petsc::run_agreed(comm, [&] {
    bytes.assign(ranks, 0);
    at.assign(ranks + 1, 0);
    if (items.size() * sizeof(T) > INT32_MAX) throw SystemError("too many items for one message");
  });
  const int mine = static_cast<int>(items.size() * sizeof(T));
  MPI_Allgather(&mine, 1, MPI_INT, bytes.data(), 1, MPI_INT, comm);
  std::vector<T> all;
  petsc::run_agreed(comm, [&] {
    std::int64_t total = 0;
    for (const int one : bytes) total += one;
    if (total > INT32_MAX) throw SystemError("too many items for one message: the body is in too many parts");
    std::partial_sum(bytes.begin(), bytes.end(), at.begin() + 1);
    all.resize(static_cast<std::size_t>(total) / sizeof(T));
  });
  MPI_Allgatherv(items.data(), mine, MPI_BYTE, all.data(), bytes.data(), at.data(), MPI_BYTE, comm);
  return all;
}

/// Brings all items to rank 0, in the order of the ranks; empty elsewhere. Collective.
template <typename T>
std::vector<T> collect(MPI_Comm comm, const std::vector<T>& items) {
  return route(comm, items, [](const T&) { return 0; }).items;
}

}  // namespace carillon::slabs
