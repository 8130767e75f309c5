// Method: one JSON object per line, editable as text; numbers in the shortest form that reads back as the same double.
// Source: jsonlines.org for lines; Steele and White (1990) for the shortest form (in fmt, by Dragonbox).
// Deviations: the first line is a header.
#include "runtime/events/file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>
#include <variant>

#include "runtime/base/document.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/foreign.hpp"
#include "runtime/base/printable.hpp"

namespace carillon::events {
namespace {

constexpr std::size_t kMaxLineBytes = 256u << 20;  // more than a header of kMaxBodies
constexpr std::size_t kReadBytes = 1u << 18;       // read size
constexpr double kMaxBackS = 1.0;                  // s
constexpr double kMaxPulseS = 10.0;                // s
constexpr double kMaxAmount = 1e9;                 // limit of other amounts in SI units: prevents overflow
constexpr long long kMaxBodies = 1 << 20;          // above all scenes
constexpr long long kInt32 = std::numeric_limits<std::int32_t>::max();
constexpr long long kInt64 = std::numeric_limits<std::int64_t>::max();
const std::vector<std::string> kShapeNames{"hertz", "gaussian"};     // indexed by PulseShape
const std::vector<std::string> kStateNames{"begin", "hold", "end"};  // indexed by ContactState

using Out = std::back_insert_iterator<std::string>;

/// Keeps sign and decimal point or exponent, so that -0.0 is not read as an integer.
std::string format_number(double x) {
  std::string text = fmt::format("{}", x);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

template <std::size_t n>
std::string format_numbers(const std::array<double, n>& x) {
  std::string text = "[";
  for (const double value : x) text += (text.size() > 1 ? ", " : "") + format_number(value);
  return text + "]";
}

/// Shortest text that reads back, through a double, as the same float; nearly always that of the float.
std::string format_number(float x) {
  std::string text = fmt::format("{}", x);
#if defined(__EMSCRIPTEN__)  // no floating-point from_chars; single locale
  const double read = std::strtod(text.c_str(), nullptr);
#else
  double read = 0.0;
  std::from_chars(text.data(), text.data() + text.size(), read);
#endif
  if (static_cast<float>(read) != x) return format_number(static_cast<double>(x));
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

void write(Out out, const TimeWatermark& e) { fmt::format_to(out, R"({{"mark": {{"time_s": {}}}}})", format_number(e.time_s)); }

void write(Out out, const Impulse& e) {
  fmt::format_to(out, R"({{"impulse": {{"time_s": {}, "body": {}, "other": {}, "triangle": {}, "barycentric": {}, )",
                 format_number(e.time_s), e.body, e.other, e.triangle, format_numbers(e.barycentric));
  fmt::format_to(out, R"("impulse_n_s": {}, "duration_s": {}, "shape": "{}"}}}})", format_numbers(e.impulse_n_s),
                 format_number(e.duration_s), kShapeNames[static_cast<std::size_t>(e.shape)]);
}

void write(Out out, const Force& e) {
  fmt::format_to(out, R"({{"force": {{"time_s": {}, "step_s": {}, "body": {}, "other": {}, "triangle": {}, "barycentric": {}, )",
                 format_number(e.time_s), format_number(e.step_s), e.body, e.other, e.triangle, format_numbers(e.barycentric));
  if (e.continues) fmt::format_to(out, R"("continues": true, )");
  fmt::format_to(out, R"("impulse_n_s": [)");
  for (int k = 0; k < e.count; ++k) {
    const auto& [x, y, z] = e.impulse_n_s[k];
    fmt::format_to(out, "{}[{}, {}, {}]", k > 0 ? ", " : "", format_number(x), format_number(y), format_number(z));
  }
  fmt::format_to(out, "]}}}}");
}

void write(Out out, const LastingContact& e) {
  fmt::format_to(out, R"({{"contact": {{"time_s": {}, "id": {}, "body": {}, "other": {}, "triangle": {}, "state": "{}", )",
                 format_number(e.time_s), e.id, e.body, e.other, e.triangle, kStateNames[static_cast<std::size_t>(e.state)]);
  fmt::format_to(out, R"("barycentric": {}, "normal": {}, "slip_m_s": {}, "force_n": {}, )", format_numbers(e.barycentric),
                 format_numbers(e.normal), format_numbers(e.slip_m_s), format_number(e.force_n));
  fmt::format_to(out, R"("sweep_m_s": {}, "other_sweep_m_s": {}, "spin_rad_s": {}, "patch_radius_m": {})", format_number(e.sweep_m_s),
                 format_number(e.other_sweep_m_s), format_number(e.spin_rad_s), format_number(e.patch_radius_m));
  if (e.impedance_n_s_m != LastingContact::kByMaterial) fmt::format_to(out, R"(, "impedance_n_s_m": {})", format_number(e.impedance_n_s_m));
  fmt::format_to(out, "}}}}");
}

template <class Moving>
void write_moving(Out out, const Moving& e) {
  fmt::format_to(out, R"("position_m": {}, "velocity_m_s": {}, "rotation": {}}}}})", format_numbers(e.position_m),
                 format_numbers(e.velocity_m_s), format_numbers(e.rotation));
}

void write(Out out, const BodyMotion& e) {
  fmt::format_to(out, R"({{"motion": {{"time_s": {}, "body": {}, )", format_number(e.time_s), e.body);
  if (e.cut) fmt::format_to(out, R"("cut": true, )");
  write_moving(out, e);
}

void write(Out out, const Listener& e) {
  fmt::format_to(out, R"({{"listener": {{"time_s": {}, )", format_number(e.time_s));
  write_moving(out, e);
}

/// Reads the keys of `Event`; the caller calls finish().
class EventReader {
 public:
  EventReader(base::Object object, const std::vector<RecordedBody>& bodies) : in_(std::move(object)), bodies_(bodies) {}

  TimeWatermark read_mark() { return finish(TimeWatermark{in_.number("time_s")}); }

  Impulse read_impulse() {
    Impulse e;
    read_place(e);
    e.impulse_n_s = in_.numbers<3>("impulse_n_s");
    e.duration_s = in_.number("duration_s");
    check_size("impulse_n_s", e.impulse_n_s);
    check_size("duration_s", e.duration_s, kMaxPulseS);
    e.shape = static_cast<PulseShape>(find(kShapeNames, in_.choice_or("shape", kShapeNames, kShapeNames.front())));
    return finish(e);
  }

  Force read_force() {
    Force e;
    read_place(e);
    e.step_s = in_.number("step_s");
    e.continues = in_.boolean_or("continues", false);
    check_size("step_s", e.step_s, kMaxPulseS / kMaxForceSteps);
    for (const std::vector<double>& row : in_.number_rows("impulse_n_s", 3, kMaxForceSteps)) {
      auto& sample = e.impulse_n_s[e.count++];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        check_size("impulse_n_s", row[axis]);
        sample[axis] = static_cast<float>(row[axis]);
      }
    }
    return finish(e);
  }

  LastingContact read_contact() {
    LastingContact e;
    read_place(e);
    e.id = static_cast<std::uint64_t>(in_.integer("id", 0, kInt64));
    e.state = static_cast<ContactState>(find(kStateNames, in_.choice("state", kStateNames)));
    e.normal = in_.numbers<3>("normal");
    e.slip_m_s = in_.numbers<3>("slip_m_s");
    e.force_n = in_.number("force_n");
    e.sweep_m_s = in_.number("sweep_m_s");
    e.other_sweep_m_s = in_.number("other_sweep_m_s");
    e.spin_rad_s = in_.number("spin_rad_s");
    e.patch_radius_m = in_.number("patch_radius_m");
    if (in_.has("impedance_n_s_m")) {
      e.impedance_n_s_m = in_.number("impedance_n_s_m");
      check_size("impedance_n_s_m", e.impedance_n_s_m);
      if (e.impedance_n_s_m < 0.0) in_.fail("impedance_n_s_m", "is negative");
    }
    check_size("slip_m_s", e.slip_m_s);
    check_size("force_n", e.force_n);
    check_size("sweep_m_s", e.sweep_m_s);
    check_size("other_sweep_m_s", e.other_sweep_m_s);
    check_size("spin_rad_s", e.spin_rad_s);
    check_size("patch_radius_m", e.patch_radius_m);
    return finish(e);
  }

  BodyMotion read_motion() {
    BodyMotion e;
    e.body = read_body("body", 0);
    e.cut = in_.boolean_or("cut", false);
    read_moving(e);
    return finish(e);
  }

  Listener read_listener() {
    Listener e;
    read_moving(e);
    return finish(e);
  }

 private:
  static std::ptrdiff_t find(const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) - names.begin();
  }

  std::int32_t read_body(std::string_view key, long long lowest) {
    const long long body = in_.integer(key, lowest, kInt32);
    if (body >= static_cast<long long>(bodies_.size())) {
      in_.fail(key, fmt::format("there is no body {}; the first line names {}, counted from 0", body, bodies_.size()));
    }
    return static_cast<std::int32_t>(body);
  }

  template <class Touching>
  void read_place(Touching& e) {
    e.time_s = in_.number("time_s");
    e.body = read_body("body", 0);
    e.other = in_.has("other") ? read_body("other", -1) : -1;
    const long long triangle = in_.integer("triangle", 0, kInt32);
    const RecordedBody& body = bodies_[e.body];
    if (triangle >= body.triangles) {
      in_.fail("triangle",
               fmt::format("the bank of \"{}\" has {} triangles, counted from 0, and no triangle {}", body.name, body.triangles, triangle));
    }
    e.triangle = static_cast<std::int32_t>(triangle);
    e.barycentric = in_.numbers<3>("barycentric");
  }

  template <class Moving>
  void read_moving(Moving& e) {
    e.time_s = in_.number("time_s");
    e.position_m = in_.numbers<3>("position_m");
    e.velocity_m_s = in_.numbers<3>("velocity_m_s");
    check_size("position_m", e.position_m);
    check_size("velocity_m_s", e.velocity_m_s);
    e.rotation = in_.numbers<4>("rotation");
  }

  void check_size(std::string_view key, double value, double largest = kMaxAmount) {
    if (!(std::abs(value) <= largest)) in_.fail(key, fmt::format("{:g} exceeds the limit; give {:g} at most", value, largest));
  }
  void check_size(std::string_view key, const Vec3& value) {
    for (const double x : value) check_size(key, x);
  }

  template <class T>
  T finish(const T& event) {
    in_.finish();
    if (const char* fault = find_fault(event); fault != nullptr) in_.fail("", fmt::format("{}; correct the event", fault));
    return event;
  }

  base::Object in_;
  const std::vector<RecordedBody>& bodies_;
};

Event parse_event(base::Object line, const std::vector<RecordedBody>& bodies) {
  const auto finish = [&](const Event& event) {
    line.finish();
    return event;
  };
  if (const auto mark = line.object_if("mark")) return finish(EventReader(*mark, bodies).read_mark());
  if (const auto impulse = line.object_if("impulse")) return finish(EventReader(*impulse, bodies).read_impulse());
  if (const auto force = line.object_if("force")) return finish(EventReader(*force, bodies).read_force());
  if (const auto contact = line.object_if("contact")) return finish(EventReader(*contact, bodies).read_contact());
  if (const auto motion = line.object_if("motion")) return finish(EventReader(*motion, bodies).read_motion());
  if (const auto listener = line.object_if("listener")) return finish(EventReader(*listener, bodies).read_listener());
  line.finish();
  line.fail("", "this line holds no event; give it a mark, an impulse, a force, a contact, a motion or a listener");
}

/// Reads the bodies; returns the number of events, if stated.
std::optional<long long> parse_header(base::Object line, std::vector<RecordedBody>& bodies) {
  line.integer("carillon_contacts", 1, 1);
  const std::optional<long long> count = line.integer_if("events", 0, kInt64);
  for (base::Object& body : line.objects("bodies")) {
    RecordedBody& recorded = bodies.emplace_back();
    recorded.name = body.string("name");
    recorded.triangles = body.integer("triangles", 1, kInt32);
    if (body.has("size_m") || body.has("order_m")) recorded.surface = {body.numbers<3>("size_m"), body.numbers<3>("order_m")};
    body.finish();
  }
  if (bodies.empty()) line.fail("bodies", "there are no bodies; give each a name and the number of triangles of its bank");
  if (static_cast<long long>(bodies.size()) > kMaxBodies) line.fail("bodies", fmt::format("more than {} bodies", kMaxBodies));
  line.finish();
  return count;
}

}  // namespace

SurfaceMark mark_surface(std::span<const Vec3> vertices_m, std::span<const std::array<std::int32_t, 3>> triangles) {
  Vec3 low = vertices_m.front(), high = low, sum{};
  for (const Vec3& vertex : vertices_m) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], vertex[k]);
      high[k] = std::max(high[k], vertex[k]);
    }
  }
  double weights = 0.0;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const auto weight = static_cast<double>(t + 1);
    weights += weight;
    for (const std::int32_t corner : triangles[t]) {
      for (std::size_t k = 0; k < 3; ++k) sum[k] += weight / 3.0 * vertices_m[corner][k];
    }
  }
  SurfaceMark mark;
  for (std::size_t k = 0; k < 3; ++k) {
    mark.size_m[k] = high[k] - low[k];
    mark.order_m[k] = sum[k] / weights;
  }
  return mark;
}

