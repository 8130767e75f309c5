// carillon-bank: what is in a bank; is it whole and sane; another density, stiffness, size or damping.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/edits.hpp"
#include "runtime/bank/report.hpp"

namespace {

using namespace carillon;

/// Prints every check. InputError when a fault was found, after all lines were printed.
void check(const std::string& file) {
  const bank::Bank bank = bank::read_bank_unchecked(file);
  fmt::print("ok      {:<12} length and SHA-256 agree\n", "seal");
  fmt::print("ok      {:<12} {}, known to this program\n", "version", fmt::join(bank::read_version(file), "."));
  std::size_t faults = 0;
  std::vector<bank::Check> checks = bank::calc_checks(bank);
  checks.push_back(bank::calc_regions_check(bank));
  checks.push_back(bank::calc_provenance_check(bank));
  for (const bank::Check& check : checks) {
    fmt::print("{}", bank::format_check(check));
    faults += check.faults.size();
  }
  std::fflush(stdout);
  if (faults > 0) throw InputError(fmt::format("{}: {} fault{}; compute the bank again", file, faults, faults == 1 ? "" : "s"));
  fmt::print("{}\n{}\n{}: whole and sane\n", bank::describe_completeness(bank), bank::describe_accuracy(bank), file);
}

int run(int argc, char** argv) {
  CLI::App app("Looks at a mode bank, and edits it.");
  app.name("carillon-bank");
  app.require_subcommand(1);
  std::string file;
  bool json = false;
  std::size_t modes = 20;
  CLI::App* info = app.add_subcommand("info", "What is in a bank: frequencies, damping, residuals, counts, provenance");
  info->add_option("BANK", file, "The bank file")->required();
  info->add_flag("--json", json, "Everything but mesh and shapes, as JSON");
  info->add_option("--modes", modes, "Rows of the table of modes")->capture_default_str();
  CLI::App* checking = app.add_subcommand("check", "Is it whole and sane: one line per property; exit code 0 when it is, 2 otherwise");
  checking->add_option("BANK", file, "The bank file")->required();
  bank::Edits edits;
  std::string edited;
  std::vector<double> alphas;
  CLI::App* editing =
      app.add_subcommand("edit", "The bank of the same body with another density, stiffness, size or damping, without a solve");
  editing->add_option("BANK", file, "The bank file")->required();
  editing->add_option("OUT", edited, "The new bank file")->required();
  editing->add_option("--density", edits.density_scale, "Times this much")->capture_default_str();
  editing->add_option("--stiffness", edits.stiffness_scale, "Times this much; Poisson's ratio stays")->capture_default_str();
  editing->add_option("--size", edits.size_scale, "All lengths times this much")->capture_default_str();
  editing->add_option("--alphas", alphas, "Rayleigh damping in place of the bank's law: alpha1 [s] and alpha2 [1/s]")->expected(2);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kExitInput;
  }
  if (*checking) {
    check(file);
  } else if (*editing) {
    if (alphas.size() == 2) edits.alphas = {alphas[0], alphas[1]};
    bank::write_bank(bank::calc_edited(bank::read_bank(file), edits), edited);
  } else {
    const bank::Bank bank = bank::read_bank(file);
    fmt::print("{}", json ? bank::format_info_json(bank, file) : bank::format_info(bank, file, modes));
  }
  if (std::fflush(stdout) != 0) throw SystemError("the output cannot be written");
  return 0;
}

int fail(const char* what, int code) {
  std::fflush(stdout);
  fmt::print(stderr, "carillon-bank: {}\n", what);
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const InputError& error) {
    return fail(error.what(), kExitInput);
  } catch (const SolveError& error) {
    return fail(error.what(), kExitSolve);
  } catch (const std::exception& error) {
    return fail(error.what(), kExitSystem);
  }
}
