// Method:     Rows are claimed in one transaction; submissions are recorded in the job folders, then sbatch is called, then the number is
//             written. After a crash in between, the job is found in Slurm by its name, or known to be missing. docs/howto/slurm.md
#include "jobs/queue/slurm/engine.hpp"

#include <fmt/core.h>
#include <time.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <set>
#include <tuple>

#include "jobs/queue/local.hpp"
#include "jobs/queue/settle.hpp"
#include "jobs/queue/slurm/task.hpp"
#include "jobs/store/files.hpp"
#include "jobs/store/outcome/policy.hpp"
#include "jobs/store/process/process.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/failure.hpp"

namespace carillon::slurm {
namespace {

namespace fs = std::filesystem;
using registry::Job;
using registry::JobState;

constexpr double kMemoryGrowth = 1.5;
constexpr double kCancelPatienceS = 5.0;
constexpr std::size_t kMinPacked = 4;  // minimum number of jobs for packing
constexpr double kRunnerGb = 0.1;      // memory of the task runner
constexpr double kTimeMargin = 2.0;    // factor for a predicted time

std::string make_name(const SubmittedJob& submitted, const std::string& number) {
  const std::string name = submitted.task < 0 ? number : fmt::format("{}_{}", number, submitted.task);
  return submitted.place < 0 ? name : fmt::format("{}.{}", name, submitted.place);
}

/// Appends Slurm's output to the log of the job.
void append_output(const fs::path& root, const fs::path& work, const SubmittedJob& submitted) {
  const std::string output = read_output(root, submitted);
  if (output.empty()) return;
  store::append_text(work / store::kLogFile, output + (output.ends_with('\n') ? "" : "\n"));
  std::error_code error;
  fs::remove(make_output_file(root, submitted.batch, std::max(submitted.task, 0)), error);
}

void remove_submitted_job(const store::Store& store, const store::Id& id) {
  if (store.has_work(id)) slurm::remove_submitted_job(store.work_folder(id));
}

/// queue::apply(). After an end for lack of memory, predicted memory is raised; memory requested by the user is not.
void apply(Job& row, const outcome::Outcome& outcome, bool has_asked_memory) {
  if (outcome.cause == outcome::Cause::memory && has_asked_memory && !row.cancel_wanted)
    return queue::end(row, JobState::failed, outcome.reason + "; request more by \"resources\": {\"memory_gb\": ...} in the job");
  const double given_gb = row.given.memory_gb;
  queue::apply(row, outcome, queue::LocalClock());
  if (outcome.cause == outcome::Cause::memory)
    row.resources.memory_gb = std::max(
        {row.resources.memory_gb, kMemoryGrowth * given_gb, outcome::calc_next_memory(outcome.memory_need_gb, outcome.peak_memory_gb)});
}

store::Resources find_asked(const fs::path& work) {
  try {
    const std::optional<store::Request> request = store::read_request(work);
    return request ? request->resources : store::Resources{};
  } catch (const InputError&) {
    return {};
  }
}

bool may_pack(const Needs& needs, const Machine& machine, const queue::SlurmSettings& settings) {
  const int ranks = std::max(1, needs.pack.ranks);
  if (!needs.is_short || ranks > machine.cores || (ranks > 1 && settings.launcher == "srun")) return false;
  return machine.memory_gb <= 0.0 || needs.pack.memory_gb.empty() || needs.pack.memory_gb.back() <= machine.memory_gb;
}

bool has_ready(const registry::Registry& registry) {
  const std::vector<Job> jobs = registry.list({JobState::queued, JobState::waiting});
  return std::any_of(jobs.begin(), jobs.end(),
                     [](const Job& job) { return job.engine == store::JobEngine::slurm && job.slurm_job.empty(); });
}

}  // namespace

Engine::Engine(const store::Store& store, queue::SlurmSettings settings, fs::path program, std::function<void(const std::string&)> say)
    : store_(store), client_(std::move(settings)), program_(std::move(program)), say_(std::move(say)) {
  if (!client_.settings().program.empty()) program_ = client_.settings().program;
}

void Engine::show_unreachable(const Unreachable& error) {
  if (!is_unreachable_shown_) say_(fmt::format("{}; states of jobs are not updated", error.what()));
  is_unreachable_shown_ = true;
}

Batch Engine::make_batch(std::size_t jobs) const {
  Batch batch;
  batch.name = store::make_random_name();
  batch.title = "carillon-" + batch.name.substr(0, 12);
  batch.comment = fmt::format("{} jobs of Carillon", jobs);
  batch.root = store_.root();
  batch.program = program_;
  return batch;
}

std::vector<Job> Engine::hand_over(registry::Registry& registry, const FindNeeds& find_needs) {
  const auto choose = [&](const std::vector<Job>&, const std::vector<Job>& ready) {
    std::vector<Job> chosen;
    for (const Job& job : ready) {
      if (job.slurm_job.empty() && !read_submitted_job(store_.work_folder(job.id))) chosen.emplace_back(job).reason.clear();
    }
    return chosen;
  };
  std::map<std::tuple<int, double, double>, Rows> alike;
  Rows changed, short_jobs;
  std::vector<Needs> short_needs;
  if (!has_ready(registry)) return changed;
  int max_tasks = 1;
  std::optional<Machine> machine;
  try {
    max_tasks = client_.find_max_tasks();
    if (client_.settings().packs) machine = client_.find_machine();
  } catch (const Unreachable& error) {
    show_unreachable(error);
    return changed;
  }
  const auto add_alone = [&](Job job, const Needs& needs) {
    job.given = needs.resources;
    alike[{job.given.ranks, job.given.memory_gb, job.given.time_limit_s}].push_back(std::move(job));
  };
  for (Job& job : registry.claim(store::JobEngine::slurm, process::find_self(), choose, static_cast<std::size_t>(-1))) {
    const Needs needs = find_needs(job);
    if (machine && may_pack(needs, *machine, client_.settings())) {
      short_jobs.push_back(std::move(job));
      short_needs.push_back(needs);
    } else {
      add_alone(std::move(job), needs);
    }
  }
  if (short_jobs.size() >= kMinPacked) {
    submit_packed(registry, *machine, max_tasks, std::move(short_jobs), short_needs, changed);
  } else {
    for (std::size_t i = 0; i < short_jobs.size(); ++i) add_alone(short_jobs[i], short_needs[i]);
  }
  const std::size_t most = max_tasks;
  for (const auto& [needs, jobs] : alike) {
    for (std::size_t at = 0; at < jobs.size(); at += most) {
      const Rows part(jobs.begin() + static_cast<std::ptrdiff_t>(at),
                      jobs.begin() + static_cast<std::ptrdiff_t>(std::min(at + most, jobs.size())));
      Batch batch = make_batch(part.size());
      if (part.size() == 1) {
        batch.title = "carillon-" + part[0].id.short_text();
        batch.comment = part[0].id.text();
      }
      std::tie(batch.ranks, batch.memory_gb, batch.time_limit_s) = needs;
      for (const Job& job : part) batch.folders.push_back(store_.work_folder(job.id).lexically_relative(store_.root() / "work").string());
      submit(registry, batch, part, nullptr, changed);
    }
  }
  return changed;
}

void Engine::submit_packed(registry::Registry& registry, const Machine& machine, int max_tasks, Rows jobs, const std::vector<Needs>& needs,
                           Rows& changed) {
  std::vector<PackJob> shapes;
  for (const Needs& need : needs) shapes.push_back(need.pack);
  const queue::SlurmSettings& settings = client_.settings();
  PackTerms terms;
  terms.longest_s = std::max(1.0, 60.0 * settings.pack_minutes);
  terms.max_tasks = max_tasks;
  terms.max_ranks = settings.launcher == "srun" ? 1 : settings.max_ranks;
  const PackPlan plan = plan_packs(shapes, machine, terms);
  double limit_s = 0.0;
  for (std::size_t i = 0; i < jobs.size(); ++i) limit_s = std::max(limit_s, needs[i].resources.time_limit_s);
  for (const std::vector<Placed>& task : plan.tasks) {
    for (const Placed& placed : task) jobs[placed.job].given = {placed.ranks, placed.memory_gb, needs[placed.job].resources.time_limit_s};
  }
  Batch batch = make_batch(jobs.size());
  batch.tasks = plan.tasks.size();
  batch.ranks = plan.cores;
  if (plan.memory_gb > 0.0) batch.memory_gb = plan.memory_gb + kRunnerGb;
  if (limit_s > 0.0) batch.time_limit_s = limit_s + kTimeMargin * plan.seconds;
  say_(fmt::format(
      "{} jobs of less than {:.0f} minutes on one rank are packed into {} {} of {} {} (predicted: {:.0f} s, {:.0f} % idle); disable by "
      "\"pack\": false in \"slurm\" of the profile",
      jobs.size(), kShortSeconds / 60.0, batch.tasks, batch.tasks == 1 ? "task" : "tasks", plan.cores, plan.cores == 1 ? "core" : "cores",
      plan.seconds, 100.0 * plan.idle_share));
  const Packed packed{plan.tasks, plan.memory_gb};
  submit(registry, batch, jobs, &packed, changed);
}

void Engine::submit(registry::Registry& registry, const Batch& batch, const Rows& jobs, const Packed* packed, Rows& changed) {
  const auto change = [&](const Job& job, const std::function<void(Job&)>& act) { queue::change_running(registry, job, act, &changed); };
  const auto give_up = [&](JobState state, const std::string& reason, double delay_s = 0.0) {
    for (const Job& job : jobs) {
      remove_submitted_job(store_, job.id);
      change(job, [&](Job& row) {
        row.slurm_job.clear();
        row.attempts -= 1;
        if (row.cancel_wanted || state == JobState::failed)
          queue::end(row, row.cancel_wanted ? JobState::cancelled : state, reason);
        else
          queue::wait(row, delay_s, reason, queue::LocalClock());
      });
    }
    remove_batch_folder(batch.root, batch.name);
  };
  std::vector<SubmittedJob> submitted(jobs.size(), SubmittedJob{batch.name, batch.title});
  std::vector<TaskList> lists;
  for (std::size_t i = 0; i < jobs.size() && packed == nullptr && jobs.size() > 1; ++i) submitted[i].task = static_cast<int>(i);
  for (std::size_t task = 0; packed != nullptr && task < packed->tasks.size(); ++task) {
    TaskList& list = lists.emplace_back(TaskList{batch.ranks, packed->memory_gb, {}});
    for (const Placed& placed : packed->tasks[task]) {
      submitted[placed.job].task = static_cast<int>(task);
      submitted[placed.job].place = static_cast<int>(list.jobs.size());
      list.jobs.push_back({jobs[placed.job].id, placed, jobs[placed.job].given.time_limit_s});
    }
  }
  std::string number;
  try {
    const std::string script = make_script(batch, client_.settings());
    std::vector<store::Id> ids;
    for (std::size_t i = 0; i < jobs.size(); ++i) {
      const fs::path work = store_.work_folder(jobs[i].id);
      ids.push_back(jobs[i].id);
      if (jobs[i].failures != read_failures(work)) write_failures(work, jobs[i].failures);
      const std::optional<outcome::Attempt> before = outcome::read_attempt(work);
      if (before) submitted[i].before = before->token;
      write_submitted_job(work, submitted[i]);
    }
    make_batch_folder(store_, batch.name, script, ids, lists);
    number = client_.submit(batch);
  } catch (const Unreachable& error) {
    // Slurm may have accepted the batch: adopt() finds it by its name.
    return show_unreachable(error);
  } catch (const DiskFullError& error) {
    return give_up(JobState::waiting, error.what(), outcome::decide(outcome::Cause::disk_full, 0, false).delay_s);
  } catch (const SystemError& error) {
    return give_up(JobState::failed, error.what());
  } catch (const InputError& error) {
    return give_up(JobState::failed, error.what());
  }
  // Accepted. If writing fails (full disk), adopt() finds it later.
  write_number(batch.root, batch.name, number);
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    change(jobs[i], [&](Job& row) {
      row.state = JobState::queued;
      row.slurm_job = make_name(submitted[i], number);
      row.given = jobs[i].given;
      row.reason = packed == nullptr ? "submitted to Slurm" : "submitted to Slurm, in a task with other jobs";
    });
  }
}

