// Method:     One thread, poll(2), non-blocking sockets. A connection holds a head of at most kMaxHead bytes or one piece of a file, with a
//             deadline for each. At the limit a new connection replaces the longest idle one.
// Source:     RFC 9112 9.6 (lingering close).
#include "jobs/front/explore/serve.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <iterator>
#include <list>
#include <string>
#include <utility>
#include <vector>

#include "jobs/front/explore/recut.hpp"
#include "jobs/front/explore/request.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/descriptor.hpp"

namespace carillon::explore {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxHead = 16 << 10, kPiece = 256 << 10;
constexpr std::size_t kMaxConnections = 200;  // two descriptors each; the usual limit is 1024
constexpr double kHeadS = 10.0;               // for a request
constexpr double kPieceS = 600.0;             // for the next piece: browsers may pause reading
constexpr double kRecutS = 0.2;               // between looks at a body that is computed
constexpr double kEndS = 10.0;                // for the rest of a refused request

/// SIGINT and SIGTERM as a descriptor; blocked in this thread and its children.
class BlockedSignals {
 public:
  BlockedSignals() {
    sigemptyset(&signals_);
    for (const int signal : {SIGINT, SIGTERM}) sigaddset(&signals_, signal);
    pthread_sigmask(SIG_BLOCK, &signals_, &before_);
    descriptor_ = base::Descriptor(::signalfd(-1, &signals_, SFD_CLOEXEC | SFD_NONBLOCK));
  }
  ~BlockedSignals() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  BlockedSignals(const BlockedSignals&) = delete;
  BlockedSignals& operator=(const BlockedSignals&) = delete;

  int descriptor() const { return descriptor_.get(); }
  /// Number of a pending signal; 0: none.
  int take() const {
    signalfd_siginfo info{};
    return ::read(descriptor_.get(), &info, sizeof(info)) == sizeof(info) ? static_cast<int>(info.ssi_signo) : 0;
  }

 private:
  sigset_t signals_{}, before_{};
  base::Descriptor descriptor_;
};

const char* find_reason(int status) {
  switch (status) {
    case 200:
      return "OK";
    case 202:
      return "Accepted";
    case 206:
      return "Partial Content";
    case 400:
      return "Bad Request";
    case 404:
      return "Not Found";
    case 405:
      return "Method Not Allowed";
    case 409:
      return "Conflict";
    case 411:
      return "Length Required";
    case 413:
      return "Content Too Large";
    case 415:
      return "Unsupported Media Type";
    case 416:
      return "Range Not Satisfiable";
    case 421:
      return "Misdirected Request";
    case 431:
      return "Request Header Fields Too Large";
    case 500:
      return "Internal Server Error";
    case 505:
      return "HTTP Version Not Supported";
    default:
      return "Service Unavailable";
  }
}

const char* find_type(const fs::path& file) {
  static constexpr std::array<std::pair<const char*, const char*>, 9> kTypes{{{".html", "text/html; charset=utf-8"},
                                                                              {".js", "application/javascript; charset=utf-8"},
                                                                              {".css", "text/css; charset=utf-8"},
                                                                              {".json", "application/json; charset=utf-8"},
                                                                              {".jsonl", "application/x-ndjson"},
                                                                              {".wasm", "application/wasm"},
                                                                              {".png", "image/png"},
                                                                              {".txt", "text/plain; charset=utf-8"},
                                                                              {".gz", "application/gzip"}}};
  const std::string ending = file.extension().string();
  for (const auto& [name, type] : kTypes)
    if (ending == name) return type;
  return "application/octet-stream";
}

/// A response: a head, then a part of a file.
struct Answer {
  std::string head;
  std::size_t head_sent = 0;
  base::Descriptor file;
  std::uint64_t at = 0, left = 0;  // bytes of the file
  bool is_last = false;            // closes the connection
};

/// The files of a folder, for requests with a host name of this machine.
class Folder {
 public:
  Folder(const fs::path& folder, const std::map<std::string, fs::path>& originals, int port)
      : recut(fs::canonical(folder), originals), root_(fs::canonical(folder)) {
    for (const char* name : {"127.0.0.1", "localhost"}) hosts_.push_back(fmt::format("{}:{}", name, port));
  }

