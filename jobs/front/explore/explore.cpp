// Method:     Banks become a scene; carillon-render checks and simulates it and records its contacts; the folder gets scene, contacts,
//             banks, page and sound engine, and explore.json, which connects them. For a silent scene a probe with a blow on each body
//             determines the gain.
// Source:     van den Doel and Pai 1996 (Sonic Explorer).
#include "jobs/front/explore/explore.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "jobs/front/explore/files.hpp"
#include "jobs/front/explore/names.hpp"
#include "jobs/front/report/record.hpp"
#include "jobs/store/process/programs.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/bank/blows.hpp"
#include "runtime/bank/pack.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/bank/write.hpp"
#include "runtime/base/command.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/base/version.hpp"
#include "runtime/material/table.hpp"
#include "runtime/scene/job_keys.hpp"

namespace carillon::explore {
namespace {

namespace fs = std::filesystem;

struct BankFacts {
  PageBank kept;
  Vec3 low_m{}, high_m{};        // bounding box of the surface, in the frame of the mesh
  std::string material, group;   // nearest row of the material table, and its group
  Vec3 loudest_m{};              // vertex with the loudest response
  std::array<int, 2> loudest{};  // the same vertex as triangle and corner
};

/// Puts banks into a folder, each once. Large ones are packed without renumbering triangles, which recorded contacts refer to.
class PageBanks {
 public:
  /// `keeps_all`: copies all banks unchanged.
  PageBanks(std::filesystem::path folder, bool keeps_all) : folder_(std::move(folder)), keeps_all_(keeps_all) {}

  /// InputError for invalid banks and banks without modes.
  const BankFacts& add(const std::filesystem::path& file);
  /// In the order of add().
  std::vector<PageBank> list() const;

