// What is being done right now, said again while it goes on, so that a program that works is not taken for one that hangs.
#pragma once

#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

namespace carillon::io {

/// Seconds of the clock since this process was started; 0 if the system does not tell.
double find_process_seconds();

/// Says on standard error what is being done, and again every few seconds while it goes on, from a thread of its own.
class Pulse {
 public:
  /// speaks: false says nothing and has no thread.
  explicit Pulse(bool speaks);
  ~Pulse();
  Pulse(const Pulse&) = delete;
  Pulse& operator=(const Pulse&) = delete;

  void begin(const std::string& step);

 private:
  void beat();

  bool speaks_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::thread thread_;
  std::string step_;
  bool is_new_ = false, is_done_ = false;
};

}  // namespace carillon::io
