#include "runtime/render/labels.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>
#include <utility>

#include "runtime/base/json.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/render/npz.hpp"
#include "runtime/synth/sensor.hpp"

namespace carillon::render {
namespace {

using Column = LabelTable::Column;

/// Fills the columns of a table by name. The first row only makes the columns, so that an empty table has them, too.
class Filler {
 public:
  explicit Filler(std::string name) { table_.name = std::move(name); }

  void put(const char* name, double value) { find<double>(name, 0).push_back(value); }
  void put(const char* name, std::int64_t value) { find<std::int64_t>(name, 0).push_back(value); }
  void put(const char* name, std::uint64_t value) { find<std::uint64_t>(name, 0).push_back(value); }
  template <std::size_t kSize>
  void put(const char* name, const std::array<double, kSize>& values) {
    auto& to = find<double>(name, kSize);
    to.insert(to.end(), values.begin(), values.end());
  }
  void next() { at_ = 0; }
  LabelTable take() {
    for (Column& column : table_.columns)
      std::visit([&](auto& values) { values.erase(values.begin(), values.begin() + std::max<std::ptrdiff_t>(1, column.width)); },
                 column.values);
    return std::move(table_);
  }

 private:
  /// The columns come in the same order in every row.
  template <class T>
  std::vector<T>& find(const char* name, std::size_t width) {
    if (at_ == table_.columns.size()) table_.columns.push_back({name, width, std::vector<T>{}});
    return std::get<std::vector<T>>(table_.columns[at_++].values);
  }

  LabelTable table_;
  std::size_t at_ = 0;
};

/// Mass of a body as a blow at a point feels it [kg]; 0: it cannot move.
double calc_effective_mass(const bank::Bank& bank, bool is_fixed, const Vec3& point_m, const Vec3& along) {
  if (is_fixed || !synth::moves_freely(bank)) return 0.0;
  const Mat3 inertia = make_matrix(bank.rigid.inertia_kg_m2);
  double mobility = 1.0 / bank.rigid.mass_kg;
  if (calc_det(inertia[0], inertia[1], inertia[2]) > 0.0) {
    const Vec3 arm = cross(point_m - bank.rigid.centre_m, along);
    mobility += dot(arm, calc_inverse(inertia) * arm);
  }
  return 1.0 / mobility;
}

/// A blow; a pulse given in pieces is one.
struct Hit {
  events::Impulse blow;
  double begin_s = 0.0, end_s = 0.0, moment_s = 0.0, size_n_s = 0.0;  // moment: of the times, weighted by impulse
};

/// A lasting contact.
struct Interval {
  std::uint64_t id = 0;
  std::int32_t body = 0, other = -1;
  double begin_s = 0.0, end_s = 0.0, peak_n = 0.0;
  bool is_open = true;
};

/// Hits and contacts in the order of their beginnings.
class Collector {
 public:
  explicit Collector(double duration_s) : duration_s_(duration_s) {}

  void take(const events::Impulse& impulse) {
    const double half = 0.5 * impulse.duration_s, size = norm(impulse.impulse_n_s);
    hits.push_back({impulse, impulse.time_s - half, impulse.time_s + half, size * impulse.time_s, size});
  }
  void take(const events::Force& force) {
    const events::Impulse part = events::to_impulse(force);
    const Place place{force.body, force.other, force.triangle, force.barycentric};
    const auto open = pulses_.find(place);
    const double size = norm(part.impulse_n_s), end_s = force.time_s + force.calc_length_s();
    if (!force.continues || open == pulses_.end()) {
      pulses_[place] = hits.size();
      hits.push_back({part, force.time_s, end_s, size * part.time_s, size});
      return;
    }
    Hit& hit = hits[open->second];
    hit.blow.impulse_n_s = hit.blow.impulse_n_s + part.impulse_n_s;
    hit.moment_s += size * part.time_s;
    hit.size_n_s += size;
    hit.end_s = std::max(hit.end_s, end_s);
  }
  /// Both bodies of a contact get records; the first one seen counts.
  void take(const events::LastingContact& contact) {
    auto open = open_.find(contact.id);
    if (open == open_.end() || contact.state == events::ContactState::kBegin) {
      if (open == open_.end() || contact.body == contacts[open->second].body) {
        open = open_.insert_or_assign(contact.id, contacts.size()).first;
        contacts.push_back({contact.id, contact.body, contact.other, contact.time_s, duration_s_});
      }
    }
    Interval& interval = contacts[open->second];
    if (contact.body != interval.body) return;
    interval.peak_n = std::max(interval.peak_n, contact.force_n);
    if (contact.state != events::ContactState::kEnd) return;
    interval.end_s = contact.time_s;
    interval.is_open = false;
  }