 private:
  std::filesystem::path folder_;
  bool keeps_all_;
  std::map<std::filesystem::path, BankFacts> facts_;
  std::vector<const BankFacts*> order_;
};

const material::Row* find_nearest(const material::MaterialTable& table, const bank::Material& material) {
  const material::Row* nearest = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const material::Row& row : table.rows()) {
    const double off = std::abs(std::log(row.material.young_modulus_pa / material.young_modulus_pa)) +
                       2.0 * std::abs(std::log(row.material.density_kg_m3 / material.density_kg_m3));
    if (off < least) least = off, nearest = &row;
  }
  return nearest;
}

/// The material for the look of the body: that of the job, else one in the file name ("shelf_wood"), else the table row with the nearest
/// stiffness and density.
void find_material(const bank::Bank& bank, const fs::path& file, BankFacts& facts) {
  const material::MaterialTable& table = material::MaterialTable::get();
  const base::Json job = report::parse_json(bank.provenance);
  const base::Json& given = job["material"];
  const material::Row* row = nullptr;
  if (given.is_string()) row = table.find(given.as_string());
  if (given.is_object() && given["name"].is_string()) row = table.find(given["name"].as_string());
  std::string word;
  for (const char c : file.stem().string() + " ") {
    if (std::isalpha(static_cast<unsigned char>(c)) != 0) {
      word += c;
      continue;
    }
    if (row == nullptr && !word.empty()) row = table.find(word);
    for (const material::Row& one : table.rows())
      if (row == nullptr && one.group == word) facts.group = word;
    word.clear();
  }
  if (row == nullptr && facts.group.empty()) row = find_nearest(table, bank.material);
  if (row == nullptr) return;
  facts.material = row->material.name;
  facts.group = row->group;
}

void find_place(const bank::Bank& bank, BankFacts& facts) {
  const auto [low, high] = bank::find_extent(bank.vertices_m);
  facts.low_m = low;
  facts.high_m = high;
  const std::size_t vertex = bank::find_strikes(bank, 1).front();
  facts.loudest_m = bank.vertices_m[vertex];
  for (std::size_t t = 0; t < bank.triangles.size(); ++t)
    for (int corner = 0; corner < 3; ++corner)
      if (static_cast<std::size_t>(bank.triangles[t][corner]) == vertex) {
        facts.loudest = {static_cast<int>(t), corner};
        return;
      }
}

const BankFacts& PageBanks::add(const fs::path& file) {
  const fs::path whole = fs::weakly_canonical(file);
  if (const auto found = facts_.find(whole); found != facts_.end()) return found->second;
  const bank::Bank bank = bank::read_bank(file);
  if (bank.mode_count() == 0) throw InputError(fmt::format("{}: the bank has no modes, so it has no sound", file.string()));
  BankFacts facts;
  find_material(bank, file, facts);
  find_place(bank, facts);
  facts.kept.full_bytes = fs::file_size(file);
  facts.kept.original = whole;
  std::set<std::string> taken;
  for (const BankFacts* other : order_) taken.insert(other->kept.name);
  const std::string stem = make_name(file.stem().string());
  facts.kept.name = stem + ".hdf";
  for (int k = 2; taken.contains(facts.kept.name); ++k) facts.kept.name = fmt::format("{}-{}.hdf", stem, k);
  const fs::path target = folder_ / facts.kept.name;
  std::string why;
  std::optional<bank::PackedBank> packed;
  if (!keeps_all_) packed = bank::try_packed(bank, why);
  if (packed) {
    bank::write_packed_bank(*packed, target);
    facts.kept.change = "packed, " + bank::describe(*packed->bank.packing);
  } else {
    put_file(file, target);
  }
  facts.kept.bytes = fs::file_size(target);
  const BankFacts& kept = facts_.emplace(whole, std::move(facts)).first->second;
  order_.push_back(&kept);
  return kept;
}

std::vector<PageBank> PageBanks::list() const {
  std::vector<PageBank> banks;
  for (const BankFacts* facts : order_) banks.push_back(facts->kept);
  return banks;
}

constexpr double kGap = 0.25;      // gap between neighbours / mean width
constexpr double kView = 1.6;      // distance of the listener / diagonal of the row
constexpr double kNearestM = 0.3;  // minimum distance of the listener
constexpr double kStrikeS = 0.15;  // interval between blows of the probe
constexpr const char* kMallet = "hard-wood";

base::Json to_json(const Vec3& v) {
  base::Json list = base::Json::array();
  for (const double x : v) list.append(x);
  return list;
}

/// Bounding box of the surface in world axes, relative to the origin of the mesh.
struct Box {
  Vec3 low, high;
};
Box find_box(const BankFacts& facts, Up up) {
  const Vec3 &low = facts.low_m, &high = facts.high_m;
  if (up == Up::kZ) return {low, high};
  return {{low[0], -high[2], low[1]}, {high[0], -low[2], high[1]}};  // rotation by 90 degrees about x
}

/// Bodies in a row along x on the ground, and a listener in front of them. `names` and `facts`: one entry per body.
base::Json make_row(const std::vector<std::filesystem::path>& files, const std::vector<const BankFacts*>& facts, Up up) {
  base::Json scene = base::Json::object();
  scene["duration_s"] = 1.0;
  std::set<std::string> taken;
  double x = 0.0, height = 0.0, depth = 0.0, last = 0.0;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const Box box = find_box(*facts[i], up);
    const double width = box.high[0] - box.low[0];
    if (i > 0) x += kGap * 0.5 * (width + last);
    base::Json body = base::Json::object();
    const std::string stem = cut_name(files[i].stem().string());
    std::string name = stem;
    for (int k = 2; !taken.insert(name).second; ++k) name = fmt::format("{} {}", stem, k);
    body.set("name", name).set("bank", files[i].string()).set("fixed", true);
    body.set("position_m", to_json({x - box.low[0], -0.5 * (box.low[1] + box.high[1]), -box.low[2]}));
    if (up == Up::kY) body["rotation_deg"] = to_json({90.0, 0.0, 0.0});
    scene["bodies"].append(body);
    x += width;
    last = width;
    height = std::max(height, box.high[2] - box.low[2]);
    depth = std::max(depth, box.high[1] - box.low[1]);
  }
  const double away = std::max(kNearestM, kView * std::hypot(x, height, depth));
  scene["listener"]["position_m"] = to_json({0.5 * x, -0.94 * away, 0.5 * height + 0.34 * away});
  scene["listener"]["look_at_m"] = to_json({0.5 * x, 0.0, 0.5 * height});
  return scene;
}

