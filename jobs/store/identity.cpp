// Method:     The id is the SHA-256 of the resolved job as one canonical line, the kind, format and SHA-256 of the input, and the version
//             of the solver. Equivalent jobs resolve to the same line.
// Source:     FIPS 180-4 (hash).
#include "jobs/store/identity.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <fstream>
#include <map>
#include <set>

#include "jobs/store/files.hpp"
#include "jobs/store/process/process.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/includes.hpp"
#include "runtime/base/json.hpp"

namespace carillon::store {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMeshHeadBytes = 4096;
constexpr std::uint64_t kMaxJoinedBytes = 32ULL << 30;
constexpr std::size_t kMaxTexts = 50;
constexpr const char* kScheme = "carillon identity 1";

base::Json parse_resolved(const std::string& text) {
  auto root = base::Json::parse(text);
  if (!root) throw SystemError("internal: a resolved job is not JSON");
  return std::move(*root);
}

/// Replaces -0 by 0.
void drop_signs_of_zero(base::Json& value) {
  if (value.is_real() && value.as_double() == 0.0) value = 0.0;
  if (value.is_array() || value.is_object()) {
    for (base::Json& member : value) drop_signs_of_zero(member);
  }
}

/// A resolved job as one line, without paths.
std::string make_canonical(base::Json root) {
  if (root.has("simulate")) return make_canonical_simulation(std::move(root));
  root.erase("mesh");
  if (root["body"].is_object())
    for (const char* path : {"surface", "modes_csv"}) root["body"].erase(path);
  if (root["body"].is_null()) root.erase("body");
  drop_signs_of_zero(root);
  return root.sorted_text({.is_ascii = false});
}

/// Comparison of the record of a run (JSON) with a request.
enum class Origin { same, unknown, another_job, another_input };

/// A JSON object; null for anything else.
base::Json parse_object(const std::string& text) {
  auto root = base::Json::parse(text);
  return root && root->is_object() ? std::move(*root) : base::Json();
}

/// The key of a job with the path of its input.
base::Json& get_input_key(base::Json& root, InputKind kind) {
  if (kind == InputKind::surface) return root["body"]["surface"];
  return kind == InputKind::table ? root["body"]["modes_csv"] : root["mesh"];
}

/// Compares JSON, not parsed jobs: the record has the schema of its time, as the request does.
Origin compare_origin(base::Json root, const Request& request) {
  if (!root.is_object()) return Origin::unknown;
  try {
    if (request.input_kind == InputKind::simulation) return make_canonical(root) == request.job ? Origin::same : Origin::another_job;
    const base::Json& named = get_input_key(root, request.input_kind);
    const std::string input = named.is_string() ? fs::path(named.as_string()).stem().string() : "";
    for (const char* key : {"run", "bank"}) root.erase(key);
    if (make_canonical(root) != request.job) return Origin::another_job;
    return request.input_kind == InputKind::shape || input == request.input_sha256 ? Origin::same : Origin::another_input;
  } catch (const std::logic_error&) {
    return Origin::unknown;
  }
}

std::string lower_ending(const fs::path& file) {
  const std::string extension = base::find_extension(file);
  return extension.empty() ? extension : extension.substr(1);
}

/// By the same rule as the mesh reader: from the content if conclusive, else from the file extension.
std::string find_mesh_format(const std::string& head, const std::string& ending) {
  for (const char* cae : {"inp", "bdf", "nas", "unv", "uff"})
    if (ending == cae) return ending;
  std::string_view text = head;
  if (text.starts_with("\x89HDF\r\n")) return "hdf";
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  text.remove_prefix(std::min(text.find_first_not_of(" \t\r\n"), text.size()));
  if (text.size() > 1 && text[0] == '$' && std::isalpha(static_cast<unsigned char>(text[1])) != 0) return "msh";
  if (text.starts_with('<')) return "vtu";
  if (text.starts_with("MeshVersionFormatted")) return "mesh";
  return ending;
}

/// The two files of a TetGen mesh, from the path of either.
std::array<fs::path, 2> find_tetgen_pair(const fs::path& file) {
  const auto partner = [&](const char* ending) { return lower_ending(file) == ending ? file : fs::path(file).replace_extension(ending); };
  return {partner("node"), partner("ele")};
}

Id hash_pair(const Id& node, const Id& ele) { return hash_text("node " + node.text() + "\nele " + ele.text() + "\n"); }

std::string find_user() {
  std::array<char, 4096> buffer{};
  struct passwd entry {
  }, *found = nullptr;
  ::getpwuid_r(::geteuid(), &entry, buffer.data(), buffer.size(), &found);
  return found != nullptr ? to_text(found->pw_name) : fmt::format("{}", ::geteuid());
}

/// Passes the bytes of an input to `take`, with the files that it includes, and returns their hash.
Id hash_joined(const fs::path& file, std::string_view what, const std::function<void(std::string_view)>& take,
               bool* has_includes = nullptr) {
  if (!base::may_include(file)) return hash_file(file, what, take);
  const base::JoinedText joined = base::read_joined(file, what, kMaxJoinedBytes);
  if (has_includes != nullptr) *has_includes = joined.origins.size() > 1;
  take(joined.text);
  return hash_text(joined.text);
}

/// Copies a file to `target` and returns its hash.
Id copy_hashed(const fs::path& file, std::string_view what, const fs::path& target) {
  const int fd = ::open(target.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0444);
  if (fd < 0) throw_errno(target, "write", errno);
  int error = 0;
  const auto write_all = [&](std::string_view bytes) {
    while (!bytes.empty() && error == 0) {
      const ssize_t put = ::write(fd, bytes.data(), bytes.size());
      if (put > 0) bytes.remove_prefix(put);
      if (put < 0 && errno != EINTR) error = errno;
    }
    if (error != 0) throw_errno(target, "write", error);
  };
  try {
    const Id id = hash_joined(file, what, write_all);
    if (::fsync(fd) != 0) throw_errno(target, "write", errno);
    ::close(fd);
    return id;
  } catch (...) {
    ::close(fd);
    throw;
  }
}

/// Copies the files of an input into inputs/.
void take_snapshot(const Store& store, const fs::path& file, const Input& input) {
  const Id wanted = require_id(input.sha256, "the input's hash");
  const fs::path target = store.input_file(wanted, input.format);
  const bool is_pair = input.format == "tetgen";
  const Temporary temporary = store.make_temporary();
  const auto pair = find_tetgen_pair(file);
  const std::string what = to_text(input.kind);
  Id found = copy_hashed(is_pair ? pair[0] : file, what, temporary / "first");
  if (is_pair) found = hash_pair(found, copy_hashed(pair[1], what, temporary / "second"));
  if (found != wanted)
    throw InputError(fmt::format("{}: this {} changed while it was read; submit the job when it is complete", file.string(), what));
  make_folder(target.parent_path());
  const auto name = [&](const char* from, const fs::path& to) {
    if (::rename((temporary / from).c_str(), to.c_str()) != 0) throw_errno(to, "write", errno);
  };
  if (is_pair) name("second", fs::path(target).replace_extension("ele"));
  name("first", target);
  sync_folder(target.parent_path());
}

/// Checked inputs by hash and format; true: copied by this call.
using Inputs = std::map<std::string, bool>;

/// Copies missing and damaged inputs into the store. True if any was copied.
bool ensure_inputs(const Store& store, const JobOrder& order, const Request& request, Inputs& known) {
  const std::vector<NamedInput> named = order.list_inputs();
  const std::vector<Input> inputs = list_inputs(request);
  bool is_copied = false;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const auto [entry, is_new] = known.try_emplace(inputs[i].sha256 + "." + inputs[i].format, false);
    if (is_new && find_input_fault(store, inputs[i])) {
      take_snapshot(store, named.at(i).file, inputs[i]);
      entry->second = true;
    }
    is_copied = is_copied || entry->second;
  }
  return is_copied;
}

