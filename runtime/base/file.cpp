#include "runtime/base/file.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <system_error>
#include <utility>

#include "runtime/base/descriptor.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/foreign.hpp"
#include "runtime/base/message.hpp"
#include "runtime/base/signal_pause.hpp"
#include "runtime/base/temporary.hpp"

namespace carillon::base {

namespace fs = std::filesystem;

fs::path find_folder(const fs::path& file) { return file.has_parent_path() ? file.parent_path() : fs::path("."); }

namespace {

/// Hidden name in the folder of `file`, unique to process and call, since two threads may write one file. Adds some forty bytes to the
/// name, truncated to a file system's limit of 255.
fs::path make_temporary_name(const fs::path& file) {
  static std::atomic<unsigned> count{0};
  return find_folder(file) / fmt::format(".{}.tmp.{}.{}", file.filename().string().substr(0, 200), ::getpid(), count++);
}

void sync_folder(const fs::path& folder) {
  const Descriptor fd(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd.get() >= 0) ::fsync(fd.get());
}

}  // namespace

bool is_full_error(int error) { return error == ENOSPC || error == EDQUOT || error == EFBIG; }

namespace {

/// Opens a regular file for reading; `length`: its size [byte].
int open_regular(const fs::path& file, std::string_view what, std::uint64_t& length) {
  // O_NONBLOCK: do not wait for a writer of a pipe.
  const int fd = ::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) {
    throw InputError(
        fmt::format("{}: cannot open this {}: {}; check the path{}", find_name(file), what, std::strerror(errno), hint_backslash(file)));
  }
  struct stat info {};
  if (::fstat(fd, &info) != 0 || !S_ISREG(info.st_mode)) {
    ::close(fd);
    throw InputError(fmt::format("{}: a {} must be a regular file, and this is {}; name the file itself", find_name(file), what,
                                 S_ISDIR(info.st_mode) ? "a folder" : "a pipe or a device"));
  }
  length = static_cast<std::uint64_t>(info.st_size);
  return fd;
}

/// Reads `count` bytes, fewer at end of file.
std::size_t read_some(int fd, char* bytes, std::size_t count, const fs::path& file, std::string_view what) {
  std::size_t done = 0;
  while (done < count) {
    const ssize_t got = ::read(fd, bytes + done, count - done);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw InputError(fmt::format("{}: cannot read this {}: {}; check the disk", find_name(file), what, std::strerror(errno)));
    if (got == 0) break;
    done += static_cast<std::size_t>(got);
  }
  return done;
}

}  // namespace

std::string read_file(const fs::path& file, std::string_view what, std::uint64_t max_bytes, std::string_view remedy) {
  std::uint64_t length = 0;
  const Descriptor fd(open_regular(file, what, length));
  if (length > max_bytes) {
    throw InputError(fmt::format("{}: {} bytes are too many for a {} (at most {}); {}", find_name(file), length, what, max_bytes, remedy));
  }
  std::string bytes(length, '\0');
  bytes.resize(read_some(fd.get(), bytes.data(), bytes.size(), file, what));  // shorter if the file shrank meanwhile
  return bytes;
}

void read_pieces(const fs::path& file, std::string_view what, std::size_t piece_bytes, const std::function<void(std::string_view)>& take) {
  std::uint64_t length = 0;
  const Descriptor fd(open_regular(file, what, length));
  std::string piece(piece_bytes, '\0');
  for (std::uint64_t done = 0; done < length;) {  // appended bytes are not read
    const std::size_t wanted = std::min<std::uint64_t>(piece_bytes, length - done);
    const std::size_t got = read_some(fd.get(), piece.data(), wanted, file, what);
    if (got == 0) return;
    take(std::string_view(piece).substr(0, got));
    done += got;
  }
}

namespace {

/// Nameless file in `folder`, gone with its last descriptor; -1 if unsupported (NFS, FAT).
int open_nameless(const fs::path& folder) {
  if (::access("/proc/self/fd", X_OK) != 0) return -1;  // needed by link_nameless()
  return ::open(folder.c_str(), O_WRONLY | O_TMPFILE | O_CLOEXEC, 0666);
}

/// Links a nameless file to `name`. Returns 0 or errno.
int link_nameless(int descriptor, const fs::path& name) {
  const std::string self = fmt::format("/proc/self/fd/{}", descriptor);
  return ::linkat(AT_FDCWD, self.c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) == 0 ? 0 : errno;
}

}  // namespace

std::vector<int> list_descriptors() {
  std::vector<int> open;
  std::error_code error;
  for (fs::directory_iterator it("/proc/self/fd", error), end; !error && it != end; it.increment(error))
    open.push_back(std::atoi(it->path().filename().c_str()));
  return open;
}

int write_all(int descriptor, std::string_view bytes) noexcept {
  while (!bytes.empty()) {
    const ssize_t put = ::write(descriptor, bytes.data(), bytes.size());
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) return put < 0 ? errno : ENOSPC;
    bytes.remove_prefix(put);
  }
  return 0;
}

WholeFile::WholeFile(fs::path file) : file_(std::move(file)), temporary_(make_temporary_name(file_)) {
  ::unlink(temporary_.c_str());  // left by a killed process of the same PID; O_EXCL follows no planted link
  descriptor_ = open_nameless(find_folder(file_));
  is_nameless_ = descriptor_ >= 0;
  if (!is_nameless_) descriptor_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (descriptor_ < 0) refuse(errno);
}

WholeFile::~WholeFile() {
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  if (!is_nameless_) ::unlink(temporary_.c_str());
}