  /// `body`: of a POST request.
  Answer answer(const FileRequest& request, const std::string& body) {
    if (request.status != 200) return refuse(request, request.status);
    if (std::find(hosts_.begin(), hosts_.end(), request.host) == hosts_.end()) return refuse(request, 421);
    if (request.is_post) {
      const RecutAnswer said = recut.begin(body);
      Answer answer = begin(request, said.status, said.text.size(), "Content-Type: application/json; charset=utf-8\r\n");
      answer.head += said.text;
      return answer;
    }
    const fs::path path = find_file(request.path);
    base::Descriptor file(path.empty() ? -1 : ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
    struct stat about {};
    if (file.get() < 0 && (errno == EMFILE || errno == ENFILE) && !path.empty()) return refuse(request, 503);
    if (file.get() < 0 || ::fstat(file.get(), &about) != 0 || !S_ISREG(about.st_mode)) return refuse(request, 404);
    const auto size = static_cast<std::uint64_t>(about.st_size);
    const Part part = find_part(request.range, size);
    if (part.status == 416) return refuse(request, 416, fmt::format("Content-Range: bytes */{}\r\n", size));
    std::string more = fmt::format("Content-Type: {}\r\nAccept-Ranges: bytes\r\n", find_type(path));
    if (part.status == 206) more += fmt::format("Content-Range: bytes {}-{}/{}\r\n", part.begin, part.begin + part.length - 1, size);
    Answer answer = begin(request, part.status, part.length, more);
    answer.file = std::move(file);
    answer.at = part.begin;
    answer.left = request.is_head ? 0 : part.length;
    return answer;
  }

  /// A response of one line of text.
  static Answer refuse(const FileRequest& request, int status, const std::string& more = {}) {
    const std::string text = fmt::format("{} {}\n", status, find_reason(status));
    Answer answer = begin(request, status, text.size(),
                          more + "Content-Type: text/plain; charset=utf-8\r\n" + (status == 405 ? "Allow: GET, HEAD\r\n" : ""));
    if (!request.is_head) answer.head += text;
    return answer;
  }

  Recut recut;

 private:
  /// The file of a path, links followed; empty if absent or outside of the folder.
  fs::path find_file(const std::string& path) const {
    std::error_code error;
    const fs::path inside = path.substr(std::min(path.find_first_not_of('/'), path.size()));
    fs::path file = fs::canonical(root_ / (path.back() == '/' ? inside / "index.html" : inside), error);
    const bool is_inside = !error && std::mismatch(root_.begin(), root_.end(), file.begin(), file.end()).first == root_.end();
    return is_inside ? file : fs::path();
  }

  static Answer begin(const FileRequest& request, int status, std::uint64_t length, const std::string& more) {
    Answer answer;
    answer.is_last = !request.is_reusable;
    answer.head =
        fmt::format("HTTP/1.1 {} {}\r\nCache-Control: no-cache\r\nX-Content-Type-Options: nosniff\r\nContent-Length: {}\r\n{}{}\r\n",
                    status, find_reason(status), length, more, answer.is_last ? "Connection: close\r\n" : "");
    return answer;
  }

  fs::path root_;
  std::vector<std::string> hosts_;
};

/// One connection: reads a head, sends the response, and reads the next or ends.
class Connection {
 public:
  explicit Connection(base::Descriptor socket) : socket_(std::move(socket)), until_s_(base::get_steady_s() + kHeadS) {}

  int socket() const { return socket_.get(); }
  short events() const { return state_ == State::kSending ? POLLOUT : POLLIN; }
  bool is_sending() const { return state_ == State::kSending; }
  double until_s() const { return until_s_; }

  /// Reads or writes once after poll(); false: the connection has ended.
  bool advance(Folder& folder, std::vector<char>& buffer) {
    if (state_ == State::kEnding) {
      const ssize_t count = ::recv(socket(), buffer.data(), buffer.size(), 0);
      return count > 0 || (count < 0 && is_early());
    }
    if (state_ == State::kReading) {
      const ssize_t count = ::recv(socket(), buffer.data(), kMaxHead, 0);
      if (count <= 0) return count < 0 && is_early();
      taken_.append(buffer.data(), static_cast<std::size_t>(count));
      find_request(folder);
    }
    return state_ != State::kSending || send(folder, buffer);
  }

 private:
  enum class State { kReading, kSending, kEnding };

  static bool is_early() { return errno == EAGAIN || errno == EINTR; }

  /// Starts the response to a complete request or an oversized head.
  void find_request(Folder& folder) {
    const std::size_t begin = std::min(taken_.find_first_not_of("\r\n"), taken_.size());
    std::size_t end = taken_.find("\n\r\n", begin), length = 3;
    if (const std::size_t other = taken_.find("\n\n", begin); other < end) end = other, length = 2;
    if (std::min(end, taken_.size()) > kMaxHead) {
      FileRequest request;
      request.is_reusable = false;
      answer_ = Folder::refuse(request, 431);
    } else if (end == std::string::npos) {
      return;
    } else {
      const FileRequest request = parse_request(std::string_view(taken_).substr(begin, end + 1 - begin));
      const std::size_t body = end + length;
      if (request.status == 200 && taken_.size() - body < request.length) return;
      answer_ = folder.answer(request, taken_.substr(body, request.length));
      taken_.erase(0, body + request.length);
    }
    state_ = State::kSending;
    until_s_ = base::get_steady_s() + kPieceS;
  }