std::vector<fs::path> find_input_files(const Store& store, const Request& request) {
  std::vector<fs::path> files;
  for (const Input& input : list_inputs(request)) files.push_back(find_input_file(store, input));
  return files;
}

/// Without sync: publish_work() syncs.
void write_unsynced(const fs::path& file, const std::string& text) {
  std::ofstream stream(file, std::ios::binary);
  errno = 0;
  stream << text;
  stream.close();
  if (!stream) throw_errno(file, "write", errno != 0 ? errno : EIO);
}

/// Writes the files of a new folder work/ab/<id>.
void fill_work(const std::string& job, const Request& request, const fs::path& folder) {
  write_unsynced(folder / kJobFile, job);
  write_unsynced(folder / kRequestFile, format_request(request));
  write_unsynced(folder / kStateFile, format_state({}));
}

/// The job of a request, with inputs in the store and its bank in the folder of work.
std::string make_job(const Store& store, const Request& request, const Id& id) {
  base::Json root = parse_resolved(request.job);
  const fs::path work = store.work_folder(id);
  const std::vector<fs::path> files = find_input_files(store, request);
  if (request.input_kind == InputKind::simulation) return write_simulation(std::move(root), files);
  if (!files.empty()) get_input_key(root, request.input_kind) = files[0].string();
  root["bank"] = (work / kBankFile).string();
  return job::resolved_json(job::parse_job(root.sorted_text({.indentation = "  ", .is_ascii = false}), work / kJobFile), work, "");
}

