// carillon get: the bank of a job, or the files of a simulation.
#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <cstdio>

#include "jobs/cli/commands.hpp"
#include "jobs/cli/gather.hpp"
#include "jobs/store/files.hpp"
#include "jobs/store/identity.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"

namespace carillon::cli {
namespace {

namespace fs = std::filesystem;

/// Copies a file whole: it has no name before it is on the disk.
void copy_to(const fs::path& from, const fs::path& wanted) {
  std::error_code error;
  const fs::path to = fs::is_directory(wanted, error) ? wanted / from.filename() : wanted;
  if (fs::equivalent(from, to, error)) throw InputError(fmt::format("{}: this is the file in the store; name another", to.string()));
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

}  // namespace

int run_get(Shared& shared, const GetOptions& options) {
  shared.only_reads = true;
  shared.settle();
  const auto [id, job] = find_by_content(shared, options.word);
  // A copy is for good: every byte is looked at before.
  const auto fault = shared.store().find_bank_fault(id, options.to.empty() ? store::Look::quick : store::Look::full);
  const bool is_done = !fault, is_damaged = fault && shared.store().has_bank_folder(id);
  const std::vector<std::string> warnings = is_done ? store::read_warnings(shared.store(), id) : std::vector<std::string>();
  const auto results = is_done ? list_results(shared.store(), id) : std::map<std::string, fs::path>();
  std::map<std::string, std::string> places;  // that are printed
  const bool is_bank = results.count("bank") > 0;
  std::error_code error;
  if (is_done && !is_bank && !options.to.empty() && !fs::is_directory(options.to, error))
    throw InputError(fmt::format("{}: is no folder, and a simulation has several files; name a folder that is there", options.to));
  for (const auto& [key, file] : results) {
    if (!options.to.empty()) copy_to(file, options.to);
    places[key] = options.to.empty() ? file.string() : is_bank ? options.to : (fs::path(options.to) / file.filename()).string();
  }
  const bool is_again = job && (job->state == registry::JobState::queued || job->state == registry::JobState::running ||
                                job->state == registry::JobState::waiting);
  const std::string state = is_done ? "done" : is_damaged && !is_again ? "failed" : job ? to_text(job->state) : "new";
  const std::string why = is_done                   ? ""
                          : is_damaged && !is_again ? fmt::format("{}; carillon retry {} computes it again", *fault, id.short_text())
                          : job                     ? find_reason(shared, *job)
                                                    : "";
  if (shared.json) {
    Json::Value root;
    root["id"] = id.text();
    root["state"] = state;
    root["reason"] = to_json(why);
    root["warnings"] = to_json(warnings);
    root["bank"] = is_bank ? to_json(results.at("bank").string()) : Json::Value();
    root["results"] = Json::objectValue;
    for (const auto& [key, file] : results) root["results"][key] = to_json(file.string());
    root["copy"] = is_done && !options.to.empty() ? to_json(options.to) : Json::Value();
    print_json(root);
  } else if (is_done) {
    for (const auto& [key, place] : places) fmt::print("{}\n", place);
    for (const std::string& warning : warnings) fmt::print(stderr, "carillon: warning: {}\n", show_message(warning));
  } else {
    const std::string reason = job || is_damaged ? show_message(why) : "carillon submit asks for it";
    fmt::print(stderr, "carillon: no result yet: {} is {}{}{}\n", id.short_text(), state, reason.empty() ? "" : "; ", reason);
  }
  if (std::fflush(stdout) != 0) throw SystemError("the output cannot be written");
  return is_done ? 0 : kExitNotYet;
}

}  // namespace carillon::cli
