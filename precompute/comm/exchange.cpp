// Source: find_owners uses the rendezvous of Pinar and Hendrickson 2001, as in the distributed directory of Zoltan.
#include "precompute/comm/exchange.hpp"

#include <cstring>
#include <new>
#include <unordered_map>

namespace carillon::comm {
namespace {

constexpr int kExchangeTag = 7101, kHandshakeTag = 7102;

}  // namespace

Exchange::Exchange(const Communicator& comm, std::vector<std::int64_t> sent_begin, std::size_t block_bytes)
    : comm_(comm), rank_(comm.rank()), sent_begin_(std::move(sent_begin)), messages_(block_bytes) {
  const std::size_t ranks = comm.size();
  std::vector<std::int64_t> sent, received;
  comm.agree([&] {
    for (std::size_t r = 0; r < ranks; ++r) sent.push_back(sent_begin_[r + 1] - sent_begin_[r]);
    received.resize(ranks);
    received_begin_.assign(ranks + 1, 0);
  });
  MPI_Alltoall(sent.data(), 1, MPI_INT64_T, received.data(), 1, MPI_INT64_T, comm_);
  std::partial_sum(received.begin(), received.end(), received_begin_.begin() + 1);
}

void Exchange::reserve(std::size_t item_bytes) {
  const std::size_t items = sent_count() + received_count();
  messages_.reserve(2 * sent_begin_.size(), items * item_bytes);
}

void Exchange::run(const std::vector<std::int64_t>& from, const void* sent, const std::vector<std::int64_t>& to, void* received,
                   std::size_t item_bytes) {
  const auto find_bytes = [&](const std::vector<std::int64_t>& begin, std::size_t r) {
    return std::pair(static_cast<std::size_t>(begin[r]) * item_bytes, static_cast<std::size_t>(begin[r + 1] - begin[r]) * item_bytes);
  };
  const std::size_t own = rank_;
  for (std::size_t r = 0; r + 1 < to.size(); ++r) {
    const auto [at, bytes] = find_bytes(to, r);
    if (r != own) messages_.receive(comm_, static_cast<char*>(received) + at, bytes, static_cast<int>(r), kExchangeTag);
  }
  for (std::size_t r = 0; r + 1 < from.size(); ++r) {
    const auto [at, bytes] = find_bytes(from, r);
    if (r != own) messages_.send(comm_, static_cast<const char*>(sent) + at, bytes, static_cast<int>(r), kExchangeTag);
  }
  const auto [sent_at, bytes] = find_bytes(from, own);
  if (bytes > 0) std::memcpy(static_cast<char*>(received) + find_bytes(to, own).first, static_cast<const char*>(sent) + sent_at, bytes);
  messages_.wait();
}

std::vector<std::int32_t> find_owners(const Communicator& comm, const std::vector<std::int32_t>& owned,
                                      const std::vector<std::int32_t>& wanted) {
  const auto find_meeting_place = [&](std::int32_t number) { return number % comm.size(); };
  const auto announced = all_to_all(comm, owned, find_meeting_place);
  const auto owner_of = comm.agree([&] {
    std::unordered_map<std::int32_t, std::int32_t> owners;
    for (int r = 0; r < comm.size(); ++r)
      for (const std::int32_t number : announced.of(r)) owners[number] = r;
    return owners;
  });
  return query_owners<std::int32_t>(comm, wanted, find_meeting_place, [&](std::int32_t number) { return owner_of.at(number); });
}

namespace detail {

void send_with_handshake(const Communicator& comm, const std::vector<std::byte>* bytes, int to) {
  const std::int64_t size = bytes == nullptr ? -1 : static_cast<std::int64_t>(bytes->size());
  MPI_Send(&size, 1, MPI_INT64_T, to, kHandshakeTag, comm);
  if (bytes == nullptr) return;
  int has_room = 0;
  MPI_Recv(&has_room, 1, MPI_INT, to, kHandshakeTag, comm, MPI_STATUS_IGNORE);
  if (has_room == 0) return;
  for_blocks(bytes->size(), kBlockBytes,
             [&](std::size_t at, int count) { MPI_Send(bytes->data() + at, count, MPI_BYTE, to, kHandshakeTag, comm); });
}

bool receive_with_handshake(const Communicator& comm, std::vector<std::byte>& bytes, int from) {
  std::int64_t size = 0;
  MPI_Recv(&size, 1, MPI_INT64_T, from, kHandshakeTag, comm, MPI_STATUS_IGNORE);
  if (size < 0) return false;
  int has_room = 1;
  try {
    bytes.resize(size);
  } catch (const std::bad_alloc&) {
    has_room = 0;
  }
  MPI_Send(&has_room, 1, MPI_INT, from, kHandshakeTag, comm);
  if (has_room == 0) throw std::bad_alloc();
  for_blocks(bytes.size(), kBlockBytes, [&](std::size_t at, int count) {
    MPI_Recv(bytes.data() + at, count, MPI_BYTE, from, kHandshakeTag, comm, MPI_STATUS_IGNORE);
  });
  return true;
}

}  // namespace detail

}  // namespace carillon::comm
