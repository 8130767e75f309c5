// carillon bank-for: the bank of a body, computed if missing. Started by carillon-render and carillon-live for bodies without a bank.
#include <fmt/core.h>

#include <iostream>

#include "jobs/cli/commands.hpp"
#include "jobs/front/cache/cache.hpp"
#include "precompute/job/job_spec.hpp"
#include "runtime/base/result.hpp"

namespace carillon::cli {
namespace {

job::JobSpec read(const BankForOptions& options) {
  if (options.word != "-") return job::read_job(options.word, job::BankKey::optional);
  const std::string text(std::istreambuf_iterator<char>(std::cin), {});
  return job::parse_job(text, std::filesystem::absolute(options.name.empty() ? "standard input" : options.name), job::BankKey::optional,
                        options.first_line);
}

int make(const Shared& shared, const BankForOptions& options) {
  const std::filesystem::path cache = options.cache.empty() ? cache::find_default_cache() : options.cache;
  const cache::Made made = cache::find_or_make(read(options), read_solver_version(), cache, options.is_quiet || shared.json);
  for (const std::string& warning : made.warnings) fmt::print(stderr, "carillon: warning: {}\n", show_message(warning));
  if (shared.json) {
    base::Json root;
    root.set("bank", to_json(made.bank.string())).set("is_new", made.is_new).set("warnings", to_json(made.warnings));
    print_json(root);
  } else {
    fmt::print("{}\n", made.bank.string());
  }
  if (std::fflush(stdout) != 0) throw SystemError("the output cannot be written");
  return 0;
}

}  // namespace

int run_bank_for(Shared& shared, const BankForOptions& options) {
  if (options.result.empty()) return make(shared, options);
  // The calling program prints the message.
  base::Result result;
  int code = 0;
  try {
    code = make(shared, options);
  } catch (...) {
    result = base::describe_error(std::current_exception(), "out of memory; close other programs");
    code = base::get_exit_code(result.kind);
  }
  base::write_result(options.result, result);
  return code;
}

}  // namespace carillon::cli
