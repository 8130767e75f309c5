// Child processes: finding, starting and talking to other programs, never through a shell.
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

/// The file of this program. SystemError where /proc does not show it.
std::filesystem::path find_self();
/// A program by its name: in this installation (next to this one; bin, seen from libexec/carillon), else along PATH. None if there is no
/// executable of that name.
std::optional<std::filesystem::path> find_program(const std::string& name);
/// A program or library that only the programs of this installation use: PREFIX/libexec/carillon/NAME, for programs in PREFIX/bin and
/// PREFIX/libexec/carillon. Throws SystemError where there is none.
std::filesystem::path find_helper(const std::string& name);
/// A folder of files that the programs of this installation read: PREFIX/share/carillon/NAME, likewise. Throws SystemError where there is
/// none; `remedy` says in the message what makes it.
std::filesystem::path find_data_folder(const std::string& name, std::string_view remedy);
/// The same as find_program(). Throws SystemError where there is none.
std::filesystem::path require_program(const std::string& name);
/// Is it a file that may be run?
bool is_program(const std::filesystem::path& file);

/// Streams of a program, in place of a descriptor.
inline constexpr int kNull = -1;     // /dev/null
inline constexpr int kInherit = -2;  // that of this process
inline constexpr int kCapture = -3;  // of run(): kept

/// How a program is started.
struct Command {
  std::vector<std::string> words;                                      // the program, a path or a name along PATH, and its arguments
  std::optional<std::vector<std::string>> environment = std::nullopt;  // "NAME=value"; none: make_environment()
  std::filesystem::path folder = {};                                   // working directory; empty: that of this process
  int input = kNull, output = kNull, errors = kNull;                   // kNull, kInherit, kCapture or a descriptor
  enum class Group { same, own, session } group = Group::same;         // process group or session that it starts in
  int signal_at_end = 0;          // sent to it when the thread that started it ends; 0: none by start(), SIGKILL by run()
  std::vector<int> blocked = {};  // signals blocked at its start
  bool yields_memory = false;     // the kernel's OOM killer takes it before this process
  bool default_signals =
      false;  // signals that this process ignores have their default actions there; else, SIGPIPE apart, they stay ignored
};

/// A program that could not be started.
class StartError : public SystemError {
 public:
  StartError(const std::string& message, int error) : SystemError(message), error_(error) {}
  /// The errno: ENOENT where there is no such program.
  int get_error() const { return error_; }

 private:
  int error_ = 0;
};

/// Starts it. Throws StartError "WORD: cannot be started: why". Does not fork, so that no
/// handler of pthread_atfork() runs (MPI has some) and no memory is copied. kCapture is /dev/null here.
pid_t start(const Command& command);

/// Replaces this process by the program words[0], a path, with its own environment or another. Throws StartError.
[[noreturn]] void become(const std::vector<std::string>& words, const std::optional<std::vector<std::string>>& environment = std::nullopt);

/// What became of a program.
struct Finished {
  int exit_code = 0;         // 128 + signal when a signal ended it
  int signal = 0;            // that ended it; 0: none
  bool was_slow = false;     // had not ended in time, and was killed
  bool was_long = false;     // printed more than max_bytes on one stream, and was killed
  bool was_stopped = false;  // `may_stop` said so, and it was killed
  std::string output, errors;
};

struct RunOptions {
  std::string_view input = {};                                  // on its standard input; empty: that of the command
  double patience_s = std::numeric_limits<double>::infinity();  // it is killed after this long
  std::size_t max_bytes = std::size_t{128} << 20;
  bool keeps_tail = false;  // of what is longer than max_bytes the end is kept, and it is not killed
  std::function<void(pid_t)> started = {};
  std::function<bool(const Finished& now)> may_stop = {};  // is asked at least every tenth of a second
};

/// Starts it, waits until it ends, and keeps what it prints on the streams that are kCapture. It is sent SIGKILL when the calling thread
/// ends, unless `signal_at_end` names another signal. One that does not end 5 s after it was killed is left alone. Throws StartError, and
/// SystemError where this process has no pipes left.
Finished run(Command command, const RunOptions& options = {});

}  // namespace carillon::base
