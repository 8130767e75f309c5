// Method: bytes 0..255 header, then the settings tried, the numbers of the solve, zeros up to a multiple of 4,096, and the columns in
//   groups of 16: per group node after node, per node x, y, z, each with the group's columns. SHA-256 covers everything but the columns,
//   whose records are hashed one by one and summed, so that each rank checks its own. A new file is written in the same folder, synced, and
//   renamed.
// Source: POSIX.1-2008 (open, pread, pwrite, fcntl, rename, fsync); nfs(5), "data and metadata coherence".
// Deviations: no HDF5: a truncated or altered file can crash its reader. No MPI-IO: it opens files by name on every rank, follows links,
//   and creates other files in the same folder.
#include "precompute/run/io/checkpoint_file.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <exception>
#include <utility>

#include "precompute/petsc/session.hpp"
#include "precompute/petsc/work.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/sha256.hpp"

namespace carillon::io {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr char kMagic[24] = "carillon checkpoint 1\n";
constexpr std::uint64_t kByteOrder = 0x0102030405060708;
constexpr int kGroup = 16;                    // columns
constexpr std::int64_t kAlign = 4096;         // of the first column
constexpr std::int64_t kMaxText = 1LL << 32;  // bytes of settings and numbers
constexpr std::int64_t kMaxRows = 1LL << 31, kMaxColumns = 1LL << 24;
constexpr std::size_t kMaxSettings = 100;
constexpr double kMinPause = 20;  // minimum interval of saves, in durations of the last save

struct RawHeader {
  char magic[24];
  std::uint64_t byte_order;
  Fingerprint job;
  Fingerprint system;
  char version[64];
  std::int64_t rows;
  std::int64_t columns;
  std::int64_t settings_bytes;
  std::int64_t numbers_bytes;
  std::int64_t total_bytes;
  std::uint64_t sum;
  char reserved[16];
  Fingerprint sha256;  // of the header with zeros here, the settings and the numbers
};
static_assert(sizeof(RawHeader) == 256, "The layout is fixed.");

std::int64_t find_data_start(std::int64_t settings_bytes, std::int64_t numbers_bytes) {
  const std::int64_t end = static_cast<std::int64_t>(sizeof(RawHeader)) + settings_bytes + numbers_bytes;
  return (end + kAlign - 1) / kAlign * kAlign;
}

Fingerprint seal(RawHeader header, const std::string& text) {
  header.sha256 = {};
  return base::calc_sha256(std::string(reinterpret_cast<const char*>(&header), sizeof header) + text);
}

std::uint64_t sum_records(const std::vector<double>& records, std::int64_t first, int group, int width) {
  std::uint64_t sum = 0;
  const std::size_t size = 3 * width;
  for (std::size_t i = 0; i * size < records.size(); ++i) {
    Mixer mixer(static_cast<std::uint64_t>(first) + i);
    mixer.add(static_cast<std::uint64_t>(group));
    for (std::size_t k = 0; k < size; ++k) mixer.add(records[i * size + k]);
    sum += mixer.get();
  }
  return sum;
}

/// Opens, calls, closes. Throws SystemError with the text of errno.
void with_descriptor(const fs::path& file, int flags, const std::function<bool(int)>& work) {
  const int descriptor = ::open(file.c_str(), flags | O_CLOEXEC | ((flags & O_DIRECTORY) != 0 ? 0 : O_NOFOLLOW), 0666);
  const bool ok = descriptor >= 0 && work(descriptor);
  const int error = errno;
  if (descriptor >= 0) ::close(descriptor);
  if (!ok) throw SystemError(std::strerror(error));
}

int find_width(std::int64_t columns, std::int64_t group) {
  return static_cast<int>(std::min<std::int64_t>(kGroup, columns - group * kGroup));
}

}  // namespace

/// A file shared by all ranks, each with its own descriptor. Others may write to its folder: rank 0 alone creates a new file, links are not
/// followed, and every rank verifies that it has opened that file. Creation and sync() are collective.
class SharedFile {
 public:
  enum class Use { create, read };
  SharedFile(const comm::Communicator& comm, const fs::path& file, Use use) : comm_(comm) {
    const bool creates = use == Use::create;
    // A name without a folder is in the current folder, where another program may have made a link; a path given by the user may be a link.
    const int links = creates || !file.has_parent_path() ? O_NOFOLLOW : 0;
    comm.agree([&] {
      if (comm.is_root()) open(file, links | (creates ? O_WRONLY | O_CREAT | O_EXCL : O_RDONLY));
    });
    const std::uint64_t number = comm.broadcast(number_);
    comm.agree([&] {
      if (!comm.is_root()) open(file, links | (creates ? O_WRONLY : O_RDONLY));
      if (number_ != number) throw SystemError(kReplaced);
    });
  }
  SharedFile(const SharedFile&) = delete;
  SharedFile& operator=(const SharedFile&) = delete;

