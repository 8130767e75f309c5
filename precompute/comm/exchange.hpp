// All-to-all exchange of items, and queries to the owners of numbers.
//
//   const auto find_owner = [&](std::int32_t node) { return owners.find_owner(node); };
//   const auto arrived = comm::all_to_all(comm, [&] { return list_faces(mesh); }, [&](const Face& face) { return find_owner(face.a); });
//   const auto x = comm::query_owners<Vec3>(comm, nodes, find_owner, [&](std::int32_t node) { return own_m[owners.to_local(node)]; });
//
// All functions are collective. Callbacks that make, sort or answer items are local work: if one throws on one rank, all ranks throw the
// same error.
#pragma once

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/comm/index_partition.hpp"
#include "precompute/comm/messages.hpp"

namespace carillon::comm {

/// Items sorted by the rank they go to or come from; for one rank in their original order.
template <typename T>
struct ByRank {
  std::vector<T> items;
  std::vector<std::int64_t> begin;  // (ranks + 1) into items

  int rank_count() const { return static_cast<int>(begin.size()) - 1; }
  std::span<const T> of(int rank) const {
    const std::size_t r = rank;
    return std::span(items).subspan(begin[r], begin[r + 1] - begin[r]);
  }
};

/// All-to-all with counts known on both sides: can be repeated and reversed without counting again. Each item goes to one rank.
class Exchange {
 public:
  Exchange() = default;  // one rank, no items
  /// sent_begin: (ranks + 1) first item for each rank, starting at 0. Collective.
  Exchange(const Communicator& comm, std::vector<std::int64_t> sent_begin, std::size_t block_bytes = kBlockBytes);

  std::int64_t sent_count() const { return sent_begin_.back(); }
  std::int64_t received_count() const { return received_begin_.back(); }
  const std::vector<std::int64_t>& received_begin() const { return received_begin_; }

  /// Reserves memory for items of this size, so that later calls do not allocate. Local.
  void reserve(std::size_t item_bytes);
  /// sent: (sent_count, width), received: (received_count, width). Collective.
  template <Plain T>
  void forward(const T* sent, T* received, std::size_t width = 1) {
    run(sent_begin_, sent, received_begin_, received, width * sizeof(T));
  }
  /// Reverse direction: answers return to the senders of the items.
  template <Plain T>
  void backward(const T* answers, T* returned, std::size_t width = 1) {
    run(received_begin_, answers, sent_begin_, returned, width * sizeof(T));
  }

 private:
  void run(const std::vector<std::int64_t>& from, const void* sent, const std::vector<std::int64_t>& to, void* received,
           std::size_t item_bytes);

