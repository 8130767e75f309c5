// Method: METIS installs its own SIGTERM handler, which leaves by longjmp. Out of malloc, that leaves a lock held and the program hangs;
// and on return METIS restores the previous handler for one signal only. METIS also raises SIGTERM itself for its own errors. It uses two
// functions of the C library, __sysv_signal() and raise(), which are overridden here: while a thread is in METIS, its SIGTERM handler is
// only stored, and called when METIS raises the signal. A SIGTERM from outside reaches the handler of the program.
// Source: gk_sigtrap(), gk_errexit() of GKlib in METIS 5.1.0, as built by Debian 12; ELF symbol interposition, ld.so(8); sigaction(2).
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

/// As in glibc, except for METIS and SIGTERM. METIS passes the previous handler back when it ends, also in nested calls.
extern "C" SignalHandler __sysv_signal(int signal, SignalHandler handler) noexcept {
  if (is_in_metis && signal == SIGTERM) return std::exchange(metis_handler, handler);
  struct sigaction action {};
  struct sigaction before {};
  action.sa_handler = handler;
  action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_NODEFER;
  return ::sigaction(signal, &action, &before) == 0 ? before.sa_handler : SIG_ERR;
}

/// As in glibc, except for METIS and SIGTERM: leaves METIS by longjmp.
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
  if (status == METIS_ERROR_MEMORY) throw SystemError(fmt::format("METIS ran out of memory in {}; use a machine with more memory", what));
  throw SystemError(fmt::format("METIS failed in {} (status {})", what, status));
}

}  // namespace carillon::partition
