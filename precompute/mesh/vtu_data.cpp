// Method: ascii numbers; base64 in groups of four characters, padding allowed between header and data; zlib blocks. LZ4 and LZMA data and
//   unsigned 64-bit integers above 2^63 - 1 are refused.
// Source: VTK file formats, "XML File Formats" (The VTK User's Guide); RFC 4648 section 4; zlib's uncompress().

#include "precompute/mesh/vtu_data.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace carillon::mesh {

namespace {

constexpr std::size_t kZlibRatio = 1040;  // deflate's maximum expansion is 1032 (zlib, "Technical Details")

std::array<signed char, 256> make_base64_values() {
  std::array<signed char, 256> values{};
  values.fill(-1);
  constexpr std::string_view kLetters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (std::size_t i = 0; i < kLetters.size(); ++i) values[static_cast<unsigned char>(kLetters[i])] = static_cast<signed char>(i);
  return values;
}

/// Byte stream over raw data or base64 text.
class ByteStream {
 public:
  ByteStream(std::string_view source, bool base64) : source_(source), base64_(base64) {}

  /// Upper bound of the remaining bytes.
  std::size_t remaining() const { return base64_ ? ready_.size() - used_ + (source_.size() - at_) / 4 * 3 + 3 : source_.size() - at_; }

  /// Appends the next `count` bytes to `out`; false if there are fewer.
  bool take(std::size_t count, std::string& out) {
    if (!base64_) {
      if (count > source_.size() - at_) return false;
      out.append(source_.substr(at_, count));
      at_ += count;
      return true;
    }
    while (ready_.size() - used_ < count)
      if (!decode_four()) return false;
    out.append(ready_, used_, count);
    used_ += count;
    if (used_ == ready_.size()) {
      ready_.clear();
      used_ = 0;
    }
    return true;
  }

 private:
  bool decode_four() {
    static const std::array<signed char, 256> kValues = make_base64_values();
    std::array<int, 4> value{};
    int padding = 0;
    for (int k = 0; k < 4;) {
      if (at_ >= source_.size()) return false;
      const auto c = static_cast<unsigned char>(source_[at_++]);
      if (c == ' ' || c == '\n' || c == '\r' || c == '\t') continue;
      if (c == '=' && k >= 2) {
        ++padding;
        value[k++] = 0;
        continue;
      }
      if (kValues[c] < 0 || padding > 0) return false;
      value[k++] = kValues[c];
    }
    const unsigned bits = static_cast<unsigned>(value[0]) << 18 | static_cast<unsigned>(value[1]) << 12 |
                          static_cast<unsigned>(value[2]) << 6 | static_cast<unsigned>(value[3]);
    ready_ += static_cast<char>(bits >> 16 & 0xff);
    if (padding < 2) ready_ += static_cast<char>(bits >> 8 & 0xff);
    if (padding < 1) ready_ += static_cast<char>(bits & 0xff);
    return true;
  }

  std::string_view source_;
  bool base64_;
  std::size_t at_ = 0;
  std::string ready_;
  std::size_t used_ = 0;
};

std::size_t type_bytes(const std::string& type) {
  if (type == "Int8" || type == "UInt8") return 1;
  if (type == "Int16" || type == "UInt16") return 2;
  if (type == "Int32" || type == "UInt32" || type == "Float32") return 4;
  if (type == "Int64" || type == "UInt64" || type == "Float64") return 8;
  return 0;
}

template <class Stored, class T>
std::vector<T> convert(std::string_view bytes, const std::string& name, bool swap, std::size_t count, std::size_t place,
                       const Cursor& file) {
  Cursor numbers(bytes, file.name());
  numbers.set_binary(swap);
  std::vector<T> values(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto value = numbers.raw<Stored>("a number");
    if constexpr (std::is_same_v<Stored, std::uint64_t>)
      if (value > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()))
        file.fail(place, "DataArray '{}' holds the number {}, beyond 64 signed bits; write the mesh again", name, value);
    values[i] = static_cast<T>(value);
  }
  return values;
}

}  // namespace

VtuData::VtuData(const Cursor& file, VtuEncoding encoding, std::string_view appended)
    : file_(file), encoding_(encoding), appended_(appended), budget_((encoding.zlib ? kZlibRatio : 16) * (file.bytes().size() + 64)) {}

void VtuData::spend(std::size_t bytes, std::size_t place) {
  if (bytes > budget_)
    file_.fail(place, "the DataArrays ask for more data than a file of {} bytes can hold; it was damaged: write the mesh again",
               file_.bytes().size());
  budget_ -= bytes;
}

