#include "runtime/exchange/commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <map>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/bank/reduce.hpp"
#include "runtime/bank/write.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/includes.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/standard_output.hpp"
#include "runtime/exchange/faust.hpp"
#include "runtime/exchange/frf.hpp"
#include "runtime/exchange/glb.hpp"
#include "runtime/exchange/gltf_scene.hpp"
#include "runtime/exchange/measured.hpp"
#include "runtime/exchange/silent.hpp"
#include "runtime/exchange/sofa.hpp"
#include "runtime/exchange/solved_model.hpp"
#include "runtime/material/table.hpp"

namespace carillon::exchange {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxResultBytes = 1ULL << 36;

bool has_results(const fs::path& file) {
  const std::string ending = base::find_extension(file);
  return ending == ".frd" || ending == ".unv" || ending == ".uff" || ending == ".pch";
}

bank::Bank import_results(const ImportWishes& wishes, const material::Material* material, std::vector<std::string>& notes) {
  if (material == nullptr)
    throw InputError(
        fmt::format("{}: modes of another solver name no density and no damping; add --material NAME (`carillon materials` lists them)",
                    wishes.file.string()));
  if (wishes.model || wishes.is_plain || wishes.scales_frequencies)
    throw InputError("--model, --plain and --scale-frequencies are for glTF files; leave them out");
  const ResultsReading reading{.material = material,
                               .units = wishes.unit == "mm-t-s" ? ModelUnits::kMillimetre : ModelUnits::kMetre,
                               .are_units_given = !wishes.unit.empty()};
  const std::string name = wishes.file.string(), bytes = base::read_file(wishes.file, "file of results", kMaxResultBytes);
  const std::string ending = base::find_extension(wishes.file);
  if (ending == ".pch") {
    if (wishes.mesh.empty())
      throw InputError(fmt::format("{}: a punch file has modes, but no mesh; add --mesh MODEL.bdf, the model that was solved", name));
    return make_bank(parse_pch(bytes, name, base::read_joined(wishes.mesh, "Nastran file", kMaxResultBytes), wishes.mesh.string()), name,
                     reading, &notes);
  }
  if (!wishes.mesh.empty()) throw InputError(fmt::format("--mesh is for Nastran's .pch files; {} has its own mesh: leave it out", name));
  return make_bank(ending == ".frd" ? parse_frd(bytes, name) : parse_unv(bytes, name), name, reading, &notes);
}

GlbReading make_reading(const ImportWishes& wishes, const material::Material* material) {
  return {.model = wishes.model, .ignores_extras = wishes.is_plain, .material = material, .scales_frequencies = wishes.scales_frequencies};
}

bank::Bank import_glb(const ImportWishes& wishes, const material::Material* material, std::vector<std::string>& notes) {
  if (!wishes.unit.empty()) throw InputError("--unit is for modes of other solvers; glTF is in metres");
  if (!wishes.mesh.empty()) throw InputError("--mesh is for Nastran's .pch files; leave it out");
  const GlbReading reading = make_reading(wishes, material);
  return parse_glb(base::read_file(wishes.file, "GLB or glTF file", kMaxGlbBytes), wishes.file.string(), reading, &notes);
}

std::string find_format(const ExportWishes& wishes) {
  if (!wishes.format.empty()) return wishes.format;
  const std::string ending = base::find_extension(wishes.out);
  if (ending == ".glb") return "glb";
  if (ending == ".dsp") return "faust";
  if (ending == ".sofa") return "sofa";
  if (ending == ".uff" || ending == ".unv") return "uff";
  throw InputError(fmt::format(
      "{}: GLB files end in .glb, Faust programs in .dsp, SOFA files in .sofa, frequency responses in .uff; rename the output, or give "
      "--format",
      wishes.out.string()));
}

/// "0.01,0,0.05"
Vec3 read_point(const char* option, const std::string& word) {
  Vec3 point{};
  const char* at = word.data();
  const char* const end = at + word.size();
  for (std::size_t c = 0; c < 3; ++c) {
    const auto read = std::from_chars(at, end, point[c]);
    const bool is_last = c == 2;
    if (read.ec != std::errc() || !std::isfinite(point[c]) || (is_last ? read.ptr != end : read.ptr == end || *read.ptr != ','))
      throw InputError(fmt::format("{} {}: give X,Y,Z in metres{}", option, word,
                                   std::string_view(option) == "--points" ? ", or a number of points" : ""));
    at = read.ptr + 1;
  }
  return point;
}

void read_points(const std::vector<std::string>& words, FaustOptions& options) {
  std::size_t count = 0;
  if (words.size() == 1) {
    const auto read = std::from_chars(words[0].data(), words[0].data() + words[0].size(), count);
    if (read.ec == std::errc() && read.ptr == words[0].data() + words[0].size()) {
      if (count < 1 || count > kMaxFaustPoints) throw InputError(fmt::format("--points {}: give 1 to {}", words[0], kMaxFaustPoints));
      options.point_count = count;
      return;
    }
  }
  for (const std::string& word : words) options.points_m.push_back(read_point("--points", word));
}

/// Writes a file atomically, or standard output; then messages go to standard error.
template <class Fill>
void write_output(const fs::path& out, const char* what, const Fill& fill) {
  if (base::is_standard_output(out)) {
    base::check_standard_output(what);
    fill([](std::string_view bytes) { base::write_standard_output(bytes); });
    return;
  }
  base::check_writable(out, what);
  base::WholeFile file(out);
  fill([&](std::string_view bytes) { file.append(bytes); });
  file.commit();
}

void check_other(const fs::path& in, const fs::path& out) {
  std::error_code error;
  if (fs::equivalent(in, out, error)) throw InputError(fmt::format("{}: this would overwrite the input; name another file", out.string()));
}

/// Throws InputError for options that are given and belong to other formats.
void check_options(const ExportWishes& wishes, const std::string& format) {
  const std::map<std::string, std::string> names{{"glb", "GLB"}, {"faust", "Faust"}, {"sofa", "SOFA"}, {"uff", "UFF"}};
  const struct {
    bool is_given;
    const char* option;
    std::vector<std::string> formats;
  } options[] = {{wishes.modes.has_value(), "--modes", {"GLB", "Faust"}}, {!wishes.points.empty(), "--points", {"Faust", "UFF"}},
                 {wishes.radiation != "auto", "--radiation", {"Faust"}},  {wishes.is_z_up, "--up", {"GLB"}},
                 {!wishes.strike.empty(), "--strike", {"SOFA", "UFF"}},   {wishes.has_bands, "--bands", {"SOFA"}},
                 {wishes.step_deg.has_value(), "--step", {"SOFA"}},       {wishes.distance_m.has_value(), "--distance", {"SOFA"}},
                 {!wishes.quantity.empty(), "--quantity", {"UFF"}},       {wishes.spacing_hz.has_value(), "--spacing", {"UFF"}},
                 {wishes.highest_hz.has_value(), "--to", {"UFF"}}};
  const std::string& name = names.at(format);
  for (const auto& one : options)
    if (one.is_given && std::find(one.formats.begin(), one.formats.end(), name) == one.formats.end())
      throw InputError(fmt::format("{} is for {}, and the output is {}; leave it out", one.option, fmt::join(one.formats, " and "), name));
}

void export_sofa(const bank::Bank& bank, const ExportWishes& wishes, const std::string& name, std::FILE* notes) {
  SofaOptions options{.name = name, .has_bands = wishes.has_bands};
  if (wishes.step_deg) options.step_deg = *wishes.step_deg;
  if (wishes.distance_m) options.distance_m = *wishes.distance_m;
  if (!wishes.strike.empty()) options.strike_m = read_point("--strike", wishes.strike);
  SofaFile file;
  try {
    file = make_sofa(bank, options);
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: {}", wishes.bank.string(), error.what()));
  }
  write_output(wishes.out, "SOFA file", [&](const auto& sink) { sink(file.bytes); });
  fmt::print(notes, "sofa      {} {} at {} receivers, {:g} m away, {:.3g} MB\n", file.frequencies,
             wishes.has_bands ? "third octaves" : "modes", file.receivers, options.distance_m,
             1e-6 * static_cast<double>(file.bytes.size()));
}

/// Functions of every point along x, y and z, per force at the struck point along the axis nearest to its inward normal.
FrfSet make_frfs(const bank::Bank& bank, const ExportWishes& wishes) {
  constexpr std::size_t kMostValues = 20'000'000;
  if (wishes.strike.empty() && wishes.points.empty())
    throw InputError("frequency responses need a struck point and points of response: --strike X,Y,Z --points X,Y,Z ...");
  const bank::Bank played = bank::calc_corrected(bank);
  std::vector<StruckPoint> points;
  for (const std::string& word : wishes.points) points.push_back(find_struck_point(played, read_point("--points", word)));
  StruckPoint struck = wishes.strike.empty() ? points.front() : find_struck_point(played, read_point("--strike", wishes.strike));
  if (points.empty()) points.push_back(struck);
  FrfSet set;
  for (std::size_t p = 0; p < points.size(); ++p) set.nodes_m[static_cast<std::int64_t>(p + 1)] = points[p].point_m;
  const auto same = std::find_if(points.begin(), points.end(), [&](const StruckPoint& point) { return point.point_m == struck.point_m; });
  const auto reference = static_cast<std::int64_t>(same - points.begin() + 1);
  set.nodes_m[reference] = struck.point_m;
  const Motion motion = wishes.quantity == "displacement" ? Motion::kDisplacement
                        : wishes.quantity == "velocity"   ? Motion::kVelocity
                                                          : Motion::kAcceleration;
  const double step = std::stod(fmt::format("{:.5e}", wishes.spacing_hz.value_or(1.0)));  // six digits, as written
  const double count = std::floor(wishes.highest_hz.value_or(bank.band_hz[1]) / step * (1.0 + 1e-12));
  if (!(count >= 1.0))
    throw InputError(fmt::format("--spacing {:g}: there is no line below the end of the band; give a smaller one", step));
  if (count * 3.0 * static_cast<double>(points.size()) > static_cast<double>(kMostValues))
    throw InputError(fmt::format("{:.0f} lines of {} functions are more than {} values; give a larger --spacing or a lower --to", count,
                                 3 * points.size(), kMostValues));
  std::vector<double> freq_hz;
  for (std::size_t i = 1; i <= static_cast<std::size_t>(count); ++i) freq_hz.push_back(step * static_cast<double>(i));
  const int struck_direction = find_direction(struck.inward);
  for (std::size_t p = 0; p < points.size(); ++p)
    for (int direction = 1; direction <= 3; ++direction)
      set.frfs.push_back(
          {.response_node = static_cast<std::int64_t>(p + 1),
           .reference_node = reference,
           .response_direction = direction,
           .reference_direction = struck_direction,
           .motion = motion,
           .freq_hz = freq_hz,
           .value = calc_frf(played, points[p], find_axis(direction), struck, find_axis(struck_direction), motion, freq_hz)});
  return set;
}

void export_frfs(const bank::Bank& bank, const ExportWishes& wishes, const std::string& name, std::FILE* notes) {
  FrfSet set;
  try {
    set = make_frfs(bank, wishes);
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: {}", wishes.bank.string(), error.what()));
  }
  write_output(wishes.out, "universal file", [&](const auto& sink) { sink(format_frfs(set, name)); });
  const Frf& first = set.frfs.front();
  constexpr std::array<const char*, 7> kAxes{"-z", "-y", "-x", "", "x", "y", "z"};
  fmt::print(notes, "uff       {} functions of {} lines, {:g} to {:g} Hz; force at node {} along {}{}\n", set.frfs.size(),
             first.freq_hz.size(), first.freq_hz.front(), first.freq_hz.back(), first.reference_node,
             kAxes[static_cast<std::size_t>(first.reference_direction + 3)], bank.counts.rigid_modes == 6 ? "; with the rigid body" : "");
  for (const auto& [node, x] : set.nodes_m) fmt::print(notes, "node {:<5}{:.5g}, {:.5g}, {:.5g} m\n", node, x[0], x[1], x[2]);
}

void import_scene(const ImportWishes& wishes, const material::Material* material) {
  if (!wishes.unit.empty()) throw InputError("--unit is for modes of other solvers; glTF is in metres");
  if (wishes.model) throw InputError("--model chooses one model for a bank, and -o names a folder for the whole scene; leave one out");
  base::WholeFolder folder(base::find_replaceable(
      wishes.out, [](const fs::path& entry) { return entry.filename() == kSceneFile || base::find_extension(entry) == ".hdf"; },
      "the folder of a scene"));
  const GltfScene made = write_gltf_scene(wishes.file, make_reading(wishes, material), folder.path());
  for (const std::string& warning : made.warnings)
    fmt::print(stderr, "carillon-bank: warning: {}: {}\n", base::printable(wishes.file.string()), warning);
  folder.commit();
  for (const std::string& reading : made.readings) fmt::print("{}\n", reading);
  fmt::print("scene     {} bodies, {} banks: {}\n", made.bodies, made.banks, base::printable((wishes.out / kSceneFile).string()));
}

/// Numbers of "box:1,2,3" after its name; empty: another shape.
std::vector<double> read_sizes(const std::string& word, std::string_view shape, std::size_t count) {
  if (!word.starts_with(shape) || word.size() <= shape.size() || word[shape.size()] != ':') return {};
  std::vector<double> sizes(count);
  const char* at = word.data() + shape.size() + 1;
  const char* const end = word.data() + word.size();
  for (std::size_t k = 0; k < count; ++k) {
    const auto read = std::from_chars(at, end, sizes[k]);
    const bool is_last = k + 1 == count;
    if (read.ec != std::errc() || !(sizes[k] > 0.0 && std::isfinite(sizes[k])) ||
        (is_last ? read.ptr != end : read.ptr == end || *read.ptr != ','))
      throw InputError(fmt::format("{}: give {} lengths in metres above 0 after the colon, with commas between them", word, count));
    at = read.ptr + 1;
  }
  return sizes;
}

/// Cylinders and capsules along z.
Surface read_silent_surface(const std::string& word) {
  const auto raise = [](Surface surface) {
    for (Vec3& v : surface.vertices_m) v = {v[0], -v[2], v[1]};
    return surface;
  };
  if (const auto s = read_sizes(word, "box", 3); !s.empty()) return make_box({s[0], s[1], s[2]});
  if (const auto s = read_sizes(word, "sphere", 1); !s.empty()) return make_sphere(s[0]);
  if (const auto s = read_sizes(word, "cylinder", 2); !s.empty()) return raise(make_cylinder(s[0], s[1], s[1]));
  if (const auto s = read_sizes(word, "capsule", 2); !s.empty()) return raise(make_capsule(s[0], s[1], s[1]));
  if (base::find_extension(word) == ".obj") return parse_obj_surface(base::read_file(word, "surface", kMaxGlbBytes), word);
  const bank::Bank bank = bank::read_bank(word);
  return {bank.vertices_m, bank.triangles};
}

}  // namespace

