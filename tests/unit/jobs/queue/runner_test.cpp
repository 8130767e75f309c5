// The queue in memory under random and all short sequences of events. Invariants: ranks and memory within the machine; at most one attempt
// per job; every bank published once; no job lost.
#include "jobs/queue/runner.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <random>
#include <set>

#include "jobs/queue/settle.hpp"
#include "tests/unit/jobs/queue/fake_environment.hpp"
#include "tests/unit/jobs/store/registry/jobs.hpp"

namespace carillon::tests {
namespace {

enum class Event {
  step,         // a runner makes a round
  begin,        // an attempt takes its lock
  done,         // an attempt publishes its bank
  fail,         // an attempt ends with a transient error
  refuse,       // an attempt ends with an error of its input
  save,         // an attempt saves and stops, if asked
  kill,         // an attempt is killed
  kill_runner,  // a runner is killed and replaced
  stop,         // a runner gets SIGTERM
  cancel,       // a user cancels a job
  retry,        // a user retries a job
  wait,         // time passes
  die,          // a runner will be killed between claim and start
  fill,         // the disk will get full between claim and start
  disk,         // the disk gets full, or free again
  starts,       // process starts fail, or work again
};
constexpr int kEvents = 16;

class Scene {
 public:
  Scene(int jobs, int runners) : table_(world_, [this](const store::Id& id) { return world_.has_bank(id); }), display_(false, true, {}) {
    for (int i = 0; i < jobs; ++i) {
      Job job{ids()[i]};
      job.resources.ranks = 1 + i % 3;
      job.resources.memory_gb = 1.5 + i % 2;
      table_.add(job);
    }
    for (int i = 0; i < runners; ++i) add_runner();
  }

  /// `choice` selects the job, attempt or runner. False: not possible now.
  bool act(Event event, unsigned choice) {
    bool has_acted = false;
    try {
      has_acted = try_to_act(event, choice);
    } catch (const DiskFullError&) {  // in a command of the user
    }
    events_ += fmt::format(" {}/{}", static_cast<int>(event), choice % 12);
    check();
    return has_acted;
  }

  /// Without further failures every job must end.
  void finish() {
    SCOPED_TRACE("events (number/choice):" + events_);
    set_disk_full(false);
    world_.refuses_to_start = false;
    world_.at_next_start = {};
    if (runners_.empty()) add_runner();
    for (int round = 0; round < 400 && !is_over(); ++round) {
      for (Process* process : world_.list_alive()) {
        if (!process->has_begun)
          world_.begin(*process);
        else
          world_.finish(*process, process->was_asked ? Cause::stopped : Cause::done);
      }
      for (std::size_t i = 0; i < runners_.size(); ++i) step(*runners_[i]);
      if (std::all_of(runners_.begin(), runners_.end(), [](const auto& runner) { return runner->is_over; })) add_runner();
      world_.wait(30.0);
      check();
    }
    for (const Job& job : table_.rows()) {
      EXPECT_TRUE(job.state == JobState::done || job.state == JobState::failed || job.state == JobState::cancelled) << to_text(job.state);
      // The registry finds the bank of an unknown attempt at its next opening.
      const bool has_bank = world_.has_bank(job.id) && (job.state == JobState::done || unnamed_.count(job.id) == 0);
      EXPECT_EQ(job.state == JobState::done, has_bank) << to_text(job.state);
      EXPECT_EQ(table_.count_ends(job.id), 1 + requeued_[job.id]);
      EXPECT_LE(world_.count_published(job.id), 1);
    }
    EXPECT_TRUE(world_.list_alive().empty());
  }

 private:
  struct OwnRunner {
    std::unique_ptr<FakeLauncher> launcher;
    std::unique_ptr<queue::Runner> runner;
    bool is_over = false;
  };

  static const std::vector<store::Id>& ids() {
    static const std::vector<store::Id> made{make_id(1), make_id(2), make_id(3), make_id(4), make_id(5), make_id(6)};
    return made;
  }

  void add_runner() {
    auto own = std::make_unique<OwnRunner>();
    own->launcher = std::make_unique<FakeLauncher>(world_);
    const auto find_needs = [](const Job& job) {
      queue::JobNeeds needs;
      queue::set_asked(needs, job);
      return needs;
    };
    own->runner = std::make_unique<queue::Runner>(table_, queue::Environment{world_, world_, *own->launcher}, display_, find_needs,
                                                  queue::RunnerOptions{});
    runners_.push_back(std::move(own));
  }

  void step(OwnRunner& own) {
    try {
      own.is_over = own.runner->step();
    } catch (const DiskFullError&) {
      EXPECT_TRUE(world_.is_disk_full);
    } catch (const RunnerDied&) {
      replace(own);
    }
  }

  /// The runner is killed and replaced.
  void replace(const OwnRunner& own) {
    world_.orphan_children(own.launcher->self());
    std::erase_if(runners_, [&](const auto& other) { return other.get() == &own; });
    add_runner();
  }

  void set_disk_full(bool is_full) { world_.is_disk_full = table_.is_disk_full = is_full; }

  bool is_over() { return world_.list_alive().empty() && table_.list({JobState::queued, JobState::waiting, JobState::running}).empty(); }

