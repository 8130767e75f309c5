// A solve that is saved while it runs and resumed later on any number of ranks.
#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <string>
#include <vector>

#include "precompute/la/block_kernels.hpp"

namespace carillon::eigen {

using la::Columns;

/// Request of a rank at a safe point.
struct CheckpointRequest {
  bool stop = false;  // save and throw Stopped
  bool save = false;  // save and continue
};

/// State of a solve: numbers, the same on all ranks and at most a few MB, and columns over the rows of K, each rank with its own rows. The
/// storage does not interpret them.
struct Checkpoint {
  /// Local and cheap; called at every safe point. A request of one rank applies to all.
  std::function<CheckpointRequest()> ask;
  /// Collective. Returns success; the solve continues in either case.
  std::function<bool(const std::string& numbers, const std::vector<Columns>& columns)> save;
  /// Reports if there is unsaved progress. Local.
  std::function<void(bool has_news)> report_unsaved;

  std::string numbers;            // numbers of the state to resume from; empty: start from the beginning
  std::int64_t column_count = 0;  // number of columns of that state
  /// Reads the columns from `first` on into this rank's rows. Collective. Throws SystemError on every rank.
  std::function<void(std::int64_t first, const Columns& into)> read;
  /// Reports the reason why the state cannot be resumed; the solve then starts from the beginning. Collective.
  std::function<void(const std::string& why)> reject;
};

/// Thrown on all ranks after a stop request; the state has been saved.
class Stopped : public std::exception {
 public:
  const char* what() const noexcept override { return "stopped"; }
};

/// Combined request of all ranks. Collective.
CheckpointRequest vote(const comm::Communicator& comm, const Checkpoint& checkpoint);

/// Serialises numbers.
class NumberWriter {
 public:
  void add(double value);
  void add(std::int64_t value);
  void add(const std::vector<double>& values);
  void add(const std::string& text);
  std::string bytes;
};

/// Reads numbers in the order of NumberWriter. The bytes are untrusted; throws InputError on a mismatch.
class NumberReader {
 public:
  explicit NumberReader(const std::string& bytes) : bytes_(bytes) {}
  double get_double();
  /// Within [min, max].
  std::int64_t get_count(std::int64_t min, std::int64_t max);
  std::vector<double> get_doubles(std::int64_t max);
  std::string get_text();
  void end() const;

 private:
  void take(void* to, std::size_t size);
  const std::string& bytes_;
  std::size_t at_ = 0;
};

}  // namespace carillon::eigen
