// A web server for this machine alone.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "runtime/base/error.hpp"

namespace carillon::explore {

/// Serves the files of a folder at http://127.0.0.1:PORT/ until SIGINT or SIGTERM; returns the number of that signal. Port 0: a free one.
/// `on_ready` gets the address of the open port. Serves only files of the folder, only to this machine, and only requests for that host
/// name (against DNS rebinding by pages of other origins). Bounded memory and connections: a request has one range of a file or the whole
/// of it, and an idle connection makes room for a new one. Throws SystemError for an occupied port.
int serve(const std::filesystem::path& folder, int port, const std::function<void(const std::string& address)>& on_ready);

}  // namespace carillon::explore
