// Exit report for the parent process: a small JSON file, written atomically and last (option --result FILE). Absent after death by signal.
//
//   {"kind": "memory", "message": "... needs about 12.50 GB ...", "need_bytes": 12500000000, "resumable": true}
#pragma once

#include <cstdint>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>

namespace carillon::base {

enum class ResultKind : std::uint8_t { done, bad_input, no_solution, memory, disk_full, system, checkpointed };

struct Result {
  ResultKind kind = ResultKind::done;
  std::string message = {};         // for people; empty when done
  std::string place = {};           // bad_input: "file:line" or a file; empty: unknown
  double need_bytes = 0.0;          // memory: all ranks of the fullest machine; 0: unknown
  bool is_resumable = false;        // the same command resumes from a checkpoint
  std::int64_t possible_nodes = 0;  // bad_input: feasible number of nodes (CountRefusal); 0: unknown
};

/// Name of the kind in the file ("disk-full").
const char* to_text(ResultKind kind);
/// 0, kExitInput, kExitSolve, kExitSystem or kExitCheckpointed.
int get_exit_code(ResultKind kind);

/// Result for an exception: InputError, SolveError, SystemError and derived classes (failure.hpp); std::bad_alloc is `memory` with
/// `no_memory` as its message; any other is `system`.
Result describe_error(const std::exception_ptr& error, const std::string& no_memory);

/// Throws the exception that corresponds to the result; non-error kinds are SystemError.
[[noreturn]] void throw_error(const Result& result);

/// Writes atomically. Returns false on I/O errors: the exit code still reports the outcome.
bool write_result(const std::filesystem::path& file, const Result& result);
/// nullopt if missing or unreadable.
std::optional<Result> read_result(const std::filesystem::path& file);

}  // namespace carillon::base
