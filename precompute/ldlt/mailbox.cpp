#include "precompute/ldlt/mailbox.hpp"

#include <cstring>
#include <utility>

namespace carillon::ldlt {

Letter::Letter(const Heading& heading, std::int64_t count) : data_(kHeadingNumbers + count) {
  static_assert(sizeof heading <= kHeadingNumbers * sizeof(double));
  std::memcpy(data_.data(), &heading, sizeof heading);
}

Heading Letter::heading() const {
  Heading heading;
  std::memcpy(static_cast<void*>(&heading), data_.data(), sizeof heading);
  return heading;
}

void Mailbox::send(int rank, Letter letter) { send(rank, std::make_shared<const Letter>(std::move(letter))); }

void Mailbox::send(int rank, const std::shared_ptr<const Letter>& letter) {
  Sent& sent = sent_.emplace_back();
  sent.letter = letter;
  const Buffer& data = letter->data();
  MPI_Isend(data.data(), static_cast<int>(data.size()), MPI_DOUBLE, rank, tag_, comm_, &sent.request);
}

std::optional<Letter> Mailbox::receive() {
  int has_come = 0;
  MPI_Message message = MPI_MESSAGE_NULL;
  MPI_Status status;
  MPI_Improbe(MPI_ANY_SOURCE, tag_, comm_, &has_come, &message, &status);
  if (has_come == 0) return std::nullopt;
  fruitless_ = 0;
  int count = 0;
  MPI_Get_count(&status, MPI_DOUBLE, &count);
  try {
    Buffer data(count);
    MPI_Mrecv(data.data(), count, MPI_DOUBLE, &message, MPI_STATUS_IGNORE);
    return Letter(std::move(data));
  } catch (const std::bad_alloc&) {
    // The sender must not block forever. Open MPI aborts if a long message is received into a shorter buffer.
    if (count <= std::ssize(refuge_)) {
      MPI_Mrecv(refuge_.data(), count, MPI_DOUBLE, &message, MPI_STATUS_IGNORE);
      throw;
    }
    // A buffer for one number accepts the message; the rest is truncated.
    double nothing = 0;
    MPI_Errhandler handler = MPI_ERRHANDLER_NULL;
    MPI_Comm_get_errhandler(comm_, &handler);
    MPI_Comm_set_errhandler(comm_, MPI_ERRORS_RETURN);
    MPI_Mrecv(&nothing, 1, MPI_DOUBLE, &message, MPI_STATUS_IGNORE);
    MPI_Comm_set_errhandler(comm_, handler);
    MPI_Errhandler_free(&handler);
    throw;
  }
}

bool Mailbox::release() {
  for (auto at = sent_.begin(); at != sent_.end();) {
    int is_done = 0;
    MPI_Test(&at->request, &is_done, MPI_STATUS_IGNORE);
    at = is_done != 0 ? sent_.erase(at) : std::next(at);
  }
  return sent_.empty();
}

}  // namespace carillon::ldlt