/// Why the job file of a folder of work differs from its request.
std::optional<std::string> find_text_fault(const Store& store, const Request& request, const Id& id, const std::string& text) {
  constexpr const char* kAnother = "its job.json differs from the submitted job";
  if (request.input_kind == InputKind::simulation)
    return text == make_job(store, request, id) ? std::nullopt : std::optional(std::string(kAnother));
  const job::JobSpec job = job::parse_job(text, store.work_folder(id) / kJobFile);
  if (make_canonical_job(job) != request.job) return kAnother;
  if (job.bank != store.work_folder(id) / kBankFile) return "its job.json names another bank";
  const std::vector<fs::path> files = find_input_files(store, request);
  if (get_input(job) != (files.empty() ? fs::path() : files[0]))
    return fmt::format("its job.json names another {}", to_text(request.input_kind));
  return std::nullopt;
}

/// True for a damaged folder of work without a running attempt.
bool is_spoilt(const Store& store, const Id& id) {
  const fs::path work = store.work_folder(id);
  return store.has_work(id) && find_job_fault(store, id) && !process::Lock::is_held(work / "lock");
}

}  // namespace

std::string make_canonical_job(const job::JobSpec& job) {
  job::JobSpec bare = job;
  bare.bank.clear();
  return make_canonical(parse_resolved(job::resolved_json(bare, "/", "")));
}

