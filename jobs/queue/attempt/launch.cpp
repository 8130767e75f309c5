// Method:     fork and exec without a shell. One thread per rank; no binding to cores (concurrent runs would share the same cores);
//             keep-alive probes between mpirun's daemons (a lost host is detected in 11 s instead of 8 minutes); temporary files and shared
//             memory in folders of the attempt. A single rank is started without mpirun, which is faster.
// Source:     Open MPI 4.1, mpirun(1), ompi_info --all; Linux prctl(2), proc(5) (oom_score_adj).
#include "jobs/queue/attempt/launch.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <map>

#include "jobs/store/store.hpp"
#include "runtime/base/command.hpp"
#include "runtime/base/descriptor.hpp"
#include "runtime/base/environment.hpp"
#include "runtime/base/file.hpp"

namespace carillon::attempt {
namespace {

namespace fs = std::filesystem;

// Paths of sockets in the temporary folder are limited to about 100 bytes.
constexpr std::size_t kMaxTemporaryPath = 60;

fs::path find_temporary_base() {
  const char* named = std::getenv("TMPDIR");
  std::error_code error;
  if (named != nullptr && named[0] == '/' && std::strlen(named) <= kMaxTemporaryPath && fs::is_directory(named, error) &&
      ::access(named, W_OK | X_OK) == 0)
    return named;
  return "/tmp";
}

std::string make_folder_name(const std::string& token) { return "carillon-" + token.substr(0, 16); }

bool is_token(const std::string& token) { return token.size() == 32 && token.find_first_not_of("0123456789abcdef") == std::string::npos; }

std::vector<std::string> make_environment(const std::string& token, const Scratch* scratch, bool is_alone) {
  std::map<std::string, std::string> values;
  for (const std::string& entry : is_alone ? base::make_lone_environment() : base::make_environment())
    if (const std::size_t equal = entry.find('='); equal != std::string::npos) values[entry.substr(0, equal)] = entry.substr(equal + 1);
  values["CARILLON_ATTEMPT"] = token;
  values["OMP_NUM_THREADS"] = values["OPENBLAS_NUM_THREADS"] = "1";
  values["HWLOC_COMPONENTS"] = "-gl";  // else hwloc queries X servers for GPUs, and Open MPI fails if one exits meanwhile
  values["OMPI_MCA_hwloc_base_binding_policy"] = "none";
  if (::geteuid() == 0) values["OMPI_ALLOW_RUN_AS_ROOT"] = values["OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"] = "1";
  values.try_emplace("OMPI_MCA_oob_tcp_keepalive_time", "5");
  values.try_emplace("OMPI_MCA_oob_tcp_keepalive_intvl", "2");
  values.try_emplace("OMPI_MCA_oob_tcp_keepalive_probes", "3");
  if (scratch != nullptr) {
    values["TMPDIR"] = scratch->temporary();
    if (!scratch->shared_memory().empty()) values["OMPI_MCA_btl_vader_backing_directory"] = scratch->shared_memory();
  }
  std::vector<std::string> environment;
  for (const auto& [name, value] : values) environment.push_back(name + "=" + value);
  return environment;
}

base::Descriptor open_output(const fs::path& file, int mode) {
  base::Descriptor output(::open(file.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | mode, 0666));
  if (output.get() < 0)
    throw SystemError(
        fmt::format("{}: cannot write: {}; check the folder's rights and the space on the disk", file.string(), std::strerror(errno)));
  return output;
}

}  // namespace

Scratch::Scratch(const std::string& token) {
  const auto make = [&](const fs::path& base) {
    fs::path folder = base / make_folder_name(token);
    return ::mkdir(folder.c_str(), 0700) == 0 ? folder : fs::path();
  };
  temporary_ = make(find_temporary_base());
  if (temporary_.empty()) {
    throw SystemError(fmt::format("{}: cannot create a temporary folder: {}; make room there, or set TMPDIR",
                                  find_temporary_base().string(), std::strerror(errno)));
  }
  shared_memory_ = make("/dev/shm");
}

Scratch::~Scratch() {
  std::error_code error;
  for (const fs::path& folder : {temporary_, shared_memory_}) {
    if (!folder.empty()) fs::remove_all(folder, error);
  }
}

void Scratch::remove_left(const std::string& token) {
  if (!is_token(token)) return;
  std::error_code error;
  for (const fs::path& base : {find_temporary_base(), fs::path("/tmp"), fs::path("/dev/shm")})
    fs::remove_all(base / make_folder_name(token), error);
}

bool is_under_slurm() { return std::getenv("SLURM_JOB_ID") != nullptr; }

Launch make_launch(const Options& options, const std::string& token, const Scratch* scratch) {
  Launch launch;
  const fs::path solver = base::require_program(options.is_simulation ? "carillon-simulate" : "carillon-precompute");
  Launcher launcher = options.launcher;
  if (launcher == Launcher::automatic) launcher = options.ranks == 1 ? Launcher::alone : Launcher::mpirun;
  launch.environment = make_environment(token, scratch, launcher == Launcher::alone);
  if (launcher == Launcher::mpirun) {
    launch.arguments = {base::require_program("mpirun"), "-np", std::to_string(options.ranks), "--bind-to", "none", "--oversubscribe"};
    launch.arguments.insert(launch.arguments.end(), options.mpirun_options.begin(), options.mpirun_options.end());
    for (const char* name : {"CARILLON_ATTEMPT", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "HWLOC_COMPONENTS"}) {
      launch.arguments.insert(launch.arguments.end(), {"-x", name});
    }
  } else if (launcher == Launcher::srun) {
    launch.arguments = {base::require_program("srun"), "--mpi=pmix", "--kill-on-bad-exit=1", "-n", std::to_string(options.ranks)};
    launch.arguments.insert(launch.arguments.end(), options.mpirun_options.begin(), options.mpirun_options.end());
  }
  launch.arguments.insert(launch.arguments.end(), {solver, store::kJobFile});
  const auto add = [&](std::initializer_list<const char*> words) {
    launch.arguments.insert(launch.arguments.end(), words.begin(), words.end());
  };
  add({"--result", store::kResultFile});
  if (options.memory_limit_gb > 0.0 && !options.is_simulation)
    launch.arguments.insert(launch.arguments.end(), {"--memory-gb", fmt::format("{}", options.memory_limit_gb)});
  if (options.is_simulation && options.is_prediction) {
    add({"--validate", "--json", "--patience", "1000000", "--checkpoint", store::kCheckpointFile});  // includes the memory of checkpoints
  } else if (options.is_simulation) {
    add({"--checkpoint", store::kCheckpointFile, "--progress", store::kProgressFile});  // its outputs are in the job
  } else if (options.is_prediction) {
    add({"--validate", "--json"});
  } else {
    add({"--bank", store::kBankFile, "--checkpoint", store::kCheckpointFile, "--progress", store::kProgressFile});
  }
  return launch;
}

Launch make_worker_launch(std::size_t title_bytes) {
  constexpr std::size_t kTokenDigits = 32;
  return {{base::require_program("carillon-precompute"), "--worker", std::string(title_bytes, ' ')},
          make_environment(std::string(kTokenDigits, '0'), nullptr, true)};
}

pid_t start(const Launch& launch, const fs::path& folder, const fs::path& log, const fs::path& output,
            const std::function<int(const std::vector<std::string>&)>& solver) {
  const base::Descriptor errors = open_output(log, O_APPEND);
  const base::Descriptor own = output.empty() ? base::Descriptor() : open_output(output, O_TRUNC);
  return base::start({.words = launch.arguments,
                      .environment = launch.environment,
                      .folder = folder,
                      .output = output.empty() ? errors.get() : own.get(),
                      .errors = errors.get(),
                      .group = base::Command::Group::own,
                      .signal_at_end = SIGTERM,
                      .yields_memory = true,  // the kernel kills the solver first
                      .default_signals = true,
                      .function = solver ? std::function<int()>([&] { return solver(launch.arguments); }) : nullptr});
}

}  // namespace carillon::attempt