std::vector<Job> Engine::follow(registry::Registry& registry) {
  Rows changed, jobs = registry.list_open(store::JobEngine::slurm);
  try {
    adopt(registry, jobs);
    std::vector<std::string> names;
    for (const Job& job : jobs) {
      if (!job.slurm_job.empty()) names.push_back(job.slurm_job);
    }
    cancel_left(registry);
    end_unwanted(jobs);
    const std::map<std::string, SlurmStatus> all = names.empty() ? std::map<std::string, SlurmStatus>() : client_.list(names);
    std::map<std::string, std::optional<SlurmStatus>> ends;  // by task
    for (const Job& job : jobs) {
      if (job.slurm_job.empty()) continue;
      const std::string task = find_task(job.slurm_job);
      const auto seen = all.find(task);
      if (seen == all.end() || seen->second.phase == SlurmPhase::ended) {
        if (!ends.contains(task)) {
          ends[task] = client_.find_end(task);
          // squeue lists an array that was cancelled while pending by its number only.
          const auto known = seen == all.end() ? all.find(find_array(task)) : seen;
          if (!ends[task] && known != all.end() && known->second.phase == SlurmPhase::ended) ends[task] = known->second;
        }
        settle(registry, job, ends[task], changed);
      } else {
        look_at(registry, job, seen->second, changed);
      }
    }
    clean();
    is_unreachable_shown_ = false;
  } catch (const Unreachable& error) {
    show_unreachable(error);
  }
  return changed;
}

