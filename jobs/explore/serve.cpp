// Method:     cpp-httplib; a thread waits for the signals, since its stop() may not be called from a handler.
// Source:     none.
// Deviations: none.
#include "jobs/explore/serve.hpp"

#include <fmt/core.h>
#include <httplib.h>
#include <pthread.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <thread>

namespace carillon::explore {
namespace {

/// SIGINT and SIGTERM wait for sigwait() in this thread and in those that it starts.
class BlockedSignals {
 public:
  BlockedSignals() {
    sigemptyset(&signals_);
    for (const int signal : {SIGINT, SIGTERM}) sigaddset(&signals_, signal);
    pthread_sigmask(SIG_BLOCK, &signals_, &before_);
  }
  ~BlockedSignals() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  BlockedSignals(const BlockedSignals&) = delete;
  BlockedSignals& operator=(const BlockedSignals&) = delete;

  int wait() const {
    int signal = 0;
    sigwait(&signals_, &signal);
    return signal;
  }

 private:
  sigset_t signals_{}, before_{};
};

/// Whether a path of a request ends outside of the folder, by a symbolic link in it.
bool leaves(const std::filesystem::path& folder, const std::string& path) {
  std::error_code error;
  const std::filesystem::path root = std::filesystem::canonical(folder, error);
  const std::filesystem::path file =
      std::filesystem::weakly_canonical(root / path.substr(std::min(path.find_first_not_of('/'), path.size())), error);
  return error || std::mismatch(root.begin(), root.end(), file.begin(), file.end()).first != root.end();
}

}  // namespace

int serve(const std::filesystem::path& folder, int port, const std::function<void(const std::string& address)>& on_ready) {
  const BlockedSignals signals;
  httplib::Server server;
  server.set_socket_options([](socket_t socket) {  // not the library's SO_REUSEPORT, by which two servers would share a port
    const int yes = 1;
    ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  });
  server.set_default_headers({{"Cache-Control", "no-cache"}, {"X-Content-Type-Options", "nosniff"}});
  // Of types that it knows as text the library makes brotli of the highest level, which takes seconds for a contacts file and brings
  // nothing here: none of the large files has such a type.
  for (const auto& [ending, type] : {std::pair{"html", "text/html; charset=utf-8"},
                                     {"js", "application/javascript; charset=utf-8"},
                                     {"css", "text/css; charset=utf-8"},
                                     {"json", "application/json; charset=utf-8"},
                                     {"jsonl", "application/x-ndjson"},
                                     {"wasm", "application/wasm"},
                                     {"hdf", "application/octet-stream"}})
    server.set_file_extension_and_mimetype_mapping(ending, type);
  if (!server.set_mount_point("/", folder.string()))
    throw SystemError(fmt::format("{}: this folder does not exist any more", folder.string()));
  const int bound = port == 0 ? server.bind_to_any_port("127.0.0.1") : (server.bind_to_port("127.0.0.1", port) ? port : -1);
  if (bound <= 0)
    throw SystemError(port == 0 ? std::string("no port of the loopback address is free")
                                : fmt::format("port {} of the loopback address is taken; give another one with --port", port));
  const std::string by_number = fmt::format("127.0.0.1:{}", bound), by_name = fmt::format("localhost:{}", bound);
  server.set_pre_routing_handler([&](const httplib::Request& request, httplib::Response& response) {
    const std::string host = request.get_header_value("Host");
    if (host != by_number && host != by_name)
      response.status = 421;  // misdirected request
    else if (leaves(folder, request.path))
      response.status = 404;
    else
      return httplib::Server::HandlerResponse::Unhandled;
    return httplib::Server::HandlerResponse::Handled;
  });
  server.set_write_timeout(600);     // a browser that builds its picture may read nothing for long [s]
  server.set_keep_alive_timeout(1);  // what an idle browser may delay the end by [s]
  int signal = 0;
  std::atomic<bool> has_ended = false;
  std::thread waiter([&] {
    signal = signals.wait();
    while (!has_ended) {  // stop() does nothing before the server listens
      server.stop();
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  });
  on_ready(fmt::format("http://{}/", by_number));
  server.listen_after_bind();
  has_ended = true;
  if (signal == 0) pthread_kill(waiter.native_handle(), SIGTERM);  // it ended by itself
  waiter.join();
  return signal;
}

}  // namespace carillon::explore
