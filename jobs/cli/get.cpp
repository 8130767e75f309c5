// carillon get: paths or copies of banks and of files of simulations.
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <set>

#include "jobs/cli/commands.hpp"
#include "jobs/cli/gather.hpp"
#include "jobs/store/files.hpp"
#include "jobs/store/identity.hpp"
#include "jobs/store/warning_kinds.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"

namespace carillon::cli {
namespace {

namespace fs = std::filesystem;

/// Atomic copy.
void copy_to(const fs::path& from, const fs::path& wanted) {
  std::error_code error;
  const fs::path to = fs::is_directory(wanted, error) ? wanted / from.filename() : wanted;
  if (fs::equivalent(from, to, error)) throw InputError(fmt::format("{}: this is the file in the store; give another path", to.string()));
  base::check_writable(to, "copy");
  const fs::path temporary = to.parent_path() / fmt::format(".{}.tmp.{}", to.filename().string().substr(0, 200), ::getpid());
  const auto refuse = [&](int code) {
    ::unlink(temporary.c_str());
    store::throw_errno(to, "write", code);
  };
  ::unlink(temporary.c_str());
  fs::copy_file(from, temporary, error);
  if (error) refuse(error.value());
  try {
    store::sync_file(temporary);
  } catch (...) {
    ::unlink(temporary.c_str());
    throw;
  }
  fs::permissions(temporary, fs::perms::owner_write, fs::perm_options::add, error);
  fs::rename(temporary, to, error);
  if (error) refuse(error.value());
}

/// Current state of one job: its files, or the reason for their absence.
struct Got {
  Named named;
  std::string state, why;
  std::vector<std::string> warnings;
  std::map<std::string, fs::path> results;  // in the store, by key; empty: not done
  std::map<std::string, fs::path> copies;   // written by --to
  bool is_done() const { return !results.empty(); }
  bool is_bank() const { return results.count("bank") > 0; }
};

/// Checks digest and job of the bank.
Got look_at(Shared& shared, Named named) {
  Got got{std::move(named), {}, {}, {}, {}, {}};
  const store::Id& id = got.named.id;
  const std::optional<registry::Job>& job = got.named.job;
  const auto fault = shared.store().find_bank_fault(id, store::Look::content);
  if (!fault) {
    got.state = "done";
    got.warnings = store::read_warnings(shared.store(), id);
    got.results = list_results(shared.store(), id);
    return got;
  }
  const bool is_again = job && is_open(job->state);
  const bool is_damaged = shared.store().has_bank_folder(id) && !is_again;
  got.state = is_damaged ? "failed" : job ? to_text(job->state) : "new";
  got.why = is_damaged ? fmt::format("{}; carillon retry {} computes it again", *fault, id.short_text())
            : job      ? find_reason(shared, *job)
                       : "not submitted; use carillon submit";
  return got;
}

/// "bar" of bar.json, "sweep-21" of line 21 of sweep.txt.
std::string make_stem(const std::string& name) {
  const std::size_t mark = name.rfind('#');
  const fs::path file = store::from_text(name.substr(0, mark));
  return file.stem().string() + (mark == std::string::npos ? "" : "-" + name.substr(mark + 1));
}

/// Destinations of the files of each job: one bank to a file or into a folder, several into a folder by the names of their jobs.
void choose_places(std::vector<Got>& all, const fs::path& to) {
  std::error_code error;
  const bool is_one = all.size() == 1;
  if (is_one && !all[0].is_bank() && all[0].is_done() && !fs::is_directory(to, error))
    throw InputError(fmt::format("{}: not a folder, but a simulation has several files; give an existing folder", to.string()));
  if (!is_one && fs::exists(to, error) && !fs::is_directory(to, error))
    throw InputError(fmt::format("{}: not a folder, but these are {} jobs; give a folder", to.string(), all.size()));
  std::set<std::string> taken;
  for (Got& got : all) {
    std::string stem = make_stem(got.named.name);
    if (!taken.insert(stem).second) taken.insert(stem += "-" + got.named.id.short_text());
    for (const auto& [key, file] : got.results)
      got.copies[key] = !is_one         ? (got.is_bank() ? to / (stem + ".hdf") : to / stem / file.filename())
                        : got.is_bank() ? to
                                        : to / file.filename();
  }
}

base::Json describe(const Got& got, const fs::path& to, bool is_one) {
  base::Json root;
  root.set("id", got.named.id.text()).set("name", to_json(got.named.name)).set("state", got.state);
  root.set("reason", to_json(got.state == "new" ? "" : got.why)).set("warnings", to_json(got.warnings));
  root.set("bank", got.is_bank() ? to_json(got.results.at("bank").string()) : base::Json()).set("results", base::Json::object());
  for (const auto& [key, file] : got.results) root["results"][key] = to_json(file.string());
  root["copy"] = base::Json();
  if (!got.copies.empty())
    root["copy"] = to_json((is_one ? to : got.is_bank() ? got.copies.at("bank") : got.copies.begin()->second.parent_path()).string());
  return root;
}

void print(const std::vector<Got>& all) {
  constexpr std::size_t kMaxMissing = 20;
  store::WarningKinds kinds;
  std::size_t missing = 0;
  for (const Got& got : all) {
    for (const auto& [key, file] : got.copies.empty() ? got.results : got.copies) fmt::print("{}\n", file.string());
    for (const std::string& warning : got.warnings) kinds.add(show(got.named.name), show_message(warning));
    if (got.is_done() || ++missing > kMaxMissing) continue;
    fmt::print(stderr, "carillon: no result yet: {}{} is {}{}{}\n", got.named.id.short_text(),
               all.size() > 1 ? " (" + show(got.named.name) + ")" : "", got.state, got.why.empty() ? "" : "; ", show_message(got.why));
  }
  if (missing > kMaxMissing) fmt::print(stderr, "carillon: ... and {} more\n", missing - kMaxMissing);
  if (missing > 0 && all.size() > 1) fmt::print(stderr, "carillon: {} of {} jobs have no result yet\n", missing, all.size());
  if (all.size() == 1)
    for (const std::string& warning : all[0].warnings) fmt::print(stderr, "carillon: warning: {}\n", show_message(warning));
  else
    for (const std::string& line : kinds.list()) fmt::print(stderr, "carillon: warning {}\n", line);
}

}  // namespace

int run_get(Shared& shared, const GetOptions& options) {
  shared.only_reads = true;
  shared.settle();
  std::vector<Got> all;
  for (Named& named : find_all_by_content(shared, options.words)) all.push_back(look_at(shared, std::move(named)));
  if (!options.to.empty()) choose_places(all, options.to);
  for (const Got& got : all)
    for (const auto& [key, to] : got.copies) copy_to(got.results.at(key), to);
  const bool is_one = all.size() == 1;
  if (shared.json) {
    base::Json root;
    for (const Got& got : all) root["jobs"].append(describe(got, options.to, is_one));
    print_json(is_one ? root["jobs"][0] : root);
  } else {
    print(all);
  }
  if (std::fflush(stdout) != 0) throw SystemError("the output cannot be written");
  return std::all_of(all.begin(), all.end(), [](const Got& got) { return got.is_done(); }) ? 0 : kExitNotYet;
}

}  // namespace carillon::cli
