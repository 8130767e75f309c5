// Method:     METIS installs its own SIGTERM handler, which longjmps out of whatever is running. Out of malloc, that leaves a lock held and
//             the program hangs; and when METIS returns, it restores the previous handler for one signal only. METIS raises SIGTERM itself
//             too, for its own errors. It does both by two functions of the C library, __sysv_signal() and raise(). They are defined here:
//             while a thread is in METIS, its handler of SIGTERM is only noted, and called where METIS raises the signal. A SIGTERM from
//             outside meets the program's handler, as if METIS were not there.
// Source:     gk_sigtrap(), gk_errexit() of GKlib in METIS 5.1.0, as Debian 12 builds it; ELF symbol interposition, ld.so(8); sigaction(2).
// Deviations: none.
#include "partition/metis.hpp"

#include <fmt/core.h>
#include <pthread.h>
#include <signal.h>

#include <cerrno>
#include <utility>

#include "runtime/base/error.hpp"

namespace carillon::partition {
namespace {

using SignalHandler = void (*)(int);

thread_local bool is_in_metis = false;
thread_local SignalHandler metis_handler = nullptr;

struct InMetis {
  InMetis() { is_in_metis = true; }
  ~InMetis() {
    is_in_metis = false;
    metis_handler = nullptr;
  }
  InMetis(const InMetis&) = delete;
  InMetis& operator=(const InMetis&) = delete;
};

}  // namespace

/// As glibc's, but for METIS and SIGTERM. METIS passes back what it got when it ends, calls of it within a call too.
extern "C" SignalHandler __sysv_signal(int signal, SignalHandler handler) noexcept {
  if (is_in_metis && signal == SIGTERM) return std::exchange(metis_handler, handler);
  struct sigaction action {};
  struct sigaction before {};
  action.sa_handler = handler;
  action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_NODEFER;
  return ::sigaction(signal, &action, &before) == 0 ? before.sa_handler : SIG_ERR;
}

/// As glibc's, but for METIS and SIGTERM: leaves METIS by longjmp.
extern "C" int raise(int signal) noexcept {
  if (is_in_metis && signal == SIGTERM && metis_handler != nullptr) metis_handler(signal);
  const int error = pthread_kill(pthread_self(), signal);
  if (error == 0) return 0;
  errno = error;
  return -1;
}

MetisOptions make_metis_options() {
  MetisOptions options{};
  METIS_SetDefaultOptions(options.data());
  options[METIS_OPTION_NUMBERING] = 0;
  options[METIS_OPTION_SEED] = 1;
  return options;
}

void call_metis(const char* what, const std::function<int()>& call) {
  int status = METIS_OK;
  {
    const InMetis inside;
    status = call();
  }
  if (status == METIS_OK) return;
  if (status == METIS_ERROR_MEMORY) throw SystemError(fmt::format("METIS ran out of memory in {}; use a machine with more", what));
  throw SystemError(fmt::format("METIS failed in {} (status {})", what, status));
}

}  // namespace carillon::partition