std::string VtuData::decode(const std::string& name, const std::string& format, std::string_view text, std::uint64_t offset,
                            std::size_t expected, std::size_t place) {
  const bool appended = format == "appended";
  if (appended && offset >= appended_.size())
    file_.fail(place,
               "DataArray '{}' lies at offset {} of the appended data, which ends at {}; the file was cut short: write or copy it again",
               name, offset, appended_.size());
  ByteStream stream(appended ? appended_.substr(offset) : text, !(appended && encoding_.appended_raw));
  const auto cut_short = [&] {
    file_.fail(place, "the data of DataArray '{}' end too early or are not valid base64; the file was cut short or damaged: write it again",
               name);
  };
  const auto header = [&](std::size_t words) {
    std::string bytes;
    if (words > stream.remaining() / static_cast<std::size_t>(encoding_.header_bytes) ||
        !stream.take(words * static_cast<std::size_t>(encoding_.header_bytes), bytes))
      cut_short();
    Cursor cursor(bytes, file_.name());
    cursor.set_binary(encoding_.swap_bytes);
    std::vector<std::uint64_t> values(words);
    for (auto& value : values)
      value = encoding_.header_bytes == 4 ? cursor.raw<std::uint32_t>("a size") : cursor.raw<std::uint64_t>("a size");
    return values;
  };
  const auto mismatch = [&](std::uint64_t found) {
    file_.fail(place, "DataArray '{}' holds {} bytes where the counts of the file ask for {}; the file was damaged: write the mesh again",
               name, found, expected);
  };
  std::string bytes;
  if (!encoding_.zlib) {
    const std::uint64_t size = header(1)[0];
    if (size != expected) mismatch(size);
    if (size > stream.remaining()) cut_short();
    spend(size, place);
    if (!stream.take(static_cast<std::size_t>(size), bytes)) cut_short();
    return bytes;
  }
  const std::uint64_t block_count = header(1)[0];
  if (block_count == 0) {
    if (expected != 0) mismatch(0);
    return bytes;
  }
  const auto sizes = header(2);
  if (block_count > stream.remaining() / static_cast<std::size_t>(encoding_.header_bytes)) cut_short();
  const auto packed = header(static_cast<std::size_t>(block_count));
  const std::uint64_t last = sizes[1] == 0 ? sizes[0] : sizes[1];
  // Sum of block_count - 1 full blocks and the last one equals `expected`; written without an overflowing product.
  if (last > expected ||
      (block_count > 1 &&
       (sizes[0] == 0 || (expected - last) / (block_count - 1) != sizes[0] || (expected - last) % (block_count - 1) != 0)) ||
      (block_count == 1 && last != expected))
    mismatch(last);
  std::uint64_t room = 0;
  for (const auto size : packed) {
    if (size > stream.remaining() - std::min<std::uint64_t>(room, stream.remaining())) cut_short();
    room += size;
  }
  if (expected / kZlibRatio > room) mismatch(room);
  spend(expected, place);
  bytes.resize(expected);
  std::size_t at = 0;
  std::string block;
  for (std::size_t b = 0; b < packed.size(); ++b) {
    const std::size_t want = b + 1 == packed.size() ? last : sizes[0];
    block.clear();
    if (!stream.take(static_cast<std::size_t>(packed[b]), block)) cut_short();
    uLongf got = want;
    if (uncompress(reinterpret_cast<Bytef*>(bytes.data() + at), &got, reinterpret_cast<const Bytef*>(block.data()), block.size()) != Z_OK ||
        got != want)
      file_.fail(place, "block {} of DataArray '{}' is not valid zlib data; the file was damaged: write or copy it again", b + 1, name);
    at += want;
  }
  return bytes;
}

template <class T>
std::vector<T> VtuData::read(const std::string& name, const std::string& type, const std::string& format, std::string_view text,
                             std::uint64_t offset, std::size_t count, std::size_t place) {
  const std::size_t width = type_bytes(type);
  const bool real = type == "Float32" || type == "Float64";
  if (width == 0 || (real && std::is_integral_v<T>))
    file_.fail(place, "DataArray '{}' is of type '{}'; it has to be {}: write the mesh again", name, type,
               std::is_integral_v<T> ? "Int8 to UInt64" : "Float32 or Float64");
  if (count > std::numeric_limits<std::size_t>::max() / width / 8)
    file_.fail(place, "DataArray '{}' announces {} numbers; write the mesh again", name, count);
  if (format == "ascii") {
    if (count > text.size() / 2 + 1)
      file_.fail(place, "DataArray '{}' needs {} numbers and has room for {} at most; the file was cut short or damaged: write it again",
                 name, count, text.size() / 2 + 1);
    spend(count * sizeof(T), place);
    std::vector<T> values(count);
    // The text belongs to the parsed XML, not to the file: errors name the array's line.
    Cursor numbers(text, file_.name());
    std::size_t done = 0;
    try {
      for (; done < count; ++done) {
        if constexpr (std::is_integral_v<T>) {
          values[done] = numbers.text_int("a number", INT64_MIN, INT64_MAX);
        } else {
          values[done] = numbers.text_real("a number");
        }
      }
    } catch (const InputError&) {
      file_.fail(place, "number {} of DataArray '{}' is missing or damaged ({} are needed); write the mesh again", done + 1, name, count);
    }
    if (numbers.skip_space())
      file_.fail(place, "DataArray '{}' holds more than the {} numbers it should; write the mesh again", name, count);
    return values;
  }
  if (format != "binary" && format != "appended")
    file_.fail(place, "DataArray '{}' has the format '{}'; only ascii, binary and appended are read: write the mesh again", name, format);
  const std::string bytes = decode(name, format, text, offset, count * width, place);
  spend(count * sizeof(T), place);
  const auto make = [&]<class Stored>(Stored) { return convert<Stored, T>(bytes, name, encoding_.swap_bytes, count, place, file_); };
  if constexpr (!std::is_integral_v<T>) {
    if (type == "Float32") return make(float{});
    if (type == "Float64") return make(double{});
  }
  if (type == "Int8") return make(std::int8_t{});
  if (type == "UInt8") return make(std::uint8_t{});
  if (type == "Int16") return make(std::int16_t{});
  if (type == "UInt16") return make(std::uint16_t{});
  if (type == "Int32") return make(std::int32_t{});
  if (type == "UInt32") return make(std::uint32_t{});
  if (type == "Int64") return make(std::int64_t{});
  return make(std::uint64_t{});
}

template std::vector<double> VtuData::read(const std::string&, const std::string&, const std::string&, std::string_view, std::uint64_t,
                                           std::size_t, std::size_t);
template std::vector<std::int64_t> VtuData::read(const std::string&, const std::string&, const std::string&, std::string_view,
                                                 std::uint64_t, std::size_t, std::size_t);

}  // namespace carillon::mesh
