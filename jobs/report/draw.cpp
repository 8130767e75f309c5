// Method:     fork and exec with what the program says in memory; looked at every few milliseconds until it is done or late.
// Source:     Linux prctl(2) (PR_SET_PDEATHSIG), PNG Specification 5.2 (the signature), 11.2.5 (how it ends).
// Deviations: none.
#include "jobs/report/draw.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>
#include <vector>

namespace carillon::report {
namespace {

namespace fs = std::filesystem;

bool is_program(const fs::path& file) {
  std::error_code error;
  return fs::is_regular_file(file, error) && ::access(file.c_str(), X_OK) == 0;
}

/// As the system looks for programs, the folder of this one first.
std::optional<fs::path> find_draw_program() {
  std::error_code error;
  const fs::path beside = fs::read_symlink("/proc/self/exe", error).parent_path() / "carillon-draw";
  if (!error && is_program(beside)) return beside;
  const char* path = std::getenv("PATH");
  for (std::string_view left = path == nullptr ? "" : path; !left.empty();) {
    const std::size_t end = std::min(left.find(':'), left.size());
    const fs::path file = fs::path(left.substr(0, end)) / "carillon-draw";
    if (end > 0 && is_program(file)) return fs::absolute(file, error);
    left.remove_prefix(std::min(end + 1, left.size()));
  }
  return std::nullopt;
}

double get_seconds() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// In the child: nothing that takes memory or a lock.
[[noreturn]] void become(const char* program, char* const* arguments, int output, pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(127);
  const int nothing = ::open("/dev/null", O_RDWR);
  ::dup2(nothing, STDIN_FILENO);
  ::dup2(nothing, STDOUT_FILENO);
  ::dup2(output, STDERR_FILENO);
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGUSR1, SIGUSR2, SIGPIPE, SIGCHLD}) ::signal(number, SIG_DFL);
  sigset_t none;
  ::sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  ::execv(program, arguments);
  ::_exit(127);
}

/// Its status, or none when it took too long and was ended.
std::optional<int> wait_for(pid_t child, double limit_s) {
  const double end = get_seconds() + limit_s;
  for (int status = 0;;) {
    const pid_t ended = ::waitpid(child, &status, WNOHANG);
    if (ended == child) return status;
    if (ended < 0 && errno != EINTR) return 0;  // somebody else has waited for it; what it left tells
    if (get_seconds() > end) {
      ::kill(child, SIGKILL);
      while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
      }
      return std::nullopt;
    }
    const timespec pause{0, 10'000'000};
    ::nanosleep(&pause, nullptr);
  }
}

/// The last line of what it said, without the name of the program.
std::string find_last_words(int file) {
  std::array<char, 4096> text{};
  const off_t size = ::lseek(file, 0, SEEK_END);
  const off_t from = std::max<off_t>(0, size - static_cast<off_t>(text.size()));
  const ssize_t got = ::pread(file, text.data(), text.size(), from);
  std::string words(text.data(), static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
  while (!words.empty() && (words.back() == '\n' || words.back() == ' ')) words.pop_back();
  if (const auto line = words.rfind('\n'); line != std::string::npos) words.erase(0, line + 1);
  constexpr std::string_view kName = "carillon-draw: ";
  if (words.starts_with(kName)) words.erase(0, kName.size());
  return words;
}

bool is_whole_png(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::array<char, 8> first{}, last{};
  in.read(first.data(), 8);
  in.seekg(-8, std::ios::end);
  in.read(last.data(), 8);
  return in && std::memcmp(first.data(), "\x89PNG\r\n\x1a\n", 8) == 0 && std::memcmp(last.data(), "IEND\xae\x42\x60\x82", 8) == 0;
}

/// Why it failed, or nothing.
std::string run(const fs::path& program, const fs::path& bank, int modes, const fs::path& picture, double limit_s) {
  std::string numbers = "1";
  for (int mode = 2; mode <= modes; ++mode) numbers += fmt::format(",{}", mode);
  std::vector<std::string> words{program.string(), "modes", bank.string(), "-o", picture.string(), "--modes", numbers};
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);

  const int said = ::memfd_create("what carillon-draw says", MFD_CLOEXEC);
  if (said < 0) return fmt::format("carillon-draw cannot be started: {}", std::strerror(errno));
  const pid_t parent = ::getpid(), child = ::fork();
  if (child == 0) become(program.c_str(), arguments.data(), said, parent);
  const int fork_error = errno;
  const std::optional<int> status = child > 0 ? wait_for(child, limit_s) : std::nullopt;
  const std::string last_words = find_last_words(said);
  ::close(said);
  if (child < 0) return fmt::format("carillon-draw cannot be started: {}", std::strerror(fork_error));
  if (!status) return fmt::format("carillon-draw took longer than {:g} s and was ended", limit_s);
  if (WIFSIGNALED(*status)) return fmt::format("carillon-draw was ended by signal {}", WTERMSIG(*status));
  if (WEXITSTATUS(*status) == 0) return {};
  if (last_words.empty()) return fmt::format("carillon-draw failed with exit code {}", WEXITSTATUS(*status));
  return fmt::format("carillon-draw said: {}", last_words);
}

}  // namespace

Drawing draw_modes(const fs::path& given, const fs::path& bank, int modes, const fs::path& picture, double limit_s) {
  std::error_code error;
  fs::remove(picture, error);
  const std::optional<fs::path> program = given.empty() ? find_draw_program() : std::optional(fs::absolute(given, error));
  if (!program || !is_program(*program)) return {"carillon-draw is not installed here"};
  // In a folder of its own, which goes with all that is in it, whatever becomes of the program.
  std::string place = (fs::absolute(picture, error).parent_path() / ".drawing-XXXXXX").string();
  if (::mkdtemp(place.data()) == nullptr) return {fmt::format("there is no place to draw: {}", std::strerror(errno))};
  const fs::path drawn = fs::path(place) / picture.filename();
  Drawing drawing{run(*program, fs::absolute(bank, error), modes, drawn, limit_s)};
  if (drawing.fault.empty() && !is_whole_png(drawn)) drawing.fault = "carillon-draw left no picture";
  if (drawing.fault.empty()) {
    fs::rename(drawn, picture, error);
    if (error) drawing.fault = fmt::format("the picture cannot be kept: {}", error.message());
  }
  fs::remove_all(place, error);
  return drawing;
}

}  // namespace carillon::report
