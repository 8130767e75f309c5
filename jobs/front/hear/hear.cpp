// Method:     Runs carillon-mesh, carillon-precompute and carillon-render on files in one folder. The body with the lowest wave speed is
//             solved; bodies that differ only in density, stiffness, loss and size are scaled from it (docs/equations.md E6).
#include "jobs/front/hear/hear.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <limits>
#include <string_view>
#include <utility>

#include "jobs/front/explore/explore.hpp"
#include "jobs/front/explore/names.hpp"
#include "jobs/front/hear/assume.hpp"
#include "jobs/front/hear/strikes.hpp"
#include "jobs/front/report/report.hpp"
#include "jobs/store/process/programs.hpp"
#include "precompute/job/preview.hpp"
#include "precompute/job/read_body.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/bank/blows.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/bank/mounting/heard.hpp"
#include "runtime/bank/of_material.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/base/descriptor.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/foreign.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/material/mallets.hpp"
#include "runtime/material/table.hpp"

namespace carillon::hear {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr int kMaxModes = 600;                // with accuracy_cents
constexpr const char* kExplorer = "explore";  // folder of the page
constexpr const char* kOfFile = "file";       // material of the mesh file, as jobs name it
constexpr std::size_t kStrikes = 4, kListed = 12;
constexpr long long kMaxUnused = 1'000'000'000'000;
constexpr double kSameCents = 5.0;                       // allowed error of scaling with unchanged Poisson's ratio
constexpr double kMinCents = 0.001, kMaxCents = 1200.0;  // of a job's accuracy_cents
constexpr std::array<double, 2> kBandHz{20.0, 20000.0};

/// Keeps characters that are safe in file names: letters and digits of any script, points and underscores.
std::string clean(const std::string& name) {
  const bool is_text = base::printable(name) == name;  // invalid UTF-8 is not valid in JSON
  std::string text;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    text += std::isalnum(byte) != 0 || c == '.' || c == '_' || (byte >= 0x80 && is_text) ? c : '-';
  }
  return text.empty() || text[0] == '.' ? "object" + text : text;
}

bool is_mesh_file(const fs::path& file) {
  constexpr std::array<std::string_view, 12> kEndings{".msh", ".vtu",    ".vtk", ".mesh", ".node", ".ele",
                                                      ".inp", ".vtkhdf", ".bdf", ".nas",  ".unv",  ".uff"};
  return std::find(kEndings.begin(), kEndings.end(), base::find_extension(file)) != kEndings.end();
}

bool is_surface_file(const fs::path& file) {
  constexpr std::array<std::string_view, 6> kEndings{".obj", ".stl", ".ply", ".off", ".gltf", ".glb"};
  return std::find(kEndings.begin(), kEndings.end(), base::find_extension(file)) != kEndings.end();
}

/// InputError if the object is neither a surface nor a mesh, with a remedy for other kinds of files.
void check_object(const fs::path& object) {
  constexpr const char* kTakes = "a surface (.obj, .stl, .ply, .off, .gltf, .glb) or a mesh (.msh, .vtu, .mesh, .inp, .bdf, .unv)";
  const std::string name = object.string(), ending = base::find_extension(object);
  std::error_code error;
  if (!fs::exists(object, error)) throw InputError(fmt::format("{}: no such file{}; give {}", name, base::hint_backslash(object), kTakes));
  if (fs::is_directory(object, error)) throw InputError(fmt::format("{}: a folder; give the file of {} in it", name, kTakes));
  if (is_surface_file(object) || is_mesh_file(object)) return;
  if (ending == ".json" || ending == ".jsonl")
    throw InputError(
        fmt::format("{}: by its name not an object, but a scene (play it: carillon-render {} -o sound.wav) or a job "
                    "(solve it: carillon-precompute {}); give {}",
                    name, name, name, kTakes));
  if (ending == ".hdf" || ending == ".h5" || ending == ".hdf5" || ending == ".bank")
    throw InputError(fmt::format("{}: by its name a bank; play it with carillon explore, use it in a scene for carillon-render, or give {}",
                                 name, kTakes));
  throw InputError(fmt::format("{}: by its name neither a surface nor a mesh; give {}, and convert other formats first", name, kTakes));
}

