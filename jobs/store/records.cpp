#include "jobs/store/records.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>

#include "jobs/store/store.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/json.hpp"

namespace carillon::store {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxCount = 1'000'000'000;

template <class Value>
struct Word {
  Value value;
  std::string_view word;
};
constexpr std::array<Word<JobState>, 6> kStates{{{JobState::queued, "queued"},
                                                 {JobState::running, "running"},
                                                 {JobState::waiting, "waiting"},
                                                 {JobState::done, "done"},
                                                 {JobState::failed, "failed"},
                                                 {JobState::cancelled, "cancelled"}}};
constexpr std::array<Word<JobEngine>, 2> kEngines{{{JobEngine::local, "local"}, {JobEngine::slurm, "slurm"}}};
constexpr std::array<Word<InputKind>, 5> kInputKinds{{{InputKind::mesh, "mesh"},
                                                      {InputKind::surface, "surface"},
                                                      {InputKind::shape, "shape"},
                                                      {InputKind::table, "table"},
                                                      {InputKind::simulation, "simulation"}}};

template <class Words>
auto find_word(const Words& words, std::string_view word) {
  const auto found = std::find_if(words.begin(), words.end(), [&](const auto& known) { return known.word == word; });
  return found == words.end() ? std::nullopt : std::optional(found->value);
}

/// `words`: in the order of the enumeration.
template <class Words, class Value>
std::string get_word(const Words& words, Value value) {
  return std::string(words.at(static_cast<std::size_t>(value)).word);
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
  request.input_kind = *find_word(kInputKinds, root.choice("input_kind", {"mesh", "surface", "shape", "table", "simulation"}));
  request.input_format = read_empty_or(root, "input_format");
  request.input_sha256 = read_empty_or(root, "input_sha256");
  if (request.input_kind == InputKind::simulation) {
    for (base::Object& object : root.objects("inputs")) {
      Input& input = request.inputs.emplace_back();
      input.kind = *find_word(kInputKinds, object.choice("kind", {"mesh", "surface"}));
      input.format = read_empty_or(object, "format");
      input.sha256 = require_id(object.string("sha256"), where).text();
      input.file = read_empty_or(object, "file");
    }
  } else if (request.input_kind != InputKind::shape) {
    require_id(request.input_sha256, where);
  }
  request.solver = root.string("solver");
  request.resources.ranks = static_cast<int>(root.integer("ranks", 0, kMaxCount));
  request.resources.memory_gb = root.number("memory_gb");
  request.resources.time_limit_s = root.number("time_limit_s");
  request.engine = *find_engine(root.choice("engine", {"local", "slurm"}));
  request.job_file = read_empty_or(root, "job_file");
  request.input_file = read_empty_or(root, "input_file");
  request.user = read_empty_or(root, "user");
  request.submitted_unix_s = root.number("submitted_unix_s");
  return request;
}

/// The last `max` bytes of a regular file; empty if there is none.
std::string read_tail(const fs::path& file, off_t max) {
  std::string text;
  const int fd = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) return text;
  struct stat info {};
  if (::fstat(fd, &info) == 0 && S_ISREG(info.st_mode)) {
    text.resize(std::min(max, info.st_size));
    const ssize_t got = ::pread(fd, text.data(), text.size(), info.st_size - static_cast<off_t>(text.size()));
    text.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
  }
  ::close(fd);
  return text;
}

std::optional<Progress> parse_progress(const std::string& line) {
  const std::optional<base::Json> parsed = base::Json::parse(line);
  if (!parsed || !(*parsed)["phase"].is_string()) return std::nullopt;
  const base::Json& root = *parsed;
  const auto number = [&](const char* key, double fallback) { return root[key].is_number() ? root[key].as_double() : fallback; };
  Progress progress;
  progress.phase = root["phase"].as_string();
  progress.percent = std::clamp(number("percent", 0.0), 0.0, 100.0);
  progress.modes_done = static_cast<long long>(std::clamp(number("modes_done", -1.0), -1.0, 1e15));
  progress.modes_wanted = static_cast<long long>(std::clamp(number("modes_wanted", -1.0), -1.0, 1e15));
  progress.seconds_left = std::clamp(number("seconds_left", -1.0), -1.0, 1e12);
  progress.seconds = std::clamp(number("seconds", 0.0), 0.0, 1e12);
  return progress;
}

}  // namespace

std::string to_text(JobState state) { return get_word(kStates, state); }
std::string to_text(JobEngine engine) { return get_word(kEngines, engine); }
std::string to_text(InputKind kind) { return get_word(kInputKinds, kind); }
std::optional<JobState> find_state(std::string_view word) { return find_word(kStates, word); }
std::optional<JobEngine> find_engine(std::string_view word) { return find_word(kEngines, word); }

std::vector<Input> list_inputs(const Request& request) {
  if (request.input_kind == InputKind::simulation) return request.inputs;
  if (request.input_kind == InputKind::shape) return {};
  return {{request.input_kind, request.input_format, request.input_sha256, request.input_file}};
}

std::string format_request(const Request& request, bool one_line) {
  base::Json root = base::Json::object();
  const auto set_text = [&](const char* key, const std::string& text) {
    if (!text.empty()) root.set(key, text);
  };
  root.set("id", request.id).set("job", request.job).set("input_kind", to_text(request.input_kind));
  set_text("input_format", request.input_format);
  set_text("input_sha256", request.input_sha256);
  for (const Input& input : request.inputs) {
    base::Json json = base::Json::object();
    json.set("kind", to_text(input.kind)).set("sha256", input.sha256);
    if (!input.format.empty()) json.set("format", input.format);
    if (!input.file.empty()) json.set("file", input.file);
    root["inputs"].add(std::move(json));
  }
  root.set("solver", request.solver).set("ranks", request.resources.ranks).set("memory_gb", request.resources.memory_gb);
  root.set("time_limit_s", request.resources.time_limit_s).set("engine", to_text(request.engine));
  set_text("job_file", request.job_file);
  set_text("input_file", request.input_file);
  set_text("user", request.user);
  root.set("submitted_unix_s", request.submitted_unix_s);
  return one_line ? root.line() + "\n" : root.text();
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

std::optional<SavedState> read_state(const fs::path& folder) {
  auto root = read_root(folder / kStateFile);
  if (!root) return std::nullopt;
  SavedState saved;
  saved.state = *find_state(root->choice("state", {"queued", "waiting", "failed", "cancelled"}));
  saved.reason = read_empty_or(*root, "reason");
  saved.attempts = static_cast<int>(root->integer("attempts", 0, kMaxCount));
  saved.failures = static_cast<int>(root->integer("failures", 0, kMaxCount));
  return saved;
}

std::string format_state(const SavedState& saved) {
  base::Json root = base::Json::object();
  root.set("state", to_text(saved.state)).set("attempts", saved.attempts).set("failures", saved.failures);
  if (!saved.reason.empty()) root.set("reason", saved.reason);
  return root.text();
}

void write_state(const fs::path& folder, const SavedState& saved) { base::write_file(folder / kStateFile, format_state(saved)); }

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
