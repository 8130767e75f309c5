#include "jobs/front/explore/recut.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/wait.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <system_error>
#include <utility>

#include "runtime/base/command.hpp"
#include "runtime/base/descriptor.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/json.hpp"

namespace carillon::explore {
namespace {

namespace fs = std::filesystem;

RecutAnswer refuse(int status, const std::string& why) {
  base::Json root = base::Json::object();
  root.set("error", why);
  return {status, root.line() + "\n"};
}

}  // namespace

/// The bank of a name in the folder, where it was made from; empty: none.
fs::path Recut::find_bank(const std::string& name) const {
  std::error_code error;
  const fs::path file = fs::canonical(folder_ / name, error);
  const bool is_inside = !error && std::mismatch(folder_.begin(), folder_.end(), file.begin(), file.end()).first == folder_.end();
  if (!is_inside || file.extension() != ".hdf" || !fs::is_regular_file(file, error)) return {};
  const auto original = originals_.find(file.filename().string());
  const bool is_copy = original != originals_.end() && file.parent_path().filename() == "banks";
  return is_copy && fs::is_regular_file(original->second, error) ? original->second : file;
}

RecutAnswer Recut::begin(const std::string& request) {
  if (advance()) return refuse(409, "another body is being computed; wait for it");
  const std::optional<base::Json> asked = base::Json::parse(request);
  if (!asked || !asked->is_object() || !(*asked)["bank"].is_string() || !(*asked)["cuts"].is_array())
    return refuse(400, "no bank and cuts in the request");
  const fs::path bank = find_bank((*asked)["bank"].as_string());
  if (bank.empty()) return refuse(400, "this folder has no such bank");
  const auto program = base::find_program("carillon-tune");
  if (!program) return refuse(503, "carillon-tune is not installed");
  std::error_code error;
  int number = 1;
  const auto name = [&](const char* ending) { return folder_ / fmt::format("recut-{}{}", number, ending); };
  while (fs::exists(name(""), error) || fs::exists(name(".json"), error)) ++number;
  base::Json cuts = base::Json::object();
  cuts.set("cuts", (*asked)["cuts"]);
  try {
    base::write_file(name(".cuts.json"), cuts.text());
    base::write_file(name(".json"), base::Json::object().set("is_running", true).line());
    const base::Descriptor output(::open(name(".part").c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
    if (output.get() < 0) throw SystemError(fmt::format("{}: {}", name(".part").string(), std::strerror(errno)));
    base::Command command;
    command.words = {program->string(), "tune", bank.string(), "--cuts", name(".cuts.json").string(), "-o", name("").string(), "--json"};
    command.output = output.get();
    command.group = base::Command::Group::own;
    command.signal_at_end = SIGTERM;  // it removes its temporary folders
    child_ = base::start(command);
  } catch (const SystemError& problem) {
    return refuse(500, problem.what());
  }
  result_ = name(".json");
  base::Json root = base::Json::object();
  root.set("result", result_.filename().string()).set("folder", name("").filename().string());
  return {202, root.line() + "\n"};
}

bool Recut::advance() {
  if (child_ == 0) return false;
  int status = 0;
  const pid_t ended = ::waitpid(child_, &status, WNOHANG);
  if (ended == 0 || (ended < 0 && errno == EINTR)) return true;
  child_ = 0;
  fs::path part = result_;
  part.replace_extension(".part");
  std::error_code error;
  if (fs::file_size(part, error) == 0 || error) {
    const std::string why = WIFSIGNALED(status) ? fmt::format("carillon-tune was ended by signal {}", WTERMSIG(status))
                                                : fmt::format("carillon-tune ended with exit code {}", WEXITSTATUS(status));
    try {
      base::write_file(part, refuse(500, why).text);
    } catch (const SystemError&) {  // a full disk: the page waits no longer than the server
    }
  }
  fs::rename(part, result_, error);
  return false;
}

}  // namespace carillon::explore
