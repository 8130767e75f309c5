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
#include <map>
#include <string>

#include "runtime/base/document.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::render {
namespace {

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

}  // namespace

std::vector<ProgramOptions> read_manifest(const std::filesystem::path& file) {
  const base::Document document = base::read_document(file, "a manifest lists the scenes to render");
  base::Object root = document.root();
  std::vector<ProgramOptions> runs;
  std::map<std::filesystem::path, std::string> written;
  if (root.objects("scenes").empty()) root.fail("scenes", "is missing or empty; list objects with \"scene\" and \"output\"");
  for (base::Object& object : root.objects("scenes")) {
    const ProgramOptions run = runs.emplace_back(read_run(object));
    for (const auto& output : {std::optional(run.sound), run.labels, run.record, run.report, run.trajectory, run.spectrogram})
      if (output && !written.emplace(output->lexically_normal(), object.find_place("")).second)
        throw InputError(
            fmt::format("{}: {} is written twice; give every file a name of its own", object.find_place("output"), output->string()));
  }
  root.finish();
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