  static constexpr const char* kReplaced = "its name now refers to another file";

  /// Local. Throws SystemError.
  void write(std::int64_t at, const void* bytes, std::size_t count) { move(at, count, true, static_cast<char*>(const_cast<void*>(bytes))); }
  void read(std::int64_t at, void* bytes, std::size_t count) { move(at, count, false, static_cast<char*>(bytes)); }
  /// Syncs this rank's writes to the disk. Local.
  void flush() {
    if (::fsync(own_.descriptor) != 0) throw SystemError(std::strerror(errno));
  }
  /// Syncs all ranks' writes to the disk. Collective.
  void sync() {
    comm_.agree([&] { flush(); });
  }
  /// True if `name` is this file and not a link. Local.
  bool has_name(const fs::path& name) const {
    struct stat info {};
    return ::lstat(name.c_str(), &info) == 0 && S_ISREG(info.st_mode) && info.st_ino == number_;
  }

 private:
  void open(const fs::path& file, int flags) {
    own_.descriptor = ::open(file.c_str(), flags | O_NONBLOCK | O_CLOEXEC, 0666);
    struct stat info {};
    struct statfs system {};
    if (own_.descriptor < 0 || ::fstat(own_.descriptor, &info) != 0) throw SystemError(std::strerror(errno));
    if (!S_ISREG(info.st_mode) || ((flags & O_ACCMODE) != O_RDONLY && info.st_nlink != 1)) throw SystemError(kReplaced);
    number_ = info.st_ino;
    locks_ = ::fstatfs(own_.descriptor, &system) == 0 && system.f_type == kNfs;
  }

  /// Hosts that write to one page of a file on NFS lose each other's bytes unless each has locked its own. Continues without locks if
  /// unsupported.
  void lock(std::int64_t at, std::size_t count, short kind) {
    struct flock range {};
    range.l_type = kind;
    range.l_whence = SEEK_SET;
    range.l_start = at;
    range.l_len = static_cast<off_t>(count);
    while (locks_ && ::fcntl(own_.descriptor, F_SETLKW, &range) != 0 && errno == EINTR) {
    }
  }

  void move(std::int64_t at, std::size_t count, bool writes, char* bytes) {
    lock(at, count, writes ? F_WRLCK : F_RDLCK);
    std::size_t done = 0;
    int error = 0;
    while (done < count && error == 0) {
      const std::size_t piece = std::min(count - done, kPiece);
      const off_t place = at + static_cast<off_t>(done);
      const ssize_t got =
          writes ? ::pwrite(own_.descriptor, bytes + done, piece, place) : ::pread(own_.descriptor, bytes + done, piece, place);
      if (got > 0) done += static_cast<std::size_t>(got);
      if (got == 0) break;
      if (got < 0 && errno != EINTR) error = errno;
    }
    lock(at, count, F_UNLCK);
    if (error != 0) throw SystemError(std::strerror(error));
    if (done < count) throw SystemError(writes ? "the disk is full" : "the file ends early");
  }

  static constexpr std::size_t kPiece = 32 << 20;  // bytes per disk access
  static constexpr long kNfs = 0x6969;             // statfs(2)
  comm::Communicator comm_;
  struct Own {
    int descriptor = -1;
    ~Own() {
      if (descriptor >= 0) ::close(descriptor);
    }
  } own_;
  std::uint64_t number_ = 0;  // of the file
  bool locks_ = false;
};

