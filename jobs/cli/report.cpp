// carillon report: the report of a bank in the store or in a file.
#include "jobs/front/report/report.hpp"

#include <fmt/core.h>

#include <cstdio>

#include "jobs/cli/commands.hpp"
#include "jobs/cli/gather.hpp"
#include "runtime/base/error.hpp"

namespace carillon::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char* kExplorer = "explore";  // folder of the page next to the report

/// The page of carillon explore next to a report; empty for a bank that cannot be played.
std::string make_explorer(const fs::path& bank, const fs::path& folder, const std::string& title) {
  try {
    (void)explore::explore({.subjects = {bank}, .folder = folder / kExplorer, .title = title});
    return kExplorer;
  } catch (const InputError&) {
    return "";
  }
}

/// Into options.folder.
fs::path write(const ReportOptions& options, const fs::path& bank, const fs::path& resolved_job, const std::string& title) {
  report::Options wanted;
  wanted.title = title;
  if (options.no_pictures) wanted.drawn_modes = 0;
  if (!options.no_page && explore::is_installed()) wanted.explorer = make_explorer(bank, options.folder, title);
  report::write_report(bank, resolved_job, options.folder, wanted);
  return options.folder / report::kPageFile;
}

/// Name of the submitted mesh or surface; empty if unknown.
std::string find_title(const fs::path& folder) {
  try {
    const std::optional<store::Request> request = store::read_request(folder);
    return request ? store::find_input_name(*request) : std::string();
  } catch (const InputError&) {
    return "";
  }
}

/// Replaces the report in the store by one with pictures. On failure prints a message and keeps the old one.
void draw_in_store(const store::Store& store, const store::Id& id, const std::string& title) {
  try {
    const store::Lock lock = store.lock_shared();  // gc waits
    const store::Temporary temporary = store.make_temporary();
    const fs::path folder = store.bank_folder(id);
    report::write_report(folder / store::kBankFile, folder / store::kJobFile, temporary.path(), {.title = title});
    store.replace_records(id, temporary);
  } catch (const SystemError& error) {
    fmt::print(stderr, "carillon: the report has no pictures: {}\n", show_message(error.what()));
  }
}

void print(Shared& shared, base::Json root, const fs::path& page) {
  if (shared.json) {
    root["report"] = page.empty() ? base::Json() : to_json(page.string());
    print_json(root);
  } else if (!page.empty()) {
    fmt::print("{}\n", page.string());
  }
  if (std::fflush(stdout) != 0) throw SystemError("the output cannot be written");
}

/// Report of a bank file outside the store.
int report_file(Shared& shared, const ReportOptions& options) {
  const fs::path bank = options.word;
  if (options.folder.empty()) throw InputError(fmt::format("{}: the report of a bank file needs -o FOLDER", bank.string()));
  std::error_code error;
  fs::path record = bank.string() + ".resolved.json";
  if (!fs::exists(record, error)) record = bank.parent_path() / store::kJobFile;
  if (!fs::exists(record, error)) record.clear();
  base::Json root;
  root["bank"] = to_json(bank.string());
  print(shared, root, write(options, bank, record, ""));
  return 0;
}

int report_job(Shared& shared, const ReportOptions& options) {
  shared.settle();
  const auto [id, job] = find_by_content(shared, options.word);
  const fs::path folder = shared.store().bank_folder(id);
  const bool is_done = shared.store().has_bank(id);
  base::Json root;
  root.set("id", id.text()).set("state", is_done ? "done" : job ? to_text(job->state) : "new");
  fs::path page;
  std::error_code error;
  if (is_done && list_results(shared.store(), id).count("bank") == 0)
    throw InputError(fmt::format("{}: a simulation has no report; carillon get prints its files", options.word));
  if (is_done) {
    const std::string title = find_title(folder);
    const bool has_pictures = fs::exists(folder / report::kPictureFile, error);
    if (!options.folder.empty()) {
      page = write(options, folder / store::kBankFile, folder / store::kJobFile, title);
    } else {
      if (!has_pictures && !options.no_pictures && shared.store().may_write()) draw_in_store(shared.store(), id, title);
      if (fs::exists(folder / store::kReportFile, error)) page = folder / store::kReportFile;
    }
  }
  print(shared, root, page);
  if (!page.empty()) return 0;
  if (!shared.json)
    fmt::print(stderr, "carillon: no report{}: {} is {}{}\n", is_done ? "" : " yet", id.short_text(), root["state"].as_string(),
               is_done ? ", but writing its report failed; carillon report -o FOLDER writes one" : "");
  return kExitNotYet;
}

}  // namespace

int run_report(Shared& shared, const ReportOptions& options) {
  shared.only_reads = true;
  std::error_code error;
  const bool is_file = !store::parse_id(options.word) && !options.word.ends_with(".json") && fs::is_regular_file(options.word, error);
  return is_file ? report_file(shared, options) : report_job(shared, options);
}

}  // namespace carillon::cli
