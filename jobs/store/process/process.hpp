// Processes of this machine: which one it is, whether it still runs, and how to end processes that were left behind.
// A process number alone says nothing, as numbers are used again: the moment of the start and the boot belong to it. Wall clocks play no
// part.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::process {

/// One process among all that ever were.
struct Identity {
  std::string host;             // its machine's name
  std::string boot;             // boot id and PID namespace: "e6e7e236-...:4026531836"
  int pid = 0;                  // in that namespace; 0: none
  std::uint64_t start_ticks{};  // of its start, in clock ticks since the boot
};

enum class Life { running, gone, elsewhere };  // elsewhere: another machine or container, which this one cannot see

/// This machine's name; this boot and PID namespace.
std::string find_host();
std::string find_boot();

/// This process, and the one of a number; none when there is none (a zombie is none).
Identity find_self();
std::optional<Identity> find_process(pid_t pid);
/// Whether `identity` is this process: number, start and boot; its machine may have got another name meanwhile.
bool is_self(const Identity& identity);

/// Of this machine and this boot: running or gone. Of an earlier boot of this machine: gone. Else: elsewhere.
Life find_life(const Identity& identity);

/// A file of /proc, whole; what there was of it when the process ends meanwhile, "" when it cannot be read.
std::string read_proc(const std::filesystem::path& file);

/// The processes with `entry` ("NAME=value") in the environment they were started with, zombies and this one left out.
std::vector<pid_t> find_with_environment(std::string_view entry);

/// Waits up to `grace_s` for them to end by themselves; then kills them (SIGKILL), and those that they start meanwhile, and waits until all
/// are gone. Returns how many there were. SystemError when one is still there `patience_s` later.
int end_with_environment(std::string_view entry, double patience_s = 20.0, double grace_s = 0.0);

/// An exclusive lock on a file, for its lifetime; the kernel releases it when the process ends, in whatever way.
class Lock {
 public:
  /// None when another holds it. SystemError when `file` cannot be opened or made.
  static std::optional<Lock> take(const std::filesystem::path& file);
  /// Whether a process holds it now. A file that is not there is not locked.
  static bool is_held(const std::filesystem::path& file);
  Lock(Lock&& other) noexcept : descriptor_(other.descriptor_) { other.descriptor_ = -1; }
  Lock& operator=(Lock&&) = delete;
  ~Lock();

 private:
  explicit Lock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_ = -1;
};

}  // namespace carillon::process