CheckpointFile::CheckpointFile(const comm::Communicator& comm, fs::path file, double every_s, const Fingerprint& job, CheckpointHost host)
    : comm_(comm), file_(std::move(file)), every_s_(every_s), job_(job), host_(std::move(host)), last_save_(Clock::now()) {
  temporary_ = file_.parent_path() / ("." + file_.filename().string().substr(0, 200) + ".new");
  checkpoint_.ask = [this] {
    const double pause = std::max(every_s_, kMinPause * save_seconds_);
    const bool is_due = comm_.is_root() && !is_ahead() && std::chrono::duration<double>(Clock::now() - last_save_).count() >= pause;
    return eigen::CheckpointRequest{host_.is_stop_requested(), is_due};
  };
  checkpoint_.save = [this](const std::string& numbers, const std::vector<eigen::Columns>& columns) { return save(numbers, columns); };
  checkpoint_.report_unsaved = [this](bool has_news) { host_.set_unsaved(has_news && !is_ahead()); };
  checkpoint_.read = [this](std::int64_t first, const eigen::Columns& into) { read_columns(first, into); };
  checkpoint_.reject = [this](const std::string& why) { set_aside(why); };
  look();
}

CheckpointFile::~CheckpointFile() = default;

/// Rank 0 only: the fault of the file, or nullopt; empty content if there is no file.
std::string CheckpointFile::read_content(Content& content) const {
  const int links = file_.has_parent_path() ? 0 : O_NOFOLLOW;  // as SharedFile
  const int descriptor = ::open(file_.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | links);
  if (descriptor < 0) return errno == ENOENT ? "" : std::string("it cannot be opened: ") + std::strerror(errno);
  struct Closer {
    int descriptor;
    ~Closer() { ::close(descriptor); }
  } closer{descriptor};
  struct stat info {};
  if (::fstat(descriptor, &info) != 0 || !S_ISREG(info.st_mode)) return "it is not a regular file";
  RawHeader header{};
  const auto read_all = [&](void* to, std::size_t size, std::int64_t at) {
    for (std::size_t done = 0; done < size;) {
      const ssize_t got = ::pread(descriptor, static_cast<char*>(to) + done, size - done, at + static_cast<std::int64_t>(done));
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) return false;
      done += static_cast<std::size_t>(got);
    }
    return true;
  };
  if (!read_all(&header, sizeof header, 0)) return "it is too short";
  if (std::memcmp(header.magic, kMagic, sizeof kMagic) != 0 || header.byte_order != kByteOrder)
    return "it is not a checkpoint of this format";
  const auto within = [](std::int64_t value, std::int64_t max) { return value >= 0 && value <= max; };
  if (!within(header.rows, kMaxRows) || !within(header.columns, kMaxColumns) || !within(header.settings_bytes, kMaxText) ||
      !within(header.numbers_bytes, kMaxText))
    return "it is damaged";
  const std::int64_t data_at = find_data_start(header.settings_bytes, header.numbers_bytes);
  const auto total = static_cast<std::int64_t>(data_at + 24.0 * static_cast<double>(header.rows) * static_cast<double>(header.columns));
  if (header.total_bytes != total || info.st_size != total) return "it is truncated or damaged";
  std::string text(header.settings_bytes + header.numbers_bytes, '\0');
  if (!read_all(text.data(), text.size(), sizeof header) || seal(header, text) != header.sha256) return "it is damaged";
  const std::string version(header.version, strnlen(header.version, sizeof header.version));
  if (version != cut_version()) return fmt::format("it was saved by another version, {}", version);
  if (header.job != job_) return "it is of another job";
  content.rows = header.rows;
  content.columns = header.columns;
  content.sum = header.sum;
  content.data_at = data_at;
  content.system = header.system;
  content.numbers = text.substr(header.settings_bytes);
  content.settings = text.substr(0, header.settings_bytes);
  return "";
}

void CheckpointFile::look() {
  Content content;
  const std::string trouble = comm_.broadcast([&] { return read_content(content); });
  if (!trouble.empty()) return set_aside(trouble);
  struct Sizes {
    std::int64_t rows, columns, data_at;
    std::uint64_t sum;
    Fingerprint system;
  };
  const Sizes sizes = comm_.broadcast(Sizes{content.rows, content.columns, content.data_at, content.sum, content.system});
  content.rows = sizes.rows;
  content.columns = sizes.columns;
  content.data_at = sizes.data_at;
  content.sum = sizes.sum;
  content.system = sizes.system;
  content.numbers = comm_.broadcast(std::move(content.numbers));
  content.settings = comm_.broadcast(std::move(content.settings));
  if (content.data_at == 0) return;  // no file
  content_ = std::move(content);
  try {
    eigen::NumberReader from(content_.settings);
    const std::int64_t count = from.get_count(1, kMaxSettings);
    for (std::int64_t i = 0; i < count; ++i) kept_settings_.push_back(read_setting(from));
    from.end();
  } catch (const InputError& error) {
    kept_settings_.clear();
    return set_aside(error.what());
  }
  is_there_ = true;
}