void run_export(const ExportWishes& wishes) {
  const std::string format = find_format(wishes);
  check_other(wishes.bank, wishes.out);
  check_options(wishes, format);
  std::FILE* const notes = base::is_standard_output(wishes.out) ? stderr : stdout;
  const std::string name = wishes.name.empty() ? wishes.bank.stem().string() : wishes.name;
  bank::Bank bank = bank::read_bank(wishes.bank);
  if (bank.mode_count() == 0) throw InputError(fmt::format("{}: the bank has no modes, hence no sound", wishes.bank.string()));
  if (format == "sofa") return export_sofa(bank, wishes, name, notes);
  if (format == "uff") return export_frfs(bank, wishes, name, notes);
  if (format == "glb") {
    const std::size_t modes = bank.mode_count();
    if (wishes.modes) bank = bank::calc_reduced(bank, {.modes = wishes.modes});
    std::uint64_t bytes = 0;
    write_output(wishes.out, "GLB file", [&](const auto& sink) {
      write_glb(bank, {.name = name, .is_z_up = wishes.is_z_up}, [&](std::string_view piece) {
        bytes += piece.size();
        sink(piece);
      });
    });
    fmt::print(notes, "glb       {} of {} modes at {} points, {:.3g} MB\n", bank.mode_count(), modes, bank.vertex_count(),
               1e-6 * static_cast<double>(bytes));
    return;
  }
  FaustOptions options{.name = name};
  if (wishes.modes) options.modes = *wishes.modes;
  read_points(wishes.points, options);
  options.radiation = radiation::require_gain_kind("--radiation", wishes.radiation);
  const FaustProgram program = make_faust(bank, options);
  write_output(wishes.out, "Faust program", [&](const auto& sink) { sink(program.text); });
  fmt::print(
      notes, "faust     {} of {} modes{}\n", program.modes, bank.mode_count(),
      std::isfinite(program.left_out_db) ? fmt::format("; the other modes are {:.1f} dB(A) below the total", -program.left_out_db) : "");
  for (std::size_t p = 0; p < program.points_m.size(); ++p)
    fmt::print(notes, "point {:<4}{:.5g}, {:.5g}, {:.5g} m\n", p, program.points_m[p][0], program.points_m[p][1], program.points_m[p][2]);
}