const RequestMaker::Known& RequestMaker::find_input(const fs::path& file, const std::string& what) {
  struct stat info {};
  const bool is_there = ::stat(file.c_str(), &info) == 0;
  const auto stamp = std::array<long long, 5>{static_cast<long long>(info.st_dev), static_cast<long long>(info.st_ino), info.st_size,
                                              info.st_mtim.tv_sec * 1'000'000'000LL + info.st_mtim.tv_nsec,
                                              info.st_ctim.tv_sec * 1'000'000'000LL + info.st_ctim.tv_nsec};
  const auto found = known_.find(file);
  if (is_there && found != known_.end() && found->second.stamp == stamp && !found->second.has_includes) return found->second;
  std::string head;
  bool has_includes = false;  // their changes do not show in the stamp
  const auto take_head = [&](std::string_view bytes) {
    if (head.size() < kMeshHeadBytes) head += bytes.substr(0, kMeshHeadBytes - head.size());
  };
  const Id id = hash_joined(file, what, take_head, &has_includes);
  return known_.insert_or_assign(file, Known{id, head, stamp, has_includes}).first->second;
}

Input RequestMaker::find_hashed(const NamedInput& named) {
  const std::string ending = lower_ending(named.file);
  Input input{named.kind, "", "", to_text(named.file)};
  if (named.kind == InputKind::mesh && (ending == "node" || ending == "ele")) {
    const auto pair = find_tetgen_pair(named.file);
    const Id node = find_input(pair[0], "mesh").sha256;
    input.format = "tetgen";
    input.sha256 = hash_pair(node, find_input(pair[1], "mesh").sha256).text();
  } else {
    const Known& known = find_input(named.file, to_text(named.kind));
    input.format = named.kind != InputKind::mesh ? ending : find_mesh_format(known.head, ending);
    input.sha256 = known.sha256.text();
  }
  return input;
}

Request RequestMaker::make(const JobOrder& order) {
  Request request;
  std::vector<Input> inputs;
  for (const NamedInput& named : order.list_inputs()) inputs.push_back(find_hashed(named));
  if (order.is_simulation()) {
    std::vector<fs::path> names;
    for (const Input& input : inputs) names.push_back(make_input_name(require_id(input.sha256, "the input's hash"), input.format));
    request.job = order.make_canonical(names);
    request.solver = simulator_;
    request.input_kind = InputKind::simulation;
    request.inputs = std::move(inputs);
  } else {
    request.job = make_canonical_job(order.bank());
    request.solver = solver_;
    if (!inputs.empty()) {
      request.input_kind = inputs[0].kind;
      request.input_format = inputs[0].format;
      request.input_sha256 = inputs[0].sha256;
      request.input_file = inputs[0].file;
    }
  }
  request.resources = order.resources();
  request.user = find_user();
  request.submitted_unix_s = std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  request.job_file = to_text(fs::absolute(order.file()).lexically_normal());
  request.id = calc_id(request).text();
  return request;
}

Id calc_id(const Request& request) {
  return hash_text(fmt::format("{}\njob {}\ninput {} {} {}\nsolver {}\n", kScheme, request.job, to_text(request.input_kind),
                               to_text(request.input_format), request.input_sha256, request.solver));
}

fs::path find_input_file(const Store& store, const Input& input) {
  return store.input_file(require_id(input.sha256, "the request"), input.format);
}

std::optional<std::string> find_input_fault(const Store& store, const Request& request) {
  for (const Input& input : list_inputs(request))
    if (auto fault = find_input_fault(store, input)) return fault;
  return std::nullopt;
}

std::optional<std::string> find_input_fault(const Store& store, const Input& input) {
  const Id wanted = require_id(input.sha256, "the request");
  const fs::path file = find_input_file(store, input);
  const std::string what =
      fmt::format("the copy of its {} in the store, {},", to_text(input.kind), file.lexically_relative(store.root()).string());
  try {
    const auto hash = [&](const fs::path& name) -> std::optional<Id> {
      std::error_code error;
      return fs::is_regular_file(name, error) ? std::optional(hash_file(name, to_text(input.kind))) : std::nullopt;
    };
    std::optional<Id> found = hash(file);
    if (found && input.format == "tetgen") {
      const std::optional<Id> other = hash(fs::path(file).replace_extension("ele"));
      found = other ? std::optional(hash_pair(*found, *other)) : std::nullopt;
    }
    if (!found) return what + " is missing";
    if (*found != wanted) return what + " is damaged: its bytes have changed since submission";
    return std::nullopt;
  } catch (const SystemError& error) {
    return error.what();
  } catch (const InputError& error) {
    return error.what();
  }
}

std::optional<std::string> find_job_fault(const Store& store, const Id& id) {
  const fs::path folder = store.work_folder(id);
  try {
    const std::optional<Request> request = read_request(folder);
    if (!request) return "its request.json is missing";
    if (request->id != id.text() || calc_id(*request) != id) return "its request.json is not the submitted one";
    return find_text_fault(store, *request, id, base::read_file(folder / kJobFile, "job file", kMaxJobBytes));
  } catch (const InputError& error) {
    return fmt::format("its files cannot be read: {}", error.what());
  }
}

std::optional<std::string> find_output_fault(const fs::path& folder, const Request& request) {
  try {
    for (const std::string& name : list_outputs(request.job)) {
      const fs::file_status status = fs::symlink_status(folder / name);
      if (!fs::exists(status)) return fmt::format("its {} is missing", name);
      if (!fs::is_regular_file(status)) return fmt::format("its {} is not a regular file", name);
    }
    const std::string record = base::read_file(folder / kRecordFile, "record", kMaxJobBytes);
    return find_record_fault(record, base::read_file(folder / kJobFile, "job file", kMaxJobBytes));
  } catch (const InputError& error) {
    return error.what();
  } catch (const fs::filesystem_error& error) {
    return error.what();
  }
}

std::optional<std::string> find_origin_fault(const std::string& provenance, const Request& request) {
  switch (compare_origin(parse_object(provenance), request)) {
    case Origin::same:
      return std::nullopt;
    case Origin::unknown:
      return "the bank does not record its job";
    case Origin::another_job:
      return "the bank was computed from another job";
    case Origin::another_input:
      break;
  }
  return fmt::format("the bank was computed from another {}", to_text(request.input_kind));
}

std::optional<std::string> find_resolved_fault(const fs::path& folder, const Id& id) {
  std::optional<Request> request;
  try {
    request = read_request(folder);
  } catch (const InputError&) {
    return "its request.json cannot be read";
  }
  if (!request) return "its request.json is missing";
  if (request->id != id.text() || calc_id(*request) != id) return "its request.json is not the submitted one";
  std::string text;
  try {
    text = base::read_file(folder / kJobFile, "record", kMaxJobBytes);
  } catch (const InputError&) {
    return "its job.json is missing or unreadable";
  }
  switch (compare_origin(parse_object(text), *request)) {
    case Origin::same:
      return std::nullopt;
    case Origin::unknown:
      return text.empty() ? "its job.json is empty" : "its job.json is truncated or damaged";
    default:
      return "its job.json belongs to another job";
  }
}

std::string name_job(const std::string& message, const Id& id, const std::string& name) {
  const std::string copy = fmt::format("/{}/{}", id.text(), kJobFile);
  const std::size_t at = message.find(copy);
  if (at == std::string::npos || message[0] != '/') return message;
  std::size_t end = at + copy.size();
  if (const std::size_t digits = message.find_first_not_of("0123456789", end + 1);
      message.compare(end, 1, ":") == 0 && digits != std::string::npos && digits > end + 1)
    end = digits;
  return name + message.substr(end);
}

std::vector<std::string> read_warnings(const Store& store, const Id& id, const std::string& name) {
  std::vector<std::string> texts;
  const fs::path folder = store.bank_folder(id);
  try {
    const base::Json root = parse_object(base::read_file(folder / kJobFile, "record", kMaxJobBytes));
    const base::Json list = root.has("simulate") ? parse_object(base::read_file(folder / kRecordFile, "record", kMaxJobBytes))["warnings"]
                                                 : root["run"]["warnings"];
    if (list.empty()) return texts;
    const std::optional<Request> request = read_request(folder);
    if (!request || request->id != id.text() || calc_id(*request) != id || compare_origin(root, *request) != Origin::same) return texts;
    for (std::size_t i = 0; list.is_array() && i < list.size() && texts.size() < kMaxTexts; ++i) {
      if (!list[i].is_string()) continue;
      const std::string text = name_job(list[i].as_string(), id, name);
      if (std::find(texts.begin(), texts.end(), text) == texts.end()) texts.push_back(text);
    }
  } catch (const InputError&) {
  } catch (const std::logic_error&) {
  }
  return texts;
}

bool restore_input(const Store& store, const Request& request) {
  for (const Input& input : list_inputs(request)) {
    if (!find_input_fault(store, input)) continue;
    if (input.file.empty()) return false;
    try {
      take_snapshot(store, from_text(input.file), input);
    } catch (const InputError&) {  // removed or changed
      return false;
    }
  }
  return true;
}

bool restore_work(const Store& store, const Request& request) {
  const Id id = calc_id(request);
  const Temporary temporary = store.make_temporary();
  make_folder(temporary / id.text());
  fill_work(make_job(store, request, id), request, temporary / id.text());
  if (is_spoilt(store, id)) store.remove_work(id);
  return store.publish_work(temporary, {{id, id.text()}}).front();
}

std::vector<bool> prepare_work(const Store& store, const std::vector<Asked>& asked) {
  std::vector<bool> was_made(asked.size(), false);
  std::vector<std::size_t> index;  // into `asked`, of `folders`
  std::vector<Store::Prepared> folders;
  std::set<Id> seen;
  Inputs inputs;
  std::optional<Temporary> temporary;
  for (std::size_t i = 0; i < asked.size(); ++i) {
    const Id id = require_id(asked[i].request->id, "the request");
    if (!seen.insert(id).second) continue;
    if (!store.find_bank_fault(id, Look::content)) continue;
    if (store.has_bank_folder(id)) store.set_bank_aside(id);
    const bool is_copied = ensure_inputs(store, *asked[i].order, *asked[i].request, inputs);
    if (store.has_work(id)) {
      was_made[i] = is_copied;
      if (!is_spoilt(store, id)) continue;
      store.remove_work(id);
    }
    if (!temporary) temporary.emplace(store.make_temporary());
    folders.push_back({id, id.text()});
    index.push_back(i);
    make_folder(*temporary / id.text());
    fill_work(asked[i].order->write(store.work_folder(id), find_input_files(store, *asked[i].request)), *asked[i].request,
              *temporary / id.text());
  }
  if (folders.empty()) return was_made;
  const std::vector<bool> was_published = store.publish_work(*temporary, folders);
  for (std::size_t i = 0; i < index.size(); ++i) was_made[index[i]] = was_published[i];
  return was_made;
}

}  // namespace carillon::store
