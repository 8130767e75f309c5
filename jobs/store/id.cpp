#include "jobs/store/id.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cctype>

#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/sha256.hpp"

namespace carillon::store {
namespace {

constexpr std::size_t kIdDigits = 64;
constexpr std::size_t kPieceBytes = 1 << 20;

}  // namespace

std::optional<Id> parse_id(std::string_view text) {
  const auto is_digit = [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); };
  if (text.size() != kIdDigits || !std::all_of(text.begin(), text.end(), is_digit)) return std::nullopt;
  return Id(std::string(text));
}

Id require_id(std::string_view text, const std::string& where) {
  if (auto id = parse_id(text)) return *id;
  throw InputError(fmt::format("{}: not an id of {} hex digits", where, kIdDigits));
}

std::string make_input_name(const Id& sha256, const std::string& format) {
  const bool is_plain =
      format.size() <= 8 && std::all_of(format.begin(), format.end(), [](unsigned char c) { return std::isalnum(c) != 0; });
  return sha256.text() + (format.empty() || !is_plain ? "" : "." + (format == "tetgen" ? std::string("node") : format));
}

Id hash_text(std::string_view text) { return *parse_id(base::to_hex(base::calc_sha256(text))); }

Id hash_file(const std::filesystem::path& file, std::string_view what, const std::function<void(std::string_view)>& take) {
  base::Sha256 sha;
  base::read_pieces(file, what, kPieceBytes, [&](std::string_view bytes) {
    sha.add(bytes);
    if (take) take(bytes);
  });
  return *parse_id(base::to_hex(sha.finish()));
}

std::string make_random_name() {
  std::array<unsigned char, 16> bytes{};
  if (::getentropy(bytes.data(), bytes.size()) != 0) throw SystemError("getentropy fails; check the machine");
  return base::to_hex(bytes);
}

}  // namespace carillon::store
