// The small JSON files of a job's folder.
#include "jobs/store/records.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <json/json.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <sstream>

#include "jobs/store/store.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/file.hpp"

namespace carillon::store {
namespace {

namespace fs = std::filesystem;

constexpr int kMostCount = 1'000'000'000;

std::string write_json(const Json::Value& root, const char* indentation) {
  Json::StreamWriterBuilder writer;
  writer["indentation"] = indentation;
  writer["precision"] = 17;
  writer["emitUTF8"] = true;
  return Json::writeString(writer, root);
}

std::optional<base::Object> read_root(const fs::path& file) {
  struct stat info {};
  if (::lstat(file.c_str(), &info) != 0) return std::nullopt;
  return base::read_document(file, "the store is damaged here; remove the job's folder and submit again").root();
}

std::string read_empty_or(base::Object& object, std::string_view key) { return object.has(key) ? object.string_or(key, "") : ""; }

Request read_request_root(base::Object root, const std::string& where) {
  Request request;
  request.id = require_id(root.string("id"), where).text();
  request.job = root.string("job");
  request.input_kind = root.choice("input_kind", {"mesh", "surface", "shape"});
  request.input_format = read_empty_or(root, "input_format");
  request.input_sha256 = read_empty_or(root, "input_sha256");
  if (request.input_kind != "shape") require_id(request.input_sha256, where);
  request.solver = root.string("solver");
  request.resources.ranks = static_cast<int>(root.integer("ranks", 0, kMostCount));
  request.resources.memory_gb = root.number("memory_gb");
  request.resources.time_limit_s = root.number("time_limit_s");
  request.engine = root.choice("engine", {"local", "slurm"});
  request.job_file = read_empty_or(root, "job_file");
  request.input_file = read_empty_or(root, "input_file");
  request.user = read_empty_or(root, "user");
  request.submitted_unix_s = root.number("submitted_unix_s");
  return request;
}

/// The last `most` bytes of a regular file; empty when there is none.
std::string read_tail(const fs::path& file, off_t most) {
  std::string text;
  const int fd = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW);
  if (fd < 0) return text;
  struct stat info {};
  if (::fstat(fd, &info) == 0 && S_ISREG(info.st_mode)) {
    text.resize(static_cast<std::size_t>(std::min(most, info.st_size)));
    const ssize_t got = ::pread(fd, text.data(), text.size(), info.st_size - static_cast<off_t>(text.size()));
    text.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
  }
  ::close(fd);
  return text;
}

std::optional<Progress> parse_progress(const std::string& line) {
  Json::Value root;
  Json::CharReaderBuilder reader;
  std::istringstream stream(line);
  std::string errors;
  try {
    if (!Json::parseFromStream(reader, stream, &root, &errors) || !root.isObject() || !root["phase"].isString()) return std::nullopt;
    const auto number = [&](const char* key, double fallback) { return root[key].isNumeric() ? root[key].asDouble() : fallback; };
    Progress progress;
    progress.phase = root["phase"].asString();
    progress.percent = std::clamp(number("percent", 0.0), 0.0, 100.0);
    progress.modes_done = static_cast<long long>(std::clamp(number("modes_done", -1.0), -1.0, 1e15));
    progress.modes_wanted = static_cast<long long>(std::clamp(number("modes_wanted", -1.0), -1.0, 1e15));
    progress.seconds_left = std::max(number("seconds_left", -1.0), -1.0);
    progress.seconds = std::max(number("seconds", 0.0), 0.0);
    return progress;
  } catch (const Json::Exception&) {
    return std::nullopt;
  }
}

}  // namespace

std::string format_request(const Request& request, bool one_line) {
  Json::Value root;
  root["id"] = request.id;
  root["job"] = request.job;
  root["input_kind"] = request.input_kind;
  root["input_format"] = request.input_format;
  root["input_sha256"] = request.input_sha256;
  root["solver"] = request.solver;
  root["ranks"] = request.resources.ranks;
  root["memory_gb"] = request.resources.memory_gb;
  root["time_limit_s"] = request.resources.time_limit_s;
  root["engine"] = request.engine;
  root["job_file"] = request.job_file;
  root["input_file"] = request.input_file;
  root["user"] = request.user;
  root["submitted_unix_s"] = request.submitted_unix_s;
  for (const char* key : {"input_format", "input_sha256", "job_file", "input_file", "user"}) {
    if (root[key].asString().empty()) root.removeMember(key);  // a text of a document of ours is never empty
  }
  return write_json(root, one_line ? "" : "  ") + "\n";
}

Request parse_request(std::string_view text, const fs::path& name) {
  return read_request_root(base::parse_document(text, name).root(), name.string());
}

std::optional<Request> read_request(const fs::path& folder) {
  auto root = read_root(folder / kRequestFile);
  if (!root) return std::nullopt;
  return read_request_root(*root, (folder / kRequestFile).string());
}

void write_request(const fs::path& folder, const Request& request) { base::write_file(folder / kRequestFile, format_request(request)); }

std::optional<Standing> read_standing(const fs::path& folder) {
  auto root = read_root(folder / kStandingFile);
  if (!root) return std::nullopt;
  Standing standing;
  standing.state = root->choice("state", {"queued", "waiting", "failed", "cancelled"});
  standing.reason = read_empty_or(*root, "reason");
  standing.attempts = static_cast<int>(root->integer("attempts", 0, kMostCount));
  standing.failures = static_cast<int>(root->integer("failures", 0, kMostCount));
  return standing;
}

std::string format_standing(const Standing& standing) {
  Json::Value root;
  root["state"] = standing.state;
  if (!standing.reason.empty()) root["reason"] = standing.reason;
  root["attempts"] = standing.attempts;
  root["failures"] = standing.failures;
  return write_json(root, "  ") + "\n";
}

void write_standing(const fs::path& folder, const Standing& standing) {
  base::write_file(folder / kStandingFile, format_standing(standing));
}

std::optional<Progress> read_progress(const fs::path& folder) {
  const std::string text = read_tail(folder / "progress.jsonl", 1 << 16);
  for (std::size_t end = text.rfind('\n'); end != std::string::npos && end > 0;) {
    const std::size_t before = text.rfind('\n', end - 1);
    const std::size_t begin = before == std::string::npos ? 0 : before + 1;
    if (auto progress = parse_progress(text.substr(begin, end - begin))) return progress;
    end = before;
  }
  return std::nullopt;
}

}  // namespace carillon::store
