// Writing banks so that at every moment the name holds either the old bank or the new one, whole.
// Method: the bytes are made in memory, go to a temporary file in the same folder, to the disk (fsync), and take the name by rename(2).
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/hdf5_image.hpp"
#include "runtime/bank/layout.hpp"
#include "runtime/bank/seal.hpp"

namespace carillon::bank {
namespace {

namespace fs = std::filesystem;

SystemError refusal(const fs::path& file, const char* what, int error) {
  const char* mend =
      error == ENOSPC || error == EDQUOT ? "make room on the disk and write it again" : "choose another place or mend its permissions";
  return SystemError(fmt::format("{}: the bank cannot be {}: {}; {}", file.string(), what, std::strerror(error), mend));
}

/// A new file that disappears unless it was renamed.
class TemporaryFile {
 public:
  explicit TemporaryFile(const fs::path& target) : target_(target) {
    static std::atomic<unsigned> count{0};
    path_ = target;
    path_ += fmt::format(".tmp-{}-{}", ::getpid(), count++);
    // One that a killed process with our number left behind may be there.
    ::unlink(path_.c_str());
    descriptor_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (descriptor_ < 0) throw refusal(target_, "written", errno);
  }
  ~TemporaryFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
    if (!renamed_) ::unlink(path_.c_str());
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  void write(std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
      const ssize_t put = ::write(descriptor_, bytes.data(), bytes.size());
      if (put < 0 && errno == EINTR) continue;
      if (put < 0) throw refusal(target_, "written", errno);
      bytes = bytes.subspan(static_cast<std::size_t>(put));
    }
  }

  void take_name() {
    if (::fsync(descriptor_) != 0) throw refusal(target_, "brought to the disk", errno);
    const int status = ::close(descriptor_);
    descriptor_ = -1;
    if (status != 0) throw refusal(target_, "brought to the disk", errno);
    if (::rename(path_.c_str(), target_.c_str()) != 0) throw refusal(target_, "given its name", errno);
    renamed_ = true;
    // The new name reaches the disk with the folder. Some file systems refuse to sync a folder; the bank itself is safe there.
    const fs::path folder = target_.has_parent_path() ? target_.parent_path() : fs::path(".");
    const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor >= 0) {
      ::fsync(descriptor);
      ::close(descriptor);
    }
  }

 private:
  fs::path target_;
  fs::path path_;
  int descriptor_ = -1;
  bool renamed_ = false;
};

/// Where the bytes shall go: links are followed, and only a regular file is ever replaced.
fs::path resolve_target(const fs::path& file) {
  if (file.empty() || !file.has_filename()) throw InputError(fmt::format("\"{}\" names no file; give the bank a file name", file.string()));
  std::error_code error;
  const fs::path target = fs::exists(file, error) ? fs::canonical(file, error) : file;
  if (error) throw refusal(file, "written", error.value());
  const fs::file_status status = fs::status(target, error);
  if (fs::is_directory(status)) throw InputError(fmt::format("{}: is a folder; give the bank a file name inside it", file.string()));
  if (fs::exists(status) && !fs::is_regular_file(status))
    throw InputError(fmt::format("{}: is not a regular file; give the bank another name", file.string()));
  const fs::path folder = target.has_parent_path() ? target.parent_path() : fs::path(".");
  if (!fs::is_directory(folder, error)) {
    throw InputError(fmt::format("{}: there is no folder {}; make it or choose another", file.string(), folder.string()));
  }
  return target;
}

template <std::size_t N>
void copy_text(const std::string& text, std::array<char, N>& padded) {
  std::copy_n(text.begin(), std::min(text.size(), N), padded.begin());
}

}  // namespace

void write_bank(const Bank& bank, const fs::path& file) {
  const auto faults = find_faults(bank);
  if (!faults.empty()) {
    throw InputError(fmt::format("{}: this bank is not sane and is not written: {}{}", file.string(), faults[0],
                                 faults.size() > 1 ? fmt::format(" (and {} more)", faults.size() - 1) : ""));
  }
  const fs::path target = resolve_target(file);

  FileForm form;
  for (std::size_t i = 0; i < bank.mode_count(); ++i) form.freq_hz.push_back(bank.freq_hz(i));
  form.complete = bank.complete ? 1 : 0;
  copy_text(bank.element, form.element);
  copy_text(bank.mass, form.mass);
  form.provenance = bank.provenance.empty() ? std::string(1, '\0') : bank.provenance;

  const Hdf5Image image = make_hdf5_image(bank, list_fields(bank, form));
  const std::span<std::byte> bytes = image.bytes;
  const std::string text = format_seal_text(bytes.size(), image.extents);
  std::memcpy(bytes.data(), text.data(), kTextBytes);
  Digest digest;
  digest.update(bytes.first(kTextBytes));
  digest.update(bytes.subspan(kSealBytes));
  std::memcpy(bytes.data() + kTextBytes, digest.finish().data(), kDigestBytes);

  TemporaryFile temporary(target);
  temporary.write(bytes);
  temporary.take_name();
}

}  // namespace carillon::bank
