#include "precompute/run/heartbeat.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <sstream>

#include "precompute/run/worker.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/printable.hpp"

namespace carillon::run {

double find_process_seconds() {
  std::ifstream file("/proc/self/stat");
  std::string line;
  std::getline(file, line);
  // After the name, which is in brackets, the 20th word is the start in ticks since the system booted.
  std::istringstream words(line.substr(std::min(line.size(), line.rfind(')') + 1)));
  std::string word;
  for (int i = 0; i < 20 && words; ++i) words >> word;
  if (!words) return 0;
  const double started = std::strtod(word.c_str(), nullptr) / static_cast<double>(sysconf(_SC_CLK_TCK));
  return std::max(base::get_boot_s() - started, 0.0);
}

Heartbeat::Heartbeat(bool prints) : prints_(prints) {
  if (prints_) thread_ = start_worker([this] { print_periodically(); });
}

Heartbeat::~Heartbeat() {
  if (!prints_) return;
  {
    const std::lock_guard lock(mutex_);
    is_done_ = true;
  }
  wake_.notify_one();
  thread_.join();
}

void Heartbeat::begin(const std::string& step) {
  if (!prints_) return;
  {
    const std::lock_guard lock(mutex_);
    step_ = step;
    is_new_ = true;
    fmt::print(stderr, "carillon-precompute: {}\n", base::printable(step_));
  }
  wake_.notify_one();
}

void Heartbeat::print_periodically() {
  constexpr std::chrono::seconds kEvery{2}, kSeldom{10};
  constexpr int kFirst = 5;  // so many times every kEvery
  std::unique_lock lock(mutex_);
  auto begun = std::chrono::steady_clock::now();
  for (int beats = 1; !is_done_; ++beats) {
    if (!wake_.wait_for(lock, beats <= kFirst ? kEvery : kSeldom, [&] { return is_done_ || is_new_; })) {
      const std::chrono::duration<double> gone = std::chrono::steady_clock::now() - begun;
      fmt::print(stderr, "carillon-precompute: still {}, {:.0f} s\n", base::printable(step_), gone.count());
      continue;
    }
    is_new_ = false;
    begun = std::chrono::steady_clock::now();
    beats = 0;
  }
}

}  // namespace carillon::run