const Setting* CheckpointFile::find_setting(std::size_t trials) const {
  return is_there_ && trials < kept_settings_.size() ? &kept_settings_[trials] : nullptr;
}

void CheckpointFile::begin(const Setting& setting, const Fingerprint& system, const mesh::LocalMesh& local) {
  settings_.push_back(setting);
  system_ = system;
  order_ = std::make_unique<NodeOrder>(comm_, local);
  if (!is_there_ || is_ahead()) return;
  if (settings_.size() != kept_settings_.size() || system != content_.system) return set_aside("it is of another mesh");
  const std::string trouble = verify();
  if (!trouble.empty()) return set_aside(trouble);
  checkpoint_.numbers = content_.numbers;
  checkpoint_.column_count = content_.columns;
  host_.log(fmt::format("resumes from {}", file_.string()));
}

/// True if the columns are unchanged.
std::string CheckpointFile::verify() {
  if (content_.rows != order_->all()) return "it is of another mesh";
  std::uint64_t sum = 0;
  try {
    SharedFile file(comm_, file_, SharedFile::Use::read);
    NodeOrder::Room room;
    comm_.agree([&] {
      order_->make_room(kGroup, room);
      for (std::int64_t group = 0; group * kGroup < content_.columns; ++group) {
        const int width = find_width(content_.columns, group);
        room.records.resize(order_->count() * 3 * width);
        file.read(find_place(content_.data_at, group, width), room.records.data(), room.records.size() * sizeof(double));
        sum += sum_records(room.records, order_->first(), static_cast<int>(group), width);
      }
    });
  } catch (const SystemError& error) {
    return std::string("it cannot be read: ") + error.what();
  }
  return comm_.sum(sum) == content_.sum ? "" : "it is damaged";
}

std::int64_t CheckpointFile::find_place(std::int64_t data_at, std::int64_t group, int width) const {
  return data_at + 24 * (group * kGroup * order_->all() + order_->first() * width);
}

void CheckpointFile::read_columns(std::int64_t first, const eigen::Columns& into) const {
  SharedFile file(comm_, file_, SharedFile::Use::read);
  NodeOrder::Room room;
  std::vector<double> rows;  // of a group
  comm_.agree([&] {
    order_->make_room(kGroup, room);
    rows.resize(static_cast<std::size_t>(into.rows) * kGroup);
  });
  const std::int64_t last = first + into.count;
  for (std::int64_t group = first / kGroup; group * kGroup < last; ++group) {
    const eigen::Columns part{rows.data(), into.rows, into.rows, find_width(content_.columns, group)};
    comm_.agree([&] {
      room.records.resize(order_->count() * 3 * part.count);
      file.read(find_place(content_.data_at, group, part.count), room.records.data(), room.records.size() * sizeof(double));
    });
    order_->from_records(room, part);
    for (int j = 0; j < part.count; ++j) {
      const std::int64_t column = group * kGroup + j;
      if (column >= first && column < last) std::copy_n(part.column(j), into.rows, into.column(static_cast<int>(column - first)));
    }
  }
}

/// Warns of the reason why the file is not used, and renames it, so that its owner keeps it.
void CheckpointFile::set_aside(const std::string& why) {
  is_there_ = false;
  checkpoint_.numbers.clear();
  checkpoint_.column_count = 0;
  if (comm_.is_root()) {
    const fs::path aside = file_.string() + ".aside";
    const bool is_moved = ::rename(file_.c_str(), aside.c_str()) == 0;
    host_.warn(fmt::format("{}: the checkpoint is not resumed from, because {}{}", file_.string(), why,
                           is_moved ? "; it is now " + aside.filename().string() : ""));
  }
  MPI_Barrier(comm_);
}

bool CheckpointFile::save(const std::string& numbers, const std::vector<eigen::Columns>& columns) {
  if (is_ahead()) return true;  // the file is of a later setting: keep it
  const petsc::WorkScope scope(petsc::WorkPhase::kWrite);
  const auto start = Clock::now();
  std::string trouble;
  try {
    write(numbers, columns);
  } catch (const SystemError& error) {
    trouble = error.what();
  }
  last_save_ = Clock::now();
  save_seconds_ = std::chrono::duration<double>(last_save_ - start).count();
  if (trouble.empty()) {
    is_there_ = false;  // the content of the former run is replaced
    was_saved_ = true;
    last_trouble_.clear();
    return true;
  }
  if (comm_.is_root()) ::unlink(temporary_.c_str());
  if (trouble != last_trouble_)
    host_.warn(
        fmt::format("{}: the checkpoint cannot be saved: {}; the solve continues, and the previous one stays", file_.string(), trouble));
  last_trouble_ = trouble;
  return false;
}

