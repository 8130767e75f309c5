// Method: the handler only calls what POSIX allows in one (signal-safety(7)): write, poll, _exit, and what
//   runtime/base/temporary does.
// Source: POSIX.1-2008, 2.4.3. Deviations: none.
#include "precompute/run/interrupt.hpp"

#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <cstring>

#include "runtime/base/error.hpp"
#include "runtime/base/temporary.hpp"

namespace carillon::run {
namespace {

constexpr int kFirstRankMs = 200;

volatile sig_atomic_t own_rank = 0;
volatile sig_atomic_t saves = 0;
volatile sig_atomic_t has_news = 0;
volatile sig_atomic_t stop_signal = 0;

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
  base::end_children_and_temporaries();
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

}  // namespace carillon::run