/// Cancels tasks all of whose jobs are unwanted; in other tasks the job's folder is marked as unwanted.
void Engine::end_unwanted(const Rows& jobs) {
  std::set<std::string> needed, unwanted;
  for (const Job& job : jobs) {
    if (!job.slurm_job.empty()) (job.cancel_wanted ? unwanted : needed).insert(find_task(job.slurm_job));
  }
  for (const Job& job : jobs) {
    if (!job.cancel_wanted || !is_packed(job.slurm_job)) continue;
    const fs::path work = store_.work_folder(job.id);
    std::optional<SubmittedJob> submitted = read_submitted_job(work);
    if (!submitted || submitted->is_unwanted) continue;
    submitted->is_unwanted = true;
    write_submitted_job(work, *submitted);
  }
  std::vector<std::string> names;
  std::set_difference(unwanted.begin(), unwanted.end(), needed.begin(), needed.end(), std::back_inserter(names));
  if (!names.empty()) client_.cancel(names);
}

void Engine::adopt(registry::Registry& registry, Rows& jobs) {
  std::map<std::string, std::string> numbers;  // by batch
  for (Job& job : jobs) {
    if (!job.slurm_job.empty()) continue;
    const bool is_claimed = job.state == JobState::running;
    const std::optional<SubmittedJob> submitted = read_submitted_job(store_.work_folder(job.id));
    // After a rebuild of the registry the row names the attempt itself; otherwise the claiming process may be about to submit the job.
    const auto attempt = outcome::read_attempt(store_.work_folder(job.id));
    const bool is_attempt = submitted && attempt && attempt->token == job.token;
    if (is_claimed && !is_attempt && process::find_life(job.worker) != process::Life::gone && !process::is_self(job.worker)) continue;
    std::string number;
    if (submitted) {
      number = numbers.try_emplace(submitted->batch, read_number(store_.root(), submitted->batch)).first->second;
      if (number.empty()) number = numbers[submitted->batch] = client_.find_by_title(submitted->title, submitted->batch).value_or("none");
      if (number != "none") write_number(store_.root(), submitted->batch, number);
    }
    if (!submitted && !is_claimed) continue;  // not submitted yet
    if (submitted && number == "none") remove_submitted_job(store_, job.id);
    registry.update(job.id, [&](Job& row) {
      if (!row.slurm_job.empty() || row.state != job.state || row.token != job.token) return false;
      queue::wait(row, 0.0, "", queue::LocalClock());
      if (submitted && number != "none") row.slurm_job = make_name(*submitted, number);
      job = row;
      return true;
    });
  }
}

