// Method:     The page is a template (page/) with the data of the bank and the record of its run as JSON; its script shows them as text
// only.
//             The bank is read without checks, so that invalid banks have a report too.
#include "jobs/front/report/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>

#include "jobs/front/report/figures.hpp"
#include "jobs/front/report/page.hpp"
#include "jobs/front/report/record.hpp"
#include "runtime/base/command.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/result.hpp"
#include "runtime/base/temporary.hpp"

namespace carillon::report {
namespace {

namespace fs = std::filesystem;

// Source: PNG Specification 5.2 (signature), 11.2.5 (IEND).

struct Drawing {
  std::string fault;  // why there is no picture, one sentence without a full stop; empty: drawn
};

bool is_whole_png(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::array<char, 8> first{}, last{};
  in.read(first.data(), 8);
  in.seekg(-8, std::ios::end);
  in.read(last.data(), 8);
  return in && std::memcmp(first.data(), "\x89PNG\r\n\x1a\n", 8) == 0 && std::memcmp(last.data(), "IEND\xae\x42\x60\x82", 8) == 0;
}

/// Why it failed; empty: success.
std::string run(const fs::path& program, const fs::path& bank, int modes, const fs::path& picture, double limit_s) {
  std::string numbers = "1";
  for (int mode = 2; mode <= modes; ++mode) numbers += fmt::format(",{}", mode);
  const fs::path file = picture.parent_path() / "result.json";
  base::Finished finished;
  try {
    finished = base::run({.words = {program, "modes", bank, "-o", picture, "--modes", numbers, "--result", file}, .default_signals = true},
                         {.patience_s = limit_s});
  } catch (const SystemError& error) {
    return error.what();
  }
  if (finished.was_slow) return fmt::format("carillon-draw took longer than {:g} s and was ended", limit_s);
  if (finished.signal != 0) return fmt::format("carillon-draw was ended by signal {}", finished.signal);
  if (finished.exit_code == 0) return {};
  const std::optional<base::Result> result = base::read_result(file);
  if (!result || result->message.empty()) return fmt::format("carillon-draw failed with exit code {}", finished.exit_code);
  return fmt::format("carillon-draw: {}", result->message);
}

/// Runs `program` (empty: carillon-draw next to this program, else in PATH) with a time limit; it ends with this process. The picture is a
/// complete PNG or missing.
Drawing draw_modes(const fs::path& given, const fs::path& bank, int modes, const fs::path& picture, double limit_s) {
  std::error_code error;
  fs::remove(picture, error);
  const std::optional<fs::path> program = given.empty() ? base::find_program("carillon-draw") : std::optional(fs::absolute(given, error));
  if (!program || !base::is_program(*program)) return {"carillon-draw is not installed here"};
  // In a temporary folder, removed with all files of the program.
  std::optional<base::TemporaryFolder> place;
  try {
    place.emplace(fs::absolute(picture, error).parent_path(), ".drawing-");
  } catch (const SystemError& failure) {
    return {fmt::format("no temporary folder: {}", failure.what())};
  }
  const fs::path drawn = place->path() / picture.filename();
  Drawing drawing{run(*program, fs::absolute(bank, error), modes, drawn, limit_s)};
  if (drawing.fault.empty() && !is_whole_png(drawn)) drawing.fault = "carillon-draw left no picture";
  if (drawing.fault.empty()) {
    fs::rename(drawn, picture, error);
    if (error) drawing.fault = fmt::format("the picture cannot be kept: {}", error.message());
  }
  return drawing;
}

constexpr int kMaxDrawn = 12;  // limit of carillon-draw

/// The mesh, surface or shape of the job, else the file name of the bank.
std::string find_title(const base::Json& job, const fs::path& bank) {
  const base::Json& body = find(job, "body");
  for (const auto& name : {find_text(job, "mesh"), find_text(body, "surface"), find_text(body, "shape")}) {
    if (name && !fs::path(*name).filename().empty()) return fs::path(*name).filename().string();
  }
  return bank.filename().string();
}

/// {"file", "modes"}, or {"reason"} as a sentence.
base::Json draw(const base::Json& figures, const fs::path& bank, const fs::path& folder, const Options& options) {
  const int mode_count = static_cast<int>(std::min<std::size_t>(figures["modes"]["heard_hz"].size(), kMaxDrawn));
  const int modes = std::min({options.drawn_modes, kMaxDrawn, mode_count});
  base::Json json;
  if (modes < 1) {
    std::error_code error;
    fs::remove(folder / kPictureFile, error);
    json["reason"] = mode_count == 0                  ? "the bank has no modes to draw."
                     : options.undrawn_reason.empty() ? "not drawn yet; carillon report draws them."
                                                      : options.undrawn_reason + ".";
    return json;
  }
  const Drawing drawing = draw_modes(options.draw_program, bank, modes, folder / kPictureFile, options.draw_limit_s);
  if (!drawing.fault.empty()) {
    json["reason"] = drawing.fault + ".";
  } else {
    json.set("file", kPictureFile).set("modes", modes);
  }
  return json;
}

/// Escapes control and bidirectional characters and invalid UTF-8 in all strings and keys.
base::Json clean(const base::Json& value) {
  if (value.is_string()) return base::printable(value.as_string());
  if (value.is_array()) {
    base::Json list = base::Json::array();
    for (const base::Json& member : value) list.add(clean(member));
    return list;
  }
  if (!value.is_object()) return value;
  base::Json object = base::Json::object();
  for (const std::string& key : value.keys()) object[base::printable(key)] = clean(value[key]);
  return object;
}

/// JSON for an HTML script element: no "<".
std::string write_data(const base::Json& data) {
  std::string text;
  for (const char letter : data.line()) {
    if (letter == '<')
      text += "\\u003c";
    else
      text += letter;
  }
  return text;
}

std::string fill(std::string_view page, std::string_view mark, std::string_view text) {
  const std::size_t at = page.find(mark);
  return std::string(page.substr(0, at)) + std::string(text) + std::string(page.substr(at + mark.size()));
}

}  // namespace

void write_report(const fs::path& bank, const fs::path& resolved_job, const fs::path& folder, const Options& options) {
  std::string provenance;
  base::Json data;
  data["bank"] = make_figures(bank, provenance);
  Record record = read_record(resolved_job, provenance);
  data["title"] = options.title.empty() ? find_title(record.job, bank) : options.title;
  if (record.job.is_object()) record.job.erase("run");
  data.set("job", record.job).set("run", record.run).set("remarks", base::Json::array(record.remarks)).set("explorer", options.explorer);
  std::error_code error;
  fs::create_directories(folder, error);
  if (error || !fs::is_directory(folder))
    throw SystemError(fmt::format("{}: cannot create the folder of the report: {}; choose another place", folder.string(),
                                  error ? error.message() : "not a directory"));
  data["picture"] = draw(data["bank"], bank, folder, options);
  // The data last: it may contain any mark.
  const std::string page = fill(fill(kPage, "{{STYLE}}", kStyle), "{{SCRIPT}}", kScript);
  base::write_file(folder / kPageFile, fill(page, "{{DATA}}", write_data(clean(data))));
}

}  // namespace carillon::report
