// Processes of this machine: identity, life, and termination of leftovers. Process numbers are reused, so an identity includes the start
// time and the boot; wall clocks are not used.
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

/// Unique identity of a process.
struct Identity {
  std::string host;             // name of its machine
  std::string boot;             // boot id and PID namespace: "e6e7e236-...:4026531836"
  int pid = 0;                  // 0: none
  std::uint64_t start_ticks{};  // start time in clock ticks since boot
};

enum class Life { running, gone, elsewhere };  // elsewhere: on another machine or in another container

/// Name of this machine; this boot and PID namespace.
std::string find_host();
std::string find_boot();

/// This process; the process with a number, none if it does not exist or is a zombie.
Identity find_self();
std::optional<Identity> find_process(pid_t pid);
/// True if `identity` is this process (number, start and boot; the host name may change).
bool is_self(const Identity& identity);

/// This boot: running or gone. An earlier boot of this machine: gone. Else: elsewhere.
Life find_life(const Identity& identity);

/// Content of a file of /proc; partial or empty if the process ends meanwhile.
std::string read_proc(const std::filesystem::path& file);

/// Processes with `entry` ("NAME=value") in their initial environment, without zombies and this process.
std::vector<pid_t> find_with_environment(std::string_view entry);

/// Waits up to `grace_s` for these processes to end, then kills them and their new children (SIGKILL) and waits until all are gone. Returns
/// their number. SystemError if one remains after another `patience_s`.
int end_with_environment(std::string_view entry, double patience_s = 20.0, double grace_s = 0.0);

/// An exclusive lock on a file; the kernel releases it when the process ends.
class Lock {
 public:
  /// Does not wait: none if another process holds it. Creates the file. SystemError.
  static std::optional<Lock> take(const std::filesystem::path& file);
  /// False if the file does not exist.
  static bool is_held(const std::filesystem::path& file);
  Lock(Lock&& other) noexcept : descriptor_(other.descriptor_) { other.descriptor_ = -1; }
  Lock& operator=(Lock&&) = delete;
  ~Lock();

 private:
  explicit Lock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_ = -1;
};

}  // namespace carillon::process