void run_measured(const MeasuredWishes& wishes) {
  const std::string name = wishes.measured.string();
  const bank::Bank played = bank::calc_corrected(bank::read_bank(wishes.bank));
  const FrfSet measured = parse_frfs(base::read_file(wishes.measured, "universal file", kMaxResultBytes), name);
  const MeasuredComparison found = compare_measured(played, measured, wishes.modes, wishes.within_cents, !wishes.picture.empty(), name);
  if (!wishes.picture.empty())
    base::write_file(wishes.picture, format_picture(found, played, base::printable(wishes.bank.string()), base::printable(name)));
  fmt::print("{}", wishes.has_json ? format_json(found, played) : base::printable_lines(format_table(found, played)));
}

void run_import(const ImportWishes& wishes) {
  for (const fs::path& in : {wishes.file, wishes.mesh}) check_other(in, wishes.out);
  const material::Material* const material =
      wishes.material.empty() ? nullptr : &material::MaterialTable::get().require("--material", wishes.material).material;
  if (wishes.is_scene) return import_scene(wishes, material);
  std::vector<std::string> notes;
  const bank::Bank bank = has_results(wishes.file) ? import_results(wishes, material, notes) : import_glb(wishes, material, notes);
  for (const std::string& note : notes) fmt::print(stderr, "carillon-bank: note: {}: {}\n", base::printable(wishes.file.string()), note);
  if (base::is_standard_output(wishes.out)) {
    base::check_standard_output("bank");
    base::write_standard_output(bank::make_bank_bytes(bank));
  } else {
    bank::write_bank(bank, wishes.out);
    fmt::print("bank      {} modes, {} vertices: {}\n", bank.mode_count(), bank.vertex_count(), base::printable(wishes.out.string()));
  }
}