/// A job whose task is pending or running.
void Engine::look_at_packed(registry::Registry& registry, const Job& job, const SlurmStatus& seen, Rows& changed) {
  const fs::path work = store_.work_folder(job.id);
  const SubmittedJob submitted = read_submitted_job(work).value_or(SubmittedJob{});
  const PackedState state = find_packed_state(store_, job.id, submitted);
  const bool is_over = state == PackedState::ended || (job.cancel_wanted && state != PackedState::runs);
  if (is_over) return settle_ended(registry, job, submitted, std::nullopt, changed);
  SlurmStatus own = seen;
  if (state != PackedState::runs) own.phase = SlurmPhase::waits;
  // Rows of waiting jobs are not rewritten when their task begins.
  if (own.phase == SlurmPhase::runs || job.state == JobState::running) show_phase(registry, job, own, changed);
}

void Engine::look_at(registry::Registry& registry, const Job& job, const SlurmStatus& seen, Rows& changed) {
  if (is_packed(job.slurm_job)) return look_at_packed(registry, job, seen, changed);
  show_phase(registry, job, seen, changed);
}

void Engine::show_phase(registry::Registry& registry, const Job& job, const SlurmStatus& seen, Rows& changed) {
  const bool is_running = seen.phase == SlurmPhase::runs;
  const JobState state = is_running ? JobState::running : JobState::queued;
  const bool has_reason = !seen.reason.empty() && seen.reason != "None";
  const std::string reason = is_running ? "" : fmt::format("pending in Slurm{}", has_reason ? " (" + seen.reason + ")" : "");
  if (job.state == state && job.reason == reason) return;
  registry.update(job.id, [&](Job& row) {
    if (row.slurm_job != job.slurm_job || !is_open(row.state)) return false;
    if (row.state != state) {
      if (is_running) row.started_unix_s = registry::find_unix_seconds();
      row.state = state;
      changed.push_back(row);
    }
    row.reason = reason;
    return true;
  });
}

