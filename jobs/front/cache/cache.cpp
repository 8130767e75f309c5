// Method:     Ids of jobs/store; carillon-precompute runs in a temporary folder of the cache, published by one rename. Concurrent misses of
//             the same bank both solve it. If the mesher refuses the node count of a preview and proposes another, the proposal is stored
//             for the next time.
#include "jobs/front/cache/cache.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdlib>
#include <optional>
#include <system_error>

#include "jobs/store/identity.hpp"
#include "jobs/store/process/programs.hpp"
#include "jobs/store/store.hpp"
#include "precompute/job/preview.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/printable.hpp"

namespace carillon::cache {
namespace {

namespace fs = std::filesystem;

constexpr const char* kCountFolder = "counts";  // node counts by the id of the requested preview
constexpr std::uint64_t kMaxCountBytes = 100;

/// Name of the body for messages.
std::string describe(const job::JobSpec& job) {
  const std::string body = job.analytic                           ? job::get_key(*job.analytic)
                           : job.body && !job.body->shape.empty() ? job.body->shape
                                                                  : job::get_input(job).filename().string();
  return job.material.name.empty() ? body : fmt::format("{} of {}", body, job.material.name);
}

/// Place in the scene or job, for messages about the copy that the solver reads.
std::string find_place(const job::JobSpec& job) {
  if (job.body && !job.body->place.empty()) return job.body->place;
  if (job.analytic && !job.analytic->place.empty()) return job.analytic->place;
  return job.file.string();
}

/// Replaces "COPY:LINE" or "COPY" at the beginning of a message by `place`.
std::string name_place(const std::string& message, const fs::path& copy, const std::string& place) {
  if (!message.starts_with(copy.string())) return fmt::format("{}: {}", place, message);
  std::size_t end = copy.string().size();
  if (message.compare(end, 1, ":") == 0) {
    const std::size_t digits = message.find_first_not_of("0123456789", end + 1);
    if (digits != std::string::npos && digits > end + 1 && message[digits] == ':') end = digits;
  }
  return place + message.substr(end);
}

/// Warnings about differences between mesh and description.
std::vector<std::string> read_mesh_warnings(const fs::path& folder) {
  constexpr std::size_t kMaxWarnings = 100;
  std::vector<std::string> warnings;
  try {
    base::Object root = base::read_document(folder / store::kJobFile).root();
    std::optional<base::Object> run = root.object_if("run"), mesh = run ? run->object_if("mesh") : std::nullopt;
    if (!mesh || !mesh->has("warnings")) return warnings;
    for (const base::Entry& entry : mesh->entries("warnings", kMaxWarnings)) warnings.push_back(entry.text);
  } catch (const InputError&) {  // without warnings if the record is damaged
  }
  return warnings;
}

class Maker {
 public:
  Maker(const job::JobSpec& asked, std::string solver, const fs::path& cache, bool is_quiet)
      : job_(asked), requests_(std::move(solver)), cache_(store::Store::open(cache)), is_quiet_(is_quiet) {
    job_.bank.clear();
    is_preview_ = job::make_preview(job_);
  }

  Made run() {
    store::Request request = make_request();
    const store::Id asked = store::require_id(request.id, "the job");
    if (is_preview_) request = recall_count(asked, request);
    Made made{.bank = find(store::require_id(request.id, "the job")), .warnings = job_.warnings};
    if (made.bank.empty()) make(asked, made);
    for (const std::string& warning : read_mesh_warnings(made.bank.parent_path()))
      made.warnings.push_back(fmt::format("{}: {}", find_place(job_), warning));
    return made;
  }

 private:
  void make(const store::Id& asked, Made& made) {
    made.is_new = true;
    if (!is_preview_) {
      made.bank = solve();
      return;
    }
    const std::int64_t wanted = *job_.body->nodes;
    const std::int64_t met = job::run_at_possible_count(wanted, "\"accuracy_cents\" chooses the count itself", [&](std::int64_t nodes) {
      job_.body->nodes = nodes;
      made.bank = solve();
    });
    if (met != wanted) remember_count(asked, met);
  }

