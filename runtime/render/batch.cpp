// Method:     a process per run: the memory of one is freed by its end, its crash is its own, and banks come from the page cache, read
// once.
#include "runtime/render/batch.hpp"

#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <map>
#include <string>
#include <system_error>
#include <utility>

#include "runtime/base/document.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::render {
namespace {

namespace fs = std::filesystem;

const base::Keys<ProgramOptions> kRun{{"scene", "required", "scene file; paths are relative to the manifest"},
                                      {"output", "required", "WAV file"},
                                      {"labels", "none", "as the option `--labels`, likewise the next ones"},
                                      {"record", "none", "contacts file to write"},
                                      {"contacts", "none", "contacts file to play"},
                                      {"report", "none", "figures of the run"},
                                      {"trajectory", "none", "paths of the bodies"},
                                      {"spectrogram", "none", "picture of the sound"},
                                      {"rate", &ProgramOptions::rate_hz, base::Limits{8000, 192000}, "sample rate instead of the scene's"},
                                      {"format", &ProgramOptions::format, "sample format instead of the scene's: one of `--format`"}};

ProgramOptions read_run(base::Object& object) {
  ProgramOptions options;
  options.scene = object.path("scene");
  options.sound = object.path("output");
  const auto read = [&](const char* key, std::optional<std::filesystem::path>& to) {
    if (object.has(key)) to = object.path(key);
  };
  read("labels", options.labels);
  read("record", options.record);
  read("contacts", options.contacts);
  read("report", options.report);
  read("trajectory", options.trajectory);
  read("spectrogram", options.spectrogram);
  kRun.read(object, options);
  const auto& formats = scene::kSampleFormatNames;
  if (options.format && std::find(formats.begin(), formats.end(), *options.format) == formats.end())
    object.fail("format", "must be pcm16, pcm24, pcm32 or float");
  options.quiet = true;
  object.finish();
  return options;
}

/// Exit code of a process that has ended; one that a signal ended counts as a failure of the system.
int find_code(int status, const std::filesystem::path& scene) {
  if (WIFEXITED(status)) return WEXITSTATUS(status);
  fmt::print(stderr, "carillon-render: {}: ended by signal {}\n", base::printable(scene.string()), WTERMSIG(status));
  return kExitSystem;
}

/// False also for a scene that cannot be read: its own run says why.
bool has_sensors(const fs::path& scene) {
  try {
    return base::read_document(scene, "").root().has("sensors");
  } catch (const std::exception&) {
    return false;
  }
}

/// The files of all runs: those of one must not be written or read by another, as runs come in any order.
class Files {
 public:
  void add_input(const fs::path& file, std::string what) { inputs_.emplace(find_key(file), std::move(what)); }
  void add_output(const fs::path& file, const std::string& place) {
    if (!written_.emplace(find_key(file), place).second) fail_twice(file, place);
  }
  void check_inputs() const {
    for (const auto& [file, what] : inputs_)
      if (const auto found = written_.find(file); found != written_.end())
        throw InputError(fmt::format("{}: {} is {}; give the output another name", found->second, file.string(), what));
  }
  /// Scenes are read only where files of sensors would have the name of another file.
  void check_sensors(const std::vector<ProgramOptions>& runs, const std::vector<std::string>& places) {
    std::map<fs::path, int> counts;
    for (const ProgramOptions& run : runs) ++counts[find_key(find_sensor_file(run.sound))];
    for (std::size_t i = 0; i < runs.size(); ++i) {
      const fs::path file = find_sensor_file(runs[i].sound), key = find_key(file);
      if ((counts[key] > 1 || written_.contains(key)) && has_sensors(runs[i].scene)) add_output(file, places[i]);
    }
  }

 private:
  static fs::path find_key(const fs::path& file) {
    std::error_code error;
    const fs::path key = fs::weakly_canonical(fs::absolute(file), error);
    return error ? file.lexically_normal() : key;
  }
  [[noreturn]] static void fail_twice(const fs::path& file, const std::string& place) {
    throw InputError(fmt::format("{}: {} is written twice; give every file a name of its own", place, file.string()));
  }

  std::map<fs::path, std::string> inputs_, written_;  // what, or where in the manifest
};

}  // namespace

std::vector<ProgramOptions> read_manifest(const fs::path& file) {
  const base::Document document = base::read_document(file, "a manifest lists the scenes to render");
  base::Object root = document.root();
  std::vector<ProgramOptions> runs;
  std::vector<std::string> places;
  Files files;
  files.add_input(file, "the manifest");
  if (root.objects("scenes").empty()) root.fail("scenes", "is missing or empty; list objects with \"scene\" and \"output\"");
  for (base::Object& object : root.objects("scenes")) {
    const ProgramOptions& run = runs.emplace_back(read_run(object));
    places.push_back(object.find_place(""));
    for (const auto& output : {std::optional(run.sound), run.labels, run.record, run.report, run.trajectory, run.spectrogram})
      if (output) files.add_output(*output, object.find_place("output"));
  }
  root.finish();
  for (std::size_t i = 0; i < runs.size(); ++i) {
    files.add_input(runs[i].scene, "the scene of " + places[i]);
    if (runs[i].contacts) files.add_input(*runs[i].contacts, "the contacts file that is played by " + places[i]);
  }
  files.check_inputs();
  files.check_sensors(runs, places);
  return runs;
}

base::KeyTable describe_manifest_keys() {
  base::KeyTable table{"manifest", {}};
  kRun.describe(table);
  return table;
}

int run_batch(const std::vector<ProgramOptions>& runs, int jobs, const std::function<int(const ProgramOptions&)>& work) {
  std::map<pid_t, std::size_t> busy;
  int worst = 0, failed = 0;
  const auto wait_for_one = [&] {
    int status = 0;
    const pid_t ended = waitpid(-1, &status, 0);
    const auto found = busy.find(ended);
    if (found == busy.end()) return;
    const int code = find_code(status, runs[found->second].scene);
    worst = std::max(worst, code);
    failed += static_cast<int>(code != 0);
    busy.erase(found);
  };
  const pid_t parent = getpid();
  for (std::size_t i = 0; i < runs.size(); ++i) {
    while (std::ssize(busy) >= jobs) wait_for_one();
    std::fflush(nullptr);
    const pid_t process = fork();
    if (process == 0) {
      prctl(PR_SET_PDEATHSIG, SIGTERM);  // no run outlives the program
      const int code = getppid() == parent ? work(runs[i]) : kExitSystem;
      std::fflush(nullptr);
      _exit(code);
    }
    if (process < 0) {
      const std::string reason = std::strerror(errno);
      while (!busy.empty()) wait_for_one();
      throw SystemError(fmt::format("cannot start a process: {}; {} of {} scenes were not rendered", reason, runs.size() - i, runs.size()));
    }
    busy.emplace(process, i);
  }
  while (!busy.empty()) wait_for_one();
  if (failed > 0) fmt::print(stderr, "carillon-render: {} of {} scenes failed\n", failed, runs.size());
  return worst;
}

}  // namespace carillon::render
