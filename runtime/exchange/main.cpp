// carillon-bank: what is in a bank; is it whole and sane; another density, stiffness, size or damping; fewer modes, coarser shapes; other
// formats.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/edits.hpp"
#include "runtime/bank/of_material.hpp"
#include "runtime/bank/pack.hpp"
#include "runtime/bank/reduce.hpp"
#include "runtime/bank/report.hpp"
#include "runtime/bank/write.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/file_limit.hpp"
#include "runtime/base/message.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/standard_output.hpp"
#include "runtime/base/whole_range.hpp"
#include "runtime/exchange/commands.hpp"
#include "runtime/material/solids.hpp"
#include "runtime/material/table.hpp"
#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/bank/mounting/heard.hpp"
#include "runtime/base/version.hpp"

namespace {

using namespace carillon;

constexpr int kMost = std::numeric_limits<int>::max();
const CLI::Validator kCounts(base::whole_range(1, kMost), base::describe_whole_range(1, kMost));

/// Prints every check. InputError when a fault was found, after all lines were printed. `original`: the bank that was packed, or empty.
void check(const std::string& file, const std::string& original) {
  const bank::Bank bank = bank::read_bank_unchecked(file);
  if (!original.empty() && !bank.packing) throw InputError(file + ": is not packed; leave --original out");
  std::optional<bank::Check> against;
  if (!original.empty()) {
    const bank::Bank whole = bank::read_bank(original);
    if (whole.packing) throw InputError(original + ": is packed itself; give the bank that was packed");
    try {
      against = bank::check_original(bank, whole);
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: {}", original, error.what()));
    }
  }
  fmt::print("ok      {:<12} length and SHA-256 agree\n", "seal");
  fmt::print("ok      {:<12} {}, known to this program\n", "version", fmt::join(bank::read_version(file), "."));
  std::size_t faults = 0;
  std::vector<bank::Check> checks = bank::calc_checks(bank);
  checks.push_back(bank::calc_regions_check(bank));
  checks.push_back(bank::calc_provenance_check(bank));
  if (against) checks.push_back(*against);
  for (const bank::Check& check : checks) {
    fmt::print("{}", bank::format_check(check));
    faults += check.faults.size();
  }
  std::fflush(stdout);
  if (faults > 0)
    throw InputError(
        fmt::format("{}: {} fault{}; {} the bank again", file, faults, faults == 1 ? "" : "s", bank.packing ? "pack" : "compute"));
  fmt::print("{}\n{}\n{}: whole and sane\n", bank::describe_completeness(bank), bank::describe_accuracy(bank), base::printable(file));
}

/// What `carillon-bank edit` does to a bank.
struct Wishes {
  bank::Edits edits;
  std::string material;
  std::vector<double> alphas;
  std::optional<double> tan_phi;
  std::vector<std::string> loss, caughey;  // "HZ:FACTOR", "POWER:COEFFICIENT"
  bank::Reduction reduction;
  std::string keep = "loudest";
};

void add_options(CLI::App& editing, Wishes& wishes) {
  editing.add_option("--material", wishes.material,
                     "Name of another material (carillon materials): takes its density, stiffness and damping; Poisson's ratio stays");
  editing.add_option("--density", wishes.edits.density_scale, "Factor of the density")->capture_default_str();
  editing.add_option("--stiffness", wishes.edits.stiffness_scale, "Factor of the stiffness; Poisson's ratio stays")->capture_default_str();
  editing.add_option("--size", wishes.edits.size_scale, "Factor of all lengths")->capture_default_str();
  editing.add_option("--alphas", wishes.alphas, "Rayleigh damping in place of the bank's law: alpha1 [s] and alpha2 [1/s]")->expected(2);
  editing.add_option("--tan-phi", wishes.tan_phi,
                     "The same loss factor at all frequencies, in place of the bank's law (internal friction)");
  editing
      .add_option(
          "--loss", wishes.loss,
          "Loss factors by frequency, in place of the bank's law: HZ:FACTOR, as many as there are, ascending in frequency; linear in "
          "log f between them, constant beyond")
      ->option_text("HZ:FACTOR ...");
  editing
      .add_option("--caughey", wishes.caughey,
                  "Damping as a series of powers of lambda = omega^2, in place of the bank's law: POWER:COEFFICIENT, as many as there are")
      ->option_text("POWER:COEFFICIENT ...");
  CLI::Option* modes =
      editing.add_option("--modes", wishes.reduction.modes, "Number of modes to keep; the bank is then no longer complete")->check(kCounts);
  editing
      .add_option(
          "--keep", wishes.keep,
          "Which modes to keep: \"loudest\", the most audible for blows all over the body, or \"lowest\" in frequency, whose proof stays")
      ->check(CLI::IsMember({"loudest", "lowest"}))
      ->capture_default_str()
      ->needs(modes);
  editing
      .add_option("--shape-bits", wishes.reduction.shape_bits,
                  "Bits of a component of a mode's shape; up to 8 the bank has one byte for it instead of two")
      ->check(base::whole_range(bank::kMinShapeBits, bank::kMaxShapeBits),
              base::describe_whole_range(bank::kMinShapeBits, bank::kMaxShapeBits))
      ->capture_default_str();
}

/// The two numbers of "100:0.01". Throws InputError that names the option.
std::pair<double, double> read_pair(const std::string& word, const char* option, const char* form) {
  std::pair<double, double> pair;
  const char* const end = word.data() + word.size();
  const auto first = std::from_chars(word.data(), end, pair.first);
  const bool has_second = first.ec == std::errc() && first.ptr != end && *first.ptr == ':';
  const auto second = has_second ? std::from_chars(first.ptr + 1, end, pair.second) : first;
  if (!has_second || second.ec != std::errc() || second.ptr != end)
    throw InputError(fmt::format("{} {}: give {}, two numbers with a colon between them", option, word, form));
  return pair;
}

/// The damping that is asked for in place of the bank's.
void read_damping(Wishes& wishes) {
  const int laws = !wishes.alphas.empty() + wishes.tan_phi.has_value() + !wishes.loss.empty() + !wishes.caughey.empty();
  if (laws > 1) throw InputError("a body has one damping law; give one of --alphas, --tan-phi, --loss and --caughey");
  if (wishes.alphas.size() == 2) wishes.edits.alphas = {wishes.alphas[0], wishes.alphas[1]};
  const auto begin_law = [&](const char* name) -> bank::Damping& {
    wishes.edits.damping.emplace();
    wishes.edits.damping->law = name;
    return *wishes.edits.damping;
  };
  if (wishes.tan_phi) begin_law("internal_friction").coefficient = {*wishes.tan_phi};
  if (!wishes.loss.empty()) {
    bank::Damping& law = begin_law("loss_table");
    for (const std::string& word : wishes.loss) {
      const auto [freq_hz, factor] = read_pair(word, "--loss", "HZ:FACTOR");
      law.freq_hz.push_back(freq_hz);
      law.loss_factor.push_back(factor);
    }
  }
  if (!wishes.caughey.empty()) {
    bank::Damping& law = begin_law("caughey");
    for (const std::string& word : wishes.caughey) {
      const auto [power, coefficient] = read_pair(word, "--caughey", "POWER:COEFFICIENT");
      law.power.push_back(power);
      law.coefficient.push_back(coefficient);
    }
  }
}

/// Other programs rely on the extension: a name of another kind is refused.
void check_bank_name(const std::filesystem::path& out) {
  constexpr std::array<std::string_view, 6> kExtensions{"", ".hdf", ".h5", ".hdf5", ".vtkhdf", ".bank"};
  const std::string extension = base::find_extension(out);
  const bool is_bank = std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
  const bool is_number =
      extension.size() > 1 && std::all_of(extension.begin() + 1, extension.end(), [](unsigned char c) { return std::isdigit(c); });
  if (!is_bank && !is_number)  // bell.1, bell.2
    throw InputError(
        fmt::format("{}: a bank is an HDF5 file; give it a name that ends in .hdf, .h5, .hdf5, .vtkhdf or .bank, or - for standard output",
                    out.string()));
}

/// Refuses an output that is no place for a bank. True for standard output.
bool check_output(const std::string& out) {
  const bool is_piped = base::is_standard_output(out);
  if (is_piped)
    base::check_standard_output("bank");
  else
    check_bank_name(out);
  return is_piped;
}

constexpr double kMaxAudibleHz = 20000.0;

/// --material, with another damping where one is given too.
void take_material(const bank::Bank& bank, Wishes& wishes) {
  constexpr double kAudibleCents = 5.0;
  if (wishes.edits.density_scale != 1.0 || wishes.edits.stiffness_scale != 1.0)
    throw InputError("--material has a density and a stiffness of its own; leave --density and --stiffness out");
  const material::Material& material = material::MaterialTable::get().require("--material", wishes.material).material;
  const bank::Edits own = bank::make_edits(bank, material);
  wishes.edits.density_scale = own.density_scale;
  wishes.edits.stiffness_scale = own.stiffness_scale;
  if (!wishes.edits.alphas && !wishes.edits.damping) {
    wishes.edits.alphas = own.alphas;
    wishes.edits.damping = own.damping;
  }
  if (const double cents = bank::calc_poisson_cents(bank, material); cents > kAudibleCents)
    fmt::print(
        stderr,
        "carillon-bank: note: Poisson's ratio stays {:g}, but {} has {:g}: modes of torsion are off by {:.0f} cents, others by less; a "
        "job with \"material\": \"{}\" takes its own ratio\n",
        bank.material.poisson_ratio, material.name, material.poisson_ratio, cents, material.name);
}

void add_export(CLI::App& app, exchange::ExportWishes& wishes) {
  app.add_option("BANK", wishes.bank, "The bank file")->required();
  app.add_option("-o,--output", wishes.out, "The file to write, .glb or .dsp; - is standard output")->required();
  app.add_option("--format", wishes.format, "glb or faust; without it by the name of the file")->check(CLI::IsMember({"glb", "faust"}));
  app.add_option("--modes", wishes.modes, "Number of modes, the most audible; without it all (glb), or 100 (faust)")->check(kCounts);
  app.add_option("--points", wishes.points, "Points to strike (faust): X,Y,Z in metres each; or their number (4)")
      ->option_text("X,Y,Z ...");
  app.add_option("--radiation", wishes.radiation, "Radiation model (faust), as \"radiation\" of a scene")
      ->check(CLI::IsMember(radiation::kGainKindNames))
      ->capture_default_str();
  app.add_option("--name", wishes.name, "Name of the body in the file; without it that of the bank's file");
  app.add_option_function<std::string>(
         "--up", [&wishes](const std::string& axis) { wishes.is_z_up = axis == "z"; },
         "The axis of the body that points up in the other program (glb), y or z; without it y")
      ->check(CLI::IsMember({"y", "z"}));
}

void add_import(CLI::App& app, exchange::ImportWishes& wishes) {
  app.add_option("GLB", wishes.glb, "The GLB or glTF file (.glb, .gltf with its buffers)")->required();
  app.add_option("-o,--output", wishes.out, "The bank to write; - is standard output")->required();
  app.add_option("--model", wishes.model, "Number of the modal model in the file, from 0")
      ->check(base::whole_range(0, kMost), base::describe_whole_range(0, kMost));
  app.add_option("--material", wishes.material, "Material of a model without one, by its name (carillon materials)");
  app.add_flag("--plain", wishes.is_plain, "Read the extension alone, without the extras of carillon-bank export");
}

void edit(const std::string& file, const std::string& out, Wishes& wishes) {
  const bool is_piped = check_output(out);
  read_damping(wishes);
  wishes.reduction.keep = wishes.keep == "lowest" ? bank::Keep::kLowest : bank::Keep::kLoudest;
  const bool is_reduced = wishes.reduction.modes || wishes.reduction.shape_bits < bank::kMaxShapeBits;
  bank::Bank bank = bank::read_bank(file);
  if (!wishes.material.empty()) take_material(bank, wishes);
  const bank::Edits& e = wishes.edits;
  const bool is_edited = e.density_scale != 1.0 || e.stiffness_scale != 1.0 || e.size_scale != 1.0 || e.alphas || e.damping;
  const double old_end_hz = bank.band_hz[1];
  const std::string dropped = bank::describe_dropped(bank, e);
  if (is_edited || !is_reduced) bank = bank::calc_edited(bank, e);  // first: what is heard most may change
  if (const auto question = material::ask_about_solid(bank.material.young_modulus_pa, bank.material.density_kg_m3))
    fmt::print(stderr, "carillon-bank: warning: {}\n", base::show_message(*question));
  const std::size_t coupled = bank.quartic.mode_count();
  if (is_reduced) bank = bank::calc_reduced(bank, wishes.reduction);
  if (is_piped)
    base::write_standard_output(bank::make_bank_bytes(bank));
  else
    bank::write_bank(bank, out);
  if (!dropped.empty()) fmt::print(is_piped ? stderr : stdout, "{}\n", dropped);
  if (bank.quartic.mode_count() < coupled)
    fmt::print(is_piped ? stderr : stdout, "nonlinear {} of {} coupled modes are left; \"--keep lowest\" keeps those of the lowest modes\n",
               bank.quartic.mode_count(), coupled);
  if (bank.band_hz[1] < std::min(old_end_hz, kMaxAudibleHz))
    fmt::print(is_piped ? stderr : stdout,
               "band      now {:.5g} to {:.5g} Hz: nothing above is in the bank; for more, compute the job again with a \"band_hz\" up to "
               "{:.5g} Hz and "
               "edit that\n",
               bank.band_hz[0], bank.band_hz[1], kMaxAudibleHz * old_end_hz / bank.band_hz[1]);
}

void pack(const std::string& file, const std::string& out, double error_db, bool keep_numbers) {
  const bool is_piped = check_output(out);
  const bank::Bank bank = bank::read_bank(file);
  if (bank.packing) throw InputError(file + ": is packed already; give the bank that was packed");
  const bank::PackedBank packed = bank::calc_packed(bank, error_db, keep_numbers);
  if (is_piped)
    base::write_standard_output(bank::make_packed_bytes(packed));
  else
    bank::write_packed_bank(packed, out);
  fmt::print(is_piped ? stderr : stdout, "packed    {} bytes of shapes, {} of surface: {}\n", packed.shape.size(),
             packed.surface.size() + packed.order.size(), bank::describe(*packed.bank.packing));
}

void unpack(const std::string& file, const std::string& out) {
  const bool is_piped = check_output(out);
  const bank::Bank bank = bank::read_bank(file);
  if (!bank.packing) throw InputError(file + ": is not packed; use it as it is");
  if (is_piped)
    base::write_standard_output(bank::make_bank_bytes(bank));
  else
    bank::write_bank(bank, out);
}

int run(int argc, char** argv) {
  CLI::App app("Looks at a mode bank, and edits it.");
  app.name("carillon-bank");
  app.failure_message(
      [](const CLI::App* asked, const CLI::Error& error) { return base::printable_lines(CLI::FailureMessage::simple(asked, error)); });
  app.require_subcommand(1);
  app.set_version_flag("--version", base::describe("carillon-bank"));
  std::string file;
  bool json = false, csv = false, all = false;
  std::size_t modes = 20;
  CLI::App* info = app.add_subcommand("info", "Shows a bank: frequencies, damping, residuals, counts");
  info->add_option("BANK", file, "The bank file")->required();
  CLI::Option* as_json = info->add_flag("--json", json, "Everything but mesh and shapes, as JSON");
  info->add_flag("--csv", csv, "The modes alone, one line each, as a table with commas")->excludes(as_json);
  info->add_flag("--all", all, "The record of the run that made it too: versions, seconds, memory, partition, solver");
  info->add_option("--modes", modes, "Rows of the table of modes")->capture_default_str();
  CLI::App* checking =
      app.add_subcommand("check", "Checks a bank, one line per property; exit code 0 if it is whole and sane, 2 otherwise");
  checking->add_option("BANK", file, "The bank file")->required();
  std::string original;
  checking->add_option("--original", original, "The bank that a packed one was made of: its error is measured again");
  double error_db = -60.0;
  std::string packed;
  CLI::App* packing = app.add_subcommand("pack", "Writes a bank with few bytes and a stated error, for pages and games");
  packing->add_option("BANK", file, "The bank file")->required();
  packing->add_option("OUT", packed, "The packed bank; - is standard output")->required();
  packing
      ->add_option("--error", error_db,
                   "Error of a hard blow, A-weighted, against the blow itself [dB], on 95 % of the surface; from -90 to -10")
      ->check(CLI::Range(bank::kMinPackError, bank::kMaxPackError))
      ->capture_default_str();
  bool keep_numbers = false;
  packing->add_flag("--keep-numbers", keep_numbers,
                    "Triangles keep their numbers, to which recorded contacts and strikes of scenes refer; about two bytes a triangle");
  std::string unpacked;
  CLI::App* unpacking = app.add_subcommand("unpack", "Writes a packed bank as one that other programs read; its errors stay");
  unpacking->add_option("BANK", file, "The packed bank")->required();
  unpacking->add_option("OUT", unpacked, "The new bank file; - is standard output")->required();
  Wishes wishes;
  std::string edited;
  CLI::App* editing = app.add_subcommand(
      "edit",
      "The bank of the same body with another density, stiffness, size or damping, with fewer modes or coarser shapes, without a solve");
  editing->add_option("BANK", file, "The bank file")->required();
  editing->add_option("OUT", edited, "The new bank file; - is standard output")->required();
  add_options(*editing, wishes);
  exchange::ExportWishes exported;
  CLI::App* exporting = app.add_subcommand(
      "export",
      "Writes the body for other programs: GLB (mesh and modes, KHR_audio_rigid_bodies) or Faust (the loudest modes at a few points)");
  add_export(*exporting, exported);
  exchange::ImportWishes imported;
  CLI::App* importing =
      app.add_subcommand("import", "Reads a GLB or glTF file with KHR_audio_rigid_bodies as a bank; from a file of export, the same bank");
  add_import(*importing, imported);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kExitInput;
  }
  if (*checking) {
    check(file, original);
  } else if (*packing) {
    pack(file, packed, error_db, keep_numbers);
  } else if (*unpacking) {
    unpack(file, unpacked);
  } else if (*editing) {
    edit(file, edited, wishes);
  } else if (*exporting) {
    exchange::run_export(exported);
  } else if (*importing) {
    if (!base::is_standard_output(imported.out)) check_bank_name(imported.out);
    exchange::run_import(imported);
  } else {
    const bank::Bank bank = bank::read_bank(file);
    const std::vector<bank::HeardMode> heard = mounting::calc_heard(bank);
    fmt::print("{}", json  ? bank::format_info_json(bank, heard, file)
                     : csv ? bank::format_info_csv(bank, heard)
                           : base::printable_lines(bank::format_info(bank, heard, file, modes, all)));
  }
  if (std::fflush(stdout) != 0) throw SystemError("the output cannot be written");
  return 0;
}

int fail(const char* what, int code) {
  std::fflush(stdout);
  fmt::print(stderr, "carillon-bank: {}\n", base::show_message(what));
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  base::report_file_limit();
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
