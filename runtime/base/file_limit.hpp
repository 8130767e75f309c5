// File size limit (ulimit -f) as an error.
#pragma once

#include <csignal>

namespace carillon::base {

/// Call first in main(): writes beyond the limit then fail with EFBIG, reported like a full disk, instead of ending the process by SIGXFSZ.
/// Inherited by children.
inline void report_file_limit() { std::signal(SIGXFSZ, SIG_IGN); }

}  // namespace carillon::base