bool is_same_surface(const SurfaceMark& a, const SurfaceMark& b) {
  constexpr double kSlack = 5e-5;  // relative to the size: rounding, or a packed surface
  const double size = std::hypot(calc_length(a.size_m), calc_length(b.size_m));
  for (std::size_t k = 0; k < 3; ++k) {
    if (!(std::abs(a.size_m[k] - b.size_m[k]) <= kSlack * size) || !(std::abs(a.order_m[k] - b.order_m[k]) <= kSlack * size)) return false;
  }
  return true;
}

std::string format_header(const std::vector<RecordedBody>& bodies, std::uint64_t events) {
  std::string text = fmt::format(R"({{"carillon_contacts": 1, "events": {}, "bodies": [)", events);
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const RecordedBody& body = bodies[i];
    fmt::format_to(std::back_inserter(text), R"({}{{"name": {}, "triangles": {})", i == 0 ? "" : ", ", base::quote(body.name),
                   body.triangles);
    if (body.surface) {
      fmt::format_to(std::back_inserter(text), R"(, "size_m": {}, "order_m": {})", format_numbers(body.surface->size_m),
                     format_numbers(body.surface->order_m));
    }
    text += '}';
  }
  return text + "]}\n";
}

void append_line(std::string& text, const Event& event) {
  std::visit([&](const auto& e) { write(std::back_inserter(text), e); }, event);
  text += '\n';
}