  std::vector<Hit> hits;
  std::vector<Interval> contacts;

 private:
  double duration_s_;
  using Place = std::tuple<std::int32_t, std::int32_t, std::int32_t, Vec3>;  // of a force: both bodies, triangle, barycentric
  std::map<Place, std::size_t> pulses_;        // last pulse in pieces: those of simultaneous pulses on a body alternate
  std::map<std::uint64_t, std::size_t> open_;  // last interval, by id
};

void put(Filler& hit, const Hit& at, const Vec3& point_m, double effective_mass_kg, int rate_hz) {
  const double time_s = at.size_n_s > 0.0 ? at.moment_s / at.size_n_s : at.blow.time_s;
  hit.put("time_s", time_s);
  hit.put("frame", static_cast<std::int64_t>(std::llround(time_s * rate_hz)));
  hit.put("begin_s", at.begin_s);
  hit.put("end_s", at.end_s);
  hit.put("body", std::int64_t{at.blow.body});
  hit.put("other", std::int64_t{at.blow.other});
  hit.put("impulse_n_s", at.blow.impulse_n_s);
  hit.put("effective_mass_kg", effective_mass_kg);
  hit.put("triangle", std::int64_t{at.blow.triangle});
  hit.put("barycentric", at.blow.barycentric);
  hit.put("point_m", point_m);
  hit.next();
}

LabelTable list_hits(const std::vector<Hit>& hits, const scene::Scene& scene, const std::vector<const bank::Bank*>& banks) {
  Filler hit("hit");
  put(hit, {}, {}, 0.0, scene.sample_rate_hz);
  for (const Hit& at : hits) {
    const bank::Bank& bank = *banks[at.blow.body];
    const double size = norm(at.blow.impulse_n_s);
    const bool is_on_surface = at.blow.triangle >= 0 && at.blow.triangle < std::ssize(bank.triangles);
    const Vec3 point = is_on_surface ? bank::calc_point(bank, at.blow.triangle, at.blow.barycentric) : Vec3{};
    const bool is_fixed = scene.bodies[at.blow.body].spec.fixed;
    put(hit, at, point, size > 0.0 ? calc_effective_mass(bank, is_fixed, point, (1.0 / size) * at.blow.impulse_n_s) : 0.0,
        scene.sample_rate_hz);
  }
  return hit.take();
}

void put(Filler& contact, const Interval& at, int rate_hz) {
  contact.put("id", at.id);
  contact.put("body", std::int64_t{at.body});
  contact.put("other", std::int64_t{at.other});
  contact.put("begin_s", at.begin_s);
  contact.put("end_s", at.end_s);
  contact.put("begin_frame", static_cast<std::int64_t>(std::llround(at.begin_s * rate_hz)));
  contact.put("end_frame", static_cast<std::int64_t>(std::llround(at.end_s * rate_hz)));
  contact.put("peak_force_n", at.peak_n);
  contact.put("is_open", std::int64_t{at.is_open});
  contact.next();
}

LabelTable list_contacts(const std::vector<Interval>& contacts, int rate_hz) {
  Filler contact("contact");
  put(contact, {}, rate_hz);
  for (const Interval& at : contacts) put(contact, at, rate_hz);
  return contact.take();
}

void put(Filler& touch, const events::LastingContact& contact) {
  touch.put("time_s", contact.time_s);
  touch.put("id", contact.id);
  touch.put("body", std::int64_t{contact.body});
  touch.put("other", std::int64_t{contact.other});
  touch.put("force_n", contact.force_n);
  touch.put("slip_m_s", contact.slip_m_s);
  touch.put("normal", contact.normal);
  touch.put("sweep_m_s", contact.sweep_m_s);
  touch.put("triangle", std::int64_t{contact.triangle});
  touch.put("barycentric", contact.barycentric);
  touch.next();
}

void put(Filler& pose, const events::BodyMotion& motion) {
  pose.put("time_s", motion.time_s);
  pose.put("body", std::int64_t{motion.body});
  pose.put("position_m", motion.position_m);
  pose.put("velocity_m_s", motion.velocity_m_s);
  pose.put("rotation", motion.rotation);
  pose.next();
}

template <class T>
std::string_view view_bytes(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

std::size_t count_rows(const Column& column) {
  return std::visit([&](const auto& values) { return values.size() / std::max<std::size_t>(1, column.width); }, column.values);
}

/// A row of a column as JSON.
std::string write_row(const Column& column, std::size_t row) {
  return std::visit(
      [&](const auto& values) {
        if (column.width == 0) return fmt::format("{}", values[row]);
        std::string text;
        for (std::size_t k = 0; k < column.width; ++k) text += fmt::format("{}{}", k == 0 ? "" : ", ", values[row * column.width + k]);
        return "[" + text + "]";
      },
      column.values);
}

}  // namespace

Labels make_labels(const scene::Scene& scene, const std::vector<const bank::Bank*>& banks, const scene::Events& events,
                   const ModalEnergies& energies) {
  Labels labels;
  labels.rate_hz = scene.sample_rate_hz;
  labels.frames = count_frames(scene.duration_s, scene.sample_rate_hz);
  for (const scene::SceneBody& body : scene.bodies) labels.bodies.push_back(body.name);
  Collector collector(scene.duration_s);
  Filler touch("touch"), pose("pose");
  put(touch, events::LastingContact{});
  put(pose, events::BodyMotion{});
  const auto is_known = [&](std::int32_t body) { return body >= 0 && body < std::ssize(banks); };
  events.for_each([&](const events::Event& event) {
    if (const auto* impulse = std::get_if<events::Impulse>(&event); impulse != nullptr && is_known(impulse->body)) collector.take(*impulse);
    if (const auto* force = std::get_if<events::Force>(&event); force != nullptr && is_known(force->body)) collector.take(*force);
    if (const auto* contact = std::get_if<events::LastingContact>(&event)) {
      collector.take(*contact);
      put(touch, *contact);
    }
    if (const auto* motion = std::get_if<events::BodyMotion>(&event)) put(pose, *motion);
  });
  labels.tables.push_back(list_hits(collector.hits, scene, banks));
  labels.tables.push_back(list_contacts(collector.contacts, scene.sample_rate_hz));
  labels.tables.push_back(touch.take());
  labels.tables.push_back(pose.take());
  labels.tables.push_back({"energy", {{"time_s", 0, energies.time_s}, {"modes_j", scene.bodies.size(), energies.modes_j}}});
  return labels;
}

void write_npz(const Labels& labels, const std::function<void(std::string_view)>& sink) {
  NpzWriter npz(sink);
  npz.add("rate_hz", "<i8", {}, view_bytes(std::vector<std::int64_t>{labels.rate_hz}));
  npz.add("frames", "<i8", {}, view_bytes(std::vector<std::uint64_t>{labels.frames}));
  std::size_t longest = 1;
  for (const std::string& name : labels.bodies) longest = std::max(longest, name.size());
  std::string names;
  for (const std::string& name : labels.bodies) names += name + std::string(longest - name.size(), '\0');
  npz.add("bodies", fmt::format("|S{}", longest), {labels.bodies.size()}, names);
  for (const LabelTable& table : labels.tables) {
    for (const Column& column : table.columns) {
      std::vector<std::size_t> shape{count_rows(column)};
      if (column.width > 0) shape.push_back(column.width);
      constexpr const char* kTypes[] = {"<f8", "<i8", "<u8"};
      std::visit(
          [&](const auto& values) { npz.add(table.name + "." + column.name, kTypes[column.values.index()], shape, view_bytes(values)); },
          column.values);
    }
  }
  npz.finish();
}

void write_jsonl(const Labels& labels, const std::function<void(std::string_view)>& sink) {
  base::Json head = base::Json::object();
  head.set("carillon_labels", 1);
  head.set("rate_hz", labels.rate_hz);
  head.set("frames", static_cast<long long>(labels.frames));
  head.set("bodies", base::Json::array(labels.bodies));
  sink(head.line() + "\n");
  for (const LabelTable& table : labels.tables) {
    const std::size_t rows = table.columns.empty() ? 0 : count_rows(table.columns.front());
    for (std::size_t row = 0; row < rows; ++row) {
      std::string line;
      for (const Column& column : table.columns)
        line += fmt::format("{}\"{}\": {}", line.empty() ? "" : ", ", column.name, write_row(column, row));
      sink(fmt::format("{{\"{}\": {{{}}}}}\n", table.name, line));
    }
  }
}

}  // namespace carillon::render
