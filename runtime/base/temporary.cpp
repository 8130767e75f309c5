// Method: fixed-size table, since signal handlers may neither allocate nor lock. Folders are removed by rm(1) in a child process.
// Source: signal-safety(7); glibc 2.34 _Fork(); flock(2).
#include "runtime/base/temporary.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <mutex>
#include <system_error>

#include "runtime/base/descriptor.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/message.hpp"

namespace carillon::base {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMark = ".carillon-temporary";
constexpr const char* kLetters = "XXXXXX";
constexpr std::size_t kMaxFolders = 16, kMaxChildren = 16, kMaxPath = 4096;
constexpr int kStepMs = 20, kPatienceMs = 3000;
constexpr std::array kSignals{SIGINT, SIGTERM, SIGHUP};

struct Slot {
  std::atomic<bool> is_used{false};
  std::array<char, kMaxPath> path{};
  int lock = -1;
};
std::array<Slot, kMaxFolders> slots;
std::array<std::atomic<pid_t>, kMaxChildren> children{};
std::atomic<bool> is_ending{false};  // a handler has begun: no further WholeStep
std::atomic<int> step_count{0};      // threads in a WholeStep
thread_local int step_depth = 0;
std::mutex handlers_mutex;
static_assert(std::atomic<int>::is_always_lock_free && std::atomic<pid_t>::is_always_lock_free && std::atomic<bool>::is_always_lock_free,
              "Signal handlers require lock-free atomics.");

void handle(int signal) {
  end_children_and_temporaries();
  struct sigaction action {};
  action.sa_handler = SIG_DFL;
  ::sigaction(signal, &action, nullptr);
  ::raise(signal);
}

bool is_ours(int signal) {
  struct sigaction action {};
  return ::sigaction(signal, nullptr, &action) == 0 && action.sa_handler == handle;
}

/// Signals that are ignored or handled elsewhere stay so.
void set_handlers(bool is_needed) {
  for (const int signal : kSignals) {
    struct sigaction action {};
    if (::sigaction(signal, nullptr, &action) != 0) continue;
    if (is_needed ? action.sa_handler != SIG_DFL : !is_ours(signal)) continue;
    action = {};
    action.sa_handler = is_needed ? handle : SIG_DFL;
    sigfillset(&action.sa_mask);
    action.sa_flags = is_needed ? SA_RESTART : 0;
    ::sigaction(signal, &action, nullptr);
  }
}

/// Removes folders of dead processes.
void sweep(const fs::path& parent, const std::string& begin) {
  std::error_code error;
  for (fs::directory_iterator it(parent, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    std::error_code other;
    if (!name.starts_with(begin) || name.size() != begin.size() + std::strlen(kLetters)) continue;
    if (!fs::is_directory(it->symlink_status(other))) continue;
    const Descriptor mark(::open((it->path() / kMark).c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC));
    if (mark.get() >= 0 && ::flock(mark.get(), LOCK_EX | LOCK_NB) == 0) fs::remove_all(it->path(), other);
  }
}

Slot* find_slot(const fs::path& folder) {
  for (Slot& slot : slots)
    if (slot.is_used.load() && folder == slot.path.data()) return &slot;
  return nullptr;
}

/// False if something remains. Async-signal-safe.
bool remove_by_rm(const char* folder) {
  const pid_t child = ::_Fork();
  if (child == 0) {
    const int null = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (null >= 0) ::dup2(null, STDERR_FILENO);
    ::execl("/bin/rm", "rm", "-rf", "--", folder, nullptr);
    ::_exit(127);
  }
  int status = 0;
  while (child > 0 && ::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return child > 0 && status == 0;
}

/// Handlers are installed while a slot is used.
void update_handlers() {
  const std::lock_guard lock(handlers_mutex);
  set_handlers(std::any_of(slots.begin(), slots.end(), [](const Slot& slot) { return slot.is_used.load(); }));
}

/// Removes a folder from the handler's table.
void release(Slot& slot) {
  const WholeStep step;
  if (slot.lock >= 0) ::close(slot.lock);
  slot.lock = -1;
  slot.path[0] = '\0';
  slot.is_used.store(false);
  update_handlers();
}

}  // namespace

WholeStep::WholeStep() {
  if (step_depth++ > 0) return;
  step_count.fetch_add(1);
  if (!is_ending.load()) return;
  step_count.fetch_sub(1);
  for (;;) ::pause();  // another thread ends the process
}

WholeStep::~WholeStep() {
  if (--step_depth == 0) step_count.fetch_sub(1);
}

fs::path make_temporary_folder(const fs::path& parent, const std::string& begin) {
  sweep(parent, begin);
  std::string path = (parent / (begin + kLetters)).string();
  const WholeStep step;
  const auto slot = std::find_if(slots.begin(), slots.end(), [](Slot& one) { return !one.is_used.exchange(true); });
  update_handlers();
  if (path.size() >= kMaxPath || ::mkdtemp(path.data()) == nullptr) {
    const int error = path.size() >= kMaxPath ? ENAMETOOLONG : errno;
    if (slot != slots.end()) release(*slot);
    throw_system_error(error, fmt::format("{}: no temporary folder can be made here: {}; make room there, or name another place (temporary "
                                          "files: TMPDIR)",
                                          find_name(path), std::strerror(error)));
  }
  if (slot == slots.end()) return path;  // table full: removed only by the destructor
  std::memcpy(slot->path.data(), path.c_str(), path.size() + 1);
  slot->lock = ::open((path + "/" + kMark).c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (slot->lock >= 0) (void)::flock(slot->lock, LOCK_EX | LOCK_NB);
  return path;
}

void remove_temporary_folder(const fs::path& folder) noexcept {
  if (folder.empty()) return;
  std::error_code error;
  fs::remove_all(folder, error);
  if (Slot* slot = find_slot(folder)) release(*slot);
}

void keep_temporary_folder(const fs::path& folder, const fs::path& moved_to) noexcept {
  if (Slot* slot = find_slot(folder)) release(*slot);
  ::unlink(((moved_to.empty() ? folder : moved_to) / kMark).c_str());
}

TemporaryFolder::TemporaryFolder(const std::string& begin) {
  std::error_code error;
  const fs::path parent = fs::temp_directory_path(error);
  path_ = make_temporary_folder(error ? fs::path("/tmp") : parent, begin);
}

void note_child(pid_t child) noexcept {
  for (std::atomic<pid_t>& slot : children) {
    pid_t none = 0;
    if (slot.compare_exchange_strong(none, child)) return;
  }
}

void forget_child(pid_t child) noexcept {
  for (std::atomic<pid_t>& slot : children) {
    pid_t expected = child;
    if (slot.compare_exchange_strong(expected, 0)) return;
  }
}

void end_children_and_temporaries() noexcept {
  is_ending.store(true);
  for (int waited_ms = 0; step_count.load() > 0 && waited_ms < kPatienceMs; ++waited_ms) ::poll(nullptr, 0, 1);
  for (const int signal : {SIGTERM, SIGKILL}) {
    for (std::atomic<pid_t>& slot : children)
      if (const pid_t child = slot.load(); child > 0) ::kill(child, signal);
    for (int waited_ms = 0; waited_ms < kPatienceMs; waited_ms += kStepMs) {
      bool is_left = false;
      for (std::atomic<pid_t>& slot : children) {
        const pid_t child = slot.load();
        if (child <= 0) continue;
        const pid_t ended = ::waitpid(child, nullptr, WNOHANG);
        if (ended == child || (ended < 0 && errno == ECHILD))
          slot.store(0);
        else
          is_left = true;
      }
      if (!is_left) break;
      ::poll(nullptr, 0, kStepMs);
    }
  }
  for (Slot& slot : slots) {
    if (!slot.is_used.load()) continue;
    // Grandchildren such as a shell's mkdir may outlive the child briefly: rm then finds a folder that is not empty.
    for (int waited_ms = 0; !remove_by_rm(slot.path.data()) && waited_ms < kPatienceMs; waited_ms += kStepMs) ::poll(nullptr, 0, kStepMs);
  }
}

}  // namespace carillon::base
