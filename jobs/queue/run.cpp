#include "jobs/queue/run.hpp"

#include <signal.h>

#include <algorithm>
#include <optional>

#include "jobs/queue/attempt/attempt.hpp"
#include "jobs/queue/local.hpp"
#include "jobs/queue/repair.hpp"
#include "jobs/queue/runner.hpp"
#include "jobs/store/identity.hpp"
#include "jobs/store/registry/registry.hpp"

namespace carillon::queue {
namespace {

using registry::Job;

constexpr double kDrawingHosts = 4;  // no memory is reserved for drawing on machines with less than this many times kDrawGb

void block_signals() {
  sigset_t set;
  ::sigemptyset(&set);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP, SIGCHLD}) ::sigaddset(&set, signal);
  ::sigprocmask(SIG_BLOCK, &set, nullptr);
  ::signal(SIGPIPE, SIG_IGN);
}

/// With the name of the submitted job file.
std::vector<std::string> find_warnings(const store::Store& store, const registry::Registry& registry, const Job& job) {
  const std::optional<store::Request> request = find_request(store, registry, job.id);
  return store::read_warnings(store, job.id, request && !request->job_file.empty() ? request->job_file : "the job");
}

}  // namespace

int run(const store::Store& store, const RunOptions& options) {
  Display display(options.json, options.quiet, [&](const store::Id& id) { return store::read_progress(store.work_folder(id)); });
  registry::Registry registry = registry::Registry::open(store, [&](const std::string& line) { display.print_note(line); });
  display.show_warnings_by([&](const Job& job) { return find_warnings(store, registry, job); });
  block_signals();
  const auto find_job_needs = [&](const Job& job) {
    JobNeeds needs = find_needs(store, job);
    if (options.attempt.has_pictures && base::find_host().total_gb > kDrawingHosts * attempt::kDrawGb)
      needs.need.min_gb = std::max(needs.need.min_gb, attempt::kDrawGb);
    return needs;
  };
  LocalEnvironment local(store, options.attempt);
  return Runner(registry, local, display, find_job_needs, options.runner).run();
}

}  // namespace carillon::queue
