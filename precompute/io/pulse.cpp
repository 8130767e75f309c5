#include "precompute/io/pulse.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <sstream>

#include "precompute/io/worker.hpp"
#include "runtime/base/printable.hpp"

namespace carillon::io {

double find_process_seconds() {
  std::ifstream file("/proc/self/stat");
  std::string line;
  std::getline(file, line);
  // After the name, which is in brackets, the 20th word is the start in ticks since the system booted.
  std::istringstream words(line.substr(std::min(line.size(), line.rfind(')') + 1)));
  std::string word;
  for (int i = 0; i < 20 && words; ++i) words >> word;
  timespec now{};
  if (!words || clock_gettime(CLOCK_BOOTTIME, &now) != 0) return 0;
  const double started = std::strtod(word.c_str(), nullptr) / static_cast<double>(sysconf(_SC_CLK_TCK));
  return std::max(static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec) - started, 0.0);
}

Pulse::Pulse(bool speaks) : speaks_(speaks) {
  if (speaks_) thread_ = start_worker([this] { beat(); });
}

Pulse::~Pulse() {
  if (!speaks_) return;
  {
    const std::lock_guard lock(mutex_);
    is_done_ = true;
  }
  wake_.notify_one();
  thread_.join();
}

void Pulse::begin(const std::string& step) {
  if (!speaks_) return;
  {
    const std::lock_guard lock(mutex_);
    step_ = step;
    is_new_ = true;
    fmt::print(stderr, "carillon-precompute: {}\n", base::printable(step_));
  }
  wake_.notify_one();
}

void Pulse::beat() {
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

}  // namespace carillon::io