/// The scene with all bodies fixed and, instead of its events, one blow on each at its loudest point. `files`: banks of its bodies.
base::Json make_probe(base::Json scene, const std::vector<std::filesystem::path>& files, const std::vector<const BankFacts*>& facts) {
  for (const char* happening : {"strikes", "joints", "cords", "gravity_m_s2", "variation"}) scene.erase(happening);
  double time_s = 0.05;
  for (std::size_t i = 0; i < scene["bodies"].size(); ++i) {
    base::Json& body = scene["bodies"][i];
    body.set("fixed", true).set("bank", files[i].string());
    for (const char* motion : {"velocity_m_s", "angular_velocity_rad_s"}) body.erase(motion);
    base::Json strike = base::Json::object();
    strike.set("time_s", time_s).set("body", body["name"]).set("point_m", to_json(facts[i]->loudest_m)).set("mallet", kMallet);
    scene["strikes"].append(strike);
    time_s += kStrikeS;
  }
  scene["duration_s"] = time_s;
  return scene;
}

constexpr int kVersion = 1;  // of explore.json
constexpr std::uint64_t kMaxSceneBytes = 16 << 20, kMaxTrajectoryBytes = std::uint64_t{1} << 30;
constexpr const char *kAboutFile = "explore.json", *kSceneFile = "scene.json", *kContactsFile = "contacts.jsonl",
                     *kPackedContactsFile = "contacts.jsonl.gz", *kBankFolder = "banks";
constexpr double kProbeGain = 0.35;  // fraction of the full-scale gain of the probe: headroom for harder strikes

bool is_bank(const fs::path& file) {
  std::array<char, 13> begin{};
  std::FILE* in = std::fopen(file.c_str(), "rb");
  if (in == nullptr) return false;
  const std::size_t read = std::fread(begin.data(), 1, begin.size(), in);
  std::fclose(in);
  return std::string_view(begin.data(), read) == "CARILLON BANK";
}

/// The output folder. InputError if it holds other content.
fs::path find_place(const PageOrder& order) {
  fs::path folder = order.folder;
  if (folder.empty()) folder = make_name(fs::absolute(order.subjects.front()).stem().string()) + "-explore";
  folder = fs::absolute(folder).lexically_normal();
  if (folder.filename().empty()) folder = folder.parent_path();
  std::error_code error;
  if (!fs::exists(folder, error) || is_explorer(folder) || (fs::is_directory(folder, error) && fs::is_empty(folder, error))) return folder;
  throw InputError(fmt::format("{}: this folder was not made by carillon explore; give another one with -o", folder.string()));
}

fs::path find_page() { return base::find_data_folder("explore", "install Carillon with its page, or build it where npm is installed"); }
fs::path find_engine() {
  return base::find_data_folder("web", "install Carillon with its page, or build it where emscripten is installed");
}

fs::path find_world() {
  return base::find_data_folder("world", "install Carillon with its page, or build it where emscripten is installed");
}

/// Default title; for "scene.json" the name of its folder.
std::string find_title(const PageOrder& order) {
  if (!order.title.empty()) return order.title;
  const fs::path first = fs::absolute(order.subjects.front());
  if (order.subjects.size() > 1) return fmt::format("{} and {} more", first.stem().string(), order.subjects.size() - 1);
  return first.filename() == "scene.json" ? first.parent_path().filename().string() : first.stem().string();
}

/// Removes effects from a key "effects" of any form: a list, {"on": [...], "off": [...]}, {"head": true}.
void remove_effects(base::Json& owner, const std::vector<std::string>& names) {
  if (!owner.is_object() || !owner.has("effects")) return;
  base::Json& effects = owner["effects"];
  const auto take_from = [&](base::Json& list) {
    if (!list.is_array()) return;
    base::Json kept = base::Json::array();
    for (const base::Json& one : list)
      if (!one.is_string() || std::find(names.begin(), names.end(), one.as_string()) == names.end()) kept.append(one);
    list = kept;
  };
  take_from(effects);
  if (!effects.is_object()) return;
  for (const char* key : {"on", "off"})
    if (effects.has(key)) take_from(effects[key]);
  for (const std::string& name : names) effects.erase(name);
}

/// The same for a scene and each of its bodies.
void remove_effects_of_all(base::Json& scene, const std::vector<std::string>& names) {
  remove_effects(scene, names);
  for (base::Json& body : scene["bodies"]) remove_effects(body, names);
}

