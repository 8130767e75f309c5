// Method:     Rows are claimed in one transaction; what is handed over is written to the jobs' folders, then sbatch is called, then the
//             number is written: whoever dies in between leaves enough to find the job in Slurm by its name, or to know that it is not
//             there.
// Source:     docs/howto/slurm.md. Deviations: none.
#include "jobs/slurm/engine.hpp"

#include <fmt/core.h>
#include <time.h>

#include <algorithm>
#include <map>
#include <set>
#include <tuple>

#include "jobs/process/process.hpp"
#include "jobs/queue/settle.hpp"
#include "jobs/store/files.hpp"
#include "jobs/store/open_folder.hpp"

namespace carillon::slurm {
namespace {

namespace fs = std::filesystem;
using registry::Job;
using registry::State;

constexpr double kMemoryGrowth = 1.5;
constexpr double kCancelPatienceS = 5.0;

bool is_open(const Job& job) { return job.state == State::queued || job.state == State::running || job.state == State::waiting; }

std::string make_name(const Handed& handed, const std::string& number) {
  return handed.task < 0 ? number : fmt::format("{}_{}", number, handed.task);
}

void make_queued(Job& row, const std::string& reason) {
  row.state = State::queued;
  row.slurm_job.clear();
  row.reason = reason;
}

/// What Slurm said goes to the end of the job's own log, where people look.
void append_output(const fs::path& root, const fs::path& work, const Handed& handed) {
  const std::string output = read_output(root, handed);
  if (output.empty()) return;
  store::append_text(work / store::kLogFile, output + (output.ends_with('\n') ? "" : "\n"));
  std::error_code error;
  fs::remove(make_output_file(root, handed.batch, std::max(handed.task, 0)), error);
}

void remove_handed(const store::Store& store, const store::Id& id) {
  if (store.has_work(id)) slurm::remove_handed(store.open_work(id).path());
}

/// As queue::apply(). Memory that the user named is not raised behind his back; memory that was predicted is, beyond what was given.
void apply(Job& row, const outcome::Outcome& outcome, bool has_asked_memory) {
  if (outcome.cause == outcome::Cause::memory && has_asked_memory && !row.cancel_wanted) {
    row.state = State::failed;
    row.reason = outcome.reason + "; ask for more by \"resources\": {\"memory_gb\": ...} in the job";
    return;
  }
  const double given_gb = row.given.memory_gb;
  queue::apply(row, outcome);
  if (outcome.cause == outcome::Cause::memory) row.resources.memory_gb = std::max(row.resources.memory_gb, kMemoryGrowth * given_gb);
}

store::Resources find_asked(const fs::path& work) {
  try {
    const std::optional<store::Request> request = store::read_request(work);
    return request ? request->resources : store::Resources{};
  } catch (const InputError&) {
    return {};
  }
}

bool has_ready(const registry::Registry& registry) {
  const std::vector<Job> jobs = registry.list({State::queued, State::waiting});
  return std::any_of(jobs.begin(), jobs.end(), [](const Job& job) { return job.engine == "slurm" && job.slurm_job.empty(); });
}

}  // namespace

Engine::Engine(const store::Store& store, Settings settings, fs::path program, std::function<void(const std::string&)> say)
    : store_(store), site_(std::move(settings)), program_(std::move(program)), say_(std::move(say)) {
  if (!site_.settings().program.empty()) program_ = site_.settings().program;
}

void Engine::tell_unreachable(const Unreachable& error) {
  if (!is_unreachable_told_) say_(fmt::format("{}; the jobs stay as they are until it does", error.what()));
  is_unreachable_told_ = true;
}

std::vector<Job> Engine::hand_over(registry::Registry& registry, const FindNeeds& find_needs) {
  const auto choose = [&](const std::vector<Job>&, const std::vector<Job>& ready) {
    std::vector<Job> chosen;
    for (const Job& job : ready) {
      if (job.slurm_job.empty() && !read_handed(store_.work_folder(job.id))) chosen.emplace_back(job).reason.clear();
    }
    return chosen;
  };
  std::map<std::tuple<int, double, double>, Rows> alike;
  Rows changed;
  if (!has_ready(registry)) return changed;
  std::size_t most = 1;
  try {
    most = static_cast<std::size_t>(site_.find_most_tasks());
  } catch (const Unreachable& error) {
    tell_unreachable(error);
    return changed;
  }
  for (Job& job : registry.claim("slurm", process::find_self(), choose, static_cast<std::size_t>(-1))) {
    job.given = find_needs(job);
    alike[{job.given.ranks, job.given.memory_gb, job.given.time_limit_s}].push_back(job);
  }
  for (const auto& [needs, jobs] : alike) {
    for (std::size_t at = 0; at < jobs.size(); at += most) {
      const Rows part(jobs.begin() + static_cast<std::ptrdiff_t>(at),
                      jobs.begin() + static_cast<std::ptrdiff_t>(std::min(at + most, jobs.size())));
      Batch batch;
      batch.name = store::make_random_name();
      const bool is_single = part.size() == 1;
      batch.title = "carillon-" + (is_single ? part[0].id.short_text() : batch.name.substr(0, 12));
      batch.comment = is_single ? part[0].id.text() : fmt::format("{} jobs of Carillon", part.size());
      batch.root = store_.root();
      batch.program = program_;
      std::tie(batch.ranks, batch.memory_gb, batch.time_limit_s) = needs;
      for (const Job& job : part) batch.folders.push_back(store_.work_folder(job.id).lexically_relative(store_.root() / "work").string());
      submit(registry, batch, part, changed);
    }
  }
  return changed;
}

void Engine::submit(registry::Registry& registry, const Batch& batch, const Rows& jobs, Rows& changed) {
  const auto change = [&](const Job& job, const std::function<void(Job&)>& act) {
    registry.update(job.id, [&](Job& row) {
      if (row.state != State::running || row.token != job.token) return false;
      act(row);
      changed.push_back(row);
      return true;
    });
  };
  const auto give_up = [&](State state, const std::string& reason) {
    for (const Job& job : jobs) {
      remove_handed(store_, job.id);
      change(job, [&](Job& row) {
        make_queued(row, reason);
        row.state = row.cancel_wanted ? State::cancelled : state;
        row.attempts -= 1;
      });
    }
    remove_batch_folder(batch.root, batch.name);
  };
  std::string number;
  try {
    const std::string script = make_script(batch, site_.settings());
    std::vector<store::Id> ids;
    for (std::size_t i = 0; i < jobs.size(); ++i) {
      const store::OpenFolder opened = store_.open_work(jobs[i].id);
      const fs::path work = opened.path();
      ids.push_back(jobs[i].id);
      write_failures(work, jobs[i].failures);
      const std::optional<outcome::Attempt> before = outcome::read_attempt(work);
      write_handed(work, {batch.name, batch.title, jobs.size() > 1 ? static_cast<int>(i) : -1, before ? before->token : ""});
    }
    make_batch_folder(store_, batch.name, script, ids);
    number = site_.submit(batch);
  } catch (const Unreachable& error) {
    // It may have taken the batch and not told: then it is there by its name, and adopt() finds it.
    return tell_unreachable(error);
  } catch (const SystemError& error) {
    return give_up(State::failed, error.what());
  } catch (const InputError& error) {
    return give_up(State::failed, error.what());
  }
  // Slurm has it. Where this cannot be written any more (a full disk) adopt() finds it later, as after a kill.
  write_number(batch.root, batch.name, number);
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    change(jobs[i], [&](Job& row) {
      row.state = State::queued;
      row.slurm_job = jobs.size() > 1 ? fmt::format("{}_{}", number, i) : number;
      row.given = jobs[i].given;
      row.reason = "handed to Slurm";
    });
  }
}