  Process* pick(unsigned choice, bool has_begun) {
    std::vector<Process*> alive = world_.list_alive();
    std::erase_if(alive, [&](const Process* process) { return process->has_begun != has_begun; });
    return alive.empty() ? nullptr : alive[choice % alive.size()];
  }

  bool end_attempt(unsigned choice, Cause cause) {
    Process* process = pick(choice, true);
    if (process != nullptr) world_.finish(*process, cause);
    return process != nullptr;
  }

  bool try_to_act(Event event, unsigned choice) {
    const std::size_t runner = choice % runners_.size();
    const store::Id& id = table_.rows()[choice % table_.rows().size()].id;
    switch (event) {
      case Event::step:
        step(*runners_[runner]);
        return true;
      case Event::begin:
        if (Process* process = pick(choice, false)) return world_.begin(*process), true;
        return false;
      case Event::done:
        return end_attempt(choice, Cause::done);
      case Event::fail:
        return end_attempt(choice, choice % 2 == 0 ? Cause::crashed : Cause::memory);
      case Event::refuse:
        return end_attempt(choice, Cause::bad_input);
      case Event::save: {
        Process* process = pick(choice, true);
        if (process == nullptr || !process->was_asked) return false;
        return world_.finish(*process, Cause::stopped), true;
      }
      case Event::kill: {
        const std::vector<Process*> alive = world_.list_alive();
        if (!alive.empty()) world_.kill(*alive[choice % alive.size()]);
        return !alive.empty();
      }
      case Event::kill_runner:
        replace(*runners_[runner]);
        return true;
      case Event::die:
        return world_.at_next_start = [] { throw RunnerDied(); }, true;
      case Event::fill:
        return world_.at_next_start = [this] { set_disk_full(true); }, true;
      case Event::stop: {
        runners_[runner]->runner->stop(SIGTERM);
        // It continues until its attempts have ended; a new runner continues the queue.
        if (runners_.size() < 3) add_runner();
        return true;
      }
      case Event::cancel:
        return queue::request_cancel(table_, id).is_done;
      case Event::retry: {
        const JobState before = table_.find(id)->state;
        const bool is_done = before != JobState::done && queue::requeue(table_, id, true).is_done;
        if (is_done && (before == JobState::failed || before == JobState::cancelled)) ++requeued_[id];
        return is_done;
      }
      case Event::wait:
        return world_.wait(choice % 4 == 0 ? 200.0 : 5.0), true;
      case Event::disk:
        return set_disk_full(!world_.is_disk_full), true;
      case Event::starts:
        return world_.refuses_to_start = !world_.refuses_to_start, true;
    }
    return false;
  }

  void check() {
    int ranks = 0;
    double memory_gb = 0.0;
    std::map<store::Id, int> working;
    for (const Process* process : world_.list_alive()) {
      // A full disk followed by a kill of the runner can leave an attempt without a row.
      const Job row = *table_.find(process->job);
      const bool is_named = row.state == JobState::running && row.token == process->token;
      if (!is_named) unnamed_.insert(process->job);
      ranks += is_named ? process->ranks : 0;
      memory_gb += is_named ? process->memory_gb : 0.0;
      working[process->job] += process->has_begun ? 1 : 0;
      EXPECT_LE(working[process->job], 1) << "two attempts work on one job";
    }
    EXPECT_LE(ranks, World::kCores);
    EXPECT_LE(memory_gb, World::kMemoryGb);
    for (const Job& job : table_.rows()) EXPECT_LE(world_.count_published(job.id), 1) << "a bank was published twice";
  }

  World world_;
  MemoryTable table_;
  queue::Display display_;
  std::vector<std::unique_ptr<OwnRunner>> runners_;
  std::map<store::Id, int> requeued_;
  std::set<store::Id> unnamed_;
  std::string events_;
};

TEST(Runner, jobs_without_failures_are_done) {
  for (int jobs = 1; jobs <= 6; ++jobs) Scene(jobs, 1).finish();
}

TEST(Runner, every_job_ends_once_under_random_events) {
  constexpr int kOrders = 3000, kLength = 40;
  for (int seed = 0; seed < kOrders && !testing::Test::HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(static_cast<unsigned>(seed));
    Scene scene(1 + seed % 6, 1 + seed % 2);
    for (int i = 0; i < kLength; ++i) {
      // Half of the events are rounds.
      const Event event = random() % 2 == 0 ? Event::step : static_cast<Event>(random() % kEvents);
      scene.act(event, static_cast<unsigned>(random()));
    }
    scene.finish();
  }
}

TEST(Runner, every_job_ends_once_under_all_short_event_sequences) {
  constexpr int kLength = 4;
  int orders = 1;
  for (int i = 0; i < kLength; ++i) orders *= kEvents - 2;  // without disk and starts
  for (int order = 0; order < orders && !testing::Test::HasFailure(); ++order) {
    SCOPED_TRACE(order);
    Scene scene(1, 1);
    scene.act(Event::step, 0);
    bool is_new = true;
    for (int i = 0, rest = order; i < kLength; ++i, rest /= kEvents - 2) {
      if (!scene.act(static_cast<Event>(rest % (kEvents - 2)), 0)) is_new = false;  // the same as a shorter order
      if (!is_new) break;
    }
    if (is_new) scene.finish();
  }
}

}  // namespace
}  // namespace carillon::tests