  /// Empty: not found.
  fs::path find(const store::Id& id) const {
    std::error_code error;
    if (const fs::path own = store::find_default_store(); fs::exists(own / "VERSION", error)) {
      try {
        const store::Store store = store::Store::open_to_read(own);
        if (!store.find_bank_fault(id, store::Look::content)) return store.bank_folder(id) / store::kBankFile;
      } catch (const InputError&) {  // unreadable store: not found
      }
    }
    // All bytes, but not the name of the input: here it is the user's own file, not a snapshot named by its content.
    if (!cache_.find_bank_fault(id, store::Look::full)) return cache_.bank_folder(id) / store::kBankFile;
    if (cache_.has_bank_folder(id)) cache_.set_bank_aside(id);
    return {};
  }

  store::Request make_request() {
    try {
      return requests_.make(job_);
    } catch (const InputError& error) {  // unreadable file
      throw InputError(fmt::format("{}: {}", find_place(job_), error.what()));
    }
  }

  store::Request recall_count(const store::Id& asked, const store::Request& request) {
    std::error_code error;
    const fs::path file = cache_.root() / kCountFolder / asked.text();
    if (!fs::is_regular_file(file, error)) return request;
    const long long nodes = std::atoll(base::read_file(file, "count of nodes", kMaxCountBytes).c_str());
    if (nodes < 4 || nodes > job::kMaxPreviewNodes) return request;
    job_.body->nodes = nodes;
    return make_request();
  }

  void remember_count(const store::Id& asked, std::int64_t nodes) const {
    std::error_code error;
    fs::create_directory(cache_.root() / kCountFolder, error);
    if (!error) base::write_file(cache_.root() / kCountFolder / asked.text(), fmt::format("{}\n", nodes));
  }

  void say(const std::string& text) const {
    if (!is_quiet_) fmt::print(stderr, "carillon: {}\n", base::printable(text));
  }

  fs::path solve() {
    const store::Request request = make_request();
    const store::Id id = store::require_id(request.id, "the job");
    const auto start = std::chrono::steady_clock::now();
    say(fmt::format("computing the modes of {}, once", describe(job_)));
    store::Temporary temporary = cache_.make_temporary();
    const fs::path folder = temporary.path(), file = folder / store::kJobFile;
    job_.bank = folder / store::kBankFile;
    base::write_file(file, job::resolved_json(job_, folder, ""));
    std::vector<std::string> words{file.string()};
    if (is_preview_) words.emplace_back("-q");
    try {
      (void)process::Programs(is_quiet_).run("carillon-precompute", words, true, !is_preview_);
    } catch (const CountRefusal&) {
      throw;
    } catch (const InputError& error) {
      throw InputError(name_place(error.what(), file, find_place(job_)));
    } catch (const SolveError& error) {
      throw SolveError(name_place(error.what(), file, find_place(job_)));
    }
    // The resolved job, written by the solver next to the bank.
    fs::rename(job::find_resolved_path(job_.bank), file);
    store::write_request(folder, request);
    cache_.publish(id, temporary);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    say(fmt::format("{:.1f} s; cached in {}{}", seconds, cache_.root().string(),
                    is_preview_ ? " (a preview: \"accuracy_cents\" refines it)" : ""));
    return cache_.bank_folder(id) / store::kBankFile;
  }

  job::JobSpec job_;
  store::RequestMaker requests_;
  store::Store cache_;
  bool is_quiet_, is_preview_ = false;
};

}  // namespace

fs::path find_default_cache() {
  const char* cache = std::getenv("XDG_CACHE_HOME");
  if (cache != nullptr && fs::path(cache).is_absolute()) return fs::path(cache) / "carillon";
  const char* home = std::getenv("HOME");
  if (home != nullptr && fs::path(home).is_absolute()) return fs::path(home) / ".cache" / "carillon";
  throw SystemError("no folder for the cache of banks: set XDG_CACHE_HOME or HOME");
}

Made find_or_make(const job::JobSpec& job, const std::string& solver, const fs::path& cache, bool is_quiet) {
  std::error_code error;
  fs::create_directories(cache, error);
  if (error)
    throw SystemError(fmt::format("{}: cannot create the cache of banks: {}; set XDG_CACHE_HOME", cache.string(), error.message()));
  return Maker(job, solver, cache, is_quiet).run();
}

}  // namespace carillon::cache
