// Child processes: find, start and communicate, never through a shell.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::base {

/// Executable of this process. Throws SystemError without /proc.
std::filesystem::path find_self();
/// Executable by name: in this installation (same folder, or bin seen from libexec/carillon), else along PATH; nullopt if not found.
std::optional<std::filesystem::path> find_program(const std::string& name);
/// Private program or library of this installation: PREFIX/libexec/carillon/NAME, for programs in PREFIX/bin and
/// PREFIX/libexec/carillon. Throws SystemError if missing.
std::filesystem::path find_helper(const std::string& name);
/// Data folder of this installation: PREFIX/share/carillon/NAME. Throws SystemError if missing; `remedy` ends the message.
std::filesystem::path find_data_folder(const std::string& name, std::string_view remedy);
/// As find_program(); throws SystemError if not found.
std::filesystem::path require_program(const std::string& name);
/// True for an executable regular file.
bool is_program(const std::filesystem::path& file);

/// Values of Command streams that are not descriptors.
inline constexpr int kNull = -1;     // /dev/null
inline constexpr int kInherit = -2;  // inherited from this process
inline constexpr int kCapture = -3;  // captured by run()

/// Start parameters of a process.
struct Command {
  std::vector<std::string> words;                                      // program (path, or name along PATH) and arguments
  std::optional<std::vector<std::string>> environment = std::nullopt;  // "NAME=value"; none: make_environment()
  std::filesystem::path folder = {};                                   // working directory; empty: inherited
  int input = kNull, output = kNull, errors = kNull;                   // kNull, kInherit, kCapture or a descriptor
  enum class Group { same, own, session } group = Group::same;         // process group or session
  int signal_at_end = 0;               // sent when the starting thread ends; 0: none by start(), SIGKILL by run()
  std::vector<int> blocked = {};       // signals blocked at start
  bool yields_memory = false;          // preferred victim of the kernel's OOM killer
  bool default_signals = false;        // resets ignored signals to their default actions; otherwise only SIGPIPE is reset
  std::function<int()> function = {};  // run in a fork of this process instead of a program; returns the exit code
  bool is_given_away = false;          // with `function`: a child of the nearest ancestor that is a subreaper instead of this process
};

/// Process start failed.
class StartError : public SystemError {
 public:
  StartError(const std::string& message, int error) : SystemError(message), error_(error) {}
  /// errno; ENOENT: no such program.
  int get_error() const { return error_; }

 private:
  int error_ = 0;
};

/// Starts a process. Throws StartError "WORD: cannot be started: REASON". Uses vfork: no pthread_atfork() handlers (MPI registers some), no
/// copied page tables. kCapture acts as /dev/null. With `function` the process is a fork without the descriptors that exec would close; it
/// keeps handlers of faults (SIGSEGV ...), and ends without destructors and atexit() handlers, which belong to this process.
pid_t start(const Command& command);

/// Replaces this process by words[0] (a path); environment: own if none given. Throws StartError.
[[noreturn]] void become(const std::vector<std::string>& words, const std::optional<std::vector<std::string>>& environment = std::nullopt);

/// Outcome of a process.
struct Finished {
  int exit_code = 0;         // 128 + signal after termination by a signal
  int signal = 0;            // terminating signal; 0: none
  bool was_slow = false;     // killed after patience_s
  bool was_long = false;     // killed after more than max_bytes on one stream
  bool was_stopped = false;  // killed on request of `may_stop`
  std::string output, errors;
};

struct RunOptions {
  std::string_view input = {};                                  // bytes for standard input; empty: Command::input
  double patience_s = std::numeric_limits<double>::infinity();  // killed after this time
  std::size_t max_bytes = std::size_t{128} << 20;
  bool keeps_tail = false;  // keeps the last max_bytes instead of killing
  std::function<void(pid_t)> started = {};
  std::function<bool(const Finished& now)> may_stop = {};  // polled at least every 0.1 s
};

/// Starts a process, captures the kCapture streams and waits for its end. Sends SIGKILL (or `signal_at_end`) when the calling thread ends.
/// A process still alive 5 s after SIGKILL is abandoned. Throws StartError, and SystemError if no pipe can be made.
Finished run(Command command, const RunOptions& options = {});

}  // namespace carillon::base
