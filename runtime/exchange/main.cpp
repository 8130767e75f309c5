// carillon-bank: shows, checks, edits, reduces, packs and converts banks.
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

#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/bank/edits.hpp"
#include "runtime/bank/mounting/heard.hpp"
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
#include "runtime/base/version.hpp"
#include "runtime/base/whole_range.hpp"
#include "runtime/exchange/commands.hpp"
#include "runtime/exchange/compare.hpp"
#include "runtime/material/solids.hpp"
#include "runtime/material/table.hpp"

namespace {

using namespace carillon;

constexpr int kMost = std::numeric_limits<int>::max();
constexpr int kMostCompared = 2000;
constexpr double kWithinCents = 200.0;
const CLI::Validator kCounts(base::whole_range(1, kMost), base::describe_whole_range(1, kMost));

/// Prints all checks, then throws InputError if there was a fault. `original`: source of a packed bank, or empty.
void check(const std::string& file, const std::string& original) {
  const bank::Bank bank = bank::read_bank_unchecked(file);
  if (!original.empty() && !bank.packing) throw InputError(file + ": is not packed; omit --original");
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
  fmt::print("{}\n{}\n{}: valid\n", bank::describe_completeness(bank), bank::describe_accuracy(bank), base::printable(file));
}

/// Options of `carillon-bank edit`.
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
                     "Another material (carillon materials): its density, stiffness and damping; keeps Poisson's ratio");
  editing.add_option("--density", wishes.edits.density_scale, "Factor of the density")->capture_default_str();
  editing.add_option("--stiffness", wishes.edits.stiffness_scale, "Factor of the stiffness; keeps Poisson's ratio")->capture_default_str();
  editing.add_option("--size", wishes.edits.size_scale, "Factor of all lengths")->capture_default_str();
  editing.add_option("--alphas", wishes.alphas, "Rayleigh damping instead of the bank's law: alpha1 [s] and alpha2 [1/s]")->expected(2);
  editing.add_option("--tan-phi", wishes.tan_phi, "Constant loss factor (internal friction) instead of the bank's law");
  editing
      .add_option("--loss", wishes.loss,
                  "Loss factors by frequency instead of the bank's law: HZ:FACTOR, repeated, ascending in frequency; linear in "
                  "log f between them, constant beyond")
      ->option_text("HZ:FACTOR ...");
  editing
      .add_option("--caughey", wishes.caughey, "Power series of lambda = omega^2 instead of the bank's law: POWER:COEFFICIENT, repeated")
      ->option_text("POWER:COEFFICIENT ...");
  CLI::Option* modes =
      editing.add_option("--modes", wishes.reduction.modes, "Number of modes to keep; the bank is then incomplete")->check(kCounts);
  editing
      .add_option("--keep", wishes.keep,
                  "Selection of modes: \"loudest\" for blows all over the body, or \"lowest\" in frequency, which keeps the proof")
      ->check(CLI::IsMember({"loudest", "lowest"}))
      ->capture_default_str()
      ->needs(modes);
  editing
      .add_option("--shape-bits", wishes.reduction.shape_bits, "Bits per shape component; up to 8 the bank stores one byte instead of two")
      ->check(base::whole_range(bank::kMinShapeBits, bank::kMaxShapeBits),
              base::describe_whole_range(bank::kMinShapeBits, bank::kMaxShapeBits))
      ->capture_default_str();
}

/// Parses "100:0.01". Throws InputError that names the option.
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

/// Damping law of the options, if any.
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

/// Other programs rely on the extension: refuse other names.
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

/// Checks the output path. True for standard output.
bool check_output(const std::string& out) {
  const bool is_piped = base::is_standard_output(out);
  if (is_piped)
    base::check_standard_output("bank");
  else
    check_bank_name(out);
  return is_piped;
}

constexpr double kMaxAudibleHz = 20000.0;

/// Applies --material, with another damping if given.
void take_material(const bank::Bank& bank, Wishes& wishes) {
  constexpr double kAudibleCents = 5.0;
  if (wishes.edits.density_scale != 1.0 || wishes.edits.stiffness_scale != 1.0)
    throw InputError("--material sets density and stiffness; omit --density and --stiffness");
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
        "carillon-bank: note: Poisson's ratio stays {:g}, but {} has {:g}: torsional modes are off by {:.0f} cents, others by less; a "
        "job with \"material\": \"{}\" takes its own ratio\n",
        bank.material.poisson_ratio, material.name, material.poisson_ratio, cents, material.name);
}

