// Source: MPI 3.1.
#include "precompute/comm/communicator.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <numeric>

#include "precompute/comm/messages.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/result.hpp"

namespace carillon::comm {
namespace {

/// Throws the error of the lowest failing rank on every rank.
void agree_on(const Communicator& comm, base::Result failure) {
  const int first = comm.min(std::int32_t{failure.kind == base::ResultKind::done ? comm.size() : comm.rank()});
  if (first == comm.size()) return;
  std::array<double, 5> header{static_cast<double>(failure.kind), static_cast<double>(failure.message.size()),
                               static_cast<double>(failure.place.size()), failure.need_bytes, static_cast<double>(failure.possible_nodes)};
  MPI_Bcast(header.data(), static_cast<int>(header.size()), MPI_DOUBLE, first, comm);
  failure.kind = static_cast<base::ResultKind>(header[0]);
  failure.message.resize(header[1]);
  failure.place.resize(header[2]);
  failure.need_bytes = header[3];
  failure.possible_nodes = static_cast<std::int64_t>(header[4]);
  for (std::string* text : {&failure.message, &failure.place})
    MPI_Bcast(text->data(), static_cast<int>(text->size()), MPI_CHAR, first, comm);
  base::throw_error(failure);
}

}  // namespace

Communicator::Communicator(MPI_Comm comm) : comm_(comm) {
  MPI_Comm_rank(comm, &rank_);
  MPI_Comm_size(comm, &size_);
}

bool Communicator::all(bool ok) const { return min(std::int32_t{ok}) == 1; }

void Communicator::agree(const std::string& error_text) const {
  agree_on(*this, {error_text.empty() ? base::ResultKind::done : base::ResultKind::bad_input, error_text});
}

void Communicator::agree(std::exception_ptr error) const {
  agree_on(*this, error
                      ? base::describe_error(error, "Out of memory. Take a coarser mesh, a narrower band, or more ranks on more machines.")
                      : base::Result{});
}

void Communicator::reduce(void* values, std::size_t count, MPI_Datatype type, MPI_Op operation) const {
  MPI_Allreduce(MPI_IN_PLACE, values, static_cast<int>(count), type, operation, comm_);
}

void Communicator::broadcast_bytes(void* data, std::size_t bytes) const {
  auto* at = static_cast<char*>(data);
  for_blocks(bytes, kBlockBytes, [&](std::size_t begin, int count) { MPI_Bcast(at + begin, count, MPI_BYTE, 0, comm_); });
}

std::string Communicator::broadcast(std::string text) const {
  const auto count = broadcast(static_cast<std::int64_t>(text.size()));
  agree([&] { text.resize(count); });
  broadcast_bytes(text.data(), text.size());
  return text;
}

std::vector<std::string> Communicator::broadcast(std::vector<std::string> texts) const {
  auto [lengths, joined] = agree([&] {
    std::pair<std::vector<std::int64_t>, std::string> packed;
    for (const std::string& text : texts) {
      packed.first.push_back(static_cast<std::int64_t>(text.size()));
      packed.second += text;
    }
    return packed;
  });
  lengths = broadcast(std::move(lengths));
  joined = broadcast(std::move(joined));
  return agree([&, &lengths = lengths, &joined = joined] {
    std::vector<std::string> all;
    std::size_t at = 0;
    for (const std::int64_t length : lengths) {
      all.push_back(joined.substr(at, length));
      at += static_cast<std::size_t>(length);
    }
    return all;
  });
}

Communicator::Gathering Communicator::plan_gathering(std::size_t own_bytes) const {
  Gathering gathering;
  agree([&] {
    gathering.bytes.resize(size_);
    gathering.begin.assign(size_ + 1, 0);
    if (own_bytes > INT32_MAX) throw SystemError(fmt::format("{} bytes are too many to gather on every rank; start more ranks", own_bytes));
  });
  const int own = static_cast<int>(own_bytes);
  MPI_Allgather(&own, 1, MPI_INT, gathering.bytes.data(), 1, MPI_INT, comm_);
  agree([&] {
    const auto total = std::accumulate(gathering.bytes.begin(), gathering.bytes.end(), std::int64_t{0});
    if (total > INT32_MAX) throw SystemError(fmt::format("{} bytes are too many to gather on every rank; start fewer ranks", total));
    std::partial_sum(gathering.bytes.begin(), gathering.bytes.end(), gathering.begin.begin() + 1);
  });
  return gathering;
}

void Communicator::all_gather_bytes(const void* own, const Gathering& gathering, void* all) const {
  MPI_Allgatherv(own, gathering.bytes[rank_], MPI_BYTE, all, gathering.bytes.data(), gathering.begin.data(), MPI_BYTE, comm_);
}

}  // namespace carillon::comm
