// A web server for this machine alone.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "runtime/base/error.hpp"

namespace carillon::explore {

/// Serves the files of a folder at http://127.0.0.1:PORT/ until the process is sent SIGINT or SIGTERM; the number of that signal. Port 0: a
/// free one. `on_ready` gets the address once it answers. Serves only files of the folder, only to this machine, and only requests for that
/// host name (against DNS rebinding by pages of other origins). Memory and connections are bounded, whatever is asked for: a request has
/// one range of a file or the whole of it, and a connection without a request makes room for a new one. Throws SystemError where the port
/// is taken.
int serve(const std::filesystem::path& folder, int port, const std::function<void(const std::string& address)>& on_ready);

}  // namespace carillon::explore
