// Method:     METIS takes SIGTERM for itself as soon as it is called, and answers it by longjmp out of whatever it does: out of malloc,
//             that leaves a lock closed, and the program stands still for good. When it ends, it gives the handler back for one signal
//             only. No option has it leave the signal alone. So the thread that calls it blocks the signal, and a second one puts the
//             program's handler back as soon as METIS has set its own, and from then on hands signals to it. To block alone would have
//             them wait for METIS, or come to a thread of MPI, in which METIS's handler crashes.
// Source:     gk_sigtrap() of GKlib in METIS 5.1.0; sigaction(2), signalfd(2), signal(7).
// Deviations: none.
#include "partition/metis.hpp"

#include <fmt/core.h>
#include <poll.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <thread>

#include "runtime/base/descriptor.hpp"
#include "runtime/base/error.hpp"

namespace carillon::partition {
namespace {

/// While it lives, SIGTERM comes to the handler that was set when it was made.
class KeptHandler {
 public:
  KeptHandler() {
    if (end_.get() < 0 || signals_.get() < 0)
      throw SystemError(fmt::format("no descriptor is left for signals: {}; raise ulimit -n", std::strerror(errno)));
    ::sigaction(SIGTERM, nullptr, &handler_);
    ::pthread_sigmask(SIG_BLOCK, &termination_, &mask_);
    keeper_ = std::thread([this] { keep(); });
  }
  ~KeptHandler() {
    ::sigaction(SIGTERM, &handler_, nullptr);
    (void)!::eventfd_write(end_.get(), 1);
    keeper_.join();
    ::pthread_sigmask(SIG_SETMASK, &mask_, nullptr);
  }
  KeptHandler(const KeptHandler&) = delete;
  KeptHandler& operator=(const KeptHandler&) = delete;

 private:
  void keep() {
    constexpr long kFirstNs = 20'000, kLongestNs = 1'000'000;
    std::array<pollfd, 2> events{{{end_.get(), POLLIN, 0}, {signals_.get(), POLLIN, 0}}};
    for (long pause_ns = kFirstNs; is_set(); pause_ns = std::min(2 * pause_ns, kLongestNs)) {
      const timespec pause{0, pause_ns};
      ::ppoll(events.data(), 1, &pause, nullptr);
      if (events[0].revents != 0) return;
    }
    ::sigaction(SIGTERM, &handler_, nullptr);
    for (;;) {
      ::poll(events.data(), events.size(), -1);
      if (events[0].revents != 0) return;
      signalfd_siginfo taken{};
      if (::read(signals_.get(), &taken, sizeof taken) == sizeof taken) deliver();
    }
  }
  /// In this thread, as the program asked for it.
  void deliver() const {
    ::sigaction(SIGTERM, &handler_, nullptr);
    ::raise(SIGTERM);
    ::pthread_sigmask(SIG_UNBLOCK, &termination_, nullptr);
    ::pthread_sigmask(SIG_BLOCK, &termination_, nullptr);
  }
  bool is_set() const {
    struct sigaction now {};
    return ::sigaction(SIGTERM, nullptr, &now) == 0 && now.sa_handler == handler_.sa_handler;
  }

  const sigset_t termination_ = [] {
    sigset_t set;
    ::sigemptyset(&set);
    ::sigaddset(&set, SIGTERM);
    return set;
  }();
  struct sigaction handler_ {};
  sigset_t mask_{};
  const base::Descriptor end_{::eventfd(0, EFD_CLOEXEC)};
  const base::Descriptor signals_{::signalfd(-1, &termination_, SFD_CLOEXEC | SFD_NONBLOCK)};
  std::thread keeper_;
};

}  // namespace

MetisOptions make_metis_options() {
  MetisOptions options{};
  METIS_SetDefaultOptions(options.data());
  options[METIS_OPTION_NUMBERING] = 0;
  options[METIS_OPTION_SEED] = 1;
  return options;
}

void check_metis(int status, const char* what) {
  if (status == METIS_OK) return;
  if (status == METIS_ERROR_MEMORY) throw SystemError(fmt::format("METIS ran out of memory in {}; use a machine with more", what));
  throw SystemError(fmt::format("METIS failed in {} (status {})", what, status));
}

void call_metis(const char* what, const std::function<int()>& call) {
  int status = METIS_OK;
  {
    const KeptHandler kept;
    status = call();
  }
  check_metis(status, what);
}

}  // namespace carillon::partition
