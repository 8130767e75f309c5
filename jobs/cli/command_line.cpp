// Command line: all commands with options and help. The only file with CLI11, which is slow to compile.
#include "jobs/cli/command_line.hpp"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "jobs/cli/commands.hpp"
#include "jobs/queue/slurm/task.hpp"
#include "precompute/job/read_body.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/version.hpp"
#include "runtime/base/whole_range.hpp"

namespace carillon::cli {
namespace {

constexpr const char* kAbout =
    "The sound of an object: carillon hear OBJECT --material steel. Many banks: carillon submit JOB.json --run.\n"
    "Banks are stored under the hash of job, mesh and solver version, and never computed twice.";
constexpr const char* kShortFooter = "IDs, exit codes, store and profile: carillon --help";
constexpr const char* kFooter =
    "ID is an id or its beginning, a job file, or a name of carillon status (sweep.txt#21). Exit codes: 0 done, 1 not done yet, 2 bad "
    "input,\n"
    "3 a job failed, 4 system error, 128 + n stopped by signal n. Store: --store, else \"store\" of the profile, else\n"
    "$XDG_DATA_HOME/carillon, else ~/.local/share/carillon. Profile: --profile, else ~/.config/carillon/profile.json,\n"
    "{\"store\": DIR, \"on\": \"local\" or \"slurm\"}.";
constexpr int kMaxRanks = attempt::kMaxRanks;
constexpr double kMaxGb = 1e9;

/// Gigabytes, at least `min`. Rejects NaN, which CLI::Range accepts.
CLI::Validator make_gb_check(double min) {
  return {[min](const std::string& text) {
            double value = 0.0;
            const auto end = std::from_chars(text.data(), text.data() + text.size(), value);
            if (end.ec == std::errc() && end.ptr == text.data() + text.size() && value >= min && value <= kMaxGb) return std::string();
            return fmt::format("{}: give gigabytes, from {} to {}", show(text), min, kMaxGb);
          },
          fmt::format("FLOAT in [{} - {}]", min, kMaxGb)};
}

CLI::Validator make_engine_check() { return CLI::IsMember({"local", "slurm"}); }

void add_resources(CLI::App& command, ResourceOptions& options) {
  command.add_option("--ranks", options.ranks, "MPI ranks of each job; default: chosen from the mesh")
      ->check(base::whole_range(1, kMaxRanks), base::describe_whole_range(1, kMaxRanks));
  command.add_option("--memory-gb", options.memory_gb, "Memory limit of each job, all ranks together; default: predicted")
      ->check(make_gb_check(1e-6));
  command.add_option("--time-limit", options.time_limit,
                     "Time limit of one attempt: seconds, or 15m, 2h; the next attempt resumes from its checkpoint");
  command.add_option("--on", options.engine, "Where jobs run: local (this machine) or slurm")->check(make_engine_check());
}

/// Sets `run` to `work` with the parsed options if `command` is given.
template <class Options>
void set_work(CLI::App& command, Shared& shared, Run& run, const std::shared_ptr<Options>& options, int (*work)(Shared&, const Options&)) {
  command.callback([&shared, &run, options, work] { run = [&shared, options, work] { return work(shared, *options); }; });
}

void add_submit(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<SubmitOptions>();
  CLI::App* command =
      app.add_subcommand("submit",
                         "Submits jobs. JOB.json is a job, a folder stands for its *.json, any other file is a manifest: one "
                         "job file or one job as JSON\n"
                         "per line; \"-\" reads a manifest from standard input. Existing banks are not computed again. All "
                         "jobs are checked before any is submitted.");
  command->add_option("JOB", options->words, "Job files, folders, manifests")->required();
  add_resources(*command, options->resources);
  command->add_flag("--keep-going", options->keep_going, "Submit the valid jobs if some are invalid (exit code 2)");
  command->add_flag("-q,--quiet", options->is_quiet, "Print only warnings and errors");
  command->add_flag("--wait", options->wait, "Wait until they have ended; carillon run or Slurm must run the queue");
  CLI::Option* runs = command->add_flag("--run", options->run, "Run the queue here until they have ended");
  command->add_flag("--pictures", options->has_pictures, "With --run: as carillon run --pictures")->needs(runs);
  set_work(*command, shared, run, options, run_submit);
}

void add_status(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<StatusOptions>();
  CLI::App* command = app.add_subcommand("status", "Shows jobs: state, phase, percent, modes, time left, and why a job failed or waits.");
  command->add_option("ID", options->words, "Ids, job files, folders, manifests, or names in this list; default: all jobs");
  command->add_flag(
      "--watch", options->watch,
      "Follow until they have ended: bars on a terminal, else one JSON object per line and change. Exit code 0: all are done, "
      "3: one failed or was cancelled (without ID also earlier ones)");
  command->add_flag("--all", options->all, "Show every job");
  set_work(*command, shared, run, options, run_status);
}

void add_log(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<LogOptions>();
  CLI::App* command = app.add_subcommand("log", "Prints the solver output of a job, all attempts in order. Exit code 1: no output yet.");
  command->add_option("ID", options->word, "Id (or its beginning), job file, or name of carillon status")->required();
  command->add_flag("-f,--follow", options->follow, "Follow until the job has ended");
  set_work(*command, shared, run, options, run_log);
}

void add_cancel(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<CancelOptions>();
  CLI::App* command = app.add_subcommand("cancel",
                                         "Cancels jobs that are queued, waiting or running; checkpoints are kept for a retry. Exit code 1: "
                                         "one was already done.");
  command->add_option("ID", options->words, "Ids, job files, folders, manifests, or names of carillon status")->required();
  set_work(*command, shared, run, options, run_cancel);
}

void add_retry(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<RetryOptions>();
  CLI::App* command = app.add_subcommand("retry", "Requeues failed and cancelled jobs, from their checkpoints, and waiting jobs at once.");
  command->add_option("ID", options->words, "Ids, job files, folders, manifests, or names of carillon status");
  command->add_flag("--failed", options->all_failed, "All failed jobs");
  add_resources(*command, options->resources);
  set_work(*command, shared, run, options, run_retry);
}

void add_explain(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<ExplainOptions>();
  CLI::App* command =
      app.add_subcommand("explain", "Shows whether a job would run, and which parts changed since its last submission. Changes nothing.");
  command->add_option("JOB", options->word, "Job file, folder, manifest or one of its lines (sweep.txt#21)")->required();
  set_work(*command, shared, run, options, run_explain);
}

void add_run(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<QueueOptions>();
  queue::RunOptions& queue = options->queue;
  CLI::App* command =
      app.add_subcommand("run",
                         "Runs the queue on this machine until it is empty, with as many concurrent jobs as cores and memory "
                         "allow. Several processes may run on one store.\n"
                         "Ctrl-C saves and requeues running jobs; a second one ends them. Exit code 0: all are done, 3: one "
                         "failed or was cancelled. With --json one object per line.");
  command->add_flag("--keep", queue.runner.keep, "Wait for more jobs when the queue is empty");
  command->add_option("--cores", queue.runner.cores, "Use at most this many cores")
      ->check(base::whole_range(1, kMaxRanks), base::describe_whole_range(1, kMaxRanks));
  command->add_option("--memory-gb", queue.runner.memory_gb, "Use at most this much memory")->check(make_gb_check(1e-3));
  command->add_flag("-q,--quiet", queue.quiet, "No output");
  command->add_flag("--pictures", queue.attempt.has_pictures,
                    "Draw the first modes for the report of each bank at once, not at the first carillon report");
  command->add_option("--on", options->engine, "local: the queue of this machine; slurm: submit to Slurm and follow until all have ended")
      ->check(make_engine_check());
  set_work(*command, shared, run, options, run_queue);
}

void add_get(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<GetOptions>();
  CLI::App* command = app.add_subcommand("get",
                                         "Prints the path of each finished bank, or of each file of a simulation, in the store "
                                         "(read-only). Exit code 1: one is not done yet.");
  command->add_option("JOB", options->words, "Job files (current content), folders, manifests, ids or names of carillon status")
      ->required();
  command->add_option(
      "--to", options->to,
      "Copy the bank to this file or folder; several banks, named by their jobs, and the files of a simulation into this folder");
  set_work(*command, shared, run, options, run_get);
}

void add_gc(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<GcOptions>();
  CLI::App* command = app.add_subcommand(
      "gc",
      "Lists unreferenced entries: banks and failed jobs whose job file was removed or changed, unused inputs, and leftovers of killed\n"
      "processes. Removes nothing without --delete, and never open jobs.");
  command->add_flag("--delete", options->is_deleting, "Remove them");
  set_work(*command, shared, run, options, run_gc);
}

/// Dimensions of all shapes, by their names in carillon-mesh.
std::vector<std::string> list_dimensions() {
  std::vector<std::string> names;
  for (const job::ShapeKeys& shape : job::get_shape_keys())
    for (const std::string& name : shape.dimensions)
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  return names;
}

void add_hear(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<HearOptions>();
  hear::Order& hear = options->hear;
  CLI::App* command = app.add_subcommand(
      "hear",
      "Computes the sound of an object: meshes it, computes its modes, strikes it at four points, and writes a WAV, a spectrogram and a "
      "report.\nMissing data (size, solid or wall, material) are assumed, and the assumptions printed.");
  command->add_option("OBJECT", hear.object, "A surface (OBJ, STL, PLY, OFF, glTF, GLB) or a mesh (.msh, .vtu)");
  command->add_option("--shape", hear.shape, "A parametric body instead of a file, with its dimensions: see carillon-mesh --help");
  command->add_option("-o,--output", hear.out, "The folder for all files (default: NAME-sound)");
  command
      ->add_option("--material", hear.materials,
                   "Name of the material (carillon materials); several, separated by commas, give one sound each")
      ->delimiter(',');
  command
      ->add_option("--height", hear.heights_m,
                   "Height of the object in metres (y is up; for a shape: its dimension); several, separated by commas")
      ->delimiter(',');
  command->add_option("--scale", hear.scale, "Metres per unit of the file");
  command->add_flag("--facets", hear.facets,
                    "The facets are planes of the body, not samples of a smooth surface (as in carillon-mesh --facets)");
  command->add_option("--mallet", hear.mallet, "steel, hard-wood, plastic, rubber, hard-felt, soft-felt or yarn")->capture_default_str();
  command->add_option("--accuracy", hear.accuracy_cents, "Refine until every error bar is within this many cents; default: a preview");
  command->add_flag("-q,--quiet", hear.is_quiet, "No progress");
  for (const std::string& name : list_dimensions()) {
    if (name == "height") continue;
    command->add_option_function<double>(
        "--" + name, [options, name](double value) { options->hear.dimensions[name] = value; },
        name == "wall" ? "Thickness of the wall of a surface or shape, in metres" : "A dimension of shapes");
  }
  set_work(*command, shared, run, options, run_hear);
}

void add_explore(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<ExploreOptions>();
  explore::PageOrder& explore = options->explore;
  CLI::App* command = app.add_subcommand(
      "explore",
      "Writes a web page on which bodies can be struck and scraped: a folder for any web server. A scene is also simulated, and the page\n"
      "plays it. With --serve, an existing folder is served unchanged.");
  command
      ->add_option("BANK|SCENE|FOLDER", explore.subjects,
                   "Banks, shown side by side; or one scene file (JSON); or a folder written by this command")
      ->required();
  command->add_option("-o,--output", explore.folder, "The folder (default: NAME-explore)");
  command->add_option("--title", explore.title, "Title of the page (default: the name of the bank or scene)");
  command->add_option("--up", explore.up, "Axis of the meshes of banks that points up: y or z (default)")
      ->transform(CLI::CheckedTransformer(std::map<std::string, explore::Up>{{"y", explore::Up::kY}, {"z", explore::Up::kZ}}))
      ->option_text("AXIS");
  command->add_flag("--whole", explore.keeps_banks,
                    "Copy banks unchanged; default: shapes of 1 MB and more are packed with an error of -60 dB(A)");
  CLI::Option* serves = command->add_flag("--serve", options->is_serving, "Serve it on this machine until Ctrl-C");
  command->add_option("--port", options->port, "With --serve: the port (default: a free one)")
      ->check(base::whole_range(1, 65535), base::describe_whole_range(1, 65535))
      ->needs(serves);
  set_work(*command, shared, run, options, run_explore);
}

void add_bank_for(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<BankForOptions>();
  CLI::App* command = app.add_subcommand(
      "bank-for",
      "Prints the path of the bank of a body, computed if missing. JOB is a job without \"bank\", like a body of a scene.\n"
      "A body without \"nodes\" and \"accuracy_cents\" is a preview. Banks are cached in $XDG_CACHE_HOME/carillon, else "
      "~/.cache/carillon,\nwhich may be removed at any time.");
  command->add_option("JOB", options->word, "Job file; -: standard input")->required();
  command->add_option("--cache", options->cache, "Folder of the cache");
  command->add_option("--name", options->name, "File name of standard input, for messages; paths are relative to its folder");
  command->add_option("--first-line", options->first_line, "Line of that file at which standard input begins")->check(CLI::PositiveNumber);
  command->add_option("--result", options->result, "Write the result to this file (JSON) instead of printing a message");
  command->add_flag("-q,--quiet", options->is_quiet, "No progress");
  set_work(*command, shared, run, options, run_bank_for);
}

void add_mesh2faust(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<Mesh2FaustOptions>();
  CLI::App* command = app.add_subcommand("mesh2faust",
                                         "Computes the modes of a closed surface and writes them as a Faust library, NAME.lib, with the "
                                         "arguments of Faust's program mesh2faust.");
  command->add_option("--infile", options->file, "Surface, an OBJ file in metres")->required();
  command->add_option("--name", options->name, "Name of the model and of its file")->capture_default_str();
  command->add_option("--material", options->material, "E [Pa], nu, rho [kg/m3], and for Rayleigh damping alpha [1/s] and beta [s]")
      ->expected(3, 5)
      ->option_text("E NU RHO [ALPHA BETA]");
  command->add_option("--minmode", options->min_hz, "Lowest frequency of a mode")->capture_default_str();
  command->add_option("--maxmode", options->max_hz, "Highest frequency of a mode")->capture_default_str();
  const auto add_count = [&](const char* name, auto& value, const char* help) {
    return command->add_option(name, value, help)->check(base::whole_range(1, kMaxRanks), base::describe_whole_range(1, kMaxRanks));
  };
  add_count("--nsynthmodes", options->modes, "Number of modes, the lowest of the band")->capture_default_str();
  add_count("--nfemmodes", options->solved, "Accepted and not needed: all modes of the band are found");
  add_count("--lmexpos", options->max_points, "Number of struck vertices, spread over the file; default: all");
  command->add_option("--expos", options->vertices, "Struck vertices, numbered from 0 in the order of the file")->option_text("ID ...");
  command->add_option("--accuracy", options->accuracy_cents, "Refine until every frequency is within so many cents; default: a preview");
  command->add_flag("--freqcontrol", options->has_control, "Give the model its lowest frequency as a parameter");
  command->add_flag("--showfreqs", options->shows_frequencies, "Print the frequencies");
  command->add_flag("--debug", options->is_verbose, "Print the progress");
  set_work(*command, shared, run, options, run_mesh2faust);
}

void add_materials(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<MaterialsOptions>();
  CLI::App* command =
      app.add_subcommand("materials",
                         "Lists the names for \"material\" in jobs and scenes; those of your own file first ($CARILLON_MATERIALS, else\n"
                         "~/.config/carillon/materials.json). With names: all constants and their sources.");
  command->add_option("NAME", options->names, "Show only these, with all constants");
  set_work(*command, shared, run, options, run_materials);
}

void add_verify(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<VerifyOptions>();
  CLI::App* command = app.add_subcommand(
      "verify",
      "Checks every bank, input and folder of work of the store, or of the given jobs, against the published and submitted data.\n"
      "Exit code 3: something is damaged. With --repair, damaged banks are set aside and requeued, and damaged inputs copied again.");
  command->add_option("ID", options->words, "Ids, job files, folders, manifests, or names of carillon status; default: the whole store");
  command->add_flag("--repair", options->repairs, "Repair damaged entries");
  set_work(*command, shared, run, options, run_verify);
}

void add_validate(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<ValidateOptions>();
  CLI::App* command =
      app.add_subcommand("validate",
                         "Checks a job and its mesh without solving, and predicts modes, memory by ranks and time. Exit code "
                         "2: invalid.");
  command->add_option("JOB", options->word, "Job file")->required();
  set_work(*command, shared, run, options, run_validate);
}

/// For the list of commands only.
void add_handed_over(CLI::App& app, Shared&, Run&) {
  for (const HandedOver& one : kHandedOver) app.add_subcommand(std::string(one.command), std::string(one.help));
}

void add_report(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<ReportOptions>();
  CLI::App* command = app.add_subcommand("report",
                                         "Prints the path of a bank's report (HTML): mesh, modes and proof, error bars, time and memory, "
                                         "pictures (drawn by the first call). With -o, writes the report of a job or of any bank into a "
                                         "folder.\nExit code 1: not done yet.");
  command->add_option("JOB|BANK", options->word, "Job file (current content), an id or its beginning, or, with -o, a bank file")
      ->required();
  command->add_option("-o,--output", options->folder, "Write report.html, pictures and the page of carillon explore into this folder");
  command->add_flag("--no-pictures", options->no_pictures, "No pictures of the first modes");
  command->add_flag("--no-page", options->no_page, "With -o: omit the page of carillon explore");
  set_work(*command, shared, run, options, run_report);
}

void add_attempt(CLI::App& app, Run& run) {
  auto options = std::make_shared<AttemptOptions>();
  attempt::Options& attempt = options->attempt;
  CLI::App* command =
      app.add_subcommand("attempt", "One attempt at the job of a folder of work, for carillon run and Slurm scripts")->group("");
  attempt::add_options(*command, attempt);
  command->add_option("--engine", options->engine)->check(make_engine_check());
  command->add_option("--launcher", options->launcher)->check(CLI::IsMember({"alone", "mpirun", "srun"}));
  command->add_option("--grace-s", attempt.grace_s);
  command->add_option("--hang-s", attempt.hang_s);
  command->callback([&run, options] { run = [options] { return run_attempt(*options); }; });
}

void add_task(CLI::App& app, Run& run) {
  auto options = std::make_shared<slurm::TaskOptions>();
  CLI::App* command = app.add_subcommand("task", "One task of a packed array, for Slurm scripts")->group("");
  command->add_option("STORE", options->root)->required();
  command->add_option("BATCH", options->batch)->required();
  command->add_option("TASK", options->task)->required();
  command->add_option("--mpirun-option", options->mpirun_options, "Argument of mpirun; repeatable")->allow_extra_args(false);
  command->add_flag("--pictures", options->has_pictures);
  command->callback([&run, options] { run = [options] { return slurm::run_task(*options); }; });
}

/// InputError for an unknown command, with the nearest one.
void check_command(CLI::App& app, int argc, char** argv) {
  const int at = find_command(argc, argv);
  if (at == argc) return;
  std::vector<std::string> known;
  for (const CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) {
    if (command->get_name() == argv[at]) return;
    if (!command->get_group().empty()) known.push_back(command->get_name());
  }
  const std::string near = base::find_nearest(argv[at], known);
  throw InputError(fmt::format("\"{}\": unknown command{}; carillon --help lists them", show(argv[at]),
                               near.empty() ? "" : ", did you mean \"" + near + "\"?"));
}

}  // namespace

int find_command(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (!word.starts_with('-')) return i;
    if (word == "--store" || word == "--profile")
      ++i;
    else if (word != "--json" && !word.starts_with("--store=") && !word.starts_with("--profile="))
      break;
  }
  return argc;
}

Run parse_command_line(int argc, char** argv, Shared& shared) {
  CLI::App app(kAbout, "carillon");
  app.footer(kShortFooter);  // of the commands
  app.require_subcommand(1);
  app.fallthrough();
  Run run;
  app.add_option("--store", shared.store_option, "Folder of the store, created if necessary");
  app.add_option("--profile", shared.profile_option, "Profile file");
  app.add_flag("--json", shared.json, "One JSON document (from commands that keep running: one object per line)");
  app.set_version_flag("--version", base::describe("carillon"));
  for (const auto add : {add_hear, add_explore, add_materials, add_mesh2faust, add_submit, add_status, add_log, add_cancel, add_retry,
                         add_explain, add_run, add_get, add_gc, add_verify, add_validate, add_handed_over, add_report, add_bank_for})
    add(app, shared, run);
  app.footer(kFooter);
  add_attempt(app, run);
  add_task(app, run);
  check_command(app, argc, argv);
  const bool json = shared.json;
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    shared.json = json;
    if (error.get_exit_code() != 0)
      throw InputError(std::string(error.what()) + "; carillon --help, or --help after a command, lists the options");
    app.exit(error);  // prints the text
    return [] { return 0; };
  }
  return run;
}

}  // namespace carillon::cli
