#include "precompute/run/io/progress_file.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "runtime/base/error.hpp"
#include "runtime/base/json.hpp"

namespace carillon::io {
namespace {

base::Descriptor open_to_append(const std::filesystem::path& file) {
  const auto refuse = [&](const char* why) -> InputError {
    return InputError(fmt::format("{}: the progress file cannot be written: {}; give another with --progress", file.string(), why));
  };
  // O_NONBLOCK: a pipe without a reader would block open(). A name without a folder is in the current folder, where another user may have
  // made a link.
  const int links = file.has_parent_path() ? 0 : O_NOFOLLOW;
  base::Descriptor descriptor(::open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NONBLOCK | O_NOCTTY | links, 0666));
  if (descriptor.get() < 0) throw refuse(std::strerror(errno));
  struct stat info {};
  if (::fstat(descriptor.get(), &info) != 0 || !(S_ISREG(info.st_mode) || S_ISCHR(info.st_mode))) throw refuse("not a regular file");
  return descriptor;
}

base::Json describe_state(const ProgressLine& line) {
  base::Json object = base::Json::object();
  object.set("phase", line.phase).set("percent", base::decimals(line.percent, 2)).set("modes_done", line.modes_done);
  if (line.modes_wanted) object.set("modes_wanted", *line.modes_wanted);
  return object;
}

}  // namespace

std::string format_progress(const ProgressLine& line) {
  base::Json object = describe_state(line);
  if (line.seconds_left) object.set("seconds_left", base::decimals(*line.seconds_left, 1));
  return object.set("seconds", base::decimals(line.seconds, 2)).line() + "\n";
}

ProgressFile::ProgressFile(const std::filesystem::path& file) : file_(open_to_append(file)) {}

bool ProgressFile::append(const ProgressLine& line) {
  std::string state = describe_state(line).line();
  if (state == last_ || is_broken_) return true;
  last_ = std::move(state);
  const std::string text = format_progress(line);
  is_broken_ = ::write(file_.get(), text.data(), text.size()) != static_cast<ssize_t>(text.size());
  return !is_broken_;
}

}  // namespace carillon::io
