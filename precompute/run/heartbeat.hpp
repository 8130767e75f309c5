// Repeated messages of --validate, so that a long step is not taken for a hang.
#pragma once

#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

namespace carillon::run {

/// Seconds of the clock since this process was started; 0 where it is unknown.
double find_process_seconds();

/// Prints the current step to standard error, and again every few seconds until the next one, from a thread of its own.
class Heartbeat {
 public:
  /// prints: false prints nothing and starts no thread.
  explicit Heartbeat(bool prints);
  ~Heartbeat();
  Heartbeat(const Heartbeat&) = delete;
  Heartbeat& operator=(const Heartbeat&) = delete;

  void begin(const std::string& step);

 private:
  void print_periodically();

  bool prints_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::thread thread_;
  std::string step_;
  bool is_new_ = false, is_done_ = false;
};

}  // namespace carillon::run
