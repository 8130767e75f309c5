// Errors that say to a program what their message says to a person.
#pragma once

#include <cstdint>
#include <string>

#include "runtime/base/error.hpp"

namespace carillon {

/// An InputError at a place of a file.
class PlacedError : public InputError {
 public:
  /// `place`: "file:line" or a file; the message is "place: message".
  PlacedError(const std::string& place, const std::string& message) : InputError(place + ": " + message), place_(place) {}
  const std::string& get_place() const { return place_; }
  /// Without the place.
  std::string get_message() const { return std::string(what()).substr(place_.size() + 2); }

 private:
  std::string place_;
};

/// A count of nodes that was asked for cannot be met, and another one can.
class CountRefusal : public InputError {
 public:
  /// `possible_nodes`: what to ask for in its place, about; above 0.
  CountRefusal(const std::string& message, std::int64_t possible_nodes) : InputError(message), possible_nodes_(possible_nodes) {}
  std::int64_t get_possible_nodes() const { return possible_nodes_; }

 private:
  std::int64_t possible_nodes_;
};

/// There is not as much memory as the work needs.
class MemoryError : public SystemError {
 public:
  /// `need_bytes`: on all ranks of the fullest machine; 0: not known.
  explicit MemoryError(const std::string& message, double need_bytes = 0.0) : SystemError(message), need_bytes_(need_bytes) {}
  double get_need_bytes() const { return need_bytes_; }

 private:
  double need_bytes_ = 0.0;
};

/// The disk, or a user's share of it, takes no more.
class DiskFullError : public SystemError {
  using SystemError::SystemError;
};

/// Throws a DiskFullError, MemoryError or SystemError as `error`, a value of errno, says.
[[noreturn]] void throw_system_error(int error, const std::string& message);

/// In a handler: throws the exception again, with `before` in front of its message, behind its place, where it is one of
/// Carillon's.
[[noreturn]] void rethrow_after(const std::string& before);

}  // namespace carillon