  MPI_Comm comm_ = MPI_COMM_NULL;
  int rank_ = 0;
  std::vector<std::int64_t> sent_begin_{0, 0}, received_begin_{0, 0};
  Messages messages_;
};

/// Items sorted by receiver; `source`, if not null, gets the original index of each. Local.
template <Plain T, typename FindReceiver>
ByRank<T> sort_by_receiver(int ranks, const std::vector<T>& items, FindReceiver&& find_receiver,
                           std::vector<std::size_t>* source = nullptr) {
  ByRank<T> sorted;
  std::vector<int> receiver(items.size());
  sorted.begin.assign(ranks + 1, 0);
  for (std::size_t i = 0; i < items.size(); ++i) ++sorted.begin[static_cast<std::size_t>(receiver[i] = find_receiver(items[i])) + 1];
  std::partial_sum(sorted.begin.begin(), sorted.begin.end(), sorted.begin.begin());
  std::vector<std::int64_t> next(sorted.begin.begin(), sorted.begin.end() - 1);
  sorted.items.resize(items.size());
  if (source != nullptr) source->resize(items.size());
  for (std::size_t i = 0; i < items.size(); ++i) {
    const std::size_t place = next[receiver[i]]++;
    sorted.items[place] = items[i];
    if (source != nullptr) (*source)[place] = i;
  }
  return sorted;
}

/// Sends items sorted by receiver.
template <Plain T>
ByRank<T> all_to_all(const Communicator& comm, const ByRank<T>& sent) {
  Exchange exchange(comm, sent.begin);
  auto received = comm.agree([&] {
    exchange.reserve(sizeof(T));
    return ByRank<T>{std::vector<T>(exchange.received_count()), exchange.received_begin()};
  });
  exchange.forward(sent.items.data(), received.items.data());
  return received;
}

/// Sends the ByRank returned by `make`.
template <std::invocable Make>
auto all_to_all(const Communicator& comm, Make&& make) {
  return all_to_all(comm, comm.agree(std::forward<Make>(make)));
}

/// Sends every item to rank find_receiver(item). `items`: a vector, or a function that returns one.
template <typename Items, typename FindReceiver>
auto all_to_all(const Communicator& comm, Items&& items, FindReceiver&& find_receiver) {
  return all_to_all(comm, [&] {
    if constexpr (std::is_invocable_v<Items>) {
      return sort_by_receiver(comm.size(), items(), find_receiver);
    } else {
      return sort_by_receiver(comm.size(), items, find_receiver);
    }
  });
}

/// All items on rank 0, in rank order; empty on other ranks.
template <Plain T>
std::vector<T> gather(const Communicator& comm, const std::vector<T>& items) {
  Exchange exchange(comm, comm.agree([&] {
    std::vector<std::int64_t> begin(comm.size() + 1, static_cast<std::int64_t>(items.size()));
    begin.front() = 0;
    return begin;
  }));
  auto received = comm.agree([&] {
    exchange.reserve(sizeof(T));
    return std::vector<T>(exchange.received_count());
  });
  exchange.forward(items.data(), received.data());
  return received;
}

/// Gathers the vector returned by `make`.
template <std::invocable Make>
auto gather(const Communicator& comm, Make&& make) {
  return gather(comm, comm.agree(std::forward<Make>(make)));
}

/// Sends each question to rank find_owner(question), where it is answered by answer(question), which returns one Answer, or by
/// answer(questions), which takes the ByRank of all questions and returns a vector of answers in that order. Returns the answers in the
/// order of the questions.
template <Plain Answer, Plain Question, typename FindOwner, typename FindAnswer>
std::vector<Answer> query_owners(const Communicator& comm, const std::vector<Question>& questions, FindOwner&& find_owner,
                                 FindAnswer&& answer) {
  std::vector<std::size_t> source;
  auto sent = comm.agree([&] { return sort_by_receiver(comm.size(), questions, find_owner, &source); });
  Exchange exchange(comm, sent.begin);
  auto asked = comm.agree([&] {
    exchange.reserve(std::max(sizeof(Question), sizeof(Answer)));
    return ByRank<Question>{std::vector<Question>(exchange.received_count()), exchange.received_begin()};
  });
  exchange.forward(sent.items.data(), asked.items.data());
  std::vector<Answer> replies, returned, answers;
  comm.agree([&] {
    sent = {};
    if constexpr (std::is_invocable_v<FindAnswer, const ByRank<Question>&>) {
      replies = answer(std::as_const(asked));
    } else {
      replies.reserve(asked.items.size());
      for (const Question& question : asked.items) replies.push_back(answer(question));
    }
    asked = {};
    returned.resize(questions.size());
    answers.resize(questions.size());
  });
  exchange.backward(replies.data(), returned.data());
  for (std::size_t i = 0; i < source.size(); ++i) answers[source[i]] = returned[i];
  return answers;
}

/// A value for a number owned by some rank.
template <Plain T>
struct Reported {
  std::int32_t number;
  T value;
};

/// Sends each Reported of the list returned by `make` to rank find_owner(number). Returns `count` values there, at to_local(number); values
/// without a report are `missing`.
template <Plain T, std::invocable Make, typename FindOwner, typename FindLocal>
std::vector<T> report_to_owners(const Communicator& comm, Make&& make, FindOwner&& find_owner, std::int64_t count, FindLocal&& to_local,
                                T missing = {}) {
  const auto arrived = all_to_all(comm, std::forward<Make>(make), [&](const Reported<T>& one) { return find_owner(one.number); });
  return comm.agree([&] {
    std::vector<T> values(count, missing);
    for (const Reported<T>& one : arrived.items) values[to_local(one.number)] = one.value;
    return values;
  });
}
/// The same for the numbers of a partition.
template <Plain T, std::invocable Make>
std::vector<T> report_to_owners(const Communicator& comm, Make&& make, const IndexPartition& owners, T missing = {}) {
  return report_to_owners<T>(
      comm, std::forward<Make>(make), [&](std::int32_t number) { return owners.find_owner(number); }, owners.own_count(),
      [&](std::int32_t number) { return owners.to_local(number); }, missing);
}

/// Owner of each wanted number, given the numbers owned by each rank; numbers are not negative. Every wanted number has one owner. Uses a
/// rendezvous rank for each number (number modulo ranks).
std::vector<std::int32_t> find_owners(const Communicator& comm, const std::vector<std::int32_t>& owned,
                                      const std::vector<std::int32_t>& wanted);

namespace detail {
/// Sends the bytes in three steps, so that neither side waits for one that ran out of memory: their count (null bytes: this side failed),
/// the reply whether memory suffices, and the bytes themselves.
void send_with_handshake(const Communicator& comm, const std::vector<std::byte>* bytes, int to);
/// Receiving side. False if the sender failed. Throws std::bad_alloc after replying that memory does not suffice.
bool receive_with_handshake(const Communicator& comm, std::vector<std::byte>& bytes, int from);
}  // namespace detail

/// Rank 0 calls make(rank) for one rank after the other, its own last, and sends serialise(result); deserialise(bytes) restores the result.
/// Rank 0 holds only one result at a time. Returns the result of this rank. Throws the same error on every rank if any of the three throws
/// or memory runs out on either side.
template <typename Make, typename Serialise, typename Deserialise>
auto scatter_in_turn(const Communicator& comm, Make&& make, Serialise&& serialise, Deserialise&& deserialise) {
  using Result = std::invoke_result_t<Make, int>;
  return comm.agree([&]() -> Result {
    if (!comm.is_root()) {
      std::vector<std::byte> bytes;
      return detail::receive_with_handshake(comm, bytes, 0) ? deserialise(bytes) : Result();  // the error comes from rank 0
    }
    std::exception_ptr error;
    for (int to = 1; to < comm.size(); ++to) {
      std::vector<std::byte> bytes;
      try {
        if (!error) bytes = serialise(make(to));
      } catch (...) {
        error = std::current_exception();
      }
      detail::send_with_handshake(comm, error ? nullptr : &bytes, to);
    }
    if (error) std::rethrow_exception(error);
    return make(0);
  });
}

}  // namespace carillon::comm
