// carillon mesh2faust: the arguments and the file of Faust's program mesh2faust, on our solver.
// Source: grame-cncm/faust, tools/physicalModeling/mesh2faust (arguments, layout of the library).
// Deviations: all modes of the band, none missed; T60 = ln 1000 / decay, where that program leaves out 2 pi; vertex 0 may be struck; an
//   error has an exit code other than 0 and leaves no file. Without alpha and beta the damping is that of aluminium.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numbers>

#include "jobs/cli/commands.hpp"
#include "jobs/front/cache/cache.hpp"
#include "precompute/job/job_spec.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/bank/nearest.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::cli {
namespace {

constexpr std::uint64_t kMaxObjBytes = 1ULL << 32;
constexpr double kLn1000 = 3.0 * std::numbers::ln10;

/// Vertices of an OBJ file in the order of the file, which numbers them from 0.
std::vector<Vec3> read_vertices(const std::filesystem::path& file) {
  if (base::find_extension(file) != ".obj")
    throw InputError(fmt::format("{}: vertices are numbered as in an OBJ file; give a surface that ends in .obj", file.string()));
  const std::string text = base::read_file(file, "surface", kMaxObjBytes);
  std::vector<Vec3> vertices;
  std::size_t line = 0;
  for (std::size_t begin = 0; begin < text.size(); ++line) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const char* at = text.data() + begin;
    const char* const stop = text.data() + end;
    const auto skip = [&] { at = std::find_if(at, stop, [](char c) { return c != ' ' && c != '\t'; }); };
    begin = end + 1;
    skip();
    if (stop - at < 2 || *at != 'v' || (at[1] != ' ' && at[1] != '\t')) continue;
    ++at;
    Vec3& vertex = vertices.emplace_back();
    for (double& x : vertex) {
      skip();
      const auto read = std::from_chars(at, stop, x);
      if (read.ec != std::errc() || !std::isfinite(x))
        throw InputError(fmt::format("{}:{}: a vertex needs three numbers, as in \"v 0.1 0 0.05\"", file.string(), line + 1));
      at = read.ptr;
    }
  }
  if (vertices.empty()) throw InputError(fmt::format("{}: has no vertices; export the body as a triangle surface", file.string()));
  return vertices;
}

/// Vertices to strike: --expos, at most --lmexpos over the file, or all.
std::vector<std::size_t> choose_vertices(const Mesh2FaustOptions& options, std::size_t count) {
  for (const std::size_t vertex : options.vertices)
    if (vertex >= count)
      throw InputError(
          fmt::format("--expos {}: {} has {} vertices; give numbers from 0 to {}", vertex, options.file.string(), count, count - 1));
  if (!options.vertices.empty()) return options.vertices;
  std::vector<std::size_t> chosen(std::min(options.max_points.value_or(count), count));
  for (std::size_t i = 0; i < chosen.size(); ++i) chosen[i] = i * (count / chosen.size());
  return chosen;
}

job::JobSpec make_job(const Mesh2FaustOptions& options) {
  const std::vector<double>& given = options.material;
  base::Json material, body, job;
  material.set("from", "aluminium");
  for (std::size_t i = 0; i < std::min<std::size_t>(3, given.size()); ++i)
    material.set(std::array{"young_modulus_pa", "poisson_ratio", "density_kg_m3"}[i], given[i]);
  if (given.size() == 5) {
    base::Json rayleigh, damping;
    rayleigh.set("alpha1_s", given[4]).set("alpha2_per_s", given[3]);
    damping.set("rayleigh", rayleigh);
    material.set("damping", damping);
  }
  body.set("surface", std::filesystem::absolute(options.file).string()).set("scale", 1.0);
  job.set("material", material).set("max_modes", static_cast<std::int64_t>(options.modes)).set("shapes", "exact");
  job["band_hz"].append(options.min_hz);
  job["band_hz"].append(options.max_hz);
  if (options.accuracy_cents) job.set("accuracy_cents", *options.accuracy_cents);
  job.set("body", body);
  return job::parse_job(job.line(), std::filesystem::absolute("the arguments of mesh2faust"), job::BankKey::optional);
}

struct Modes {
  std::vector<double> freq_hz, t60_s;      // (m) damped
  std::vector<std::vector<double>> gains;  // (positions, m) relative to the largest of each position
};

Modes find_modes(const bank::Bank& bank, const std::vector<Vec3>& points_m) {
  std::vector<std::size_t> ringing;
  Modes modes;
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    const double decay = bank.decay_per_s[m], turn = 2.0 * std::numbers::pi * bank.freq_hz(m);
    if (decay >= turn) continue;  // over-damped
    ringing.push_back(m);
    modes.freq_hz.push_back(std::sqrt((turn - decay) * (turn + decay)) / (2.0 * std::numbers::pi));
    modes.t60_s.push_back(kLn1000 / decay);
  }
  const bank::SurfaceTree tree(bank);
  for (const Vec3& point_m : points_m) {
    const bank::NearestPlace place = tree.find(point_m);
    const std::vector<double> shapes = bank::calc_shapes(bank, place.triangle, place.barycentric);
    std::vector<double>& gains = modes.gains.emplace_back();
    for (const std::size_t m : ringing) gains.push_back(norm(Vec3{shapes[3 * m], shapes[3 * m + 1], shapes[3 * m + 2]}));
    const double largest = gains.empty() ? 0.0 : *std::max_element(gains.begin(), gains.end());
    for (double& gain : gains) gain = largest > 0.0 ? gain / largest : 0.0;
  }
  return modes;
}

