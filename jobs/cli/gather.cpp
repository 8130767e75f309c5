#include "jobs/cli/gather.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <set>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/foreign.hpp"

namespace carillon::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxManifestBytes = 1ULL << 28;

std::string name_of(const fs::path& file) { return store::to_text(fs::absolute(file).lexically_normal()); }

bool ends_with(const fs::path& file, std::string_view ending) { return file.filename().string().ends_with(ending); }

/// Calls `read` and stores an InputError in the source.
template <class Read>
Source keep_error(const std::string& job_file, const Read& read) {
  Source source;
  source.job_file = job_file;
  try {
    source.order = read();
  } catch (const InputError& error) {
    source.error = error.what();
  }
  return source;
}

Source read_file_source(const fs::path& file) {
  return keep_error(name_of(file), [&] { return store::read_order(file); });
}

std::vector<Source> read_folder(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    if (ends_with(it->path(), ".json") && !ends_with(it->path(), ".resolved.json")) files.push_back(it->path());
  }
  if (error) throw InputError(fmt::format("{}: cannot read this folder: {}; check its rights", folder.string(), error.message()));
  if (files.empty()) throw InputError(fmt::format("{}: no jobs in this folder; jobs are files that end in .json", folder.string()));
  std::sort(files.begin(), files.end());
  std::vector<Source> sources;
  for (const fs::path& file : files) sources.push_back(read_file_source(file));
  return sources;
}

std::string strip(const std::string& line) {
  const std::size_t begin = line.find_first_not_of(" \t\r");
  return begin == std::string::npos ? "" : line.substr(begin, line.find_last_not_of(" \t\r") - begin + 1);
}

/// `place` is "manifest:line".
Source read_line(const std::string& line, const fs::path& manifest, int number) {
  const std::string place = fmt::format("{}:{}", manifest.string(), number);
  if (line.starts_with('{')) {
    return keep_error(fmt::format("{}#{}", name_of(manifest), number), [&] { return store::parse_order(line, manifest, number); });
  }
  const fs::path file = fs::path(line).is_absolute() ? fs::path(line) : manifest.parent_path() / line;
  Source source = read_file_source(file);
  if (!source.error.empty()) source.error = fmt::format("{}: {}", place, source.error);
  return source;
}

std::vector<Source> read_manifest(const std::string& word, int only = 0) {
  const bool is_stdin = word == "-";
  const fs::path manifest = is_stdin ? fs::current_path() / "standard input" : fs::absolute(word);
  std::string text =
      is_stdin ? std::string(std::istreambuf_iterator<char>(std::cin), {})
               : base::read_file(word, "manifest", kMaxManifestBytes, "a job file ends in .json, and a manifest names one per line");
  base::refuse_utf16(text, word);
  if (text.find('\0') != std::string::npos)
    throw InputError(fmt::format("{}: not a text file; a job file ends in .json, and a manifest names one per line", word));
  std::vector<Source> sources;
  int number = 0;
  for (std::size_t at = 0; at < text.size(); ++number) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string line = strip(text.substr(at, end - at));
    at = end + 1;
    if (!line.empty() && line[0] != '#' && (only == 0 || only == number + 1)) sources.push_back(read_line(line, manifest, number + 1));
  }
  if (sources.empty() && only > 0) throw InputError(fmt::format("{}: no job on line {}", word, only));
  if (sources.empty()) throw InputError(fmt::format("{}: this manifest has no jobs; write one job file per line", word));
  return sources;
}

/// File and line of "sweep.txt#21"; line 0 without such a file.
std::pair<std::string, int> split_line(const std::string& word) {
  const std::size_t mark = word.rfind('#');
  std::error_code error;
  int line = 0;
  if (mark == std::string::npos || fs::exists(word, error) || !fs::is_regular_file(word.substr(0, mark), error)) return {word, 0};
  const char* const end = word.data() + word.size();
  const auto read = std::from_chars(word.data() + mark + 1, end, line);
  return read.ec == std::errc() && read.ptr == end && line > 0 ? std::pair(word.substr(0, mark), line) : std::pair(word, 0);
}

