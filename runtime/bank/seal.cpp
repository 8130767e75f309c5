#include "runtime/bank/seal.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>

#include "runtime/bank/layout.hpp"

namespace carillon::bank {
namespace {

constexpr std::string_view kMagic = "CARILLON BANK ";

/// All of `text` as a decimal number without sign or leading zeros.
template <class Integer>
std::optional<Integer> parse_number(std::string_view text) {
  Integer value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool plain = !text.empty() && text[0] >= '0' && text[0] <= '9' && (text[0] != '0' || text.size() == 1);
  if (!plain || error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> words;
  for (std::size_t start = 0; start <= text.size();) {
    const std::size_t end = std::min(text.find(separator, start), text.size());
    words.push_back(text.substr(start, end - start));
    start = end + 1;
  }
  return words;
}

/// a * b; nullopt above `limit`.
std::optional<std::uint64_t> multiply(std::uint64_t a, std::uint64_t b, std::uint64_t limit) {
  if (a != 0 && b > limit / a) return std::nullopt;
  return a * b;
}

/// "field NAME DTYPE OFFSET [EXTENT ...]"; nullopt unless well-formed and between the seal and the end of the file.
std::optional<std::pair<std::string, Extent>> parse_extent(const std::vector<std::string_view>& words, std::uint64_t length) {
  if (words.size() < 4 || words.size() > 8) return std::nullopt;
  Extent extent;
  extent.dtype = words[2];
  const auto offset = parse_number<std::uint64_t>(words[3]);
  const std::uint64_t item = find_item_bytes(extent.dtype);
  // Extents beyond the file's length are rejected even if another extent is zero.
  if (!offset || item == 0 || item > length) return std::nullopt;
  extent.offset = *offset;
  extent.bytes = item;
  for (std::size_t i = 4; i < words.size(); ++i) {
    const auto size = parse_number<std::uint64_t>(words[i]);
    if (!size || *size > length) return std::nullopt;
    extent.shape.push_back(*size);
    const auto bytes = multiply(extent.bytes, *size, length);
    if (!bytes) return std::nullopt;
    extent.bytes = *bytes;
  }
  if (extent.bytes > 0 && (extent.offset < kSealBytes || extent.offset > length - extent.bytes)) return std::nullopt;
  return std::pair(std::string(words[1]), extent);
}

}  // namespace

Seal parse_seal(std::string_view head, std::uint64_t length, const std::string& name) {
  if (length == 0) throw InputError(fmt::format("{}: the file is empty, not a Carillon bank; write the bank again", name));
  const std::string_view magic = head.substr(0, kMagic.size());
  if (magic != kMagic.substr(0, magic.size())) {
    const bool hdf5 = head.substr(0, 4) == "\x89HDF";
    throw InputError(
        fmt::format("{}: not a Carillon bank: byte 0 does not begin with \"CARILLON BANK\"{}; give a file that carillon-precompute wrote",
                    name, hdf5 ? " (an HDF5 file of another kind, or one whose seal was cut off)" : ""));
  }
  if (length < kSealBytes) {
    throw InputError(fmt::format("{}: truncated: {} bytes, and the seal of a bank alone has {}; copy or write the bank again", name, length,
                                 kSealBytes));
  }
  head = head.substr(0, kSealBytes);
  const auto lines = split(head.substr(0, kTextBytes), '\n');

  Seal seal;
  const auto numbers = split(lines[0].substr(kMagic.size()), '.');
  const auto major = parse_number<int>(numbers[0]);
  const int minor = numbers.size() == 2 ? parse_number<int>(numbers[1]).value_or(-1) : -1;
  if (!major || minor < 0) throw InputError(fmt::format("{}: damaged seal: line 1 names no version; copy or write the bank again", name));
  if (*major > kVersionMajor) {
    throw InputError(fmt::format("{}: written as version {}.{}, this reader knows 1.x and {}.x: update Carillon or write the bank again",
                                 name, *major, minor, kVersionMajor));
  }
  if (*major < 1)
    throw InputError(fmt::format("{}: damaged seal: there was never a version {}.{}; write the bank again", name, *major, minor));
  seal.major = *major;
  seal.minor = minor;

  const auto damaged = [&](std::size_t line, std::string_view what) {
    return InputError(fmt::format("{}: damaged seal: line {} {}; copy or write the bank again", name, line + 1, what));
  };
  if (lines.size() < 2 || !lines[1].starts_with("length ")) throw damaged(1, "does not give the length of the file");
  const auto stated = parse_number<std::uint64_t>(lines[1].substr(7));
  if (!stated) throw damaged(1, "does not give the length of the file");
  if (*stated != length) {
    throw InputError(fmt::format("{}: {}: {} bytes, sealed with {}; copy or write the bank again (or seal it again: docs/bank-format.md)",
                                 name, length < *stated ? "truncated" : "bytes were added", length, *stated));
  }
  seal.length = length;

  std::uint64_t total = kSealBytes;
  for (std::size_t i = 2; i < lines.size(); ++i) {
    const auto words = split(lines[i], ' ');
    if (words[0] != "field") continue;  // padding, or a newer minor version
    auto extent = parse_extent(words, length);
    if (!extent) throw damaged(i, "gives an array that cannot be in this file");
    // Arrays do not overlap, so their sum is bounded by the file, and so is the reader's memory.
    total += extent->second.bytes;
    if (total > length) throw damaged(i, "gives an array that overlaps another");
    if (!seal.extents.insert(std::move(*extent)).second) throw damaged(i, "gives an array a second time");
  }
  seal.digest = head.substr(kTextBytes);
  return seal;
}

std::string format_seal_text(std::uint64_t length, const std::array<int, 2>& version, const std::map<std::string, Extent>& extents) {
  std::string text = fmt::format("{}{}.{}\nlength {}\n", kMagic, version[0], version[1], length);
  for (const auto& [name, extent] : extents) {
    text += fmt::format("field {} {} {}{}{}\n", name, extent.dtype, extent.offset, extent.shape.empty() ? "" : " ",
                        fmt::join(extent.shape, " "));
  }
  if (text.size() > kTextBytes) throw InputError("the table of arrays does not fit into the seal of a bank");
  text.resize(kTextBytes, '\n');
  return text;
}

}  // namespace carillon::bank
