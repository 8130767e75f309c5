// The limit on the size of files (ulimit -f), met as an error.
#pragma once

#include <csignal>

namespace carillon::base {

/// At the start of main(): a write beyond the limit fails with EFBIG, which is reported like a full disk. Without this the system ends the
/// program by SIGXFSZ, without a word. Programs that are started inherit it.
inline void report_file_limit() { std::signal(SIGXFSZ, SIG_IGN); }

}  // namespace carillon::base