void run_silent(const SilentWishes& wishes) {
  if (!base::is_standard_output(wishes.out)) check_other(wishes.body, wishes.out);
  SilentBody body{.surface = read_silent_surface(wishes.body), .mass_kg = wishes.mass_kg, .origin = wishes.body};
  if (!wishes.material.empty()) {
    const material::Material& material = material::MaterialTable::get().require("--material", wishes.material).material;
    body.density_kg_m3 = material.density_kg_m3;
    body.young_modulus_pa = material.young_modulus_pa;
    body.poisson_ratio = material.poisson_ratio;
  } else if (!wishes.density_kg_m3 && !wishes.mass_kg) {
    throw InputError("give --material NAME, --density or --mass: bodies that collide need a mass");
  }
  body.density_kg_m3 = wishes.density_kg_m3.value_or(body.density_kg_m3);
  body.young_modulus_pa = wishes.young_modulus_pa.value_or(body.young_modulus_pa);
  body.poisson_ratio = wishes.poisson_ratio.value_or(body.poisson_ratio);
  bank::Bank bank;
  std::vector<std::string> warnings;  // of given centres and moments, which this command has none of
  try {
    bank = make_silent_bank(body, warnings);
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: {}", wishes.body, error.what()));
  }
  if (base::is_standard_output(wishes.out)) {
    base::check_standard_output("bank");
    base::write_standard_output(bank::make_bank_bytes(bank));
  } else {
    bank::write_bank(bank, wishes.out);
    fmt::print("bank      no modes, {} vertices, {:.6g} kg: {}\n", bank.vertex_count(), bank.rigid.mass_kg,
               base::printable(wishes.out.string()));
  }
}

}  // namespace carillon::exchange