void Engine::settle(registry::Registry& registry, const Job& job, const std::optional<SlurmStatus>& seen, Rows& changed) {
  if (seen && seen->phase != SlurmPhase::ended) return look_at(registry, job, *seen, changed);
  const SubmittedJob submitted = read_submitted_job(store_.work_folder(job.id)).value_or(SubmittedJob{});
  settle_ended(registry, job, submitted, seen, changed);
}

void Engine::settle_ended(registry::Registry& registry, const Job& job, const SubmittedJob& submitted,
                          const std::optional<SlurmStatus>& seen, Rows& changed) {
  // Another command may have settled and resubmitted it meanwhile.
  const std::optional<Job> now = registry.find(job.id);
  if (!now || now->slurm_job != job.slurm_job || !is_open(now->state)) return;
  const fs::path work = store_.work_folder(job.id);
  const bool is_shared = is_packed(job.slurm_job);
  const bool is_done = store_.has_bank(job.id);
  SlurmOutcome judgement;
  int failures = 0;
  bool has_asked_memory = false;
  PackedState state = PackedState::runs;
  if (!is_done) {
    judgement = judge(store_, job.id, submitted, seen);
    failures = read_failures(work);
    if (store_.has_work(job.id) && !is_shared) append_output(store_.root(), work, submitted);
    has_asked_memory = find_asked(work).memory_gb > 0.0;
    if (is_shared) state = find_packed_state(store_, job.id, submitted);
    // It ended before its task.
    if (is_shared && state == PackedState::ended) judgement.is_cancelled = false;
  }
  registry.update(job.id, [&](Job& row) {
    if (row.slurm_job != job.slurm_job || !is_open(row.state)) return false;
    remove_submitted_job(store_, job.id);
    row.slurm_job.clear();
    row.attempts += seen && !is_shared ? seen->restarts : 0;
    if (is_done) {
      queue::end(row, JobState::done, "");
    } else if (judgement.is_cancelled || (row.cancel_wanted && state == PackedState::waits)) {
      queue::end(row, JobState::cancelled, row.cancel_wanted ? "cancelled" : "cancelled in Slurm (scancel)");
    } else if (state == PackedState::waits && has_begun(store_.root(), submitted)) {
      // The end of the task is not a failure of a job that had not begun.
      queue::wait(row, 0.0, "its Slurm task ended before it began: " + judgement.outcome.reason, queue::LocalClock());
      row.attempts -= 1;
    } else {
      row.failures = failures;
      apply(row, judgement.outcome, has_asked_memory);
    }
    changed.push_back(row);
    return true;
  });
  if (is_done && store_.has_work(job.id)) store_.remove_work(job.id);
}