void add_export(CLI::App& app, exchange::ExportWishes& wishes) {
  app.add_option("BANK", wishes.bank, "Bank file")->required();
  app.add_option("-o,--output", wishes.out, "Output file, .glb, .dsp, .sofa or .uff; -: standard output")->required();
  app.add_option("--format", wishes.format, "glb, faust, sofa or uff; default: by the file name")
      ->check(CLI::IsMember({"glb", "faust", "sofa", "uff"}));
  app.add_option("--modes", wishes.modes, "Number of modes, the most audible ones; default: all (glb), 100 (faust)")->check(kCounts);
  app.add_option("--points", wishes.points,
                 "Strike points (faust) or points of response (uff): X,Y,Z in metres each; faust: or their number (4)")
      ->option_text("X,Y,Z ...");
  app.add_option("--radiation", wishes.radiation, "Radiation model (faust), as \"radiation\" in a scene")
      ->check(CLI::IsMember(radiation::kGainKindNames))
      ->capture_default_str();
  app.add_option("--name", wishes.name, "Name of the body in the file; default: name of the bank's file");
  app.add_option_function<std::string>(
         "--up", [&wishes](const std::string& axis) { wishes.is_z_up = axis == "z"; },
         "Axis of the body that is up in the other program (glb), y or z; default: y")
      ->check(CLI::IsMember({"y", "z"}));
  app.add_option(
         "--strike", wishes.strike,
         "Struck point: of a blow of 1 N s (sofa; default: unit modal velocities), of the force (uff; default: the first of --points)")
      ->option_text("X,Y,Z");
  app.add_flag("--bands", wishes.has_bands, "Third octaves of that blow (sofa) instead of modes");
  app.add_option("--step", wishes.step_deg, "Degrees between receivers (sofa), a divisor of 180; default: 10");
  app.add_option("--distance", wishes.distance_m, "Distance of the receivers (sofa) from the centre of the body [m]; default: 1");
  app.add_option("--quantity", wishes.quantity, "Motion per force (uff): acceleration, velocity or displacement; default: the first")
      ->check(CLI::IsMember({"acceleration", "velocity", "displacement"}));
  app.add_option("--spacing", wishes.spacing_hz, "Hz between the lines (uff), and of the first; default: 1")->check(CLI::Range(1e-4, 1e6));
  app.add_option("--to", wishes.highest_hz, "Highest frequency (uff) [Hz]; default: end of the bank's band")->check(CLI::Range(1e-4, 1e6));
}

void add_import(CLI::App& app, exchange::ImportWishes& wishes) {
  app.add_option("FILE", wishes.file,
                 "GLB or glTF file (.glb, .gltf with its buffers), or modes of CalculiX (.frd), of Nastran (.pch) or in a universal file "
                 "(.unv, .uff)")
      ->required();
  app.add_option("-o,--output", wishes.out, "Output bank; -: standard output. For a whole glTF scene: a folder, a name without extension")
      ->required();
  app.add_option_function<std::string>(
         "--scale-frequencies", [&wishes](const std::string& word) { wishes.scales_frequencies = word == "yes"; },
         "Whether modes of scaled nodes are of the unscaled geometry, so that the scale divides their frequencies; default: by the masses")
      ->check(CLI::IsMember({"yes", "no"}));
  app.add_option("--model", wishes.model, "Index of the modal model in the file, from 0")
      ->check(base::whole_range(0, kMost), base::describe_whole_range(0, kMost));
  app.add_option("--material", wishes.material,
                 "Material name (carillon materials) for a model without one, and for modes of other solvers");
  app.add_option("--mesh", wishes.mesh, "Nastran model (.bdf) of which the .pch file has the modes");
  app.add_option("--unit", wishes.unit,
                 "Units of modes of other solvers, m-kg-s or mm-t-s; default: the former, for bodies of at most 10 m")
      ->check(CLI::IsMember({"m-kg-s", "mm-t-s"}));
  app.add_flag("--plain", wishes.is_plain, "Read only the extension, ignoring the extras of carillon-bank export");
}

