// How a program ended, for the program that started it: a small file of JSON, written last and whole (option --result FILE). What a signal
// ends leaves none.
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
  std::string message = {};         // one sentence or more for people; empty when done
  std::string place = {};           // bad_input: "file:line" or a file; empty: not known
  double need_bytes = 0.0;          // memory: on all ranks of the fullest machine; 0: not known
  bool is_resumable = false;        // the same command resumes from a checkpoint
  std::int64_t possible_nodes = 0;  // bad_input: a count that can be met, where another was asked for (CountRefusal); 0: not known
};

/// The word of a kind in the file ("disk-full").
const char* to_text(ResultKind kind);
/// 0, kExitInput, kExitSolve, kExitSystem or kExitCheckpointed.
int get_exit_code(ResultKind kind);

/// What an exception means: InputError, SolveError, SystemError and what derives from them (failure.hpp); std::bad_alloc is memory, with
/// `no_memory` as its message; any other is of the system.
Result describe_error(const std::exception_ptr& error, const std::string& no_memory);

/// Throws the exception that describe_error() makes this result of; any kind that is no error is of the system.
[[noreturn]] void throw_error(const Result& result);

/// Writes the file whole. False when the disk refuses: the exit code still says how it ended.
bool write_result(const std::filesystem::path& file, const Result& result);
/// None when there is no such file, or none that can be read.
std::optional<Result> read_result(const std::filesystem::path& file);

}  // namespace carillon::base
