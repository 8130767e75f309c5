// The loop of `carillon run` on rows and an Environment: starts jobs, settles ended ones, reports to the display.
#pragma once

#include <functional>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "jobs/queue/admission.hpp"
#include "jobs/queue/display.hpp"
#include "jobs/queue/environment.hpp"
#include "jobs/queue/needs.hpp"

namespace carillon::queue {

struct RunnerOptions {
  bool keep = false;       // wait for more jobs when the queue is empty
  int cores = 0;           // limit; 0: all cores of this process
  double memory_gb = 0.0;  // limit; 0: the memory of the machine
};

/// The state of one `carillon run`. A claimed row is in claimed_ until it is started or given back; its child is in children_ until reaped.
class Runner {
 public:
  /// `find_needs` may read files and run the solver; it is called outside transactions.
  using FindNeeds = std::function<JobNeeds(const registry::Job&)>;
  Runner(registry::JobTable& table, const Environment& at, Display& display, FindNeeds find_needs, RunnerOptions options)
      : table_(table), at_(at), display_(display), calc_needs_(std::move(find_needs)), options_(options) {}

  /// Steps until the queue is empty or, after a signal, all attempts have ended. Exit code: 0, 3 if a job failed or was cancelled, or 128 +
  /// signal.
  int run();
  /// One round; true if nothing is left to do.
  bool step();
  /// On SIGTERM, SIGINT or SIGHUP: attempts save and are requeued; on the second signal they end at once.
  void stop(int signal);

 private:
  int find_exit_code() const;
  void reap_children();
  void show_end(const registry::Job& job);
  void show_adopted(const std::vector<registry::Job>& jobs);
  std::vector<pid_t> list_attempts() const;
  void ask_cancelled(const std::vector<registry::Job>& jobs);
  Host find_room() const;
  Admitted find_admitted(const registry::Job& job) const;
  const JobNeeds& find_needs(const registry::Job& job);
  void start_what_fits();
  std::vector<registry::Job> pick_jobs(const Host& host, double now_s, const std::vector<registry::Job>& running,
                                       const std::vector<registry::Job>& ready, std::vector<std::pair<registry::Job, double>>& never);
  void refuse(const registry::Job& job, double memory_gb, const Host& host);
  void start_claimed();
  void start(const registry::Job& job);
  void name_worker(const registry::Job& job, pid_t pid);
  void give_back(const registry::Job& job);
  bool is_forgotten(const registry::Job& job) const;
  void release_lost(const std::vector<registry::Job>& jobs);

  registry::JobTable& table_;
  const Environment at_;
  Display& display_;
  const FindNeeds calc_needs_;
  const RunnerOptions options_;
  std::map<pid_t, registry::Job> children_;
  std::set<store::Id> worked_;                 // open jobs of this run
  std::map<store::Id, JobNeeds> needs_;        // until the attempt has ended
  std::map<store::Id, double> blocked_since_;  // boot seconds
  std::map<store::Id, double> lost_since_;
  std::map<store::Id, double> asked_s_;
  std::vector<registry::Job> claimed_;  // not started yet
  int stops_ = 0;
  int exit_code_ = 0;
  bool is_first_step_ = true;
  bool is_disk_shown_ = false;
};

}  // namespace carillon::queue