/// Throws SystemError on every rank.
void CheckpointFile::write(const std::string& numbers, const std::vector<eigen::Columns>& columns) {
  std::int64_t count = 0;
  for (const eigen::Columns& part : columns) count += part.count;
  RawHeader header{};
  std::string text;
  comm_.agree([&] {
    if (comm_.is_root()) ::unlink(temporary_.c_str());  // of a killed run
  });
  eigen::NumberWriter settings;
  settings.add(static_cast<std::int64_t>(settings_.size()));
  for (const Setting& setting : settings_) write_setting(settings, setting);
  text = settings.bytes + numbers;
  std::memcpy(header.magic, kMagic, sizeof kMagic);
  header.byte_order = kByteOrder;
  header.job = job_;
  header.system = system_;
  const std::string version = cut_version();
  std::copy(version.begin(), version.end(), header.version);
  header.rows = order_->all();
  header.columns = count;
  header.settings_bytes = static_cast<std::int64_t>(settings.bytes.size());
  header.numbers_bytes = static_cast<std::int64_t>(numbers.size());
  const std::int64_t data_at = find_data_start(header.settings_bytes, header.numbers_bytes);
  header.total_bytes = data_at + 24 * header.rows * count;
  SharedFile file(comm_, temporary_, SharedFile::Use::create);
  header.sum = write_columns(file, data_at, count, columns);
  file.sync();
  comm_.agree([&] {
    if (!comm_.is_root()) return;
    header.sha256 = seal(header, text);
    std::string start(reinterpret_cast<const char*>(&header), sizeof header);
    start += text;
    start.resize(data_at, '\0');
    file.write(0, start.data(), start.size());
    file.flush();
    if (::rename(temporary_.c_str(), file_.c_str()) != 0) throw SystemError(std::strerror(errno));
    if (!file.has_name(file_)) throw SystemError(SharedFile::kReplaced);
    const fs::path folder = base::find_folder(file_);
    try {
      with_descriptor(folder, O_RDONLY | O_DIRECTORY, [](int descriptor) { return ::fsync(descriptor) == 0; });
    } catch (const SystemError&) {  // unsupported by some file systems; the name is in place
    }
  });
}

/// Every rank writes its range of every group. Returns the sum of all record hashes. Throws SystemError on every rank.
std::uint64_t CheckpointFile::write_columns(SharedFile& file, std::int64_t data_at, std::int64_t count,
                                            const std::vector<eigen::Columns>& columns) const {
  std::vector<const double*> all;  // start of each column
  for (const eigen::Columns& part : columns)
    for (int j = 0; j < part.count; ++j) all.push_back(part.column(j));
  NodeOrder::Room room;
  comm_.agree([&] { order_->make_room(kGroup, room); });
  std::exception_ptr trouble;
  std::uint64_t sum = 0;
  for (std::int64_t group = 0; group * kGroup < count; ++group) {
    const int width = find_width(count, group);
    order_->to_records({all.data() + group * kGroup, static_cast<std::size_t>(width)}, room);
    sum += sum_records(room.records, order_->first(), static_cast<int>(group), width);
    if (trouble) continue;  // the others wait for data of this rank
    try {
      file.write(find_place(data_at, group, width), room.records.data(), room.records.size() * sizeof(double));
    } catch (...) {
      trouble = std::current_exception();
    }
  }
  comm_.agree(trouble);
  return comm_.sum(sum);
}

void CheckpointFile::end() {
  checkpoint_.numbers.clear();
  checkpoint_.column_count = 0;
  order_.reset();
  host_.set_unsaved(false);
}

eigen::CheckpointRequest CheckpointFile::vote() const { return eigen::vote(comm_, checkpoint_); }

void CheckpointFile::finish() { host_.set_unsaved(true); }

void CheckpointFile::remove() {
  is_there_ = false;
  if (!comm_.is_root()) return;
  ::unlink(temporary_.c_str());
  ::unlink(file_.c_str());
}

std::string CheckpointFile::cut_version() const { return find_program_version().substr(0, sizeof RawHeader{}.version); }

}  // namespace carillon::io
