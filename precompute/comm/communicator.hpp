// The ranks of an MPI communicator: agreement on errors, reductions, gather and broadcast.
//
//   const auto parts = comm.agree([&] { return find_parts(mesh); });   // all ranks have their parts, or all throw the same error
//   const auto names = comm.broadcast([&] { return read_names(file); });
#pragma once

#include <mpi.h>

#include <array>
#include <concepts>
#include <cstdint>
#include <exception>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace carillon::comm {

/// Types that can be sent as bytes.
template <typename T>
concept Plain = std::is_trivially_copyable_v<T>;

/// Number types supported by MPI reductions.
template <typename T>
concept Number =
    std::same_as<T, double> || std::same_as<T, std::int32_t> || std::same_as<T, std::int64_t> || std::same_as<T, std::uint64_t>;

/// Numbers of a record that consists of doubles only.
template <Plain T>
std::span<double> list_numbers(T& record) {
  static_assert(sizeof(T) % sizeof(double) == 0 && alignof(T) == alignof(double));
  return {reinterpret_cast<double*>(&record), sizeof(T) / sizeof(double)};
}

/// A communicator (not owned) with rank and size. All methods are collective except the conversions, rank(), size() and is_root(): all
/// ranks call them in the same order. Methods that allocate or run the caller's work either return on all ranks or throw the same error on
/// all ranks, so that no rank waits for a failed one.
class Communicator {
 public:
  /// Implicit conversions in both directions to and from MPI_Comm.
  Communicator(MPI_Comm comm);
  operator MPI_Comm() const { return comm_; }

  int rank() const { return rank_; }
  int size() const { return size_; }
  bool is_root() const { return rank_ == 0; }

  // ---- agreement ----

  /// True on every rank if `ok` was true on every rank.
  bool all(bool ok) const;

  /// Throws the error of the lowest failing rank on every rank (null: this rank did not fail). InputError, PlacedError, SolveError,
  /// SystemError, MemoryError and DiskFullError keep their type, place and need; std::bad_alloc becomes MemoryError, any other exception
  /// SystemError.
  void agree(std::exception_ptr error) const;

  /// Throws InputError(text) on every rank if any rank passes a non-empty text; the text of the lowest such rank is used.
  void agree(const std::string& error_text) const;

  /// Runs `work` on every rank, then agrees: either all ranks get their result or all throw the same error. `work` must not be collective,
  /// unless it throws on all ranks alike.
  template <std::invocable Work>
  auto agree(Work&& work) const {
    using Result = std::invoke_result_t<Work>;
    std::exception_ptr error;
    if constexpr (std::is_void_v<Result>) {
      try {
        work();
      } catch (...) {
        error = std::current_exception();
      }
      agree(error);
    } else {
      std::optional<Result> result;
      try {
        result.emplace(work());
      } catch (...) {
        error = std::current_exception();
      }
      agree(error);
      return std::move(*result);
    }
  }

  // ---- reductions: the same result on every rank ----

  template <Number T>
  T sum(T value) const {
    sum(std::span<T>(&value, 1));
    return value;
  }
  template <Number T>
  T min(T value) const {
    min(std::span<T>(&value, 1));
    return value;
  }
  template <Number T>
  T max(T value) const {
    max(std::span<T>(&value, 1));
    return value;
  }
  /// Reduces each entry, in place.
  void sum(std::span<double> values) const { reduce(values.data(), values.size(), MPI_DOUBLE, MPI_SUM); }
  void sum(std::span<std::int32_t> values) const { reduce(values.data(), values.size(), MPI_INT32_T, MPI_SUM); }
  void sum(std::span<std::int64_t> values) const { reduce(values.data(), values.size(), MPI_INT64_T, MPI_SUM); }
  void sum(std::span<std::uint64_t> values) const { reduce(values.data(), values.size(), MPI_UINT64_T, MPI_SUM); }
  void min(std::span<double> values) const { reduce(values.data(), values.size(), MPI_DOUBLE, MPI_MIN); }
  void min(std::span<std::int32_t> values) const { reduce(values.data(), values.size(), MPI_INT32_T, MPI_MIN); }
  void min(std::span<std::int64_t> values) const { reduce(values.data(), values.size(), MPI_INT64_T, MPI_MIN); }
  void min(std::span<std::uint64_t> values) const { reduce(values.data(), values.size(), MPI_UINT64_T, MPI_MIN); }
  void max(std::span<double> values) const { reduce(values.data(), values.size(), MPI_DOUBLE, MPI_MAX); }
  void max(std::span<std::int32_t> values) const { reduce(values.data(), values.size(), MPI_INT32_T, MPI_MAX); }
  void max(std::span<std::int64_t> values) const { reduce(values.data(), values.size(), MPI_INT64_T, MPI_MAX); }
  void max(std::span<std::uint64_t> values) const { reduce(values.data(), values.size(), MPI_UINT64_T, MPI_MAX); }

  // ---- rank 0 to all ----

  /// Value of rank 0; values of other ranks are ignored.
  template <Plain T>
  requires(!std::invocable<T>) T broadcast(T value)
  const {
    broadcast_bytes(&value, sizeof(T));
    return value;
  }
  template <Plain T>
  std::vector<T> broadcast(std::vector<T> items) const {
    const auto count = broadcast(static_cast<std::int64_t>(items.size()));
    agree([&] { items.resize(count); });
    broadcast_bytes(items.data(), items.size() * sizeof(T));
    return items;
  }
  /// Entries in place; the same count on all ranks.
  template <Plain T>
  void broadcast_into(std::span<T> values) const {
    broadcast_bytes(values.data(), values.size_bytes());
  }
  std::string broadcast(std::string text) const;
  std::vector<std::string> broadcast(std::vector<std::string> texts) const;
  /// Result of `make`, which runs on rank 0 only; its error is thrown on every rank.
  template <std::invocable Make>
  auto broadcast(Make&& make) const {
    using Result = std::invoke_result_t<Make>;
    return broadcast(agree([&] { return is_root() ? make() : Result(); }));
  }

  // ---- all to all ----

  /// Items of all ranks on every rank, in rank order; for few items. Throws SystemError if all together exceed 2 GB.
  template <Plain T>
  std::vector<T> all_gather(const std::vector<T>& own) const {
    Gathering gathering = plan_gathering(own.size() * sizeof(T));
    auto all = agree([&] { return std::vector<T>(gathering.total_bytes() / sizeof(T)); });
    all_gather_bytes(own.data(), gathering, all.data());
    return all;
  }
  /// Gathers the items returned by `make`.
  template <std::invocable Make>
  auto all_gather(Make&& make) const {
    return all_gather(agree(std::forward<Make>(make)));
  }

  /// Sizes and offsets of a gathering, in bytes. Throws SystemError on every rank if the total exceeds 2 GB.
  struct Gathering {
    std::vector<int> bytes;  // (ranks)
    std::vector<int> begin;  // (ranks + 1)
    std::size_t total_bytes() const { return begin.back(); }
  };
  Gathering plan_gathering(std::size_t own_bytes) const;

 private:
  void reduce(void* values, std::size_t count, MPI_Datatype type, MPI_Op operation) const;
  void broadcast_bytes(void* data, std::size_t bytes) const;
  void all_gather_bytes(const void* own, const Gathering& gathering, void* all) const;

  MPI_Comm comm_;
  int rank_ = 0;
  int size_ = 1;
};

}  // namespace carillon::comm