void WholeFile::refuse(int error) {
  if (descriptor_ >= 0) ::close(descriptor_);
  descriptor_ = -1;
  ::unlink(temporary_.c_str());
  throw_system_error(error, fmt::format("{}: cannot write: {}; {}", find_name(file_), std::strerror(error), find_advice(error)));
}

void WholeFile::append(std::string_view bytes) {
  if (const int error = write_all(descriptor_, bytes); error != 0) refuse(error);
}

void WholeFile::overwrite(std::uint64_t at, std::string_view bytes) {
  const off_t end = ::lseek(descriptor_, 0, SEEK_CUR);
  if (end < 0 || ::lseek(descriptor_, static_cast<off_t>(at), SEEK_SET) < 0) refuse(errno);
  append(bytes);
  if (::lseek(descriptor_, end, SEEK_SET) < 0) refuse(errno);
}

void WholeFile::commit() {
  if (::fsync(descriptor_) != 0) refuse(errno);
  {
    // No temporary name is left behind, unless another thread takes a signal just now.
    const SignalPause pause;
    if (is_nameless_) {
      if (const int error = link_nameless(descriptor_, temporary_); error != 0) refuse(error);
    }
    if (::close(std::exchange(descriptor_, -1)) != 0) refuse(errno);
    if (::rename(temporary_.c_str(), file_.c_str()) != 0) refuse(errno);
  }
  sync_folder(find_folder(file_));
}

void write_file(const fs::path& file, std::string_view bytes) {
  WholeFile whole(file);
  whole.append(bytes);
  whole.commit();
}

namespace {

[[noreturn]] void refuse_folder(const std::filesystem::path& folder, const std::error_code& error) {
  throw SystemError(fmt::format("{}: {}; make room, or choose another place", find_name(folder), error.message()));
}

}  // namespace

WholeFolder::WholeFolder(std::filesystem::path place) : place_(std::move(place)) {
  std::error_code error;
  for (std::filesystem::path above = place_.parent_path(); !above.empty() && !std::filesystem::exists(above, error);
       above = above.parent_path())
    made_.push_back(above);
  std::filesystem::create_directories(place_.parent_path(), error);
  if (error) refuse_folder(place_, error);
  path_ = make_temporary_folder(place_.parent_path().empty() ? "." : place_.parent_path(), "." + place_.filename().string() + ".");
  std::filesystem::permissions(path_, std::filesystem::perms(0755), error);
}

WholeFolder::~WholeFolder() {
  std::error_code error;
  if (path_.empty()) return;
  remove_temporary_folder(path_);
  for (const std::filesystem::path& above : made_) std::filesystem::remove(above, error);  // removes empty ones only
}

void WholeFolder::commit() {
  const WholeStep step;
  std::error_code error;
  const std::filesystem::path before = path_.string() + ".before";  // keep the old folder until the new one is in place
  const bool has_before = std::filesystem::exists(place_, error);
  if (has_before) std::filesystem::rename(place_, before, error);
  if (error) refuse_folder(place_, error);
  std::filesystem::rename(path_, place_, error);
  if (error) {
    std::error_code ignored;
    if (has_before) std::filesystem::rename(before, place_, ignored);
    refuse_folder(place_, error);
  }
  keep_temporary_folder(path_, place_);
  path_.clear();
  if (has_before) std::filesystem::remove_all(before, error);
}

fs::path find_replaceable(const fs::path& folder, const std::function<bool(const fs::path&)>& is_ours, std::string_view what) {
  fs::path place = fs::absolute(folder).lexically_normal();
  if (place.filename().empty()) place = place.parent_path();
  std::error_code error;
  if (!fs::exists(place, error)) return place;
  bool is_free = fs::is_directory(place, error);
  if (is_free)
    for (const fs::directory_entry& entry : fs::directory_iterator(place, error)) is_free = is_free && is_ours(entry.path());
  if (!is_free || error)
    throw InputError(
        fmt::format("{}: contains other files, and {} is replaced as a whole; give another one with -o", folder.string(), what));
  return place;
}

std::string find_extension(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return std::tolower(c); });
  return extension;
}

void check_writable(const fs::path& file, std::string_view what) {
  std::error_code error;
  if (file.filename().empty()) throw InputError(fmt::format("{}: the {} needs a file name after the folder", find_name(file), what));
  const auto status = fs::status(file, error);
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    throw InputError(fmt::format("{}: the {} cannot be written here: this is {}; name a file", find_name(file), what,
                                 fs::is_directory(status) ? "a folder" : "a pipe or a device"));
  }
  struct stat info {};
  const fs::path folder = find_folder(file);
  fs::create_directories(folder, error);
  if (error || !fs::is_directory(folder)) {
    throw InputError(fmt::format("{}: cannot make the folder of the {} ({}); choose another place", find_name(folder), what,
                                 error ? error.message() : "it is not a folder"));
  }
  const fs::path probe = make_temporary_name(file);
  for (const fs::path& name : {file, probe}) {
    if (::lstat(name.c_str(), &info) != 0 && errno != ENOENT) {  // name too long, or a symlink loop
      throw InputError(
          fmt::format("{}: the {} cannot be written here: {}; choose another name", find_name(file), what, std::strerror(errno)));
    }
  }
  // A nameless file leaves nothing behind, whenever the program is ended.
  if (const Descriptor nameless(open_nameless(folder)); nameless.get() >= 0) return;
  ::unlink(probe.c_str());  // left by a killed process of the same PID; O_EXCL follows no planted link
  const SignalPause pause;
  const Descriptor fd(::open(probe.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (fd.get() < 0) {
    throw InputError(fmt::format("{}: the {} cannot be written here: {}; choose a folder that you may write to", find_name(file), what,
                                 std::strerror(errno)));
  }
  ::unlink(probe.c_str());
}

}  // namespace carillon::base
