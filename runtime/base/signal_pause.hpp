// Steps that no signal may interrupt: a file and its name, a folder and its entry in a table, a child before it is known.
#pragma once

#include <signal.h>

namespace carillon::base {

/// Blocks all signals of this thread during its lifetime; they are delivered afterwards. A signal to the process still ends it if another
/// thread does not block that signal (WholeStep of temporary.hpp waits for those, too).
class SignalPause {
 public:
  SignalPause() {
    sigset_t all;
    sigfillset(&all);
    ::pthread_sigmask(SIG_SETMASK, &all, &before_);
  }
  ~SignalPause() { ::pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  SignalPause(const SignalPause&) = delete;
  SignalPause& operator=(const SignalPause&) = delete;

 private:
  sigset_t before_{};
};

}  // namespace carillon::base
