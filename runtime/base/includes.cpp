#include "runtime/base/includes.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <optional>
#include <string_view>

#include "runtime/base/failure.hpp"
#include "runtime/base/fields.hpp"
#include "runtime/base/file.hpp"

namespace carillon::base {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxDepth = 16, kMaxIncludes = 10000;
constexpr std::string_view kWord = "INCLUDE";

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

bool starts_with_word(std::string_view text, std::string_view word) {
  return text.size() >= word.size() && std::equal(word.begin(), word.end(), text.begin(),
                                                  [](char a, char b) { return a == std::toupper(static_cast<unsigned char>(b)); });
}

/// Name of the file that a line includes; empty if the line lacks it, nullopt if the line includes nothing.
std::optional<std::string_view> find_name(std::string_view line, bool has_asterisk) {
  line = trim(line);
  if (has_asterisk) {
    if (!line.starts_with('*')) return std::nullopt;
    line = trim(line.substr(1));
  }
  if (!starts_with_word(line, kWord)) return std::nullopt;
  line.remove_prefix(kWord.size());
  if (!has_asterisk) {
    const std::size_t quote = line.find_first_of("'\"");
    const std::size_t end = quote == std::string_view::npos ? 0 : line.find(line[quote], quote + 1);
    if (end != std::string_view::npos) line = trim(line.substr(0, line.find('$', end)));  // without a comment
    return line.empty() || (!is_blank(line[0]) && line[0] != '\'' && line[0] != '"') ? std::nullopt : std::optional(unquote(line));
  }
  line = trim(line);
  if (!line.starts_with(',')) return line.empty() ? std::optional(line) : std::nullopt;
  line = trim(line.substr(1));
  if (!starts_with_word(line, "INPUT")) return std::string_view();
  line = trim(line.substr(5));
  return line.starts_with('=') ? unquote(line.substr(1)) : std::string_view();
}

class Joiner {
 public:
  Joiner(bool has_asterisk, std::uint64_t max_bytes) : has_asterisk_(has_asterisk), max_bytes_(max_bytes) {}

  void add(const fs::path& file, std::string bytes) {
    open_.push_back(file.lexically_normal());
    const std::vector<std::size_t> lines = find_lines(bytes);
    if (lines.empty() && out_.text.empty()) {
      out_ = {std::move(bytes), {{0, file.string(), 1}}};
      open_.pop_back();
      return;
    }
    std::size_t begin = 0, line = 1;
    const auto append = [&](std::size_t end) {
      out_.origins.push_back({out_.text.size(), file.string(), line});
      out_.text.append(bytes, begin, end - begin);
      line += static_cast<std::size_t>(
          std::count(bytes.begin() + static_cast<std::ptrdiff_t>(begin), bytes.begin() + static_cast<std::ptrdiff_t>(end), '\n'));
    };
    for (const std::size_t at : lines) {
      append(at);
      const std::size_t end = std::min(bytes.find('\n', at), bytes.size());
      include(file, line, *find_name(std::string_view(bytes).substr(at, end - at), has_asterisk_));
      begin = std::min(end + 1, bytes.size());
      ++line;
    }
    append(bytes.size());
    open_.pop_back();
  }

  JoinedText take() { return std::move(out_); }

 private:
  /// Beginnings of the lines that include a file.
  std::vector<std::size_t> find_lines(std::string_view bytes) const {
    std::vector<std::size_t> lines;
    for (std::size_t at = 0; at < bytes.size();) {
      const std::size_t end = std::min(bytes.find('\n', at), bytes.size());
      std::size_t first = at;
      while (first < end && is_blank(bytes[first])) ++first;
      const char c = first < end ? bytes[first] : '\0';
      if ((has_asterisk_ ? c == '*' : c == 'I' || c == 'i') && find_name(bytes.substr(at, end - at), has_asterisk_)) lines.push_back(at);
      at = end + 1;
    }
    return lines;
  }

  void include(const fs::path& from, std::size_t line, std::string_view name) {
    const std::string place = fmt::format("{}:{}", from.string(), line);
    if (name.empty())
      throw PlacedError(place,
                        has_asterisk_ ? "*INCLUDE names no file; give *INCLUDE, INPUT=file" : "INCLUDE names no file; give INCLUDE 'file'");
    const fs::path file = find_folder(from) / fs::path(std::string(name));
    if (open_.size() >= kMaxDepth || std::find(open_.begin(), open_.end(), file.lexically_normal()) != open_.end())
      throw PlacedError(place, fmt::format("{} is included {}; remove the line", file.string(),
                                           open_.size() >= kMaxDepth ? fmt::format("at depth {}", kMaxDepth) : "by itself"));
    if (++includes_ > kMaxIncludes) throw PlacedError(place, fmt::format("more than {} included files; join them", kMaxIncludes));
    std::string bytes;
    try {
      bytes = read_file(file, "included file", max_bytes_ - std::min<std::uint64_t>(max_bytes_, out_.text.size()));
    } catch (const InputError& error) {
      throw PlacedError(place, fmt::format("the included file cannot be read: {}", error.what()));
    }
    if (!bytes.empty() && bytes.back() != '\n') bytes += '\n';
    if (!out_.text.empty() && out_.text.back() != '\n') out_.text += '\n';
    if (out_.text.size() > max_bytes_ - std::min<std::uint64_t>(max_bytes_, bytes.size()))
      throw PlacedError(place, "the included files are too large together; remove a line that is included repeatedly");
    add(file, std::move(bytes));
  }

  bool has_asterisk_;
  std::uint64_t max_bytes_;
  JoinedText out_;
  std::size_t includes_ = 0;
  std::vector<fs::path> open_;  // files being joined, outermost first
};

}  // namespace

bool may_include(const fs::path& file) {
  const std::string ending = find_extension(file);
  return ending == ".inp" || ending == ".bdf" || ending == ".nas";
}

JoinedText join_includes(const fs::path& file, std::string bytes, std::uint64_t max_bytes) {
  Joiner joiner(find_extension(file) == ".inp", max_bytes);
  joiner.add(file, std::move(bytes));
  return joiner.take();
}

std::string find_place(std::string_view text, const std::string& name, std::span<const TextOrigin> origins, std::size_t place) {
  place = std::min(place, text.size());
  const auto after =
      std::upper_bound(origins.begin(), origins.end(), place, [](std::size_t at, const TextOrigin& origin) { return at < origin.begin; });
  const TextOrigin whole{0, name, 1};
  const TextOrigin& origin = after == origins.begin() ? whole : *(after - 1);
  const auto at = [&](std::size_t position) { return text.begin() + static_cast<std::ptrdiff_t>(position); };
  return fmt::format("{}:{}", origin.file, origin.first_line + static_cast<std::size_t>(std::count(at(origin.begin), at(place), '\n')));
}

JoinedText read_joined(const fs::path& file, std::string_view what, std::uint64_t max_bytes) {
  std::string bytes = read_file(file, what, max_bytes);
  if (!may_include(file)) return {std::move(bytes), {{0, file.string(), 1}}};
  return join_includes(file, std::move(bytes), max_bytes);
}

}  // namespace carillon::base
