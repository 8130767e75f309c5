// Method: signal handlers on a stack of their own, so that they run after a stack overflow too. They only write a line that was made before
//   and end the process: nothing else is safe in them. Nothing is lost, for outputs have no name before they are whole.
// Source: POSIX.1-2017, signal concepts (async-signal-safe functions), setrlimit (RLIMIT_CPU, SIGXCPU).
#include "precompute/mesher/guard.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "precompute/mesher/surface.hpp"
#include "runtime/base/error.hpp"

namespace carillon::mesher {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#elif defined(__has_feature)
constexpr bool kSanitized = __has_feature(address_sanitizer) || __has_feature(thread_sanitizer);
#else
constexpr bool kSanitized = false;
#endif

constexpr std::size_t kStack = 64 * 1024;
alignas(16) std::array<char, kStack> alternate_stack;

bool guarded = false;
const char* program_name = "";
double limit_s = 0;  // set by us; 0: none, and what ends the process is a limit that it came with
// What the handlers write, each a whole line.
std::array<char, 1024> crash_line{}, time_line{};

void store(std::array<char, 1024>& line, const std::string& text) {
  const std::size_t length = std::min(text.size(), line.size() - 2);
  // A handler that comes in between finds an end in any case.
  line[length] = '\n';
  line[length + 1] = '\0';
  std::memcpy(line.data(), text.data(), length);
}

void write_and_end(const char* line, int code) {
  const std::size_t length = ::strnlen(line, 1024);
  [[maybe_unused]] const auto written = ::write(STDERR_FILENO, line, length);
  ::_exit(code);
}

void end_by_crash(int) { write_and_end(crash_line.data(), kExitInput); }
void end_by_time(int) { write_and_end(time_line.data(), limit_s > 0 ? kExitInput : kExitSystem); }

}  // namespace

void guard_program(const char* program) {
  guarded = true;
  program_name = program;
  set_guarded_step("", "starting");
  stack_t stack{};
  stack.ss_sp = alternate_stack.data();
  stack.ss_size = alternate_stack.size();
  if (!kSanitized) ::sigaltstack(&stack, nullptr);
  struct sigaction action {};
  sigfillset(&action.sa_mask);
  action.sa_flags = kSanitized ? 0 : SA_ONSTACK;
  action.sa_handler = end_by_time;
  ::sigaction(SIGXCPU, &action, nullptr);
  action.sa_handler = end_by_crash;
  ::sigaction(SIGFPE, &action, nullptr);  // GMP raises it for what is not a number
  if (kSanitized) return;                 // the other faults are for the sanitizer to report
  for (const int signal : {SIGSEGV, SIGBUS, SIGILL, SIGABRT}) ::sigaction(signal, &action, nullptr);
}

void set_guarded_step(std::string_view file, std::string_view step) {
  if (!guarded) return;
  constexpr const char* kAdvice =
      "ask for another node count or edge length, try --method stuffing, or repair the surface in a modeller (parts that pass through or "
      "touch "
      "each other, needles)";
  const std::string place = file.empty() ? std::string(program_name) : fmt::format("{}: {}", program_name, file.substr(0, 300));
  store(crash_line,
        fmt::format("{}: the mesher broke down at the step '{}': the surface is one that it cannot take; {}", place, step, kAdvice));
  if (limit_s > 0)
    store(time_line,
          fmt::format(
              "{}: the mesher was ended at the step '{}' after {:.0f} s of processor time, far more than a body of this size takes; {}",
              place, step, limit_s, kAdvice));
  else
    store(time_line,
          fmt::format("{}: the mesher was ended at the step '{}': the processor time that this process may use is over (ulimit -t)", place,
                      step));
}

CpuLimit::CpuLimit(double seconds) {
  if (!guarded) return;
  rusage used{};
  rlimit limit{};
  if (::getrusage(RUSAGE_SELF, &used) != 0 || ::getrlimit(RLIMIT_CPU, &limit) != 0) return;
  const double now = static_cast<double>(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
                     1e-6 * static_cast<double>(used.ru_utime.tv_usec + used.ru_stime.tv_usec);
  const auto wanted = static_cast<rlim_t>(std::ceil(now + std::min(seconds, 1e8)));
  if (wanted >= limit.rlim_cur) return;  // the user's own limit is the tighter one
  before_ = limit.rlim_cur;
  limit.rlim_cur = wanted;
  set_ = ::setrlimit(RLIMIT_CPU, &limit) == 0;
  if (set_) limit_s = seconds;
}

CpuLimit::~CpuLimit() {
  rlimit limit{};
  limit_s = 0;
  if (!set_ || ::getrlimit(RLIMIT_CPU, &limit) != 0) return;
  limit.rlim_cur = before_;
  ::setrlimit(RLIMIT_CPU, &limit);
}

}  // namespace carillon::mesher
