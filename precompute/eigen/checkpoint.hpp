// A solve that is saved on its way and resumed later, by as many ranks as one likes.
#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <string>
#include <vector>

#include "precompute/la/block_kernels.hpp"

namespace carillon::eigen {

using la::Columns;

/// What a rank requests at a safe point.
struct CheckpointRequest {
  bool stop = false;  // it was asked to stop: save and throw Stopped
  bool save = false;  // it is time to save
};

/// All that a solve has to remember: numbers, the same on every rank and a few MB at most, and columns over the rows of K, of which each
/// rank brings its own. The code that stores them need not know what they mean.
struct Checkpoint {
  /// Local and cheap; asked at every safe point. What one rank requests all do.
  std::function<CheckpointRequest()> ask;
  /// Collective. Whether it worked; where it did not, the solve continues.
  std::function<bool(const std::string& numbers, const std::vector<Columns>& columns)> save;
  /// Reports whether there is now something that has not been saved. Local.
  std::function<void(bool has_news)> report_unsaved;

  std::string numbers;            // of the state to resume from; empty: from the beginning
  std::int64_t column_count = 0;  // and how many columns belong to it
  /// Reads the columns from `first` on into this rank's rows. Collective. Throws SystemError on every rank.
  std::function<void(std::int64_t first, const Columns& into)> read;
  /// Says why the state cannot be resumed from; the solve then starts from the beginning. Collective.
  std::function<void(const std::string& why)> reject;
};

/// Thrown on every rank alike after a rank was asked to stop: what can be resumed is saved.
class Stopped : public std::exception {
 public:
  const char* what() const noexcept override { return "stopped"; }
};

/// What any rank asks for. Collective.
CheckpointRequest vote(const comm::Communicator& comm, const Checkpoint& checkpoint);

/// Numbers as bytes.
class NumberWriter {
 public:
  void add(double value);
  void add(std::int64_t value);
  void add(const std::vector<double>& values);
  void add(const std::string& text);
  std::string bytes;
};

/// And back, in the same order. What does not fit throws InputError; the bytes are untrusted.
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