std::string format_recording(const Recording& recording) {
  std::string text = format_header(recording.bodies, recording.events.size());
  for (const Event& event : recording.events) append_line(text, event);
  return text;
}

namespace {

/// Line reader of a contacts file.
class Lines {
 public:
  Lines(std::filesystem::path file, const std::function<void(const Event&)>& sink,
        const std::function<void(const std::vector<RecordedBody>&)>& begin)
      : file_(std::move(file)), sink_(sink), begin_(begin) {}

  void take(std::string_view line) {
    ++number_;
    if (line.find_first_not_of(" \t\r") == std::string_view::npos) return;
    const base::Object object = base::parse_document(line, file_, number_).root();
    if (!has_header_) {
      announced_ = parse_header(object, bodies_);
      has_header_ = true;
      if (begin_) begin_(bodies_);
      return;
    }
    const Event event = parse_event(object, bodies_);
    const double time = get_time_s(event);
    if (time < latest_ - kMaxBackS) {
      throw InputError(
          fmt::format("{}:{}: time goes back from {:g} s to {:g} s; put the lines in order", file_.string(), number_, latest_, time));
    }
    latest_ = std::max(latest_, time);
    ++count_;
    sink_(event);
  }

  std::vector<RecordedBody> finish() {
    if (!has_header_) throw InputError(fmt::format("{}:1: the file is empty; it has to begin with the line of its bodies", file_.string()));
    if (announced_ && *announced_ != count_) {
      throw InputError(
          fmt::format("{}:{}: the first line states {} events, found {}; a part of the file is missing, or its \"events\" has "
                      "to be changed or removed",
                      file_.string(), number_, *announced_, count_));
    }
    return std::move(bodies_);
  }