std::vector<Job> Engine::follow(registry::Registry& registry) {
  Rows changed, jobs = registry.list({State::queued, State::running, State::waiting});
  std::erase_if(jobs, [](const Job& job) { return job.engine != "slurm"; });
  try {
    adopt(registry, jobs);
    std::vector<std::string> names, unwanted;
    for (const Job& job : jobs) {
      if (job.slurm_job.empty()) continue;
      names.push_back(job.slurm_job);
      if (job.cancel_wanted) unwanted.push_back(job.slurm_job);
    }
    cancel_left(registry);
    if (!unwanted.empty()) site_.cancel(unwanted);
    const std::map<std::string, Seen> all = names.empty() ? std::map<std::string, Seen>() : site_.list(names);
    for (const Job& job : jobs) {
      if (job.slurm_job.empty()) continue;
      const auto seen = all.find(job.slurm_job);
      if (seen == all.end() || seen->second.phase == Phase::ended)
        settle(registry, job, site_.find_end(job.slurm_job), changed);
      else
        look_at(registry, job, seen->second, changed);
    }
    clean();
    is_unreachable_told_ = false;
  } catch (const Unreachable& error) {
    tell_unreachable(error);
  }
  return changed;
}

void Engine::adopt(registry::Registry& registry, Rows& jobs) {
  std::map<std::string, std::string> numbers;  // by batch
  for (Job& job : jobs) {
    if (!job.slurm_job.empty()) continue;
    const bool is_claimed = job.state == State::running;
    const std::optional<Handed> handed = read_handed(store_.work_folder(job.id));
    // A registry that was made again names the attempt itself, wherever it runs; else whoever claimed the job may be about to hand it over.
    const auto attempt = outcome::read_attempt(store_.work_folder(job.id));
    const bool is_attempt = handed && attempt && attempt->token == job.token;
    if (is_claimed && !is_attempt && process::find_life(job.worker) != process::Life::gone && !process::is_self(job.worker)) continue;
    std::string number;
    if (handed) {
      number = numbers.try_emplace(handed->batch, read_number(store_.root(), handed->batch)).first->second;
      if (number.empty()) number = numbers[handed->batch] = site_.find_by_title(handed->title, handed->batch).value_or("none");
      if (number != "none") write_number(store_.root(), handed->batch, number);
    }
    if (!handed && !is_claimed) continue;  // waits to be handed over
    if (handed && number == "none") remove_handed(store_, job.id);
    registry.update(job.id, [&](Job& row) {
      if (!row.slurm_job.empty() || row.state != job.state || row.token != job.token) return false;
      make_queued(row, "");
      if (handed && number != "none") row.slurm_job = make_name(*handed, number);
      job = row;
      return true;
    });
  }
}