/// Removes the head or the Ambisonics of a listener (the sound engine has neither). True if there was one.
bool take_head(base::Json& scene) {
  if (!scene.has("listener")) return false;
  base::Json& listener = scene["listener"];
  const base::Json& ears = std::as_const(listener)["ears"];
  const bool has_head = ears.is_string() && ears.as_string() != "free";
  listener.erase("ears");
  listener.erase("sofa");
  listener.erase("order");
  if (has_head) remove_effects_of_all(scene, {"head"});
  return has_head;
}

/// True if a body has a description instead of a bank. False for invalid scenes, which carillon-render reports.
bool has_described_body(const base::Json& scene) {
  const base::Json bodies = scene.is_object() ? scene["bodies"] : base::Json();
  return bodies.is_array() &&
         std::any_of(bodies.begin(), bodies.end(), [](const base::Json& body) { return body.is_object() && !body.has("bank"); });
}

/// InputError for recorded surfaces, which have no modes.
void refuse_recordings(const base::Json& scene, const fs::path& file) {
  const base::Json bodies = scene.is_object() ? scene["bodies"] : base::Json();
  if (!bodies.is_array()) return;
  for (const base::Json& body : bodies)
    if (body.is_object() && body.has("recording"))
      throw InputError(fmt::format("{}: a body is a recording, which pages cannot play; remove it, or play the scene with carillon-render",
                                   file.string()));
}

/// Sets the banks of described bodies from the trajectory of carillon-render.
void name_banks(base::Json& scene, const base::Json& trajectory) {
  for (std::size_t i = 0; i < scene["bodies"].size(); ++i) {
    base::Json& body = scene["bodies"][i];
    if (body.has("bank")) continue;
    for (const char* key : scene::kJobKeys) body.erase(key);
    body["bank"] = trajectory["bodies"][i]["bank"];
  }
}

class Work {
 public:
  explicit Work(const PageOrder& order)
      : order_(order),
        page_(find_page()),
        engine_(find_engine()),
        world_(find_world()),
        place_(find_place(order)),
        folder_(place_),
        banks_(folder_.path() / kBankFolder, order.keeps_banks),
        programs_(true) {}

  Explored run() {
    fs::create_directory(folder_.path() / kBankFolder);
    read_subject();
    const double gain = find_gain();
    write(gain);
    done_.folder = place_;
    done_.banks = banks_.list();
    done_.bytes = calc_bytes(folder_.path());
    folder_.commit();
    return std::move(done_);
  }

 private:
  fs::path path(const char* name) const { return folder_.path() / name; }

  void read_subject() {
    const auto is_all = [&](auto&& test) { return std::all_of(order_.subjects.begin(), order_.subjects.end(), test); };
    std::error_code error;
    for (const fs::path& subject : order_.subjects)
      if (!fs::is_regular_file(subject, error)) throw InputError(fmt::format("{}: no such file; give banks or a scene", subject.string()));
    if (is_all(is_bank) || order_.subjects.size() > 1) {
      for (const fs::path& subject : order_.subjects) add_bank(subject);
      scene_ = make_row(files_, facts_, order_.up);
      return;
    }
    const fs::path& file = order_.subjects.front();
    scene_ = record(file);
    for (const base::Json& body : scene_["bodies"]) add_bank(fs::absolute(file).parent_path() / body["bank"].as_string());
  }

  void add_bank(const fs::path& file) {
    const BankFacts& facts = banks_.add(file);
    files_.push_back(fs::absolute(file));
    facts_.push_back(&facts);
  }

