// Threads for reporting.
#pragma once

#include <pthread.h>
#include <signal.h>

#include <thread>
#include <utility>

namespace carillon::run {

/// A thread that takes no signals: those are for the thread that computes.
template <class Work>
std::thread start_worker(Work work) {
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  std::thread thread(std::move(work));
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  return thread;
}

}  // namespace carillon::run
