// Method: one function lists the fields of each event, for both directions.
#include "runtime/bindings/web/event_words.hpp"

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <type_traits>
#include <variant>

#include "runtime/base/error.hpp"

namespace carillon::web {
namespace {

constexpr std::size_t kHead = 4;  // length, kind, timing, time
constexpr double kHalf = 4294967296.0;

[[noreturn]] void refuse(const char* what) { throw InputError(std::string("invalid event row: ") + what); }

/// Writes fields as words.
struct Writer {
  std::vector<double>* words;
  void field(double x) { words->push_back(x); }
  void field(std::int32_t x) { words->push_back(x); }
  void field(bool x) { words->push_back(x ? 1.0 : 0.0); }
  void field(std::uint64_t x) {
    words->push_back(static_cast<double>(x >> 32));
    words->push_back(static_cast<double>(x & 0xffffffffU));
  }
  template <class Choice>
  requires std::is_enum_v<Choice>
  void field(Choice x, Choice) { words->push_back(static_cast<double>(x)); }
  template <std::size_t n>
  void field(const std::array<double, n>& x) {
    words->insert(words->end(), x.begin(), x.end());
  }
  void steps(const events::Force& force) {
    for (int k = 0; k < force.count; ++k)
      for (const float x : force.impulse_n_s[k]) words->push_back(static_cast<double>(x));
  }
};

/// Reads fields from words.
struct Reader {
  std::span<const double> left;
  double take() {
    if (left.empty()) refuse("too short");
    const double x = left.front();
    left = left.subspan(1);
    return x;
  }
  /// An integer from `low` to `high`.
  double take_whole(double low, double high) {
    const double x = take();
    if (!(x >= low && x <= high) || x != std::floor(x)) refuse("index or choice out of range");
    return x;
  }
  void field(double& x) { x = take(); }
  void field(std::int32_t& x) {
    x = static_cast<std::int32_t>(take_whole(-1.0, static_cast<double>(std::numeric_limits<std::int32_t>::max())));
  }
  void field(bool& x) { x = take_whole(0.0, 1.0) != 0.0; }
  void field(std::uint64_t& x) {
    const auto high = static_cast<std::uint64_t>(take_whole(0.0, kHalf - 1.0));
    x = high << 32 | static_cast<std::uint64_t>(take_whole(0.0, kHalf - 1.0));
  }
  template <class Choice>
  requires std::is_enum_v<Choice>
  void field(Choice& x, Choice last) { x = static_cast<Choice>(take_whole(0.0, static_cast<double>(last))); }
  template <std::size_t n>
  void field(std::array<double, n>& x) {
    for (double& one : x) one = take();
  }
  void steps(events::Force& force) {
    const std::size_t count = left.size() / 3;
    if (left.size() % 3 != 0 || count < 1 || count > events::kMaxForceSteps) refuse("a force has 1 to 16 steps of three numbers");
    force.count = static_cast<std::int16_t>(count);
    for (std::size_t k = 0; k < count; ++k)
      for (float& x : force.impulse_n_s[k]) x = static_cast<float>(take());
  }
};

template <class Way, class Event>
void pass_fields(Way& way, Event& event) {
  using Kind = std::remove_const_t<Event>;
  if constexpr (std::is_same_v<Kind, events::Impulse>) {
    way.field(event.body), way.field(event.other), way.field(event.triangle), way.field(event.shape, events::PulseShape::kGaussian);
    way.field(event.barycentric), way.field(event.impulse_n_s), way.field(event.duration_s);
  } else if constexpr (std::is_same_v<Kind, events::Force>) {
    way.field(event.step_s), way.field(event.body), way.field(event.other), way.field(event.triangle);
    way.field(event.continues), way.field(event.barycentric), way.steps(event);
  } else if constexpr (std::is_same_v<Kind, events::LastingContact>) {
    way.field(event.id), way.field(event.body), way.field(event.other), way.field(event.triangle);
    way.field(event.state, events::ContactState::kEnd), way.field(event.barycentric), way.field(event.normal);
    way.field(event.slip_m_s), way.field(event.force_n), way.field(event.sweep_m_s), way.field(event.other_sweep_m_s);
    way.field(event.spin_rad_s), way.field(event.patch_radius_m), way.field(event.impedance_n_s_m);
  } else if constexpr (std::is_same_v<Kind, events::BodyMotion>) {
    way.field(event.body), way.field(event.position_m), way.field(event.velocity_m_s), way.field(event.rotation);
  } else if constexpr (std::is_same_v<Kind, events::Listener>) {
    way.field(event.position_m), way.field(event.velocity_m_s), way.field(event.rotation);
  }
}

template <std::size_t kKind>
events::Event read_event(std::span<const double> fields, double time_s) {
  std::variant_alternative_t<kKind, events::Event> event{};
  Reader reader{fields};
  event.time_s = time_s;
  pass_fields(reader, event);
  if (!reader.left.empty()) refuse("too long");
  return event;
}

}  // namespace

void append_words(std::vector<double>& words, const events::Event& event, Timing timing) {
  const std::size_t begin = words.size();
  words.insert(words.end(), {0.0, static_cast<double>(event.index()), static_cast<double>(timing), events::get_time_s(event)});
  Writer writer{&words};
  std::visit([&](const auto& one) { pass_fields(writer, one); }, event);
  words[begin] = static_cast<double>(words.size() - begin);
}

void read_words(std::span<const double> words, const std::function<void(const events::Event&, Timing)>& sink) {
  while (!words.empty()) {
    const double length = words[0];
    if (!(length >= static_cast<double>(kHead) && length <= static_cast<double>(words.size())) || length != std::floor(length))
      refuse("wrong length");
    const std::span<const double> row = words.first(length), fields = row.subspan(kHead);
    words = words.subspan(row.size());
    if (row[2] != 0.0 && row[2] != 1.0) refuse("unknown timing");
    const Timing timing = row[2] == 0.0 ? Timing::kExact : Timing::kSoon;
    if (row[1] == 0.0)
      sink(read_event<0>(fields, row[3]), timing);
    else if (row[1] == 1.0)
      sink(read_event<1>(fields, row[3]), timing);
    else if (row[1] == 2.0)
      sink(read_event<2>(fields, row[3]), timing);
    else if (row[1] == 3.0)
      sink(read_event<3>(fields, row[3]), timing);
    else if (row[1] == 4.0)
      sink(read_event<4>(fields, row[3]), timing);
    else if (row[1] == 5.0)
      sink(read_event<5>(fields, row[3]), timing);
    else
      refuse("unknown kind");
  }
}

}  // namespace carillon::web