std::vector<Source> read_word(const std::string& word) {
  std::error_code error;
  if (const auto [manifest, line] = split_line(word); line > 0) return read_manifest(manifest, line);
  if (word != "-" && fs::is_directory(word, error)) return read_folder(word);
  if (word != "-" && ends_with(word, ".json")) return {read_file_source(word)};
  return read_manifest(word);
}

void add_request(Source& source, store::RequestMaker& maker) {
  if (!source.error.empty()) return;
  try {
    source.request = maker.make(source.order);
    source.request.job_file = source.job_file;
  } catch (const InputError& error) {
    source.error = fmt::format("{}: {}", source.order.file().string(), error.what());
  }
}

/// The version of carillon-simulate; empty without simulations.
std::string find_simulator(const std::vector<Source>& sources) {
  const bool is_needed = std::any_of(sources.begin(), sources.end(), [](const Source& source) { return source.order.is_simulation(); });
  return is_needed ? read_program_version("carillon-simulate") : "";
}

}  // namespace

std::vector<Source> gather(const std::vector<std::string>& words, const std::string& solver) {
  std::vector<Source> sources;
  std::set<std::string> seen;
  for (const std::string& word : words) {
    for (Source& source : read_word(word)) {
      if (seen.insert(source.job_file).second) sources.push_back(std::move(source));
    }
  }
  store::RequestMaker maker(solver, find_simulator(sources));
  for (Source& source : sources) add_request(source, maker);
  return sources;
}

bool is_of_jobs(const std::string& word) {
  std::error_code error;
  return fs::exists(word, error) || split_line(word).second > 0;
}

bool is_of_many(const std::string& word) {
  std::error_code error;
  return fs::is_directory(word, error) || (fs::is_regular_file(word, error) && !ends_with(word, ".json"));
}

std::vector<std::string> list_job_files(const std::string& word) {
  const std::vector<Source> sources = read_word(word);
  // Neither a job nor a manifest.
  if (std::none_of(sources.begin(), sources.end(), [](const Source& source) { return source.error.empty(); }))
    throw InputError(sources.front().error);
  std::vector<std::string> files;
  for (const Source& source : sources) files.push_back(source.job_file);
  return files;
}

Source gather_one(const std::string& word, const std::string& solver) {
  Source source = gather({word}, solver).front();
  if (!source.error.empty()) throw InputError(source.error);
  return source;
}

std::vector<Named> find_all_by_content(Shared& shared, const std::vector<std::string>& words) {
  std::vector<Named> found;
  const auto add = [&](const store::Id& id, std::optional<registry::Job> job, const std::string& name) {
    if (std::none_of(found.begin(), found.end(), [&](const Named& known) { return known.id == id; }))
      found.push_back({id, std::move(job), name});
  };
  std::string solver;
  for (const std::string& word : words) {
    const bool is_content =
        !store::parse_id(word) && (is_of_jobs(word) || (word.ends_with(".json") && word.find('/') != std::string::npos));
    if (!is_content) {
      registry::Job job = find_job(shared, word);
      const store::Id id = job.id;
      const std::string name = job.name;
      add(id, std::move(job), name);
      continue;
    }
    if (solver.empty()) solver = read_solver_version();
    for (const Source& source : gather({word}, solver)) {
      if (!source.error.empty()) throw InputError(source.error);
      const store::Id id = store::require_id(source.request.id, source.job_file);
      add(id, shared.registry().find(id), registry::find_name(source.job_file));
    }
  }
  return found;
}

std::pair<store::Id, std::optional<registry::Job>> find_by_content(Shared& shared, const std::string& word) {
  const std::vector<Named> found = find_all_by_content(shared, {word});
  if (found.size() != 1) throw InputError(fmt::format("{}: matches {} jobs; name one of them", word, found.size()));
  return {found.front().id, found.front().job};
}

}  // namespace carillon::cli
