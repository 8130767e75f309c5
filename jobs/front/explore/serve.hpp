// A web server on the loopback interface.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>

#include "runtime/base/error.hpp"

namespace carillon::explore {

/// Serves the files of a folder at http://127.0.0.1:PORT/ until SIGINT or SIGTERM; returns the signal. Port 0: a free port. `on_ready` gets
/// the address. Computes bodies that were cut on the page; `originals`: as in Recut. Accepts only requests with a host name of this machine
/// (against DNS rebinding). Memory and connections are bounded; new connections replace idle ones. SystemError for an occupied port.
int serve(const std::filesystem::path& folder, const std::map<std::string, std::filesystem::path>& originals, int port,
          const std::function<void(const std::string& address)>& on_ready);

}  // namespace carillon::explore