void add_silent(CLI::App& app, exchange::SilentWishes& wishes) {
  app.add_option("BODY", wishes.body,
                 "box:X,Y,Z, sphere:RADIUS, cylinder:HEIGHT,RADIUS or capsule:HEIGHT,RADIUS [m], a closed surface (.obj) or a bank")
      ->required();
  app.add_option("-o,--output", wishes.out, "Output bank; -: standard output")->required();
  app.add_option("--material", wishes.material, "Material name (carillon materials); the next four replace its numbers");
  app.add_option("--density", wishes.density_kg_m3, "Density [kg/m3]")->check(CLI::PositiveNumber);
  app.add_option("--mass", wishes.mass_kg, "Mass [kg] instead of the density")->check(CLI::PositiveNumber);
  app.add_option("--young", wishes.young_modulus_pa, "Young's modulus [Pa]; default: concrete")->check(CLI::PositiveNumber);
  app.add_option("--poisson", wishes.poisson_ratio, "Poisson's ratio; default: concrete")->check(CLI::Range(-0.999, 0.499));
}

/// A glTF file goes into a folder: an existing one, or a name without extension.
bool is_scene_import(const exchange::ImportWishes& wishes) {
  const std::string ending = base::find_extension(wishes.file);
  std::error_code error;
  return (ending == ".gltf" || ending == ".glb") && !base::is_standard_output(wishes.out) &&
         (wishes.out.filename().empty() || base::find_extension(wishes.out).empty() || std::filesystem::is_directory(wishes.out, error));
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
  if (is_edited || !is_reduced) bank = bank::calc_edited(bank, e);  // first: the ranking may change
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
               "band      now {:.5g} to {:.5g} Hz, no modes above; for more, compute the job again with a \"band_hz\" up to "
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

/// Options of all commands.
struct Options {
  std::string file, original, packed, unpacked, edited, second, picture;
  bool json = false, csv = false, all = false, keep_numbers = false;
  std::size_t modes = 20, compared_modes = 50;
  std::optional<double> within_cents;
  double error_db = bank::kPackError;
  Wishes wishes;
  exchange::ExportWishes exported;
  exchange::ImportWishes imported;
  exchange::SilentWishes silent;
};

void add_commands(CLI::App& app, Options& options) {
  const auto add = [&](const char* name, const char* description, const char* bank = "Bank file") {
    CLI::App* command = app.add_subcommand(name, description);
    command->add_option("BANK", options.file, bank)->required();
    return command;
  };
  CLI::App* info = add("info", "Shows a bank: frequencies, damping, residuals, counts");
  CLI::Option* as_json = info->add_flag("--json", options.json, "Everything but mesh and shapes, as JSON");
  info->add_flag("--csv", options.csv, "Modes only, as CSV")->excludes(as_json);
  info->add_flag("--all", options.all, "Add the record of the run: versions, seconds, memory, partition, solver");
  info->add_option("--modes", options.modes, "Rows of the mode table")->capture_default_str();
  CLI::App* comparison =
      add("compare",
          "Compares the modes of two banks of a body, or of a bank and measured frequency responses (.uff): pairs, cents, "
          "shapes (MAC), levels",
          "First bank");
  comparison->add_option("SECOND", options.second, "Second bank, or a universal file with dataset 58 (.uff, .unv)")->required();
  comparison->add_option("--modes", options.compared_modes, "Lowest modes of each that are compared")
      ->check(base::whole_range(1, kMostCompared), base::describe_whole_range(1, kMostCompared))
      ->capture_default_str();
  comparison->add_option("--within", options.within_cents, "Largest distance of a peak from its mode [cents]; default: 200")
      ->check(CLI::Range(0.01, 2400.0));
  comparison->add_flag("--json", options.json, "As JSON, with the whole MAC");
  comparison->add_option("--picture", options.picture, "Write the MAC, or the responses, as a picture to this file (.svg)");
  add("check", "Checks a bank, one line per property; exit code 0 if valid, else 2")
      ->add_option("--original", options.original, "Original of a packed bank, to measure its error again");
  CLI::App* pack = add("pack", "Compresses a bank with a stated error, for web pages and games");
  pack->add_option("OUT", options.packed, "Packed bank; -: standard output")->required();
  pack->add_option("--error", options.error_db,
                   "A-weighted error of a hard blow relative to the blow [dB], on 95 % of the surface; from -90 to -10")
      ->check(CLI::Range(bank::kMinPackError, bank::kMaxPackError))
      ->capture_default_str();
  pack->add_flag("--keep-numbers", options.keep_numbers,
                 "Keep the triangle numbers, to which contacts files and strikes of scenes refer; about two bytes per triangle");
  add("unpack", "Unpacks a bank for other programs; its errors stay", "Packed bank")
      ->add_option("OUT", options.unpacked, "Output bank; -: standard output")
      ->required();
  CLI::App* edit = add("edit", "Changes density, stiffness, size, damping, number of modes or precision of shapes without a solve");
  edit->add_option("OUT", options.edited, "Output bank; -: standard output")->required();
  add_options(*edit, options.wishes);
  add_export(
      *app.add_subcommand(
          "export",
          "Exports to GLB (mesh and modes, KHR_audio_rigid_bodies), Faust (the loudest modes at a few points), SOFA (directivity) or UFF "
          "(frequency responses)"),
      options.exported);
  add_import(
      *app.add_subcommand("import",
                          "Imports a GLB or glTF file with KHR_audio_rigid_bodies as a bank, lossless for exported files, or as a scene "
                          "in a folder; or modes of other solvers (.frd, .pch, .unv, .uff)"),
      options.imported);
  add_silent(*app.add_subcommand("silent", "Makes a bank without modes: a body that collides and does not vibrate"), options.silent);
}

void run_compare(const Options& options) {
  if (!options.picture.empty() && base::find_extension(options.picture) != ".svg")
    throw InputError(fmt::format("--picture {}: the picture is SVG; give it a name that ends in .svg", options.picture));
  if (const std::string ending = base::find_extension(options.second); ending == ".uff" || ending == ".unv")
    return exchange::run_measured({.bank = options.file,
                                   .measured = options.second,
                                   .modes = options.compared_modes,
                                   .within_cents = options.within_cents.value_or(kWithinCents),
                                   .picture = options.picture,
                                   .has_json = options.json});
  if (options.within_cents) throw InputError("--within is for measured frequency responses (.uff); leave it out");
  const bank::Bank first = bank::read_bank(options.file), second = bank::read_bank(options.second);
  const exchange::Comparison found = exchange::compare(first, second, options.compared_modes, options.second);
  if (!options.picture.empty())
    base::write_file(options.picture, exchange::format_picture(found, base::printable(options.file), base::printable(options.second)));
  fmt::print("{}", options.json ? exchange::format_json(found, first, second) : exchange::format_table(found, first, second));
}

void show(const Options& options) {
  const bank::Bank bank = bank::read_bank(options.file);
  const std::vector<bank::HeardMode> heard = mounting::calc_heard(bank);
  fmt::print("{}", options.json  ? bank::format_info_json(bank, heard, options.file)
                   : options.csv ? bank::format_info_csv(bank, heard)
                                 : base::printable_lines(bank::format_info(bank, heard, options.file, options.modes, options.all)));
}

int run(int argc, char** argv) {
  CLI::App app("Shows, checks, edits and converts mode banks.");
  app.name("carillon-bank");
  app.failure_message(
      [](const CLI::App* asked, const CLI::Error& error) { return base::printable_lines(CLI::FailureMessage::simple(asked, error)); });
  app.require_subcommand(1);
  app.set_version_flag("--version", base::describe("carillon-bank"));
  Options options;
  add_commands(app, options);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kExitInput;
  }
  const std::string command = app.get_subcommands().front()->get_name();
  if (command == "info") show(options);
  if (command == "compare") run_compare(options);
  if (command == "check") check(options.file, options.original);
  if (command == "pack") pack(options.file, options.packed, options.error_db, options.keep_numbers);
  if (command == "unpack") unpack(options.file, options.unpacked);
  if (command == "edit") edit(options.file, options.edited, options.wishes);
  if (command == "export") exchange::run_export(options.exported);
  if (command == "import") {
    options.imported.is_scene = is_scene_import(options.imported);
    if (!options.imported.is_scene && !base::is_standard_output(options.imported.out)) check_bank_name(options.imported.out);
    exchange::run_import(options.imported);
  }
  if (command == "silent") {
    check_output(options.silent.out.string());
    exchange::run_silent(options.silent);
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