  /// Checks and simulates a scene file and keeps its contacts. Returns the scene with the bank of each body.
  base::Json record(const fs::path& file) {
    base::Json scene = report::parse_json(base::read_file(file, "scene", kMaxSceneBytes));
    refuse_recordings(scene, file);
    const fs::path trajectory = path(".trajectory.json");
    std::vector<std::string> words{"--record", path(kContactsFile).string()};
    const bool lacks_bank = has_described_body(scene);
    if (lacks_bank) words.insert(words.end(), {"--trajectory", trajectory.string()});
    report_ = render(file, words);
    if (lacks_bank) {
      name_banks(scene, report::parse_json(base::read_file(trajectory, "trajectory of carillon-render", kMaxTrajectoryBytes)));
      fs::remove(trajectory);
    }
    done_.duration_s = report_["duration_s"].as_double();
    for (const base::Json& warning : report_["warnings"]) done_.warnings.push_back(warning.as_string());
    for (const std::string& note : programs_.get_notes())
      if (std::find(done_.warnings.begin(), done_.warnings.end(), note) == done_.warnings.end()) done_.warnings.push_back(note);
    if (take_head(scene)) done_.warnings.emplace_back("listener: pages have no heads; the ears of this one are in free field");
    done_.has_recording = report_["peak_pa"].is_number() && report_["peak_pa"].as_double() > 0.0;
    std::error_code error;
    if (done_.has_recording)
      compress_file(path(kContactsFile));
    else
      fs::remove(path(kContactsFile), error);
    return scene;
  }

  /// The report of carillon-render on a scene file.
  base::Json render(const fs::path& scene, std::vector<std::string> words) {
    const fs::path sound = path(".sound.wav"), report = path(".report.json");
    words.insert(words.begin(), {fs::absolute(scene).string(), "-q", "-o", sound.string(), "--report", report.string()});
    (void)programs_.run("carillon-render", words, false);
    base::Json root = report::parse_json(base::read_file(report, "report of carillon-render", kMaxSceneBytes));
    std::error_code error;
    fs::remove(sound, error);
    fs::remove(report, error);
    return root;
  }

  /// Full scale per pascal.
  double find_gain() {
    if (done_.has_recording) return report_["gain_per_pa"].as_double();
    const fs::path probe = path(".probe.json");
    base::write_file(probe, to_text(make_probe(scene_, files_, facts_)));
    report_ = render(probe, {});
    std::error_code error;
    fs::remove(probe, error);
    return kProbeGain * report_["gain_per_pa"].as_double();
  }

  void write(double gain) {
    base::Json about = base::Json::object();
    about.set("carillon_explore", kVersion).set("made_by", base::describe("carillon")).set("title", find_title(order_));
    about.set("scene", kSceneFile).set("contacts", done_.has_recording ? base::Json(kPackedContactsFile) : base::Json());
    about.set("duration_s", done_.duration_s).set("gain_per_pa", gain);
    for (std::size_t i = 0; i < scene_["bodies"].size(); ++i) {
      const BankFacts& facts = *facts_[i];
      scene_["bodies"][i]["bank"] = fmt::format("{}/{}", kBankFolder, facts.kept.name);
      base::Json body = base::Json::object();
      body.set("bank_bytes", facts.kept.bytes).set("full_bytes", facts.kept.full_bytes);
      body.set("change", facts.kept.change.empty() ? base::Json() : base::Json(facts.kept.change)).set("material", facts.material);
      body.set("group", facts.group);
      body["loudest"].set("triangle", facts.loudest[0]).set("corner", facts.loudest[1]);
      if (done_.has_recording) body["effects"] = report_["per_body"][i]["effects"];
      about["bodies"].append(body);
    }
    remove_effects_of_all(scene_,
                          {"head", "nonlinear", "cascade", "directivity", "ground_reflection"});  // not supported by the sound engine
    base::write_file(path(kSceneFile), to_text(scene_));
    base::write_file(path(kAboutFile), to_text(about));
    put_folder(page_, folder_.path());
    put_folder(engine_, folder_.path() / "audio");
    put_folder(world_, folder_.path() / "audio");
  }

  const PageOrder& order_;
  fs::path page_, engine_, world_, place_;
  base::WholeFolder folder_;
  PageBanks banks_;
  process::Programs programs_;
  base::Json scene_, report_;
  std::vector<fs::path> files_;          // banks, per body
  std::vector<const BankFacts*> facts_;  // per body
  Explored done_;
};

}  // namespace

Explored explore(const PageOrder& order) {
  if (order.subjects.empty()) throw InputError("give banks or a scene");
  return Work(order).run();
}

bool is_installed() {
  try {
    (void)find_page();
    (void)find_engine();
    (void)find_world();
  } catch (const SystemError&) {
    return false;
  }
  return true;
}

bool is_explorer(const fs::path& folder) {
  std::error_code error;
  return fs::is_regular_file(folder / kAboutFile, error) && fs::is_regular_file(folder / "index.html", error);
}

}  // namespace carillon::explore