/// Without exponents, which readers of these files do not expect.
std::string list(const std::vector<double>& numbers) {
  std::string text;
  for (const double x : numbers) text += fmt::format("{}{:.6f}", text.empty() ? "" : ",", x);
  return text;
}

/// The name of the model in Faust: a name of a file with other characters than Faust's names have is made one.
std::string make_identifier(const std::string& name) {
  std::string text;
  for (const char c : name) text += (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ? c : '_';
  if (text.empty() || (text[0] >= '0' && text[0] <= '9')) text.insert(0, 1, '_');
  return text;
}

std::string write_library(const Modes& modes, const std::string& name, bool has_control) {
  std::string gains;
  for (const std::vector<double>& row : modes.gains) gains += (gains.empty() ? "" : ",") + list(row);
  std::string text = "import(\"stdfaust.lib\");\n\n";
  text += fmt::format(
      "{}({}exPos,t60Scale) = _ <: par(mode,nModes,pm.modeFilter(modeFreqs(mode),modesT60s(mode),modesGains(int(exPos),mode))) :> "
      "/(nModes)\nwith{{\nnModes = {};\n",
      make_identifier(name), has_control ? "freq," : "", modes.freq_hz.size());
  if (modes.gains.size() > 1) text += fmt::format("nExPos = {};\n", modes.gains.size());
  text += fmt::format("modeFreqsUnscaled(n) = ba.take(n+1,({}));\n", list(modes.freq_hz));
  text +=
      fmt::format("modeFreqs(mode) = {};\n", has_control ? "freq*modeFreqsUnscaled(mode)/modeFreqsUnscaled(0)" : "modeFreqsUnscaled(mode)");
  text += fmt::format("modesGains(p,n) = waveform{{{}}},int(p*nModes+n) : rdtable{};\n", gains,
                      has_control ? " : select2(modeFreqs(n)<(ma.SR/2-1),0)" : "");
  text += fmt::format("modesT60s(n) = t60Scale * ba.take(n+1,({}));\n}};\n", list(modes.t60_s));
  return text;
}

}  // namespace

int run_mesh2faust(Shared& shared, const Mesh2FaustOptions& options) {
  if (options.material.size() == 4) throw InputError("--material: give 3 numbers, E nu rho, or 5, E nu rho alpha beta");
  if (!(options.min_hz < options.max_hz))
    throw InputError(fmt::format("--minmode {:g} --maxmode {:g}: give a lower and a higher frequency", options.min_hz, options.max_hz));
  const std::filesystem::path out = options.name + ".lib";
  base::check_writable(out, "Faust library");
  const std::vector<Vec3> vertices_m = read_vertices(options.file);
  std::vector<Vec3> points_m;
  for (const std::size_t vertex : choose_vertices(options, vertices_m.size())) points_m.push_back(vertices_m[vertex]);
  const cache::Made made = cache::find_or_make(make_job(options), read_solver_version(), cache::find_default_cache(), !options.is_verbose);
  for (const std::string& warning : made.warnings) fmt::print(stderr, "carillon: warning: {}\n", show_message(warning));
  const bank::Bank bank = bank::choose_frequencies(bank::read_bank(made.bank), bank::Frequencies::kCorrected);
  const Modes modes = find_modes(bank, points_m);
  if (modes.freq_hz.empty())
    throw InputError(fmt::format("{}: the body has no modes from {:g} to {:g} Hz; give a higher --maxmode or a lower --minmode",
                                 options.file.string(), options.min_hz, options.max_hz));
  base::write_file(out, write_library(modes, out.stem().string(), options.has_control));
  if (options.shows_frequencies) {
    fmt::print("Mode frequencies between {:g}Hz and {:g}Hz:\n", options.min_hz, options.max_hz);
    for (const double freq_hz : modes.freq_hz) fmt::print("{:.6g}\n", freq_hz);
    fmt::print("\n");
  }
  if (shared.json) {
    base::Json root;
    root.set("library", to_json(out.string())).set("bank", to_json(made.bank.string()));
    root.set("modes", static_cast<std::int64_t>(modes.freq_hz.size())).set("positions", static_cast<std::int64_t>(points_m.size()));
    print_json(root);
  }
  if (std::fflush(stdout) != 0) throw SystemError("the output cannot be written");
  return 0;
}

}  // namespace carillon::cli
