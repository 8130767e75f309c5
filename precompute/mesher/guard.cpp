// Method: signal handlers on an alternate stack, so that they survive a stack overflow. They only write a prepared line and end the process
//   (async-signal-safe). No output is lost: files are named only when complete.
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
double limit_s = 0;  // set by this program; 0: none, an inherited limit applies
// Output of the handlers, whole lines.
std::array<char, 1024> crash_line{}, time_line{};

void store(std::array<char, 1024>& line, const std::string& text) {
  const std::size_t length = std::min(text.size(), line.size() - 2);
  // A handler in between still finds a terminated string.
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
  ::sigaction(SIGFPE, &action, nullptr);  // GMP raises it for non-finite numbers
  if (kSanitized) return;                 // leave other faults to the sanitizer
  for (const int signal : {SIGSEGV, SIGBUS, SIGILL, SIGABRT}) ::sigaction(signal, &action, nullptr);
}

void set_guarded_step(std::string_view file, std::string_view step) {
  if (!guarded) return;
  constexpr const char* kAdvice =
      "ask for another node count or edge length, try --method stuffing, or repair the surface in a modeller (parts that pass through or "
      "touch "
      "each other, needles)";
  const std::string place = file.empty() ? std::string(program_name) : fmt::format("{}: {}", program_name, file.substr(0, 300));
  store(crash_line, fmt::format("{}: the mesher crashed at the step '{}': it cannot handle this surface; {}", place, step, kAdvice));
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
  if (wanted >= limit.rlim_cur) return;  // the user's limit is tighter
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
