// Method:     carillon-mesh, carillon-precompute and carillon-render, one after the other, on files in one folder. The body of the slowest
//             waves is solved; those that differ from it by density, stiffness, loss and size alone are scaled (docs/equations.md E6).
// Source:     own.
// Deviations: none.
#include "jobs/hear/hear.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <cmath>
#include <limits>

#include "jobs/explore/explore.hpp"
#include "jobs/hear/assume.hpp"
#include "jobs/hear/strikes.hpp"
#include "jobs/process/programs.hpp"
#include "jobs/report/report.hpp"
#include "precompute/job/read_body.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/bank/of_material.hpp"
#include "runtime/bank/strikes.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/material/mallets.hpp"
#include "runtime/material/table.hpp"

namespace carillon::hear {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr std::int64_t kSolidNodes = 16000, kWallNodes = 15000, kShapeNodes = 6000;  // of a preview
constexpr std::int64_t kMaxPreviewNodes = 80000;
constexpr int kPreviewModes = 200, kMaxModes = 600;
constexpr const char* kExplorer = "explore";  // folder of the page
constexpr std::size_t kStrikes = 4, kListed = 12;
constexpr double kSameCents = 5.0;  // an edit that leaves Poisson's ratio may be so far off
constexpr std::array<double, 2> kBandHz{20.0, 20000.0};

/// Letters, digits and what else is harmless in the name of a file.
std::string clean(const std::string& name) {
  std::string text;
  for (const char c : name) text += std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.' || c == '_' ? c : '-';
  return text.empty() || text[0] == '.' ? "object" + text : text;
}

bool is_mesh_file(const fs::path& file) {
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return ending == ".msh" || ending == ".vtu" || ending == ".vtk" || ending == ".mesh" || ending == ".node" || ending == ".vtkhdf";
}

/// One material and height, and where it stands among the others.
struct Wish {
  const material::Material* material = nullptr;
  double height_m = 0.0;
  double slowness = 0.0;  // how low it sounds, but for the shape: height over the speed of sound
  std::string name = {};
};

class Listening {
 public:
  explicit Listening(const Order& order) : order_(order), start_(Clock::now()) {}

