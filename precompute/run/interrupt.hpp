// Handling of SIGTERM, SIGINT, SIGHUP and SIGUSR1.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

namespace carillon::run {

/// From now on such a signal ends this process at once with exit code 128 + signal. The first rank prints one line, "PROGRAM: stopped by
/// SIGTERM; UNTOUCHED"; the mesher is ended, and temporary folders and TemporaryFiles are removed. Outputs are renamed into place when
/// complete (base::write_file) and need no cleanup. mpirun ends the other ranks after the first. Both texts must live as long as the
/// process. Call once, before the work.
void end_on_signals(const char* program, const char* untouched);

/// From now on SIGTERM and SIGUSR1 request a checkpoint: with unsaved work they only set is_stop_asked(); otherwise they end this process
/// at once with exit code kExitCheckpointed. Call once, after end_on_signals().
void save_on_signals();
/// Sets the presence of unsaved work; none at first. Local.
void set_news(bool has_news);
/// True after such a signal. Local.
bool is_stop_asked();
/// Name of the last signal, such as "SIGUSR1".
std::string find_stop_name();

/// A file removed by its destructor and by signals, unless a checkpoint needs it.
class TemporaryFile {
 public:
  static constexpr std::size_t kMost = 8;  // maximum number at a time
  explicit TemporaryFile(const std::filesystem::path& file);
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  void set_needed(bool is_needed);

 private:
  std::size_t place_ = 0;
};

}  // namespace carillon::run