 private:
  std::filesystem::path file_;
  const std::function<void(const Event&)>& sink_;
  const std::function<void(const std::vector<RecordedBody>&)>& begin_;
  std::vector<RecordedBody> bodies_;
  std::optional<long long> announced_;
  long long count_ = 0;
  bool has_header_ = false;
  int number_ = 0;
  double latest_ = -std::numeric_limits<double>::infinity();
};

}  // namespace

Recording parse_recording(std::string_view text, const std::filesystem::path& file) {
  Recording recording;
  const std::function<void(const Event&)> sink = [&](const Event& event) { recording.events.push_back(event); };
  const std::function<void(const std::vector<RecordedBody>&)> none;
  Lines lines(file, sink, none);
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    lines.take(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  recording.bodies = lines.finish();
  return recording;
}

std::vector<RecordedBody> read_recording(const std::filesystem::path& file, const std::function<void(const Event&)>& sink,
                                         const std::function<void(const std::vector<RecordedBody>&)>& begin) {
  Lines lines(file, sink, begin);
  std::string line;
  bool is_begun = false;
  base::read_pieces(file, "contacts file", kReadBytes, [&](std::string_view piece) {
    if (!is_begun) base::refuse_utf16(piece, file.string());
    is_begun = true;
    while (!piece.empty()) {
      const std::size_t end = piece.find('\n');
      if (line.size() + std::min(end, piece.size()) > kMaxLineBytes) {
        throw InputError(fmt::format("{}: a line of more than {} bytes; this is not a contacts file", file.string(), kMaxLineBytes));
      }
      if (end == std::string_view::npos) {
        line += piece;
        return;
      }
      if (line.empty()) {
        lines.take(piece.substr(0, end));
      } else {
        line += piece.substr(0, end);
        lines.take(line);
        line.clear();
      }
      piece.remove_prefix(end + 1);
    }
  });
  if (!line.empty()) lines.take(line);
  return lines.finish();
}

}  // namespace carillon::events