/// The output folder, locked. Removed at the end if created here and still empty.
class OutFolder {
 public:
  /// InputError, SystemError: cannot be created, or locked by another run.
  explicit OutFolder(fs::path folder) : folder_(std::move(folder)) {
    std::error_code error;
    is_new_ = fs::create_directories(folder_, error);
    if (error) throw SystemError(fmt::format("{}: cannot create folder: {}; give another one with -o", folder_.string(), error.message()));
    base::check_writable(folder_ / "report.html", "sound");
    lock_ = base::Descriptor(::open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (lock_.get() >= 0 && ::flock(lock_.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
      throw InputError(
          fmt::format("{}: another `carillon hear` uses this folder; wait for it, or give another one with -o", folder_.string()));
  }
  ~OutFolder() {
    std::error_code error;
    if (is_new_ && fs::is_empty(folder_, error)) fs::remove(folder_, error);
  }
  OutFolder(const OutFolder&) = delete;
  OutFolder& operator=(const OutFolder&) = delete;

 private:
  fs::path folder_;
  bool is_new_ = false;
  base::Descriptor lock_;
};

/// One material and height.
struct Wish {
  const material::Material* material = nullptr;
  double height_m = 0.0;
  double slowness = 0.0;  // height over the speed of sound: larger means lower frequencies
  std::string name = {};
};

class Listening {
 public:
  explicit Listening(const Order& order) : order_(order), start_(Clock::now()), programs_(order.is_quiet) {}

  Heard run() {
    check_options();
    look();
    const std::vector<Wish> wishes = list_wishes();
    if (!is_shape()) (void)find_scale_of(wishes.front());
    const OutFolder folder(heard_.folder);
    for (const Wish& wish : wishes) listen(wish);
    if (order_.accuracy_cents) refine(wishes);
    std::sort(heard_.sounds.begin(), heard_.sounds.end(), [&](const Sound& a, const Sound& b) { return place_[a.name] < place_[b.name]; });
    write_page();
    heard_.seconds = calc_seconds();
    return std::move(heard_);
  }

 private:
  bool is_shape() const { return !order_.shape.empty(); }
  bool is_mesh() const { return !is_shape() && is_mesh_file(order_.object); }

  void say(const std::string& text) const {
    if (!order_.is_quiet) fmt::print(stderr, "[{:6.1f} s] {}\n", calc_seconds(), text);
  }
  /// Since the beginning.
  double calc_seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

  /// The page with all sounds side by side.
  void make_explorer() {
    if (!explore::is_installed()) return;
    explore::PageOrder order{.folder = heard_.folder / kExplorer, .title = stem_};
    for (const Sound& sound : heard_.sounds) order.subjects.push_back(sound.bank);
    if (!is_shape() && !is_mesh()) order.up = explore::Up::kY;
    say("writing the page");
    heard_.explorer = explore::explore(order).folder;
  }

  void check_options() {
    if (is_shape() == !order_.object.empty()) throw InputError("give an object: a file, or --shape with its dimensions");
    if (!is_shape()) check_object(order_.object);
    if (!order_.heights_m.empty() && (is_shape() || is_mesh()))
      throw InputError(fmt::format("--height is for surfaces; {}",
                                   is_shape() ? "a shape has its dimensions" : "a mesh has its size, which --scale changes"));
    if (!order_.heights_m.empty() && order_.scale) throw InputError("--height and --scale exclude each other; give one of them");
    if (order_.scale && is_shape()) throw InputError("--scale is for files; a shape has its dimensions in metres");
    if (order_.wall_m && is_mesh()) throw InputError("--wall is for surfaces; a mesh is already a volume");
    if (order_.wall_m && !(*order_.wall_m > 0.0)) throw InputError("--wall is a thickness in metres, above 0");
    if (order_.facets && (is_shape() || is_mesh()))
      throw InputError(
          fmt::format("--facets is for surfaces; {}", is_shape() ? "a shape has no facets" : "for a mesh give it to carillon-mesh"));
    for (const double height : order_.heights_m)
      if (!(height > 0.0) || !std::isfinite(height)) throw InputError("--height is in metres, above 0");
    if (order_.scale && !(*order_.scale > 0.0)) throw InputError("--scale is metres per unit of the file, above 0");
    if (order_.accuracy_cents && !(*order_.accuracy_cents >= kMinCents && *order_.accuracy_cents <= kMaxCents))
      throw InputError(fmt::format("--accuracy is in cents, from {:g} to {:g}", kMinCents, kMaxCents));
    if (order_.accuracy_cents && is_mesh())
      throw InputError("--accuracy needs a surface or a shape, to mesh it finer; give one, or a finer mesh without --accuracy");
    for (const std::string& name : order_.materials) (void)material::MaterialTable::get().require("--material", name);
    (void)material::require_mallet("--mallet", order_.mallet);
  }

  /// Reads the file and collects assumptions.
  void look() {
    stem_ = explore::cut_name(clean(is_shape() ? order_.shape : order_.object.stem().string()));
    heard_.folder = fs::absolute(order_.out.empty() ? fs::path(stem_ + "-sound") : order_.out);
    materials_ = order_.materials;
    if (!is_shape()) look_at_file();
    if (!materials_.empty()) return;
    materials_ = {kDefaultMaterial};
    heard_.assumed.insert(heard_.assumed.begin(),
                          fmt::format("material: {} (none given{}); choose another with --material NAME (`carillon materials` lists them)",
                                      kDefaultMaterial, material_problem_.empty() ? "" : ", and " + material_problem_));
  }

  void look_at_file() {
    say("reading " + order_.object.filename().string());
    facts_.is_mesh = is_mesh();
    const std::string text = programs_.run("carillon-mesh", {fs::absolute(order_.object).string(), "--look"}, true);
    const base::Document document = base::parse_document(text, "carillon-mesh --look");
    base::Object root = document.root();
    facts_.extent = root.numbers<3>("extent");
    facts_.parts = root.integer("parts", 0, std::numeric_limits<long long>::max());
    if (facts_.parts > 1)
      heard_.assumed.push_back(
          fmt::format("parts: {} separate bodies are treated as one object; use one file each to hear them separately", facts_.parts));
    if (const long long unused = root.integer_if(is_mesh() ? "unused_nodes" : "unused_points", 0, kMaxUnused).value_or(0); unused > 0)
      heard_.assumed.push_back(fmt::format("unused: {} point{} of the file belong{} to no element and {} left out", unused,
                                           unused == 1 ? "" : "s", unused == 1 ? "s" : "", unused == 1 ? "is" : "are"));
    if (is_mesh()) return look_at_model(root);
    facts_.triangles = root.integer("triangles", 0, std::numeric_limits<long long>::max());
    facts_.openings = root.integer("openings", 0, std::numeric_limits<long long>::max());
    facts_.thickness = root.has_number("thickness") ? root.number("thickness") : 0.0;
    if (!order_.wall_m && facts_.openings == 0)
      heard_.assumed.push_back(facts_.thickness > 0.0 ? std::string("body: a wall, since the file has both sides")
                                                      : std::string("body: solid; --wall T makes it a shell of T metres"));
  }

  /// Unit, material and supports of a mesh file.
  void look_at_model(base::Object& root) {
    if (root.has("unit")) {
      facts_.unit_m = root.number("unit_m", base::kPositive);
      facts_.unit = root.string("unit");
    }
    if (root.has("supports")) {
      supports_ = root.string("supports");
      heard_.assumed.push_back(
          fmt::format("supports: the nodes of '{}' of the file are fixed; for a free body remove it from the file", supports_));
    }
    if (!root.has("materials") || !materials_.empty()) return;
    base::Object materials = root.object("materials");
    for (const std::string& region : materials.keys()) {
      base::Object material = materials.object(region);
      if (material.has("problem")) material_problem_ = "the file's cannot be used: " + material.string("problem");
      of_file_.name = material.string("name");
      of_file_.young_modulus_pa = material.number("young_modulus_pa");
      of_file_.poisson_ratio = material.number("poisson_ratio");
      of_file_.density_kg_m3 = material.number("density_kg_m3");
    }
    if (!material_problem_.empty()) return;
    materials_ = {kOfFile};
    heard_.assumed.push_back(fmt::format("material: of the file ({}{}); choose another with --material NAME", of_file_.name,
                                         materials.keys().size() > 1 ? fmt::format(" and {} more", materials.keys().size() - 1) : ""));
  }

  std::vector<Wish> list_wishes() {
    std::vector<double> heights = order_.heights_m;
    if (heights.empty()) heights.push_back(0.0);
    std::vector<Wish> wishes;
    const bool has_many_heights = heights.size() > 1;
    for (const std::string& name : materials_)
      for (const double height : heights) {
        Wish wish{.material = name == kOfFile ? &of_file_ : &material::MaterialTable::get().find(name)->material, .height_m = height};
        wish.slowness = std::max(height, 1e-9) * std::sqrt(wish.material->density_kg_m3 / wish.material->young_modulus_pa);
        wish.name = fmt::format("{}-{}{}", stem_, clean(wish.material->name), has_many_heights ? fmt::format("-{:g}m", height) : "");
        if (!place_.emplace(wish.name, place_.size()).second) throw InputError(fmt::format("{} is given twice", wish.name));
        wishes.push_back(wish);
      }
    std::stable_sort(wishes.begin(), wishes.end(), [](const Wish& a, const Wish& b) { return a.slowness > b.slowness; });
    return wishes;
  }

  void listen(const Wish& wish) {
    Sound sound;
    sound.name = wish.name;
    sound.material = wish.material->name;
    sound.height_m = wish.height_m;
    sound.bank = heard_.folder / (wish.name + ".hdf");
    sound.is_edited = edit(wish, sound);
    if (!sound.is_edited) solve(wish, sound);
    play(sound);
    const auto earlier = std::find_if(heard_.sounds.begin(), heard_.sounds.end(), [&](const Sound& s) { return s.name == sound.name; });
    if (earlier == heard_.sounds.end())
      heard_.sounds.push_back(std::move(sound));
    else
      *earlier = std::move(sound);
  }

  /// The sounds again from finer meshes. On failure the preview stays.
  void refine(const std::vector<Wish>& wishes) {
    double worst_cents = 0.0;
    for (const Sound& sound : heard_.sounds) worst_cents = std::max(worst_cents, sound.worst_cents);
    const std::string preview =
        fmt::format("the preview, with error bars up to {} cents, is in {}", format_cents(worst_cents), heard_.folder.string());
    if (worst_cents <= *order_.accuracy_cents) return;
    say(preview);
    solved_.clear();
    is_refining_ = true;
    try {
      for (const Wish& wish : wishes) listen(wish);
    } catch (const SolveError& error) {
      throw SolveError(fmt::format("{} Or give a larger --accuracy; {}", error.what(), preview));
    } catch (...) {
      if (process::SignalWatch::get_signal() != 0) throw;
      rethrow_after(preview + ", and refining it failed: ");
    }
  }

  /// Report and page.
  void write_page() {
    heard_.page = heard_.folder / report::kPageFile;
    const fs::path& bank = heard_.sounds.front().bank;
    make_explorer();
    const std::string explorer = heard_.explorer.empty() ? "" : kExplorer;
    report::write_report(bank, bank.string() + ".resolved.json", heard_.folder, {.title = stem_, .drawn_modes = 0, .explorer = explorer});
  }

  /// Scales the bank of a similar solved body; false if there is none.
  bool edit(const Wish& wish, Sound& sound) {
    for (const auto& [solved, bank_file] : solved_) {
      const bool is_scaled = solved.height_m != wish.height_m, is_same = solved.material == wish.material;
      if (is_scaled && order_.wall_m) continue;  // the wall thickness is not scaled
      std::vector<std::string> words{"edit", bank_file.string(), sound.bank.string()};
      if (!is_same) {
        if (wish.material->orthotropic || solved.material->orthotropic) continue;
        const double cents = bank::calc_poisson_cents(bank::read_bank(bank_file), *wish.material);
        if (cents > kSameCents) continue;
        sound.poisson_cents = cents;
        words.insert(words.end(), {"--material", wish.material->name});
      }
      if (is_scaled) words.insert(words.end(), {"--size", fmt::format("{:.17g}", wish.height_m / solved.height_m)});
      say(fmt::format("{}: scaled from {}", wish.name, solved.name));
      (void)programs_.run("carillon-bank", words, false);
      return true;
    }
    return false;
  }

  void solve(const Wish& wish, const Sound& sound) {
    base::Json job = base::Json::object();
    if (is_refining_)
      job.set("body", make_body(wish)).set("accuracy_cents", *order_.accuracy_cents);
    else if (is_mesh())
      job.set("mesh", fs::absolute(order_.object).string()).set("mesh_scale", order_.scale.value_or(1.0));
    else
      job.set("mesh", make_mesh(wish).filename().string());
    if (!supports_.empty()) job.set("fixed", supports_);
    job.set("material", wish.material == &of_file_ ? kOfFile : wish.material->name).set("bank", sound.bank.filename().string());
    job.set("band_hz", base::Json::array(kBandHz)).set("max_modes", is_refining_ ? kMaxModes : job::kPreviewModes);
    const fs::path file = heard_.folder / (wish.name + ".json");
    base::write_file(file, job.text());
    say(fmt::format("{}: {}computing the modes", wish.name, is_refining_ ? "meshing finer and " : ""));
    std::vector<std::string> words{file.string()};
    if (!is_refining_) words.emplace_back("-q");
    (void)programs_.run("carillon-precompute", words, true, is_refining_);
    solved_.emplace_back(wish, sound.bank);
  }

  double find_scale_of(const Wish& wish) {
    std::vector<std::string> assumed;
    const double scale = find_scale(order_, facts_, wish.height_m, assumed);
    check_wall(order_, facts_, scale);
    if (!is_size_said_) heard_.assumed.insert(heard_.assumed.begin(), assumed.begin(), assumed.end());
    is_size_said_ = true;
    return scale;
  }

  base::Json make_body(const Wish& wish) {
    base::Json body = base::Json::object();
    if (is_shape()) {
      body.set("shape", order_.shape);
      for (const auto& [name, value] : order_.dimensions) body.set(job::find_dimension_key(name), value);
      return body;
    }
    body.set("surface", fs::absolute(order_.object).string()).set("scale", find_scale_of(wish));
    if (order_.wall_m) body.set("wall_m", *order_.wall_m);
    if (order_.facets) body.set("facets", true);
    return body;
  }

  /// The mesh for this height, cached.
  fs::path make_mesh(const Wish& wish) {
    if (const auto made = meshes_.find(wish.height_m); made != meshes_.end()) return made->second;
    const fs::path file =
        heard_.folder / fmt::format("{}{}.msh", stem_, order_.heights_m.size() > 1 ? fmt::format("-{:g}m", wish.height_m) : "");
    std::vector<std::string> words;
    std::int64_t nodes = job::kPreviewShapeNodes;
    if (is_shape()) {
      words = {"--shape", order_.shape};
      for (const auto& [name, value] : order_.dimensions) words.insert(words.end(), {"--" + name, fmt::format("{:.17g}", value)});
    } else {
      words = {fs::absolute(order_.object).string(), "--scale", fmt::format("{:.17g}", find_scale_of(wish))};
      if (order_.wall_m) words.insert(words.end(), {"--wall", fmt::format("{:.17g}", *order_.wall_m)});
      if (order_.facets) words.emplace_back("--facets");
      nodes = order_.wall_m || facts_.thickness > 0.0 ? job::kPreviewWallNodes : job::kPreviewSolidNodes;
    }
    words.insert(words.end(), {"--order", "2", "-q", "-o", file.string()});
    say(fmt::format("meshing {}", stem_));
    (void)job::run_at_possible_count(nodes, "mesh it with `carillon-mesh` and give the mesh, or make it thicker", [&](std::int64_t count) {
      std::vector<std::string> all = words;
      all.insert(all.end(), {"--nodes", std::to_string(count)});
      (void)programs_.run("carillon-mesh", all, true);
    });
    for (const std::string& note : programs_.get_notes())
      if (std::find(heard_.warnings.begin(), heard_.warnings.end(), note) == heard_.warnings.end()) heard_.warnings.push_back(note);
    meshes_[wish.height_m] = file;
    return file;
  }

  void play(Sound& sound) {
    bank::Bank bank = bank::choose_frequencies(bank::read_bank(sound.bank), bank::Frequencies::kCorrected);
    const std::vector<bank::HeardMode> modes = mounting::mount(bank);
    if (bank.mode_count() == 0 || bank.freq_hz(0) > kBandHz[1])
      throw InputError(fmt::format("{}: no mode from {:g} to {:g} Hz: inaudible; make it larger ({})", sound.name, kBandHz[0], kBandHz[1],
                                   is_shape()  ? "its dimensions"
                                   : is_mesh() ? "--scale"
                                               : "--height, --scale"));
    const std::vector<std::size_t> strikes = bank::find_strikes(bank, kStrikes);
    sound.mode_count = bank.mode_count();
    sound.highest_hz = bank.freq_hz(bank.mode_count() - 1);
    sound.is_complete = bank.complete;
    sound.modes = list_modes(bank, modes, strikes.front(), kListed);
    for (StruckMode& mode : sound.modes) mode.error_cents += sound.poisson_cents;
    for (const double cents : bank.discretisation_error_cents) sound.worst_cents = std::max(sound.worst_cents, cents + sound.poisson_cents);
    for (const double cents : bank.facet_error_cents) sound.facet_cents = std::max(sound.facet_cents, cents);
    const auto [low, high] = bank::find_extent(bank.vertices_m);
    const Vec3 middle = 0.5 * (low + high), extent = high - low;
    if (heard_.sounds.empty()) heard_.extent_m = {extent[0], extent[1], extent[2]};
    sound.scene = heard_.folder / (sound.name + "-scene.json");
    sound.wav = heard_.folder / (sound.name + ".wav");
    sound.spectrogram = heard_.folder / (sound.name + ".png");
    base::write_file(sound.scene, make_scene(sound, bank, strikes, middle, norm(extent)).text());
    say(fmt::format("{}: playing {} strikes", sound.name, strikes.size()));
    (void)programs_.run("carillon-render",
                        {sound.scene.string(), "-q", "-o", sound.wav.string(), "--spectrogram", sound.spectrogram.string()}, false);
  }

  base::Json make_scene(const Sound& sound, const bank::Bank& bank, const std::vector<std::size_t>& strikes, const Vec3& middle,
                        double size) const {
    const double ring = bank::calc_ring_s(bank, strikes.front()), gap = std::clamp(ring, 0.5, 1.5), begin = 0.05;
    base::Json scene = base::Json::object(), body = base::Json::object(), listener = base::Json::object();
    scene.set("duration_s", begin + gap * static_cast<double>(strikes.size() - 1) + std::clamp(ring, 0.5, 4.0));
    body.set("name", stem_).set("bank", sound.bank.filename().string()).set("fixed", true);
    scene.set("bodies", base::Json::array())["bodies"].add(body);
    for (std::size_t k = 0; k < strikes.size(); ++k) {
      base::Json strike = base::Json::object();
      strike.set("time_s", begin + gap * static_cast<double>(k)).set("body", stem_);
      strike.set("point_m", base::Json::array(bank.vertices_m[strikes[k]])).set("mallet", order_.mallet);
      scene["strikes"].add(strike);
    }
    listener.set("position_m", base::Json::array(Vec3{middle[0], middle[1] - std::clamp(2.0 * size, 1.0, 500.0), middle[2]}));
    listener.set("look_at_m", base::Json::array(middle));
    scene.set("listener", listener);
    return scene;
  }

  const Order& order_;
  Clock::time_point start_;
  const process::SignalWatch watch_;
  process::Programs programs_;
  std::string stem_;
  SurfaceFacts facts_;
  std::vector<std::string> materials_;
  material::Material of_file_;                     // the last of the mesh file
  std::string material_problem_;                   // why the file's are not used
  std::string supports_;                           // node set of the mesh file
  std::map<double, fs::path> meshes_;              // by height
  std::vector<std::pair<Wish, fs::path>> solved_;  // with their banks
  std::map<std::string, std::size_t> place_;       // order of the sounds
  bool is_size_said_ = false;
  bool is_refining_ = false;  // after the preview
  Heard heard_;
};

}  // namespace

std::string format_cents(double cents) { return cents < 10.0 ? fmt::format("{:.2g}", cents) : fmt::format("{:.0f}", cents); }

Heard hear(const Order& order) { return Listening(order).run(); }

}  // namespace carillon::hear
