// The limit on the size of files (ulimit -f) as an error.
#pragma once

#include <csignal>

namespace carillon::base {

/// At the start of main(): a write beyond the limit fails with EFBIG, reported like a full disk, in place of a silent end by SIGXFSZ.
/// Child processes inherit it.
inline void report_file_limit() { std::signal(SIGXFSZ, SIG_IGN); }

}  // namespace carillon::base
