// Method: the handler calls only async-signal-safe functions (signal-safety(7)): write, poll, unlink, _exit, and those of
//   runtime/base/temporary.
// Source: POSIX.1-2008, 2.4.3.
#include "precompute/run/interrupt.hpp"

#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <array>
#include <cstring>

#include "runtime/base/environment.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/temporary.hpp"

namespace carillon::run {
namespace {

constexpr int kFirstRankMs = 200;

struct Temporary {
  std::array<char, 4096> file{};
  volatile sig_atomic_t is_removed = 0;  // removed by a signal
  bool is_used = false;
};
std::array<Temporary, TemporaryFile::kMost> temporaries;
volatile sig_atomic_t is_speaker = 1;
const char *program_name = "", *untouched_text = "";
volatile sig_atomic_t saves = 0;
volatile sig_atomic_t has_news = 0;
volatile sig_atomic_t stop_signal = 0;

void print(const char* text) { (void)!write(STDERR_FILENO, text, std::strlen(text)); }

const char* find_name(int signal) {
  return signal == SIGTERM ? "SIGTERM" : signal == SIGINT ? "SIGINT" : signal == SIGHUP ? "SIGHUP" : "SIGUSR1";
}

void handle(int signal) {
  const bool is_to_save = saves != 0 && (signal == SIGTERM || signal == SIGUSR1);
  if (is_to_save && has_news != 0) {
    stop_signal = signal;
    return;
  }
  base::end_children_and_temporaries();
  for (const Temporary& one : temporaries)
    if (one.is_removed != 0) unlink(one.file.data());
  if (is_speaker != 0) {
    for (const char* text : {program_name, ": stopped by ", find_name(signal), "; "}) print(text);
    print(is_to_save ? "the run can be resumed from the checkpoint" : untouched_text);
    print("\n");
  } else {
    poll(nullptr, 0, kFirstRankMs);  // mpirun ends all ranks after the first exit, which should be that of the printing rank
  }
  _exit(is_to_save ? kExitCheckpointed : 128 + signal);
}

}  // namespace

void end_on_signals(const char* program, const char* untouched) {
  is_speaker = base::is_first_of_all() ? 1 : 0;
  program_name = program;
  untouched_text = untouched;
  struct sigaction action {};
  action.sa_handler = handle;
  sigfillset(&action.sa_mask);
  action.sa_flags = SA_RESTART;
  for (const int signal : {SIGTERM, SIGINT, SIGHUP}) {
    struct sigaction before {};
    // Keep signals ignored that were ignored at the start (nohup, shells without job control).
    if (sigaction(signal, nullptr, &before) == 0 && before.sa_handler != SIG_IGN) sigaction(signal, &action, nullptr);
  }
  ::signal(SIGXFSZ, SIG_IGN);  // exceeding the file size limit becomes a write error with a message
}

void save_on_signals() {
  saves = 1;
  struct sigaction action {};
  action.sa_handler = handle;
  sigfillset(&action.sa_mask);
  action.sa_flags = SA_RESTART;
  sigaction(SIGUSR1, &action, nullptr);
}

void set_news(bool is_new) { has_news = is_new ? 1 : 0; }

bool is_stop_asked() { return stop_signal != 0; }

std::string find_stop_name() { return stop_signal == 0 ? "a signal" : find_name(stop_signal); }

TemporaryFile::TemporaryFile(const std::filesystem::path& file) {
  const std::string& name = file.native();
  if (name.size() >= temporaries[0].file.size()) throw InputError(name + ": this path is too long for a temporary file");
  while (temporaries.at(place_).is_used) ++place_;
  Temporary& own = temporaries[place_];
  std::memcpy(own.file.data(), name.c_str(), name.size() + 1);
  own.is_used = true;
  own.is_removed = 1;
}

TemporaryFile::~TemporaryFile() {
  Temporary& own = temporaries[place_];
  if (own.is_removed != 0) unlink(own.file.data());
  own.is_removed = 0;
  own.is_used = false;
}

void TemporaryFile::set_needed(bool is_needed) { temporaries[place_].is_removed = is_needed ? 0 : 1; }

}  // namespace carillon::run