void Engine::look_at(registry::Registry& registry, const Job& job, const Seen& seen, Rows& changed) {
  const bool is_running = seen.phase == Phase::runs;
  const State state = is_running ? State::running : State::queued;
  const bool is_told = !seen.reason.empty() && seen.reason != "None";
  const std::string reason = is_running ? "" : fmt::format("waits in Slurm{}", is_told ? " (" + seen.reason + ")" : "");
  if (job.state == state && job.reason == reason) return;
  registry.update(job.id, [&](Job& row) {
    if (row.slurm_job != job.slurm_job || !is_open(row)) return false;
    if (row.state != state) {
      if (is_running) row.started_unix_s = registry::find_unix_seconds();
      row.state = state;
      changed.push_back(row);
    }
    row.reason = reason;
    return true;
  });
}

void Engine::settle(registry::Registry& registry, const Job& job, const std::optional<Seen>& seen, Rows& changed) {
  if (seen && seen->phase != Phase::ended) return look_at(registry, job, *seen, changed);
  // Another command may have settled it while Slurm was asked, and handed it over again.
  const std::optional<Job> now = registry.find(job.id);
  if (!now || now->slurm_job != job.slurm_job || !is_open(*now)) return;
  const fs::path work = store_.work_folder(job.id);
  const Handed handed = read_handed(work).value_or(Handed{});
  const bool is_done = store_.has_bank(job.id);
  Judgement judgement;
  int failures = 0;
  bool has_asked_memory = false;
  if (!is_done) {
    judgement = judge(store_, job.id, handed, seen);
    failures = read_failures(work);
    if (store_.has_work(job.id)) append_output(store_.root(), store_.open_work(job.id).path(), handed);
    has_asked_memory = find_asked(work).memory_gb > 0.0;
  }
  registry.update(job.id, [&](Job& row) {
    if (row.slurm_job != job.slurm_job || !is_open(row)) return false;
    remove_handed(store_, job.id);
    row.slurm_job.clear();
    row.attempts += seen ? seen->restarts : 0;
    row.ended_unix_s = registry::find_unix_seconds();
    if (is_done) {
      row.state = State::done;
      row.reason.clear();
    } else if (judgement.is_cancelled) {
      row.state = State::cancelled;
      row.reason = row.cancel_wanted ? "cancelled" : "cancelled in Slurm (scancel)";
    } else {
      row.failures = failures;
      apply(row, judgement.outcome, has_asked_memory);
    }
    row.cancel_wanted = false;
    changed.push_back(row);
    return true;
  });
  if (is_done && store_.has_work(job.id)) store_.remove_work(job.id);
}

void Engine::clean() {
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(store_.root() / "slurm", error)) {
    const std::string batch = entry.path().filename().string();
    bool is_used = false;
    for (const store::Id& id : read_jobs(store_.root(), batch)) {
      const std::optional<Handed> handed = read_handed(store_.work_folder(id));
      is_used = is_used || (handed && handed->batch == batch);
    }
    if (!is_used) remove_batch_folder(store_.root(), batch);
  }
}

bool Engine::cancel(registry::Registry& registry, const store::Id& id) {
  bool has_slurm = false;
  registry.update(id, [&](Job& row) {
    if (!is_open(row)) return false;
    const bool is_with_slurm = !row.slurm_job.empty() || row.state == State::running || read_handed(store_.work_folder(id));
    if (!is_with_slurm) {
      queue::cancel_unstarted(row);
      return true;
    }
    has_slurm = row.cancel_wanted = true;
    return true;
  });
  if (!has_slurm) return true;
  for (const double start_s = process::find_boot_seconds();;) {
    follow(registry);
    const std::optional<Job> row = registry.find(id);
    if (!row || !is_open(*row)) return true;
    if (is_unreachable_told_ || process::find_boot_seconds() - start_s > kCancelPatienceS) return false;
    const timespec time{0, 300000000};
    ::nanosleep(&time, nullptr);
  }
}

void Engine::cancel_left(registry::Registry& registry) {
  for (const Job& job : registry.list({State::cancelled})) {
    if (job.engine != "slurm" || job.slurm_job.empty()) continue;
    site_.cancel({job.slurm_job});
    remove_handed(store_, job.id);
    registry.update(job.id, [&](Job& row) {
      if (row.state != State::cancelled || row.slurm_job != job.slurm_job) return false;
      row.slurm_job.clear();
      return true;
    });
  }
}

}  // namespace carillon::slurm
