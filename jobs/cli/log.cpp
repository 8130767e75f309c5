// carillon log: output of the solver.
#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <thread>

#include "jobs/cli/commands.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"

namespace carillon::cli {
namespace {

namespace fs = std::filesystem;

constexpr auto kPause = std::chrono::milliseconds(300);
constexpr off_t kMaxJsonBytes = 16 << 20;

/// Reads at most `max` bytes at offset `from` and advances it. Empty at the end.
std::string read_from(const fs::path& file, off_t& from, off_t max) {
  std::string bytes;
  const int fd = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0 && (errno == EACCES || errno == EPERM))
    throw InputError(fmt::format("{}: you may not read this log; ask the owner of the store", file.string()));
  if (fd < 0) return bytes;
  struct stat info {};
  if (::fstat(fd, &info) == 0 && S_ISREG(info.st_mode) && info.st_size > from) {
    bytes.resize(std::min(max, info.st_size - from));
    const ssize_t got = ::pread(fd, bytes.data(), bytes.size(), from);
    bytes.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
    from += static_cast<off_t>(bytes.size());
  }
  ::close(fd);
  return bytes;
}

int print_log(Shared& shared, registry::Job job, bool follows) {
  off_t at = 0;
  if (shared.json) {
    const fs::path file = shared.store().find_folder(job.id) / store::kLogFile;
    base::Json root;
    root.set("id", job.id.text()).set("state", to_text(job.state)).set("file", to_json(file.string()));
    struct stat info {};
    if (::stat(file.c_str(), &info) == 0) at = std::max<off_t>(0, info.st_size - kMaxJsonBytes);
    root["text"] = to_json(read_from(file, at, kMaxJsonBytes));
    print_json(root);
    return 0;
  }
  for (;;) {
    const bool is_last = !follows || !is_open(job.state);  // checked before reading: the log is complete after the end
    for (std::string bytes; !(bytes = read_from(shared.store().find_folder(job.id) / store::kLogFile, at, 1 << 20)).empty();) {
      // Keep an incomplete UTF-8 character for the next piece.
      std::size_t whole = bytes.size();
      while (whole > 0 && bytes.size() - whole < 3 && (static_cast<unsigned char>(bytes[whole - 1]) & 0xC0U) == 0x80U) --whole;
      if (whole > 0 && (static_cast<unsigned char>(bytes[whole - 1]) & 0xC0U) == 0xC0U) --whole;
      if (bytes.size() == (1 << 20) && whole > 0) {
        at -= static_cast<off_t>(bytes.size() - whole);
        bytes.resize(whole);
      }
      fmt::print("{}", base::printable_lines(bytes));
    }
    if (std::fflush(stdout) != 0) throw SystemError("the output cannot be written");
    if (is_last) break;
    std::this_thread::sleep_for(kPause);
    shared.settle();
    job = shared.registry().find(job.id).value_or(job);
  }
  if (at == 0) fmt::print(stderr, "carillon: {} has no output yet; it is {}\n", job.id.short_text(), to_text(job.state));
  return at == 0 ? kExitNotYet : 0;
}

}  // namespace

int run_log(Shared& shared, const LogOptions& options) {
  shared.only_reads = true;
  shared.settle();
  const std::vector<registry::Job> jobs = find_jobs(shared, {options.word});
  if (jobs.size() == 1) return print_log(shared, jobs.front(), options.follow);
  if (options.follow || shared.json)
    throw InputError(fmt::format("{}: matches {} jobs, but {} needs one; name one of them", show(options.word), jobs.size(),
                                 options.follow ? "--follow" : "--json"));
  int code = 0;
  for (const registry::Job& job : jobs) {
    fmt::print("== {}  {}\n", job.id.short_text(), show(job.name));
    code = std::max(code, print_log(shared, job, false));
  }
  return code;
}

}  // namespace carillon::cli