void Engine::clean() {
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(store_.root() / "slurm", error)) {
    const std::string batch = entry.path().filename().string();
    const std::vector<store::Id> jobs = read_jobs(store_.root(), batch);
    const bool is_used = std::any_of(jobs.begin(), jobs.end(), [&](const store::Id& id) {
      const std::optional<SubmittedJob> submitted = read_submitted_job(store_.work_folder(id));
      return submitted && submitted->batch == batch;
    });
    if (!is_used) remove_batch_folder(store_.root(), batch);
  }
}

bool Engine::cancel(registry::Registry& registry, const store::Id& id) {
  bool has_slurm = false;
  registry.update(id, [&](Job& row) {
    if (!is_open(row.state)) return false;
    const bool is_with_slurm = !row.slurm_job.empty() || row.state == JobState::running || read_submitted_job(store_.work_folder(id));
    if (!is_with_slurm) {
      queue::cancel_not_started(row);
      return true;
    }
    has_slurm = row.cancel_wanted = true;
    return true;
  });
  if (!has_slurm) return true;
  for (const double start_s = base::get_boot_s();;) {
    follow(registry);
    const std::optional<Job> row = registry.find(id);
    if (!row || !is_open(row->state)) return true;
    if (is_unreachable_shown_ || base::get_boot_s() - start_s > kCancelPatienceS) return false;
    const timespec time{0, 300000000};
    ::nanosleep(&time, nullptr);
  }
}

void Engine::cancel_left(registry::Registry& registry) {
  for (const Job& job : registry.list({JobState::cancelled})) {
    if (job.engine != store::JobEngine::slurm || job.slurm_job.empty()) continue;
    if (!is_packed(job.slurm_job)) client_.cancel({job.slurm_job});
    remove_submitted_job(store_, job.id);
    registry.update(job.id, [&](Job& row) {
      if (row.state != JobState::cancelled || row.slurm_job != job.slurm_job) return false;
      row.slurm_job.clear();
      return true;
    });
  }
}

}  // namespace carillon::slurm
