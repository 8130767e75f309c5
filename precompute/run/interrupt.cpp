// Method: the handler only calls what POSIX allows in one (signal-safety(7)): kill, unlink, rmdir, write, poll, _exit.
// Source: POSIX.1-2008, 2.4.3. Deviations: none.
#include "precompute/run/interrupt.hpp"

#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstring>

#include "runtime/base/error.hpp"

namespace carillon::run {
namespace {

constexpr int kFirstRankMs = 200;

std::array<char, 4096> cleanup_file{}, cleanup_folder{};
volatile sig_atomic_t has_cleanup = 0;
volatile sig_atomic_t own_rank = 0;
volatile sig_atomic_t saves = 0;
volatile sig_atomic_t has_news = 0;
volatile sig_atomic_t stop_signal = 0;
std::atomic<pid_t> child_process{0};
static_assert(std::atomic<pid_t>::is_always_lock_free, "A handler may only touch lock-free atomics.");

void print(const char* text) { (void)!write(STDERR_FILENO, text, std::strlen(text)); }

const char* find_name(int signal) {
  return signal == SIGTERM ? "SIGTERM" : signal == SIGINT ? "SIGINT" : signal == SIGHUP ? "SIGHUP" : "SIGUSR1";
}

void handle(int signal) {
  const bool is_to_save = saves != 0 && (signal == SIGTERM || signal == SIGUSR1);
  if (is_to_save && has_news != 0) {
    stop_signal = signal;
    return;
  }
  if (has_cleanup != 0) {
    const pid_t child = child_process.load();
    if (child > 0) kill(child, SIGKILL);
    unlink(cleanup_file.data());
    rmdir(cleanup_folder.data());
  }
  if (own_rank == 0) {
    print("carillon-precompute: stopped by ");
    print(find_name(signal));
    print(is_to_save ? "; the run can be resumed from the checkpoint\n" : "; the bank was not touched, or it is whole\n");
  } else {
    poll(nullptr, 0, kFirstRankMs);  // mpirun ends all ranks with the first that ends, which is to be the one that prints
  }
  _exit(is_to_save ? kExitCheckpointed : 128 + signal);
}

}  // namespace

void end_on_signals(int rank) {
  own_rank = rank;
  struct sigaction action {};
  action.sa_handler = handle;
  sigfillset(&action.sa_mask);
  action.sa_flags = SA_RESTART;
  for (const int signal : {SIGTERM, SIGINT, SIGHUP}) {
    struct sigaction before {};
    // nohup and shells without job control have a process ignore some of them: that stays.
    if (sigaction(signal, nullptr, &before) == 0 && before.sa_handler != SIG_IGN) sigaction(signal, &action, nullptr);
  }
  ::signal(SIGXFSZ, SIG_IGN);  // A file that grows beyond the limit is an error of the write, with a message.
}

void save_on_signals() {
  saves = 1;
  struct sigaction action {};
  action.sa_handler = handle;
  sigfillset(&action.sa_mask);
  action.sa_flags = SA_RESTART;
  sigaction(SIGUSR1, &action, nullptr);
}

void set_news(bool is_new) { has_news = is_new ? 1 : 0; }

bool is_stop_asked() { return stop_signal != 0; }

std::string find_stop_name() { return stop_signal == 0 ? "a signal" : find_name(stop_signal); }

Cleanup::Cleanup(const std::string& file) {
  const std::string folder = file.substr(0, file.rfind('/'));
  if (file.size() >= cleanup_file.size()) throw InputError(file + ": this path is too long for a temporary file");
  std::memcpy(cleanup_file.data(), file.c_str(), file.size() + 1);
  std::memcpy(cleanup_folder.data(), folder.c_str(), folder.size() + 1);
  child_process = 0;
  has_cleanup = 1;
}

Cleanup::~Cleanup() {
  has_cleanup = 0;
  unlink(cleanup_file.data());
  rmdir(cleanup_folder.data());
}

void Cleanup::set_child(pid_t child) { child_process = child; }

}  // namespace carillon::run
