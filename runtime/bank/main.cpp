// carillon-bank: what is in a bank; is it whole and sane; another density, stiffness, size or damping; fewer modes, coarser shapes.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <optional>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/edits.hpp"
#include "runtime/bank/reduce.hpp"
#include "runtime/bank/report.hpp"
#include "runtime/config/printable.hpp"
#include "runtime/config/solids.hpp"

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
  fmt::print("{}\n{}\n{}: whole and sane\n", bank::describe_completeness(bank), bank::describe_accuracy(bank), config::printable(file));
}

/// What `carillon-bank edit` does to a bank.
struct Wishes {
  bank::Edits edits;
  std::vector<double> alphas;
  bank::Reduction reduction;
  std::string keep = "loudest";
};

void add_options(CLI::App& editing, Wishes& wishes) {
  editing.add_option("--density", wishes.edits.density_scale, "Times this much")->capture_default_str();
  editing.add_option("--stiffness", wishes.edits.stiffness_scale, "Times this much; Poisson's ratio stays")->capture_default_str();
  editing.add_option("--size", wishes.edits.size_scale, "All lengths times this much")->capture_default_str();
  editing.add_option("--alphas", wishes.alphas, "Rayleigh damping in place of the bank's law: alpha1 [s] and alpha2 [1/s]")->expected(2);
  CLI::Option* modes = editing.add_option("--modes", wishes.reduction.modes, "Keep so many modes; the bank is no longer complete")
                           ->check(CLI::PositiveNumber);
  editing
      .add_option("--keep", wishes.keep,
                  "Which: \"loudest\", the most audible ones of blows all over the body, or \"lowest\" in frequency, whose proof stays")
      ->check(CLI::IsMember({"loudest", "lowest"}))
      ->capture_default_str()
      ->needs(modes);
  editing
      .add_option("--shape-bits", wishes.reduction.shape_bits,
                  "Bits of a component of a mode's shape; up to 8 the bank has one byte for it instead of two")
      ->check(CLI::Range(bank::kLeastShapeBits, bank::kMostShapeBits))
      ->capture_default_str();
}

void edit(const std::string& file, const std::string& out, Wishes& wishes) {
  if (wishes.alphas.size() == 2) wishes.edits.alphas = {wishes.alphas[0], wishes.alphas[1]};
  wishes.reduction.keep = wishes.keep == "lowest" ? bank::Keep::kLowest : bank::Keep::kLoudest;
  const bank::Edits& e = wishes.edits;
  const bool is_reduced = wishes.reduction.modes || wishes.reduction.shape_bits < bank::kMostShapeBits;
  const bool is_edited = e.density_scale != 1.0 || e.stiffness_scale != 1.0 || e.size_scale != 1.0 || e.alphas;
  bank::Bank bank = bank::read_bank(file);
  if (is_edited || !is_reduced) bank = bank::calc_edited(bank, e);  // first: what is heard most may change
  if (const auto question = config::ask_about_solid(bank.material.young_modulus_pa, bank.material.density_kg_m3))
    fmt::print(stderr, "carillon-bank: warning: {}\n", config::printable(*question));
  if (is_reduced) bank = bank::calc_reduced(bank, wishes.reduction);
  bank::write_bank(bank, out);
}

int run(int argc, char** argv) {
  CLI::App app("Looks at a mode bank, and edits it.");
  app.name("carillon-bank");
  app.failure_message(
      [](const CLI::App* asked, const CLI::Error& error) { return config::printable_lines(CLI::FailureMessage::simple(asked, error)); });
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
  Wishes wishes;
  std::string edited;
  CLI::App* editing = app.add_subcommand(
      "edit",
      "The bank of the same body with another density, stiffness, size or damping, with fewer modes or coarser shapes, without a solve");
  editing->add_option("BANK", file, "The bank file")->required();
  editing->add_option("OUT", edited, "The new bank file")->required();
  add_options(*editing, wishes);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kExitInput;
  }
  if (*checking) {
    check(file);
  } else if (*editing) {
    edit(file, edited, wishes);
  } else {
    const bank::Bank bank = bank::read_bank(file);
    fmt::print("{}", json ? bank::format_info_json(bank, file) : config::printable_lines(bank::format_info(bank, file, modes)));
  }
  if (std::fflush(stdout) != 0) throw SystemError("the output cannot be written");
  return 0;
}

int fail(const char* what, int code) {
  std::fflush(stdout);
  fmt::print(stderr, "carillon-bank: {}\n", config::printable(what));
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
