// Errors with machine-readable details.
#pragma once

#include <cstdint>
#include <string>

#include "runtime/base/error.hpp"

namespace carillon {

/// InputError with the place separated from the message.
class PlacedError : public InputError {
 public:
  /// `place`: "file:line" or a file; the message is "place: message".
  PlacedError(const std::string& place, const std::string& message) : InputError(place + ": " + message), place_(place) {}
  const std::string& get_place() const { return place_; }
  /// Message without the place.
  std::string get_message() const { return std::string(what()).substr(place_.size() + 2); }

 private:
  std::string place_;
};

/// The requested number of nodes is not feasible, another one is.
class CountRefusal : public InputError {
 public:
  /// `possible_nodes`: approximate feasible count; above 0.
  CountRefusal(const std::string& message, std::int64_t possible_nodes) : InputError(message), possible_nodes_(possible_nodes) {}
  std::int64_t get_possible_nodes() const { return possible_nodes_; }

 private:
  std::int64_t possible_nodes_;
};

/// Insufficient memory.
class MemoryError : public SystemError {
 public:
  /// `need_bytes`: all ranks of the fullest machine; 0: unknown.
  explicit MemoryError(const std::string& message, double need_bytes = 0.0) : SystemError(message), need_bytes_(need_bytes) {}
  double get_need_bytes() const { return need_bytes_; }

 private:
  double need_bytes_ = 0.0;
};

/// Disk or quota full.
class DiskFullError : public SystemError {
  using SystemError::SystemError;
};

/// Throws DiskFullError, MemoryError or SystemError according to the errno value `error`.
[[noreturn]] void throw_system_error(int error, const std::string& message);

/// In a handler: rethrows one of Carillon's exceptions with `before` inserted between place and message.
[[noreturn]] void rethrow_after(const std::string& before);

}  // namespace carillon