  Heard run() {
    check_options();
    make_folder();
    process::Programs programs(heard_.folder, order_.is_quiet);
    programs_ = &programs;
    look();
    const std::vector<Wish> wishes = list_wishes();
    for (const Wish& wish : wishes) listen(wish);
    std::sort(heard_.sounds.begin(), heard_.sounds.end(), [&](const Sound& a, const Sound& b) { return place_[a.name] < place_[b.name]; });
    heard_.page = heard_.folder / report::kPageFile;
    const fs::path& bank = heard_.sounds.front().bank;
    make_explorer();
    const std::string explorer = heard_.explorer.empty() ? "" : kExplorer;
    report::write_report(bank, bank.string() + ".resolved.json", heard_.folder, {.title = stem_, .drawn_modes = 0, .explorer = explorer});
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

  /// The page on which all that was asked for stands side by side.
  void make_explorer() {
    if (!explore::is_installed()) return;
    explore::Order order{.folder = heard_.folder / kExplorer, .title = stem_};
    for (const Sound& sound : heard_.sounds) order.subjects.push_back(sound.bank);
    if (!is_shape() && !is_mesh()) order.up = explore::Up::kY;
    say("making the page");
    heard_.explorer = explore::explore(order).folder;
  }

  void check_options() {
    if (is_shape() == !order_.object.empty()) throw InputError("give an object: a file, or --shape with its dimensions");
    std::error_code error;
    if (!is_shape() && !fs::exists(order_.object, error))
      throw InputError(fmt::format("{}: no such file; give a surface (OBJ, STL, PLY, OFF, glTF, GLB) or a mesh", order_.object.string()));
    if (!order_.heights_m.empty() && (is_shape() || is_mesh()))
      throw InputError(fmt::format("--height is for surfaces; {}",
                                   is_shape() ? "a shape has its dimensions" : "a mesh has its size, which --scale changes"));
    if (!order_.heights_m.empty() && order_.scale) throw InputError("--height and --scale exclude each other; give one of them");
    if (order_.scale && is_shape()) throw InputError("--scale is for files; a shape has its dimensions in metres");
    if (order_.wall_m && is_mesh()) throw InputError("--wall is for surfaces; a mesh is what it is");
    if (order_.wall_m && !(*order_.wall_m > 0.0)) throw InputError("--wall is a thickness in metres, above 0");
    for (const double height : order_.heights_m)
      if (!(height > 0.0) || !std::isfinite(height)) throw InputError("--height is in metres, above 0");
    if (order_.scale && !(*order_.scale > 0.0)) throw InputError("--scale is metres per unit of the file, above 0");
    if (order_.accuracy_cents && !(*order_.accuracy_cents > 0.0)) throw InputError("--accuracy is in cents, above 0");
    for (const std::string& name : order_.materials) (void)material::MaterialTable::get().require("--material", name);
    (void)material::require_mallet("--mallet", order_.mallet);
  }

  void make_folder() {
    stem_ = clean(is_shape() ? order_.shape : order_.object.stem().string());
    heard_.folder = fs::absolute(order_.out.empty() ? fs::path(stem_ + "-sound") : order_.out);
    std::error_code error;
    fs::create_directories(heard_.folder, error);
    if (error)
      throw SystemError(
          fmt::format("{}: the folder cannot be made: {}; give another one with -o", heard_.folder.string(), error.message()));
  }

  /// What the file holds, and what is taken for granted.
  void look() {
    if (order_.materials.empty()) {
      materials_ = {kDefaultMaterial};
      heard_.assumed.push_back(
          fmt::format("material: {}, since none is given; --material NAME, and `carillon materials` lists them", kDefaultMaterial));
    } else {
      materials_ = order_.materials;
    }
    if (is_shape() || is_mesh()) return;
    say("looking at " + order_.object.filename().string());
    const std::string text = programs_->run("carillon-mesh", {fs::absolute(order_.object).string(), "--look"}, true);
    const base::Document document = base::parse_document(text, "carillon-mesh --look");
    base::Object root = document.root();
    facts_.triangles = root.integer("triangles", 0, std::numeric_limits<long long>::max());
    facts_.parts = root.integer("parts", 0, std::numeric_limits<long long>::max());
    facts_.openings = root.integer("openings", 0, std::numeric_limits<long long>::max());
    facts_.extent = root.numbers<3>("extent");
    facts_.thickness = root.has_number("thickness") ? root.number("thickness") : 0.0;
    if (!order_.wall_m && facts_.openings == 0)
      heard_.assumed.push_back(facts_.thickness > 0.0 ? std::string("body: a closed wall with two sides, as the file has it")
                                                      : std::string("body: solid; --wall T makes it a shell of T metres"));
  }

  std::vector<Wish> list_wishes() {
    std::vector<double> heights = order_.heights_m;
    if (heights.empty()) heights.push_back(0.0);
    std::vector<Wish> wishes;
    const bool has_many_heights = heights.size() > 1;
    for (const std::string& name : materials_)
      for (const double height : heights) {
        Wish wish{.material = &material::MaterialTable::get().find(name)->material, .height_m = height};
        wish.slowness = std::max(height, 1e-9) * std::sqrt(wish.material->density_kg_m3 / wish.material->young_modulus_pa);
        wish.name = fmt::format("{}-{}{}", stem_, clean(wish.material->name), has_many_heights ? fmt::format("-{:g}m", height) : "");
        if (!place_.emplace(wish.name, place_.size()).second) throw InputError(fmt::format("{} is asked for twice", wish.name));
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
    heard_.sounds.push_back(sound);
  }

  /// The bank of a body that was solved, scaled; false where none is like it.
  bool edit(const Wish& wish, const Sound& sound) {
    if (wish.material->orthotropic) return false;
    for (const auto& [solved, bank_file] : solved_) {
      const bool is_scaled = solved.height_m != wish.height_m;
      if (solved.material->orthotropic || (is_scaled && order_.wall_m)) continue;  // the wall stays as thick
      const bank::Bank bank = bank::read_bank(bank_file);
      if (bank::calc_poisson_cents(bank, *wish.material) > kSameCents) continue;
      say(fmt::format("{}: scaled from {}", wish.name, solved.name));
      std::vector<std::string> words{"edit", bank_file.string(), sound.bank.string(), "--material", wish.material->name};
      if (is_scaled) words.insert(words.end(), {"--size", fmt::format("{:.17g}", wish.height_m / solved.height_m)});
      (void)programs_->run("carillon-bank", words, false);
      return true;
    }
    return false;
  }

  void solve(const Wish& wish, const Sound& sound) {
    base::Json job = base::Json::object();
    if (order_.accuracy_cents)
      job.set("body", make_body(wish)).set("accuracy_cents", *order_.accuracy_cents);
    else if (is_mesh())
      job.set("mesh", fs::absolute(order_.object).string()).set("mesh_scale", order_.scale.value_or(1.0));
    else
      job.set("mesh", make_mesh(wish).filename().string());
    job.set("material", wish.material->name).set("bank", sound.bank.filename().string());
    job.set("band_hz", base::Json::array(kBandHz)).set("max_modes", order_.accuracy_cents ? kMaxModes : kPreviewModes);
    const fs::path file = heard_.folder / (wish.name + ".json");
    base::write_file(file, job.text());
    say(fmt::format("{}: finding the modes", wish.name));
    std::vector<std::string> words{file.string()};
    if (!order_.accuracy_cents) words.emplace_back("-q");
    (void)programs_->run("carillon-precompute", words, true, order_.accuracy_cents.has_value());
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
    if (is_mesh()) throw InputError("--accuracy meshes the object again, finer: give its surface, or a finer mesh without --accuracy");
    if (is_shape()) {
      body.set("shape", order_.shape);
      for (const auto& [name, value] : order_.dimensions) body.set(job::find_dimension_key(name), value);
      return body;
    }
    body.set("surface", fs::absolute(order_.object).string()).set("scale", find_scale_of(wish));
    if (order_.wall_m) body.set("wall_m", *order_.wall_m);
    return body;
  }

  /// Of this height; made once.
  fs::path make_mesh(const Wish& wish) {
    if (const auto made = meshes_.find(wish.height_m); made != meshes_.end()) return made->second;
    const fs::path file =
        heard_.folder / fmt::format("{}{}.msh", stem_, order_.heights_m.size() > 1 ? fmt::format("-{:g}m", wish.height_m) : "");
    std::vector<std::string> words;
    std::int64_t nodes = kShapeNodes;
    if (is_shape()) {
      words = {"--shape", order_.shape};
      for (const auto& [name, value] : order_.dimensions) words.insert(words.end(), {"--" + name, fmt::format("{:.17g}", value)});
    } else {
      words = {fs::absolute(order_.object).string(), "--scale", fmt::format("{:.17g}", find_scale_of(wish))};
      if (order_.wall_m) words.insert(words.end(), {"--wall", fmt::format("{:.17g}", *order_.wall_m)});
      nodes = order_.wall_m || facts_.thickness > 0.0 ? kWallNodes : kSolidNodes;
    }
    words.insert(words.end(), {"--order", "2", "-q", "-o", file.string()});
    say(fmt::format("meshing {}", stem_));
    for (bool is_second = false;; is_second = true) {
      std::vector<std::string> all = words;
      all.insert(all.end(), {"--nodes", std::to_string(nodes)});
      try {
        (void)programs_->run("carillon-mesh", all, true);
        break;
      } catch (const CountRefusal& error) {
        if (is_second) throw;
        if (error.get_possible_nodes() > kMaxPreviewNodes)
          throw InputError(
              fmt::format("{} (a preview has {} nodes at most; --accuracy CENTS takes what it needs)", error.what(), kMaxPreviewNodes));
        nodes = error.get_possible_nodes();
      }
    }
    meshes_[wish.height_m] = file;
    return file;
  }

  void play(Sound& sound) {
    const bank::Bank bank = bank::choose_frequencies(bank::read_bank(sound.bank), bank::Frequencies::kCorrected);
    if (bank.mode_count() == 0 || bank.freq_hz(0) > kBandHz[1])
      throw InputError(fmt::format(
          "{}: it has no mode from {:g} to {:g} Hz: it is too small, or too stiff, to be heard; make it larger (--height, --scale)",
          sound.name, kBandHz[0], kBandHz[1]));
    const std::vector<std::size_t> strikes = bank::find_strikes(bank, kStrikes);
    sound.mode_count = bank.mode_count();
    sound.modes = list_modes(bank, strikes.front(), kListed);
    for (const double cents : bank.discretisation_error_cents) sound.worst_cents = std::max(sound.worst_cents, cents);
    Vec3 low = bank.vertices_m.front(), high = low;
    for (const Vec3& x : bank.vertices_m)
      for (int c = 0; c < 3; ++c) low[c] = std::min(low[c], x[c]), high[c] = std::max(high[c], x[c]);
    const Vec3 middle = 0.5 * (low + high), extent = high - low;
    if (heard_.sounds.empty()) heard_.extent_m = {extent[0], extent[1], extent[2]};
    sound.scene = heard_.folder / (sound.name + "-scene.json");
    sound.wav = heard_.folder / (sound.name + ".wav");
    sound.spectrogram = heard_.folder / (sound.name + ".png");
    base::write_file(sound.scene, make_scene(sound, bank, strikes, middle, norm(extent)).text());
    say(fmt::format("{}: playing {} strikes", sound.name, strikes.size()));
    (void)programs_->run("carillon-render",
                         {sound.scene.string(), "-q", "-o", sound.wav.string(), "--spectrogram", sound.spectrogram.string()}, false);
  }

  base::Json make_scene(const Sound& sound, const bank::Bank& bank, const std::vector<std::size_t>& strikes, const Vec3& middle,
                        double size) const {
    const double ring = calc_ring_s(bank, strikes.front()), gap = std::clamp(ring, 0.5, 1.5), begin = 0.05;
    base::Json scene = base::Json::object(), body = base::Json::object(), listener = base::Json::object();
    scene.set("duration_s", begin + gap * static_cast<double>(strikes.size() - 1) + std::clamp(ring, 0.5, 4.0));
    body.set("name", stem_).set("bank", sound.bank.filename().string()).set("fixed", true);
    scene.set("bodies", base::Json::array()).member("bodies").add(body);
    for (std::size_t k = 0; k < strikes.size(); ++k) {
      base::Json strike = base::Json::object();
      strike.set("time_s", begin + gap * static_cast<double>(k)).set("body", stem_);
      strike.set("point_m", base::Json::array(bank.vertices_m[strikes[k]])).set("mallet", order_.mallet);
      scene.member("strikes").add(strike);
    }
    listener.set("position_m", base::Json::array(Vec3{middle[0], middle[1] - std::clamp(2.0 * size, 1.0, 500.0), middle[2]}));
    listener.set("look_at_m", base::Json::array(middle));
    scene.set("listener", listener);
    return scene;
  }

  const Order& order_;
  Clock::time_point start_;
  const process::Programs* programs_ = nullptr;
  std::string stem_;
  SurfaceFacts facts_;
  std::vector<std::string> materials_;
  std::map<double, fs::path> meshes_;              // by height
  std::vector<std::pair<Wish, fs::path>> solved_;  // with their banks
  std::map<std::string, std::size_t> place_;       // in which sounds were asked for
  bool is_size_said_ = false;
  Heard heard_;
};

}  // namespace

Heard hear(const Order& order) { return Listening(order).run(); }

}  // namespace carillon::hear
