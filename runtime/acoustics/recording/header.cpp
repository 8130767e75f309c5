// Text header: one "name value" per line.
#include "runtime/acoustics/recording/header.hpp"

#include <fmt/format.h>

#include <charconv>
#include <map>
#include <optional>

#include "runtime/base/error.hpp"

namespace carillon::recording {
namespace {

constexpr std::string_view kMagic = "CARILLON SURFACE ";
constexpr std::string_view kAgain = "copy the file or run carillon-simulate again";
constexpr std::uint64_t kMost = std::uint64_t{1} << 40;  // largest count: products of three stay below 2^127, and are checked

template <class Number>
std::optional<Number> parse_number(std::string_view text) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

Header::Shape Header::get_shape(Array array) const {
  const auto make = [](const char* name, const char* type, std::array<std::uint64_t, 3> extent) {
    Shape shape{name, type, extent, static_cast<std::uint64_t>(type[2] - '0')};
    for (const std::uint64_t n : extent)
      if (n > 0) shape.bytes = n > kMost || shape.bytes > (std::uint64_t{1} << 62) / n ? std::uint64_t{1} << 62 : shape.bytes * n;
    return shape;
  };
  switch (array) {
    case Array::kTriangle:
      return make("triangle", "<i4", {triangles, 3, 0});
    case Array::kTriangleBody:
      return make("triangle_body", "<i4", {triangles, 0, 0});
    case Array::kVertexBody:
      return make("vertex_body", "<i4", {vertices, 0, 0});
    case Array::kArea:
      return make("area", "<f8", {triangles, 0, 0});
    case Array::kRadius:
      return make("radius", "<f8", {bodies, 0, 0});
    case Array::kCentre:
      return make("centre", "<f8", {count_keys(), bodies, 3});
    case Array::kStep:
      return make("step", "<f8", {count_keys(), bodies, 0});
    case Array::kPlace:
      return make("place", "<i2", {count_keys(), vertices, 3});
    case Array::kScale:
      return make("scale", "<f4", {count_blocks(), triangles, 0});
    case Array::kAcceleration:
      break;
  }
  return make("acceleration", "<i2", {count_blocks(), triangles, kBlockFrames});
}

std::string format_header(const Header& header) {
  std::string text = fmt::format(
      "{}1.0\nlength {}\nsample_rate_hz {}\nair_density_kg_m3 {}\nsound_speed_m_s {}\nframes {}\nkey_frames {}\nvertices {}\n"
      "triangles {}\nbodies {}\n",
      kMagic, header.length, header.sample_rate_hz, header.air_density_kg_m3, header.sound_speed_m_s, header.frames, header.key_frames,
      header.vertices, header.triangles, header.bodies);
  for (std::size_t i = 0; i < kArrays; ++i) text += fmt::format("{} {}\n", header.get_shape(static_cast<Array>(i)).name, header.offset[i]);
  text.resize(kTextBytes, '\n');
  return text;
}

Header parse_header(std::string_view head, std::uint64_t length, const std::string& name) {
  if (length == 0) throw InputError(fmt::format("{}: the file is empty, not a recorded surface; {}", name, kAgain));
  const std::string_view magic = head.substr(0, kMagic.size());
  if (magic != kMagic.substr(0, magic.size())) {
    throw InputError(fmt::format(
        "{}: not a recorded surface: byte 0 does not begin with \"CARILLON SURFACE\"; give a .surface.hdf file of carillon-simulate",
        name));
  }
  if (length < kHeaderBytes || head.size() < kHeaderBytes)
    throw InputError(fmt::format("{}: truncated: {} bytes, the header alone has {}; {}", name, length, kHeaderBytes, kAgain));

  std::map<std::string_view, std::string_view> values;
  std::string_view text = head.substr(kMagic.size(), kTextBytes - kMagic.size());
  const std::string_view version = text.substr(0, text.find('\n'));
  const std::string_view major = version.substr(0, version.find('.'));
  if (!parse_number<unsigned>(major)) throw InputError(fmt::format("{}: damaged header: no version in line 1; {}", name, kAgain));
  if (major != "1")
    throw InputError(fmt::format("{}: written as version {}, this reader knows 1.x; update Carillon", name, version.substr(0, 20)));
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    const std::size_t blank = line.find(' ');
    if (blank == line.npos) continue;
    if (!values.emplace(line.substr(0, blank), line.substr(blank + 1)).second)
      throw InputError(fmt::format("{}: damaged header: duplicate line; {}", name, kAgain));
  }
  const auto damaged = [&](const char* key) {
    return InputError(fmt::format("{}: damaged header: {} is missing or out of range; {}", name, key, kAgain));
  };
  const auto get_count = [&](const char* key) {
    const auto found = values.find(key);
    const auto value = found == values.end() ? std::nullopt : parse_number<std::uint64_t>(found->second);
    if (!value || *value == 0 || *value > kMost) throw damaged(key);
    return *value;
  };
  const auto get_real = [&](const char* key, double least, double most) {
    const auto found = values.find(key);
    const auto value = found == values.end() ? std::nullopt : parse_number<double>(found->second);
    if (!value || !(*value >= least && *value <= most)) throw damaged(key);
    return *value;
  };
  Header header;
  header.length = get_count("length");
  if (header.length != length) {
    throw InputError(fmt::format("{}: {}: {} bytes, sealed with {}; {}", name, length < header.length ? "truncated" : "bytes were added",
                                 length, header.length, kAgain));
  }
  header.sample_rate_hz = get_real("sample_rate_hz", 1000.0, 1e6);
  header.air_density_kg_m3 = get_real("air_density_kg_m3", 1e-6, 1e6);
  header.sound_speed_m_s = get_real("sound_speed_m_s", 1e-3, 1e6);
  header.frames = get_count("frames");
  header.key_frames = get_count("key_frames");
  if (header.key_frames > 65536) throw damaged("key_frames");
  header.vertices = get_count("vertices");
  header.triangles = get_count("triangles");
  header.bodies = get_count("bodies");
  std::uint64_t total = kHeaderBytes;
  for (std::size_t i = 0; i < kArrays; ++i) {
    const Header::Shape shape = header.get_shape(static_cast<Array>(i));
    header.offset[i] = get_count(shape.name);
    // Arrays do not overlap, so their sum is at most the file length, which bounds the reader's memory.
    total += std::min(shape.bytes, length);
    if (header.offset[i] < kHeaderBytes || shape.bytes > length || header.offset[i] > length - shape.bytes || total > length) {
      throw InputError(fmt::format("{}: damaged header: the array {} exceeds the file; {}", name, shape.name, kAgain));
    }
  }
  return header;
}

}  // namespace carillon::recording