  /// Sends a piece of the response.
  bool send(Folder& folder, std::vector<char>& buffer) {
    const char* from = answer_.head.data() + answer_.head_sent;
    std::size_t length = answer_.head.size() - answer_.head_sent;
    const bool is_head = length > 0;
    if (!is_head && answer_.left > 0) {
      const ssize_t count =
          ::pread(answer_.file.get(), buffer.data(), std::min<std::uint64_t>(kPiece, answer_.left), static_cast<off_t>(answer_.at));
      if (count <= 0) return false;  // the file was truncated meanwhile
      from = buffer.data();
      length = count;
    }
    if (length > 0) {
      const ssize_t sent = ::send(socket(), from, length, MSG_NOSIGNAL | (is_head && answer_.left > 0 ? MSG_MORE : 0));
      if (sent < 0) return is_early();
      until_s_ = base::get_steady_s() + kPieceS;
      if (is_head) {
        answer_.head_sent += static_cast<std::size_t>(sent);
      } else {
        answer_.at += static_cast<std::uint64_t>(sent);
        answer_.left -= static_cast<std::uint64_t>(sent);
      }
    }
    if (answer_.head_sent < answer_.head.size() || answer_.left > 0) return true;
    const bool is_last = std::exchange(answer_, Answer()).is_last;
    state_ = is_last ? State::kEnding : State::kReading;
    until_s_ = base::get_steady_s() + (is_last ? kEndS : kHeadS);
    if (is_last) return ::shutdown(socket(), SHUT_WR) == 0;
    find_request(folder);  // pipelined requests
    return true;
  }

  base::Descriptor socket_;
  State state_ = State::kReading;
  std::string taken_;  // unanswered input
  Answer answer_;
  double until_s_;  // deadline
};

/// A listening socket at the loopback address, and its port.
std::pair<base::Descriptor, int> listen_at(int port) {
  base::Descriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  const int yes = 1;
  ::setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), size) != 0 || ::listen(socket.get(), SOMAXCONN) != 0 ||
      ::getsockname(socket.get(), reinterpret_cast<sockaddr*>(&address), &size) != 0)
    throw SystemError(port == 0             ? fmt::format("no free port: {}", std::strerror(errno))
                      : errno == EADDRINUSE ? fmt::format("port {} is in use; give another one with --port", port)
                                            : fmt::format("port {}: {}; give another one with --port", port, std::strerror(errno)));
  return {std::move(socket), ntohs(address.sin_port)};
}

class Server {
 public:
  Server(Folder folder, base::Descriptor socket) : folder_(std::move(folder)), socket_(std::move(socket)), buffer_(kPiece) {}

  /// Serves until a signal; returns it.
  int run(const BlockedSignals& signals) {
    for (std::vector<pollfd> waited;;) {
      waited.assign({{signals.descriptor(), POLLIN, 0}, {socket_.get(), POLLIN, 0}});
      double until_s = base::get_steady_s() + (folder_.recut.advance() ? kRecutS : 3600.0);
      for (const Connection& one : connections_) {
        waited.push_back({one.socket(), one.events(), 0});
        until_s = std::min(until_s, one.until_s());
      }
      const double wait_s = std::max(0.0, until_s - base::get_steady_s());
      if (::poll(waited.data(), waited.size(), static_cast<int>(1e3 * wait_s) + 1) < 0 && errno != EINTR)
        throw SystemError(fmt::format("poll fails: {}", std::strerror(errno)));
      if (const int signal = signals.take(); signal != 0) return signal;
      const double now_s = base::get_steady_s();
      auto ready = waited.begin() + 2;
      for (auto one = connections_.begin(); one != connections_.end(); ++ready) {
        const bool stays = ready->revents != 0 ? one->advance(folder_, buffer_) : true;
        one = stays && one->until_s() > now_s ? std::next(one) : connections_.erase(one);
      }
      if (waited[1].revents != 0) accept();
    }
  }

 private:
  /// Accepts at most kMaxConnections at a time, so that new connections cannot starve responses.
  void accept() {
    for (std::size_t count = 0; count < kMaxConnections; ++count) {
      base::Descriptor socket(::accept4(socket_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
      const bool is_short = socket.get() < 0 && (errno == EMFILE || errno == ENFILE);
      if (socket.get() < 0 && !is_short) return;
      if ((is_short || connections_.size() >= kMaxConnections) && !make_room()) return;
      if (!is_short) connections_.emplace_back(std::move(socket));
    }
  }

  /// Closes the idle connection with the earliest deadline; an active one only if none is idle.
  bool make_room() {
    const auto first = std::min_element(connections_.begin(), connections_.end(), [](const Connection& a, const Connection& b) {
      return std::pair(a.is_sending(), a.until_s()) < std::pair(b.is_sending(), b.until_s());
    });
    if (first == connections_.end()) return false;
    connections_.erase(first);
    return true;
  }

  Folder folder_;
  base::Descriptor socket_;
  std::vector<char> buffer_;
  std::list<Connection> connections_;
};

}  // namespace

int serve(const fs::path& folder, const std::map<std::string, fs::path>& originals, int port,
          const std::function<void(const std::string& address)>& on_ready) {
  const BlockedSignals signals;
  std::error_code error;
  if (!fs::is_directory(folder, error)) throw SystemError(fmt::format("{}: this folder no longer exists", folder.string()));
  auto [socket, bound] = listen_at(port);
  Server server(Folder(folder, originals, bound), std::move(socket));
  on_ready(fmt::format("http://127.0.0.1:{}/", bound));
  return server.run(signals);
}

}  // namespace carillon::explore
