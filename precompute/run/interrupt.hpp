// What happens when a run is stopped from outside by SIGTERM, SIGINT, SIGHUP or SIGUSR1.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

namespace carillon::run {

/// From now on such a signal ends this process at once with exit code 128 + signal: the first of all prints one line, "PROGRAM: stopped by
/// SIGTERM; UNTOUCHED", the mesher is ended, and temporary folders and TemporaryFiles that exist are removed. Nothing else needs
/// to be undone: outputs have no name before they are whole (base::write_file). mpirun ends the other ranks when one of them is ended like
/// this. Both texts live as long as the process. Call once, before the work.
void end_on_signals(const char* program, const char* untouched);

/// From now on SIGTERM and SIGUSR1 ask for what has been done to be saved: where there is news they only set is_stop_asked(), and otherwise
/// they end this process at once, with exit code kExitCheckpointed. Call once, after end_on_signals().
void save_on_signals();
/// Whether there is something that is not saved: nothing, at first. Local.
void set_news(bool has_news);
/// Whether such a signal came. Local.
bool is_stop_asked();
/// "SIGUSR1"; of the last one that came.
std::string find_stop_name();

/// A file that is of no use when the run ends: its destructor removes it, and so does a signal; not while a checkpoint needs it.
class TemporaryFile {
 public:
  static constexpr std::size_t kMost = 8;  // at a time
  explicit TemporaryFile(const std::filesystem::path& file);
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  void set_needed(bool is_needed);

 private:
  std::size_t place_ = 0;
};

}  // namespace carillon::run
